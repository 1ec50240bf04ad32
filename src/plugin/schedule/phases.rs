//! Schedules that run in `Update` as one system each: their systems run one after the other, on one thread.
//!
//! In most frames, most of the plugin's systems have nothing to do. In `Update` itself, each of them would be a task of
//! its own, and every point between two of them where commands are applied a barrier: on two cores that took longer
//! than all of their work.
//!
//! An exclusive system conflicts with every other one, so Bevy would report each system of a game that has no order
//! relative to these. They are left out of its search; their schedules are not.

use bevy::ecs::schedule::{ScheduleConfigs, ScheduleLabel, SingleThreadedExecutor};
use bevy::ecs::system::ScheduleSystem;
use bevy::prelude::*;

/// The schedules, in the order in which they run; [`Save`](Self::Save) and [`Look`](Self::Look) run in either order.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(
    not(all(feature = "store", feature = "render")),
    allow(dead_code, reason = "some are for one feature")
)]
pub(crate) enum Phase {
    /// Saved worlds are put in the place of their terrains.
    Worlds,
    /// That of [`BurrowSystems::Load`](crate::plugin::BurrowSystems::Load).
    Load,
    /// That of [`BurrowSystems::Collect`](crate::plugin::BurrowSystems::Collect).
    Collect,
    /// That of [`BurrowSystems::Begin`](crate::plugin::BurrowSystems::Begin).
    Begin,
    /// Commits are saved.
    Save,
    /// Terrains with a look get their materials.
    Look,
    /// That of [`BurrowSystems::Propagate`](crate::plugin::BurrowSystems::Propagate).
    Propagate,
}

impl Phase {
    /// The system in `Update` that runs the schedule, which exists from then on.
    pub fn system(self, app: &mut App) -> ScheduleConfigs<ScheduleSystem> {
        // Its `default()` would leave commands of the last systems waiting for the next frame.
        app.edit_schedule(self, |schedule| {
            schedule.set_executor(SingleThreadedExecutor::new());
        });
        (move |world: &mut World| world.run_schedule(self)).ambiguous_with_all()
    }
}
