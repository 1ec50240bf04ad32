//! Sky light: the share of the sky that lights a place on the ground.
//!
//! It is weighted by the cosine to the vertical, as a level face receives it from a sky that is equally bright all
//! over: 255 on a plain, 0 in a cave. Everything is computed in integers from heights and samples alone, so it is the
//! same on each machine, for each backend and at each level of detail, and equal places have equal light whatever draws
//! them.
//!
//! - **Under the open sky**, light depends on the *tops* of the columns around: the height of the highest ground in
//!   each. In eight directions, the steepest rise to the top of a column at one of a few distances is the horizon. On
//!   dug walls, what the wall itself hides is added.
//! - **Under a roof**, rays in eight directions and at three angles look for a way out, from every second lattice point
//!   along each axis. Light is interpolated between these, so it does not jump. Level rays in sixteen directions tell
//!   how much of the daylight is seen from there.
//!
//! No light depends on ground that is more than [`REACH`](light::REACH) columns away, so a dig changes light near it
//! only.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `light` | the rules |
//! | `horizon` | those of horizons, for eight columns at once |
//! | `air` | what is known of points of air under roofs |
//! | `bricks` | the bricks near a rectangle of columns |
//! | `tops` | the highest ground in the columns of a stack of bricks |
//! | `columns` | all columns of a rectangle: for tiles and chunks |
//! | `change` | what a commit changes: before and after, compared |
//! | `sparse` | columns a stride apart: for coarser nodes |

mod air;
mod bricks;
mod change;
mod columns;
mod horizon;
mod light;
mod sparse;
#[cfg(test)]
mod tests;
mod tops;

use std::sync::{Arc, OnceLock};

use glam::{DVec3, IVec3};
use rustc_hash::FxHashMap;

use super::patch::ChangedBrick;
use super::state::World;
use crate::ground::Ground;
use crate::lattice::{BRICK, BrickPos, Column, ONE, SNAP};
use crate::volume::{Brick, Layers, layers, pristine_layers};

pub(crate) use change::{ChangedBox, LightChange};
pub(crate) use columns::SkyColumns;
pub(crate) use light::{Light, REACH, SkyLights};
pub(crate) use sparse::SparseSky;
use tops::{StackTops, stack_tops};

/// Bricks that a commit changes, by position, and the stacks that hold them.
#[derive(Default)]
struct Newer {
    bricks: FxHashMap<BrickPos, Option<Arc<Brick>>>,
    stacks: FxHashMap<(i32, i32), NewerStack>,
}

/// A stack of bricks that a commit changes.
struct NewerStack {
    /// The heights of its bricks after the commit, ascending.
    rows: Vec<i32>,
    /// The tops before and after the commit: computed when they are first needed.
    tops: OnceLock<[Option<StackTops>; 2]>,
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
            let stack = newer.stacks.entry(key).or_insert_with(|| NewerStack {
                rows: world.stacks.get(&key).cloned().unwrap_or_default(),
                tops: OnceLock::new(),
            });
            let rows = &mut stack.rows;
            match (rows.binary_search(&pos.0.y), brick.is_some()) {
                (Err(at), true) => rows.insert(at, pos.0.y),
                (Ok(at), false) => drop(rows.remove(at)),
                _ => {}
            }
            newer.bricks.insert(pos, brick);
        }
        Self { world, newer }
    }

    /// The world before the commit, with all that it keeps.
    pub fn before(&self) -> &Arc<World> {
        &self.world
    }

    /// The world before the commit.
    pub fn view_before(&self) -> SkyView<'_> {
        SkyView { world: &self.world, newer: None, commit: Some(self) }
    }

    /// The world after the commit.
    pub fn view(&self) -> SkyView<'_> {
        SkyView { world: &self.world, newer: Some(&self.newer), commit: Some(self) }
    }

    /// The stacks in which the commit changes bricks, in no order.
    fn changed_stacks(&self) -> impl Iterator<Item = (i32, i32)> {
        self.newer.stacks.keys().copied()
    }

    /// What the commit changes of all that light depends on, a box for each stack, in no order.
    pub fn changes(&self) -> Vec<ChangedBox> {
        let mut solid: FxHashMap<(i32, i32), ChangedBox> = FxHashMap::default();
        for &pos in self.newer.bricks.keys() {
            let [before, after] = [self.view_before(), self.view()].map(|view| view.solid_layers(pos));
            let own = solid.entry(pos.stack()).or_insert(ChangedBox::NONE);
            for (y, (before, after)) in (pos.origin().y..).zip(before.iter().zip(&after)) {
                own.add(pos.stack(), before ^ after, (y * ONE, (y + 1) * ONE));
            }
        }
        for (&stack, own) in &mut solid {
            let Some(tops) = self.changed_tops(stack) else { continue };
            let ground = || self.world.ground.heights::<8>(Column::new(stack.0 * BRICK, stack.1 * BRICK));
            let [before, after] = tops.each_ref().map(|known| match known {
                Some(known) => known.tops,
                None => ground().as_flattened().try_into().unwrap_or([0; 64]),
            });
            for (bit, (&before, &after)) in before.iter().zip(&after).enumerate() {
                if before != after {
                    own.add(stack, 1 << bit, (before.min(after), before.max(after)));
                }
            }
        }
        solid.into_values().filter(|own| !own.is_empty()).collect()
    }

    /// The tops of a stack that the commit changes, before and after; `None` if it does not change the stack.
    fn changed_tops(&self, at: (i32, i32)) -> Option<&[Option<StackTops>; 2]> {
        let stack = self.newer.stacks.get(&at)?;
        let views =
            [None, Some(&self.newer)].map(|newer| SkyView { world: &self.world, newer, commit: None });
        Some(stack.tops.get_or_init(|| views.map(|view| stack_tops(view, at))))
    }
}

/// A world as far as light depends on it.
#[derive(Clone, Copy)]
pub(crate) struct SkyView<'a> {
    world: &'a World,
    newer: Option<&'a Newer>,
    /// The commit before or after which this is, which knows the tops of the stacks that it changes.
    commit: Option<&'a LitWorld>,
}

impl<'a> SkyView<'a> {
    /// A world without a running commit.
    pub fn of(world: &'a World) -> Self {
        Self { world, newer: None, commit: None }
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

    /// The solid samples where a brick is or could be.
    fn solid_layers(self, pos: BrickPos) -> Layers {
        self.brick(pos).map_or_else(|| pristine_layers(self.ground(), pos), |brick| *brick.solid())
    }

    /// The heights of the bricks in a stack, ascending.
    fn rows(self, stack: (i32, i32)) -> &'a [i32] {
        let newer = self.newer.and_then(|newer| newer.stacks.get(&stack));
        match newer {
            Some(newer) => &newer.rows,
            None => self.world.stacks.get(&stack).map_or(&[], Vec::as_slice),
        }
    }

    /// Calls a function with the tops of a stack, unless it holds no bricks.
    fn with_tops<R>(self, stack: (i32, i32), work: impl FnOnce(&StackTops) -> R) -> Option<R> {
        match self.commit.and_then(|commit| commit.changed_tops(stack)) {
            Some(tops) => tops[usize::from(self.newer.is_some())].as_ref().map(work),
            None => stack_tops(self, stack).as_ref().map(work),
        }
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
            Some(brick) => layers::contains(brick.solid(), BrickPos::index(point)),
            None => self.ground().height(Column::of(point)) > point.y * ONE,
        }
    }
}

impl World {
    /// The share of the sky that lights a place on the surface, 0..=1, weighted by the cosine to the vertical: 1 on a
    /// plain, 0 in a cave. In voxels; the place is taken to the nearest column. It is what a terrain with sky light
    /// shows there. Ground more than 17 columns away counts as none.
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
        f32::from(SparseSky::new(SkyView::of(self)).light(place).sky) / 255.0
    }
}
