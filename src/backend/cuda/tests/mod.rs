//! Compares the device with the CPU bit by bit, and tests faults.
//!
//! Tests use a GPU if there is one, else the emulator. Without a C++ compiler they print so and pass, or fail if
//! `BURROW_REQUIRE=1` is set. `BURROW_WORLDS` sets the number of random worlds.

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
use super::driver::Gpu;
use super::emulator_process::Emulator;
use super::zero_copy::ZeroCopy;
use super::*;
use crate::backend::Engine;
use crate::prelude::*;
use crate::surface::Indices;
use crate::terrain::{MeshKey, World};

pub(super) use crate::worlds;

/// A device to test, if any. If there is a GPU that cannot be opened, the test fails.
pub(super) fn device() -> Option<Box<dyn Device>> {
    match Gpu::open(&GpuChoice::Default, None) {
        Ok(gpu) => Some(Box::new(gpu)),
        Err(Fault::NoDriver | Fault::NoDevice(_)) => Some(Box::new(Emulator::start()?)),
        Err(fault) => panic!("the GPU can't be tested: {fault}"),
    }
}

/// Limits only the memory for bricks and ground.
pub(super) fn limits(records: usize) -> Limits {
    Limits { device: Some(usize::MAX), records: Some(records), host: usize::MAX }
}

/// A device that does every stage, whatever its size.
fn cuda(device: Box<dyn Device>, limits: Limits) -> Cuda {
    Cuda::with_device(false, limits, &[(4, 3.0)], |_| Ok(device))
}

/// An engine that does every stage on this device, which is open.
fn engine(device: Box<dyn Device>, records: usize) -> Engine {
    let engine = Engine::from_cuda(cuda(device, limits(records)));
    engine.wait(Duration::from_secs(60));
    engine
}

/// All drawn meshes, as bits.
fn drawn(world: &World) -> Vec<(MeshKey, Vec<u8>, Indices)> {
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

/// Applies the same transactions on the CPU and on an engine, and compares the worlds. Every fourth world has
/// rules.
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
            _ => worlds::random_gpu_brush(rng, &ground),
        };
        let brushes: Vec<Brush> = (0..rng.u32(1..6)).map(|_| brush(rng)).collect();
        assert_eq!(expected.apply(&brushes), found.apply(&brushes), "world {index}");
    }
    assert_same(expected.world(), found.world(), index);
}

/// Asserts that worlds are equal, bit by bit.
fn assert_same(expected: &World, found: &World, index: u64) {
    assert_eq!(expected.hash(), found.hash(), "world {index}");
    assert!(drawn(expected) == drawn(found), "world {index}");
    // Bricks are equal, including bits and materials, and use as much memory.
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

/// Applies transactions to this ground, on the CPU and on engines in turn.
fn compare_on(ground: Ground, chunk_size: u32, engines: &[&Engine], transactions: &[Vec<Brush>]) {
    compare_under(DiggingRules::default(), ground, chunk_size, engines, transactions);
}

/// Compares both engines under rules.
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

/// An engine that panics if memory is accessed while a copy is in flight.
fn async_copies() -> Option<Engine> {
    Some(engine(Box::new(AsyncCopies::new(device()?)), 64 << 20))
}

/// An engine whose kernels write short lists to host memory, as on a GPU.
fn zero_copy() -> Option<Engine> {
    Some(engine(Box::new(ZeroCopy::new(Box::new(Emulator::start()?))), 64 << 20))
}
