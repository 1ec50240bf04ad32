//! Lattice edges that the surface crosses, listed by axis.

use super::signs::{Signs, ones};
use super::{DenseGrid, Density};

/// An edge's lower corner in its slice: x in the lower half, y in the upper.
pub(super) type Corner = u32;

/// The crossed edges that begin in one slice, and the numbers of their vertices.
#[derive(Debug, Default)]
pub(super) struct Edges {
    /// Edges along x, y and z, each in row order.
    pub lists: [Vec<Corner>; 3],
    /// For this slice and the one before: the number that the first vertex of each row has or would have, by axis.
    starts: [Vec<[u32; 3]>; 2],
}

impl Edges {
    pub fn begin<S: Density>(&mut self, grid: &DenseGrid<S>) {
        let [_, rows, _] = grid.corners();
        for starts in &mut self.starts {
            starts.clear();
            starts.resize(rows, [0; 3]);
        }
    }

    /// Lists the edges that begin in slice `z`; their vertices are numbered from `first` on, those along x before those
    /// along y before those along z.
    pub fn list(&mut self, signs: &Signs, z: usize, is_last: bool, first: usize) {
        self.lists.iter_mut().for_each(Vec::clear);
        let next = if is_last { z } else { z + 1 };
        let starts = &mut self.starts[z % 2];
        let side = signs.side(z);
        if side.is_some() && side == signs.side(next) {
            // Nothing begins here, and rows of no edges need no start.
            return;
        }
        let [along_x, along_y, along_z] = &mut self.lists;
        let words = signs.words();
        let own = signs.slice(z);
        // The last row and the last slice stand in for those after them.
        let below = own.clone().skip(1).chain(own.clone().last());
        let corners = (0..).step_by(1 << 16);
        for ((((start, own), below), behind), corner) in
            starts.iter_mut().zip(own).zip(below).zip(signs.slice(next)).zip(corners)
        {
            *start = [along_x.len() as u32, along_y.len() as u32, along_z.len() as u32];
            for word in 0..words {
                let bits = own[word];
                if bits == below[word]
                    && bits == behind[word]
                    && (bits == 0 || bits == u64::MAX)
                    && own[word + 1] == bits
                {
                    continue;
                }
                let along = (bits ^ (bits >> 1 | own[word + 1] << 63)) & inner(signs, word);
                let base = corner + (word * 64) as u32;
                push(along_x, along, base);
                push(along_y, bits ^ below[word], base);
                push(along_z, bits ^ behind[word], base);
            }
        }
        let first = first as u32;
        let numbers = [first, first + along_x.len() as u32, first + (along_x.len() + along_y.len()) as u32];
        for start in starts {
            for (start, number) in start.iter_mut().zip(numbers) {
                *start += number;
            }
        }
    }

    /// The numbers that the first vertices of a row have or would have: along x, y and z.
    #[inline(always)]
    pub fn start(&self, y: usize, z: usize) -> [u32; 3] {
        self.starts[z % 2][y]
    }
}

/// The corners of a word that begin an edge along x: all but the last of the row.
#[inline(always)]
fn inner(signs: &Signs, word: usize) -> u64 {
    ones((signs.width() - 1).saturating_sub(word * 64))
}

#[inline(always)]
fn push(list: &mut Vec<Corner>, mut bits: u64, base: Corner) {
    while bits != 0 {
        list.push(base + bits.trailing_zeros());
        bits &= bits - 1;
    }
}
