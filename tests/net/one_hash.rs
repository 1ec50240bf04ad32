//! One order of edits of all operations has one hash, with one thread and with many, in any transactions, and on a GPU.
//!
//! ```text
//! BURROW_EDITS=100000 cargo test --release --no-default-features --features cuda,net,store --test net -- --nocapture one_hash
//! ```

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::backend::{Backend, Engine, EngineState};
use bevy_burrow::brush::Edit;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{Vec2, Vec3};

use crate::follower::{count, hills, terrain};
use crate::worlds::{any_random_brush, random_rules};

/// The requests, in order.
enum Turn {
    Edit(Edit),
    Rules(DiggingRules),
    Loose(Option<LooseSettings>),
}

fn script(ground: &Ground, edits: u64) -> Vec<Turn> {
    let mut rng = Rng::with_seed(27);
    let samples = (0..64).map(|at: u16| at * 900).collect();
    let image = Arc::new(GreyImage::from_samples(8, 8, samples).expect("an image"));
    let side = ground.width() as f32;
    let turn = |number: u64| match number % 100 {
        33 => Turn::Rules(if rng.bool() { random_rules(&mut rng, ground) } else { DiggingRules::default() }),
        66 => {
            let loose = LooseSettings { largest: 2000, crumbs: 9, debris: rng.u32(0..2000) };
            Turn::Loose(rng.bool().then_some(loose))
        }
        turn => {
            let at = Vec3::new(rng.f32() * side, 20.0, rng.f32() * side);
            let stamp = Stamp::new(Arc::clone(&image), at, Vec2::splat(9.0), 3.0);
            let brush = match turn % 10 {
                0 => Brush::stamp(Shape::sphere(at, 6.0), stamp),
                _ => any_random_brush(&mut rng, ground),
            };
            Edit::quantize(&brush).map_or(Turn::Loose(None), Turn::Edit)
        }
    };
    (0..edits).map(turn).collect()
}

/// The hash of the world.
fn play(ground: &Arc<Ground>, script: &[Turn], longest: u64, engine: &Engine) -> u64 {
    let (mut terrain, mut rng) = (terrain(ground), Rng::with_seed(longest));
    terrain.set_engine(engine.clone());
    let mut waiting = 0;
    for turn in script {
        match turn {
            Turn::Edit(edit) => terrain.submit(edit),
            Turn::Rules(rules) => terrain.set_rules(rules.clone()).expect("valid rules"),
            Turn::Loose(loose) => terrain.set_loose(*loose),
        }
        waiting += 1;
        if waiting >= rng.u64(1..=longest) {
            waiting = 0;
            while let Some(transaction) = terrain.begin() {
                terrain.commit(transaction.run()).expect("it waits for it");
            }
        }
    }
    while let Some(transaction) = terrain.begin() {
        terrain.commit(transaction.run()).expect("it waits for it");
    }
    terrain.world().hash()
}

#[test]
fn one_hash() {
    let edits = count("BURROW_EDITS", 400);
    let ground = hills(if edits > 20_000 { 512 } else { 128 });
    let script = script(&ground, edits);
    println!("| backend | threads | edits at once | edits | debug assertions | hash |");
    println!("| --- | ---: | ---: | ---: | --- | --- |");
    let run = |name: &str, engine: &Engine, threads, longest| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let hash = pool.install(|| play(&ground, &script, longest, engine));
        println!("| {name} | {threads} | {longest} | {edits} | {} | {hash:#018x} |", cfg!(debug_assertions));
        hash
    };
    let cpu = Engine::new(Backend::Cpu);
    let mut hashes: Vec<u64> = [(1, 1), (1, 40), (3, 1), (8, 40)]
        .map(|(threads, longest)| run("CPU", &cpu, threads, longest))
        .to_vec();
    let cuda = Engine::new(Backend::Cuda);
    if let EngineState::Cuda(card) = cuda.wait(Duration::from_secs(60)) {
        hashes.extend([(1, 40), (8, 400)].map(|(threads, longest)| run(&card, &cuda, threads, longest)));
        let figures = cuda.figures();
        println!("{} stages on the GPU, {} on the CPU", figures.cuda, figures.cpu);
        assert!(figures.cuda > 0 && matches!(cuda.state(), EngineState::Cuda(_)));
    }
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:x?}");
}
