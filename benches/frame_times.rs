//! The cost of digging per frame: `cargo bench --features examples --bench frame_times [-- SECONDS WIDTH HEIGHT
//! [horizon] [moving] [large] [passes]]`; with 0 seconds materials alone are compared. With `horizon`, a world of 16 x
//! 16 km with levels of detail and a plain material, with views of 0.5 to 16 km, is compared with the real landscape in
//! full detail, and the meshes are counted that cast shadows in each cascade. With `moving`, a terrain of 4096 tiles is
//! drawn while a child of it moves and while nothing does. With `large`, frames are timed around commits with hundreds
//! of meshes.
//!
//! A walk over the real landscape with textures, shadows and fog, drawn without a window, at most 60 frames a second.
//! Each backend plays the walk digging, with 20 brushes of radius 3 a second by the clock, and then again over the dug
//! ground without digging. Colliders are made near a body that moves along, and balls lie about there. A frame is timed
//! from its start until the GPU has drawn it, so unlike in a game, frames never overlap. The plugin's time on the main
//! thread is the one that it reports. Finally, the walk is drawn with a plain `StandardMaterial` on the same meshes in
//! place of the `GroundLook`, and with nothing in sight, with shadows and without: the last lines say how many times
//! the plain material's part of the frame the look takes. With `passes`, the GPU's own time of each render pass is
//! printed for each of them, which costs time itself. Pictures are checked too: the benchmark fails if ground is
//! missing where a ray meets it.

#[path = "../examples/shared/capture.rs"]
mod capture;
#[path = "../examples/shared/holes.rs"]
mod holes;
#[path = "../examples/shared/mountains.rs"]
mod mountains;
#[path = "../examples/shared/offscreen.rs"]
mod offscreen;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use avian3d::prelude::*;
use bevy::camera::RenderTarget;
use bevy::camera::visibility::CascadesVisibleEntities;
use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::diagnostic::DiagnosticsStore;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::render_resource::{PollType, TextureFormat};
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice};
use bevy_burrow::backend::{Backend, Engine, EngineState};
use bevy_burrow::ground::{GreyImage, ImageLimits, ImageScale, NoiseSource};
use bevy_burrow::lattice::Column;
use bevy_burrow::physics::{ColliderSource, PhysicsFigures, TerrainPhysicsPlugin};
use bevy_burrow::plugin::MeshBytes;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::WorkLimits;
use image::Rgb;

/// Time between frames.
const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// Time between brushes.
const BRUSH: Duration = Duration::from_millis(50);

/// Frames between balls, and the largest number of balls.
const BALL_EVERY: usize = 20;
const BALLS: usize = 100;

/// Rounds in which materials are compared, and frames of each material in a round, of which the first ones don't count.
const ROUNDS: usize = 3;
const FRAMES_OF_ROUND: usize = 90;
const FIRST_FRAMES: usize = 5;

/// The longest a material is drawn in a round, for software renderers.
const ROUND: Duration = Duration::from_secs(5);

/// Frames before timing begins.
const WARM_UP: usize = 120;

/// What is drawn to compare materials.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Look(GroundQuality),
    Plain,
    /// The plain material, with nothing in sight.
    Nothing,
}

const PARTS: [Part; 4] =
    [Part::Look(GroundQuality::High), Part::Look(GroundQuality::Low), Part::Plain, Part::Nothing];

fn main() {
    // Cargo passes `--bench`.
    let given: Vec<u32> = std::env::args().skip(1).filter_map(|arg| arg.parse().ok()).collect();
    let [seconds, width, height] = [(0, 10), (1, 1280), (2, 720)]
        .map(|(at, default)| given.get(at).copied().unwrap_or(default).min(8192));
    let mut backends = vec![Backend::Cpu];
    if let EngineState::Cuda(name) = Engine::new(Backend::Cuda).wait(Duration::from_secs(30)) {
        println!("CUDA: {name}");
        backends.push(Backend::Cuda);
    }
    let frames = seconds as usize * 60;
    println!("{width} x {height}, {seconds} s each; us");
    if is_asked("horizon") {
        horizon((width, height), seconds as usize * 60);
        return;
    }
    if is_asked("moving") {
        moving((width, height));
        return;
    }
    if is_asked("large") {
        large((width, height));
        return;
    }
    if frames == 0 {
        Walk::new(Backend::Cpu, (width, height), Scene::Landscape).compare_materials(FRAMES_OF_ROUND);
        return;
    }
    for backend in backends {
        let mut walk = Walk::new(backend, (width, height), Scene::Landscape);
        for _ in 0..WARM_UP {
            walk.frame(0, false);
        }
        let mut medians = [[0.0; 2]; 2];
        for (pass, is_digging) in [true, false].into_iter().enumerate() {
            let (mut all, mut terrain, mut both) = (Vec::new(), Vec::new(), Vec::new());
            let (mut brushed, mut at_once) = (0, 0);
            let (start, before) = (Instant::now(), walk.figures());
            walk.next_brush = start;
            for number in 0..frames {
                let brush = walk.next_brush;
                all.push(walk.frame(number, is_digging));
                brushed += usize::from(walk.next_brush != brush);
                at_once += usize::from(walk.next_brush != brush && walk.is_committed());
                terrain.push(walk.figures().main_thread);
                let physics = walk.app.world().resource::<PhysicsFigures>().main_thread;
                both.push(walk.figures().main_thread + physics);
            }
            let (what, after) =
                (if is_digging { "digging" } else { "the same, nothing to do" }, walk.figures());
            println!(
                "{backend:?}, {what}: {} brushes in {} commits, {:.1} brushes a second",
                after.brushes - before.brushes,
                after.commits - before.commits,
                (after.brushes - before.brushes) as f64 / start.elapsed().as_secs_f64(),
            );
            if is_digging {
                println!("    frames with brushes: {brushed}, of which {at_once} show all of them");
            }
            medians[pass] = report("    frames", all);
            report("    the plugin in these: brushes, commits, starts", terrain);
            report("    the same and what it does for physics", both);
        }
        let [p50, p99] = [0, 1].map(|at| medians[0][at] / medians[1][at]);
        println!("{backend:?}: digging over nothing to do: p50 {p50:.2}, p99 {p99:.2}");
        if backend == Backend::Cpu {
            walk.compare_materials(frames.min(FRAMES_OF_ROUND));
        }
    }
}

/// Whether the command line has this word.
fn is_asked(word: &str) -> bool {
    std::env::args().any(|arg| arg == word)
}

/// Prints median and 99th percentile, and returns them.
fn report(what: &str, mut times: Vec<Duration>) -> [f64; 2] {
    times.sort_unstable();
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize].as_secs_f64() * 1e6;
    println!("{what:<60} p50 {:8.0}   p99 {:8.0}   most {:8.0}", at(0.5), at(0.99), at(1.0));
    [at(0.5), at(0.99)]
}

/// An app that walks over a landscape.
struct Walk {
    app: App,
    camera: Entity,
    film: Handle<Image>,
    path: Vec<Vec3>,
    balls: Vec<Entity>,
    /// Whether the camera is far above the ground, with nothing in sight.
    is_far: bool,
    /// When the next brush is due.
    next_brush: Instant,
}

impl Walk {
    fn new(backend: Backend, (width, height): (u32, u32), scene: Scene) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        let engine = Engine::new(backend);
        engine.wait(Duration::from_secs(30));
        let renderer = offscreen::find_renderer().expect("a graphics adapter");
        let mut app = offscreen::build(Some(renderer), |app| {
            app.add_plugins((BurrowPlugins, PhysicsPlugins::default(), TerrainPhysicsPlugin))
                .insert_resource(BurrowEngine(engine));
            if is_asked("passes") {
                app.add_plugins(RenderDiagnosticsPlugin);
            }
        });
        let ground = match scene {
            Scene::Horizon { .. } => mountains(),
            Scene::ManyTiles => many_tiles(),
            Scene::Landscape | Scene::Plain => ground(),
        };
        let path = path(&ground);
        let world = app.world_mut();
        println!("drawn by {}", world.resource::<RenderAdapterInfo>().name);
        let film = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        let film = world.resource_mut::<Assets<Image>>().add(film);
        // No ground has this colour.
        world.resource_mut::<ClearColor>().0 = Color::linear_rgb(1.0, 0.0, 1.0);
        let fog =
            DistanceFog { falloff: FogFalloff::from_visibility_squared(900.0), ..DistanceFog::default() };
        // Hidden ground is not shaded, as in the digger.
        let camera =
            (Camera3d::default(), DepthPrepass, RenderTarget::from(film.clone()), fog, Transform::default());
        // All scenes are seen as far.
        let projection = Projection::from(PerspectiveProjection { far: 20_000.0, ..default() });
        let camera = world.spawn((camera, projection, ColliderSource { radius: 48.0 })).id();
        let shadows =
            CascadeShadowConfigBuilder { num_cascades: 3, maximum_distance: 150.0, ..default() }.build();
        world.spawn((
            DirectionalLight { illuminance: 10_000.0, shadow_maps_enabled: true, ..default() },
            shadows,
            Transform::from_xyz(1.0, 0.9, 0.4).looking_at(Vec3::ZERO, Vec3::Y),
        ));
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        let plain = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
        let plain = (MeshMaterial3d(plain), SlimVertices);
        match scene {
            Scene::Landscape | Scene::ManyTiles => world.spawn((terrain, GroundLook::default())),
            Scene::Plain => world.spawn((terrain, plain)),
            Scene::Horizon { view_distance } => {
                world.spawn((terrain, plain, LevelsOfDetail { view_distance, ..default() }))
            }
        };
        let mut walk =
            Self { app, camera, film, path, balls: Vec::new(), is_far: false, next_brush: Instant::now() };
        // The ground is ready when its textures are generated and its tiles are shown.
        let start = Instant::now();
        while !walk.is_shown() {
            assert!(start.elapsed() < Duration::from_secs(300), "the ground never appeared");
            walk.place_camera(0);
            walk.app.update();
        }
        walk
    }

    fn is_shown(&mut self) -> bool {
        let world = self.app.world_mut();
        let mut looks = world.query_filtered::<(), With<GroundLook>>();
        let is_painted = looks.iter(world).count() == 0
            || world.get_resource::<GroundLoading>().is_none_or(|loading| loading.is_ready());
        let mut levels = world.query::<&ShownLevels>();
        let is_fine = levels.iter(world).all(|shown| shown.waiting == 0 && shown.progress() > 0.0);
        let mut tiles = world.query_filtered::<(), (With<Tile>, With<Mesh3d>)>();
        is_painted && is_fine && tiles.iter(world).count() > 0
    }

    /// Compares the look, in each quality, with a plain material, round by round, and prints medians of the rounds.
    fn compare_materials(&mut self, frames: usize) {
        for has_shadows in [true, false] {
            self.set_shadows(has_shadows);
            let shadows = if has_shadows { "shadows" } else { "no shadows" };
            let mut rounds = [[0.0; ROUNDS]; PARTS.len()];
            for round in 0..ROUNDS {
                for (part, medians) in rounds.iter_mut().enumerate() {
                    self.set_material(PARTS[part]);
                    self.is_far = PARTS[part] == Part::Nothing;
                    if round == 0 && !self.is_far {
                        self.check_for_holes(if part < 2 { "the look" } else { "a plain material" });
                    }
                    let start = Instant::now();
                    let is_in_time = |&number: &usize| number < FIRST_FRAMES + 3 || start.elapsed() < ROUND;
                    let mut took: Vec<_> = (0..FIRST_FRAMES + frames)
                        .take_while(is_in_time)
                        .map(|number| self.frame(number, false))
                        .collect();
                    took.drain(..FIRST_FRAMES);
                    took.sort_unstable();
                    medians[round] = took[took.len() / 2].as_secs_f64() * 1e6;
                    self.report_passes(&format!("{shadows}, {:?}", PARTS[part]));
                }
            }
            let [high, low, plain, nothing] = rounds.map(|mut medians| {
                medians.sort_unstable_by(f64::total_cmp);
                medians[ROUNDS / 2]
            });
            let [high_ratio, low_ratio] = [high, low].map(|look| (look - nothing) / (plain - nothing));
            println!(
                "{shadows}: look {high:.0}, of low quality {low:.0}, plain {plain:.0}, nothing in sight {nothing:.0}; \
                 over plain, all less nothing: look {high_ratio:.2}, of low quality {low_ratio:.2}"
            );
        }
        self.is_far = false;
    }

    /// Prints the GPU time of each pass since the last call, if that is measured.
    fn report_passes(&mut self, what: &str) {
        let mut diagnostics = self.app.world_mut().resource_mut::<DiagnosticsStore>();
        let mut passes = Vec::new();
        for diagnostic in diagnostics.iter_mut() {
            let path = diagnostic.path().as_str().to_string();
            if let Some(pass) =
                path.strip_prefix("render/").and_then(|path| path.strip_suffix("/elapsed_gpu"))
            {
                // In milliseconds.
                let average = diagnostic.average().unwrap_or(0.0) * 1e3;
                diagnostic.clear_history();
                if average >= 1.0 {
                    passes.push(format!("{pass} {average:.0}"));
                }
            }
        }
        if !passes.is_empty() {
            passes.sort_unstable();
            println!("    {what}: {}", passes.join(", "));
        }
    }

    /// What each cascade of the sun draws: meshes, by the levels of their nodes, and their bytes.
    fn casters(&mut self) -> Vec<String> {
        let world = self.app.world_mut();
        let mut suns = world.query::<&CascadesVisibleEntities>();
        let cascades = suns.iter(world).flat_map(|sun| sun.entities.values().flatten());
        let cascades: Vec<Vec<Entity>> = cascades.map(|cascade| cascade.entities.clone()).collect();
        let mut parts = world.query::<(Option<&Tile>, &MeshBytes)>();
        let describe = |casters: &Vec<Entity>| {
            let (mut levels, mut bytes) = (BTreeMap::<u8, usize>::new(), 0);
            for (tile, own) in parts.iter_many(world, casters) {
                *levels.entry(tile.map_or(0, |tile| tile.level)).or_default() += 1;
                bytes += own.0;
            }
            let levels: Vec<String> =
                levels.iter().map(|(level, count)| format!("{level}: {count}")).collect();
            format!("{} ({}; {} KiB)", casters.len(), levels.join(", "), bytes >> 10)
        };
        cascades.iter().map(describe).collect()
    }

    /// Looks at some frames of the walk.
    ///
    /// # Panics
    /// Panics if ground is missing.
    fn check_for_holes(&mut self, what: &str) {
        for number in [0, 200, 400] {
            for _ in 0..3 {
                self.frame(number, false);
            }
            let picture =
                capture::capture(&mut self.app, &self.film, Duration::from_secs(120)).expect("a picture");
            let background = Rgb([255, 0, 255]);
            let found = holes::count(&self.app, self.camera, &picture, 300.0, |_, _, pixel| {
                holes::is_same(pixel, &background)
            });
            assert!(found.holes == 0 && found.ground > 0, "{what}, frame {number}: {found:?}");
        }
    }

    /// Gives the terrain its look, or a plain material in place of it.
    fn set_material(&mut self, part: Part) {
        let world = self.app.world_mut();
        let terrain = world.query_filtered::<Entity, With<Terrain>>().single(world).expect("one terrain");
        let plain = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
        let mut terrain = world.entity_mut(terrain);
        match part {
            Part::Look(quality) => {
                let look = GroundLook { quality, ..default() };
                terrain.remove::<MeshMaterial3d<StandardMaterial>>().insert(look);
            }
            // On the same meshes: without the look they would get colours.
            Part::Plain | Part::Nothing => {
                terrain.remove::<GroundLook>().insert((MeshMaterial3d(plain), SlimVertices));
            }
        }
    }

    fn set_shadows(&mut self, has_shadows: bool) {
        let world = self.app.world_mut();
        let mut suns = world.query::<&mut DirectionalLight>();
        suns.iter_mut(world).for_each(|mut sun| sun.shadow_maps_enabled = has_shadows);
    }

    /// How many nodes are drawn.
    fn nodes(&mut self) -> usize {
        let world = self.app.world_mut();
        let mut levels = world.query::<&ShownLevels>();
        levels.iter(world).flat_map(|shown| &shown.nodes).sum()
    }

    /// Whether all brushes are committed.
    fn is_committed(&mut self) -> bool {
        let world = self.app.world_mut();
        let mut terrains = world.query::<&Terrain>();
        terrains.iter(world).all(|terrain| terrain.queued() == 0 && !terrain.is_busy())
    }

    fn figures(&self) -> BurrowFigures {
        self.app.world().resource::<BurrowFigures>().clone()
    }

    /// Puts the camera where it is in a frame, and returns a place ahead.
    fn place_camera(&mut self, number: usize) -> Vec3 {
        let up = if self.is_far { 1e5 } else { 0.0 } * Vec3::Y;
        let [at, ahead] = [number, number + 90].map(|number| self.path[number % self.path.len()] + up);
        if let Some(mut camera) = self.app.world_mut().get_mut::<Transform>(self.camera) {
            *camera = Transform::from_translation(at + Vec3::Y * 6.0).looking_at(ahead, Vec3::Y);
        }
        ahead
    }

    /// Shows the terrain or hides it.
    fn set_visible(&mut self, is_visible: bool) {
        let world = self.app.world_mut();
        let mut terrains = world.query_filtered::<&mut Visibility, With<Terrain>>();
        let visibility = if is_visible { Visibility::Inherited } else { Visibility::Hidden };
        terrains.iter_mut(world).for_each(|mut own| *own = visibility);
    }

    /// Draws one frame and returns its time.
    fn frame(&mut self, number: usize, is_digging: bool) -> Duration {
        let start = Instant::now();
        let ahead = self.place_camera(number);
        let world = self.app.world_mut();
        while is_digging && self.next_brush <= start {
            world.write_message(Brush::dig(Shape::sphere(ahead, 3.0)));
            self.next_brush += BRUSH;
        }
        if number.is_multiple_of(BALL_EVERY) {
            let place = Transform::from_translation(ahead + Vec3::Y * 8.0);
            self.balls.push(world.spawn((RigidBody::Dynamic, Collider::sphere(0.4), place)).id());
            if self.balls.len() > BALLS {
                world.despawn(self.balls.remove(0));
            }
        }
        self.app.update();
        let drawn = self.app.world().resource::<RenderDevice>().poll(PollType::wait_indefinitely());
        assert!(drawn.is_ok(), "the frame is never done: {drawn:?}");
        let took = start.elapsed();
        std::thread::sleep(FRAME.saturating_sub(took));
        took
    }
}

/// The ground of the walk.
#[derive(Clone, Copy)]
enum Scene {
    /// The real landscape with a look.
    Landscape,
    /// The real landscape with a plain material.
    Plain,
    /// 4096 tiles with a look.
    ManyTiles,
    /// Mountains to the horizon with levels of detail and a plain material.
    Horizon { view_distance: f32 },
}

/// Draws a terrain of many tiles, in turns while a child of it moves and while it stays.
fn moving(size: (u32, u32)) {
    let mut walk = Walk::new(Backend::Cpu, size, Scene::ManyTiles);
    let world = walk.app.world_mut();
    let mut tiles = world.query_filtered::<(), With<Tile>>();
    let tiles = tiles.iter(world).count();
    let mut terrains = world.query_filtered::<Entity, With<Terrain>>();
    let terrain = terrains.single(world).expect("one terrain");
    let child = world.spawn((Transform::default(), Visibility::default(), ChildOf(terrain))).id();
    for _ in 0..WARM_UP {
        walk.frame(0, false);
    }
    let mut times = [Vec::new(), Vec::new()];
    for round in 0..20 {
        let moves = round % 2 == 1;
        for number in 0..FRAMES_OF_ROUND / 2 {
            if moves && let Some(mut place) = walk.app.world_mut().get_mut::<Transform>(child) {
                place.translation.x += 0.1;
            }
            // The camera does not move, so that frames differ by nothing else.
            let took = walk.frame(1, false);
            if number >= FIRST_FRAMES {
                times[usize::from(moves)].push(took);
            }
        }
    }
    println!("{tiles} tiles");
    let [still, moving] = times;
    let still = report("nothing moves below the terrain", still);
    let moving = report("a child of the terrain moves", moving);
    let [p50, p99] = [0, 1].map(|at| moving[at] / still[at]);
    println!("moving over still: p50 {p50:.3}, p99 {p99:.3}");
}

/// Digs 900 holes in one commit, again and again, and times frames: before, until it is shown, and after.
fn large(size: (u32, u32)) {
    let mut walk = Walk::new(Backend::Cpu, size, Scene::Landscape);
    let world = walk.app.world_mut();
    let mut terrains = world.query::<&mut Terrain>();
    let mut terrain = terrains.single_mut(world).expect("one terrain");
    terrain.set_work_limits(WorkLimits::UNBOUNDED);
    let ground = terrain.world().shared_ground();
    let hole = |number: i32, depth: f32| {
        let at = Column::new(320 + number % 30 * 16, 260 + number / 30 * 16);
        let height = ground.height(at) as f32 / 256.0;
        Brush::dig(Shape::sphere(Vec3::new(at.x as f32, height - depth, at.z as f32), 3.0))
    };
    for _ in 0..WARM_UP {
        walk.frame(1, false);
    }
    let [mut before, mut until, mut after] = [const { Vec::new() }; 3];
    let (commits, swaps) = (walk.figures().commits, walk.figures().swaps);
    let rounds = 10;
    for round in 0..rounds {
        before.extend((0..30).map(|_| walk.frame(1, false)));
        walk.app.world_mut().write_message_batch((0..900).map(|number| hole(number, round as f32)));
        until.push(walk.frame(1, false));
        while !walk.is_committed() {
            until.push(walk.frame(1, false));
        }
        after.extend((0..30).map(|_| walk.frame(1, false)));
    }
    let (commits, swaps) = (walk.figures().commits - commits, walk.figures().swaps - swaps);
    println!("{rounds} times 900 holes: {commits} commits, {swaps} meshes");
    report("nothing to do", before);
    report("from the brushes until they are shown", until);
    report("after them", after);
}

/// Draws scenes with a plain material, each less the frame with nothing in sight.
fn horizon(size: (u32, u32), frames: usize) {
    let mut first = [0.0; 2];
    for view in [0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0] {
        let scene = match view {
            0.0 => Scene::Plain,
            view => Scene::Horizon { view_distance: view * 1000.0 },
        };
        let mut walk = Walk::new(Backend::Cpu, size, scene);
        let nodes = walk.nodes();
        let mut times = [0.0; 2];
        for (time, has_shadows) in times.iter_mut().zip([true, false]) {
            walk.set_shadows(has_shadows);
            let mut own = [true, false].map(|is_visible| {
                walk.set_visible(is_visible);
                let mut took: Vec<_> =
                    (0..FIRST_FRAMES + FRAMES_OF_ROUND).map(|number| walk.frame(number, false)).collect();
                took.drain(..FIRST_FRAMES);
                took.sort_unstable();
                let shadows = if has_shadows { "shadows" } else { "no shadows" };
                let what = if is_visible { "the ground" } else { "nothing in sight" };
                walk.report_passes(&format!("{view} km, {shadows}, {what}"));
                took[took.len() / 2].as_secs_f64() * 1e6
            });
            own[0] -= own[1];
            *time = own[0];
        }
        walk.set_visible(true);
        walk.set_shadows(true);
        walk.frame(0, false);
        println!("    casters in each cascade: {}", walk.casters().join(", "));
        walk.check_for_holes("levels of detail");
        if view == 0.0 {
            first = times;
            println!("1.2 km in full detail: {:.0} with shadows, {:.0} without", times[0], times[1]);
            continue;
        }
        let [shadows, none] = [0, 1].map(|at| times[at] / first[at]);
        println!(
            "{view} km: {nodes} nodes; {:.0} with shadows, {:.0} without; over full detail: {shadows:.2}, {none:.2}",
            times[0], times[1]
        );
        if frames > 0 && view == 8.0 {
            let passes = [true, false].map(|is_digging| {
                walk.next_brush = Instant::now();
                let mut terrain = Vec::new();
                let all = (0..frames).map(|number| {
                    let took = walk.frame(number, is_digging);
                    terrain.push(walk.figures().main_thread);
                    took
                });
                let all = report(if is_digging { "    digging" } else { "    nothing to do" }, all.collect());
                report("    the plugin on the main thread", terrain);
                all
            });
            println!("digging over nothing to do: p99 {:.2}", passes[0][1] / passes[1][1]);
        }
    }
}

/// Mountains of 16 x 16 km, computed on demand.
fn mountains() -> Ground {
    let source = NoiseSource::new(&mountains::heights()).expect("valid noise");
    Ground::from_source(16_384, 16_384, source).expect("a valid size")
}

/// Mountains of 64 x 64 tiles.
fn many_tiles() -> Ground {
    let source = NoiseSource::new(&mountains::heights()).expect("valid noise");
    Ground::from_source(2048, 2048, source).expect("a valid size")
}

/// The landscape of the examples.
fn ground() -> Ground {
    // Cargo sets it; elsewhere it says where the assets were copied to.
    let root = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_else(|_| env!("CARGO_MANIFEST_DIR").into());
    let path = format!("{root}/assets/jacksboro_fault.png");
    let bytes = std::fs::read(path).expect("the shipped elevation model can be read");
    let image = GreyImage::decode_png(&bytes, &ImageLimits::default()).expect("a grey PNG");
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    let ground = Ground::from_image(&image, &scale).expect("valid ground");
    ground.with_strata(&Strata::alpine()).expect("valid strata")
}

/// The position of the walk in each frame: a wide loop at 9 m/s on the ground.
fn path(ground: &Ground) -> Vec<Vec3> {
    let middle = Vec2::new(ground.width() as f32, ground.depth() as f32) / 2.0;
    // In the middle of a large world, else where there is a way.
    let center = if middle.x > 2000.0 { middle } else { Vec2::new(560.0, 500.0) };
    let (radius, frames) = (280.0, 12_000);
    let place = |frame: i32| {
        let angle = frame as f32 / frames as f32 * std::f32::consts::TAU;
        let at = center + Vec2::from_angle(angle) * radius;
        let height = ground.height(Column::new(at.x as i32, at.y as i32)) as f32 / 256.0;
        Vec3::new(at.x, height, at.y)
    };
    (0..frames).map(place).collect()
}
