//! The sky: a box around the camera, whose shader draws haze, sun, moon, stars and drifting clouds.
//!
//! Bevy's own atmosphere needs an HDR camera and several more passes per frame. This one is a single draw call.

use std::path::Path;

use bevy::asset::RenderAssetUsages;
use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::camera::visibility::NoFrustumCulling;
use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, Extent3d, ShaderType, TextureDimension, TextureFormat};
use bevy::shader::ShaderRef;

const SHADER: &str = "embedded://digger/sky.wgsl";
/// Texels along an edge of the noise for the clouds.
const SIDE: u32 = 256;

/// Draws the sky behind everything.
pub struct SkyPlugin;

impl Plugin for SkyPlugin {
    fn build(&self, app: &mut App) {
        let path = Path::new("digger/sky.wgsl");
        let shader = include_bytes!("sky.wgsl");
        app.world().resource::<EmbeddedAssetRegistry>().insert_asset(path.into(), path, shader);
        app.add_plugins(MaterialPlugin::<SkyMaterial>::default()).add_systems(Startup, spawn_sky);
    }
}

/// The sky's material. `day.rs` updates it with the hour.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct SkyMaterial {
    #[uniform(0)]
    pub look: SkyLook,
    #[texture(1)]
    #[sampler(2)]
    pub noise: Handle<Image>,
}

/// The uniforms of `sky.wgsl`. Colours are linear; 1 is white.
#[derive(ShaderType, Clone, Copy, Debug, Default)]
pub struct SkyLook {
    /// The direction to the sun, and the brightness of its disc.
    pub sun: Vec4,
    /// The direction to the moon, and the brightness of its disc.
    pub moon: Vec4,
    pub zenith: Vec4,
    pub horizon: Vec4,
    /// The glow around the sun, and how much of it spreads along the horizon.
    pub glow: Vec4,
    pub cloud_light: Vec4,
    pub cloud_shade: Vec4,
    /// Brightness of the stars, drift of the clouds along x and z, and rotation of the stars.
    pub drift: Vec4,
}

impl Material for SkyMaterial {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }

    fn enable_prepass() -> bool {
        false
    }

    fn enable_shadows() -> bool {
        false
    }
}

fn spawn_sky(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<SkyMaterial>>,
) -> Result {
    // The camera is inside the box, so its triangles face inward.
    let inside_out = Cuboid::from_length(2.0).mesh().build().with_inverted_winding()?;
    let material = SkyMaterial { look: default(), noise: images.add(noise()) };
    commands.spawn((
        Name::new("sky"),
        Mesh3d(meshes.add(inside_out)),
        MeshMaterial3d(materials.add(material)),
        NoFrustumCulling,
        NotShadowCaster,
        NotShadowReceiver,
    ));
    Ok(())
}

/// Tileable value noise in six octaves.
fn noise() -> Image {
    let lattice = |x: u32, y: u32, octave: u32| {
        let mut bits =
            x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B) ^ octave.wrapping_mul(0xC2B2_AE35);
        bits = (bits ^ (bits >> 15)).wrapping_mul(0x2C1B_3C6D);
        bits = (bits ^ (bits >> 12)).wrapping_mul(0x297A_2D39);
        (bits >> 8) as f32 / 16_777_216.0
    };
    let at = |x: u32, y: u32| {
        let octaves = (0..6u32).map(|octave| {
            let cells = 4 << octave;
            let [u, v] = [x, y].map(|c| (c as f32 + 0.5) / SIDE as f32 * cells as f32);
            let [i, j] = [u, v].map(|c| c as u32);
            let [s, t] = [u.fract(), v.fract()].map(|t| t * t * (3.0 - 2.0 * t));
            let row = |j: u32| {
                let (left, right) =
                    (lattice(i, j % cells, octave), lattice((i + 1) % cells, j % cells, octave));
                left + (right - left) * s
            };
            (row(j) + (row(j + 1) - row(j)) * t) * 0.55f32.powi(octave as i32)
        });
        octaves.sum::<f32>() / 2.16
    };
    let texels = (0..SIDE * SIDE).map(|i| (at(i % SIDE, i / SIDE) * 255.0) as u8).collect();
    let size = Extent3d { width: SIDE, height: SIDE, depth_or_array_layers: 1 };
    let mut image = Image::new(
        size,
        TextureDimension::D2,
        texels,
        TextureFormat::R8Unorm,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        address_mode_v: ImageAddressMode::Repeat,
        mag_filter: ImageFilterMode::Linear,
        min_filter: ImageFilterMode::Linear,
        ..default()
    });
    image
}
