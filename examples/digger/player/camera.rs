//! The player's camera: it follows the character's eyes, shakes, and is set up as the settings say.

#[path = "../../shared/software.rs"]
mod software;

use bevy::anti_alias::smaa::Smaa;
use bevy::camera::{Hdr, ShadowLodOrigin};
use bevy::core_pipeline::{prepass::DepthPrepass, tonemapping::Tonemapping};
use bevy::light::{CascadeShadowConfig, CascadeShadowConfigBuilder, DirectionalLightShadowMap};
use bevy::pbr::AtmosphereSettings;
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy::render::renderer::{RenderAdapter, RenderAdapterInfo, RenderDevice};
use bevy_burrow::prelude::*;
use software::draws_in_software;

use crate::player::Player;
use crate::player::body::Body;
use crate::player::headlamp;
use crate::ui::settings::{DefaultSettings, Quality, Settings, SettingsFile};
use crate::world::air;
use crate::world::light::Sun;

/// The camera that looks through the player's eyes.
#[derive(Component)]
pub struct PlayerCamera;

/// The camera does not follow the player while it has this: the title or a film moves it.
#[derive(Component)]
pub struct DetachedCamera;

/// The camera's far plane, as a multiple of the view distance. Fog hides 95 % of what is at the view distance, and more
/// than 99 % here, so that ground does not end in a line.
const FAR: f32 = 1.3;

/// How hard the camera shakes from blows and explosions.
#[derive(Resource, Clone, Copy, Debug, Default)]
pub struct CameraShake(f32);

impl CameraShake {
    /// Shakes harder.
    pub fn add(&mut self, by: f32) {
        self.0 = (self.0 + by).min(1.2);
    }
}

/// Spawns the camera, moves it and applies the graphics settings.
pub struct CameraPlugin;

impl Plugin for CameraPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<CameraShake>()
            .add_systems(Startup, (spawn_camera, prefer_low_quality_in_software))
            .add_systems(
                Update,
                (
                    apply_settings.run_if(resource_exists_and_changed::<Settings>),
                    follow_player.after(BurrowSystems::Commit),
                ),
            );
    }
}

fn spawn_camera(mut commands: Commands) {
    commands.spawn((
        Name::new("player camera"),
        PlayerCamera,
        IsDefaultUiCamera,
        Camera3d::default(),
        ShadowLodOrigin,
        Projection::Perspective(PerspectiveProjection { near: 0.06, ..default() }),
        Transform::from_xyz(0.0, 400.0, 0.0),
        Tonemapping::TonyMcMapface,
        // Ridges hide ridges: with a depth prepass only visible ground is shaded.
        DepthPrepass,
        DistanceFog { directional_light_exponent: 12.0, ..default() },
        headlamp::lights(),
    ));
}

/// Without a GPU, the game starts with low quality, and scripts are played in it.
fn prefer_low_quality_in_software(
    adapter: Option<Res<RenderAdapterInfo>>,
    file: Res<SettingsFile>,
    mut defaults: ResMut<DefaultSettings>,
    mut settings: ResMut<Settings>,
) {
    if !draws_in_software(adapter.as_deref()) {
        return;
    }
    defaults.0.quality = Quality::Low;
    if file.0.as_ref().is_none_or(|file| !file.exists()) {
        settings.quality = Quality::Low;
    }
}

/// How the camera lags behind the character's feet on steps.
#[derive(Default)]
pub struct StepSmoothing {
    lag: f32,
    last_feet: Option<f32>,
}

/// Puts the camera at the player's eyes.
pub fn follow_player(
    time: Res<Time>,
    mut shake: ResMut<CameraShake>,
    players: Query<(&Player, Body)>,
    mut cameras: Query<&mut Transform, (With<PlayerCamera>, Without<DetachedCamera>, Without<Player>)>,
    mut smoothing: Local<StepSmoothing>,
) {
    shake.0 *= (-6.5 * time.delta_secs()).exp();
    let Ok((player, body)) = players.single() else { return };
    // The camera follows steps smoothly. It does not lag behind jumps or poke through ceilings.
    let feet = body.feet().y;
    let step = feet - smoothing.last_feet.replace(feet).unwrap_or(feet);
    let lag = if step.abs() > 1.0 || !body.motion.grounded { 0.0 } else { smoothing.lag + step };
    smoothing.lag = (lag * (-14.0 * time.delta_secs()).exp()).clamp(-0.05, 0.6);
    // Three sines of different frequencies look random.
    let (t, strength) = (time.elapsed_secs(), 0.022 * shake.0 * shake.0.max(0.35));
    let offset = Vec3::new((t * 61.0).sin(), (t * 47.0 + 1.0).sin(), (t * 39.0 + 2.0).sin()) * strength;
    for mut camera in &mut cameras {
        camera.translation = body.eye() - Vec3::Y * smoothing.lag;
        camera.rotation = player.rotation() * Quat::from_euler(EulerRot::YXZ, offset.x, offset.y, offset.z);
    }
}

/// The levels of detail for these settings.
fn levels(settings: &Settings) -> LevelsOfDetail {
    let defaults = LevelsOfDetail::default();
    let coarseness = match settings.quality {
        Quality::Low => 2.0,
        Quality::Medium => 1.0,
        Quality::High => 0.7,
    };
    LevelsOfDetail {
        view_distance: settings.view_distance,
        cell_pixels: coarseness * defaults.cell_pixels,
        error_pixels: coarseness * defaults.error_pixels,
        edited_pixels: coarseness * defaults.edited_pixels,
        ..defaults
    }
}

/// Applies the field of view, the view distance and the quality.
fn apply_settings(
    mut commands: Commands,
    settings: Res<Settings>,
    adapter: Option<Res<RenderAdapterInfo>>,
    device: (Option<Res<RenderAdapter>>, Option<Res<RenderDevice>>),
    mut camera: Single<(Entity, &mut Projection), With<PlayerCamera>>,
    sun: Single<Entity, With<Sun>>,
    mut terrains: Query<(&mut GroundLook, &mut LevelsOfDetail)>,
) {
    let (entity, projection) = &mut *camera;
    if let Projection::Perspective(lens) = &mut **projection {
        lens.fov = settings.field_of_view.to_radians();
        lens.far = FAR * settings.view_distance;
    }
    let (size, num_cascades, first_cascade_far_bound, maximum_distance) = match settings.quality {
        Quality::Low => (1024, 2, 20.0, 200.0),
        Quality::Medium => (2048, 4, 25.0, 900.0),
        Quality::High => (4096, 4, 30.0, 1200.0),
    };
    let levels = levels(&settings);
    commands.insert_resource(DirectionalLightShadowMap { size });
    let cascades = CascadeShadowConfigBuilder {
        num_cascades,
        minimum_distance: 0.1,
        first_cascade_far_bound,
        maximum_distance,
        ..default()
    };
    commands.entity(*sun).insert(CascadeShadowConfig::from(cascades));
    let is_cheap = settings.quality == Quality::Low || draws_in_software(adapter.as_deref());
    for (mut look, mut shown) in &mut terrains {
        shown.set_if_neq(levels.clone());
        // The high quality reads some fifty texels per pixel: fast on a GPU, but seconds per frame without
        // one.
        look.quality = if is_cheap { GroundQuality::Low } else { GroundQuality::High };
    }
    let mut camera = commands.entity(*entity);
    // In software, four samples per pixel take three times as long as one.
    if is_cheap {
        camera.insert((Msaa::Off, Smaa::default()));
    } else {
        camera.insert(Msaa::Sample4).remove::<Smaa>();
    }
    if settings.quality == Quality::High {
        camera.insert(Bloom { intensity: 0.12, ..Bloom::NATURAL });
    } else {
        camera.remove::<Bloom>();
    }
    // Mesa's software renderer fails in Bevy's atmosphere.
    let has_air = settings.quality != Quality::Low
        && !draws_in_software(adapter.as_deref())
        && air::is_possible(device.0.as_deref(), device.1.as_deref());
    if has_air {
        let reach = FAR * settings.view_distance;
        let air = AtmosphereSettings { aerial_view_lut_max_distance: reach, ..default() };
        camera.insert((Hdr, air)).remove::<DistanceFog>();
    } else {
        let falloff = FogFalloff::from_visibility_squared(settings.view_distance);
        let fog = DistanceFog { falloff, directional_light_exponent: 12.0, ..default() };
        camera.insert(fog).remove::<AtmosphereSettings>();
        if settings.quality != Quality::High {
            camera.remove::<Hdr>();
        }
    }
}
