//! Commits small transactions in the frame in which they began: a player sees the hole in the frame of the click.
//!
//! A transaction that begins in `Update` runs beside the game's other systems. In `PostUpdate`, before Bevy's systems for assets,
//! transforms and visibility, the frame waits for it for at most [`BurrowSettings::same_frame`]. If it is not done by then, it is committed
//! like any other: in `Update` of a later frame.

use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::VisibilitySystems;
use bevy::ecs::change_detection::Tick;
use bevy::ecs::system::SystemChangeTick;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::commit::Commits;
use super::{BurrowSettings, BurrowSystems};

/// The transactions that began in this frame.
#[derive(Resource, Default)]
pub(super) struct SameFrame {
    /// Terrains whose transaction began, and its work in bricks.
    begun: Vec<(Entity, u64)>,
    /// Whether the systems of [`BurrowSystems::Commit`] and [`BurrowSystems::Propagate`] ran: a game may gate them.
    commits: bool,
    propagates: bool,
    /// The tick after which a commit in this frame has spawned entities.
    since: Option<Tick>,
}

impl SameFrame {
    /// Records that transactions are committed in this frame.
    pub fn begin(&mut self) {
        self.commits = true;
    }

    /// Records that a transaction of a terrain began.
    pub fn note(&mut self, terrain: Entity, work: u64) {
        self.begun.push((terrain, work));
    }

    /// Whether an entity that got its parent at this tick was spawned by a commit of this frame.
    pub fn has_spawned(&self, added: Tick, ticks: &SystemChangeTick) -> bool {
        self.since.is_some_and(|since| added.is_newer_than(since, ticks.this_run()))
    }
}

/// The commit in `PostUpdate`.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct CommitSameFrame;

/// After it, entities that it spawned inherit what tiles and chunks have from their terrain.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct PropagateSameFrame;

/// Adds the systems.
pub(super) fn add(app: &mut App) {
    app.configure_sets(
        PostUpdate,
        (CommitSameFrame, PropagateSameFrame.run_if(|same_frame: Res<SameFrame>| same_frame.since.is_some()))
            .chain()
            .before(AssetEventSystems)
            .before(TransformSystems::Propagate)
            .before(VisibilitySystems::CalculateBounds)
            .before(VisibilitySystems::VisibilityPropagate),
    )
    .add_systems(
        Update,
        (|mut same_frame: ResMut<SameFrame>| same_frame.propagates = true).in_set(BurrowSystems::Propagate),
    )
    .add_systems(PostUpdate, commit_begun.in_set(CommitSameFrame));
}

/// Commits the small transactions that began in this frame and are done in time.
fn commit_begun(mut commits: Commits, mut same_frame: ResMut<SameFrame>, ticks: SystemChangeTick) {
    let SameFrame { begun, commits: may_commit, propagates, since } = &mut *same_frame;
    let begun = std::mem::take(begun);
    let (may_commit, propagates) = (std::mem::take(may_commit), std::mem::take(propagates));
    *since = None;
    let BurrowSettings { same_frame: most, .. } = *commits.settings;
    if begun.is_empty() || !may_commit || !commits.has_meshes() || most.is_zero() {
        return;
    }
    let start = Instant::now();
    let mut done = Vec::new();
    for (entity, work) in begun {
        // A brick takes a microsecond or two.
        if u128::from(work) > most.as_micros() {
            continue;
        }
        let Ok((_, _, _, mut task, _)) = commits.terrains.get_mut(entity) else { continue };
        if task.is_done_within(most.saturating_sub(start.elapsed())) && task.is_plain() {
            done.push((task.number, entity));
        }
    }
    commits.measure(start.elapsed());
    if !done.is_empty() {
        *since = propagates.then(|| ticks.this_run());
        commits.commit(done);
    }
}
