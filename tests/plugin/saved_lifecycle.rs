//! Components of a saved world come and go in any order: the folder of a world holds its digs, and no terrain is held
//! for ever. `BURROW_LIFECYCLES` is the number of random stories, from `BURROW_SEED` on. One that fails is reduced to
//! the acts that it takes.
#![cfg(feature = "store")]

use std::panic::catch_unwind;

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_burrow::plugin::Held;
use bevy_burrow::prelude::*;
use bevy_burrow::saves::OpeningWorld;
use bevy_burrow::store::{BaseChanged, Store, StoreOptions};
use fastrand::Rng;

use crate::saved::{Folder, Heard, flat, run_until, saved, with_assets};

/// The heights of two levels, each with a folder of its own.
const HEIGHTS: [f64; 2] = [12.0, 20.0];

fn level(kind: usize) -> Terrain {
    flat(96, HEIGHTS[kind], 32, 1.0)
}

fn ball(rng: &mut Rng) -> Brush {
    let at = Vec3::new(rng.f32() * 96.0, 8.0 + rng.f32() * 14.0, rng.f32() * 96.0);
    Brush::dig(Shape::sphere(at, 2.0 + rng.f32() * 4.0))
}

struct Story {
    rng: Rng,
    game: App,
    folders: [Folder; 2],
    entity: Entity,
    /// The hash that each folder has to hold, once something is known of it.
    expected: [Option<u64>; 2],
    /// The level of the terrain, and the folder that its world is saved in.
    terrain: Option<usize>,
    saved: Option<usize>,
    /// Whether the store has seen the terrain that is there now.
    is_followed: bool,
}

impl Story {
    fn new(seed: u64) -> Self {
        let mut game = with_assets();
        let entity = game.world_mut().spawn_empty().id();
        let folders = [0, 1].map(|kind| Folder::new(&format!("story-{seed}-{kind}")));
        Self {
            rng: Rng::with_seed(seed),
            game,
            folders,
            entity,
            expected: [None; 2],
            terrain: None,
            saved: None,
            is_followed: false,
        }
    }

    fn has<C: Component>(&self) -> bool {
        self.game.world().get::<C>(self.entity).is_some()
    }

    fn update(&mut self) {
        self.game.update();
        std::thread::sleep(std::time::Duration::from_millis(1));
        if !self.has::<SavedWorld>() {
            self.saved = None;
        }
        self.is_followed = self.has::<WorldStore>() && self.has::<Terrain>();
    }

    /// Records the present state of a world that is open: its folder must contain it later.
    fn note(&mut self) {
        if !self.has::<SavedWorld>() {
            self.saved = None;
        }
        if let (true, Some(folder)) = (self.is_followed, self.saved) {
            let terrain = self.game.world().get::<Terrain>(self.entity).expect("it is followed");
            self.expected[folder] = Some(terrain.world().hash());
        }
    }

    /// Does what an act of this story is, whatever acts were before it.
    fn act(&mut self, seed: u64, number: u64) -> u32 {
        self.rng = Rng::with_seed(seed * 1000 + number);
        self.note();
        let what = self.rng.u32(0..22);
        let kind = self.rng.usize(0..2);
        match what {
            0 | 1 => {
                // Each level is saved in its own folder.
                if let Some(kind) = self.terrain {
                    self.game.world_mut().entity_mut(self.entity).insert(saved(&self.folders[kind].0));
                    (self.saved, self.is_followed) = (Some(kind), false);
                }
            }
            2 => {
                self.game.world_mut().entity_mut(self.entity).remove::<SavedWorld>();
                (self.saved, self.is_followed) = (None, false);
            }
            3 | 4 => {
                // One that waits for its terrain gets its own.
                let waits = self.saved.filter(|_| !self.has::<WorldStore>() && !self.has::<OpeningWorld>());
                let kind = waits.unwrap_or(kind);
                let mut new = level(kind);
                for _ in 0..self.rng.u32(0..3) {
                    new.apply([ball(&mut self.rng)]);
                }
                self.game.world_mut().entity_mut(self.entity).insert(new);
                (self.terrain, self.is_followed) = (Some(kind), false);
            }
            5 => {
                self.game
                    .world_mut()
                    .entity_mut(self.entity)
                    .insert((level(kind), saved(&self.folders[kind].0)));
                (self.terrain, self.saved, self.is_followed) = (Some(kind), Some(kind), false);
            }
            6 => {
                self.game.world_mut().entity_mut(self.entity).remove::<Terrain>();
                (self.terrain, self.is_followed) = (None, false);
            }
            7 => {
                self.game.world_mut().despawn(self.entity);
                self.entity = self.game.world_mut().spawn((level(kind), saved(&self.folders[kind].0))).id();
                (self.terrain, self.saved, self.is_followed) = (Some(kind), Some(kind), false);
            }
            8 => {
                let mut entity = self.game.world_mut().entity_mut(self.entity);
                if entity.contains::<Disabled>() {
                    entity.remove::<Disabled>();
                } else {
                    entity.insert(Disabled);
                }
            }
            9 => {
                let level = match self.rng.u8(0..3) {
                    0 => Handle::default(),
                    1 => {
                        self.game.world().resource::<AssetServer>().load("burrow-story-missing.burrow_level")
                    }
                    _ => self.game.world().resource::<Assets<BurrowLevel>>().reserve_handle(),
                };
                self.game.world_mut().entity_mut(self.entity).insert(StartLevel(level));
            }
            10 => drop(self.game.world_mut().entity_mut(self.entity).remove::<StartLevel>()),
            11 => drop(self.game.world_mut().write_message(SaveNow::default())),
            20 => {
                // Several go at once.
                let mut entity = self.game.world_mut().entity_mut(self.entity);
                if self.rng.bool() {
                    entity.remove::<(Terrain, SavedWorld, StartLevel)>();
                    self.terrain = None;
                } else {
                    entity.remove::<(SavedWorld, StartLevel)>();
                }
                (self.saved, self.is_followed) = (None, false);
            }
            12 | 13 => {
                // Only a terrain that is not held: what a game does to one while its world is read is not in that.
                let brush = ball(&mut self.rng);
                if !self.has::<Held>()
                    && let Some(mut terrain) = self.game.world_mut().get_mut::<Terrain>(self.entity)
                {
                    terrain.apply([brush]);
                }
            }
            _ => {
                for _ in 0..self.rng.u32(1..4) {
                    let brush = ball(&mut self.rng);
                    self.game.world_mut().write_message(brush);
                }
            }
        }
        for _ in 0..self.rng.u32(0..8) * self.rng.u32(0..5) {
            self.update();
        }
        what
    }

    /// Waits until nothing changes any more, and checks that a dig is answered.
    fn settle(&mut self, story: &str) {
        self.note();
        if self.terrain.is_none() {
            let kind = self.saved.unwrap_or(0);
            self.game.world_mut().entity_mut(self.entity).insert(level(kind));
            (self.terrain, self.is_followed) = (Some(kind), false);
        }
        self.game.world_mut().entity_mut(self.entity).remove::<(StartLevel, Disabled)>();
        let entity = self.entity;
        run_until(&mut self.game, &format!("{story}: nothing is held"), move |world| {
            world.get::<Held>(entity).is_none()
        });
        self.update();
        let before = self.game.world().resource::<Heard>().answered;
        self.game.world_mut().write_message(Brush::dig(Shape::sphere(Vec3::new(48.0, 12.0, 48.0), 3.0)));
        run_until(&mut self.game, &format!("{story}: a dig is answered"), move |world| {
            world.resource::<Heard>().answered > before
        });
        self.update();
        self.note();
    }

    fn check(self, story: &str) {
        let Self { mut game, folders, expected, .. } = self;
        let warnings = game.world().resource::<Heard>().warnings.clone();
        game.world_mut().write_message(AppExit::Success);
        game.update();
        drop(game);
        for (kind, expected) in expected.into_iter().enumerate() {
            let Some(expected) = expected else { continue };
            let ground = Ground::flat(96, 96, HEIGHTS[kind]).expect("valid");
            let options = StoreOptions { base_changed: BaseChanged::Refuse, ..StoreOptions::default() };
            let opened = Store::open(&folders[kind].0, ground, options);
            let (_, opened) = opened.unwrap_or_else(|why| panic!("{story}: {why}"));
            assert!(opened.warnings.is_empty(), "{story}: {:?}", opened.warnings);
            let found = opened.terrain.world().hash();
            assert_eq!(found, expected, "{story}: folder {kind}, {warnings:?}");
        }
    }
}

/// Lives through some acts of a story.
fn live(seed: u64, acts: &[u64]) {
    let mut story = Story::new(seed);
    let mut told = format!("seed {seed}:");
    for &number in acts {
        told = format!("{told} {}", story.act(seed, number));
    }
    story.settle(&told);
    story.check(&told);
}

/// The acts of a story without which it would not fail.
fn reduce(seed: u64, mut acts: Vec<u64>) -> Vec<u64> {
    let mut at = 0;
    while at < acts.len() {
        let mut fewer = acts.clone();
        fewer.remove(at);
        if catch_unwind(|| live(seed, &fewer)).is_err() {
            acts = fewer;
        } else {
            at += 1;
        }
    }
    acts
}

#[test]
fn whatever_comes_and_goes_what_was_dug_in_a_world_is_in_its_folder() {
    let variable = |name: &str, or: u64| -> u64 {
        std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(or)
    };
    let (first, stories) = (variable("BURROW_SEED", 0), variable("BURROW_LIFECYCLES", 6));
    for seed in first..first + stories {
        let acts: Vec<u64> = (0..50).collect();
        if catch_unwind(|| live(seed, &acts)).is_err() {
            let least = reduce(seed, acts);
            live(seed, &least);
            panic!("seed {seed} fails with all acts only, and not with {least:?}");
        }
    }
}
