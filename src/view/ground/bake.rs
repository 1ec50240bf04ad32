//! Image arrays of painted layers, and noise in space.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bevy::asset::RenderAssetUsages;
use bevy::image::{Image, ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::log::trace;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use rayon::prelude::*;

use super::noise::solid;
use super::paint::{byte, paint};
use super::palette::RECIPES;

/// Texels along a side of the solid noise.
const SOLID: u32 = 64;

/// The progress of a bake, shared with its task.
#[derive(Clone, Debug, Default)]
pub(super) struct Meter(Arc<AtomicUsize>);

impl Meter {
    /// 0 to 1.
    pub fn progress(&self) -> f32 {
        self.0.load(Ordering::Relaxed) as f32 / RECIPES.len() as f32
    }

    fn step(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// All layers of both arrays, one after another, each with all its mip levels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layers {
    /// Texels along a side.
    pub side: u32,
    /// Colours (sRGB) and heights.
    pub albedo: Vec<u8>,
    /// Normals, occlusion and roughness.
    pub relief: Vec<u8>,
}

impl Layers {
    /// Paints all layers, `side` texels wide: in a task, over all its threads.
    pub fn paint(side: u32, meter: &Meter) -> Self {
        let layers: Vec<(Vec<u8>, Vec<u8>)> = RECIPES
            .par_iter()
            .enumerate()
            .map(|(number, recipe)| {
                let layer = paint(recipe, number as u32, side);
                trace!("painted {}", recipe.name);
                meter.step();
                layer
            })
            .collect();
        let (albedo, relief): (Vec<_>, Vec<_>) = layers.into_iter().unzip();
        Self { side, albedo: albedo.concat(), relief: relief.concat() }
    }

    /// The bytes of either array.
    pub fn size(side: u32) -> usize {
        let levels = std::iter::successors(Some(side as usize), |side| (*side > 1).then_some(side / 2));
        RECIPES.len() * levels.map(|side| 4 * side * side).sum::<usize>()
    }

    /// The images of a material: albedo, relief and noise in space.
    pub fn into_images(self, anisotropy: u16) -> [Image; 3] {
        let Self { side, albedo, relief } = self;
        let count = RECIPES.len() as u32;
        [
            array(albedo, count, side, TextureFormat::Rgba8UnormSrgb, anisotropy),
            array(relief, count, side, TextureFormat::Rgba8Unorm, anisotropy),
            solid_noise(),
        ]
    }
}

/// An image array of layers that hold all their mip levels.
pub(super) fn array(layers: Vec<u8>, count: u32, side: u32, format: TextureFormat, anisotropy: u16) -> Image {
    let size = Extent3d { width: side, height: side, depth_or_array_layers: count };
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, RenderAssetUsages::RENDER_WORLD);
    image.data = Some(layers);
    image.texture_descriptor.mip_level_count = side.ilog2() + 1;
    let view = TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..Default::default() };
    image.texture_view_descriptor = Some(view);
    image.sampler = sampler(anisotropy);
    image
}

fn sampler(anisotropy: u16) -> ImageSampler {
    ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        address_mode_v: ImageAddressMode::Repeat,
        address_mode_w: ImageAddressMode::Repeat,
        mag_filter: ImageFilterMode::Linear,
        min_filter: ImageFilterMode::Linear,
        mipmap_filter: ImageFilterMode::Linear,
        anisotropy_clamp: anisotropy.clamp(1, 16),
        ..Default::default()
    })
}

/// Four kinds of noise in space that repeat; 0.5 is their middle.
fn solid_noise() -> Image {
    let texels = (0..SOLID * SOLID)
        .into_par_iter()
        .flat_map_iter(|row| {
            let (y, z) = (row % SOLID, row / SOLID);
            (0..SOLID).flat_map(move |x| {
                let place = [x, y, z].map(|at| (at as f32 + 0.5) / SOLID as f32);
                std::array::from_fn::<u8, 4, _>(|kind| {
                    let seed = 200 + kind as u32 * 7;
                    let sum = solid(place, 6, seed) + 0.5 * solid(place, 13, seed + 1);
                    byte(0.5 + 0.5 * 0.85 * sum)
                })
            })
        })
        .collect();
    let size = Extent3d { width: SOLID, height: SOLID, depth_or_array_layers: SOLID };
    let usage = RenderAssetUsages::RENDER_WORLD;
    let mut image = Image::new(size, TextureDimension::D3, texels, TextureFormat::Rgba8Unorm, usage);
    image.sampler = sampler(1);
    image
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_hold_all_levels_of_all_layers() {
        let meter = Meter::default();
        let layers = Layers::paint(16, &meter);
        assert_eq!(meter.progress(), 1.0);
        let [albedo, relief, _] = layers.into_images(1);
        let texels = 16 * 16 + 8 * 8 + 4 * 4 + 2 * 2 + 1;
        assert_eq!(Layers::size(16), RECIPES.len() * texels * 4);
        for image in [&albedo, &relief] {
            assert_eq!(image.data.as_ref().map(Vec::len), Some(Layers::size(16)));
            assert_eq!(image.texture_descriptor.mip_level_count, 5);
        }
    }
}
