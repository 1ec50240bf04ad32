//! Marching cubes over a block by the book: cube by cube, sample by sample.
//!
//! [`block`](super::block) draws the same with the same bits, many times faster. This is what it is checked against, and
//! what to read first.

use glam::IVec3;

use super::cases::{self, Edge};
use super::indices::Indices;
use super::mask::cell_sheet;
use super::mesh::{SurfaceMesh, Vertex};
use super::vertex::{Lattice, WorldView, over_the_rim, vertex};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BRICK, BrickPos, Column, LatticeBox};
use crate::volume::{Brick, Sample};

/// Samples along one side of the apron: 9 corners, one more below and above for the gradients.
const SIDE: i32 = BRICK + 3;
const AREA: usize = (SIDE * SIDE) as usize;
const VOLUME: usize = AREA * SIDE as usize;

/// The samples around a block, copied out of their bricks.
struct PaddedSamples<'a> {
    world: &'a WorldView<'a>,
    low: IVec3,
    distances: [i32; VOLUME],
    edited: [bool; VOLUME],
}

impl<'a> PaddedSamples<'a> {
    fn gather(world: &'a WorldView<'a>, brick: BrickPos) -> Self {
        let low = brick.origin() - 1;
        let mut apron = Self { world, low, distances: [0; VOLUME], edited: [false; VOLUME] };
        let ground = world.samples.ground();
        let bricks: [Option<&Brick>; 27] = std::array::from_fn(|i| {
            let i = i as i32;
            world.samples.brick(BrickPos(brick.0 + IVec3::new(i % 3 - 1, i / 9 - 1, i / 3 % 3 - 1)))
        });
        for z in 0..SIDE {
            for x in 0..SIDE {
                let column = Column::new(low.x + x, low.z + z);
                let surface = ground.distance(column.at(0));
                let stack = ((z + 7) / 8 * 3 + (x + 7) / 8) as usize;
                for y in 0..SIDE {
                    let point = column.at(low.y + y);
                    let sample = bricks[(y + 7) as usize / 8 * 9 + stack]
                        .map_or(Sample::PRISTINE, |b| b.sample(point));
                    let at = ((y * SIDE + z) * SIDE + x) as usize;
                    apron.edited[at] = sample != Sample::PRISTINE;
                    apron.distances[at] =
                        sample.distance().unwrap_or_else(|| surface + point.y * crate::lattice::ONE);
                }
            }
        }
        apron
    }

    fn index(&self, point: IVec3) -> usize {
        let at = point - self.low;
        ((at.y * SIDE + at.z) * SIDE + at.x) as usize
    }

    /// The case of a cube, and whether one of its corners is edited.
    fn cube(&self, low: IVec3) -> (usize, bool) {
        let at = self.index(low);
        let (mut case, mut edited) = (0, false);
        for corner in 0..8 {
            let [x, y, z] = cases::corner(corner).map(|step| step as usize);
            let at = at + (y * SIDE as usize + z) * SIDE as usize + x;
            case |= usize::from(self.distances[at] < 0) << corner;
            edited |= self.edited[at];
        }
        (case, edited)
    }
}

impl Lattice for PaddedSamples<'_> {
    fn distance(&self, point: IVec3) -> i32 {
        over_the_rim(self.world.grid, point, |point| self.distances[self.index(point)])
    }
    fn is_edited(&self, point: IVec3) -> bool {
        self.edited[self.index(point)]
    }
    fn stored_material(&self, point: IVec3) -> MaterialId {
        self.world.stored_material(point)
    }
    fn ground(&self) -> &Ground {
        self.world.samples.ground()
    }
    fn is_volumetric(&self, cell: Column) -> Option<bool> {
        self.world.is_volumetric(cell)
    }
}

/// Vertices already made in a block, by lattice edge.
struct VertexCache {
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
    numbers: Vec<u32>,
    low: IVec3,
    origin: IVec3,
}

impl VertexCache {
    const SIDE: i32 = BRICK + 1;
    const NONE: u32 = u32::MAX;

    fn number(&mut self, apron: &PaddedSamples, cube: IVec3, edge: Edge) -> u32 {
        let (corner, axis) = cases::edge_corners(edge);
        let p = cube + IVec3::from_array(cases::corner(corner));
        let at = p - self.low;
        let slot = &mut self.numbers[(((at.y * Self::SIDE + at.z) * Self::SIDE + at.x) * 3) as usize + axis];
        if *slot == Self::NONE {
            *slot = self.vertices.len() as u32;
            self.vertices.push(vertex(apron, p, axis, self.origin));
        }
        *slot
    }
}

/// Meshes the cells `cells` of a brick, relative to the chunk's lowest lattice point `origin`.
pub fn mesh(world: &WorldView, brick: BrickPos, cells: LatticeBox, origin: IVec3) -> SurfaceMesh {
    debug_assert!(brick.samples().encloses(cells));
    let apron = PaddedSamples::gather(world, brick);
    let side = VertexCache::SIDE as usize;
    let mut cache = VertexCache {
        vertices: Vec::new(),
        indices: Vec::new(),
        numbers: vec![VertexCache::NONE; side * side * side * 3],
        low: brick.origin(),
        origin,
    };
    let table = cases::table();
    for z in cells.min.z..=cells.max.z {
        for x in cells.min.x..=cells.max.x {
            let cell = Column::new(x, z);
            let sheet =
                if world.mask.contains(cell) { cell_sheet(apron.ground(), cell) } else { i32::MAX..i32::MAX };
            for y in cells.min.y..=cells.max.y {
                let cube = cell.at(y);
                let (case, edited) = apron.cube(cube);
                if case == 0 || case == 255 || !(edited || sheet.contains(&y)) {
                    continue;
                }
                for triangle in table[case].triangles() {
                    let numbers = triangle.map(|edge| cache.number(&apron, cube, edge));
                    cache.indices.extend_from_slice(&numbers);
                }
            }
        }
    }
    SurfaceMesh { indices: Indices::new(cache.vertices.len(), cache.indices), vertices: cache.vertices }
}
