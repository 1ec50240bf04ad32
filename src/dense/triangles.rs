//! Triangles from the stream of cases alone.
//!
//! Vertices are numbered in the order of the edges in their lists, which is the order of the stream. So no cell looks
//! up the numbers of its twelve edges: ten counters, one for each row of edges around the cell, hold them.

use std::sync::LazyLock;

use wide::u32x4;

use super::cells::{Cells, LayerStart, NO_CELL};
use crate::surface::cases::{self, Edge};

/// What a case does to the counters, and its triangles.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Step {
    /// By how much the counters advance behind the cell.
    advance: [[u32; 4]; 3],
    /// The counter of each triangle corner.
    corners: [u8; 15],
    /// Triangle corners.
    count: u8,
}

/// The counters at a cell:
///
/// | axis | counters |
/// | --- | --- |
/// | x | of the rows (y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1) |
/// | y | of the row (y, z), the same plus one, of the row (y, z + 1), the same plus one |
/// | z | of the row (y, z), the same plus one, of the row (y + 1, z), the same plus one |
///
/// An edge along y or z on the cell's far side is the first of its row behind the cell's near side: where the near edge
/// is crossed, it has the number plus one.
type Counters = [u32x4; 3];

fn counters(low: &LayerStart, high: &LayerStart) -> Counters {
    [
        u32x4::new([low.x[0], low.x[1], high.x[0], high.x[1]]),
        u32x4::new([low.y, low.y.wrapping_add(1), high.y, high.y.wrapping_add(1)]),
        u32x4::new([low.z[0], low.z[0].wrapping_add(1), low.z[1], low.z[1].wrapping_add(1)]),
    ]
}

/// A step for each case; those from [`NO_CELL`] on have no triangles.
static STEPS: LazyLock<[Step; 512]> = LazyLock::new(|| std::array::from_fn(step));

fn step(code: usize) -> Step {
    let case = code & 255;
    let crossed = |edge: usize| {
        let (low, axis) = cases::edge_corners(edge as Edge);
        (case >> low ^ case >> (low | 1 << axis)) & 1
    };
    let counter = |edge: usize| if edge < 4 { edge } else { (edge & !1) + (edge & 1) * crossed(edge & !1) };
    let advanced_by = |counter: usize| if counter < 4 { crossed(counter) } else { crossed(counter & !1) };
    let mut step = Step {
        advance: std::array::from_fn(|axis| std::array::from_fn(|i| advanced_by(axis * 4 + i) as u32)),
        corners: [0; 15],
        count: 0,
    };
    if code < usize::from(NO_CELL) {
        for edge in cases::table()[case].triangles().flatten() {
            step.corners[usize::from(step.count)] = counter(usize::from(edge)) as u8;
            step.count += 1;
        }
    }
    step
}

/// The most triangle corners of a cell.
const MAX_INDICES: usize = 15;
/// Triangle corners that are written for every cell, as few cells have more.
const USUAL: usize = 9;

/// Replaces `indices` by the triangles of all cells.
pub(super) fn mesh(cells: &Cells, indices: &mut Vec<u32>) {
    let steps: &[Step; 512] = &STEPS;
    let (mut begin, mut at) = (0, 0);
    for layers in cells.layers.windows(2) {
        let [low, high] = layers else { continue };
        let codes = &cells.cases.items()[begin..low.cases_end];
        begin = low.cases_end;
        if codes.is_empty() {
            continue;
        }
        // The last cell may write up to MAX_INDICES surplus indices.
        if indices.len() < at + (codes.len() + 1) * MAX_INDICES {
            let count =
                codes.iter().map(|&code| usize::from(steps[usize::from(code & 511)].count)).sum::<usize>();
            let needed = at + count + MAX_INDICES;
            if indices.len() < needed {
                indices.resize(needed, 0);
            }
        }
        at += mesh_layer(steps, codes, counters(low, high), &mut indices[at..]);
    }
    indices.truncate(at);
}

/// Writes the triangles of one layer of cells, and surplus indices behind them. Returns how many indices are valid.
fn mesh_layer(steps: &[Step; 512], codes: &[u16], mut counters: Counters, indices: &mut [u32]) -> usize {
    let mut at = 0;
    // As long as a byte can reach, so that no lookup is checked.
    let mut numbers = [0; 256];
    for &code in codes {
        let step = &steps[usize::from(code & 511)];
        for (axis, counter) in counters.iter_mut().enumerate() {
            numbers[axis * 4..axis * 4 + 4].copy_from_slice(counter.as_array());
            *counter += u32x4::new(step.advance[axis]);
        }
        let room = &mut indices[at..at + MAX_INDICES];
        for (index, &corner) in room[..USUAL].iter_mut().zip(&step.corners) {
            *index = numbers[usize::from(corner)];
        }
        let count = usize::from(step.count);
        if count > USUAL {
            for (index, &corner) in room[USUAL..].iter_mut().zip(&step.corners[USUAL..]) {
                *index = numbers[usize::from(corner)];
            }
        }
        at += count;
    }
    at
}
