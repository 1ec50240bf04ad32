//! Worlds that the tests of the formats save.

use std::sync::Arc;

use glam::{IVec3, Vec3};

use crate::brush::{Brush, Shape};
use crate::format::frame::WorldId;
use crate::format::portable::PortableWorld;
use crate::format::{Batch, Metadata};
use crate::ground::{Ground, MaterialId};
use crate::terrain::{CommitRecord, LooseSettings, Meshing, Terrain, TerrainSettings};
use crate::volume::DiggingRules;

/// Hills of a gentle kind.
pub fn hills(side: u32) -> Arc<Ground> {
    let height = |x: i32, z: i32| {
        let (x, z) = (f64::from(x), f64::from(z));
        60.0 + 9.0 * (x * 0.045).sin() + 7.0 * (z * 0.06 + x * 0.01).cos() + 0.8 * (x * 0.7 + z * 0.4).sin()
    };
    Arc::new(Ground::from_fn(side, side, height).expect("valid heights"))
}

/// A terrain that keeps a log and draws nothing.
pub fn terrain(ground: &Arc<Ground>) -> Terrain {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    terrain.keep_log(Some(1 << 30));
    terrain
}

/// Applies brushes, one a commit.
pub fn apply(terrain: &mut Terrain, brushes: impl IntoIterator<Item = Brush>) {
    for brush in brushes {
        for receipt in terrain.apply([brush]) {
            receipt.outcome.expect("the edit is applied");
        }
    }
}

/// A point on the ground.
pub fn surface(ground: &Ground, x: f32, z: f32) -> Vec3 {
    let column = crate::lattice::Column::new(x as i32, z as i32);
    Vec3::new(x, ground.heights::<8>(column)[0][0] as f32 / 256.0, z)
}

/// Digs here and there.
pub fn scattered(ground: &Ground, count: usize, seed: u64) -> Vec<Brush> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let side = ground.width() as f32 - 24.0;
    let dig = |_| {
        let at = surface(ground, 12.0 + rng.f32() * side, 12.0 + rng.f32() * side);
        Brush::dig(Shape::sphere(at + Vec3::Y * (rng.f32() * 2.0 - 1.0), 2.0 + rng.f32() * 3.0))
    };
    (0..count).map(dig).collect()
}

/// Where a player digs who walks through the hill: 20 digs a second at 3 voxels a second.
pub fn tunnel(ground: &Ground, count: usize, seed: u64) -> Vec<Brush> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut at = surface(ground, 12.0, 12.0) - Vec3::Y * 6.0;
    let mut heading = 0.7f32;
    let dig = |_| {
        heading += (rng.f32() - 0.5) * 0.2;
        at += Vec3::new(heading.cos(), (rng.f32() - 0.6) * 0.3, heading.sin()) * 0.2;
        let jitter = Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5;
        Brush::dig(Shape::sphere(at + jitter * 0.5, 3.0)).with_tag(7)
    };
    (0..count).map(dig).collect()
}

/// One large hole.
pub fn crater(ground: &Ground) -> Vec<Brush> {
    let middle = ground.width() as f32 / 2.0 + 0.3;
    vec![Brush::dig(Shape::sphere(surface(ground, middle, middle), 28.0))]
}

/// Brushes of all kinds with all materials.
pub fn mixed(ground: &Ground, count: usize, seed: u64) -> Vec<Brush> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let side = ground.width() as f32 - 24.0;
    let brush = |_| {
        let at = surface(ground, 12.0 + rng.f32() * side, 12.0 + rng.f32() * side)
            + Vec3::Y * (rng.f32() * 9.0 - 6.0);
        let shape = match rng.u8(..3) {
            0 => Shape::sphere(at, 1.0 + rng.f32() * 5.0),
            1 => Shape::cuboid(at, Vec3::new(1.0 + rng.f32() * 3.0, 2.0, 1.0 + rng.f32() * 4.0)),
            _ => Shape::capsule(at, at + Vec3::new(5.0, 2.0, 3.0), 2.0),
        };
        match rng.u8(..5) {
            0 => Brush::add(shape, MaterialId(rng.u8(1..6))),
            1 => Brush::paint(shape, MaterialId(rng.u8(1..6))),
            2 => Brush::smooth(shape, 0.5),
            _ => Brush::dig(shape),
        }
    };
    (0..count).map(brush).collect()
}

/// Batches of as many commits.
pub fn batches(log: &[CommitRecord], commits: usize) -> Vec<Batch> {
    let game = |number: usize| {
        let value = (!number.is_multiple_of(3)).then(|| vec![number as u8; number % 50]);
        if number.is_multiple_of(4) { vec![(format!("inventory {number}"), value)] } else { Vec::new() }
    };
    let batch =
        |(number, commits): (usize, &[CommitRecord])| Batch { commits: commits.to_vec(), game: game(number) };
    log.chunks(commits).enumerate().map(batch).collect()
}

/// A world that was dug, painted, sculpted, undone and put in place, under rules that changed.
pub fn eventful(ground: &Arc<Ground>, count: usize, seed: u64) -> Terrain {
    let mut terrain = terrain(ground);
    let mut rng = fastrand::Rng::with_seed(seed);
    for (number, brush) in mixed(ground, count, seed).into_iter().enumerate() {
        let brush = match number % 3 {
            0 => brush.with_tag(number as u64),
            1 => brush.with_tag(rng.u64(..)).with_stroke(rng.u64(..5)),
            _ => brush.with_power(rng.u8(1..)),
        };
        if rng.u8(..8) == 0 {
            let rules = DiggingRules::default().with_hardness(MaterialId(2), rng.u8(..)).with_bedrock(20);
            terrain.set_rules(rules).expect("valid rules");
        }
        if rng.u8(..8) == 0 {
            let settings = LooseSettings { crumbs: 40, debris: rng.u32(..90), ..LooseSettings::default() };
            terrain.set_loose(rng.bool().then_some(settings));
        }
        terrain.apply([brush]);
        if rng.u8(..6) == 0 {
            terrain.undo();
        }
    }
    terrain
}

/// A portable file of a world with its journal.
pub fn portable(terrain: &mut Terrain, ground: &Ground) -> PortableWorld {
    let world = terrain.world();
    let metadata = Metadata {
        hash: world.hash(),
        ground: ground.hash(),
        simulation: Terrain::SIMULATION,
        game: vec![("time".into(), vec![1, 2, 3])],
        ..Metadata::default()
    };
    let parts = terrain.parts();
    let journal = batches(&terrain.take_log(), 7);
    PortableWorld { journal, ..PortableWorld::new(WorldId(0x1234_5678), metadata, parts, ground) }
}

/// A point with coordinates from 0 to below `end`.
pub fn point(rng: &mut fastrand::Rng, end: i32) -> IVec3 {
    IVec3::new(rng.i32(0..end), rng.i32(0..end), rng.i32(0..end))
}
