//! The cost of plants: `cargo bench --features examples --bench plants [-- WIDTH HEIGHT FRAMES] [small] [entities] [dig]
//! [grass] [trees] [prepass] [aliased]`.
//!
//! A million blades of grass (tufts of eight) and 20,000 trees within sight on a hilly world of 2 x 2 km, over the same view
//! without plants and over an empty one, with shadows and without, for several view distances. Frames are drawn without a
//! window, one after the other, and each is timed until the GPU has drawn it; the median counts. `app` is the time of the main
//! thread until the frame is handed to the GPU.
//!
//! `small` has a tenth of everything, for software renderers. `entities` draws each plant as an entity of its own, with shared
//! meshes and materials, which Bevy batches automatically. `grass` and `trees` draw only these. The camera has a depth
//! prepass with `prepass`, and no MSAA with `aliased`. `dig` compares digs with plants and without: transaction and commit.

#[path = "../examples/shared/offscreen.rs"]
mod offscreen;
#[path = "../examples/shared/plant_meshes.rs"]
mod plant_meshes;

use std::collections::HashMap;
use std::time::{Duration, Instant};

use bevy::camera::RenderTarget;
use bevy::core_pipeline::prepass::DepthPrepass;
use bevy::prelude::*;
use bevy::render::render_resource::{PollType, TextureFormat};
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice};
use bevy_burrow::lattice::Column;
use bevy_burrow::plants::{PlantDrawingPlugin, PlantLook, PlantLooks, Plants, PlantsPlugin, ShownPlants};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Clearance, PlantPatch, Scatter, ScatterRules, Species, Stem, ViewDistances};

/// Cells along each side of the world.
const SIDE: u32 = 2048;

/// View distances in shares of the full ones.
const DISTANCES: [f32; 3] = [0.25, 0.5, 1.0];

fn is_asked(word: &str) -> bool {
    std::env::args().any(|arg| arg == word)
}

/// A million blades within 160 m and 20,000 trees within 900 m, times `share`.
fn rules(distance: f32, share: f32) -> ScatterRules {
    let near = share.sqrt();
    let tree = Species {
        spacing: 7.5,
        density: 0.9,
        distance: 4.0,
        room: 0.5,
        size: (0.7, 1.3),
        clearance: Clearance { radius: 1.2, height: 7.0 },
        stem: Some(Stem { radius: 0.35, height: 6.0 }),
        view: ViewDistances { detail: 90.0, end: 900.0 * distance * near, shadows: 140.0 },
        ..Species::named("fir")
    };
    let view = 160.0 * distance * near;
    let grass = Species {
        spacing: 0.8,
        size: (0.7, 1.5),
        view: ViewDistances { detail: 25.0, end: view, shadows: 30.0 },
        ..Species::named("grass")
    };
    let mut species = vec![tree, grass];
    species.retain(|species| match species.name.as_str() {
        "fir" => !is_asked("grass"),
        _ => !is_asked("trees"),
    });
    ScatterRules { seed: 1, species }
}

fn ground() -> Ground {
    let noise = NoiseHeights { amplitude: 40.0, scale: 420.0, octaves: 5, ..NoiseHeights::default() };
    Ground::from_noise(SIDE, SIDE, &noise).expect("valid parameters")
}

/// An app that draws the world.
struct View {
    app: App,
    terrain: Entity,
    camera: Entity,
    sun: Entity,
}

impl View {
    fn new((width, height): (u32, u32)) -> Self {
        let renderer = offscreen::find_renderer().expect("a graphics adapter");
        let mut app = offscreen::build(Some(renderer), |app| {
            app.add_plugins((BurrowPlugins, PlantsPlugin, PlantDrawingPlugin));
        });
        let world = app.world_mut();
        println!("drawn by {}, {width} x {height}", world.resource::<RenderAdapterInfo>().name);
        let film = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        let film = world.resource_mut::<Assets<Image>>().add(film);
        let ground = ground();
        let middle = (SIDE / 2) as i32;
        let eye = ground.height(Column::new(middle, middle)) as f32 / 256.0 + 6.0;
        let at = Vec3::new(middle as f32, eye, middle as f32);
        let projection = Projection::from(PerspectiveProjection { far: 4000.0, ..default() });
        let place = Transform::from_translation(at).looking_to(Vec3::new(1.0, -0.12, 0.4), Vec3::Y);
        let camera = world.spawn((Camera3d::default(), RenderTarget::from(film), projection, place)).id();
        if is_asked("prepass") {
            world.entity_mut(camera).insert(DepthPrepass);
        }
        if is_asked("aliased") {
            world.entity_mut(camera).insert(Msaa::Off);
        }
        let light = DirectionalLight { illuminance: 10_000.0, ..default() };
        let sun =
            world.spawn((light, Transform::from_xyz(1.0, 0.9, 0.4).looking_at(Vec3::ZERO, Vec3::Y))).id();
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(Color::srgb(0.3, 0.4, 0.2));
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        let look = (MeshMaterial3d(material), SlimVertices, LevelsOfDetail::default());
        let terrain = world.spawn((terrain, look)).id();
        let mut view = Self { app, terrain, camera, sun };
        view.wait(|world, terrain| {
            let shown = world.get::<ShownLevels>(terrain);
            shown.is_some_and(|shown| shown.waiting == 0 && shown.progress() > 0.0)
        });
        view
    }

    /// Updates until something is true.
    fn wait(&mut self, is_done: impl Fn(&World, Entity) -> bool) {
        let start = Instant::now();
        while !is_done(self.app.world(), self.terrain) {
            assert!(start.elapsed() < Duration::from_secs(300), "it never came");
            self.app.update();
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Shows these plants, and returns how many of each species there are.
    fn plant(&mut self, rules: ScatterRules) -> HashMap<&'static str, usize> {
        let world = self.app.world_mut();
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        let material =
            StandardMaterial { perceptual_roughness: 0.95, double_sided: true, cull_mode: None, ..default() };
        let mut look = |species: &str, mesh: Mesh, far: Option<Mesh>, sway| PlantLook {
            species: species.into(),
            mesh: meshes.add(mesh),
            far: far.map(|far| meshes.add(far)),
            material: material.clone(),
            sway,
            ..default()
        };
        let looks = vec![
            look("fir", plant_meshes::fir(), Some(plant_meshes::far_fir()), 0.004),
            look("grass", plant_meshes::grass(), Some(plant_meshes::far_grass()), 0.15),
        ];
        world.entity_mut(self.terrain).insert((Plants(rules), PlantLooks(looks)));
        self.app.update();
        self.wait(|world, terrain| {
            world
                .get::<ShownPlants>(terrain)
                .is_some_and(|shown| shown.patches().is_some() && !shown.is_loading())
        });
        self.app.update();
        self.counts()
    }

    fn counts(&self) -> HashMap<&'static str, usize> {
        let mut counts = HashMap::from([("fir", 0), ("grass", 0)]);
        let shown = self.app.world().get::<ShownPlants>(self.terrain);
        let Some(patches) = shown.and_then(ShownPlants::patches) else { return counts };
        let eye =
            self.app.world().get::<Transform>(self.camera).map_or(Vec3::ZERO, |place| place.translation);
        for (pos, patch) in patches.iter() {
            let species = &patches.scatter().species()[usize::from(pos.species)];
            let end = species.view.end;
            let is_near =
                |plant: &&bevy_burrow::scatter::Plant| plant.position().as_vec3().distance(eye) < end;
            let name = if species.name == "fir" { "fir" } else { "grass" };
            *counts.entry(name).or_default() += patch.standing().filter(is_near).count();
        }
        counts
    }

    /// One entity for each plant.
    fn plant_entities(&mut self) {
        let world = self.app.world_mut();
        let shown = world.get::<ShownPlants>(self.terrain).and_then(ShownPlants::patches);
        let plants: Vec<_> = shown
            .into_iter()
            .flat_map(|patches| patches.iter().flat_map(|(_, patch)| PlantPatch::standing(patch).copied()))
            .collect();
        world.entity_mut(self.terrain).remove::<(PlantLooks, Plants)>();
        let meshes = [plant_meshes::fir(), plant_meshes::grass()]
            .map(|mesh| world.resource_mut::<Assets<Mesh>>().add(mesh));
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
        world.spawn_batch(plants.into_iter().map(move |plant| {
            let turn = f32::from(plant.turn) / 65536.0 * std::f32::consts::TAU;
            let place = Transform::from_translation(plant.position().as_vec3())
                .with_rotation(Quat::from_rotation_y(turn))
                .with_scale(Vec3::splat(f32::from(plant.size) / 256.0));
            (Mesh3d(meshes[usize::from(plant.id.species)].clone()), MeshMaterial3d(material.clone()), place)
        }));
    }

    fn set_shadows(&mut self, has_shadows: bool) {
        let mut sun = self.app.world_mut().entity_mut(self.sun);
        if let Some(mut light) = sun.get_mut::<DirectionalLight>() {
            light.shadow_maps_enabled = has_shadows;
        }
    }

    /// Medians of whole frames and of the main thread's part, in milliseconds.
    fn time(&mut self, frames: usize) -> [f64; 2] {
        let mut times = [Vec::new(), Vec::new()];
        for frame in 0..frames + 3 {
            // Batches and culling of a camera that turns a little.
            if let Some(mut place) = self.app.world_mut().get_mut::<Transform>(self.camera) {
                place.rotate_y(if frame % 2 == 0 { 0.002 } else { -0.002 });
            }
            let start = Instant::now();
            self.app.update();
            let app = start.elapsed();
            let drawn = self.app.world().resource::<RenderDevice>().poll(PollType::wait_indefinitely());
            assert!(drawn.is_ok(), "the frame is never done: {drawn:?}");
            if frame >= 3 {
                times[0].push(start.elapsed());
                times[1].push(app);
            }
        }
        times.map(|mut times| {
            times.sort_unstable();
            times[times.len() / 2].as_secs_f64() * 1e3
        })
    }

    /// Looks at the sky, with nothing in sight.
    fn turn_away(&mut self) -> Option<Transform> {
        let mut place = self.app.world_mut().get_mut::<Transform>(self.camera)?;
        let before = *place;
        *place = place.looking_to(Vec3::Y, Vec3::X);
        Some(before)
    }
}

fn main() {
    let given: Vec<u32> = std::env::args().skip(1).filter_map(|arg| arg.parse().ok()).collect();
    let [width, height, frames] =
        [(0, 2560), (1, 1440), (2, 60)].map(|(at, default)| given.get(at).copied().unwrap_or(default).max(1));
    if is_asked("dig") {
        digs();
        return;
    }
    let (frames, share) = (frames as usize, if is_asked("small") { 0.1 } else { 1.0 });
    let mut view = View::new((width, height));
    println!(
        "| shadows | view | blades | trees | frame ms | app ms | times the view without plants, less an empty frame |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    let (mut empty, mut bare) = ([[0.0; 2]; 2], [[0.0; 2]; 2]);
    for (index, has_shadows) in [false, true].into_iter().enumerate() {
        view.set_shadows(has_shadows);
        bare[index] = view.time(frames);
        let before = view.turn_away();
        empty[index] = view.time(frames);
        if let (Some(before), Some(mut place)) =
            (before, view.app.world_mut().get_mut::<Transform>(view.camera))
        {
            *place = before;
        }
        for (name, [frame, app], times) in [("empty", empty[index], ""), ("no plants", bare[index], "1")] {
            println!("| {has_shadows} | {name} | 0 | 0 | {frame:.2} | {app:.2} | {times} |");
        }
    }
    for distance in DISTANCES {
        let counts = view.plant(rules(distance, share));
        for (index, has_shadows) in [false, true].into_iter().enumerate() {
            view.set_shadows(has_shadows);
            let [frame, app] = view.time(frames);
            let times = (frame - empty[index][0]) / (bare[index][0] - empty[index][0]).max(1e-3);
            let (blades, trees) = (counts["grass"] * plant_meshes::BLADES as usize, counts["fir"]);
            println!(
                "| {has_shadows} | {distance} | {blades} | {trees} | {frame:.2} | {app:.2} | {times:.2} |"
            );
        }
    }
    if is_asked("entities") {
        view.plant_entities();
        for has_shadows in [false, true] {
            view.set_shadows(has_shadows);
            let [frame, app] = view.time(frames.min(10));
            println!("| {has_shadows} | an entity for each plant | | | {frame:.2} | {app:.2} | |");
        }
    }
}

/// What plants add to a dig: to its transaction nothing, to its commit the check of the plants around it.
fn digs() {
    use bevy_burrow::scatter::{PatchPos, PlantPatches};
    let scatter = std::sync::Arc::new(Scatter::new(&rules(1.0, 1.0)).expect("valid rules"));
    let mut terrain = Terrain::new(ground(), &TerrainSettings::default()).expect("valid settings");
    let mut patches = PlantPatches::new(std::sync::Arc::clone(&scatter));
    let start = Instant::now();
    let mut count = 0;
    for species in 0..2 {
        let size = scatter.patch_size(species);
        for (x, z) in (0..512 / size).flat_map(|x| (0..512 / size).map(move |z| (x, z))) {
            let pos = PatchPos { species, x, z };
            let plants = scatter.patch(terrain.world().ground(), pos);
            count += plants.len();
            patches.insert(terrain.world(), pos, plants);
        }
    }
    let made = start.elapsed();
    println!("{count} plants of a quarter of a square kilometre in {made:?}");
    let (mut digging, mut plants, mut gone) = (Duration::ZERO, Duration::ZERO, 0);
    const DIGS: u32 = 2000;
    for dig in 0..DIGS {
        let (x, z) = ((dig * 37 % 470 + 20) as f32, (dig * 91 % 470 + 20) as f32);
        let y = terrain.world().height(x.into(), z.into()).expect("inside") as f32;
        let start = Instant::now();
        let receipts = terrain.apply([Brush::dig(Shape::sphere(Vec3::new(x, y, z), 4.0))]);
        digging += start.elapsed();
        let Some(bounds) = receipts[0].outcome.as_ref().ok().and_then(|applied| applied.bounds) else {
            continue;
        };
        let start = Instant::now();
        gone += patches.update(terrain.world(), Some(bounds)).len();
        plants += start.elapsed();
    }
    let each = |all: Duration| all.as_secs_f64() * 1e6 / f64::from(DIGS);
    println!(
        "a dig of radius 4: {:.1} us of transaction and commit, {:.1} us of plants: {:.2} times; {gone} plants went",
        each(digging),
        each(plants),
        1.0 + each(plants) / each(digging)
    );
}
