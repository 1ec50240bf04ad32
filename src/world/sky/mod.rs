//! Sky light: the share of the sky that lights a place on the ground.
//!
//! It is weighted by the cosine to the vertical, as a level face receives it from a sky that is equally bright all over:
//! 255 on a plain, 0 in a cave. Everything is computed in integers from heights and samples alone, so it is the same on
//! each machine, for each backend and at each level of detail, and equal places have equal light whatever draws them.
//!
//! - **Under the open sky**, light depends on the *tops* of the columns around: the height of the highest ground in each.
//!   In eight directions, the steepest rise to the top of a column at one of a few distances is the horizon.
//! - **Under a roof**, rays in eight directions and at three angles look for a way out.
//!
//! No light depends on ground that is more than [`REACH`](light::REACH) columns away, so a dig changes light near it only.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `light` | the rules |
//! | `tops` | the highest ground in the columns of a stack of bricks |
//! | `columns` | all columns of a rectangle: for tiles and chunks |
//! | `sparse` | columns a stride apart: for coarser nodes |

mod columns;
mod light;
mod sparse;
#[cfg(test)]
mod tests;
mod tops;

use std::sync::Arc;

use glam::{DVec3, IVec3};
use rustc_hash::FxHashMap;

use super::patch::ChangedBrick;
use super::state::World;
use crate::ground::Ground;
use crate::lattice::{BrickPos, Column, ONE, SNAP};
use crate::volume::Brick;

pub(crate) use columns::SkyColumns;
pub(crate) use light::{REACH, SkyLights};
pub(crate) use sparse::SparseSky;
pub(crate) use tops::stack_tops;

/// Bricks that a commit changes, by position, and the bricks of each stack that it changes.
#[derive(Default)]
struct Newer {
    bricks: FxHashMap<BrickPos, Option<Arc<Brick>>>,
    stacks: FxHashMap<(i32, i32), Vec<i32>>,
}

/// A world as it is after a commit that is not installed yet, for the light of its surfaces.
pub(crate) struct LitWorld {
    world: Arc<World>,
    newer: Newer,
}

impl LitWorld {
    /// A world with these bricks in place of its own.
    pub fn new(world: Arc<World>, changed: Vec<ChangedBrick>) -> Self {
        let mut newer = Newer::default();
        for (pos, brick) in changed {
            let key = pos.stack();
            let own = || world.stacks.get(&key).cloned().unwrap_or_default();
            let rows = newer.stacks.entry(key).or_insert_with(own);
            match (rows.binary_search(&pos.0.y), brick.is_some()) {
                (Err(at), true) => rows.insert(at, pos.0.y),
                (Ok(at), false) => drop(rows.remove(at)),
                _ => {}
            }
            newer.bricks.insert(pos, brick);
        }
        Self { world, newer }
    }

    /// The world before the commit.
    pub fn before(&self) -> &Arc<World> {
        &self.world
    }

    /// The lowest of some columns before anyone dug, and of others beside them, in 1/256 voxel.
    pub fn lowest_ground(&self, low: Column, high: Column) -> i32 {
        let heights = |(x, z): (i32, i32)| {
            let heights = self.world.ground.heights::<8>(Column::new(x * 8, z * 8));
            heights.as_flattened().iter().copied().min().unwrap_or(i32::MIN)
        };
        stacks_over(low, high).map(heights).min().unwrap_or(i32::MIN)
    }

    /// Whether no bricks are stored over some columns, neither before nor after the commit.
    pub fn is_undug(&self, low: Column, high: Column) -> bool {
        let [before, after] = [SkyView::of(&self.world), self.view()];
        stacks_over(low, high).all(|stack| before.rows(stack).is_empty() && after.rows(stack).is_empty())
    }

    /// The world after the commit.
    pub fn view(&self) -> SkyView<'_> {
        SkyView { world: &self.world, newer: Some(&self.newer) }
    }

    /// The stacks of bricks that the commit changes, in no order.
    pub fn changed_stacks(&self) -> impl Iterator<Item = (i32, i32)> {
        self.newer.stacks.keys().copied()
    }

    /// The positions of the bricks that it changes, in no order.
    pub fn changed_bricks(&self) -> impl Iterator<Item = BrickPos> {
        self.newer.bricks.keys().copied()
    }
}

/// The stacks of bricks over some columns, both ends included.
fn stacks_over(low: Column, high: Column) -> impl Iterator<Item = (i32, i32)> {
    (low.z >> 3..=high.z >> 3).flat_map(move |z| (low.x >> 3..=high.x >> 3).map(move |x| (x, z)))
}

/// A world as far as light depends on it.
#[derive(Clone, Copy)]
pub(crate) struct SkyView<'a> {
    world: &'a World,
    newer: Option<&'a Newer>,
}

impl<'a> SkyView<'a> {
    /// A world without a running commit.
    pub fn of(world: &'a World) -> Self {
        Self { world, newer: None }
    }

    fn ground(self) -> &'a Ground {
        &self.world.ground
    }

    fn brick(self, pos: BrickPos) -> Option<&'a Brick> {
        match self.newer.and_then(|newer| newer.bricks.get(&pos)) {
            Some(brick) => brick.as_deref(),
            None => self.world.bricks.get(&pos).map(Arc::as_ref),
        }
    }

    /// The heights of the bricks in a stack, ascending.
    fn rows(self, stack: (i32, i32)) -> &'a [i32] {
        let newer = self.newer.and_then(|newer| newer.stacks.get(&stack));
        newer.or_else(|| self.world.stacks.get(&stack)).map_or(&[], Vec::as_slice)
    }

    /// The stacks that hold bricks between two stacks, both ends included, in no order.
    fn stacks_within(self, low: (i32, i32), high: (i32, i32)) -> Vec<(i32, i32)> {
        let is_within = |&(x, z): &(i32, i32)| (low.0..=high.0).contains(&x) && (low.1..=high.1).contains(&z);
        let count = i64::from(high.0 - low.0 + 1) * i64::from(high.1 - low.1 + 1);
        let known = self.world.stacks.len() + self.newer.map_or(0, |newer| newer.stacks.len());
        let mut found: Vec<(i32, i32)> = if (known as i64) < count {
            let newer = self.newer.into_iter().flat_map(|newer| newer.stacks.keys());
            self.world.stacks.keys().chain(newer).copied().filter(is_within).collect()
        } else {
            (low.0..=high.0).flat_map(|x| (low.1..=high.1).map(move |z| (x, z))).collect()
        };
        found.retain(|&stack| !self.rows(stack).is_empty());
        found.sort_unstable();
        found.dedup();
        found
    }

    /// Beyond the rim everything is as on it.
    fn clamped(self, column: Column) -> Column {
        let grid = self.world.grid;
        Column::new(column.x.clamp(0, grid.width()), column.z.clamp(0, grid.depth()))
    }

    /// Whether a sample is solid.
    fn is_solid(self, point: IVec3) -> bool {
        let point = self.clamped(Column::of(point)).at(point.y);
        match self.brick(BrickPos::of(point)) {
            Some(brick) => {
                let at = point & 7;
                brick.solid()[at.y as usize] >> (at.z * 8 + at.x) & 1 == 1
            }
            None => self.ground().height(Column::of(point)) > point.y * ONE,
        }
    }
}

impl World {
    /// The share of the sky that lights a place on the surface, 0..=1, weighted by the cosine to the vertical: 1 on a
    /// plain, 0 in a cave. In voxels; the place is taken to the nearest column. It is what a terrain with sky light shows
    /// there. Ground more than 17 columns away counts as none.
    pub fn sky_light(&self, place: DVec3) -> f32 {
        let last = DVec3::new(
            f64::from(self.grid.width()),
            f64::from(crate::lattice::LIMIT),
            f64::from(self.grid.depth()),
        );
        let place = place.clamp(DVec3::ZERO.with_y(-last.y), last);
        if !place.is_finite() {
            return 0.0;
        }
        let (column, y) = (place.round().as_ivec3(), (place.y * f64::from(SNAP)).round() as i32);
        let place = (column * SNAP).with_y(y);
        f32::from(SparseSky::new(SkyView::of(self)).light(place)) / 255.0
    }
}
