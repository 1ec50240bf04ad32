//! What digging costs the main thread: `cargo bench --features examples --bench main_thread`.
//!
//! The real landscape in an app without a renderer; one radius-4 sphere at a time. Frames without work beside it.

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

fn main() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png");
    let bytes = std::fs::read(path).expect("the shipped elevation model can be read");
    let image = GreyImage::decode_png(&bytes, &ImageLimits::default()).expect("a grey PNG");
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    let ground = Ground::from_image(&image, &scale).expect("valid ground");
    let heights: Vec<(i32, f32, i32)> = (0..500)
        .map(|i| (40 + i * 389 % 1100, 40 + i * 211 % 940))
        .map(|(x, z)| (x, ground.height(Column::new(x, z)) as f32 / 256.0, z))
        .collect();
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin, BurrowPlugins));
    app.finish();
    app.cleanup();
    app.world_mut().spawn(Terrain::new(ground, &TerrainSettings::default()).expect("valid settings"));
    let mut tiles = app.world_mut().query_filtered::<(), With<Tile>>();
    while tiles.iter(app.world()).count() == 0 {
        app.update();
    }
    let frame = |app: &mut App| {
        let start = Instant::now();
        app.update();
        (start.elapsed(), app.world().resource::<BurrowFigures>().clone())
    };
    let (mut idle, mut busy, mut systems, mut transactions) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (x, y, z) in heights {
        for _ in 0..3 {
            idle.push(frame(&mut app).0);
        }
        let commits = app.world().resource::<BurrowFigures>().commits;
        app.world_mut().write_message(Brush::dig(Shape::sphere(Vec3::new(x as f32, y, z as f32), 4.0)));
        loop {
            let (took, figures) = frame(&mut app);
            busy.push(took);
            systems.push(figures.main_thread);
            if figures.commits > commits {
                transactions.push(figures.last_transaction);
                break;
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }
    report("whole frame, nothing to do", idle);
    report("whole frame, with a brush, a transaction or a commit", busy);
    report("the plugin's systems in such a frame", systems);
    report("transaction and Bevy meshes, in the task", transactions);
}
