//! Reading the world at a lattice point, edited or not.

use std::sync::Arc;

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::{Brick, Sample};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, LatticeBox};

/// Bricks by position; a missing brick is all pristine, so none with edited samples may be left out to save memory.
pub type Bricks = FxHashMap<BrickPos, Arc<Brick>>;

/// Bricks in order of their positions.
pub(crate) type BrickList<'a> = [(BrickPos, &'a Brick)];

/// The samples of a world: its ground, its bricks, and newer bricks that a running transaction lays over them.
#[derive(Clone, Copy)]
pub struct SampleView<'a> {
    ground: &'a Ground,
    bricks: &'a Bricks,
    newer: Option<&'a Bricks>,
    /// Bricks that take the place of all others.
    latest: &'a BrickList<'a>,
}

/// A list without the bricks before a position. Looks near its begin first.
fn from<'l, 'a>(list: &'l BrickList<'a>, next: BrickPos) -> &'l BrickList<'a> {
    let is_before = |&(pos, _): &(BrickPos, &Brick)| pos < next;
    let mut end = 1;
    while list.get(end).is_some_and(is_before) {
        end *= 2;
    }
    let begin = end / 2;
    &list[begin + list[begin..list.len().min(end + 1)].partition_point(is_before)..]
}

impl<'a> SampleView<'a> {
    /// A view of committed bricks.
    pub fn new(ground: &'a Ground, bricks: &'a Bricks) -> Self {
        Self { ground, bricks, newer: None, latest: &[] }
    }

    /// This view with newer bricks in place of older ones.
    pub fn over(self, newer: &'a Bricks) -> Self {
        Self { newer: Some(newer), ..self }
    }

    /// This view with bricks of a list in place of all others.
    pub(crate) fn under(self, latest: &'a BrickList<'a>) -> Self {
        debug_assert!(latest.is_sorted_by(|a, b| a.0 < b.0));
        Self { latest, ..self }
    }

    /// The pristine world below the edits.
    pub fn ground(&self) -> &'a Ground {
        self.ground
    }

    /// Calls `each` with the bricks at all positions of a box. Where several lie over each other, the topmost comes
    /// last.
    pub(crate) fn for_bricks(&self, places: LatticeBox, mut each: impl FnMut(BrickPos, &'a Brick)) {
        for table in std::iter::once(self.bricks).chain(self.newer) {
            if (table.len() as u64) < places.volume() {
                let near = table.iter().filter(|(pos, _)| places.contains(pos.0));
                near.for_each(|(&pos, brick)| each(pos, brick));
            } else {
                let found = places.points().filter_map(|at| Some((BrickPos(at), table.get(&BrickPos(at))?)));
                found.for_each(|(pos, brick)| each(pos, brick));
            }
        }
        let (min, max) = (places.min, places.max);
        let first = self.latest.partition_point(|&(pos, _)| pos < BrickPos(min));
        let mut latest = &self.latest[first..];
        while let Some(&(pos, brick)) = latest.first() {
            let BrickPos(IVec3 { x, y, z }) = pos;
            if x > max.x {
                break;
            }
            // The next position of the box that is not before this one.
            let [x, z, y] = match (z < min.z, z > max.z, y < min.y, y > max.y) {
                (true, ..) => [x, min.z, min.y],
                (_, true, ..) => [x + 1, min.z, min.y],
                (_, _, true, _) => [x, z, min.y],
                (_, _, _, true) => [x, z + 1, min.y],
                _ => {
                    each(pos, brick);
                    latest = &latest[1..];
                    continue;
                }
            };
            latest = from(latest, BrickPos(IVec3::new(x, y, z)));
        }
    }

    /// A brick, `None` where all samples are pristine.
    pub fn brick(&self, pos: BrickPos) -> Option<&'a Brick> {
        if let Ok(at) = self.latest.binary_search_by_key(&pos, |&(pos, _)| pos) {
            return Some(self.latest[at].1);
        }
        self.newer.and_then(|newer| newer.get(&pos)).or_else(|| self.bricks.get(&pos)).map(Arc::as_ref)
    }

    /// The stored sample.
    pub fn sample(&self, point: IVec3) -> Sample {
        self.brick(BrickPos::of(point)).map_or(Sample::PRISTINE, |brick| brick.sample(point))
    }

    /// Returns `true` if the sample was edited.
    pub fn is_edited(&self, point: IVec3) -> bool {
        self.sample(point) != Sample::PRISTINE
    }

    /// Density in 1/256 voxel: stored where edited, otherwise computed (rule 1).
    pub fn distance(&self, point: IVec3) -> i32 {
        self.sample(point).distance().unwrap_or_else(|| self.ground.distance(point))
    }

    /// Returns `true` if the lattice point is solid. Density 0 is air.
    pub fn is_solid(&self, point: IVec3) -> bool {
        self.distance(point) < 0
    }

    /// The stored material; [`MaterialId::GROUND`] if it was never changed.
    pub fn stored_material(&self, point: IVec3) -> MaterialId {
        self.brick(BrickPos::of(point)).map_or(MaterialId::GROUND, |brick| brick.material(point))
    }

    /// The material at a lattice point, the ground's own if it was never changed.
    pub fn material(&self, point: IVec3) -> MaterialId {
        resolve(self.ground, point, self.stored_material(point))
    }

    /// Solid lattice points of a box, counted one by one.
    pub fn solid_count(&self, samples: LatticeBox) -> u64 {
        samples.points().filter(|&point| self.is_solid(point)).count() as u64
    }
}

/// The material that a stored id stands for at a lattice point.
pub(crate) fn resolve(ground: &Ground, point: IVec3, stored: MaterialId) -> MaterialId {
    if stored == MaterialId::GROUND { ground.material(point) } else { stored }
}
