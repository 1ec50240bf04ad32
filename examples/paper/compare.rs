//! Full fields against the hybrid: do they hold the same ground, and is the same drawn?

use std::collections::HashMap;

use bevy_burrow::lattice::{Column, SNAP};
use bevy_burrow::surface::{SurfaceMesh, Vertex};
use bevy_burrow::terrain::{Drawn, World};
use glam::IVec3;

use crate::edits::{Run, Scene};
use crate::error::PaperError;
use crate::full::{DenseField, FullWorld, stored};
use crate::play;
use crate::published::CHUNK_SIZES;

/// How far the dense field and a world agree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Ground {
    /// Lattice points that were compared.
    pub points: usize,
    /// Points that are solid in one and air in the other.
    pub otherwise_solid: usize,
    /// Points of another density.
    pub otherwise_dense: usize,
}

impl Ground {
    /// Looks at every lattice point of the cube.
    pub fn compare(field: &DenseField, world: &World) -> Self {
        let view = world.samples();
        let mut ground = Self::default();
        for (point, here) in field.points() {
            let there = stored(view.distance(point));
            ground.points += 1;
            ground.otherwise_solid += usize::from((here < 0) != (there < 0));
            ground.otherwise_dense += usize::from(here != there);
        }
        ground
    }
}

/// How far a world of marching cubes alone draws what the hybrid draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Surface {
    /// Triangles of marching cubes that the hybrid draws.
    pub triangles: usize,
    /// Those that the full field lacks.
    pub missing: usize,
    /// Triangles of the full field that the hybrid lacks, though its marching cubes draw their cells.
    pub extra: usize,
    /// Corners of the hybrid's triangles that have other materials in the full field.
    pub other_materials: usize,
    /// The same for normals, off the border between marching cubes and heightmap. At the border they are the heightmap's.
    pub other_normals: usize,
}

/// Three positions in the world, the lowest first, in the order in which they are run through.
type Key = [[i32; 3]; 3];

/// Triangles by their positions; each holds its corners in the same order.
fn keyed(mesh: &SurfaceMesh, origin: IVec3) -> impl Iterator<Item = (Key, [Vertex; 3])> {
    mesh.triangles().map(move |mut corners| {
        for corner in &mut corners {
            corner.position += origin * SNAP;
        }
        let place = |corner: &Vertex| corner.position.to_array();
        let first = (0..3).min_by_key(|&i| place(&corners[i])).unwrap_or(0);
        corners.rotate_left(first);
        (corners.each_ref().map(place), corners)
    })
}

impl Surface {
    /// Looks at every triangle.
    pub fn compare(full: &FullWorld, world: &World) -> Self {
        let mut surface = Self::default();
        let mut others: HashMap<Key, [Vertex; 3]> = keyed(&full.mesh(), IVec3::ZERO).collect();
        for chunk in world.drawn_chunks() {
            let (mesh, origin) = (world.chunk_mesh(chunk), world.origin(Drawn::Chunk(chunk)));
            for (key, here) in keyed(&mesh, origin) {
                surface.triangles += 1;
                let Some(there) = others.remove(&key) else {
                    surface.missing += 1;
                    continue;
                };
                for (here, there) in here.iter().zip(&there) {
                    surface.other_materials += usize::from(here.materials != there.materials);
                    let differs = here.normal != there.normal && !is_at_border(world, here.position);
                    surface.other_normals += usize::from(differs);
                }
            }
        }
        surface.extra = others.keys().filter(|key| !is_heightmap(world, key)).count();
        surface
    }

    pub fn is_the_same(self) -> bool {
        self.triangles > 0 && self.missing + self.extra + self.other_materials + self.other_normals == 0
    }
}

/// The cells that touch a place over the ground, of which there are up to four; `scale` steps make a voxel.
fn cells_at(world: &World, x: i32, z: i32, scale: i32) -> impl Iterator<Item = Column> {
    let low = move |at: i32| (at - 1).div_euclid(scale);
    let cells = (low(z)..=z.div_euclid(scale)).flat_map(move |cell_z| {
        (low(x)..=x.div_euclid(scale)).map(move |cell_x| Column::new(cell_x, cell_z))
    });
    let grid = world.grid();
    cells.filter(move |&cell| grid.has_cell(cell))
}

/// Does the hybrid draw a cell here as heightmap and another one as marching cubes?
fn is_at_border(world: &World, position: IVec3) -> bool {
    let volumetric = |wanted| {
        cells_at(world, position.x, position.z, SNAP).any(|cell| world.mask().contains(cell) == wanted)
    };
    volumetric(true) && volumetric(false)
}

/// Does the hybrid draw the cell of this triangle as heightmap?
fn is_heightmap(world: &World, key: &Key) -> bool {
    // Three times the middle of the triangle, which lies in its cell or on its rim.
    let [x, _, z] = [0, 1, 2].map(|axis| key.iter().map(|corner| corner[axis]).sum::<i32>());
    cells_at(world, x, z, 3 * SNAP).any(|cell| !world.mask().contains(cell))
}

/// Plays both runs on both full fields and on a terrain, and compares all that there is after each.
pub fn all(scene: &Scene) -> Result<[(Ground, Surface); 2], PaperError> {
    let mut field = DenseField::new(&scene.ground)?;
    let mut full = FullWorld::new(scene)?;
    let mut terrain = scene.terrain(CHUNK_SIZES[0])?;
    let mut found = [(Ground::default(), Surface::default()); 2];
    for (run, found) in Run::BOTH.into_iter().zip(&mut found) {
        let brushes = scene.brushes(run);
        play::bare(&mut field, &brushes)?;
        play::same(&mut full, &brushes);
        terrain.apply(&brushes);
        let world = terrain.world();
        *found = (Ground::compare(&field, world), Surface::compare(&full, world));
    }
    Ok(found)
}
