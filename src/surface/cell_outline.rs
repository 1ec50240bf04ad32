//! The triangles that a tile draws for a cell, by the lines around it.
//!
//! A cell is two triangles, a-b-c and c-d-a. Sides that border on the mask or on a steep cell are lines of several
//! vertices, over which rule 3 fans. All lines of a steep cell are, its diagonal too, and its triangles are cut into
//! bands, one for each lattice level, so a cliff shows the beds between the tops of its columns:
//!
//! ```text
//!        high          The long side goes from the lowest corner to the highest, the other
//!        /  \          two over the third one. All have a vertex on each level that separates
//!       /----\         their ends, so no triangle has its three corners on one side.
//!      /------\
//!     /--------mid
//!    /-----/
//!   low
//! ```
//!
//! Two cells that share a side agree on its vertices, across the borders of tiles too, so nothing opens.

use glam::IVec3;

use super::mask::{Borders, sheet};
use super::vertex::DIAGONAL;
use crate::ground::Ground;
use crate::lattice::{Column, ONE};

/// The lines of a cell that stays heightmap, between its corners a, b, c, d. `T` is a vertex.
pub(crate) struct CellOutline<T> {
    /// Sides a-b, b-c, c-d and d-a, and the diagonal a-c.
    lines: [Vec<T>; 5],
    is_steep: bool,
    /// All lines around a triangle.
    around: Vec<T>,
}

impl<T: Copy> CellOutline<T> {
    pub fn with_capacity(vertices: usize) -> Self {
        let lines = [(); 5].map(|()| Vec::with_capacity(vertices));
        Self { lines, is_steep: false, around: Vec::new() }
    }

    /// Makes it that of a cell, given its [flags](super::mask::Borders), the vertices at its corners, by column and
    /// height, and those of crossed lattice edges, as lower end and axis.
    pub fn trace(
        &mut self,
        ground: &Ground,
        cell: Column,
        flags: u8,
        corner: impl Fn(Column, i32) -> T,
        mut crossing: impl FnMut(IVec3, usize) -> T,
    ) {
        const ENDS: [(usize, usize); 5] = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)];
        let columns = cell.corners();
        let [[a, d], [b, c]] = ground.heights::<2>(cell);
        let heights = [a, b, c, d];
        let corners: [T; 4] = std::array::from_fn(|number| corner(columns[number], heights[number]));
        self.is_steep = flags == Borders::STEEP;
        // Only steep cells need the diagonal.
        let lines = if self.is_steep { 5 } else { 4 };
        for (number, (line, (from, to))) in self.lines.iter_mut().zip(ENDS).take(lines).enumerate() {
            line.clear();
            line.push(corners[from]);
            if flags >> number & 1 == 1 {
                let crossings = chain([from, to].map(|end| (columns[end], heights[end])));
                line.extend(crossings.map(|(p, axis)| crossing(p, axis)));
            }
            line.push(corners[to]);
        }
    }

    /// The cell's triangles; `height` of a vertex is exact.
    pub fn triangles<H: PartialOrd>(&mut self, height: impl Fn(T) -> H, mut emit: impl FnMut([T; 3])) {
        let [ab, bc, cd, da, ac] = &self.lines;
        for (half, [first, second]) in [[ab, bc], [cd, da]].into_iter().enumerate() {
            if !self.is_steep {
                fan(first, second, &mut emit);
                continue;
            }
            let inner = |line: &[T]| line.len() - 1;
            self.around.clear();
            self.around.reserve(first.len() + second.len() + ac.len());
            self.around.extend_from_slice(&first[..inner(first)]);
            self.around.extend_from_slice(&second[..inner(second)]);
            if half == 0 {
                self.around.extend(ac[1..].iter().rev());
            } else {
                self.around.extend_from_slice(&ac[..inner(ac)]);
            }
            bands(&self.around, [0, inner(first), inner(first) + inner(second)], &height, &mut emit);
        }
    }
}

/// Cuts a triangle into bands: goes up on both sides, always to the vertex that is lower. `around` are its vertices,
/// counter-clockwise, three of which are its `corners`.
fn bands<T: Copy, H: PartialOrd>(
    around: &[T],
    corners: [usize; 3],
    height: impl Fn(T) -> H,
    mut emit: impl FnMut([T; 3]),
) {
    let is_below = |a: usize, b: usize| height(around[corners[a]]) < height(around[corners[b]]);
    let low = (1..3).fold(0, |low, corner| if is_below(corner, low) { corner } else { low });
    let high = (1..3).fold(0, |high, corner| if is_below(high, corner) { corner } else { high });
    let is_long_ahead = (low + 1) % 3 == high;
    let (count, start) = (around.len(), corners[low]);
    let ahead = |steps: usize| around[(start + steps) % count];
    let back = |steps: usize| around[(start + count - steps) % count];
    let most = (corners[high] + count - start) % count;
    let most = [most, count - most];
    let mut at = [0, 0];
    while at != most {
        let next = [ahead(at[0] + 1), back(at[1] + 1)];
        // At equal height, the long side comes last: its vertex lies next to that of the others, never below
        // a corner.
        let goes_ahead = match (at[0] < most[0], at[1] < most[1]) {
            (true, true) if is_long_ahead => height(next[0]) < height(next[1]),
            (true, true) => height(next[0]) <= height(next[1]),
            (is_left, _) => is_left,
        };
        let triangle = if goes_ahead {
            [ahead(at[0]), next[0], back(at[1])]
        } else {
            [next[1], back(at[1]), ahead(at[0])]
        };
        let is_first = at == [0, 0];
        at[usize::from(!goes_ahead)] += 1;
        // The sides meet at both ends, so the first step and the last are along a side.
        if !is_first && at != most {
            emit(triangle);
        }
    }
}

/// The lattice edges whose crossings lie strictly between two neighbouring heightmap vertices, given by column and
/// height, in order: one for each lattice y that separates their heights, as lower end and axis. Also between the ends
/// of a cell's diagonal.
fn chain([(from, h_from), (to, h_to)]: [(Column, i32); 2]) -> impl Iterator<Item = (IVec3, usize)> {
    let axis = match (from.x != to.x, from.z != to.z) {
        (true, true) => DIAGONAL,
        (true, false) => 0,
        (false, _) => 2,
    };
    let low = Column::new(from.x.min(to.x), from.z.min(to.z));
    let rungs = sheet([h_from, h_to]);
    let (first, last) = (rungs.start, rungs.end - 1);
    let is_falling = h_to < h_from;
    rungs
        .map(move |y| if is_falling { last - (y - first) } else { y })
        .filter(move |y| (y * ONE < h_from) != (y * ONE < h_to))
        .map(move |y| (low.at(y), axis))
}

/// Rule 3: fans a triangle with legs P..R and R..Q, each straight or a polyline; the side Q-P is straight.
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
