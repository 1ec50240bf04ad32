//! The plugin's time on the main thread in frames of an app that shows a world.

use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use super::{percentiles, tunnels};

/// Median and 99th percentile, in microseconds, of the plugin's systems in frames with a dig and in those after it; the
/// terrain has levels of detail.
pub fn main_thread(terrain: Terrain, ground: &Ground, rng: &mut Rng) -> [f64; 2] {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin, BurrowPlugins));
    app.finish();
    app.cleanup();
    let middle = ground.width() as f32 / 2.0;
    app.world_mut().spawn((terrain, LevelsOfDetail::default()));
    app.world_mut().spawn((DetailSource::default(), Transform::from_xyz(middle, 80.0, middle)));
    let mut levels = app.world_mut().query::<&ShownLevels>();
    let start = Instant::now();
    loop {
        app.update();
        let is_shown = levels.iter(app.world()).any(|shown| !shown.nodes.is_empty() && shown.waiting == 0);
        if is_shown || start.elapsed() > Duration::from_secs(120) {
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let mut times = Vec::new();
    for at in tunnels(ground, rng).into_iter().flatten() {
        app.world_mut().write_message(Brush::dig(Shape::sphere(at, 4.0)));
        for _ in 0..3 {
            app.update();
            times.push(app.world().resource::<BurrowFigures>().main_thread);
            std::thread::sleep(Duration::from_millis(2));
        }
    }
    percentiles(times)
}
