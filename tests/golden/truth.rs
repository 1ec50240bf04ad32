//! The ground is what it looks like: each pixel shows what a dig there yields.
//!
//! A cliff, a cave and a trench through beds and ores are drawn by the look with one flat colour for each material,
//! without light. What every pixel shows is compared with the solid voxels next to the point that it is a picture of.
//! Borders may stray by half a voxel: then what shows is up to a voxel farther away than what is nearest.

use bevy::asset::RenderAssetUsages;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain;
use image::{Rgb, RgbImage};

use crate::album::Album;
use crate::own_textures::set_textures;
use crate::studio::{SIZE, Studio};

/// A colour for each material of the default look, far from all others and from what two others mix to.
pub const COLORS: [[u8; 3]; 14] = [
    [255, 0, 0],
    [0, 255, 0],
    [0, 0, 255],
    [255, 255, 255],
    [0, 0, 0],
    [255, 255, 0],
    [0, 255, 255],
    [255, 0, 255],
    [188, 0, 0],
    [0, 188, 0],
    [0, 0, 188],
    [255, 188, 0],
    [0, 188, 255],
    [188, 0, 255],
];

/// How much farther than the nearest solid voxel one may be whose material shows: half a voxel on either side of a
/// border, and what a surface at a whole height lies above its highest sample.
const FARTHER: f64 = 1.1;

/// One pixel in this many may show ground that lies a little farther: noise moves borders, by less than half the way to
/// the next vertex.
const SELDOM: usize = 5000;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let noise = NoiseHeights { seed: 5, scale: 24.0, amplitude: 26.0, octaves: 3, ..default() };
    let ground = Ground::from_noise(96, 96, &noise).and_then(|ground| ground.with_strata(&Strata::mine()));
    studio.terrain(ground.expect("valid ground"), GroundLook { variety: 0.0, ..default() });
    let top = studio.height(48.0, 48.0);
    studio.apply([
        // A cave, and a trench from rim to rim.
        Brush::dig(Shape::capsule(Vec3::new(30.0, top - 4.0, 30.0), Vec3::new(60.0, top - 24.0, 52.0), 6.0)),
        Brush::dig(Shape::cuboid(Vec3::new(48.0, top, 66.0), Vec3::new(40.0, 30.0, 4.0))),
    ]);
    let own = draw_flat(studio);
    let camera = studio.camera;
    let fog = studio.app.world_mut().entity_mut(camera).take::<DistanceFog>();
    studio.app.world_mut().entity_mut(camera).insert(Tonemapping::None);
    let mut counts = Counts::default();
    for (from, at) in [
        (Vec3::new(90.0, top + 24.0, 90.0), Vec3::new(40.0, top - 8.0, 40.0)),
        (Vec3::new(6.0, top + 10.0, 60.0), Vec3::new(60.0, top - 14.0, 66.0)),
        (Vec3::new(34.0, top - 5.0, 33.0), Vec3::new(60.0, top - 24.0, 52.0)),
        (Vec3::new(20.0, top - 12.0, 66.0), Vec3::new(80.0, top - 20.0, 66.5)),
    ] {
        studio.look(from, at);
        let picture = studio.picture();
        let place = *studio.app.world().get::<Transform>(camera).expect("the camera has a place");
        let terrain = studio.one::<Terrain>();
        counts.count(&picture, place, terrain.world());
    }
    println!("materials by pixel: {counts:?}");
    album.check(counts.seen > 100_000 && counts.materials.count_ones() >= 8, || {
        format!("too little of the ground is in sight: {counts:?}")
    });
    album.check(counts.wrong * SELDOM < counts.seen, || format!("pixels show what is not there: {counts:?}"));
    let world = studio.app.world_mut();
    world.entity_mut(camera).insert((Tonemapping::default(), fog.unwrap_or_default()));
    set_textures(studio, own);
}

/// Draws all ground unlit and in flat colours, and returns the previous textures.
pub fn draw_flat(studio: &mut Studio) -> GroundTextures {
    let own = studio.app.world().resource::<GroundTextures>().clone();
    let textures = flat(studio);
    set_textures(studio, textures);
    let mut materials = studio.app.world_mut().resource_mut::<Assets<GroundMaterial>>();
    for (_, material) in materials.iter_mut() {
        material.base.unlit = true;
    }
    own
}

/// A flat colour for each layer.
fn flat(studio: &mut Studio) -> GroundTextures {
    let size = Extent3d { width: 4, height: 4, ..default() };
    let (format, usage) = (TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::default());
    let layer = |[r, g, b]: [u8; 3]| GroundLayerImages {
        albedo: Image::new_fill(size, TextureDimension::D2, &[r, g, b, 255], format, usage),
        ..default()
    };
    // Sandstone and shale have textures of their own for floors.
    let layers: Vec<GroundLayerImages> =
        COLORS.into_iter().chain([COLORS[9], COLORS[10]]).map(layer).collect();
    let arrays = GroundArrays::pack(layers).expect("flat pictures fit");
    arrays.add_to(&mut studio.app.world_mut().resource_mut::<Assets<Image>>())
}

/// What pixels show.
#[derive(Debug, Default)]
struct Counts {
    /// Pixels that show ground.
    seen: usize,
    /// Pixels that show one material, and pixels that show two on a border.
    pure: usize,
    mixed: usize,
    /// Pixels that show what is not there.
    wrong: usize,
    /// A bit for each material that shows.
    materials: u32,
    /// A wrong pixel, where it is in the ground, its colour, and the materials that are there.
    example: Option<([u32; 2], DVec3, [u8; 3], Vec<usize>)>,
}

impl Counts {
    fn count(&mut self, picture: &RgbImage, camera: Transform, world: &terrain::World) {
        for (x, y, texel) in picture.enumerate_pixels() {
            // On an outline, the renderer may see ground just off the middle of the pixel.
            let beside = [[0.0, 0.0], [0.1, 0.0], [-0.1, 0.0], [0.0, 0.1], [0.0, -0.1]];
            let cast = |[dx, dy]: [f32; 2]| {
                let direction = direction(camera, x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
                world.raycast(camera.translation.as_dvec3(), direction.as_dvec3(), 500.0)
            };
            let hits: Vec<DVec3> = beside.into_iter().filter_map(cast).map(|hit| hit.position).collect();
            let [place, .., _] = hits[..] else { continue };
            if hits.len() < beside.len() {
                continue;
            }
            self.seen += 1;
            let is_even = hits.iter().all(|other| other.distance(place) < 1.0);
            let places = if is_even { &hits[..1] } else { &hits[..] };
            let there: Vec<usize> = places.iter().flat_map(|&place| materials_at(world, place)).collect();
            if let Some(only) = there.iter().find(|&&material| shows(texel, [material, material])) {
                self.pure += 1;
                self.materials |= 1 << only;
            } else if there.iter().any(|&a| there.iter().any(|&b| shows(texel, [a, b]))) {
                self.mixed += 1;
            } else {
                self.wrong += 1;
                self.example = Some(([x, y], place, texel.0, there));
            }
        }
    }
}

/// Where the camera looks through a point of the picture.
fn direction(camera: Transform, x: f32, y: f32) -> Vec3 {
    let (width, height) = (SIZE.0 as f32, SIZE.1 as f32);
    let half = (PerspectiveProjection::default().fov / 2.0).tan();
    let across = (x / width * 2.0 - 1.0) * half * width / height;
    let up = (1.0 - y / height * 2.0) * half;
    camera.rotation * Vec3::new(across, up, -1.0).normalize()
}

/// The materials of the solid voxels about a point of the surface, as numbers of colours.
fn materials_at(world: &terrain::World, place: DVec3) -> Vec<usize> {
    let samples = world.samples();
    let middle = place.round().as_ivec3();
    let around = (0..125).map(|at| middle + IVec3::new(at % 5 - 2, at / 5 % 5 - 2, at / 25 - 2));
    let solid: Vec<(f64, usize)> = around
        .filter(|&point| samples.is_solid(point))
        .map(|point| (point.as_dvec3().distance(place), usize::from(samples.material(point).0)))
        .collect();
    let nearest = solid.iter().map(|(distance, _)| *distance).fold(f64::MAX, f64::min);
    let near = solid.into_iter().filter(|(distance, _)| *distance <= nearest + FARTHER);
    let mut materials: Vec<usize> = near.map(|(_, material)| material.min(COLORS.len() - 1)).collect();
    materials.sort_unstable();
    materials.dedup();
    materials
}

/// Whether a pixel shows these two materials, mixed in any way, and at most a tenth of others.
fn shows(texel: &Rgb<u8>, materials: [usize; 2]) -> bool {
    let linear = |[r, g, b]: [u8; 3]| LinearRgba::from(Srgba::rgb_u8(r, g, b)).to_vec3();
    let (shown, from, to) = (linear(texel.0), linear(COLORS[materials[0]]), linear(COLORS[materials[1]]));
    let along = to - from;
    let share = if along == Vec3::ZERO { 0.0 } else { (shown - from).dot(along) / along.length_squared() };
    shown.distance(from + along * share.clamp(0.0, 1.0)) < 0.1
}
