//! Tiles of several files that make one grid.

use std::collections::BTreeMap;

use super::decoded::reserve;
use super::error::ImportError;
use super::grid::ElevationGrid;
use super::report::ImportNote;
use crate::ground::ImageLimits;

/// A tile of a larger grid.
#[derive(Clone, Debug)]
pub struct ElevationTile {
    /// The tile's place along x; the lowest one is the grid's first column.
    pub column: i32,
    /// The tile's place along z; the lowest one is the grid's top row.
    pub row: i32,
    /// The tile's samples.
    pub grid: ElevationGrid,
}

impl ElevationTile {
    /// The place of a tile as its file's name says it, as column and row; `None` if it does not, or says several.
    ///
    /// | name | column and row |
    /// | --- | --- |
    /// | `island_x3_y5.png`, `island_y5_x3.r16`, `island_1025x1025_x3_y5.png` | 3, 5 |
    /// | `island_3_5.png`, `3-5.tif` | 3, 5 |
    /// | `island_x-1_y0.png`, `island_-1_0.png` | -1, 0 |
    /// | `N46E007.hgt` | 7, -46: rows go south |
    ///
    /// A minus is a sign at the beginning, and after another separator or a letter; otherwise it separates.
    pub fn place_of(name: &str) -> Option<(i32, i32)> {
        let stem = name.rsplit(['/', '\\']).next()?;
        let stem = stem.split_once('.').map_or(stem, |(stem, _)| stem).to_ascii_lowercase();
        let numbers = lettered_numbers(&stem);
        // Columns and rows that follow each other in the name.
        let pairs = |columns: [char; 2], rows: [char; 2]| -> Vec<[(char, i32); 2]> {
            let own: Vec<_> = numbers
                .iter()
                .filter(|(letter, _)| columns.contains(letter) || rows.contains(letter))
                .collect();
            let sorted =
                |a: (char, i32), b: (char, i32)| if columns.contains(&a.0) { [a, b] } else { [b, a] };
            let pairs = own.windows(2).map(|pair| sorted(*pair[0], *pair[1]));
            pairs.filter(|[a, b]| columns.contains(&a.0) && rows.contains(&b.0)).collect()
        };
        let places = pairs(['x'; 2], ['y'; 2]);
        if let Some(first @ [(_, column), (_, row)]) = places.first() {
            return places.iter().all(|place| place == first).then_some((*column, *row));
        }
        if stem.starts_with(['n', 's'])
            && let Some(&[(side, east), (half, north)]) = pairs(['e', 'w'], ['n', 's']).first()
        {
            return Some((if side == 'w' { -east } else { east }, if half == 'n' { -north } else { north }));
        }
        let (row, rest) = last_number(&stem)?;
        let (column, _) = last_number(rest.strip_suffix(SEPARATORS)?)?;
        Some((column, row))
    }
}

/// How tiles meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TileEdges {
    /// As their samples suggest.
    #[default]
    Guess,
    /// The last column or row of a tile is the first one of the next: 1025 samples for 1024 cells.
    Shared,
    /// A tile begins with the sample after the last one of the tile before.
    Apart,
}

impl ElevationGrid {
    /// One grid from tiles, in any order, that fill a rectangle. All tiles of a column have the same width, all of a
    /// row the same height. Returns notes on how they meet. A tile's memory is released once it is copied.
    ///
    /// # Errors
    /// [`ImportError::Tile`] for a tile that is missing, there twice, or of another size than its row or column;
    /// [`ImportError::Limit`] if the grid would be larger than 16385 samples along a side; [`ImportError::Empty`]
    /// without tiles.
    pub fn join(tiles: Vec<ElevationTile>, edges: TileEdges) -> Result<(Self, Vec<ImportNote>), ImportError> {
        let mut places = BTreeMap::new();
        let (mut widths, mut heights) = (BTreeMap::new(), BTreeMap::new());
        let Some(sample) = tiles.first().map(|tile| tile.grid.sample_kind()) else {
            return Err(ImportError::Empty);
        };
        for ElevationTile { column, row, grid } in tiles {
            let wrong = |problem: String| ImportError::Tile { column, row, problem };
            let (width, height) = (grid.width(), grid.height());
            let expected = (*widths.entry(column).or_insert(width), *heights.entry(row).or_insert(height));
            if expected != (width, height) {
                let (across, down) = expected;
                return Err(wrong(format!("has {width} x {height} samples in place of {across} x {down}")));
            }
            if places.insert((row, column), grid).is_some() {
                return Err(wrong("is given twice".into()));
            }
        }
        let (columns, rows) = (consecutive(&widths), consecutive(&heights));
        let all = columns.iter().flat_map(|&column| rows.iter().map(move |&row| (row, column)));
        if let Some((row, column)) = all.clone().find(|place| !places.contains_key(place)) {
            return Err(ImportError::Tile { column, row, problem: "is missing".into() });
        }
        let mut notes = Vec::new();
        let meeting = Meeting::of(&places);
        let are_shared = match edges {
            TileEdges::Shared => true,
            TileEdges::Apart => false,
            TileEdges::Guess => {
                let are_shared = meeting.looks_shared(&widths);
                if places.len() > 1 {
                    notes.push(ImportNote::EdgesGuessed { are_shared });
                }
                are_shared
            }
        };
        if are_shared && meeting.different > 0 {
            notes.push(ImportNote::EdgesDiffer { count: meeting.different, largest: meeting.largest });
        }
        let overlap = u32::from(are_shared);
        let starts = |sizes: &BTreeMap<i32, u32>| -> (BTreeMap<i32, u64>, u64) {
            let mut next = 0;
            let starts = sizes.iter().map(|(&place, &size)| {
                let start = next;
                next += u64::from(size.saturating_sub(overlap));
                (place, start)
            });
            (starts.collect(), next + u64::from(overlap))
        };
        let ((lefts, width), (tops, height)) = (starts(&widths), starts(&heights));
        let side = |side: u64| u32::try_from(side).unwrap_or(u32::MAX);
        ImageLimits::check_sides(side(width), side(height))?;
        let mut samples = reserve(width * height)?;
        samples.resize((width * height) as usize, f32::NAN);
        // From the last tile on, so that of shared edges those of the left and upper tile stay.
        while let Some(((row, column), grid)) = places.pop_last() {
            let (left, top) = (lefts[&column] as usize, tops[&row] as usize);
            for (z, line) in grid.samples().chunks_exact(grid.width() as usize).enumerate() {
                samples[(top + z) * width as usize + left..][..line.len()].copy_from_slice(line);
            }
        }
        Ok((Self::with_kind(sample, side(width), side(height), samples)?, notes))
    }
}

/// The positions from the first to the last one, but at most one more than there are tiles: enough to show a gap.
fn consecutive(sizes: &BTreeMap<i32, u32>) -> Vec<i32> {
    let (Some((&first, _)), Some((&last, _))) = (sizes.first_key_value(), sizes.last_key_value()) else {
        return Vec::new();
    };
    // One gap is enough to report.
    let most = sizes.len() as i64;
    (i64::from(first)..=i64::from(last)).take(most as usize + 1).map(|at| at as i32).collect()
}

/// How the edges of neighbouring tiles compare.
#[derive(Default)]
struct Meeting {
    equal: u64,
    different: u64,
    largest: f32,
    /// Samples of edges that equal the next ones of their own tile, so that they say nothing.
    level: u64,
}

impl Meeting {
    fn of(places: &BTreeMap<(i32, i32), ElevationGrid>) -> Self {
        let mut found = Self::default();
        for (&(row, column), grid) in places {
            let (width, height) = (grid.width(), grid.height());
            if let Some(right) = column.checked_add(1).and_then(|next| places.get(&(row, next))) {
                let last = width - 1;
                (0..height).for_each(|z| {
                    found.add(grid.value(last, z), right.value(0, z), grid.value(last.saturating_sub(1), z));
                });
            }
            if let Some(below) = row.checked_add(1).and_then(|next| places.get(&(next, column))) {
                let last = height - 1;
                (0..width).for_each(|x| {
                    found.add(grid.value(x, last), below.value(x, 0), grid.value(x, last.saturating_sub(1)));
                });
            }
        }
        found
    }

    fn add(&mut self, own: f32, other: f32, before: f32) {
        if own == other || own.is_nan() && other.is_nan() {
            self.equal += 1;
            self.level += u64::from(own == before || own.is_nan());
        } else {
            self.different += 1;
            // A void on one side has no difference.
            self.largest = self.largest.max((own - other).abs());
        }
    }

    /// Whether most samples of edges are equal; where all is level, whether tiles have a sample more than a power of
    /// two.
    fn looks_shared(&self, widths: &BTreeMap<i32, u32>) -> bool {
        if self.equal == self.level {
            return self.different == 0
                && widths.values().all(|&width| width > 1 && (width - 1).is_power_of_two());
        }
        self.equal >= self.different
    }
}

/// What separates the numbers of a name.
const SEPARATORS: [char; 2] = ['_', '-'];

/// The numbers of a name that follow a letter alone, each with that letter. `1025x1025` has none: that is a size.
fn lettered_numbers(stem: &str) -> Vec<(char, i32)> {
    let number = |(at, letter): (usize, char)| {
        let (before, after) = (&stem[..at], &stem[at + letter.len_utf8()..]);
        let (sign, digits) = match after.strip_prefix('-') {
            Some(digits) if !before.ends_with('-') => (-1, digits),
            _ => (1, after),
        };
        let end = digits.find(|digit: char| !digit.is_ascii_digit()).unwrap_or(digits.len());
        let number: i32 = digits[..end].parse().ok()?;
        // As in `x3y5`, where the number before has its letter.
        let is_first = !before.ends_with(char::is_alphanumeric);
        let before_digits = before.trim_end_matches(|digit: char| digit.is_ascii_digit());
        let follows = before_digits.len() < before.len()
            && before_digits.strip_suffix('-').unwrap_or(before_digits).ends_with(char::is_alphabetic);
        (is_first || follows).then_some((letter, sign * number))
    };
    stem.char_indices().filter(|(_, letter)| letter.is_alphabetic()).filter_map(number).collect()
}

/// The number at the end of a name and the text before it, or `None` without a separator between them.
fn last_number(stem: &str) -> Option<(i32, &str)> {
    let rest = stem.trim_end_matches(|digit: char| digit.is_ascii_digit());
    let (rest, start) = match rest.strip_suffix('-') {
        Some(before) if before.is_empty() || before.ends_with(SEPARATORS) => (before, rest.len() - 1),
        _ => (rest, rest.len()),
    };
    let is_separated = rest.is_empty() || rest.ends_with(SEPARATORS);
    stem[start..].parse().ok().filter(|_| is_separated).map(|number| (number, rest))
}
