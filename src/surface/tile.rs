//! Tiles: the heightmap's triangles outside the mask, with rings along its border (rule 3).
//!
//! A tile's vertices are its columns, in rows along x; digging never moves them. What a transaction rebuilds is the list
//! of indices; the few vertices that rings need on the mask's border follow after the columns.

use glam::IVec3;

use super::mask::{Borders, sheet};
use super::mesh::{SurfaceMesh, Vertex};
use super::vertex::{WorldView, height_vertex, vertex};
use crate::ground::Ground;
use crate::lattice::{Column, ONE, TilePos};

/// The whole mesh of a tile, relative to its lowest column at y = 0. May be empty, when the mask covers all of it.
pub fn mesh(world: &WorldView, tile: TilePos) -> SurfaceMesh {
    let mut mesh = SurfaceMesh { vertices: columns(world, tile), indices: Vec::new() };
    let (indices, ring) = indices(world, tile);
    mesh.vertices.extend_from_slice(&ring);
    mesh.indices = indices;
    mesh
}

/// The vertices of a tile's columns, x fastest.
pub fn columns(world: &WorldView, tile: TilePos) -> Vec<Vertex> {
    let (low, high) = world.grid.tile_cells(tile);
    let ground = world.samples.ground();
    let row = move |z| (low.x..=high.x).map(move |x| height_vertex(ground, Column::new(x, z), low.at(0)));
    (low.z..=high.z).flat_map(row).collect()
}

/// The triangles outside the mask, and the vertices of rings that they need after those of [`columns`].
pub fn indices(world: &WorldView, tile: TilePos) -> (Vec<u32>, Vec<Vertex>) {
    let (low, high) = world.grid.tile_cells(tile);
    let width = (high.x - low.x + 1) as u32;
    let mut ring =
        Ring { world, origin: low.at(0), base: width * (high.z - low.z + 1) as u32, vertices: Vec::new() };
    let cells = ((high.x - low.x) * (high.z - low.z)) as usize;
    let mut whole: Vec<[u32; 6]> = Vec::with_capacity(cells);
    let mut fans: Vec<u32> = Vec::new();
    let borders = world.mask.borders(low, high);
    for z in low.z..high.z {
        let row = (z - low.z) as u32 * width;
        for (x, &flags) in (low.x..high.x).zip(borders.row(z)) {
            let a = row + (x - low.x) as u32;
            let [a, b, c, d] = [a, a + width, a + width + 1, a + 1];
            if flags == 0 {
                whole.push([a, b, c, c, d, a]);
                continue;
            }
            if flags & Borders::VOLUMETRIC != 0 {
                continue;
            }
            let [ca, cb, cc, cd] = Column::new(x, z).corners();
            let ends = [(a, ca, b, cb), (b, cb, c, cc), (c, cc, d, cd), (d, cd, a, ca)];
            let [ab, bc, cd, da] = std::array::from_fn(|side| {
                let (start, from, end, to) = ends[side];
                ring.side(start, from, end, to, flags >> side & 1 == 1)
            });
            fan(&ab, &bc, |triangle| fans.extend_from_slice(&triangle));
            fan(&cd, &da, |triangle| fans.extend_from_slice(&triangle));
        }
    }
    let mut indices = whole.into_flattened();
    indices.extend_from_slice(&fans);
    (indices, ring.vertices)
}

/// The ring vertices of one tile.
struct Ring<'a> {
    world: &'a WorldView<'a>,
    origin: IVec3,
    base: u32,
    vertices: Vec<Vertex>,
}

impl Ring<'_> {
    /// One side of a heightmap cell as vertex numbers: straight, or the polyline that a volumetric cell draws there.
    fn side(&mut self, start: u32, from: Column, end: u32, to: Column, bordered: bool) -> Vec<u32> {
        let mut line = vec![start];
        if bordered {
            line.extend(self.chain(from, to));
        }
        line.push(end);
        line
    }

    /// The vertices strictly between two heightmap vertices.
    fn chain(&mut self, from: Column, to: Column) -> Vec<u32> {
        let number = |(p, axis)| {
            self.vertices.push(vertex(self.world, p, axis, self.origin));
            self.base + self.vertices.len() as u32 - 1
        };
        chain(self.world.samples.ground(), from, to).into_iter().map(number).collect()
    }
}

/// The lattice edges whose crossings lie strictly between two neighbouring heightmap vertices, in order: one for each
/// lattice y that separates their heights, as lower end and axis.
pub fn chain(ground: &Ground, from: Column, to: Column) -> Vec<(IVec3, usize)> {
    let (h_from, h_to) = (ground.height(from), ground.height(to));
    let axis = if from.x != to.x { 0 } else { 2 };
    let low = Column::new(from.x.min(to.x), from.z.min(to.z));
    let separates = |y: &i32| (y * ONE < h_from) != (y * ONE < h_to);
    let mut edges: Vec<_> = sheet([h_from, h_to]).filter(separates).map(|y| (low.at(y), axis)).collect();
    if h_to < h_from {
        edges.reverse();
    }
    edges
}

/// Rule 3: a triangle with legs P..R and R..Q, each straight or a polyline; Q-P is straight.
pub fn fan<T: Copy>(first: &[T], second: &[T], mut emit: impl FnMut([T; 3])) {
    // Q when the second leg is straight; else its first inner vertex, and P fans the rest of it.
    let apex = second[1];
    for pair in first.windows(2) {
        emit([pair[0], pair[1], apex]);
    }
    for pair in second[1..].windows(2) {
        emit([first[0], pair[0], pair[1]]);
    }
}
