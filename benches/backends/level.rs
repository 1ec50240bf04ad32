//! Ground with many fields, and with one large field.

use std::sync::Arc;

use bevy_burrow::ground::Ground;
use bevy_burrow::prelude::*;
use glam::Vec3;

/// 16 x 32 chunks of 32 cells, to be dug one by one.
pub struct Level {
    ground: Arc<Ground>,
}

const SIDES: [u32; 2] = [16 * 32, 32 * 32];

fn height(x: f64, z: f64) -> f64 {
    16.0 + (x * 0.05).sin() * 5.0 + (z * 0.037).cos() * 6.0
}

impl Level {
    pub fn new() -> Self {
        let ground = Ground::from_fn(SIDES[0], SIDES[1], |x, z| height(x.into(), z.into()));
        Self { ground: Arc::new(ground.expect("finite heights")) }
    }

    pub fn terrain(&self) -> Terrain {
        Terrain::new(Arc::clone(&self.ground), &TerrainSettings::default()).expect("valid settings")
    }

    /// One brush per chunk, a rough or smooth crater, that changes samples in nearly all of the chunk's bricks.
    pub fn brushes(&self, pass: usize, is_rough: bool) -> impl Iterator<Item = Brush> {
        (0..512u32).map(move |i| {
            let (x, z) = ((i % 16) as f32 * 32.0 + 16.0, (i / 16) as f32 * 32.0 + 16.0);
            let center = Vec3::new(x + pass as f32, 16.0, z);
            let brush = Brush::dig(Shape::sphere(center, 13.0 + pass as f32 * 0.7));
            if is_rough { brush.with_roughness(Roughness::new(2.0, 6.0, i)) } else { brush }
        })
    }
}

/// A terrain of one chunk of `size` cells, and a queued brush that turns all of it into a field with caves.
pub fn one_field(size: u32, round: u32) -> Terrain {
    let ground = Ground::flat(size, size, f64::from(size) * 0.5).expect("finite heights");
    let settings = TerrainSettings { chunk_size: size, ..Default::default() };
    let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
    let center = Vec3::splat(size as f32 * 0.5);
    let shape = Shape::cuboid(center, center - 4.0);
    terrain.submit(Brush::dig(shape).with_roughness(Roughness::new(8.0, 12.0, round)));
    terrain
}
