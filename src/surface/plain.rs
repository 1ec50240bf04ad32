//! A simple reference implementation of marching cubes, cube by cube.
//!
//! [`block`](super::block) draws the same surface with the same bits, many times faster. [`mesh`] is what it is checked
//! against, and what to read first.

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::cases;
use super::indices::Indices;
use super::mask::cell_sheet;
use super::mesh::{SurfaceMesh, Vertex};
use super::vertex::{Lattice, WorldView, vertex};
use crate::lattice::{BRICK, BrickPos, Column, LatticeBox};

/// The triangles of some cubes, with one vertex for each lattice edge that they cross.
pub(crate) struct CubeMesh<V> {
    pub vertices: Vec<V>,
    pub indices: Vec<u32>,
    /// The number of each edge's vertex, by the edge's lower end and axis.
    numbers: FxHashMap<(IVec3, usize), u32>,
}

impl<V> CubeMesh<V> {
    /// A mesh without triangles.
    pub fn new() -> Self {
        Self { vertices: Vec::new(), indices: Vec::new(), numbers: FxHashMap::default() }
    }

    /// Adds the triangles of the cube at `low`; `vertex` makes the vertex of an edge that is crossed for the first
    /// time.
    pub fn add(&mut self, low: IVec3, case: usize, mut vertex: impl FnMut(IVec3, usize) -> V) {
        for edge in cases::table()[case].triangles().flatten() {
            let (start, axis) = cases::lattice_edge(low, edge);
            let number = *self.numbers.entry((start, axis)).or_insert_with(|| {
                self.vertices.push(vertex(start, axis));
                self.vertices.len() as u32 - 1
            });
            self.indices.push(number);
        }
    }
}

impl From<CubeMesh<Vertex>> for SurfaceMesh {
    fn from(CubeMesh { vertices, indices, .. }: CubeMesh<Vertex>) -> Self {
        Self { indices: Indices::new(vertices.len(), indices), vertices }
    }
}

/// Meshes the cells `cells` of a brick, relative to the chunk's lowest lattice point `origin`.
pub fn mesh(world: &WorldView, brick: BrickPos, cells: LatticeBox, origin: IVec3) -> SurfaceMesh {
    debug_assert!(brick.samples().encloses(cells));
    const SIDE: i32 = BRICK + 1;
    let index = |point: IVec3| {
        let at = point - brick.origin();
        ((at.y * SIDE + at.z) * SIDE + at.x) as usize
    };
    // Each corner is shared by up to eight cubes, and looked up once.
    let mut solid = [false; (SIDE * SIDE * SIDE) as usize];
    for point in (LatticeBox { min: cells.min, max: cells.max + 1 }).points() {
        solid[index(point)] = world.distance(point) < 0;
    }
    let mut mesh = CubeMesh::new();
    for z in cells.min.z..=cells.max.z {
        for x in cells.min.x..=cells.max.x {
            let cell = Column::new(x, z);
            let sheet = world.mask.contains(cell).then(|| cell_sheet(world.ground(), cell));
            for y in cells.min.y..=cells.max.y {
                let cube = cell.at(y);
                let case = cases::case_of(cube, |corner| solid[index(corner)]);
                if case == 0 || case == 255 {
                    continue;
                }
                let is_in_sheet = sheet.as_ref().is_some_and(|rows| rows.contains(&y));
                let mut corners = LatticeBox { min: cube, max: cube + 1 }.points();
                if is_in_sheet || corners.any(|corner| world.is_edited(corner)) {
                    mesh.add(cube, case, |start, axis| vertex(world, start, axis, origin));
                }
            }
        }
    }
    mesh.into()
}
