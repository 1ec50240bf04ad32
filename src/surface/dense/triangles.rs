//! Triangles of the cells between two slices.

use std::sync::LazyLock;

use wide::u32x4;

use super::DenseMesh;
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

/// Indices in the making. Beyond `used` the buffer holds old ones, so that it need not be cleared.
#[derive(Debug, Default)]
pub(super) struct Triangles {
    indices: Vec<u32>,
    used: usize,
}

/// Room that one cell may need.
const ROOM: usize = 15;

impl Triangles {
    pub fn begin(&mut self) {
        self.used = 0;
    }

    pub fn hand_over(&mut self, out: &mut DenseMesh) {
        out.indices.clear();
        out.indices.extend_from_slice(&self.indices[..self.used]);
    }

    /// Adds the triangles of the cells between slices `z` and `z + 1`.
    pub fn make(&mut self, signs: &Signs, edges: &Edges, z: usize) {
        if signs.side(z).is_some() && signs.side(z) == signs.side(z + 1) {
            return;
        }
        let entries = &**ENTRIES;
        for y in 0..signs.rows() - 1 {
            let rows = [signs.row(y, z), signs.row(y + 1, z), signs.row(y, z + 1), signs.row(y + 1, z + 1)];
            let mut numbers = None;
            for word in 0..signs.words() {
                let own = rows.map(|row| row[word]);
                let next = rows.map(|row| row[word] >> 1 | row[word + 1] << 63);
                let any = own.iter().chain(&next).fold(0, |all, bits| all | bits);
                let all = own.iter().chain(&next).fold(u64::MAX, |all, bits| all & bits);
                let mut cells = any & !all & ones((signs.width() - 1).saturating_sub(word * 64));
                if cells == 0 {
                    continue;
                }
                let mut counts = *numbers.get_or_insert_with(|| first_numbers(edges, &rows, y, z));
                self.reserve(cells.count_ones() as usize);
                while cells != 0 {
                    let bit = cells.trailing_zeros();
                    cells &= cells - 1;
                    let pair = |row: usize| (own[row] >> bit & 1 | (next[row] >> bit & 1) << 1) as usize;
                    let case = pair(0) | pair(1) << 2 | pair(2) << 4 | pair(3) << 6;
                    let entry = &entries[case];
                    self.add(entry, &counts);
                    for (count, step) in counts.iter_mut().zip(entry.steps) {
                        *count += step;
                    }
                }
                numbers = Some(counts);
            }
        }
    }

    fn reserve(&mut self, cells: usize) {
        let wanted = self.used + cells * ROOM;
        if self.indices.len() < wanted {
            self.indices.resize(wanted.max(self.indices.len() * 2), 0);
        }
    }

    /// Adds a cube's triangles.
    #[inline(always)]
    fn add(&mut self, entry: &Entry, counts: &[u32x4; 3]) {
        let numbers: [u32; 12] = bytemuck::cast(*counts);
        let mut table = [0; 16];
        table[..12].copy_from_slice(&numbers);
        let Some(out) = self.indices[self.used..].first_chunk_mut::<ROOM>() else { return };
        // Most cells have three triangles or fewer; what is written too much is overwritten.
        for (out, &edge) in out[..9].iter_mut().zip(&entry.edges[..9]) {
            *out = table[usize::from(edge & 15)];
        }
        if entry.len > 9 {
            for (out, &edge) in out[9..].iter_mut().zip(&entry.edges[9..]) {
                *out = table[usize::from(edge & 15)];
            }
        }
        self.used += usize::from(entry.len);
    }
}

/// The numbers that the vertices of a row's first cube have, by edge, if its edges are crossed; if not, those of the next
/// that is.
#[inline(always)]
fn first_numbers(edges: &Edges, rows: &[&[u64]; 4], y: usize, z: usize) -> [u32x4; 3] {
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
    ]
}
