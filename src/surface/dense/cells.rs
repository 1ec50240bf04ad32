//! The cells that the surface crosses, as a stream of cases, and the crossed edges that each of them starts, as lists.
//!
//! A cell owns the three edges that start at its low corner. So that every edge has an owner, each row has one more
//! column than cells, each layer one more row, and the grid one more layer. What lies behind the end repeats the last
//! samples, and draws nothing.

use std::ops::Range;

use super::density::Density;
use super::grid::DenseGrid;
use super::signs::{COLUMNS, Signs};

/// A column behind the last cell of a row: the case's edges count, its triangles do not.
pub(super) const NO_CELL: u16 = 256;

/// The lattice point where a crossed edge starts: x, y and z in 16 bits each, counted from sample (0, 0, 0).
pub(super) type Point = u64;

/// Packs a lattice point.
pub(super) const fn point([x, y, z]: [usize; 3]) -> Point {
    x as u64 | (y as u64) << 16 | (z as u64) << 32
}

/// Slots behind the end of a stream that may be written in vain.
const SLACK: usize = 8;

/// A growing list that is written ahead of its end: the slots behind it hold nothing of worth.
#[derive(Debug, Default)]
pub(super) struct Stream<T> {
    slots: Vec<T>,
    len: usize,
}

impl<T: Copy + Default> Stream<T> {
    /// Forgets the items, keeps the memory.
    pub(super) fn clear(&mut self) {
        self.len = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.len
    }

    pub(super) fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    pub(super) fn items(&self) -> &[T] {
        &self.slots[..self.len]
    }

    /// Appends an item. There must be room.
    #[inline(always)]
    fn push(&mut self, item: T) {
        self.slots[self.len] = item;
        self.len += 1;
    }

    /// Appends an item when `condition` is odd, without a branch. There must be room.
    #[inline(always)]
    fn push_if(&mut self, item: T, condition: u16) {
        self.slots[self.len] = item;
        self.len += usize::from(condition & 1);
    }

    /// Room for `more` items. Memory is cleared when it is first used, and never again.
    fn reserve(&mut self, more: usize) {
        if self.slots.len() < self.len + more {
            self.slots.resize(self.len + more, T::default());
        }
    }

    /// The items, the last one repeated until their number is a multiple of `group`.
    pub(super) fn in_groups_of(&mut self, group: usize) -> &[T] {
        let end = self.len.next_multiple_of(group);
        self.reserve(end - self.len);
        if let Some(&last) = self.items().last() {
            self.slots[self.len..end].fill(last);
        }
        &self.slots[..end]
    }
}

/// Where the vertices of a layer's edges begin: in the lists first, in the mesh once those are numbered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LayerStart {
    /// Of edges along x, in row 0 and in row 1.
    pub(super) x: [u32; 2],
    /// Of edges along y, in row 0.
    pub(super) y: u32,
    /// Of edges along z, in row 0 and in row 1.
    pub(super) z: [u32; 2],
    /// The end of this layer's cells in [`Cells::cases`].
    pub(super) cases_end: usize,
}

impl LayerStart {
    /// Turns places in the lists into vertex numbers, given the number of each list's first vertex.
    pub(super) fn shift(&mut self, [x, y, z]: [u32; 3]) {
        self.x = self.x.map(|start| start + x);
        self.y += y;
        self.z = self.z.map(|start| start + z);
    }
}

/// Crossed cells and edges.
#[derive(Debug, Default)]
pub(super) struct Cells {
    /// The crossed cells of all layers: cases, with [`NO_CELL`] added at the end of a row.
    pub(super) cases: Stream<u16>,
    /// The crossed cells of this layer.
    points: Stream<Point>,
    /// Where crossed edges start that have no vertex yet, for each axis.
    pub(super) edges: [Stream<Point>; 3],
    /// One for each layer of samples.
    pub(super) layers: Vec<LayerStart>,
}

impl Cells {
    /// Forgets all, keeps the memory.
    pub(super) fn clear(&mut self) {
        self.cases.clear();
        self.points.clear();
        self.edges.iter_mut().for_each(Stream::clear);
        self.layers.clear();
    }

    /// How many edges wait for their vertices.
    pub(super) fn waiting(&self) -> usize {
        self.edges.iter().map(Stream::len).sum()
    }

    /// Adds layer `z`: the cells between `low`, its signs, and `high`, those of the next layer. Behind the last layer, which
    /// starts no cells, both are the same.
    pub(super) fn add_layer<S: Density>(&mut self, grid: &DenseGrid<S>, z: usize, low: &Signs, high: &Signs) {
        let [width, height, depth] = grid.meshed();
        let mut start = LayerStart::default();
        let lists = |cells: &Self| [0, 1, 2].map(|axis| cells.edges[axis].len() as u32);
        [start.x[0], start.y, start.z[0]] = lists(self);
        let first = self.cases.len();
        let mut end = first;
        if !low.is_uniform_with(high) {
            let most = width * height + SLACK;
            self.cases.reserve(most);
            self.points.clear();
            self.points.reserve(most);
            self.edges.iter_mut().for_each(|edges| edges.reserve(most));

            self.add_rows(grid, z, low, high, 0..1);
            let row_1 = self.cases.len();
            self.add_rows(grid, z, low, high, 1..height - 1);
            if z < depth - 1 {
                end = self.cases.len();
            }
            self.add_rows(grid, z, low, high, height - 1..height);
            self.add_edges(first, first..row_1);
            [start.x[1], _, start.z[1]] = lists(self);
            self.add_edges(first, row_1..self.cases.len());
        }
        // What lies behind the last row and the last layer has told its edges, and is no cell.
        self.cases.truncate(end);
        start.cases_end = end;
        self.layers.push(start);
    }

    /// Appends the crossed cells of some rows.
    fn add_rows<S: Density>(
        &mut self,
        grid: &DenseGrid<S>,
        z: usize,
        low: &Signs,
        high: &Signs,
        rows: Range<usize>,
    ) {
        let [width, height, _] = grid.meshed();
        let words_per_row = Signs::words_per_row(width);
        let last_column = 1 << (width - 1 - (words_per_row - 1) * COLUMNS);
        let (cases, points) = (&mut self.cases, &mut self.points);
        for y in rows {
            let next = if y + 1 < height { y + 1 } else { y };
            let [a, b] = [y, next].map(|y| &low.words()[y * words_per_row..][..words_per_row]);
            let [c, d] = [y, next].map(|y| &high.words()[y * words_per_row..][..words_per_row]);
            for word in 0..words_per_row {
                let corners = [a[word], b[word], c[word], d[word]];
                let is_last = word + 1 == words_per_row;
                let columns = if is_last { last_column * 2 - 1 } else { (1 << COLUMNS) - 1 };
                let mut crossed = crossed_columns(corners) & columns;
                if crossed == 0 {
                    continue;
                }
                let origin = point([word * COLUMNS, y, z].map(|steps| grid.first() + steps));
                let ends_row = is_last && crossed & last_column != 0;
                while crossed != 0 {
                    let x = crossed.trailing_zeros();
                    crossed &= crossed - 1;
                    cases.push(case(corners, x));
                    points.push(origin + u64::from(x));
                }
                cases.slots[cases.len - 1] |= if ends_row { NO_CELL } else { 0 };
            }
        }
    }

    /// Appends the crossed edges that these cases start to the lists.
    fn add_edges(&mut self, first: usize, cases: Range<usize>) {
        let points = &self.points.slots[cases.start - first..cases.end - first];
        let [x, y, z] = &mut self.edges;
        for (&case, &point) in self.cases.slots[cases].iter().zip(points) {
            x.push_if(point, case ^ case >> 1);
            y.push_if(point, case ^ case >> 2);
            z.push_if(point, case ^ case >> 4);
        }
    }
}

/// The columns in which the corners of a cell are neither all solid nor all air. The words hold the signs of the rows at
/// (y, z), (y + 1, z), (y, z + 1) and (y + 1, z + 1).
#[inline(always)]
fn crossed_columns([a, b, c, d]: [u64; 4]) -> u64 {
    let (some, every) = (a | b | c | d, a & b & c & d);
    (some | some >> 1) & !(every & every >> 1)
}

/// The case of the cell in column `x`.
#[inline(always)]
fn case([a, b, c, d]: [u64; 4], x: u32) -> u16 {
    (a >> x & 3 | (b >> x & 3) << 2 | (c >> x & 3) << 4 | (d >> x & 3) << 6) as u16
}
