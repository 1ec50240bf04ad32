//! The cost of digging on the main thread: `cargo bench --features examples --bench main_thread`.
//!
//! The real landscape in an app without a renderer, one sphere of radius 4 at a time, compared with idle frames, and
//! those with frames of the same app without this crate; and the task's time until Bevy's meshes are ready, by chunk
//! size. Vertices have depths, or with `-- slim` none; with
//! `-- light` they have the light of the sky. With `-- colliders`, all ground has colliders, in chunks of 32. With
//! `-- repeated`, each dig is near the one before it. Printed first is the time until all of the landscape is there.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::ground::{GreyImage, Ground, ImageLimits, ImageScale};
use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;

fn report(what: &str, mut durations: Vec<Duration>) {
    durations.sort_unstable();
    let at = |share: f64| durations[((durations.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6;
    println!("{what:<50} median {:8.1} us   p99 {:8.1} us   n {}", at(0.5), at(0.99), durations.len());
}

/// Whether the command line has this word.
fn is_asked(word: &str) -> bool {
    std::env::args().any(|arg| arg == word)
}

/// Times of one app.
#[derive(Default)]
struct Times {
    idle: Vec<Duration>,
    busy: Vec<Duration>,
    systems: Vec<Duration>,
    /// Digs, and those of them that were committed in the frame in which they were sent.
    digs: usize,
    at_once: usize,
    transactions: Vec<Duration>,
}

/// An app without a terrain, and without anything that could show one.
fn bare_app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin));
    app
}

/// An app whose terrain is loaded.
fn app(ground: &Arc<Ground>, chunk_size: u32, is_slim: bool) -> App {
    let settings = TerrainSettings { chunk_size, ..default() };
    let mut app = bare_app();
    app.add_plugins(BurrowPlugins);
    #[cfg(feature = "avian")]
    if is_asked("colliders") {
        use avian3d::prelude::PhysicsPlugins;
        use bevy_burrow::physics::{ColliderSource, TerrainPhysicsPlugin};
        app.add_plugins((PhysicsPlugins::default(), TerrainPhysicsPlugin));
        app.world_mut().spawn((Transform::default(), ColliderSource { radius: f32::INFINITY }));
    }
    app.finish();
    app.cleanup();
    let terrain = Terrain::new(Arc::clone(ground), &settings).expect("valid settings");
    let terrain = app.world_mut().spawn(terrain).id();
    if is_slim {
        app.world_mut().entity_mut(terrain).insert(SlimVertices);
    }
    if is_asked("light") {
        app.world_mut().entity_mut(terrain).insert(SkyLight::default());
    }
    let mut tiles = app.world_mut().query_filtered::<(), With<Tile>>();
    let start = Instant::now();
    while tiles.iter(app.world()).count() == 0 {
        app.update();
        std::thread::sleep(Duration::from_micros(200));
    }
    let count = tiles.iter(app.world()).count();
    println!("chunks of {chunk_size}: {count} tiles in full detail are shown after {:.2?}", start.elapsed());
    app
}

impl Times {
    /// Runs some idle frames, then digs once.
    fn dig(&mut self, app: &mut App, at: Vec3) {
        let frame = |app: &mut App| {
            let start = Instant::now();
            app.update();
            (start.elapsed(), app.world().resource::<BurrowFigures>().clone())
        };
        self.idle.extend((0..3).map(|_| frame(app).0));
        let commits = app.world().resource::<BurrowFigures>().commits;
        app.world_mut().write_message(Brush::dig(Shape::sphere(at, 4.0)));
        self.digs += 1;
        for number in 0.. {
            let (took, figures) = frame(app);
            self.busy.push(took);
            self.systems.push(figures.main_thread);
            if figures.commits > commits {
                self.at_once += usize::from(number == 0);
                return self.transactions.push(figures.last_transaction);
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}

fn main() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png");
    let bytes = std::fs::read(path).expect("the shipped elevation model can be read");
    let image = GreyImage::decode_png(&bytes, &ImageLimits::default()).expect("a grey PNG");
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    let ground = Arc::new(Ground::from_image(&image, &scale).expect("valid ground"));
    let sizes: &[u32] = if is_asked("colliders") { &[32] } else { &[32, 25, 50, 100] };
    let mut apps: Vec<_> =
        sizes.iter().map(|&size| (size, app(&ground, size, is_asked("slim")), Times::default())).collect();
    let mut bare = bare_app();
    let mut bare_frames = Vec::new();
    for (turn, i) in (0..500).enumerate() {
        bare_frames.extend((0..3).map(|_| {
            let start = Instant::now();
            bare.update();
            start.elapsed()
        }));
        let (x, z) = match is_asked("repeated") {
            true => (500 + i * 5 % 40, 500 + i * 3 % 41),
            false => (40 + i * 389 % 1100, 40 + i * 211 % 940),
        };
        let at = Vec3::new(x as f32, ground.height(Column::new(x, z)) as f32 / 256.0, z as f32);
        // In turns, beginning with another app each time.
        for number in 0..apps.len() {
            let number = (number + turn) % apps.len();
            let (_, app, times) = &mut apps[number];
            times.dig(app, at);
        }
    }
    report("whole frame, without this crate", bare_frames);
    for (size, _, times) in apps {
        if size == 32 {
            report("whole frame, nothing to do", times.idle);
            report("whole frame, with a brush, a transaction or a commit", times.busy);
            report("the plugin's systems in such a frame", times.systems);
        }
        println!("chunks of {size}: {} of {} digs seen in their own frame", times.at_once, times.digs);
        report(&format!("transaction and Bevy meshes, chunks of {size}"), times.transactions);
    }
}
