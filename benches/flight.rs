//! A long flight without a renderer: `cargo bench --features examples --bench flight [-- MINUTES] [looking|digging]
//! [plain]`, by default one minute.
//!
//! A camera flies at 100 m/s and 60 frames a second, 60 m above a world of 16 x 16 km whose mountains are computed on
//! demand, with 8 km of view on a picture 1440 high at 45 degrees: first without edits, then with 20 digs a second
//! below it, each for the given minutes, or only one of the two. Vertices are slim, as with a look, or with `plain`
//! those of other materials. Printed are the plugin's time on the main thread in each frame, and every tenth of the
//! flight what the ground and the meshes take.

#[path = "../examples/shared/mountains.rs"]
mod mountains;

use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::ground::NoiseSource;
use bevy_burrow::plugin::MeshBytes;
use bevy_burrow::prelude::*;

/// Time between frames, and between digs.
const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);
const DIG: Duration = Duration::from_millis(50);

/// The flight is a circle around the middle, once a minute: its radius, metres a second, and metres above the ground.
const RADIUS: f32 = 955.0;
const SPEED: f32 = 100.0;
const HEIGHT: f32 = 60.0;

/// Pixels of a picture 1440 high at 45 degrees. A camera without a picture counts as 1080 high.
const PIXELS: f32 = 1738.0;

fn mib(bytes: usize) -> f64 {
    bytes as f64 / (1 << 20) as f64
}

struct Flight {
    app: App,
    camera: Entity,
    terrain: Entity,
    /// How long it has flown.
    time: Duration,
}

/// Bytes that a terrain takes while it is drawn.
struct Bytes {
    nodes: usize,
    ground: usize,
    edits: usize,
    tiles: usize,
    chunks: usize,
}

impl Flight {
    fn new(is_slim: bool) -> Self {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin, BurrowPlugins));
        app.finish();
        app.cleanup();
        let source = NoiseSource::new(&mountains::heights()).expect("valid noise");
        let ground = Ground::from_source(16_384, 16_384, source).expect("a valid size");
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        let fov = 2.0 * (1080.0 / (2.0 * PIXELS)).atan();
        let projection = Projection::from(PerspectiveProjection { fov, far: 20_000.0, ..default() });
        let levels = LevelsOfDetail { view_distance: 8000.0, ..default() };
        let camera = app.world_mut().spawn((Camera::default(), projection, Transform::default())).id();
        let terrain = app.world_mut().spawn((terrain, levels)).id();
        if is_slim {
            app.world_mut().entity_mut(terrain).insert(SlimVertices);
        }
        let mut flight = Self { app, camera, terrain, time: Duration::ZERO };
        let (start, mut first) = (Instant::now(), None);
        while !flight.is_complete() {
            assert!(start.elapsed() < Duration::from_secs(300), "the ground never appeared");
            flight.place_camera();
            flight.app.update();
            // All that is shown is closed at any time; at first with the coarsest nodes.
            if first.is_none() && flight.bytes().tiles > 0 {
                first = Some(start.elapsed());
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        println!(
            "closed ground is shown after {:.2?}, all of it after {:.2?}",
            first.unwrap_or_default(),
            start.elapsed()
        );
        flight
    }

    fn is_complete(&self) -> bool {
        let shown = self.app.world().get::<ShownLevels>(self.terrain);
        shown.is_some_and(|shown| shown.waiting == 0 && shown.progress() > 0.0)
    }

    /// Puts the camera where it is now, and returns the place on the ground below it.
    fn place_camera(&mut self) -> Vec3 {
        let turn = self.time.as_secs_f32() * SPEED / RADIUS;
        let at = Vec2::splat(8192.0) + Vec2::from_angle(turn) * RADIUS;
        let world = self.app.world().get::<Terrain>(self.terrain).expect("the terrain").world();
        let height = world.height(at.x.into(), at.y.into()).unwrap_or_default() as f32;
        let below = Vec3::new(at.x, height, at.y);
        if let Some(mut camera) = self.app.world_mut().get_mut::<Transform>(self.camera) {
            camera.translation = below + Vec3::Y * HEIGHT;
        }
        below
    }

    fn bytes(&mut self) -> Bytes {
        let world = self.app.world_mut();
        let sum = |query: &mut dyn Iterator<Item = &MeshBytes>| query.map(|bytes| bytes.0).sum();
        let mut all = world.query_filtered::<&MeshBytes, (With<Tile>, With<Mesh3d>)>();
        let tiles = sum(&mut all.iter(world));
        let mut all = world.query_filtered::<&MeshBytes, (With<Chunk>, With<Mesh3d>)>();
        let chunks = sum(&mut all.iter(world));
        let nodes = world.get::<ShownLevels>(self.terrain).map_or(0, |shown| shown.nodes.iter().sum());
        let memory = world.get::<Terrain>(self.terrain).expect("the terrain").world().memory();
        Bytes { nodes, ground: memory.ground, edits: memory.edits(), tiles, chunks }
    }

    /// Flies for a while.
    fn fly(&mut self, length: Duration, is_digging: bool) {
        println!("\n{}", if is_digging { "with 20 digs a second" } else { "without edits" });
        let (first, commits) = (self.time, self.app.world().resource::<BurrowFigures>().commits);
        let (mut main_thread, mut max_waiting, mut late) = (Vec::new(), 0, 0);
        let (mut tenth, mut next_dig, mut steady) = (0, self.time, Vec::new());
        while self.time < first + length {
            let start = Instant::now();
            let below = self.place_camera();
            while is_digging && next_dig <= self.time {
                self.app.world_mut().write_message(Brush::dig(Shape::sphere(below, 3.0)));
                next_dig += DIG;
            }
            self.app.update();
            main_thread.push(self.app.world().resource::<BurrowFigures>().main_thread);
            let waiting = self.app.world().get::<ShownLevels>(self.terrain).map_or(0, |shown| shown.waiting);
            max_waiting = max_waiting.max(waiting);
            if (self.time - first).as_secs_f64() >= length.as_secs_f64() / 10.0 * f64::from(tenth) {
                let bytes = self.bytes();
                let Bytes { nodes, ground, edits, tiles, chunks } = bytes;
                let [ground_mib, tiles_mib, edits, chunks] = [ground, tiles, edits, chunks].map(mib);
                println!(
                    "{:5.0} s: {nodes} nodes; MiB: ground {ground_mib:.1}, tiles {tiles_mib:.1}, edits {edits:.1}, chunks {chunks:.1}",
                    (self.time - first).as_secs_f64()
                );
                steady.push(bytes.ground + bytes.tiles);
                tenth += 1;
            }
            late += usize::from(start.elapsed() > FRAME);
            std::thread::sleep(FRAME.saturating_sub(start.elapsed()));
            self.time += FRAME.max(start.elapsed());
        }
        main_thread.sort_unstable();
        let at = |share: f64| main_thread[((main_thread.len() - 1) as f64 * share) as usize];
        let figures = self.app.world().resource::<BurrowFigures>();
        println!(
            "{} frames, {late} late, {} commits; main thread: p50 {:.0?}, p99 {:.0?}, most {:.0?}; at most {max_waiting} nodes waited",
            main_thread.len(),
            figures.commits - commits,
            at(0.5),
            at(0.99),
            at(1.0),
        );
        let steady = steady.get(1..).unwrap_or_default();
        let (low, high) = (steady.iter().min().copied(), steady.iter().max().copied());
        if let (Some(low), Some(high)) = (low, high) {
            let spread = (high as f64 / low as f64 - 1.0) * 100.0;
            println!("ground and tiles: {:.1} to {:.1} MiB, {spread:.1} % apart", mib(low), mib(high));
        }
    }
}

fn main() {
    let minutes =
        std::env::args().skip(1).find_map(|arg| arg.parse().ok()).unwrap_or(1.0f64).clamp(0.01, 600.0);
    let length = Duration::from_secs_f64(minutes * 60.0);
    let is_named = |name: &str| std::env::args().any(|arg| arg == name);
    let mut flight = Flight::new(!is_named("plain"));
    for (name, is_digging) in [("looking", false), ("digging", true)] {
        if is_named(name) || !is_named("looking") && !is_named("digging") {
            flight.fly(length, is_digging);
        }
    }
}
