//! Floors and ceilings of columns, from the bits of bricks.

use glam::IVec3;

use crate::lattice::{BRICK, BrickPos, Column, ONE, ceil};
use crate::terrain::World;
use crate::volume::layers::ones;
use crate::volume::{Brick, Layers, solid_layers};

/// The height of a ceiling that is not there.
pub(super) const SKY: i32 = i32::MAX;

/// The floors of a square of columns: where each column leaves the ground upwards, with enough air above.
#[derive(Debug)]
pub(super) struct Floors {
    /// The lowest column.
    pub low: Column,
    /// Columns along x and z.
    pub side: usize,
    /// Where the floors of each column begin, row by row; and where the last ones end.
    pub starts: Vec<u32>,
    /// Heights in 1/256 voxel, lowest first in each column.
    pub floor: Vec<i32>,
    /// Heights of the ground above.
    pub ceiling: Vec<i32>,
}

/// A floor that is found: its column's index, its height and that of the ceiling.
type Found = (u32, i32, i32);

/// The 8x8 columns of a stack of bricks.
struct Stack<'a> {
    heights: [[i32; 8]; 8],
    /// The columns that are wanted: bit `z * 8 + x`.
    wanted: u64,
    /// The height of the floor below the air that a column is in.
    open: [i32; 64],
    brick: Option<&'a Brick>,
    y: i32,
}

impl Floors {
    /// The floors of `side` x `side` columns from `low` on that have this much air. There are none outside the world.
    pub fn new(world: &World, low: Column, side: usize, air: i32) -> Self {
        let ground = world.ground();
        let last = low.offset(side as i32 - 1, side as i32 - 1);
        let (first, end) = (
            Column::new(low.x.max(0), low.z.max(0)),
            Column::new(last.x.min(ground.width()), last.z.min(ground.depth())),
        );
        let mut found: Vec<Found> = Vec::with_capacity(side * side + side);
        for z in first.z >> 3..=end.z >> 3 {
            for x in first.x >> 3..=end.x >> 3 {
                let origin = Column::new(x * BRICK, z * BRICK);
                let row = |from: i32, low: i32, high: i32| {
                    let (low, high) = ((low - from).max(0), (high - from).min(7));
                    (low.min(8) as usize, (high + 1).max(0) as usize)
                };
                let (xs, zs) = (row(origin.x, first.x, end.x), row(origin.z, first.z, end.z));
                let index = |bit: usize| {
                    let (x, z) = (origin.x + (bit % 8) as i32 - low.x, origin.z + (bit / 8) as i32 - low.z);
                    (z as usize * side + x as usize) as u32
                };
                let heights = ground.heights::<8>(origin);
                let columns = (zs.0..zs.1).flat_map(|z| (xs.0..xs.1).map(move |x| z * 8 + x));
                let Some(bricks) = world.stacks.get(&(x, z)) else {
                    found.extend(columns.map(|bit| (index(bit), heights[bit / 8][bit % 8], SKY)));
                    continue;
                };
                let wanted = columns.fold(0, |bits: u64, bit| bits | 1 << bit);
                let stack = Stack { heights, wanted, open: [0; 64], brick: None, y: 0 };
                stack.scan(world, (x, z), bricks, |bit, floor, ceiling| {
                    if ceiling == SKY || i64::from(ceiling) - i64::from(floor) >= i64::from(air) {
                        found.push((index(bit), floor, ceiling));
                    }
                });
            }
        }
        Self::sorted(low, side, &found)
    }

    /// Puts floors in order of their columns. Those of each column are found from below.
    fn sorted(low: Column, side: usize, found: &[Found]) -> Self {
        let mut starts = vec![0; side * side + 1];
        for &(column, ..) in found {
            starts[column as usize + 1] += 1;
        }
        for column in 0..side * side {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let (mut floors, mut ceilings) = (vec![0; found.len()], vec![0; found.len()]);
        for &(column, floor, ceiling) in found {
            let at = next[column as usize];
            next[column as usize] += 1;
            (floors[at as usize], ceilings[at as usize]) = (floor, ceiling);
        }
        Self { low, side, starts, floor: floors, ceiling: ceilings }
    }

    /// Number of floors.
    pub fn len(&self) -> usize {
        self.floor.len()
    }

    /// The floors of the column with this index.
    pub fn of(&self, column: usize) -> std::ops::Range<usize> {
        self.starts[column] as usize..self.starts[column + 1] as usize
    }
}

impl<'a> Stack<'a> {
    /// Calls `each` with the columns' floors and ceilings, those of each column from below.
    fn scan(
        mut self,
        world: &'a World,
        (x, z): (i32, i32),
        bricks: &[i32],
        mut each: impl FnMut(usize, i32, i32),
    ) {
        // The bricks that the undug surface lies in, or between.
        let tops = self.heights.iter().flatten().map(|&height| ceil(height));
        let (least, most) = tops.fold((i32::MAX, i32::MIN), |(least, most), y| (least.min(y), most.max(y)));
        let pristine = (least - 1) >> 3..=most >> 3;
        let mut scanned: Vec<i32> = pristine.clone().chain(bricks.iter().copied()).collect();
        scanned.sort_unstable();
        scanned.dedup();
        // Deep ground is solid. Bricks that are not scanned are all solid or all air.
        let (mut below, mut expected) = (self.wanted, i32::MIN);
        let outside = |y: i32| if y < *pristine.start() { u64::MAX } else { 0 };
        for y in scanned {
            let brick = world.bricks.get(&BrickPos(IVec3::new(x, y, z))).map(std::convert::AsRef::as_ref);
            if y != expected && expected != i32::MIN {
                self.layer(below, outside(expected), None, expected * BRICK, &mut each);
                below = outside(expected) & self.wanted;
            } else if expected == i32::MIN {
                below = outside(y - 1) & self.wanted;
            }
            let layers: Layers = match brick {
                Some(brick) => *brick.solid(),
                None => solid_layers(&self.heights, y * BRICK),
            };
            for (layer, &solid) in (y * BRICK..).zip(&layers) {
                self.layer(below, solid, brick, layer, &mut each);
                below = solid & self.wanted;
            }
            expected = y + 1;
        }
        self.layer(below, outside(expected), None, expected.saturating_mul(BRICK), &mut each);
        let open = !outside(expected) & self.wanted;
        ones(open).for_each(|bit| each(bit, self.open[bit], SKY));
    }

    /// Looks at the samples of a layer and those below it.
    fn layer(
        &mut self,
        below: u64,
        solid: u64,
        brick: Option<&'a Brick>,
        y: i32,
        each: &mut impl FnMut(usize, i32, i32),
    ) {
        let (floors, ceilings) = (below & !solid & self.wanted, !below & solid & self.wanted);
        if floors | ceilings != 0 {
            let under = if y & 7 == 0 { self.brick } else { brick };
            let under = under.filter(|_| y & 7 != 0 || self.y == (y >> 3) - 1);
            for bit in ones(floors) {
                self.open[bit] = self.crossing(bit, y, [under, brick]);
            }
            for bit in ones(ceilings) {
                each(bit, self.open[bit], self.crossing(bit, y, [under, brick]));
            }
        }
        (self.brick, self.y) = (brick, y >> 3);
    }

    /// Where the surface crosses a column between the layer at `y` and the one below.
    fn crossing(&self, bit: usize, y: i32, [under, over]: [Option<&Brick>; 2]) -> i32 {
        let density = |brick: Option<&Brick>, y: i32| {
            let stored = brick.and_then(|brick| brick.samples()[(y & 7) as usize * 64 + bit].distance());
            i64::from(stored.unwrap_or_else(|| y * ONE - self.heights[bit / 8][bit % 8]).abs())
        };
        let (low, high) = (density(under, y - 1), density(over, y));
        (y - 1) * ONE + (i64::from(ONE) * low / (low + high).max(1)) as i32
    }
}
