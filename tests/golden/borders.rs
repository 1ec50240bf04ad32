//! Borders between materials do not show the mesh: seen from above, hardly more of their length runs along edges of triangles
//! than along any other direction.
//!
//! Undug ground of two materials is drawn in flat colours. The edges of its triangles have three directions. A border counts as
//! running along one of them if they differ by less than 5 degrees: of borders in random directions, a sixth would.

use bevy::camera::ScalingMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use image::RgbImage;

use crate::album::{Album, keep};
use crate::own_textures::set_textures;
use crate::studio::{SIZE, Studio};
use crate::truth::{COLORS, draw_flat};

/// Voxels along the picture's side, and pixels of a voxel.
const VOXELS: u32 = 64;
const PIXELS: u32 = 16;

/// How far directions may differ, in degrees, to be the same.
const ALONG: f32 = 5.0;

/// The largest share of borders along edges. Of borders in random directions it is a sixth, and this measure finds 0.18 for
/// circles; where borders follow the mesh, it is 0.84. Measured: 0.19.
const MAX_SHARE: f32 = 0.21;

pub fn shoot(studio: &mut Studio, album: &mut Album) {
    let middle = VOXELS as f32 / 2.0;
    // Rings, whose borders have all directions.
    let rings = move |point: IVec3, _| {
        let out = Vec2::new(point.x as f32 - middle - 0.3, point.z as f32 - middle + 0.4).length();
        Some(MaterialId(if out % 14.0 < 7.0 { 4 } else { 1 }))
    };
    let noise = NoiseHeights { seed: 5, scale: 40.0, amplitude: 3.0, octaves: 2, base: 20.0, ..default() };
    let ground =
        Ground::from_noise(VOXELS, VOXELS, &noise).and_then(|ground| ground.with_material_fn(1, rings));
    studio.terrain(ground.expect("valid ground"), GroundLook { variety: 0.0, ..default() });
    let own = draw_flat(studio);
    let side = VOXELS * PIXELS;
    studio.resize((side, side));
    let middle = Vec3::new(middle, 0.0, middle);
    let above = Transform::from_translation(middle + Vec3::Y * 60.0).looking_at(middle, Vec3::NEG_Z);
    let scaling_mode = ScalingMode::Fixed { width: VOXELS as f32, height: VOXELS as f32 };
    let lens = OrthographicProjection { scaling_mode, ..OrthographicProjection::default_3d() };
    studio.renew_camera((Msaa::Off, Tonemapping::None));
    let camera = studio.camera;
    studio.app.world_mut().entity_mut(camera).insert((above, Projection::from(lens)));
    let picture = studio.picture();
    keep("borders", "from_above", &picture);
    let borders = Borders::measure(&picture);
    println!("borders: {borders:?}, along edges {:.3}", borders.share());
    album.check(borders.length > 300.0, || format!("too few borders: {borders:?}"));
    album.check(borders.share() <= MAX_SHARE, || format!("borders follow the mesh: {borders:?}"));
    studio.resize(SIZE);
    studio.renew_camera(Msaa::Off);
    studio
        .app
        .world_mut()
        .entity_mut(studio.camera)
        .insert(Projection::from(PerspectiveProjection::default()));
    set_textures(studio, own);
}

/// Lengths in voxels.
#[derive(Debug, Default)]
struct Borders {
    length: f32,
    along_x: f32,
    along_z: f32,
    along_diagonal: f32,
}

impl Borders {
    fn share(&self) -> f32 {
        (self.along_x + self.along_z + self.along_diagonal) / self.length.max(1.0)
    }

    /// The length of a border is the integral of the gradient of what lies on one side of it, slightly blurred.
    fn measure(picture: &RgbImage) -> Self {
        let side = picture.width() as usize;
        let distance = |texel: [u8; 3], color: [u8; 3]| -> u32 {
            texel.iter().zip(color).map(|(a, b)| u32::from(a.abs_diff(b)).pow(2)).sum()
        };
        let inside: Vec<f32> = picture
            .pixels()
            .map(|texel| if distance(texel.0, COLORS[4]) < distance(texel.0, COLORS[1]) { 1.0 } else { 0.0 })
            .collect();
        let inside = blurred(&blurred(&inside, side, 1), side, side);
        let mut borders = Self::default();
        let margin = PIXELS as usize;
        for y in margin..side - margin {
            for x in margin..side - margin {
                let at = y * side + x;
                let gradient =
                    Vec2::new(inside[at + 1] - inside[at - 1], inside[at + side] - inside[at - side]) / 2.0;
                let length = gradient.length() / PIXELS as f32;
                if length < 1e-6 {
                    continue;
                }
                borders.length += length;
                // The picture's y is the ground's z; the diagonal of a cell runs from its lowest corner to its highest.
                let runs =
                    |edge: Vec2| gradient.normalize().dot(edge.normalize()).abs() < ALONG.to_radians().sin();
                let along = [
                    (Vec2::X, &mut borders.along_x),
                    (Vec2::Y, &mut borders.along_z),
                    (Vec2::ONE, &mut borders.along_diagonal),
                ];
                along.into_iter().filter(|(edge, _)| runs(*edge)).for_each(|(_, sum)| *sum += length);
            }
        }
        borders
    }
}

/// Weighted means of neighbours that are `step` apart.
fn blurred(values: &[f32], side: usize, step: usize) -> Vec<f32> {
    const WEIGHTS: [f32; 7] = [0.06, 0.13, 0.19, 0.24, 0.19, 0.13, 0.06];
    let reach = 3 * if step == 1 { 1 } else { side };
    (0..values.len())
        .map(|at| {
            if at < reach || at + reach >= values.len() {
                return values[at];
            }
            WEIGHTS.iter().enumerate().map(|(i, weight)| weight * values[at + i * step - reach]).sum()
        })
        .collect()
}
