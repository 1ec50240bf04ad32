//! What a terrain may carry, crossed with what may happen to it in each phase of its life. After each event the same
//! laws hold: every message is answered once, every applied brush has its ground, nothing waits for ever, nothing is
//! left over, seams are flawless, the world is that of a plain model, and the folder of a saved world holds every dig.
//!
//! [`controls`] puts old faults back on purpose, which has to be found; [`flat`] looks whether anything grows.
//!
//! | variable | meaning |
//! | --- | --- |
//! | `BURROW_SEQUENCES` | random sequences of 20 events, 8 unless set |
//! | `BURROW_SEED` | the seed of the first of them |

use std::fmt::Debug;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::entity_disabling::Disabled;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::plugin::{CommitAction, Held, Part, SurfaceProcessor, SurfaceProcessors};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use fastrand::Rng;

use crate::stage::Stage;

mod controls;
#[cfg(all(feature = "examples", feature = "store"))]
mod flat;
mod life;

use life::*;

/// Something that a terrain carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Load {
    Nothing,
    Levels,
    Loose,
    Layers,
    SlimVertices,
    Parent,
    #[cfg(feature = "render")]
    Material,
    #[cfg(feature = "avian")]
    Physics,
    #[cfg(feature = "store")]
    Saved,
    #[cfg(feature = "store")]
    StartLevel,
    #[cfg(feature = "examples")]
    Look,
    #[cfg(feature = "replicon")]
    Shared,
}

const LOADS: &[Load] = &[
    Load::Nothing,
    Load::Levels,
    Load::Loose,
    Load::Layers,
    Load::SlimVertices,
    Load::Parent,
    #[cfg(feature = "render")]
    Load::Material,
    #[cfg(feature = "avian")]
    Load::Physics,
    #[cfg(feature = "store")]
    Load::Saved,
    #[cfg(feature = "store")]
    Load::StartLevel,
    #[cfg(feature = "examples")]
    Load::Look,
    #[cfg(feature = "replicon")]
    Load::Shared,
];

impl Load {
    fn is_saved(self) -> bool {
        #[cfg(feature = "store")]
        return self == Self::Saved;
        #[cfg(not(feature = "store"))]
        false
    }

    fn is_shared(self) -> bool {
        #[cfg(feature = "replicon")]
        return self == Self::Shared;
        #[cfg(not(feature = "replicon"))]
        false
    }

    /// Whether its terrain has what a phase is about.
    fn knows(self, phase: Phase) -> bool {
        phase != Phase::Saving || self.is_saved()
    }

    /// Whether an event means something for it. A game's own changes of a shared terrain are not in the shared world.
    fn allows(self, event: Event) -> bool {
        match event {
            Event::SaveAnew => self.is_saved(),
            Event::OwnEdit => !self.is_shared(),
            _ => true,
        }
    }

    /// An app for it.
    fn stage(self) -> Stage {
        let base = (MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin);
        match self {
            #[cfg(feature = "avian")]
            Self::Physics => Stage::with_all(
                base,
                (avian3d::prelude::PhysicsPlugins::default(), bevy_burrow::physics::TerrainPhysicsPlugin),
            ),
            #[cfg(feature = "examples")]
            Self::Look => {
                let mut stage = Stage::windowless();
                stage.app.insert_resource(GroundTextures::Baked { side: 16, anisotropy: 1 });
                stage
            }
            #[cfg(feature = "replicon")]
            Self::Shared => {
                use bevy_replicon::prelude::*;
                let replicon = RepliconPlugins.set(ServerPlugin::new(PostUpdate));
                let before = (base, bevy::state::app::StatesPlugin, replicon);
                Stage::with_all(before, bevy_burrow::together::TogetherPlugin)
            }
            _ => Stage::with(base),
        }
    }
}

/// What a terrain is doing when something happens to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Idle,
    Loading,
    Transaction,
    LevelChange,
    Saving,
}

const PHASES: [Phase; 5] =
    [Phase::Idle, Phase::Loading, Phase::Transaction, Phase::LevelChange, Phase::Saving];

/// Something that happens.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Event {
    Dig,
    DigBeside,
    Undo,
    Redo,
    OwnEdit,
    Replace,
    ReplaceResized,
    Swap,
    RemoveAndInsert,
    DespawnAndSpawn,
    Disable,
    Gate,
    Pause,
    Hold,
    Move,
    Reparent,
    Redraw,
    CameraOff,
    ToggleLevels,
    ToggleLayers,
    ToggleSlim,
    Hide,
    DespawnPart,
    Another,
    SaveAnew,
}

const EVENTS: [Event; 25] = [
    Event::Dig,
    Event::DigBeside,
    Event::Undo,
    Event::Redo,
    Event::OwnEdit,
    Event::Replace,
    Event::ReplaceResized,
    Event::Swap,
    Event::RemoveAndInsert,
    Event::DespawnAndSpawn,
    Event::Disable,
    Event::Gate,
    Event::Pause,
    Event::Hold,
    Event::Move,
    Event::Reparent,
    Event::Redraw,
    Event::CameraOff,
    Event::ToggleLevels,
    Event::ToggleLayers,
    Event::ToggleSlim,
    Event::Hide,
    Event::DespawnPart,
    Event::Another,
    Event::SaveAnew,
];

#[test]
fn all_that_a_terrain_carries_survives_all_that_happens_in_every_phase() {
    for (number, &load) in LOADS.iter().enumerate() {
        for phase in PHASES.into_iter().filter(|phase| load.knows(*phase)) {
            let mut life = Life::new(load, number as u64);
            for event in EVENTS.into_iter().filter(|event| load.allows(*event)) {
                life.reach(phase);
                life.happen(event);
                life.frames();
                life.check(&(load, phase, event));
            }
            life.end();
        }
    }
}

/// Runs a sequence of events, with few checks in between.
fn run(seed: u64, load: Load, events: &[Event]) {
    let mut life = Life::new(load, seed);
    for (number, &event) in events.iter().enumerate() {
        // Also in the middle of something.
        let phase = PHASES[life.rng.usize(..PHASES.len())];
        if load.knows(phase) {
            life.reach(phase);
        }
        life.happen(event);
        life.frames();
        if number % 5 == 4 {
            life.check(&(seed, load, &events[..=number]));
        }
    }
    life.check(&(seed, load, events));
    life.end();
}

/// The shortest part of a sequence that still fails.
fn reduce(seed: u64, load: Load, mut events: Vec<Event>) -> Vec<Event> {
    let fails = |events: &[Event]| catch_unwind(AssertUnwindSafe(|| run(seed, load, events))).is_err();
    let mut at = 0;
    while at < events.len() {
        let mut fewer = events.clone();
        fewer.remove(at);
        if fails(&fewer) {
            events = fewer;
        } else {
            at += 1;
        }
    }
    events
}

fn variable(name: &str, or: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(or)
}

#[test]
fn random_sequences_of_events_break_nothing() {
    let first = variable("BURROW_SEED", 0);
    for seed in first..first + variable("BURROW_SEQUENCES", 8) {
        let mut rng = Rng::with_seed(seed);
        let load = LOADS[rng.usize(..LOADS.len())];
        let all: Vec<Event> = EVENTS.into_iter().filter(|event| load.allows(*event)).collect();
        let events: Vec<Event> = (0..20).map(|_| all[rng.usize(..all.len())]).collect();
        if catch_unwind(AssertUnwindSafe(|| run(seed, load, &events))).is_err() {
            let least = reduce(seed, load, events);
            panic!("seed {seed} with {load:?} fails: {least:?}");
        }
    }
}
