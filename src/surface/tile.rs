//! Tiles: the heightmap's triangles outside the mask, with rings along its border (rule 3).
//!
//! A tile's vertices are its columns, in rows along x; digging never moves them. The few vertices that rings need on
//! the mask's border follow after the columns. A transaction rebuilds only the list of indices: whole cells first, then
//! the rings, of which it computes those near its edits and copies the others.
//!
//! On a ground with strata or a material function, steep cells are drawn with the rings, wherever they are: in bands,
//! since their corners alone do not show the beds between them (`cell_outline`).

use std::cmp::Ordering;

use glam::IVec3;

use super::cell_outline::CellOutline;
use super::indices::Indices;
use super::mask::Borders;
use super::mesh::{MaterialMix, SurfaceMesh, Vertex};
use super::vertex::{DIAGONAL, WorldView, sheet_vertex};
use crate::ground::{Ground, RowBuffer};
use crate::lattice::{ChunkGrid, Column, ONE, SNAP, TilePos};

pub use super::cell_outline::fan;

/// The whole mesh of a tile, relative to its lowest column at y = 0. Empty where the mask covers all of it, and where
/// the world has no such tile.
pub fn mesh(world: &WorldView, tile: TilePos) -> SurfaceMesh {
    if !world.grid.has_tile(tile) {
        return SurfaceMesh::default();
    }
    let borders = borders(world, tile);
    let rings = Rings::new(world, tile, &borders);
    let vertices = vertices(world.samples.ground(), world.grid, tile, &rings);
    SurfaceMesh { vertices, indices: indices(world.grid, tile, &borders, &rings) }
}

/// The vertices of a tile: those of its columns, x fastest, then those of its rings.
pub fn vertices(ground: &Ground, grid: ChunkGrid, tile: TilePos, rings: &Rings) -> Vec<Vertex> {
    let (low, high) = grid.tile_cells(tile);
    let (columns, mut buffer) = (column_count(low, high) as usize, RowBuffer::default());
    let mut vertices = Vec::with_capacity(columns + rings.vertices.len());
    let width = columns / (high.z - low.z + 1).max(1) as usize;
    for z in low.z..=high.z {
        let row = ground.row(Column::new(low.x, z), width, &mut buffer);
        vertices.extend((0..).zip(row).map(|(x, (height, normal, material))| Vertex {
            position: IVec3::new(x * SNAP, height * (SNAP / ONE), (z - low.z) * SNAP),
            normal,
            materials: MaterialMix::column(material),
        }));
    }
    vertices.extend_from_slice(&rings.vertices);
    vertices
}

/// How many columns a tile has; none outside the world, where its cells end before they begin.
fn column_count(low: Column, high: Column) -> u32 {
    let along = |low: i32, high: i32| if low < high { (high - low + 1) as u32 } else { 0 };
    along(low.x, high.x) * along(low.z, high.z)
}

/// Which of a tile's cells are in the mask or steep, or border on such cells.
pub fn borders(world: &WorldView, tile: TilePos) -> Borders {
    let (low, high) = world.grid.tile_cells(tile);
    let steep = world.samples.ground().steep_cells();
    world.mask.borders(low, high, |word| steep.map_or(0, |steep| steep.word(word)))
}

/// The triangles outside the mask: two for each whole cell, row by row, then the rings, steep cells included.
pub fn indices(grid: ChunkGrid, tile: TilePos, borders: &Borders, rings: &Rings) -> Indices {
    let (low, high) = grid.tile_cells(tile);
    let vertices = column_count(low, high) as usize + rings.vertices.len();
    let cells = (high.x - low.x).max(0) as u32;
    let width = cells + 1;
    let corners = |a: u32| [a, a + width, a + width + 1, a + width + 1, a + 1, a];
    let mut first = Indices::with_capacity(vertices, cells as usize * 6);
    (0..cells).for_each(|a| first.extend(&corners(a)));
    let count = first.len() * (high.z - low.z).max(0) as usize + rings.fans.len();
    let mut indices = Indices::with_capacity(vertices, count);
    for z in low.z..high.z {
        let base = (z - low.z) as usize * width as usize;
        // Runs of whole cells are the first row's, moved.
        for run in borders.whole(z) {
            let corners = (run.start - low.x) as usize * 6..(run.end - low.x) as usize * 6;
            indices.extend_moved(&first, corners, 0, base);
        }
    }
    indices.extend(&rings.fans);
    indices
}

/// The rings of one tile: triangles of steep cells and of those that border on them or on the mask, and the vertices
/// they have there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rings {
    vertices: Vec<Vertex>,
    /// Three for each triangle; columns count first, then the rings' own vertices.
    fans: Vec<u32>,
    patches: Vec<Patch>,
}

/// Vertices for which updated rings reserve room.
const ROOM: usize = 64;

/// The rings of 8x8 cells of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Patch {
    /// Where the patch is, as (z, x).
    at: (i32, i32),
    /// Where the patch's vertices end.
    vertices: usize,
    /// Where the patch's triangles end.
    fans: usize,
}

impl Rings {
    /// All rings of a tile.
    pub fn new(world: &WorldView, tile: TilePos, borders: &Borders) -> Self {
        let (low, high) = world.grid.tile_cells(tile);
        let mut drawing = Drawing::new(world, tile, borders);
        drawing.rings.vertices.reserve(ROOM);
        drawing.rings.fans.reserve(12 * ROOM);
        for z in low.z >> 3..=(high.z - 1) >> 3 {
            for x in low.x >> 3..=(high.x - 1) >> 3 {
                drawing.patch((z, x));
            }
        }
        drawing.finish()
    }

    /// These rings, with those of some patches of 8x8 cells made again: `(z, x)` in units of 8 cells,
    /// ascending.
    pub(crate) fn updated(
        &self,
        world: &WorldView,
        tile: TilePos,
        borders: &Borders,
        patches: &[(i32, i32)],
    ) -> Self {
        let mut drawing = Drawing::new(world, tile, borders);
        drawing.rings.vertices.reserve(self.vertices.len() + ROOM);
        drawing.rings.fans.reserve(self.fans.len() + 3 * ROOM);
        drawing.rings.patches.reserve(self.patches.len() + patches.len());
        let (mut own, mut next_patch) = (0, 0);
        loop {
            let next = match (self.patches.get(own), patches.get(next_patch)) {
                (None, None) => return drawing.finish(),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (Some(patch), Some(at)) => patch.at.cmp(at),
            };
            if next == Ordering::Less {
                drawing.copy(self, own);
            } else {
                drawing.patch(patches[next_patch]);
                next_patch += 1;
            }
            own += usize::from(next != Ordering::Greater);
        }
    }

    /// Returns `true` if no cell of the tile borders on the mask, and none is steep.
    pub fn is_empty(&self) -> bool {
        self.patches.is_empty()
    }

    /// The vertices that follow after the tile's columns.
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// The triangles of the rings: the tile's columns count first, then these rings' own vertices.
    pub(crate) fn fans(&self) -> &[u32] {
        &self.fans
    }

    /// Bytes of the rings, their buffers included.
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.vertices.capacity() * size_of::<Vertex>()
            + self.fans.capacity() * size_of::<u32>()
            + self.patches.capacity() * size_of::<Patch>()
    }
}

/// Rings under construction.
struct Drawing<'a> {
    ground: &'a Ground,
    borders: &'a Borders,
    low: Column,
    high: Column,
    /// The number of the first vertex after the columns.
    base: u32,
    rings: Rings,
    /// The lines of the cell under work.
    outline: CellOutline<Numbered>,
    /// Sides of a patch's cells that have vertices: 81 along x and as many along z. Those with numbers below the
    /// patch's first were of an earlier one. Empty where no cell is steep: there, only the mask's border has vertices,
    /// and each side of it but once.
    sides: Vec<Side>,
    /// The number that the patch's first vertex has, or would have.
    first: u32,
}

/// The vertices of a cell's side, which two cells of a patch share: numbered one after the other, up or down.
#[derive(Clone, Copy, Default)]
struct Side {
    /// The number of the side's first vertex.
    number: u32,
    /// The y of the level that the side lies on.
    y: i32,
}

impl<'a> Drawing<'a> {
    fn new(world: &WorldView<'a>, tile: TilePos, borders: &'a Borders) -> Self {
        let (low, high) = world.grid.tile_cells(tile);
        let (base, ground) = (column_count(low, high), world.samples.ground());
        let outline = CellOutline::with_capacity(ROOM);
        let sides = if ground.steep_cells().is_some() { vec![Side::default(); 2 * 81] } else { Vec::new() };
        Self { ground, borders, low, high, base, rings: Rings::default(), outline, sides, first: base }
    }

    /// The rings, without room for more: they are kept until the next edit nearby.
    fn finish(mut self) -> Rings {
        self.rings.vertices.shrink_to_fit();
        self.rings.fans.shrink_to_fit();
        self.rings.patches.shrink_to_fit();
        self.rings
    }

    /// Copies a patch.
    fn copy(&mut self, from: &Rings, number: usize) {
        let end = &from.patches[number];
        let (vertex, fan) = match number.checked_sub(1) {
            Some(before) => (from.patches[before].vertices, from.patches[before].fans),
            None => (0, 0),
        };
        let moved = (self.rings.vertices.len() as u32).wrapping_sub(vertex as u32);
        let shift = |&index: &u32| if index < self.base { index } else { index.wrapping_add(moved) };
        self.rings.fans.extend(from.fans[fan..end.fans].iter().map(shift));
        self.rings.vertices.extend_from_slice(&from.vertices[vertex..end.vertices]);
        self.close(end.at);
    }

    /// Draws the rings of 8x8 cells.
    fn patch(&mut self, at: (i32, i32)) {
        self.first = self.base + self.rings.vertices.len() as u32;
        self.borders.bordering(at).for_each(|(cell, flags)| self.cell(cell, flags));
        self.close(at);
    }

    fn close(&mut self, at: (i32, i32)) {
        let fans = self.rings.fans.len();
        if self.rings.patches.last().map_or(0, |patch| patch.fans) != fans {
            self.rings.patches.push(Patch { at, vertices: self.rings.vertices.len(), fans });
        }
    }

    /// Draws a cell's two triangles, with vertices on the lines that its flags name.
    fn cell(&mut self, cell: Column, flags: u8) {
        let (ground, low, base, first) = (self.ground, self.low, self.base, self.first);
        let (rings, sides) = (&mut self.rings, &mut self.sides);
        let width = (self.high.x - low.x + 1) as u32;
        let corner = |column: Column, height: i32| Numbered {
            number: (column.z - low.z) as u32 * width + (column.x - low.x) as u32,
            height: height * (SNAP / ONE),
        };
        let start = Column::new(cell.x & !7, cell.z & !7);
        self.outline.trace(ground, cell, flags, corner, |p, axis| {
            let next = base + rings.vertices.len() as u32;
            let number = match axis {
                DIAGONAL => next,
                _ if sides.is_empty() => next,
                _ => {
                    let side = &mut sides[axis / 2 * 81 + ((p.z - start.z) * 9 + p.x - start.x) as usize];
                    if side.number < first {
                        *side = Side { number: next, y: p.y };
                    }
                    side.number + side.y.abs_diff(p.y)
                }
            };
            if number == next {
                rings.vertices.push(sheet_vertex(ground, p, axis, low.at(0)));
            }
            Numbered { number, height: p.y * SNAP }
        });
        let numbers = |triangle: [Numbered; 3]| {
            rings.fans.extend_from_slice(&triangle.map(|vertex| vertex.number));
        };
        self.outline.triangles(|vertex| vertex.height, numbers);
    }
}

/// A vertex of a cell's outline.
#[derive(Clone, Copy)]
struct Numbered {
    number: u32,
    /// In 1/4096 voxel.
    height: i32,
}

#[cfg(test)]
mod tests {
    use super::super::vertex::height_vertex;
    use super::*;
    use crate::ground::NoiseHeights;

    #[test]
    fn columns_are_the_heightmaps_own_vertices() {
        let noise = NoiseHeights { seed: 3, scale: 12.0, amplitude: 20.0, ..NoiseHeights::default() };
        let ground = Ground::from_noise(50, 37, &noise).expect("valid hills");
        let grid = ChunkGrid::new(16, 50, 37);
        for tile in grid.tiles() {
            let (low, high) = grid.tile_cells(tile);
            let columns = (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| Column::new(x, z)));
            let expected: Vec<Vertex> =
                columns.map(|column| height_vertex(&ground, column, low.at(0))).collect();
            let found = vertices(&ground, grid, tile, &Rings::default());
            assert_eq!(found.len(), expected.len(), "{tile:?}");
            assert!(found.iter().zip(&expected).all(|(own, other)| own.is_same(other)), "{tile:?}");
        }
    }
}
