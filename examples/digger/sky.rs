//! The sky: a cube map of haze, blue and clouds, computed once in a task.

use bevy::asset::RenderAssetUsages;
use bevy::light::Skybox;
use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use noise::{Fbm, MultiFractal, NoiseFn, Perlin};
use rayon::prelude::*;

use crate::light::{Eyes, SUN};

/// What is far away fades into this, and the horizon has it too: linear red, green, blue.
pub const HAZE: Vec3 = Vec3::new(0.56, 0.70, 0.86);
const ZENITH: Vec3 = Vec3::new(0.075, 0.21, 0.56);
const SUNSHINE: Vec3 = Vec3::new(1.0, 0.82, 0.58);

/// Texels along an edge of the cube.
const SIDE: u32 = 512;
/// Texels hold up to this much light, so that the sun outshines the clouds.
const BRIGHTEST: f32 = 3.0;
/// Luminance in cd/m2 that Bevy's default exposure shows as 1.
const WHITE: f32 = 1000.0;

/// Puts a sky behind everything that [`Eyes`] see.
pub struct SkyPlugin;

impl Plugin for SkyPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, start_painting).add_systems(Update, hang_up);
    }
}

#[derive(Resource)]
struct Painting(Task<Vec<u8>>);

fn start_painting(mut commands: Commands) {
    commands.insert_resource(Painting(AsyncComputeTaskPool::get().spawn(async { paint() })));
}

/// Hangs the picture up when it is done.
fn hang_up(
    mut commands: Commands,
    painting: Option<ResMut<Painting>>,
    mut images: ResMut<Assets<Image>>,
    eyes: Query<Entity, With<Eyes>>,
) {
    let Some(texels) = painting.and_then(|mut painting| check_ready(&mut painting.0)) else { return };
    commands.remove_resource::<Painting>();
    let size = Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 6 };
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut image = Image::new(size, TextureDimension::D2, texels, format, RenderAssetUsages::RENDER_WORLD);
    let cube = TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..default() };
    image.texture_view_descriptor = Some(cube);
    let sky = Skybox { image: Some(images.add(image)), brightness: WHITE * BRIGHTEST, ..default() };
    for eyes in &eyes {
        commands.entity(eyes).insert(sky.clone());
    }
}

/// The six sides, one below the other.
fn paint() -> Vec<u8> {
    let clouds = Fbm::<Perlin>::new(7).set_octaves(6).set_persistence(0.52);
    let row = |row: u32| {
        let (side, v) = (row / SIDE, (row % SIDE) as f32 + 0.5);
        let clouds = &clouds;
        (0..SIDE).flat_map(move |u| {
            let [u, v] = [u as f32 + 0.5, v].map(|at| at / SIDE as f32 * 2.0 - 1.0);
            let [r, g, b] = (colour(towards(side, u, v), clouds) / BRIGHTEST).to_array();
            Srgba::from(LinearRgba::rgb(r.min(1.0), g.min(1.0), b.min(1.0))).to_u8_array()
        })
    };
    (0..6 * SIDE).into_par_iter().flat_map_iter(row).collect()
}

/// Where a texel of the cube lies, seen from its middle; `v` runs down. The renderer flips z.
fn towards(side: u32, u: f32, v: f32) -> Vec3 {
    let place = match side {
        0 => Vec3::new(1.0, -v, u),
        1 => Vec3::new(-1.0, -v, -u),
        2 => Vec3::new(u, 1.0, -v),
        3 => Vec3::new(u, -1.0, v),
        4 => Vec3::new(u, -v, -1.0),
        _ => Vec3::new(-u, -v, 1.0),
    };
    place.normalize()
}

/// The light from a direction, linear.
fn colour(towards: Vec3, clouds: &impl NoiseFn<f64, 2>) -> Vec3 {
    let up = towards.y.max(0.0);
    let sun = towards.dot(SUN).max(0.0);
    let glow = SUNSHINE * (0.10 * sun.powi(6) + 0.30 * sun.powi(60));
    let blue = ZENITH.lerp(HAZE, (-5.0 * up).exp()) + glow * smooth(-0.02, 0.06, towards.y);
    let disc = SUNSHINE * BRIGHTEST * smooth(0.99960, 0.99985, sun);
    if up <= 0.02 {
        return blue;
    }
    // Clouds lie on a plane overhead, which bends down to the horizon.
    let place = (towards.xz() / (up + 0.10)).as_dvec2() * 1.1;
    let thickness = |place: bevy::math::DVec2| clouds.get([place.x + 3.7, place.y + 0.4]) as f32;
    let here = thickness(place);
    let cover = smooth(0.02, 0.42, here) * smooth(0.03, 0.22, up);
    let sunward = SUN.xz().as_dvec2() * 0.12;
    let shade = (0.5 + 1.4 * (here - thickness(place + sunward))).clamp(0.0, 1.0);
    let cloud = Vec3::new(0.62, 0.68, 0.78).lerp(Vec3::new(1.25, 1.2, 1.12), shade) + glow;
    (blue + disc).lerp(cloud, 0.9 * cover)
}

/// 0 below `low`, 1 above `high`, and an S between.
fn smooth(low: f32, high: f32, at: f32) -> f32 {
    let t = ((at - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
