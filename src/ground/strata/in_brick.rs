//! Strata in one brick: which of them may be in it at all, and their noise at the corners of its cells.

use glam::{IVec2, IVec3};

use super::records::{BED, BeddingRecord, ColumnCondition, FILL, POCKET, StrataRecords, StratumRecord, VEIN};
use super::value_noise::{Corners, FlatCorners};
use crate::ground::material::MaterialId;
use crate::ground::world::Ground;
use crate::lattice::{BRICK, BrickPos, Column, ONE};

/// The strata of a brick, ready for any of its voxels.
pub(crate) struct BrickStrata<'g> {
    ground: &'g Ground,
    pos: BrickPos,
    heights: [[i32; 8]; 8],
    bedding: &'g BeddingRecord,
    /// The bedding's noise, if there are beds.
    folds: FlatCorners,
    /// Those that may hold a voxel of the brick, topmost first.
    near: Vec<Near<'g>>,
}

/// A stratum that may hold voxels of a brick.
struct Near<'g> {
    record: &'g StratumRecord,
    condition: Option<&'g ColumnCondition>,
    /// It holds them all.
    is_whole: bool,
    roughness: FlatCorners,
    noises: [Corners; 2],
}

/// Least and greatest of some numbers.
fn bounds(values: impl IntoIterator<Item = i32>) -> [i32; 2] {
    values.into_iter().fold([i32::MAX, i32::MIN], |[low, high], value| [low.min(value), high.max(value)])
}

/// Where all numbers of a range lie that are moved by up to `by`: inside another one, outside it, or neither.
fn lies([low, high]: [i32; 2], by: i32, [from, to]: [i32; 2]) -> Option<bool> {
    if high.saturating_add(by) < from || low.saturating_sub(by) >= to {
        Some(false)
    } else if low.saturating_sub(by) >= from && high.saturating_add(by) < to {
        Some(true)
    } else {
        None
    }
}

impl<'g> BrickStrata<'g> {
    pub fn new(ground: &'g Ground, records: &'g StrataRecords, pos: BrickPos) -> Self {
        let low = pos.origin();
        let heights = ground.heights::<8>(Column::of(low));
        // A column beyond the rim is like the nearest on it, and in the same cell of all noise as what is left of the brick.
        let start = ground.nearest_column(low);
        let (start, place) = (IVec3::new(start.x, low.y, start.z), IVec2::new(start.x, start.z));
        let [lowest, highest] = bounds(heights.as_flattened().iter().copied());
        let own_heights = [low.y * ONE, (low.y + BRICK - 1) * ONE];
        let depths = [(lowest - own_heights[1]).max(1), (highest - own_heights[0]).max(1)];
        let bedding = &records.bedding;
        let has_beds = records.strata.iter().any(|record| record.body == BED);
        let folds = if has_beds { bedding.noise().flat_corners(place) } else { [0; 4] };
        let mut own = Self { ground, pos, heights, bedding, folds, near: Vec::new() };
        for (record, condition) in records.strata.iter().zip(&records.conditions) {
            let rough = record.rough;
            let ys = [low.y, low.y + BRICK - 1];
            let known = [
                lies(depths, rough, record.depth),
                lies(own_heights, rough, record.height),
                lies(ys, 0, record.ys),
            ];
            if known.contains(&Some(false)) {
                continue;
            }
            let mut noises = [[0; 8]; 2];
            let is_possible = match record.body {
                BED => own.may_hold_bed(record, own_heights),
                POCKET => {
                    noises[0] = record.noises()[0].corners(start);
                    noises[0].iter().any(|&corner| corner > record.limit)
                }
                VEIN => noises.iter_mut().zip(record.noises()).all(|(corners, noise)| {
                    *corners = noise.corners(start);
                    let [least, greatest] = bounds(*corners);
                    least < record.limit && greatest > -record.limit
                }),
                _ => true,
            };
            if !is_possible {
                continue;
            }
            let is_whole = record.body == FILL && condition.is_none() && known == [Some(true); 3];
            let roughness = if rough == 0 { [0; 4] } else { record.roughness().flat_corners(place) };
            own.near.push(Near { record, condition: condition.as_ref(), is_whole, roughness, noises });
            if is_whole {
                break;
            }
        }
        own
    }

    /// May a bed be in the brick, whose samples have heights in this range?
    fn may_hold_bed(&self, record: &StratumRecord, [low, high]: [i32; 2]) -> bool {
        let start = self.ground.nearest_column(self.pos.origin());
        let corners = [(0, 0), (7, 0), (0, 7), (7, 7)].map(|(x, z)| start.offset(x, z));
        let dip = BeddingRecord { fold: 0, ..*self.bedding };
        let lifts = corners.map(|corner| dip.lift(corner, 0));
        let (fold, rough) = (i64::from(self.bedding.fold), i64::from(record.rough));
        let [least, greatest] = bounds(self.folds).map(|noise| (fold * i64::from(noise)) >> 15);
        let first = i64::from(low) + lifts.iter().min().unwrap_or(&0) + least - rough;
        let last = i64::from(high) + lifts.iter().max().unwrap_or(&0) + greatest + rough;
        let [from, thickness, every] = record.bed.map(i64::from);
        let above = first - from;
        let above = if every > 0 { above.rem_euclid(every) } else { above };
        let end = above + last - first;
        if every > 0 { above < thickness || end >= every } else { above < thickness && end >= 0 }
    }

    pub fn pos(&self) -> BrickPos {
        self.pos
    }

    /// The material of a voxel of the brick, if a stratum holds it.
    pub fn material(&self, point: IVec3) -> Option<MaterialId> {
        let [x, _, z] = (point & (BRICK - 1)).as_usizevec3().to_array();
        let height = point.y * ONE;
        let depth = (self.heights[z][x] - height).max(1);
        let column = self.ground.nearest_column(point);
        let found = self.near.iter().find(|near| near.is_whole || self.holds(near, point.y, column, depth));
        found.map(|near| MaterialId(near.record.material as u8))
    }

    fn holds(&self, near: &Near, y: i32, column: Column, depth: i32) -> bool {
        let Near { record, condition, roughness, noises, .. } = near;
        let (place, at) = (IVec2::new(column.x, column.z), IVec3::new(column.x, y, column.z));
        let moved = match record.rough {
            0 => 0,
            rough => (rough * record.roughness().flat_within(roughness, place)) >> 15,
        };
        let (height, [low, high]) = (y * ONE + moved, record.ys);
        (record.depth[0]..record.depth[1]).contains(&(depth + moved))
            && (record.height[0]..record.height[1]).contains(&height)
            && (low..high).contains(&y)
            && match record.body {
                BED => {
                    let noise = self.bedding.noise().flat_within(&self.folds, place);
                    record.is_in_bed(i64::from(height) + self.bedding.lift(column, noise))
                }
                VEIN => {
                    let mut both = record.noises().into_iter().zip(noises);
                    both.all(|(noise, corners)| noise.within(corners, at).abs() < record.limit)
                }
                POCKET => record.noises()[0].within(&noises[0], at) > record.limit,
                _ => true,
            }
            && condition.is_none_or(|condition| condition.admits(self.ground, column))
    }
}
