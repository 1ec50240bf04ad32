//! The surface of a piece of ground, cut out of the world.

use glam::IVec3;

use super::bits::Samples;
use super::search::{self, Component};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, ChunkGrid, Column, ONE};
use crate::surface::plain::CubeMesh;
use crate::surface::vertex::{Lattice, vertex};
use crate::surface::{SurfaceMesh, cases};
use crate::volume::{SampleView, layers};

/// Density of what lies beyond the world's sides. The piece ends at its last sample there, not halfway to the next.
const BEYOND: i32 = i32::MAX / 4;

/// The world as it is, but with air around the piece.
struct Piece<'a> {
    view: SampleView<'a>,
    grid: ChunkGrid,
    samples: Samples,
}

impl Piece<'_> {
    fn contains(&self, point: IVec3) -> bool {
        let own = self.samples.get(&BrickPos::of(point));
        own.is_some_and(|own| layers::contains(own, BrickPos::index(point)))
    }

    fn is_in_world(&self, point: IVec3) -> bool {
        (0..=self.grid.width()).contains(&point.x) && (0..=self.grid.depth()).contains(&point.z)
    }
}

impl Lattice for Piece<'_> {
    fn distance(&self, point: IVec3) -> i32 {
        if !self.is_in_world(point) {
            return BEYOND;
        }
        let own = self.view.distance(point);
        // Other ground does not touch the piece; it would only affect normals.
        if own < 0 && !self.contains(point) { ONE } else { own }
    }
    fn is_edited(&self, point: IVec3) -> bool {
        !self.is_in_world(point) || self.view.is_edited(point)
    }
    fn stored_material(&self, point: IVec3) -> MaterialId {
        self.view.stored_material(point)
    }
    fn ground(&self) -> &Ground {
        self.view.ground()
    }
    /// A piece has no border to a heightmap.
    fn is_volumetric(&self, _: Column) -> Option<bool> {
        None
    }
}

/// The closed marching-cubes surface of a piece alone, with its vertices at their positions in the world.
pub(super) fn closed(view: SampleView, grid: ChunkGrid, piece: &Component, origin: IVec3) -> SurfaceMesh {
    let samples = search::bricks(piece).map(|(pos, layers)| (pos, *layers)).collect();
    let piece_view = Piece { view, grid, samples };
    let mut mesh = CubeMesh::new();
    for (pos, layers) in search::bricks(piece) {
        for index in layers::indices(layers) {
            let point = pos.origin() + layers::offset(index);
            cubes_of(&piece_view, point, |cube, case| {
                mesh.add(cube, case, |start, axis| vertex(&piece_view, start, axis, origin));
            });
        }
    }
    mesh.into()
}

/// The cubes around a sample of the piece that hold surface, with their cases. Of the samples that are corners of a
/// cube, only the first gets it.
fn cubes_of(piece: &Piece, point: IVec3, mut each: impl FnMut(IVec3, usize)) {
    let mut around = [false; 27];
    for (i, own) in (0..).zip(&mut around) {
        *own = piece.contains(point + IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1));
    }
    if around.iter().all(|&own| own) {
        return;
    }
    for corner in 0..8 {
        // Where the cube's lowest corner is among the 27.
        let [x, y, z] = cases::corner(corner).map(|step| (1 - step) as usize);
        let case = (0..8).fold(0, |case, other| {
            let [dx, dy, dz] = cases::corner(other).map(|step| step as usize);
            case | usize::from(around[x + dx + (y + dy) * 3 + (z + dz) * 9]) << other
        });
        if case.trailing_zeros() as usize == corner {
            each(point - IVec3::from_array(cases::corner(corner)), case);
        }
    }
}
