//! The device against the processor, bit by bit, and whatever can go wrong with it.
//!
//! A card is used where there is one, else the emulator. Where there is no C++ compiler either, tests say so and pass; with
//! `BURROW_REQUIRE=1` they fail. `BURROW_WORLDS` says how many random worlds.

mod choice;
mod drivers;
mod equality;
mod faults;
mod memory;
mod opening;
mod output_lists;

use std::time::Duration;

use fastrand::Rng;

use super::async_copies::AsyncCopies;
use super::device::Device;
use super::driver::Card;
use super::emulator::Emulator;
use super::zero_copy::ZeroCopy;
use super::*;
use crate::backend::Engine;
use crate::prelude::*;
use crate::surface::Indices;
use crate::terrain::{Drawn, World};

pub(super) use crate::worlds;

/// A device to test, if there is any. A card that is there is tested, or nothing is.
pub(super) fn device() -> Option<Box<dyn Device>> {
    match Card::open(&CardChoice::Default, None) {
        Ok(card) => Some(Box::new(card)),
        Err(Fault::NoDriver | Fault::NoDevice(_)) => Some(Box::new(Emulator::start()?)),
        Err(fault) => panic!("the card can't be tested: {fault}"),
    }
}

/// Bricks and ground may take so many bytes, and all else as much as it wants.
pub(super) fn limits(records: usize) -> Limits {
    Limits { device: Some(usize::MAX), records: Some(records), host: usize::MAX }
}

/// A device that does everything, small as it may be.
fn cuda(device: Box<dyn Device>, limits: Limits) -> Cuda {
    Cuda::with_device(false, limits, &[(4, 3.0)], |_| Ok(device))
}

/// An engine that does everything on a device, which is open.
fn engine(device: Box<dyn Device>, records: usize) -> Engine {
    let engine = Engine::from_cuda(cuda(device, limits(records)));
    engine.wait(Duration::from_secs(60));
    engine
}

/// Everything that is drawn, as bits.
fn drawn(world: &World) -> Vec<(Drawn, Vec<u8>, Indices)> {
    let bits = |vertex: &crate::surface::Vertex| {
        let mut bytes = Vec::with_capacity(32);
        vertex.position.to_array().iter().for_each(|part| bytes.extend(part.to_le_bytes()));
        vertex.normal.to_array().iter().for_each(|part| bytes.extend(part.to_bits().to_le_bytes()));
        bytes.extend(vertex.materials.ids);
        bytes.extend(vertex.materials.weights);
        bytes
    };
    let all = world.drawn();
    all.map(|(drawn, mesh)| (drawn, mesh.vertices.iter().flat_map(bits).collect(), mesh.indices)).collect()
}

/// The same brushes on the processor and on an engine, in the same transactions; in every fourth world under rules.
fn compare(rng: &mut Rng, index: u64, engine: &Engine) {
    let seed = rng.u64(..);
    let (ground, chunk_size) = worlds::random_ground(&mut Rng::with_seed(seed), index);
    let settings = TerrainSettings { chunk_size, ..Default::default() };
    let ground = Arc::new(ground);
    let mut expected = Terrain::new(Arc::clone(&ground), &settings).expect("valid settings");
    let mut found = Terrain::new(Arc::clone(&ground), &settings).expect("valid settings");
    found.set_engine(engine.clone());
    if index % 4 == 3 {
        let rules = worlds::random_rules(rng, &ground);
        expected.set_rules(rules.clone()).expect("valid rules");
        found.set_rules(rules).expect("valid rules");
    }
    for _ in 0..rng.u32(1..5) {
        let brush = |rng: &mut Rng| match rng.u32(0..4) {
            0 => worlds::random_brush_at_a_face(rng, &ground, chunk_size),
            _ => worlds::any_random_brush(rng, &ground),
        };
        let brushes: Vec<Brush> = (0..rng.u32(1..6)).map(|_| brush(rng)).collect();
        assert_eq!(expected.apply(&brushes), found.apply(&brushes), "world {index}");
    }
    assert_same(expected.world(), found.world(), index);
}

/// Worlds are the same, bit by bit.
fn assert_same(expected: &World, found: &World, index: u64) {
    assert_eq!(expected.hash(), found.hash(), "world {index}");
    assert!(drawn(expected) == drawn(found), "world {index}");
    // What bricks hold, bits and materials included; and as much memory.
    let [own, others] = [expected, found].map(|world| {
        let mut all: Vec<_> = world.bricks().collect();
        all.sort_unstable_by_key(|(pos, _)| pos.0.to_array());
        all
    });
    assert_eq!(own.len(), others.len(), "world {index}");
    for ((pos, own), (other_pos, other)) in own.into_iter().zip(others) {
        assert!(pos == other_pos && self_test::are_same_bricks(own, other), "world {index}, {pos:?}");
    }
    assert_eq!(expected.memory().samples, found.memory().samples, "world {index}");
    assert_eq!(expected.memory().materials, found.memory().materials, "world {index}");
}

/// Transactions on the processor and on engines that take turns, on ground that is given.
fn compare_on(ground: Ground, chunk_size: u32, engines: &[&Engine], transactions: &[Vec<Brush>]) {
    compare_under(DiggingRules::default(), ground, chunk_size, engines, transactions);
}

/// The same under rules.
fn compare_under(
    rules: DiggingRules,
    ground: Ground,
    chunk_size: u32,
    engines: &[&Engine],
    transactions: &[Vec<Brush>],
) {
    let settings = TerrainSettings { chunk_size, ..Default::default() };
    let ground = Arc::new(ground);
    let [mut expected, mut found] =
        [0, 1].map(|_| Terrain::new(Arc::clone(&ground), &settings).expect("valid settings"));
    for terrain in [&mut expected, &mut found] {
        terrain.set_rules(rules.clone()).expect("valid rules");
    }
    for (number, brushes) in transactions.iter().enumerate() {
        found.set_engine(engines[number % engines.len()].clone());
        assert_eq!(expected.apply(brushes), found.apply(brushes), "transaction {number}");
        assert_same(expected.world(), found.world(), number as u64);
    }
    for engine in engines {
        assert!(matches!(engine.state(), EngineState::Cuda(_)), "{:?}", engine.state());
    }
}

/// An engine that panics where something is used while a copy is under way.
fn async_copies() -> Option<Engine> {
    Some(engine(Box::new(AsyncCopies::new(device()?)), 64 << 20))
}

/// An engine whose kernels write short lists to the host's memory, as those of a card do.
fn zero_copy() -> Option<Engine> {
    Some(engine(Box::new(ZeroCopy::new(Box::new(Emulator::start()?))), 64 << 20))
}
