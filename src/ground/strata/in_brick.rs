//! The strata in one brick, and the bricks that a thread asked for last.
//!
//! An edit and the meshes around it ask for the materials of a few hundred voxels in a dozen bricks. Most strata are
//! ruled out for 4x4x4 voxels at a time, an eighth of a brick: by their ranges when the first voxel of the eighth is
//! asked for, and by bounds of their noise when one comes that the ranges leave open. The corners of the noise are
//! hashed once for a brick.

use std::cell::RefCell;

use glam::{IVec2, IVec3};

use super::StrataRecords;
use super::records::{BED, FILL, POCKET, StratumRecord, VEIN};
use super::value_noise::{Corners, ValueNoise};
use crate::ground::material::MaterialId;
use crate::ground::world::Ground;
use crate::lattice::{BRICK, BrickPos, Column, ONE};

/// Bricks that a thread keeps along each axis.
const KEPT: i32 = 4;

thread_local! {
    static BRICKS: RefCell<Vec<BrickStrata>> = const { RefCell::new(Vec::new()) };
}

/// Calls `ask` with the strata of a brick.
#[inline]
pub(super) fn with_brick<R>(
    ground: &Ground,
    records: &StrataRecords,
    pos: BrickPos,
    ask: impl FnOnce(&mut BrickStrata) -> R,
) -> Option<R> {
    let IVec3 { x, y, z } = pos.0 & (KEPT - 1);
    let place = ((y * KEPT + z) * KEPT + x) as usize;
    BRICKS.with_borrow_mut(|bricks| {
        if bricks.is_empty() {
            bricks.resize_with((KEPT * KEPT * KEPT) as usize, BrickStrata::default);
        }
        let brick = bricks.get_mut(place)?;
        if brick.key != (records.id, pos.0) {
            brick.fill(ground, records, pos);
        }
        Some(ask(brick))
    })
}

/// The strata of a brick. Sets of strata are bits, by their numbers.
#[derive(Default)]
pub(super) struct BrickStrata {
    /// Which strata, by their [id](StrataRecords::id), and which brick. No strata have id 0.
    key: (u64, IVec3),
    /// Heights of the columns, in rows along x.
    heights: [[i32; 8]; 8],
    /// Strata whose noise is known.
    hashed: u32,
    /// By the numbers of strata.
    noises: Vec<Noises>,
    /// The eighths that are known: a bit each.
    known_eighths: u8,
    /// The eighths at low and high x, then both at high z, then all four at high y.
    eighths: [Eighth; 8],
}

/// The strata in an eighth of a brick.
#[derive(Clone, Copy, Default)]
struct Eighth {
    /// Strata that may hold a voxel of the eighth.
    near: u32,
    /// Strata whose ranges hold all voxels of the eighth, so only the body and the column decide.
    inside: u32,
    /// Strata whose bodies were looked for: the ones still near may be in it.
    bounded: u32,
}

/// Voxels along the side of an eighth.
const HALF: i32 = BRICK / 2;

/// The noise of a stratum at the corners of the brick's cells.
#[derive(Clone, Copy, Default)]
struct Noises {
    roughness: Corners,
    /// Noise of the body; for beds, the first is the bedding's.
    body: [Corners; 2],
}

/// Least and greatest of some numbers.
fn bounds(values: impl IntoIterator<Item = i32>) -> [i32; 2] {
    values.into_iter().fold([i32::MAX, i32::MIN], |[low, high], value| [low.min(value), high.max(value)])
}

/// Relation of a range, widened by `by`, to another one: inside (`Some(true)`), outside (`Some(false)`), or
/// overlapping.
#[inline]
fn range_relation([low, high]: [i32; 2], by: i32, [from, to]: [i32; 2]) -> Option<bool> {
    if high + by < from || low - by >= to {
        Some(false)
    } else if low - by >= from && high + by < to {
        Some(true)
    } else {
        None
    }
}

/// Depth of a voxel, in 1/256 voxel: 0 to 255 for the highest solid one of its column, and 0 above it.
#[inline]
fn depth(height: i32, y: i32) -> i32 {
    (height - y * ONE - 1).max(0)
}

impl BrickStrata {
    /// Starts over with another brick.
    fn fill(&mut self, ground: &Ground, records: &StrataRecords, pos: BrickPos) {
        self.key = (records.id, pos.0);
        self.heights = ground.heights(Column::of(pos.origin()));
        (self.hashed, self.known_eighths) = (0, 0);
        self.noises.resize(records.strata.len(), Noises::default());
    }

    /// The lowest voxel of an eighth.
    fn low(&self, eighth: usize) -> IVec3 {
        let half = |bit: usize| (eighth >> bit & 1) as i32 * HALF;
        BrickPos(self.key.1).origin() + IVec3::new(half(0), half(2), half(1))
    }

    /// Finds the strata of an eighth by their ranges.
    fn fill_eighth(&mut self, records: &StrataRecords, number: usize) {
        let low = self.low(number).y;
        let (x, z) = ((number & 1) * 4, (number >> 1 & 1) * 4);
        let rows = self.heights[z..z + 4].iter();
        let [lowest, highest] = bounds(rows.flat_map(|row| row[x..x + 4].iter().copied()));
        let ys = [low, low + HALF - 1];
        let (depths, heights) = ([depth(lowest, ys[1]), depth(highest, ys[0])], ys.map(|y| y * ONE));
        let mut eighth = Eighth::default();
        for (number, record) in records.strata.iter().enumerate() {
            let is_deep = range_relation(depths, record.rough, record.depth);
            if is_deep == Some(false) {
                continue;
            }
            let known = [
                is_deep,
                range_relation(heights, record.rough, record.height),
                range_relation(ys, 0, record.ys),
            ];
            if known.contains(&Some(false)) {
                continue;
            }
            eighth.near |= 1 << number;
            if known == [Some(true); 3] {
                eighth.inside |= 1 << number;
                if record.body == FILL && record.condition == 0 {
                    // It holds what those above it leave.
                    break;
                }
            }
        }
        self.known_eighths |= 1 << number;
        self.eighths[number] = eighth;
    }

    /// The voxels of a set that are the highest solid ones of their columns. Sets are bits `z * 8 + x` of the layer at
    /// a y.
    #[inline]
    pub fn tops(&self, y: i32, voxels: u64) -> u64 {
        let heights = self.heights.as_flattened();
        let is_top = |&column: &usize| (1..=ONE).contains(&(heights[column] - y * ONE));
        ones(voxels).filter(is_top).fold(0, |tops, column| tops | 1 << column)
    }

    /// Calls `each` with the materials of a set of voxels, and which of them each holds; [`MaterialId::GROUND`] for
    /// those that no stratum holds. Sets are bits `z * 8 + x` of the layer at a y.
    #[inline]
    pub fn for_materials(
        &mut self,
        ground: &Ground,
        records: &StrataRecords,
        y: i32,
        voxels: u64,
        mut each: impl FnMut(MaterialId, u64),
    ) {
        for quarter in 0..4 {
            let mut left = voxels & 0x0f0f_0f0f << ((quarter & 1) * 4 + (quarter >> 1) * 32);
            if left == 0 {
                continue;
            }
            let eighth = quarter + (y >> 2 & 1) as usize * 4;
            if self.known_eighths >> eighth & 1 == 0 {
                self.fill_eighth(records, eighth);
            }
            for number in ones(self.eighths[eighth].near.into()) {
                let record = &records.strata[number];
                let held = self.held_by(ground, records, (number, record), (eighth, y), left);
                if held != 0 {
                    each(MaterialId(record.material as u8), held);
                    left &= !held;
                    if left == 0 {
                        break;
                    }
                }
            }
            if left != 0 {
                each(MaterialId::GROUND, left);
            }
        }
    }

    /// The voxels of a set, in one eighth, that a stratum holds.
    #[inline]
    fn held_by(
        &mut self,
        ground: &Ground,
        records: &StrataRecords,
        (number, record): (usize, &StratumRecord),
        (eighth, y): (usize, i32),
        voxels: u64,
    ) -> u64 {
        // Those for which ranges decide, and those that they leave to noise.
        let (mut held, mut open) = (0, voxels);
        if self.eighths[eighth].inside >> number & 1 == 1 {
            if record.body == FILL {
                (held, open) = (voxels, 0);
            }
        } else {
            open = 0;
            let is_level = match (record.ys[0]..record.ys[1]).contains(&y) {
                true => range_relation([y * ONE; 2], record.rough, record.height),
                false => Some(false),
            };
            if is_level == Some(false) {
                return 0;
            }
            let is_sure = record.body == FILL && is_level == Some(true);
            for column in ones(voxels) {
                let depth = depth(self.heights.as_flattened()[column], y);
                match range_relation([depth; 2], record.rough, record.depth) {
                    Some(false) => {}
                    Some(true) if is_sure => held |= 1 << column,
                    _ => open |= 1 << column,
                }
            }
        }
        if open != 0 {
            held |= self.held_by_noise(records, (number, record), (eighth, y), open);
        }
        if record.condition != 0 && held != 0 {
            let low = Column::of(BrickPos(self.key.1).origin());
            let column = |bit: usize| low.offset((bit & 7) as i32, (bit >> 3) as i32);
            let is_met = |bit: &usize| records.meets(ground, column(*bit), record.condition);
            held = ones(held).filter(is_met).fold(0, |held, column| held | 1 << column);
        }
        held
    }

    /// The voxels of a set, in one eighth, that a stratum holds, if its condition on the column is met.
    #[inline(never)]
    fn held_by_noise(
        &mut self,
        records: &StrataRecords,
        (number, record): (usize, &StratumRecord),
        (eighth, y): (usize, i32),
        voxels: u64,
    ) -> u64 {
        let flag = 1 << number;
        if self.eighths[eighth].bounded & flag == 0 {
            self.eighths[eighth].bounded |= flag;
            if !self.may_hold(records, number, eighth) {
                self.eighths[eighth].near &= !flag;
                return 0;
            }
        }
        let is_inside = self.eighths[eighth].inside & flag != 0;
        let Noises { roughness, body } = self.noises[number];
        let (bedding, low) = (&records.bedding, BrickPos(self.key.1).origin());
        let is_held = |&column: &usize| {
            let point = IVec3::new(low.x + (column & 7) as i32, y, low.z + (column >> 3) as i32);
            let place = IVec2::new(point.x, point.z);
            let moved = match record.rough {
                0 => 0,
                _ if is_inside && record.body != BED => 0,
                _ => record.moved(record.roughness().flat_within(roughness, place)),
            };
            let (depth, height) = (depth(self.heights.as_flattened()[column], y), y * ONE);
            let is_in_ranges = is_inside
                || (record.depth[0]..record.depth[1]).contains(&(depth + moved))
                    && (record.height[0]..record.height[1]).contains(&(height + moved));
            is_in_ranges
                && match record.body {
                    BED => {
                        let fold = bedding.fold_at(bedding.noise().flat_within(body[0], place));
                        record.is_in_bed(i64::from(height + moved + fold) + bedding.dip_at(Column::of(point)))
                    }
                    VEIN => {
                        record.noise().within(body[0], point).abs() < record.limit
                            && record.second_noise().within(body[1], point).abs() < record.limit
                    }
                    POCKET => record.noise().within(body[0], point) > record.limit,
                    _ => true,
                }
        };
        ones(voxels).filter(is_held).fold(0, |held, column| held | 1 << column)
    }

    /// Returns `true` if the body of a stratum may be in an eighth.
    fn may_hold(&mut self, records: &StrataRecords, number: usize, eighth: usize) -> bool {
        let record = &records.strata[number];
        let Noises { body, .. } = self.noises(records, number);
        let low = self.low(eighth);
        let high = low + (HALF - 1);
        let crosses = |noise: ValueNoise, corners| {
            let [least, greatest] = noise.bounds_within(corners, low, high);
            least < record.limit && greatest > -record.limit
        };
        match record.body {
            BED => may_hold_bed(records, record, body[0], [low, high]),
            POCKET => record.noise().bounds_within(body[0], low, high)[1] > record.limit,
            VEIN => crosses(record.noise(), body[0]) && crosses(record.second_noise(), body[1]),
            _ => true,
        }
    }

    /// The noise of a stratum, hashed when it is first asked for.
    fn noises(&mut self, records: &StrataRecords, number: usize) -> Noises {
        if self.hashed >> number & 1 == 0 {
            self.hashed |= 1 << number;
            let low = BrickPos(self.key.1).origin();
            let (place, record) = (IVec2::new(low.x, low.z), &records.strata[number]);
            let mut noises = Noises::default();
            if record.rough != 0 {
                noises.roughness = record.roughness().flat_corners(place);
            }
            match record.body {
                BED => noises.body[0] = records.bedding.noise().flat_corners(place),
                POCKET => noises.body[0] = record.noise().corners(low),
                VEIN => noises.body = [record.noise(), record.second_noise()].map(|noise| noise.corners(low)),
                _ => {}
            }
            self.noises[number] = noises;
        }
        self.noises[number]
    }
}

/// Returns `true` if a bed may be in a box of a brick, where the bedding's noise has these corner values.
fn may_hold_bed(
    records: &StrataRecords,
    record: &StratumRecord,
    folds: Corners,
    [low, high]: [IVec3; 2],
) -> bool {
    let (bedding, rough) = (&records.bedding, i64::from(record.rough));
    let [from, to] = [low, high].map(|end| IVec2::new(end.x, end.z));
    let dips = [(from.x, from.y), (to.x, from.y), (from.x, to.y), (to.x, to.y)]
        .map(|(x, z)| bedding.dip_at(Column::new(x, z)));
    let folds = bedding.noise().flat_bounds_within(folds, from, to);
    let [least, greatest] = folds.map(|noise| i64::from(bedding.fold_at(noise)));
    let first = i64::from(low.y * ONE) + dips.iter().min().unwrap_or(&0) + least - rough;
    let last = i64::from(high.y * ONE) + dips.iter().max().unwrap_or(&0) + greatest + rough;
    let [from, thickness, every] = record.bed.map(i64::from);
    let above = first - from;
    let above = if every > 0 { above.rem_euclid(every) } else { above };
    let end = above + last - first;
    above < thickness && end >= 0 || every > 0 && end >= every
}

/// Positions of the bits that are set, lowest first.
#[inline]
pub(super) fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}
