//! A windowless app that takes pictures of terrains.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bevy::camera::RenderTarget;
use bevy::ecs::component::Mutable;
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap};
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy::shader::Shader;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::prelude::*;
use image::RgbImage;

use crate::capture::capture;
use crate::{offscreen, shaders};

/// Width and height of pictures.
pub const SIZE: (u32, u32) = (480, 270);

/// The longest wait for any event.
pub const TIMEOUT: Duration = Duration::from_secs(120);

/// Only one studio runs at a time: a software renderer uses all cores.
static OPEN: Mutex<()> = Mutex::new(());

/// A windowless app with a camera, a sun, some haze, and the terrains of the scenes.
pub struct Studio {
    pub app: App,
    pub camera: Entity,
    sun: Entity,
    film: Handle<Image>,
    /// A shader in place of the ground's own one.
    shader: Option<Handle<Shader>>,
    _only: MutexGuard<'static, ()>,
}

impl Studio {
    /// Opens a studio with `BurrowPlugins` and whatever `add` adds. Without a Vulkan device it prints a notice and
    /// returns
    /// `None`, or panics if `BURROW_REQUIRE` is set.
    pub fn open(add: impl FnOnce(&mut App)) -> Option<Self> {
        let only = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(renderer) = offscreen::find_renderer() else {
            let is_required = std::env::var_os("BURROW_REQUIRE").is_some_and(|value| !value.is_empty());
            assert!(!is_required, "BURROW_REQUIRE is set, but there is no Vulkan device to draw with");
            eprintln!(
                "\n*** SKIPPED: no Vulkan device, so no picture was compared. Install mesa-vulkan-drivers. ***\n"
            );
            return None;
        };
        let mut app = offscreen::build(Some(renderer), |app| {
            app.add_plugins(BurrowPlugins)
                // Small textures are generated quickly; without anisotropy, all machines filter them alike.
                .insert_resource(GroundTextures::Baked { side: 256, anisotropy: 1 })
                .insert_resource(ClearColor(Color::linear_rgb(0.50, 0.66, 0.86)))
                .insert_resource(GlobalAmbientLight {
                    color: Color::srgb(0.78, 0.88, 1.0),
                    brightness: 900.0,
                    ..default()
                })
                .insert_resource(DirectionalLightShadowMap { size: 1024 })
                .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)));
            add(app);
        });
        let image = Image::new_target_texture(SIZE.0, SIZE.1, TextureFormat::Rgba8UnormSrgb, None);
        let film = app.world_mut().resource_mut::<Assets<Image>>().add(image);
        let fog = DistanceFog {
            color: Color::linear_rgb(0.50, 0.66, 0.86),
            falloff: FogFalloff::from_visibility_squared(900.0),
            ..default()
        };
        let world = app.world_mut();
        let camera = world
            .spawn((
                Camera3d::default(),
                RenderTarget::from(film.clone()),
                Msaa::Off,
                fog,
                Transform::default(),
            ))
            .id();
        let sun = world
            .spawn((
                DirectionalLight { illuminance: 10_000.0, shadow_maps_enabled: true, ..default() },
                CascadeShadowConfigBuilder { num_cascades: 2, maximum_distance: 120.0, ..default() }.build(),
            ))
            .id();
        let mut studio = Self { app, camera, sun, film, shader: None, _only: only };
        studio.sun(Vec3::new(1.0, 0.9, 0.4));
        studio.replace_shader();
        Some(studio)
    }

    /// Draws the ground with the shader in the file that `BURROW_SHADER` names, if it does: changes can be tried without a build.
    fn replace_shader(&mut self) {
        let Some(path) = std::env::var_os("BURROW_SHADER") else { return };
        let source = std::fs::read_to_string(path).expect("BURROW_SHADER names a shader");
        let name = "embedded://bevy_burrow/view/ground/ground.wgsl";
        let own = self.app.world().resource::<AssetServer>().load::<Shader>(name);
        self.until("the ground's shader", |app| app.world().resource::<Assets<Shader>>().contains(&own));
        let mut shaders = self.app.world_mut().resource_mut::<Assets<Shader>>();
        shaders.insert(&own, Shader::from_wgsl(source, name)).expect("it is there");
        self.shader = Some(own);
    }

    /// Replaces the terrain by a new one with this look, and waits until it is shown.
    pub fn terrain(&mut self, ground: Ground, look: GroundLook) {
        self.terrain_with(ground, look);
    }

    /// Replaces the terrain by a new one with these components, a look among them, and waits until it is shown.
    pub fn terrain_with(&mut self, ground: Ground, components: impl Bundle) {
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
        self.close_terrain();
        let entity = self.app.world_mut().spawn((terrain, components)).id();
        self.until("the terrain's material", |app| {
            let mut tiles = app
                .world_mut()
                .query_filtered::<&ChildOf, (With<Tile>, With<MeshMaterial3d<GroundMaterial>>)>();
            let loading = app.world().get_resource::<GroundLoading>();
            let are_ready = loading.is_some_and(GroundLoading::is_ready);
            tiles.iter(app.world()).any(|tile| tile.parent() == entity) && are_ready
        });
    }

    /// Changes the size of the pictures.
    pub fn resize(&mut self, size: (u32, u32)) {
        let image = Image::new_target_texture(size.0, size.1, TextureFormat::Rgba8UnormSrgb, None);
        self.film = self.app.world_mut().resource_mut::<Assets<Image>>().add(image);
        self.app.world_mut().entity_mut(self.camera).insert(RenderTarget::from(self.film.clone()));
    }

    /// Despawns the terrain.
    pub fn close_terrain(&mut self) {
        let world = self.app.world_mut();
        let old: Vec<Entity> = world.query_filtered::<Entity, With<Terrain>>().iter(world).collect();
        old.into_iter().for_each(|old| assert!(world.despawn(old)));
    }

    /// Sets the camera's position and target.
    pub fn look(&mut self, from: Vec3, at: Vec3) {
        let place = Transform::from_translation(from).looking_at(at, Vec3::Y);
        self.app.world_mut().entity_mut(self.camera).insert(place);
    }

    /// Replaces the camera by another one with the same place and lens, without fog, and whatever else is given.
    pub fn renew_camera(&mut self, more: impl Bundle) {
        let world = self.app.world_mut();
        let old = world.entity(self.camera);
        let kept = (old.get::<Transform>().copied(), old.get::<Projection>().cloned());
        assert!(world.despawn(self.camera));
        let new = (Camera3d::default(), RenderTarget::from(self.film.clone()));
        let kept = (kept.0.unwrap_or_default(), kept.1.unwrap_or_default());
        self.camera = world.spawn((new, kept)).insert(more).id();
    }

    /// Sets the sun's direction.
    pub fn sun(&mut self, from: Vec3) {
        let place = Transform::from_translation(from).looking_at(Vec3::ZERO, Vec3::Y);
        self.app.world_mut().entity_mut(self.sun).insert(place);
    }

    /// Sets the brightness of the sky, in cd/m2.
    pub fn sky(&mut self, brightness: f32) {
        self.app.world_mut().resource_mut::<GlobalAmbientLight>().brightness = brightness;
    }

    /// The only component of this type.
    pub fn one<C: Component<Mutability = Mutable>>(&mut self) -> Mut<'_, C> {
        let world = self.app.world_mut();
        world.query::<&mut C>().single_mut(world).expect("one of its kind")
    }

    /// The ground's height at (x, z), in metres.
    pub fn height(&mut self, x: f32, z: f32) -> f32 {
        self.one::<Terrain>().world().height(f64::from(x), f64::from(z)).expect("within the world") as f32
    }

    /// Sends brushes and waits until all of them are shown.
    pub fn apply(&mut self, brushes: impl IntoIterator<Item = Brush>) {
        let brushes: Vec<Brush> = brushes.into_iter().collect();
        let answered = self.app.world().resource::<BurrowFigures>().brushes + brushes.len() as u64;
        self.app.world_mut().write_message_batch(brushes);
        self.until("receipts", |app| app.world().resource::<BurrowFigures>().brushes >= answered);
    }

    /// Updates the app until `done` returns true.
    pub fn until(&mut self, what: &str, mut done: impl FnMut(&mut App) -> bool) {
        // The camera is off meanwhile, to save time.
        self.set_camera_active(false);
        let start = Instant::now();
        while !done(&mut self.app) {
            assert!(start.elapsed() < TIMEOUT, "timed out waiting for {what}");
            self.app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
        self.set_camera_active(true);
    }

    /// Takes a picture, after a few frames in which lights and shadows settle.
    pub fn picture(&mut self) -> RgbImage {
        for _ in 0..2 {
            self.app.update();
        }
        // Meshes are not drawn before their shaders are compiled.
        let waiting = Instant::now();
        while shaders::are_missing(&self.app) {
            assert!(waiting.elapsed() < TIMEOUT, "a shader was not compiled in time");
            self.app.update();
        }
        capture(&mut self.app, &self.film, TIMEOUT).expect("a picture")
    }

    fn set_camera_active(&mut self, runs: bool) {
        if let Some(mut camera) = self.app.world_mut().get_mut::<Camera>(self.camera) {
            camera.is_active = runs;
        }
    }
}
