//! Boxes of cells, sorted into the bricks that hold them.
//!
//! A change in a brick also shows in cells of the bricks next to it. Where there are many boxes, each thread takes a
//! slab of bricks, one brick thick along x: all cells in it belong to boxes whose home is that slab or one next to it.
//! The bricks that are found are split into pieces again, so that many threads share a few long slabs as well.
//!
//! ```text
//! home_x           3         4         5         6
//!             |         |         |         |         |
//! reached         [========]  [=========]                 cells of two boxes, at home in 3 and in 5
//!                                        [=======]        one at home in 6
//!
//! slab 4      - - - - - |=========|                       looks at homes 3, 4, 5
//! slab 5                          |=========|             looks at homes 4, 5, 6
//! ```
//!
//! Boxes are sorted by `home_x`, so those of a slab are contiguous, and slabs in order are stacks in order.

use std::ops::RangeInclusive;

use glam::IVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::lattice::{BrickPos, ItemCost, LatticeBox, pieces};

/// A dense table of bricks is used while it has at most this many places per box; otherwise a hash table.
const PLACES: u64 = 64;

/// A piece ends with the first stack that ends after this many bricks.
const PIECE: usize = 128;

/// A brick and cells of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BrickCells {
    pub brick: BrickPos,
    /// The box around the cells that changes reach.
    pub cells: LatticeBox,
    /// Whether any cell of the brick may join the mask.
    pub may_join: bool,
}

/// Cells by the bricks that hold them: by stacks of bricks, each from below.
#[derive(Debug, Default)]
pub(crate) struct ByBrick {
    /// In order, split between stacks.
    slabs: Vec<Vec<BrickCells>>,
}

/// Cells that a change reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reached {
    /// Where the change is along x, in bricks. The cells lie there, or in the bricks next to it.
    pub home_x: i32,
    /// `None` where it reaches nothing.
    pub cells: Option<LatticeBox>,
    /// The cells that may join the mask; beyond the world's rim there may be some as well.
    pub joining: Option<LatticeBox>,
}

impl ByBrick {
    /// The bricks that hold cells which changes reach, each with the box around its own of them. Changes must be sorted
    /// by where they are at home.
    pub fn new<T: Sync>(changes: &[T], reached: impl Fn(&T) -> Reached + Sync) -> Self {
        let (Some(first), Some(last)) = (changes.first(), changes.last()) else { return Self::default() };
        let home_x = |change: &T| reached(change).home_x;
        let slabs = home_x(first) - 1..=home_x(last) + 1;
        let all = |changes: &[T]| changes.iter().map(&reached).collect();
        if !ItemCost::Lookup.is_shared(changes.len()) {
            return Self { slabs: vec![within(slabs, all(changes))] };
        }
        let slab = |x: i32| {
            let from = changes.partition_point(|change| home_x(change) < x - 1);
            let end = changes.partition_point(|change| home_x(change) <= x + 1);
            within(x..=x, all(&changes[from..end]))
        };
        Self { slabs: slabs.into_par_iter().map(slab).collect() }
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.slabs.iter().map(Vec::len).sum()
    }

    /// Collects what `work` makes of all stacks, in order; in parallel where there are many. `work` gets several whole
    /// stacks at a time.
    pub fn collect<R: Clone + Send + Sync>(
        &self,
        work: impl Fn(&[BrickCells], &mut Vec<R>) + Sync,
    ) -> Vec<R> {
        if !ItemCost::Lookup.is_shared(self.len()) {
            let mut found = Vec::with_capacity(self.len());
            self.slabs.iter().for_each(|slab| work(slab, &mut found));
            return found;
        }
        let pieces: Vec<&[BrickCells]> =
            self.slabs.iter().flat_map(|slab| pieces(slab, PIECE, is_same_stack)).collect();
        let of_piece = |piece: &&[BrickCells]| {
            let mut found = Vec::with_capacity(piece.len());
            work(piece, &mut found);
            found
        };
        pieces.par_iter().with_max_len(1).map(of_piece).collect::<Vec<_>>().concat()
    }
}

/// Returns `true` if both bricks belong to the same stack.
pub(crate) fn is_same_stack(a: &BrickCells, b: &BrickCells) -> bool {
    a.brick.stack() == b.brick.stack()
}

/// The box around some cells of a brick, as the sides of it that lie in the brick: bits 0 to 7 those along x,
/// 8 to 15 along y, 16 to 23 along z. The box around two boxes is the bitwise or. Also whether any of the
/// cells may join the mask.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Bits(u32);

impl Bits {
    const MAY_JOIN: u32 = 1 << 24;

    /// The part of a side that lies in a brick.
    fn side(brick: i32, low: i32, high: i32) -> u32 {
        let (low, high) = ((low - brick * 8).max(0), (high - brick * 8).min(7));
        0xff << low & 0xff >> (7 - high)
    }

    fn include(&mut self, other: u32) {
        self.0 |= other;
    }

    fn of(self, brick: IVec3) -> BrickCells {
        let sides = [self.0, self.0 >> 8, self.0 >> 16].map(|side| (side & 0xff) as u8);
        let first = IVec3::from_array(sides.map(|side| side.trailing_zeros() as i32));
        let last = IVec3::from_array(sides.map(|side| 7 - side.leading_zeros() as i32));
        let cells = LatticeBox { min: brick * 8 + first, max: brick * 8 + last };
        BrickCells { brick: BrickPos(brick), cells, may_join: self.0 & Self::MAY_JOIN != 0 }
    }
}

/// The bricks that hold cells of the changes' boxes and whose x lies in a range.
fn within(xs: RangeInclusive<i32>, changes: Vec<Reached>) -> Vec<BrickCells> {
    let bricks_of = |cells: LatticeBox| {
        let LatticeBox { min, max } = BrickPos::range(cells);
        LatticeBox::new(min.with_x(min.x.max(*xs.start())), max.with_x(max.x.min(*xs.end())))
    };
    let boxes = || changes.iter().filter_map(|change| Some((change, bricks_of(change.cells?)?)));
    let Some(all) = boxes().map(|(_, bricks)| bricks).reduce(LatticeBox::union) else { return Vec::new() };
    let size = all.size();
    if all.volume() > PLACES * changes.len() as u64 {
        let mut index: FxHashMap<BrickPos, Bits> = FxHashMap::default();
        enter_all(boxes(), |low, high, pile| {
            for y in low.y..=high {
                index.entry(BrickPos(low.with_y(y))).or_default().include(pile.bits(y));
            }
        });
        let mut found: Vec<BrickCells> = index.into_iter().map(|(brick, bits)| bits.of(brick.0)).collect();
        found.sort_unstable_by_key(|own| own.brick);
        return found;
    }
    let mut table = vec![Bits::default(); all.volume() as usize];
    enter_all(boxes(), |low, high, pile| {
        let at = low - all.min;
        let bricks = &mut table[((at.x * size.z + at.z) * size.y + at.y) as usize..];
        (low.y..=high).zip(bricks).for_each(|(y, own)| own.include(pile.bits(y)));
    });
    let mut found = Vec::with_capacity(table.iter().filter(|bits| bits.0 != 0).count());
    for (at, stack) in (0..).zip(table.chunks_exact(size.y as usize)) {
        let low = all.min + IVec3::new(at / size.z, 0, at % size.z);
        let filled = (0..).zip(stack).filter(|(_, bits)| bits.0 != 0);
        found.extend(filled.map(|(y, bits)| bits.of(low + IVec3::new(0, y, 0))));
    }
    found
}

/// Cells of bricks above each other.
struct BrickColumn {
    /// Along x and z, as [`Bits`] have them.
    sides: u32,
    /// The lowest and the highest one.
    cells: [i32; 2],
    /// The lowest and the highest cell, in bricks, that may join the mask.
    joining: Option<[i32; 2]>,
}

impl BrickColumn {
    /// The bits of the brick at this height.
    fn bits(&self, y: i32) -> u32 {
        let [low, high] = self.cells;
        let may_join = self.joining.is_some_and(|[low, high]| low <= y && y <= high);
        self.sides | Bits::side(y, low, high) << 8 | if may_join { Bits::MAY_JOIN } else { 0 }
    }
}

/// Enters the cells of changes into some bricks of each: `enter` gets the lowest and the highest one of bricks above
/// each other, and their cells.
fn enter_all<'r>(
    changes: impl Iterator<Item = (&'r Reached, LatticeBox)>,
    mut enter: impl FnMut(IVec3, i32, &BrickColumn),
) {
    for (change, LatticeBox { min, max }) in changes {
        let Some(cells) = change.cells else { continue };
        let joining = change.joining.map(BrickPos::range);
        for x in min.x..=max.x {
            let of_x = Bits::side(x, cells.min.x, cells.max.x);
            for z in min.z..=max.z {
                let is_in_line = |bricks: &LatticeBox| {
                    bricks.min.x <= x && x <= bricks.max.x && bricks.min.z <= z && z <= bricks.max.z
                };
                let pile = BrickColumn {
                    sides: Bits::side(z, cells.min.z, cells.max.z) << 16 | of_x,
                    cells: [cells.min.y, cells.max.y],
                    joining: joining.filter(is_in_line).map(|bricks| [bricks.min.y, bricks.max.y]),
                };
                enter(IVec3::new(x, min.y, z), max.y, &pile);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use fastrand::Rng;

    use super::*;

    /// All of them, one after the other.
    fn by_brick(changes: &[Reached]) -> Vec<BrickCells> {
        let found = ByBrick::new(changes, |&reached| reached);
        let all = found.slabs.concat();
        assert_eq!(found.len(), all.len());
        assert!(found.collect(|stacks, all| all.extend_from_slice(stacks)) == all);
        // A stack is given to one thread.
        let mut places = found.collect(|stacks, all| {
            let mut own: Vec<_> = stacks.iter().map(|own| own.brick.stack()).collect();
            own.dedup();
            all.append(&mut own);
        });
        let count = places.len();
        places.dedup();
        assert_eq!(places.len(), count);
        all
    }

    /// A simple implementation, brick by brick.
    fn naive(changes: &[Reached]) -> Vec<BrickCells> {
        let mut all: BTreeMap<_, BrickCells> = BTreeMap::new();
        for (reached, cells) in changes.iter().filter_map(|reached| Some((reached, reached.cells?))) {
            for brick in BrickPos::covering(cells) {
                let own = brick.samples().intersection(cells).expect("covered");
                let may_join =
                    reached.joining.is_some_and(|joining| brick.samples().intersection(joining).is_some());
                let all = all.entry(brick).or_insert(BrickCells { brick, cells: own, may_join });
                all.cells = all.cells.union(own);
                all.may_join |= may_join;
            }
        }
        all.into_values().collect()
    }

    fn sorted(mut boxes: Vec<Reached>) -> Vec<Reached> {
        boxes.sort_by_key(|reached| reached.home_x);
        boxes
    }

    #[test]
    fn many_boxes_are_sorted_like_few() {
        let mut rng = Rng::with_seed(5);
        for (count, homes, height) in [
            (40, 3, 30),
            (ItemCost::Lookup.shared_from(), 1, 40),
            (700, 4, 20),
            (900, 60, 2000),
            (2000, 9, 90),
        ] {
            let reached = |rng: &mut Rng| {
                let home_x = rng.i32(-homes..homes);
                let along = |rng: &mut Rng, low: i32, high: i32| {
                    let (a, b) = (rng.i32(low..=high), rng.i32(low..=high));
                    (a.min(b), a.max(b))
                };
                // From two cells below a brick to one above.
                let x = along(rng, home_x * 8 - 2, home_x * 8 + 8);
                let (y, z) = (along(rng, -height, height), along(rng, -30, 30));
                let (y, z) = ((y.0, y.1.min(y.0 + 10)), (z.0, z.1.min(z.0 + 10)));
                let cells = LatticeBox { min: IVec3::new(x.0, y.0, z.0), max: IVec3::new(x.1, y.1, z.1) };
                let joining = LatticeBox::new(cells.min + 1, cells.max - 1).filter(|_| rng.bool());
                Reached { home_x, cells: (rng.u8(..) > 9).then_some(cells), joining }
            };
            let boxes = sorted((0..count).map(|_| reached(&mut rng)).collect());
            assert!(by_brick(&boxes) == naive(&boxes), "{count} boxes at {homes} homes");
        }
    }

    /// Only one box at each origin reaches the brick next to it; the others reach no other brick.
    #[test]
    fn cells_next_to_their_origin_brick_are_found_in_every_slab() {
        let point = |home_x: i32, x: i32, y: i32| Reached {
            home_x,
            cells: Some(LatticeBox::point(IVec3::new(x, y, 4))),
            joining: None,
        };
        for home in 2..8 {
            for beside in [home * 8 - 2, home * 8 - 1, home * 8 + 8] {
                // The others at the same home, or at the ones at both ends.
                for others in [[home; 2], [2, 7]] {
                    let others =
                        others.into_iter().flat_map(|at| (0..400).map(move |y| point(at, at * 8 + 3, y)));
                    let boxes = sorted(others.chain([point(home, beside, 900)]).collect());
                    assert!(ItemCost::Lookup.is_shared(boxes.len()));
                    let found = by_brick(&boxes);
                    assert!(found == naive(&boxes), "{beside} of {home}");
                    let own = BrickPos::of(IVec3::new(beside, 900, 4));
                    assert!(found.iter().any(|found| found.brick == own), "{beside} of {home}");
                }
            }
        }
    }
}
