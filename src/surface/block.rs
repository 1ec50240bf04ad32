//! Marching cubes over blocks: the cells of one brick that lie in one chunk.
//!
//! A block draws every cube that touches an edited sample and, in the mask, every cube of the sheet. All other cubes of
//! the world are the tile's, or hold no surface. [`plain`](super::plain) says the same cube by cube and sample by
//! sample; this is the fast way, with the same bits:
//!
//! 1. Bricks keep the signs of their samples as bits. A few operations on 81-bit layers find the cubes to draw, and the
//!    lattice edges that their vertices lie on.
//! 2. Samples are copied out of the bricks, and only the layers that those edges need.
//! 3. Edges are listed by axis; vertices are made from the lists, several at a time, and so each just once.
//! 4. Triangles look their vertices' numbers up by lattice edge.

use std::sync::LazyLock;

use super::brick_window::{self, Window};
use super::cases::{self, Case};
use super::crossings::{Crossings, Edge};
use super::layer_bits::{self, LayerBits, X, Z};
use super::mesh::Vertex;
use super::neighbours::Neighbours;
use super::padded_samples::PaddedSamples;
use super::stack::Stack;
use super::vertex::WorldView;
use crate::lattice::{BrickPos, ChunkPos, Column, LatticeBox};

/// A block to be meshed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// The brick whose cells are meshed.
    pub brick: BrickPos,
    /// The chunk that draws them.
    pub chunk: ChunkPos,
}

/// The surface of one block, as ranges of a [`Parts`]. It may be empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The block.
    pub block: Block,
    /// Where the part's vertices end; they begin where those of the part before end.
    pub vertices: usize,
    /// Where the part's indices end.
    pub indices: usize,
}

/// Surfaces of blocks, one after the other. Vertices are shared by the triangles of a block; those on its faces are
/// repeated in its neighbour, with the same bits.
#[derive(Clone, Debug, Default)]
pub struct Parts {
    /// One part for each block, in order.
    pub list: Vec<Part>,
    /// Vertices, local to their chunks.
    pub vertices: Vec<Vertex>,
    /// Three for each triangle, counted within the part.
    pub indices: Vec<u16>,
}

impl Parts {
    /// An empty list with room for about this many vertices and their indices.
    pub fn with_room(vertices: usize) -> Self {
        Self {
            list: Vec::with_capacity(vertices / 32),
            vertices: Vec::with_capacity(vertices),
            indices: Vec::with_capacity(vertices * 6),
        }
    }

    /// Forgets all parts and keeps the memory.
    pub fn clear(&mut self) {
        self.list.clear();
        self.vertices.clear();
        self.indices.clear();
    }

    /// The vertices and indices of the part with this number, if there is one.
    pub fn get(&self, number: usize) -> Option<(&[Vertex], &[u16])> {
        let part = self.list.get(number)?;
        let before = number.checked_sub(1).and_then(|before| self.list.get(before));
        let (vertex, index) = before.map_or((0, 0), |before| (before.vertices, before.indices));
        Some((self.vertices.get(vertex..part.vertices)?, self.indices.get(index..part.indices)?))
    }

    /// Each part with its vertices and its indices.
    pub fn iter(&self) -> impl Iterator<Item = (Block, &[Vertex], &[u16])> {
        self.list.iter().enumerate().filter_map(|(number, part)| {
            let (vertices, indices) = self.get(number)?;
            Some((part.block, vertices, indices))
        })
    }
}

/// Meshes blocks; keeps its working memory from one call to the next.
#[derive(Default)]
pub struct Mesher {
    samples: PaddedSamples,
    crossings: Crossings,
    numbers: Numbers,
    window: Window<'static>,
}

impl Mesher {
    /// Meshes blocks and adds their parts to `out`, in the same order. Blocks of one stack of bricks should follow each
    /// other, from below.
    pub fn mesh(&mut self, view: &WorldView, blocks: &[Block], out: &mut Parts) {
        let (mut blocks, mut window) = (blocks, std::mem::take(&mut self.window).emptied());
        while let Some((count, places)) = brick_window::shared(blocks.iter().map(|block| block.brick)) {
            let (near, others) = blocks.split_at(count);
            window = window.moved(&view.samples, places);
            for stack in near.chunk_by(|a, b| stack_of(a.brick) == stack_of(b.brick)) {
                self.mesh_stack(view, &window, stack, out);
            }
            blocks = others;
        }
        self.window = window.emptied();
    }

    fn mesh_stack(&mut self, view: &WorldView, window: &Window, blocks: &[Block], out: &mut Parts) {
        let Some(first) = blocks.first() else { return };
        let mut stack = Stack::new(view, stack_of(first.brick));
        for brick in blocks.chunk_by(|a, b| a.brick == b.brick) {
            let mut around = Neighbours::corners_of(window, brick[0].brick);
            let cubes = Cubes::find(&stack, &around, brick[0].brick);
            if cubes.is_some() {
                around.complete(window);
            }
            for &block in brick {
                let cells = block.brick.samples().intersection(view.grid.chunk_cells(block.chunk));
                if let (Some(cubes), Some(cells)) = (&cubes, cells) {
                    let origin = view.grid.origin(block.chunk);
                    self.mesh_block(&mut stack, &around, cubes, block.brick, cells, origin, out);
                }
                out.list.push(Part { block, vertices: out.vertices.len(), indices: out.indices.len() });
            }
        }
    }

    fn mesh_block(
        &mut self,
        stack: &mut Stack,
        around: &Neighbours,
        cubes: &Cubes,
        brick: BrickPos,
        cells: LatticeBox,
        origin: glam::IVec3,
        out: &mut Parts,
    ) {
        let drawn = cubes.within(cells, brick);
        let filled = |y: &usize| drawn[*y] != 0;
        let (Some(bottom), Some(top)) = ((0..8).find(filled), (0..8).rfind(filled)) else { return };
        let all = drawn.iter().fold(0, |all, layer| all | layer);
        let (near, far) = (all.trailing_zeros() / Z, all.ilog2() / Z);
        // The padded samples start one before the cells; the gradients at the corners beyond them look one further.
        let rows = near as usize..=far as usize + 3;
        let layers = bottom..=top + 3;
        self.samples.fill(around, &stack.pristine.heights, layers.clone(), rows.clone());
        if let Some(columns) = stack.rim() {
            self.samples.extrapolate_beyond(&columns, layers, rows);
        }
        self.list_edges(&cubes.solid, &drawn, bottom, top);
        self.crossings.ends = stack.has_own_materials().then(|| solid_ends(&cubes.solid, &drawn));
        self.crossings.make(&self.samples, stack, around, brick.origin(), origin, &mut out.vertices);
        self.triangulate(&cubes.solid, &drawn, bottom, top, &mut out.indices);
    }

    /// Lists and numbers every lattice edge that a drawn cube's vertex lies on.
    fn list_edges(&mut self, solid: &[LayerBits; 9], drawn: &[LayerBits; 8], bottom: usize, top: usize) {
        let mut number = 0;
        for axis in 0..3 {
            let edges_of_axis = &mut self.crossings.lists[axis];
            edges_of_axis.clear();
            for y in bottom..=top + usize::from(axis != 1) {
                let here = if y < 8 { drawn[y] } else { 0 };
                let below = if y > bottom { drawn[y - 1] } else { 0 };
                let level = solid[y];
                let edges = match axis {
                    0 => (level ^ level >> X) & beside(here | below, Z),
                    1 => (level ^ solid[y + 1]) & beside(beside(here, X), Z),
                    _ => (level ^ level >> Z) & beside(here | below, X),
                };
                number = self.numbers.count(axis, y, edges, number, edges_of_axis);
            }
        }
    }

    fn triangulate(
        &self,
        solid: &[LayerBits; 9],
        drawn: &[LayerBits; 8],
        bottom: usize,
        top: usize,
        out: &mut Vec<u16>,
    ) {
        let table = &*SLOTS;
        let cubes: u32 = drawn[bottom..=top].iter().map(|layer| layer.count_ones()).sum();
        let mut end = out.len();
        out.resize(end + cubes as usize * MAX_INDICES, 0);
        for y in bottom..=top {
            layer_bits::for_ones(drawn[y], |cell| {
                let (below, above) = ((solid[y] >> cell) as usize, (solid[y + 1] >> cell) as usize);
                let case = below & 3 | (above & 3) << 2 | (below >> Z & 3) << 4 | (above >> Z & 3) << 6;
                let base = y * 81 + cell;
                let (slots, count) = (&table[case], usize::from(table[case][MAX_INDICES]));
                let Some(room) = out[end..].first_chunk_mut::<MAX_INDICES>() else { return };
                // Most cubes have two triangles at most. Those two are always written; the next cube overwrites the
                // surplus.
                let (usual, others) = slots.split_at(6);
                let (first, rest) = room.split_at_mut(6);
                let number = |slot: &u16| self.numbers.at(base + usize::from(*slot));
                first.iter_mut().zip(usual).for_each(|(to, slot)| *to = number(slot));
                let more = count.saturating_sub(6);
                rest.iter_mut().zip(&others[..more]).for_each(|(to, slot)| *to = number(slot));
                end += count;
            });
        }
        out.truncate(end);
    }
}

/// The solid ends of all lattice edges that vertices of drawn cubes lie on: those corners of the cubes that are one
/// edge away from another corner, of air.
fn solid_ends(solid: &[LayerBits; 9], drawn: &[LayerBits; 8]) -> [LayerBits; 9] {
    let mut ends = [0; 9];
    for (y, &drawn) in drawn.iter().enumerate().filter(|(_, drawn)| **drawn != 0) {
        let (low, high) = (solid[y], solid[y + 1]);
        // The solid ends of the cubes' edges in a layer, along one axis.
        let along = |level: LayerBits, step: u32, across: u32| {
            let edges = (level ^ level >> step) & beside(drawn, across);
            level & (edges | edges << step)
        };
        let upright = (low ^ high) & beside(beside(drawn, X), Z);
        ends[y] |= low & upright | along(low, X, Z) | along(low, Z, X);
        ends[y + 1] |= high & upright | along(high, X, Z) | along(high, Z, X);
    }
    ends
}

fn stack_of(brick: BrickPos) -> (i32, i32) {
    (brick.0.x, brick.0.z)
}

/// Cells, and those one step further.
fn beside(cells: LayerBits, step: u32) -> LayerBits {
    cells | cells << step
}

/// The numbers of vertices, by lattice edge: three axes, in each nine layers of corners.
struct Numbers(Box<[u16; 3 * 9 * 81]>);

impl Default for Numbers {
    fn default() -> Self {
        Self(Box::new([0; 3 * 9 * 81]))
    }
}

impl Numbers {
    /// Numbers edges from `first` on and lists them; returns the next number.
    #[inline]
    fn count(&mut self, axis: usize, y: usize, edges: LayerBits, first: u16, list: &mut Vec<Edge>) -> u16 {
        let (mut number, base) = (first, axis * 729 + y * 81);
        let numbers = &mut self.0[base..base + 81];
        layer_bits::for_ones(edges, |corner| {
            numbers[corner] = number;
            number += 1;
            list.push(Edge { y: y as u8, corner: corner as u8 });
        });
        number
    }

    #[inline]
    fn at(&self, slot: usize) -> u16 {
        self.0[slot]
    }
}

/// For each case the places in [`Numbers`] of its triangles' edges, counted from the cube's lowest corner, three for a
/// triangle; the last number is how many they are.
pub(crate) static SLOTS: LazyLock<[[u16; MAX_INDICES + 1]; 256]> = LazyLock::new(|| {
    let slot = |edge| {
        let (corner, axis) = cases::edge_corners(edge);
        let [x, y, z] = cases::corner(corner).map(|step| step as u16);
        axis as u16 * 729 + y * 81 + z * 9 + x
    };
    let of = |case: &Case| {
        let mut slots = [0; MAX_INDICES + 1];
        for (place, edge) in case.triangles().flatten().enumerate() {
            slots[place] = slot(edge);
            slots[MAX_INDICES] += 1;
        }
        slots
    };
    std::array::from_fn(|case| of(&cases::table()[case]))
});

/// The most edges that the triangles of a case have, three for a triangle.
const MAX_INDICES: usize = 15;

/// The cubes of a brick that marching cubes draws.
struct Cubes {
    /// Solid corners, layer by layer.
    solid: [LayerBits; 9],
    /// Cells to draw between a layer and the next.
    drawn: [LayerBits; 8],
}

impl Cubes {
    /// `None` where nothing is drawn.
    fn find(stack: &Stack, around: &Neighbours, brick: BrickPos) -> Option<Self> {
        let low = brick.origin().y;
        let near = around.near();
        if near.is_one_side(stack.pristine.side(low)) {
            return None;
        }
        let solid = near.solid(|| stack.pristine.solid(low));
        let mut drawn = [0; 8];
        for (y, drawn) in drawn.iter_mut().enumerate() {
            // A cube without an edited corner that both signs meet in is one of the pristine sheet.
            *drawn = layer_bits::mixed(solid[y], solid[y + 1]);
            if *drawn & !stack.mask != 0 {
                *drawn &= layer_bits::any(near.edited(y) | near.edited(y + 1)) | stack.mask;
            }
        }
        (drawn != [0; 8]).then_some(Self { solid, drawn })
    }

    /// The cubes among these cells of the brick.
    fn within(&self, cells: LatticeBox, brick: BrickPos) -> [LayerBits; 8] {
        let (low, high) = (cells.min - brick.origin(), cells.max - brick.origin());
        let area = layer_bits::rectangle(Column::of(low), Column::of(high));
        std::array::from_fn(|y| if (low.y..=high.y).contains(&(y as i32)) { self.drawn[y] & area } else { 0 })
    }
}

/// Derives the table of cases now, so that the first edit need not wait for it.
pub(crate) fn prepare() {
    LazyLock::force(&SLOTS);
}
