//! Landscape, sun and camera.

#[path = "../shared/flight.rs"]
mod flight;
#[path = "../shared/software.rs"]
mod software;

use bevy::camera_controller::free_camera::{FreeCamera, FreeCameraPlugin};
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy_burrow::prelude::*;
use software::draws_in_software;

const SKY: Color = Color::srgb(0.62, 0.74, 0.88);

/// A square level; the number is the cells along each side.
#[derive(Resource, Clone, Copy)]
pub struct ScenePlugin(pub u32);

impl ScenePlugin {
    /// The centre of the level and of the script's edits, at which the camera looks at first.
    pub fn middle(self) -> Vec3 {
        Vec3::new(0.5, 0.0, 0.5) * self.0 as f32
    }
}

impl Plugin for ScenePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(FreeCameraPlugin)
            .insert_resource(*self)
            .insert_resource(ClearColor(SKY))
            .insert_resource(GlobalAmbientLight { brightness: 900.0, ..default() })
            .add_systems(Startup, (landscape, sun_and_camera));
    }
}

fn landscape(
    mut commands: Commands,
    scene: Res<ScenePlugin>,
    adapter: Option<Res<RenderAdapterInfo>>,
) -> Result {
    let is_plain = draws_in_software(adapter.as_deref());
    let noise = NoiseHeights {
        seed: 4,
        kind: NoiseKind::Fractal,
        octaves: 5,
        scale: 150.0,
        amplitude: 34.0,
        base: 0.0,
    };
    let grass = MaterialRule { overlay: MaterialId(1), slope: (0.0, 0.7), slope_fade: 0.35, ..default() };
    let rules = MaterialControl::Rules { base: MaterialId(0), rules: vec![grass] };
    let ground = Ground::from_noise(scene.0, scene.0, &noise)?.with_materials(&rules)?;
    let terrain = Terrain::new(ground, &TerrainSettings::default())?;
    let quality = if is_plain { GroundQuality::Low } else { GroundQuality::High };
    let look = GroundLook { quality, ..default() };
    commands.spawn((Name::new("Hills"), terrain, look));
    Ok(())
}

fn sun_and_camera(mut commands: Commands, scene: Res<ScenePlugin>, adapter: Option<Res<RenderAdapterInfo>>) {
    let middle = scene.middle();
    let is_plain = draws_in_software(adapter.as_deref());
    commands.spawn((
        DirectionalLight { illuminance: 9_000.0, shadow_maps_enabled: !is_plain, ..default() },
        CascadeShadowConfigBuilder { maximum_distance: 260.0, first_cascade_far_bound: 40.0, ..default() }
            .build(),
        Transform::from_xyz(-0.6, 0.7, 0.45).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Tonemapping::AcesFitted,
        Msaa::Off,
        // It hides nothing of the level from wherever all of it is in view.
        DistanceFog { color: SKY, falloff: FogFalloff::Linear { start: 500.0, end: 1600.0 }, ..default() },
        // The mouse wheel changes the brush size.
        FreeCamera { scroll_factor: 0.0, ..flight::free_camera(24.0, 80.0) },
        // All of the level is in view.
        Transform::from_translation(middle + Vec3::new(-70.0, 150.0, 190.0)).looking_at(middle, Vec3::Y),
    ));
}
