//! Speed and size of the saved format: samples encoded and decoded per second, and bytes per sample.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use bevy_burrow::format::WorldId;
use bevy_burrow::prelude::*;
use bevy_burrow::store::WorldFile;
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;
use glam::Vec3;

use crate::worlds::real_ground;

pub fn print() {
    let ground = Arc::new(real_ground());
    let mut rng = Rng::with_seed(1);
    let mut dig = |_| {
        let [x, z, radius] = [20.0 + rng.f32() * 900.0, 20.0 + rng.f32() * 900.0, 2.0 + rng.f32() * 3.0];
        (Vec3::new(x, 0.0, z), radius)
    };
    let digs = (0..2_000).map(&mut dig).collect();
    for (name, digs) in [("2,000 digs", digs), ("a crater", vec![(Vec3::new(500.0, 0.0, 500.0), 60.0)])] {
        print_world(name, &ground, digs);
    }
}

/// Digs at these points of the surface, with these radii.
fn print_world(name: &str, ground: &Arc<Ground>, digs: Vec<(Vec3, f32)>) {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    let height =
        |at: Vec3| terrain.world().height(at.x.into(), at.z.into()).expect("within the world") as f32;
    let brushes: Vec<Brush> = digs
        .into_iter()
        .map(|(at, radius)| Brush::dig(Shape::sphere(at.with_y(height(at)), radius)))
        .collect();
    terrain.apply(brushes);
    let samples: u64 =
        terrain.world().bricks().map(|(pos, brick)| brick.edited_samples(pos).count() as u64).sum();
    let start = Instant::now();
    let bytes = WorldFile::to_bytes(&terrain, WorldId(1), &BTreeMap::new()).expect("a small world");
    let encoded = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let imported = WorldFile::from_bytes(&bytes, Arc::clone(ground)).expect("the bytes of a world");
    let decoded = start.elapsed().as_secs_f64();
    assert_eq!(imported.terrain.world().hash(), terrain.world().hash());
    let million = samples as f64 / 1e6;
    println!(
        "{name}: {million:.2} million edited samples, {:.2} bytes each; {:.1} million a second are encoded, {:.1} decoded",
        bytes.len() as f64 / samples as f64,
        million / encoded,
        million / decoded
    );
}
