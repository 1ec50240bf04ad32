//! Triangles of the cells between two slices.

use std::sync::LazyLock;

use wide::u32x4;

use super::edges::Edges;
use super::signs::{Signs, ones};
use crate::surface::cases;

/// A case: by how much each of a cube's twelve vertex numbers goes on after it, and its triangles.
struct Entry {
    /// 1 for each edge that is crossed, in the order of [`cases::Edge`].
    steps: [u32x4; 3],
    /// Three edges for each triangle; behind them, edge 0.
    edges: [u8; 15],
    len: u8,
}

static ENTRIES: LazyLock<Box<[Entry; 256]>> = LazyLock::new(|| {
    let entry = |case: usize| {
        let is_solid = |corner: usize| case >> corner & 1 == 1;
        let is_crossed = |edge: cases::Edge| {
            let (low, axis) = cases::edge_corners(edge);
            u32::from(is_solid(low) != is_solid(low | 1 << axis))
        };
        let (mut edges, mut len) = ([0; 15], 0);
        for (place, edge) in edges.iter_mut().zip(cases::table()[case].triangles().flatten()) {
            *place = edge;
            len += 1;
        }
        let steps = [0, 4, 8].map(|first| u32x4::new([0, 1, 2, 3].map(|i| is_crossed(first + i))));
        Entry { steps, edges, len }
    };
    Box::new(std::array::from_fn(entry))
});

/// The numbers of a cube's vertices, by edge, and four of no meaning.
type Numbers = [u32x4; 4];

/// The indices of the cells of one word, before they go out together.
#[derive(Debug)]
pub(super) struct Room(Box<[u32; 64 * MOST]>);

impl Default for Room {
    fn default() -> Self {
        Self(Box::new([0; 64 * MOST]))
    }
}

/// Adds to `out` the triangles of the cells between slices `z` and `z + 1`.
pub(super) fn make(signs: &Signs, edges: &Edges, z: usize, room: &mut Room, out: &mut Vec<u32>) {
    if signs.side(z).is_some() && signs.side(z) == signs.side(z + 1) {
        return;
    }
    let entries = &**ENTRIES;
    let indices = &mut *room.0;
    let (near, far) = (signs.slice(z), signs.slice(z + 1));
    let pairs = near.clone().zip(near.skip(1)).zip(far.clone().zip(far.skip(1)));
    for (y, ((a, b), (c, d))) in pairs.enumerate() {
        let mut numbers = None;
        for word in 0..signs.words() {
            let own = [a[word], b[word], c[word], d[word]];
            let next = [a[word + 1], b[word + 1], c[word + 1], d[word + 1]];
            let mut cells = mixed(own, next) & ones((signs.width() - 1).saturating_sub(word * 64));
            if cells == 0 {
                continue;
            }
            let mut used = 0;
            let mut counts: Numbers =
                *numbers.get_or_insert_with(|| first_numbers(edges, [a, b, c, d], y, z));
            while cells != 0 {
                let first = cells.trailing_zeros();
                let window = Window::new(own, next, first);
                let mut group = cells >> first & Window::CELLS;
                cells &= !(Window::CELLS << first);
                while group != 0 {
                    let entry = &entries[window.case(group.trailing_zeros())];
                    group &= group - 1;
                    if let Some(room) = indices[used..].first_chunk_mut() {
                        write(entry, &counts, room);
                    }
                    used += usize::from(entry.len);
                    for (count, step) in counts.iter_mut().zip(entry.steps) {
                        *count += step;
                    }
                }
            }
            numbers = Some(counts);
            out.extend_from_slice(&indices[..used]);
        }
    }
}

/// Cells of a word that have a solid corner and one of air.
#[inline(always)]
fn mixed(own: [u64; 4], next: [u64; 4]) -> u64 {
    let [a, b, c, d] = own;
    let [e, f, g, h] = next;
    let (any, all) = (a | b | c | d, a & b & c & d);
    let any = any | any >> 1 | (e | f | g | h) << 63;
    let all = all & (all >> 1 | (e & f & g & h) << 63);
    any & !all
}

/// Sixteen corners of each of four rows, side by side in one word.
#[derive(Clone, Copy)]
struct Window(u64);

impl Window {
    /// Cells whose corners a window holds.
    const CELLS: u64 = 0x7fff;

    /// The corners from bit `first` on.
    #[inline(always)]
    fn new(own: [u64; 4], next: [u64; 4], first: u32) -> Self {
        let sixteen = |row: usize| (own[row] >> first | next[row] << 1 << (63 - first)) & 0xffff;
        Self(sixteen(0) | sixteen(1) << 16 | sixteen(2) << 32 | sixteen(3) << 48)
    }

    /// The case of a cell, counted from the window's first.
    #[inline(always)]
    fn case(self, cell: u32) -> usize {
        // Two bits of each row, moved next to each other by one multiplication: its other products lie lower, each at a
        // place of its own, or fall out at the top.
        const GATHER: u64 = 1 << 48 | 1 << 34 | 1 << 20 | 1 << 6;
        let corners = self.0 >> cell & 0x0003_0003_0003_0003;
        (corners.wrapping_mul(GATHER) >> 48 & 0xff) as usize
    }
}

/// Indices of five triangles, the most that a cube has.
const MOST: usize = 15;
/// Indices of three triangles, which is all that most cubes have.
const FEW: usize = 9;

/// Writes the indices of a cube's triangles, and some more of no meaning behind them.
#[inline(always)]
fn write(entry: &Entry, counts: &Numbers, room: &mut [u32; MOST]) {
    let numbers: [u32; 16] = bytemuck::cast(*counts);
    let number = |edge: u8| numbers[usize::from(edge & 15)];
    for (index, &edge) in room[..FEW].iter_mut().zip(&entry.edges[..FEW]) {
        *index = number(edge);
    }
    if usize::from(entry.len) > FEW {
        for (index, &edge) in room[FEW..].iter_mut().zip(&entry.edges[FEW..]) {
            *index = number(edge);
        }
    }
}

/// The numbers that the vertices of a row's first cube have, by edge, if its edges are crossed; if not, those of the next
/// that is.
#[inline(always)]
fn first_numbers(edges: &Edges, rows: [&[u64]; 4], y: usize, z: usize) -> Numbers {
    let starts = [edges.start(y, z), edges.start(y + 1, z), edges.start(y, z + 1), edges.start(y + 1, z + 1)];
    // Is the first edge between two rows crossed? Then the second one has the next number.
    let crossed = |a: usize, b: usize| ((rows[a][0] ^ rows[b][0]) & 1) as u32;
    let [[x0, y0, z0], [x1, _, z1], [x2, y2, _], [x3, _, _]] = starts;
    [
        // Along x: at (y, z) = (0, 0), (1, 0), (0, 1), (1, 1).
        u32x4::new([x0, x1, x2, x3]),
        // Along y: at (x, z).
        u32x4::new([y0, y0 + crossed(0, 1), y2, y2 + crossed(2, 3)]),
        // Along z: at (x, y).
        u32x4::new([z0, z0 + crossed(0, 2), z1, z1 + crossed(1, 3)]),
        u32x4::ZERO,
    ]
}
