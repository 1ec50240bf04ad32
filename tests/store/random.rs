//! Random operations on a saved world against the same world in memory. `BURROW_OPERATIONS` is their number.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, WorldFile};
use bevy_burrow::terrain::{Meshing, WorldParts};
use fastrand::Rng;

use crate::play::{State, check_opened, count, ground, open, options, save, state, terrain};
use crate::worlds::any_random_brush;

/// The settings of every terrain here.
fn settings() -> TerrainSettings {
    TerrainSettings { chunk_size: 25, ..TerrainSettings::default() }
}

/// A world in memory, and its states since the last durable one.
struct Model {
    terrain: Terrain,
    states: BTreeMap<u64, Vec<State>>,
    parts: Vec<(u64, WorldParts)>,
    acknowledged: u64,
}

impl Model {
    fn new(terrain: Terrain) -> Self {
        let mut model = Self { terrain, states: BTreeMap::new(), parts: Vec::new(), acknowledged: 0 };
        model.enter();
        model
    }

    fn enter(&mut self) {
        let revision = self.terrain.world().revision();
        self.states.entry(revision).or_default().push(state(&self.terrain));
        self.parts.push((revision, self.terrain.parts()));
    }

    fn acknowledge(&mut self, revision: u64) {
        self.acknowledged = revision;
        self.states.retain(|own, _| *own >= revision);
        self.parts.retain(|(own, _)| *own >= revision);
    }

    /// Returns to the recovered state.
    fn go_back(&mut self, ground: &Arc<Ground>, to: &Terrain) {
        let found = state(to);
        let is_it = |(revision, parts): &&(u64, WorldParts)| {
            let is_same = (parts.edit_settings.rules.as_deref(), parts.edit_settings.loose)
                == (found.rules.as_ref(), found.loose);
            *revision == to.world().revision() && is_same
        };
        let (_, parts) = self.parts.iter().rfind(is_it).expect("it was so").clone();
        let settings = TerrainSettings { chunk_size: parts.chunk_size, ..TerrainSettings::default() };
        self.terrain = Terrain::restore(Arc::clone(ground), &settings, parts).expect("its own parts");
        self.terrain.set_meshing(Meshing::Never);
        self.states.clear();
        self.parts.clear();
        self.enter();
        self.acknowledge(to.world().revision());
    }
}

fn play(seed: u64, operations: u64) -> [u64; 5] {
    let mut rng = Rng::with_seed(seed);
    let ground = ground(seed % 40);
    let mut disk = SimulatedDisk::new();
    let mut saved = terrain(&ground);
    let mut model = Model::new(terrain(&ground));
    let store = Store::create_in(Arc::new(disk.clone()), &mut saved, options(rng.u64(3..40)));
    let mut store = Some(store.expect("a new world"));
    let mut done = [0; 5];
    for _ in 0..operations {
        let open_store = store.as_mut().expect("it is open");
        match rng.u32(0..40) {
            0 => {
                let revision = open_store.checkpoint().expect("the disk works");
                model.acknowledge(revision);
                done[0] += 1;
            }
            1..=3 => {
                let revision = open_store.flush().expect("the disk works");
                assert_eq!(revision, saved.world().revision());
                model.acknowledge(revision);
                done[1] += 1;
            }
            kind @ 4..=5 => {
                // The store is closed, or the process dies, or the power is lost.
                let image = disk.image();
                let power = rng.bool();
                if kind == 4 {
                    done[2] += 1;
                    drop(store.take());
                    model.acknowledge(saved.world().revision());
                } else {
                    done[3] += 1;
                    let mut keep = Rng::with_seed(rng.u64(..));
                    disk = if power { image.lose_power(|| keep.bool()) } else { image.lose_process() };
                    drop(store.take());
                }
                let opened = open(&disk, &ground).unwrap_or_else(|why| panic!("seed {seed}: {why}"));
                check_opened(&opened, &model.states, model.acknowledged, model.terrain.world().revision());
                model.go_back(&ground, &opened.1.terrain);
                saved = opened.1.terrain;
                saved.set_meshing(Meshing::Never);
                assert_eq!(state(&saved), state(&model.terrain), "seed {seed}");
                store = Some(opened.0);
            }
            39 => {
                // The world is exported to bytes and imported into another folder.
                let bytes = WorldFile::to_bytes(&saved, open_store.world_id(), open_store.game_data())
                    .expect("it is small");
                drop(store.take());
                let imported = WorldFile::from_bytes(&bytes, Arc::clone(&ground)).expect("its own bytes");
                saved = imported.terrain;
                assert_eq!(state(&saved), state(&model.terrain), "seed {seed}");
                saved.set_meshing(Meshing::Never);
                disk = SimulatedDisk::new();
                let new = Store::create_in(Arc::new(disk.clone()), &mut saved, options(20));
                let mut new = new.expect("a new world");
                imported.game.into_iter().for_each(|(key, bytes)| new.put(key, bytes));
                new.flush().expect("the disk works");
                store = Some(new);
                let same = Terrain::restore(Arc::clone(&ground), &settings(), saved.parts());
                model.go_back(&ground, &same.expect("its own parts"));
                done[4] += 1;
            }
            6..=8 => {
                let receipts = [&mut saved, &mut model.terrain].map(|own| own.undo());
                assert_eq!(format!("{:?}", receipts[0]), format!("{:?}", receipts[1]), "seed {seed}");
            }
            9..=10 => {
                let receipts = [&mut saved, &mut model.terrain].map(|own| own.redo());
                assert_eq!(format!("{:?}", receipts[0]), format!("{:?}", receipts[1]), "seed {seed}");
            }
            11 => {
                let rules = DiggingRules::default().with_unbreakable(MaterialId(rng.u8(0..4)));
                let rules = if rng.bool() { rules } else { DiggingRules::default() };
                for own in [&mut saved, &mut model.terrain] {
                    own.set_rules(rules.clone()).expect("valid rules");
                }
            }
            12 => {
                let loose = LooseSettings { largest: 4096, crumbs: rng.u32(0..40), debris: rng.u32(0..400) };
                let loose = rng.bool().then_some(loose);
                for own in [&mut saved, &mut model.terrain] {
                    own.set_loose(loose);
                }
            }
            _ => {
                let brush = any_random_brush(&mut rng, &ground);
                let receipts = [&mut saved, &mut model.terrain].map(|own| own.apply([brush.clone()]));
                assert_eq!(receipts[0], receipts[1], "seed {seed}");
            }
        }
        if let Some(store) = &mut store {
            model.enter();
            save(store, &mut saved).expect("the thread runs");
        }
    }
    assert_eq!(state(&saved), state(&model.terrain), "seed {seed}");
    done
}

#[test]
fn a_saved_world_is_the_world_in_memory() {
    let operations = count("BURROW_OPERATIONS", 1_500);
    let (each, mut total) = (150, [0; 5]);
    for seed in 0..operations.div_ceil(each) {
        let done = play(seed, each);
        total = std::array::from_fn(|at| total[at] + done[at]);
    }
    let [checkpoints, flushes, reopened, crashed, imported] = total;
    println!(
        "{operations} operations: {checkpoints} checkpoints, {flushes} flushes, {reopened} closed, {crashed} crashed, \
         {imported} exported and imported"
    );
}
