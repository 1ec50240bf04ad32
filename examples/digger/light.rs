//! Eyes and light: the camera, the sun and its shadows, haze, the dark of caves and the headlamp.

use bevy::anti_alias::smaa::Smaa;
use bevy::camera::ShadowLodOrigin;
use bevy::core_pipeline::{prepass::DepthPrepass, tonemapping::Tonemapping};
use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap, light_consts::lux};
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy_burrow::prelude::*;

use crate::sky::HAZE;

/// The way to the sun, of length 1: from the south-west, on a late afternoon.
pub const SUN: Vec3 = Vec3::new(-0.58, 0.64, 0.504);

/// Brightness of the sky's light on everything, out of doors and deep in a cave.
const SKYLIGHT: (f32, f32) = (1250.0, 30.0);
/// Luminous power of the headlamp in lumens, as a game needs it and not as a shop sells it.
const LAMP: f32 = 18_000_000.0;
/// Metres to the far end of what is seen.
const FAR: f32 = 3000.0;

/// The camera that looks through the player's eyes.
#[derive(Component)]
pub struct Eyes;

/// The lamp on the player's forehead; a child of [`Eyes`].
#[derive(Component)]
pub struct Headlamp;

/// Is the headlamp on?
#[derive(Resource, Default)]
pub struct LampSwitch(pub bool);

/// The camera, the sun, and what they need.
pub struct LightPlugin;

impl Plugin for LightPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(ClearColor(haze()))
            .insert_resource(DirectionalLightShadowMap { size: 2048 })
            .insert_resource(GlobalAmbientLight {
                color: Color::srgb(0.78, 0.88, 1.0),
                brightness: SKYLIGHT.0,
                ..default()
            })
            .init_resource::<LampSwitch>()
            .add_systems(Startup, (open_eyes, let_there_be_sun))
            .add_systems(Update, (switch_lamp, darken_caves));
    }
}

fn haze() -> Color {
    Color::linear_rgb(HAZE.x, HAZE.y, HAZE.z)
}

/// Is there no graphics card, so that the processor draws? (Bevy does not re-export the type that tells.)
fn draws_in_software(adapter: &RenderAdapterInfo) -> bool {
    format!("{:?}", adapter.device_type) == "Cpu"
}

fn open_eyes(mut commands: Commands, adapter: Option<Res<RenderAdapterInfo>>) {
    let fog = DistanceFog {
        color: haze(),
        directional_light_color: Color::linear_rgba(1.0, 0.82, 0.58, 0.35),
        directional_light_exponent: 12.0,
        falloff: FogFalloff::from_visibility_squared(2100.0),
    };
    let lamp = SpotLight {
        color: Color::srgb(1.0, 0.93, 0.80),
        intensity: 0.0,
        range: 70.0,
        radius: 0.05,
        inner_angle: 0.15,
        outer_angle: 1.0,
        shadow_maps_enabled: true,
        ..default()
    };
    // Four samples for each pixel cost a software renderer three times the time of one.
    let msaa =
        if adapter.is_some_and(|adapter| draws_in_software(&adapter)) { Msaa::Off } else { Msaa::Sample4 };
    let mut eyes = commands.spawn((
        Name::new("eyes"),
        Eyes,
        Camera3d::default(),
        ShadowLodOrigin,
        Projection::Perspective(PerspectiveProjection {
            fov: 70f32.to_radians(),
            near: 0.08,
            far: FAR,
            ..default()
        }),
        Transform::from_xyz(0.0, 400.0, 0.0),
        Tonemapping::TonyMcMapface,
        msaa,
        // Ridge lies behind ridge: only what is seen in the end is shaded.
        DepthPrepass,
        fog,
        // A little to the side of the eyes, so that its shadows are seen.
        children![(Headlamp, lamp, Transform::from_xyz(0.25, 0.12, 0.0))],
    ));
    if msaa == Msaa::Off {
        eyes.insert(Smaa::default());
    }
}

fn let_there_be_sun(mut commands: Commands) {
    commands.spawn((
        Name::new("sun"),
        DirectionalLight {
            color: Color::srgb(1.0, 0.94, 0.84),
            illuminance: lux::AMBIENT_DAYLIGHT * 1.05,
            shadow_maps_enabled: true,
            ..default()
        },
        Transform::IDENTITY.looking_to(-SUN, Vec3::Y),
        CascadeShadowConfigBuilder {
            num_cascades: 4,
            minimum_distance: 0.1,
            first_cascade_far_bound: 25.0,
            maximum_distance: 900.0,
            ..default()
        }
        .build(),
    ));
}

fn switch_lamp(switch: Res<LampSwitch>, mut lamps: Query<&mut SpotLight, With<Headlamp>>) {
    if switch.is_changed() {
        for mut lamp in &mut lamps {
            lamp.intensity = if switch.0 { LAMP } else { 0.0 };
        }
    }
}

/// The sky's light reaches into a cave as far as the sky is seen from there: looks up from points around the eyes, and
/// lets the eyes get used to what it finds.
fn darken_caves(
    time: Res<Time>,
    terrains: Terrains,
    eyes: Query<&GlobalTransform, With<Eyes>>,
    mut skylight: ResMut<GlobalAmbientLight>,
) {
    let Ok(eyes) = eyes.single() else { return };
    let places = (-1..=1).flat_map(|x| (-1..=1).map(move |z| Vec3::new(x as f32, 0.0, z as f32) * 3.0));
    let is_open = |place: Vec3| {
        let spans = terrains.spans(place.x, place.z);
        let air = spans.iter().find(|span| span.ceiling.is_none_or(|top| f64::from(place.y) < top));
        air.is_none_or(|span| span.ceiling.is_none())
    };
    let open = places.filter(|&offset| is_open(eyes.translation() + offset)).count() as f32 / 9.0;
    let (day, dark) = SKYLIGHT;
    let brightness = dark + (day - dark) * open * open;
    skylight.brightness += (brightness - skylight.brightness) * (1.0 - (-4.0 * time.delta_secs()).exp());
}
