//! The strata in one brick, and the bricks that a thread asked for last.
//!
//! An edit and the meshes around it ask for the materials of a few hundred voxels in a dozen bricks, many of them several
//! times. So a brick first finds out which strata may be in it at all, hashes the corners of their noise once, and keeps
//! what it found for each column and voxel.

use std::cell::RefCell;

use glam::{IVec2, IVec3};

use super::StrataRecords;
use super::records::{BED, BeddingRecord, FILL, POCKET, StratumRecord, VEIN};
use super::value_noise::{Corners, FlatCorners, ValueNoise};
use crate::ground::material::MaterialId;
use crate::ground::world::Ground;
use crate::lattice::{BRICK, BrickPos, Column, ONE};

/// Bricks that a thread keeps along each axis.
const KEPT: i32 = 4;

thread_local! {
    static BRICKS: RefCell<Vec<BrickStrata>> = const { RefCell::new(Vec::new()) };
}

/// A voxel of the ground, with the column of the world that is nearest.
#[derive(Clone, Copy)]
pub(super) struct Voxel {
    pub column: Column,
    pub y: i32,
    /// How deep it lies in 1/256 voxel: 0 to 255 for the highest solid voxel of its column, and 0 above it.
    pub depth: i32,
}

/// The material that strata give a voxel; [`MaterialId::GROUND`] if no stratum holds it.
pub(super) fn material(ground: &Ground, records: &StrataRecords, voxel: Voxel) -> Option<MaterialId> {
    let pos = BrickPos::of(voxel.column.at(voxel.y));
    let IVec3 { x, y, z } = pos.0 & (KEPT - 1);
    BRICKS.with_borrow_mut(|bricks| {
        let place = ((y * KEPT + z) * KEPT + x) as usize;
        if bricks.is_empty() {
            bricks.resize_with((KEPT * KEPT * KEPT) as usize, BrickStrata::default);
        }
        let brick = bricks.get_mut(place)?;
        if brick.key != (records.id, pos.0) {
            brick.fill(ground, records, pos);
        }
        Some(brick.material(ground, records, voxel))
    })
}

/// The strata of a brick.
#[derive(Default)]
struct BrickStrata {
    /// Which strata, by their [id](StrataRecords::id), and which brick. No strata have id 0.
    key: (u64, IVec3),
    /// The bedding's noise at the corners of its cell.
    folds: FlatCorners,
    /// The strata that may hold a voxel of the brick, topmost first.
    near: Vec<Near>,
    /// The columns for which `conditions` are known.
    known_columns: u64,
    /// The conditions of strata that a column fulfils: a bit each.
    conditions: Conditions,
    /// The voxels for which `materials` are known: bit `z * 8 + x` of layer y.
    known: [u64; 8],
    materials: Materials,
}

/// One word for each column; only those that are known count.
struct Conditions([u32; 64]);

/// One material for each voxel; only those that are known count.
struct Materials([MaterialId; 512]);

impl Default for Conditions {
    fn default() -> Self {
        Self([0; 64])
    }
}

impl Default for Materials {
    fn default() -> Self {
        Self([MaterialId(0); 512])
    }
}

/// A stratum that may hold voxels of a brick.
struct Near {
    /// Its number.
    number: usize,
    /// It holds them all.
    is_whole: bool,
    /// Its ranges hold all of them, so only its body decides.
    is_inside: bool,
    /// The depths at which it may be, in 1/256 voxel, the second not included: noise included.
    depth: [i32; 2],
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

impl BrickStrata {
    /// Begins anew, with another brick.
    fn fill(&mut self, ground: &Ground, records: &StrataRecords, pos: BrickPos) {
        let low = pos.origin();
        self.key = (records.id, pos.0);
        let column_heights = ground.heights::<8>(Column::of(low));
        (self.known_columns, self.known) = (0, [0; 8]);
        self.near.clear();
        let place = IVec2::new(low.x, low.z);
        let [lowest, highest] = bounds(column_heights.as_flattened().iter().copied());
        let ys = [low.y, low.y + BRICK - 1];
        let heights = ys.map(|y| y * ONE);
        let depths = [lowest - heights[1], highest - heights[0]].map(|distance| (distance - 1).max(0));
        self.folds = if records.has_beds { records.bedding.noise().flat_corners(place) } else { [0; 4] };
        for (number, record) in records.strata.iter().enumerate() {
            let rough = record.rough;
            let is_deep = lies(depths, rough, record.depth);
            if is_deep == Some(false) {
                continue;
            }
            let known = [is_deep, lies(heights, rough, record.height), lies(ys, 0, record.ys)];
            if known.contains(&Some(false)) {
                continue;
            }
            let mut noises = [[0; 8]; 2];
            let is_possible = match record.body {
                BED => self.may_hold_bed(records, record, heights),
                POCKET => {
                    noises[0] = record.noise().corners(low);
                    record.noise().bounds_within(&noises[0], low, low + 7)[1] > record.limit
                }
                VEIN => {
                    noises.iter_mut().zip([record.noise(), record.second_noise()]).all(|(corners, noise)| {
                        *corners = noise.corners(low);
                        let [least, greatest] = noise.bounds_within(corners, low, low + 7);
                        least < record.limit && greatest > -record.limit
                    })
                }
                _ => true,
            };
            if !is_possible {
                continue;
            }
            let is_inside = known == [Some(true); 3];
            let is_whole = is_inside && record.body == FILL && record.condition == 0;
            let needs_roughness = rough != 0 && (!is_inside || record.body == BED);
            let roughness = if needs_roughness { record.roughness().flat_corners(place) } else { [0; 4] };
            let [from, to] = record.depth;
            let depth = [from.saturating_sub(rough), to.saturating_add(rough)];
            self.near.push(Near { number, is_whole, is_inside, depth, roughness, noises });
            if is_whole {
                break;
            }
        }
    }

    /// May a bed be in the brick, whose samples have heights in this range?
    fn may_hold_bed(&self, records: &StrataRecords, record: &StratumRecord, [low, high]: [i32; 2]) -> bool {
        let start = Column::of(BrickPos(self.key.1).origin());
        let bedding = &records.bedding;
        let corners = [(0, 0), (7, 0), (0, 7), (7, 7)].map(|(x, z)| start.offset(x, z));
        let dips = corners.map(|corner| bedding.dip_at(corner));
        let [least, greatest] = bounds(self.folds).map(|noise| i64::from(bedding.fold_at(noise)));
        let rough = i64::from(record.rough);
        let first = i64::from(low) + dips.iter().min().unwrap_or(&0) + least - rough;
        let last = i64::from(high) + dips.iter().max().unwrap_or(&0) + greatest + rough;
        let [from, thickness, every] = record.bed.map(i64::from);
        let above = first - from;
        let above = if every > 0 { above.rem_euclid(every) } else { above };
        let end = above + last - first;
        above < thickness && end >= 0 || every > 0 && end >= every
    }

    /// The material of a voxel of the brick; [`MaterialId::GROUND`] if no stratum holds it.
    #[inline]
    fn material(&mut self, ground: &Ground, records: &StrataRecords, voxel: Voxel) -> MaterialId {
        let index = BrickPos::index(voxel.column.at(voxel.y));
        let (layer, bit) = (index >> 6, 1 << (index & 63));
        if self.known[layer] & bit == 0 {
            self.known[layer] |= bit;
            self.materials.0[index] = self.look_up(ground, records, voxel);
        }
        self.materials.0[index]
    }

    fn look_up(&mut self, ground: &Ground, records: &StrataRecords, voxel: Voxel) -> MaterialId {
        for at in 0..self.near.len() {
            let near = &self.near[at];
            if voxel.depth < near.depth[0] || voxel.depth >= near.depth[1] {
                continue;
            }
            let record = &records.strata[near.number];
            if near.is_whole
                || self.holds(near, record, &records.bedding, voxel)
                    && (record.condition == 0
                        || self.conditions_of(ground, records, voxel.column) & record.condition != 0)
            {
                return MaterialId(record.material as u8);
            }
        }
        MaterialId::GROUND
    }

    /// The conditions that a column fulfils.
    fn conditions_of(&mut self, ground: &Ground, records: &StrataRecords, column: Column) -> u32 {
        let number = ((column.z & 7) * 8 + (column.x & 7)) as usize;
        if self.known_columns >> number & 1 == 0 {
            self.known_columns |= 1 << number;
            self.conditions.0[number] = records.conditions_of(ground, column);
        }
        self.conditions.0[number]
    }

    /// Does a stratum near the brick hold a voxel, if its conditions on the column are met?
    fn holds(&self, near: &Near, record: &StratumRecord, bedding: &BeddingRecord, voxel: Voxel) -> bool {
        let Voxel { column, y, depth } = voxel;
        let Near { roughness, noises, .. } = near;
        let (place, point) = (IVec2::new(column.x, column.z), column.at(y));
        let flat = |noise: ValueNoise, corners| noise.flat_within(corners, place);
        let moved = || match record.rough {
            0 => 0,
            _ => record.moved(flat(record.roughness(), roughness)),
        };
        let is_in_ranges = near.is_inside || {
            let moved = moved();
            (record.depth[0]..record.depth[1]).contains(&(depth + moved))
                && (record.height[0]..record.height[1]).contains(&(y * ONE + moved))
                && (record.ys[0]..record.ys[1]).contains(&y)
        };
        is_in_ranges
            && match record.body {
                BED => {
                    let fold = bedding.fold_at(flat(bedding.noise(), &self.folds));
                    record.is_in_bed(i64::from(y * ONE + moved() + fold) + bedding.dip_at(column))
                }
                VEIN => {
                    record.noise().within(&noises[0], point).abs() < record.limit
                        && record.second_noise().within(&noises[1], point).abs() < record.limit
                }
                POCKET => record.noise().within(&noises[0], point) > record.limit,
                _ => true,
            }
    }
}
