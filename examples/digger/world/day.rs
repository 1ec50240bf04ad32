//! Day and night: the directions of sun and moon, and the colours of sky, fog and light at every hour.

use std::f32::consts::TAU;

use bevy::light::light_consts::lux;
use bevy::prelude::*;

use crate::player::camera::PlayerCamera;
use crate::ui::settings::Settings;
use crate::world::air::Air;
use crate::world::landscape::NewGame;
use crate::world::light::Sun;
use crate::world::sky::SkyMaterial;

/// The hour at which the sun is at [`SUN`](crate::world::light::SUN), where places for the script are searched.
pub const AFTERNOON: f32 = 14.363;
/// Sine and cosine of the angle by which the sun's path tilts to the south.
const TILT: (f32, f32) = (0.6187, 0.7857);

/// By how much the sun's light is weaker than it is in space: cameras keep Bevy's exposure, which suits it indoors.
const EXPOSURE: f32 = 0.11;

/// The time of day.
#[derive(Resource, Clone, Copy, Debug)]
pub struct Clock {
    /// Hours since midnight, below 24.
    pub hour: f32,
    /// Whether the time of day advances.
    pub runs: bool,
}

impl Default for Clock {
    fn default() -> Self {
        Self { hour: AFTERNOON, runs: true }
    }
}

impl Clock {
    /// The time as text.
    pub fn text(&self) -> String {
        let minutes = (self.hour * 60.0) as u32;
        format!("{:02}:{:02}", minutes / 60 % 24, minutes % 60)
    }

    /// The direction to the sun, of length 1.
    pub fn sun(&self) -> Vec3 {
        let angle = (self.hour - 12.0) / 24.0 * TAU;
        Vec3::new(-angle.sin(), TILT.1 * angle.cos(), TILT.0 * angle.cos())
    }

    /// The direction to the moon: opposite the sun, and a little higher.
    pub fn moon(&self) -> Vec3 {
        (-self.sun() + Vec3::new(0.0, 0.25, 0.18)).normalize()
    }
}

/// Linear colours at some hour; 1 is white.
#[derive(Clone, Copy, Debug)]
struct Colors {
    zenith: Vec3,
    horizon: Vec3,
    glow: Vec3,
    /// How much of the glow spreads along the horizon.
    spread: f32,
    cloud_light: Vec3,
    cloud_shade: Vec3,
    /// Colour and brightness of the light from the sky.
    ambient: Vec3,
    brightness: f32,
}

/// The colours by the height of the sun, as the sine of its angle.
#[rustfmt::skip]
const COLORS: [(f32, Colors); 5] = [
    (-0.28, Colors {
        zenith: Vec3::new(0.003, 0.006, 0.017), horizon: Vec3::new(0.012, 0.019, 0.038), glow: Vec3::ZERO,
        spread: 0.0, cloud_light: Vec3::new(0.022, 0.028, 0.045), cloud_shade: Vec3::new(0.006, 0.008, 0.016),
        ambient: Vec3::new(0.45, 0.57, 0.95), brightness: 95.0,
    }),
    (-0.09, Colors {
        zenith: Vec3::new(0.022, 0.040, 0.125), horizon: Vec3::new(0.20, 0.14, 0.19), glow: Vec3::new(0.80, 0.26, 0.10),
        spread: 0.9, cloud_light: Vec3::new(0.34, 0.17, 0.19), cloud_shade: Vec3::new(0.06, 0.06, 0.11),
        ambient: Vec3::new(0.68, 0.62, 0.92), brightness: 260.0,
    }),
    (0.03, Colors {
        zenith: Vec3::new(0.065, 0.13, 0.34), horizon: Vec3::new(0.55, 0.37, 0.30), glow: Vec3::new(1.15, 0.46, 0.14),
        spread: 0.8, cloud_light: Vec3::new(1.10, 0.52, 0.34), cloud_shade: Vec3::new(0.26, 0.21, 0.28),
        ambient: Vec3::new(0.90, 0.78, 0.86), brightness: 620.0,
    }),
    (0.18, Colors {
        zenith: Vec3::new(0.075, 0.19, 0.48), horizon: Vec3::new(0.66, 0.62, 0.60), glow: Vec3::new(1.0, 0.66, 0.34),
        spread: 0.35, cloud_light: Vec3::new(1.22, 1.0, 0.80), cloud_shade: Vec3::new(0.50, 0.50, 0.58),
        ambient: Vec3::new(0.86, 0.86, 0.95), brightness: 1000.0,
    }),
    (0.45, Colors {
        zenith: Vec3::new(0.075, 0.21, 0.56), horizon: Vec3::new(0.56, 0.70, 0.86), glow: Vec3::new(1.0, 0.82, 0.58),
        spread: 0.0, cloud_light: Vec3::new(1.25, 1.20, 1.12), cloud_shade: Vec3::new(0.62, 0.68, 0.78),
        ambient: Vec3::new(0.78, 0.88, 1.0), brightness: 1250.0,
    }),
];

impl Colors {
    /// The colours for a height of the sun.
    fn at(height: f32) -> Self {
        let [first, .., last] = COLORS;
        let pair = COLORS.windows(2).find(|pair| (pair[0].0..pair[1].0).contains(&height));
        let Some(&[(low, a), (high, b)]) = pair.and_then(|pair| pair.first_chunk()) else {
            return if height < first.0 { first.1 } else { last.1 };
        };
        let t = smooth(low, high, height);
        Self {
            zenith: a.zenith.lerp(b.zenith, t),
            horizon: a.horizon.lerp(b.horizon, t),
            glow: a.glow.lerp(b.glow, t),
            spread: a.spread + (b.spread - a.spread) * t,
            cloud_light: a.cloud_light.lerp(b.cloud_light, t),
            cloud_shade: a.cloud_shade.lerp(b.cloud_shade, t),
            ambient: a.ambient.lerp(b.ambient, t),
            brightness: a.brightness + (b.brightness - a.brightness) * t,
        }
    }
}

/// Advances the time of day, and lights and colours the world by it.
pub struct DayPlugin;

impl Plugin for DayPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Clock>()
            .add_observer(reset_clock)
            .add_systems(Update, (tick, update_light, update_colors).chain());
    }
}

/// Every game begins in the afternoon.
fn reset_clock(_: On<NewGame>, mut clock: ResMut<Clock>) {
    clock.hour = AFTERNOON;
}

pub fn tick(time: Res<Time>, settings: Res<Settings>, mut clock: ResMut<Clock>) {
    if clock.runs && settings.day_minutes > 0.0 {
        clock.hour = (clock.hour + time.delta_secs() / (settings.day_minutes * 60.0) * 24.0).rem_euclid(24.0);
    }
}

/// One light serves for both: the sun until it has set, then the moon. It is dark when it changes over.
fn update_light(
    clock: Res<Clock>,
    air: Res<Air>,
    mut sun: Single<(&mut DirectionalLight, &mut Transform), With<Sun>>,
) {
    let (light, place) = &mut *sun;
    let (sun_direction, moon) = (clock.sun(), clock.moon());
    let (direction, color, illuminance) = if sun_direction.y > -0.07 && *air == Air::Atmosphere {
        // The air itself makes it red and weak when it is low.
        (sun_direction, Vec3::ONE, lux::RAW_SUNLIGHT * EXPOSURE * smooth(-0.07, 0.0, sun_direction.y))
    } else if sun_direction.y > -0.07 {
        let warmth = smooth(0.0, 0.32, sun_direction.y);
        let color = Vec3::new(1.0, 0.50, 0.22).lerp(Vec3::new(1.0, 0.87, 0.67), warmth);
        (sun_direction, color, lux::AMBIENT_DAYLIGHT * 1.05 * smooth(-0.05, 0.22, sun_direction.y))
    } else {
        (
            moon,
            Vec3::new(0.50, 0.64, 1.0),
            620.0 * smooth(0.07, 0.30, -sun_direction.y) * smooth(0.0, 0.2, moon.y),
        )
    };
    light.color = Color::linear_rgb(color.x, color.y, color.z);
    light.illuminance = illuminance;
    place.look_to(-direction, Vec3::Y);
}

fn update_colors(
    clock: Res<Clock>,
    time: Res<Time>,
    mut skylight: ResMut<GlobalAmbientLight>,
    mut skies: ResMut<Assets<SkyMaterial>>,
    air: Res<Air>,
    mut fogs: Query<&mut DistanceFog, With<PlayerCamera>>,
    mut clear: ResMut<ClearColor>,
) {
    let (sun, moon) = (clock.sun(), clock.moon());
    let colors = Colors::at(sun.y);
    let linear = |c: Vec3| Color::linear_rgb(c.x, c.y, c.z);
    (skylight.color, skylight.brightness) = (linear(colors.ambient), colors.brightness);
    clear.0 = linear(colors.horizon);
    for mut fog in &mut fogs {
        fog.color = linear(colors.horizon);
        fog.directional_light_color = linear(colors.glow).with_alpha(0.35 + 0.3 * colors.spread);
    }
    let drift = time.elapsed_secs() * 0.006;
    for (_, sky) in skies.iter_mut() {
        sky.look.sun = sun.extend(smooth(-0.06, 0.02, sun.y));
        sky.look.moon = moon.extend(smooth(0.16, -0.10, sun.y));
        sky.look.zenith = colors.zenith.extend(1.0);
        sky.look.horizon = colors.horizon.extend(1.0);
        sky.look.glow = colors.glow.extend(colors.spread);
        sky.look.cloud_light = colors.cloud_light.extend(1.0);
        sky.look.cloud_shade = colors.cloud_shade.extend(1.0);
        if *air == Air::Atmosphere {
            // Clouds, discs and stars alone: they are seen through the air, which adds its own light.
            sky.look.zenith = Vec4::W;
            sky.look.horizon = Vec4::W;
            sky.look.glow = Vec4::ZERO;
        }
        let stars = 1.5 * smooth(0.0, -0.22, sun.y);
        sky.look.drift = Vec4::new(stars, drift, 0.4 * drift, (clock.hour - 12.0) / 24.0 * TAU);
    }
}

/// Smoothstep: 0 at `low`, 1 at `high`. `low` may be greater than `high`.
pub fn smooth(low: f32, high: f32, at: f32) -> f32 {
    let t = ((at - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::light::SUN;

    #[test]
    fn in_the_afternoon_the_sun_is_where_places_are_searched() {
        let sun = Clock { hour: AFTERNOON, runs: true }.sun();
        assert!(sun.abs_diff_eq(SUN, 2e-3), "{sun}");
        assert!((sun.length() - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_sun_is_up_by_day_and_the_moon_by_night() {
        for (hour, day) in
            [(0.0, false), (5.5, false), (6.5, true), (12.0, true), (17.5, true), (18.6, false)]
        {
            let clock = Clock { hour, runs: true };
            assert_eq!(clock.sun().y > 0.0, day, "at {hour}");
            assert!(clock.sun().y.max(clock.moon().y) > 0.0, "at {hour}");
        }
        assert_eq!(Clock { hour: 14.5, runs: true }.text(), "14:30");
    }

    #[test]
    fn colours_change_smoothly() {
        let brightness = |i: i32| Colors::at(-1.0 + i as f32 / 1000.0).brightness;
        assert!((0..2000).all(|i| (brightness(i) - brightness(i + 1)).abs() < 10.0));
    }
}
