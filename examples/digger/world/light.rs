//! Eyes and light: the camera, the sun and its shadows, the dark of caves and the headlamp.

#[path = "../../shared/software.rs"]
mod software;

use bevy::anti_alias::smaa::Smaa;
use bevy::camera::{Hdr, ShadowLodOrigin};
use bevy::core_pipeline::{prepass::DepthPrepass, tonemapping::Tonemapping};
use bevy::light::{CascadeShadowConfig, CascadeShadowConfigBuilder, DirectionalLightShadowMap};
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy::render::renderer::RenderAdapterInfo;
use bevy_burrow::prelude::*;
use software::draws_in_software;

use crate::player::Playing;
use crate::player::game_state::Phase;
use crate::player::input::{Action, Actions};
use crate::ui::settings::{AsMade, Quality, Settings, SettingsFile};
use crate::world::landscape::NewGame;

/// The way to the sun on a late afternoon, of length 1: from the south-west.
pub const SUN: Vec3 = Vec3::new(-0.58, 0.64, 0.504);

/// Luminous power of the headlamp's beam in lumens, as a game needs it and not as a shop sells it.
const BEAM: f32 = 12_000_000.0;
/// The same of the wide light around the beam: one light for both would burn what is near or not reach what is far.
const FLOOD: f32 = 2_400_000.0;
/// The same of the little light that shows the player's own hands then.
const HANDS: f32 = 9_000.0;
/// Metres from which on both have their whole power; nearer by, the player dims them.
const FULL: f32 = 13.0;
/// Brightness of the sky's light deep in a cave.
const DARK: f32 = 30.0;

/// The camera that looks through the player's eyes.
#[derive(Component)]
pub struct Eyes;

/// What lights the land: the sun, or by night the moon.
#[derive(Component)]
pub struct Sun;

/// A lamp on the player's forehead, and how bright it is; a child of [`Eyes`].
#[derive(Component)]
pub struct Headlamp(f32);

/// Is the headlamp on?
#[derive(Resource, Default)]
pub struct LampSwitch(pub bool);

/// The sky's light out of doors.
#[derive(Resource, Clone, Copy, Debug)]
pub struct Skylight {
    pub color: Color,
    pub brightness: f32,
}

/// The camera, the sun, and what they need.
pub struct LightPlugin;

impl Plugin for LightPlugin {
    fn build(&self, app: &mut App) {
        app.insert_resource(Skylight { color: Color::WHITE, brightness: 1000.0 })
            .insert_resource(GlobalAmbientLight { brightness: 1000.0, ..default() })
            .init_resource::<LampSwitch>()
            .add_observer(put_out)
            .add_systems(Startup, (open_eyes, let_there_be_sun, spare_software))
            .add_systems(
                Update,
                (
                    apply_settings.run_if(resource_exists_and_changed::<Settings>),
                    press_switch.in_set(Playing).run_if(in_state(Phase::Playing)),
                    (switch_lamps, dim_lamps, darken_caves).chain(),
                )
                    .chain(),
            );
    }
}

/// Without a graphics card a player begins with low quality.
fn spare_software(
    adapter: Option<Res<RenderAdapterInfo>>,
    file: Res<SettingsFile>,
    mut made: ResMut<AsMade>,
    mut settings: ResMut<Settings>,
) {
    if !draws_in_software(adapter.as_deref()) {
        return;
    }
    made.0.quality = Quality::Low;
    if file.0.as_ref().is_some_and(|file| !file.exists()) {
        settings.quality = made.0.quality;
    }
}

fn open_eyes(mut commands: Commands) {
    let beam = SpotLight {
        color: Color::srgb(1.0, 0.93, 0.80),
        intensity: 0.0,
        range: 70.0,
        radius: 0.05,
        inner_angle: 0.05,
        outer_angle: 0.8,
        shadow_maps_enabled: true,
        ..default()
    };
    // What it shines on is what the eyes see: it needs no shadows.
    let flood =
        SpotLight { range: 24.0, inner_angle: 0.3, outer_angle: 1.3, shadow_maps_enabled: false, ..beam };
    let hands = PointLight { color: beam.color, intensity: 0.0, range: 1.6, ..default() };
    commands.spawn((
        Name::new("eyes"),
        Eyes,
        IsDefaultUiCamera,
        Camera3d::default(),
        ShadowLodOrigin,
        Projection::Perspective(PerspectiveProjection { near: 0.06, ..default() }),
        Transform::from_xyz(0.0, 400.0, 0.0),
        Tonemapping::TonyMcMapface,
        // Ridge lies behind ridge: only what is seen in the end is shaded.
        DepthPrepass,
        DistanceFog { directional_light_exponent: 12.0, ..default() },
        children![
            // A little to the side of the eyes, so that its shadows are seen, and before the hands, which it would burn.
            (Headlamp(BEAM), beam, Transform::from_xyz(0.22, 0.12, -0.34)),
            (Headlamp(FLOOD), flood, Transform::from_xyz(0.22, 0.12, -0.34)),
            (Headlamp(HANDS), hands, Transform::from_xyz(-0.05, 0.16, -0.12)),
        ],
    ));
}

fn let_there_be_sun(mut commands: Commands) {
    let light = DirectionalLight { shadow_maps_enabled: true, ..default() };
    commands.spawn((Name::new("sun"), Sun, light, Transform::IDENTITY.looking_to(-SUN, Vec3::Y)));
}

/// Field of view, distances and quality.
fn apply_settings(
    mut commands: Commands,
    settings: Res<Settings>,
    adapter: Option<Res<RenderAdapterInfo>>,
    mut eyes: Single<(Entity, &mut Projection, &mut DistanceFog), With<Eyes>>,
    sun: Single<Entity, With<Sun>>,
    mut looks: Query<&mut GroundLook>,
) {
    let (entity, projection, fog) = &mut *eyes;
    if let Projection::Perspective(lens) = &mut **projection {
        lens.fov = settings.field_of_view.to_radians();
        lens.far = settings.view_distance;
    }
    fog.falloff = FogFalloff::from_visibility_squared(0.7 * settings.view_distance);
    let (map, cascades, first, last) = match settings.quality {
        Quality::Low => (1024, 2, 20.0, 200.0),
        Quality::Medium => (2048, 4, 25.0, 900.0),
        Quality::High => (4096, 4, 30.0, 1200.0),
    };
    commands.insert_resource(DirectionalLightShadowMap { size: map });
    let shadows: CascadeShadowConfig = CascadeShadowConfigBuilder {
        num_cascades: cascades,
        minimum_distance: 0.1,
        first_cascade_far_bound: first,
        maximum_distance: last,
        ..default()
    }
    .build();
    commands.entity(*sun).insert(shadows);
    let mut eyes = commands.entity(*entity);
    let is_low = settings.quality == Quality::Low;
    let in_software = draws_in_software(adapter.as_deref());
    for mut look in &mut looks {
        // Some fifty texels for each pixel are nothing to a card, and seconds to a processor.
        look.quality = if is_low || in_software { GroundQuality::Low } else { GroundQuality::High };
    }
    // Four samples for each pixel cost a software renderer three times the time of one.
    if in_software || is_low {
        eyes.insert((Msaa::Off, Smaa::default()));
    } else {
        eyes.insert(Msaa::Sample4).remove::<Smaa>();
    }
    if settings.quality == Quality::High {
        eyes.insert((Hdr, Bloom { intensity: 0.12, ..Bloom::NATURAL }));
    } else {
        eyes.remove::<(Hdr, Bloom)>();
    }
}

fn press_switch(actions: Res<Actions>, mut switch: ResMut<LampSwitch>) {
    if actions.just_pressed(Action::Headlamp) {
        switch.0 = !switch.0;
    }
}

fn put_out(_: On<NewGame>, mut switch: ResMut<LampSwitch>) {
    switch.0 = false;
}

fn switch_lamps(
    switch: Res<LampSwitch>,
    mut spots: Query<&mut SpotLight, With<Headlamp>>,
    mut points: Query<(&Headlamp, &mut PointLight)>,
) {
    if switch.is_changed() {
        // They come up by and by.
        for mut light in &mut spots {
            light.intensity = 0.0;
        }
        for (lamp, mut light) in &mut points {
            light.intensity = if switch.0 { lamp.0 } else { 0.0 };
        }
    }
}

/// The headlamp is as strong as what it falls on is far: rock before the player's nose is seen, and not burnt.
fn dim_lamps(
    time: Res<Time>,
    switch: Res<LampSwitch>,
    terrains: Terrains,
    eyes: Single<&GlobalTransform, With<Eyes>>,
    mut lamps: Query<(&Headlamp, &mut SpotLight)>,
) {
    if !switch.0 {
        return;
    }
    // Ahead, and around the beam's rim.
    let ways = [(0.0, 0.0), (0.25, 0.0), (-0.25, 0.0), (0.0, 0.25), (0.0, -0.25)]
        .map(|(right, up)| eyes.rotation() * Vec3::new(right, up, -1.0));
    let far = |way: Vec3| {
        let ray = Ray3d::new(eyes.translation(), Dir3::new(way).unwrap_or(Dir3::NEG_Z));
        terrains.raycast(ray, FULL).map_or(FULL, |hit| hit.distance.max(0.5))
    };
    let metres = (ways.map(|way| far(way).ln()).iter().sum::<f32>() / ways.len() as f32).exp();
    let share = (metres / FULL).powf(1.6);
    for (lamp, mut light) in &mut lamps {
        light.intensity += (share * lamp.0 - light.intensity) * (1.0 - (-8.0 * time.delta_secs()).exp());
    }
}

/// The sky's light reaches into a cave as far as the sky is seen from there: looks up from points around the eyes, and
/// lets the eyes get used to what it finds, even while time stands still: the title may lie under another sky.
fn darken_caves(
    time: Res<Time<Real>>,
    terrains: Terrains,
    eyes: Single<&GlobalTransform, With<Eyes>>,
    skylight: Res<Skylight>,
    mut ambient: ResMut<GlobalAmbientLight>,
) {
    let places = (-1..=1).flat_map(|x| (-1..=1).map(move |z| Vec3::new(x as f32, 0.0, z as f32) * 3.0));
    let is_open = |place: Vec3| {
        let spans = terrains.spans(place.x, place.z);
        let air = spans.iter().find(|span| span.ceiling.is_none_or(|top| f64::from(place.y) < top));
        air.is_none_or(|span| span.ceiling.is_none())
    };
    let open = places.filter(|&offset| is_open(eyes.translation() + offset)).count() as f32 / 9.0;
    let dark = DARK.min(skylight.brightness);
    let brightness = dark + (skylight.brightness - dark) * open * open;
    ambient.color = skylight.color;
    ambient.brightness += (brightness - ambient.brightness) * (1.0 - (-4.0 * time.delta_secs()).exp());
}
