//! Commits small transactions in the frame in which they began: a player sees the hole in the frame of the click.
//!
//! A transaction that begins in `Update` runs while the game's other systems do. In `PostUpdate`, before Bevy's systems
//! for assets, transforms and visibility, the frame waits for at most
//! [`same_frame`](crate::plugin::BurrowSettings::same_frame). A transaction that is not done by then is committed like
//! any other: in `Update` of a later frame.

use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::change_detection::Tick;
use bevy::ecs::system::SystemChangeTick;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use crate::plugin::Phase;

/// The transactions that began in this frame.
#[derive(Resource, Default)]
pub(in crate::plugin) struct SameFrame {
    /// Terrains whose transaction began, its work in bricks, and when.
    begun: Vec<(Entity, u64, Instant)>,
    /// Meshes that commits have swapped in this frame.
    pub swapped: usize,
    /// Whether the systems of [`Commit`](crate::plugin::BurrowSystems::Commit) and
    /// [`Propagate`](crate::plugin::BurrowSystems::Propagate) ran: a game may gate them.
    commits: bool,
    propagates: bool,
    /// The tick after which a commit in this frame has spawned entities.
    since: Option<Tick>,
}

impl SameFrame {
    /// Records that transactions are committed in this frame.
    pub fn begin(&mut self) {
        (self.commits, self.propagates, self.swapped) = (true, false, 0);
    }

    /// Records that a transaction of a terrain began.
    pub fn note(&mut self, terrain: Entity, work: u64) {
        self.begun.push((terrain, work, Instant::now()));
    }

    /// Takes the terrains whose transactions began, with work and time: none if commits are gated.
    pub fn take(&mut self) -> Vec<(Entity, u64, Instant)> {
        let begun = std::mem::take(&mut self.begun);
        self.since = None;
        if std::mem::take(&mut self.commits) { begun } else { Vec::new() }
    }

    /// Records that a commit spawns entities after this tick.
    pub fn commit(&mut self, tick: Tick) {
        self.since = self.propagates.then_some(tick);
    }

    /// Whether an entity that got its parent at this tick was spawned by a commit of this frame.
    pub fn has_spawned(&self, added: Tick, ticks: &SystemChangeTick) -> bool {
        self.since.is_some_and(|since| added.is_newer_than(since, ticks.this_run()))
    }
}

/// The commit in `PostUpdate`.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct CommitSameFrame;

/// After it, entities that it spawned inherit what tiles and chunks have from their terrain.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(in crate::plugin) struct PropagateSameFrame;

/// Adds the systems.
pub(in crate::plugin) fn add(app: &mut App) {
    app.configure_sets(
        PostUpdate,
        (CommitSameFrame, PropagateSameFrame.run_if(|same_frame: Res<SameFrame>| same_frame.since.is_some()))
            .chain()
            .before(AssetEventSystems)
            .before(TransformSystems::Propagate)
            .before(VisibilitySystems::CalculateBounds)
            .before(VisibilitySystems::VisibilityPropagate),
    )
    .add_systems(Phase::Propagate, |mut same_frame: ResMut<SameFrame>| same_frame.propagates = true);
}
