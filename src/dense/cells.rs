//! The cells that the surface crosses, as a stream of cases, and the crossed edges that each of them starts, as lists.
//!
//! A cell owns the three edges that start at its low corner. So that every edge has an owner, each row has one more
//! column than cells, each layer one more row, and the grid one more layer. What lies behind the end repeats the last
//! samples, and draws nothing.

use std::ops::Range;

use super::density::Density;
use super::grid::DenseGrid;
use super::signs::{COLUMNS, Signs};
use super::stream::Stream;

/// Added to the case of a column behind the last cell of a row: its edges count, its triangles do not.
pub(super) const NO_CELL: u16 = 256;

/// The lattice point where a crossed edge starts: x, y and z in 16 bits each, counted from sample (0, 0, 0).
pub(super) type Point = u64;

/// Packs a lattice point.
pub(super) const fn point([x, y, z]: [usize; 3]) -> Point {
    x as u64 | (y as u64) << 16 | (z as u64) << 32
}

/// Edges that are listed before they get their vertices. Few enough to stay in the first cache, and their samples in
/// the second; enough that the lists' ends do not matter.
const BATCH: usize = 2048;

/// Where the vertices of a layer's edges begin: in the lists first, in the mesh once those are numbered.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LayerStart {
    /// Start of edges along x, in row 0 and in row 1.
    pub(super) x: [u32; 2],
    /// Start of edges along y, in row 0.
    pub(super) y: u32,
    /// Start of edges along z, in row 0 and in row 1.
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

/// What a word of signs stands for, in any layer.
#[derive(Clone, Copy, Debug)]
struct Columns {
    /// One bit for each of its columns.
    all: u64,
    /// The column behind the last cell of the row, if it is here.
    row_end: u64,
    /// The word's first column, in layer 0.
    origin: Point,
}

/// Crossed cells and edges.
#[derive(Debug, Default)]
pub(super) struct Cells {
    /// The crossed cells of all layers.
    pub(super) cases: Stream<u16>,
    /// Where crossed edges start that have no vertex yet, for each axis.
    pub(super) edges: [Stream<Point>; 3],
    /// The starts of each layer of samples.
    pub(super) layers: Vec<LayerStart>,
    /// The words of a layer.
    columns: Vec<Columns>,
    /// Crossed columns of some words of a layer, and the numbers of those words.
    crossed: Stream<(u64, usize)>,
    /// The crossed cells of a layer.
    points: Stream<Point>,
}

impl Cells {
    /// Clears all lists, keeps their memory, and prepares for a grid.
    pub(super) fn start<S: Density>(&mut self, grid: &DenseGrid<S>) {
        self.cases.clear();
        self.points.clear();
        self.edges.iter_mut().for_each(Stream::clear);
        self.layers.clear();

        let [width, height, _] = grid.meshed();
        self.points.reserve(width * height);
        self.edges.iter_mut().for_each(|edges| edges.reserve(BATCH + width * height));
        let words_per_row = Signs::words_per_row(width);
        let origin = |x, y| point([grid.first() + x, grid.first() + y, grid.first()]);
        self.columns.clear();
        for y in 0..height {
            for x in (0..words_per_row - 1).map(|word| word * COLUMNS) {
                self.columns.push(Columns { all: (1 << COLUMNS) - 1, row_end: 0, origin: origin(x, y) });
            }
            let x = (words_per_row - 1) * COLUMNS;
            let row_end = 1 << (width - 1 - x);
            self.columns.push(Columns { all: row_end | (row_end - 1), row_end, origin: origin(x, y) });
        }
    }

    /// Number of edges without a vertex yet.
    pub(super) fn pending(&self) -> usize {
        self.edges.iter().map(Stream::len).sum()
    }

    /// Returns `true` if the edges must get their vertices before the next layer is added.
    pub(super) fn is_full(&self) -> bool {
        self.pending() >= BATCH
    }

    /// Adds layer `z`: the cells between `low`, its signs, and `high`, those of the next layer. Behind the last layer,
    /// which starts no cells, both are the same.
    pub(super) fn add_layer<S: Density>(&mut self, grid: &DenseGrid<S>, z: usize, low: &Signs, high: &Signs) {
        let [width, height, depth] = grid.meshed();
        let mut start = LayerStart::default();
        let lists = |cells: &Self| [0, 1, 2].map(|axis| cells.edges[axis].len() as u32);
        [start.x[0], start.y, start.z[0]] = lists(self);
        let first = self.cases.len();
        let mut end = first;
        if !low.is_uniform_with(high) {
            let words = self.columns.len();
            let words_per_row = words / height;
            self.crossed.reserve(words);
            self.points.clear();
            self.cases.reserve(width * height);

            let signs = Corners::new(low.words(), high.words(), words);
            self.add_cells(z, signs, 0..words_per_row);
            let row_1 = self.cases.len();
            self.add_cells(z, signs, words_per_row..words - words_per_row);
            if z < depth - 1 {
                end = self.cases.len();
            }
            self.add_cells(z, signs, words - words_per_row..words);
            self.add_edges(first, first..row_1);
            [start.x[1], _, start.z[1]] = lists(self);
            self.add_edges(first, row_1..self.cases.len());
        }
        // Edges behind the last row and the last layer are listed by now; there are no cells.
        self.cases.truncate(end);
        if z + 1 == depth {
            // Room that another grid with as many cells may need, if more of them lie in its last layers.
            self.cases.reserve(width * height);
        }
        start.cases_end = end;
        self.layers.push(start);
    }

    /// Appends the crossed cells of some words of layer `z`: first the words that hold any, without a branch, as most
    /// hold none; then their cells.
    fn add_cells(&mut self, z: usize, signs: Corners, words: Range<usize>) {
        // Slices of one length: a single check covers all of them.
        let [a, b, c, d] = signs.0.map(|signs| &signs[words.clone()]);
        let layout = &self.columns[words];
        let crossed = self.crossed.spare(layout.len());
        let mut words_crossed = 0;
        let rows = a.iter().zip(b).zip(c).zip(d);
        for (word, ((((&a, &b), &c), &d), layout)) in rows.zip(layout).enumerate() {
            let columns = crossed_columns([a, b, c, d]) & layout.all;
            crossed[words_crossed] = (columns, word);
            words_crossed += usize::from(columns != 0);
        }

        let most = self.cases.room().min(self.points.room());
        let (cases, points) = (self.cases.spare(most), self.points.spare(most));
        let mut count = 0;
        for &(columns, word) in &crossed[..words_crossed] {
            let [a, b, c, d] = [a[word], b[word], c[word], d[word]];
            let Columns { row_end, origin, .. } = layout[word];
            // Each word is turned so that its bits of the case only need a mask.
            let [b, c, d] = [b.rotate_left(2), c.rotate_left(4), d.rotate_left(6)];
            let origin = origin + point([0, 0, z]);
            let mut rest = columns;
            while rest != 0 {
                let x = rest.trailing_zeros();
                rest &= rest - 1;
                let low = a.rotate_right(x) & 3 | b.rotate_right(x) & 12;
                let high = c.rotate_right(x) & 48 | d.rotate_right(x) & 192;
                cases[count] = (low | high) as u16;
                points[count] = origin + u64::from(x);
                count += 1;
            }
            cases[count - 1] |= if columns & row_end != 0 { NO_CELL } else { 0 };
        }
        self.cases.extend(count);
        self.points.extend(count);
    }

    /// Appends the crossed edges that these cases start to the lists.
    fn add_edges(&mut self, first: usize, cases: Range<usize>) {
        let points = &self.points.items()[cases.start - first..cases.end - first];
        let most = points.len();
        let [x, y, z] = &mut self.edges;
        let (xs, ys, zs) = (x.spare(most), y.spare(most), z.spare(most));
        let mut counts = [0; 3];
        for (&case, &point) in self.cases.items()[cases].iter().zip(points) {
            let case = usize::from(case);
            xs[counts[0]] = point;
            ys[counts[1]] = point;
            zs[counts[2]] = point;
            counts[0] += (case ^ case >> 1) & 1;
            counts[1] += (case ^ case >> 2) & 1;
            counts[2] += (case ^ case >> 4) & 1;
        }
        x.extend(counts[0]);
        y.extend(counts[1]);
        z.extend(counts[2]);
    }
}

/// The signs of four rows around each row of cells: at (y, z), (y + 1, z), (y, z + 1) and (y + 1, z + 1).
#[derive(Clone, Copy)]
struct Corners<'a>([&'a [u64]; 4]);

impl<'a> Corners<'a> {
    /// The first `words` words of two layers, and those one row on.
    fn new(low: &'a [u64], high: &'a [u64], words: usize) -> Self {
        let ahead = low.len() - words;
        Self([&low[..words], &low[ahead..][..words], &high[..words], &high[ahead..][..words]])
    }
}

/// The columns in which the corners of a cell are neither all solid nor all air.
#[inline(always)]
fn crossed_columns([a, b, c, d]: [u64; 4]) -> u64 {
    let (some, every) = (a | b | c | d, a & b & c & d);
    (some | some >> 1) & !(every & every >> 1)
}
