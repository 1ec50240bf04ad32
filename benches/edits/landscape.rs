//! The landscape that is dug, and the places on it.

use std::sync::Arc;
use std::sync::OnceLock;

use bevy_burrow::ground::{GreyImage, Ground, ImageLimits, ImageScale};
use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use glam::Vec3;

/// The shipped elevation model as in the digger example.
pub fn ground() -> Arc<Ground> {
    static GROUND: OnceLock<Arc<Ground>> = OnceLock::new();
    Arc::clone(GROUND.get_or_init(|| {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png");
        let bytes = std::fs::read(path).expect("the shipped elevation model can be read");
        let image = GreyImage::decode_png(&bytes, &ImageLimits::default()).expect("a grey PNG");
        let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
        Arc::new(Ground::from_image(&image, &scale).expect("valid ground"))
    }))
}

/// A terrain without edits.
pub fn landscape(chunk_size: u32) -> Terrain {
    Terrain::new(ground(), &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings")
}

/// A brush that digs a ball.
pub fn dig(center: Vec3, radius: f32) -> Brush {
    Brush::dig(Shape::sphere(center, radius))
}

/// Places on the surface, spread over the landscape in a cache-unfriendly order.
pub struct Places {
    count: usize,
    first: usize,
}

impl Places {
    pub fn new(count: usize) -> Self {
        Self { count, first: 0 }
    }

    /// An equal number of other places.
    pub fn offset(self, round: usize) -> Self {
        Self { first: round * 1009, ..self }
    }

    pub fn iter(&self) -> impl Iterator<Item = Vec3> {
        let ground = ground();
        (self.first..self.first + self.count).map(move |i| {
            let i = i as i32;
            let (x, z) = (40 + i * 389 % 1100, 40 + i * 211 % 940);
            let height = ground.height(Column::new(x, z)) as f32 / 256.0;
            Vec3::new(x as f32, height, z as f32)
        })
    }
}

/// Runs `work` in a pool of one thread.
pub fn one_thread(work: impl FnOnce() + Send) {
    threads(1).install(work);
}

/// A pool of this many threads.
pub fn threads(count: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("threads can be started")
}

/// Submits digs of radius 4.
pub fn submit(terrain: &mut Terrain, count: usize, round: usize, is_spread: bool) {
    let places = Places::new(count).offset(round);
    let center = Places::new(1).offset(round).iter().next().unwrap_or_default();
    terrain.submit_all((0..).zip(places.iter()).map(|(i, place)| {
        let near = Vec3::new((i * 7 % 13) as f32, (i * 5 % 7) as f32, (i * 3 % 11) as f32) * 0.3;
        dig(if is_spread { place } else { center + near }, 4.0)
    }));
}
