//! Texels from recipes: colour with height, slope with occlusion and roughness, all mip levels.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bevy::asset::RenderAssetUsages;
use bevy::image::{Image, ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::log::trace;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use rayon::prelude::*;

use super::noise::{chance, octaves, solid};
use super::palette::{Point, RECIPES, Recipe, Scatter};

/// Texels along a side of the solid noise.
const SOLID: u32 = 64;

/// The progress of a bake, shared with its task.
#[derive(Clone, Debug, Default)]
pub(super) struct Meter(Arc<AtomicUsize>);

impl Meter {
    /// 0 to 1.
    pub fn progress(&self) -> f32 {
        self.0.load(Ordering::Relaxed) as f32 / (RECIPES.len() + 1) as f32
    }

    fn step(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// The result of a bake.
pub(super) struct Baked {
    pub albedo: Image,
    pub relief: Image,
    pub noise: Image,
}

/// Paints all layers, `side` texels wide: in a task, over all its threads.
pub(super) fn bake(side: u32, anisotropy: u16, meter: &Meter) -> Baked {
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
    let noise = solid_noise();
    meter.step();
    Baked {
        albedo: array(&albedo, side, TextureFormat::Rgba8UnormSrgb, anisotropy),
        relief: array(&relief, side, TextureFormat::Rgba8Unorm, anisotropy),
        noise,
    }
}

/// An image array of layers that hold all their mip levels.
pub(super) fn array(layers: &[Vec<u8>], side: u32, format: TextureFormat, anisotropy: u16) -> Image {
    let size = Extent3d { width: side, height: side, depth_or_array_layers: layers.len() as u32 };
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, RenderAssetUsages::RENDER_WORLD);
    image.data = Some(layers.concat());
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

fn byte(share: f32) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// One layer: colour and height, slope with occlusion and roughness, each with all its mip levels.
fn paint(recipe: &Recipe, number: u32, side: u32) -> (Vec<u8>, Vec<u8>) {
    let along = |texel: u32| (texel as f32 + 0.5) / side as f32;
    let mut points: Vec<Point> = (0..side * side)
        .into_par_iter()
        .map(|texel| (recipe.paint)(along(texel % side), along(texel / side)))
        .collect();
    if let Some(scatter) = &recipe.scatter {
        scatter_blades(&mut points, side, scatter, number);
    }
    let heights: Vec<f32> = points.iter().map(|point| point.height).collect();
    let low = blurred(&heights, side);
    let at = |x: u32, y: u32| heights[((y % side) * side + x % side) as usize];
    let steep = recipe.relief / (2.0 * recipe.metres / side as f32);
    let (mut albedo, mut relief) = (Vec::with_capacity(points.len()), Vec::with_capacity(points.len()));
    for (texel, point) in points.iter().enumerate() {
        let (x, y) = (texel as u32 % side, texel as u32 / side);
        let [dx, dy] = [at(x + 1, y) - at(x + side - 1, y), at(x, y + 1) - at(x, y + side - 1)];
        let [dx, dy] = [dx, dy].map(|rise| rise * steep);
        let length = (dx * dx + dy * dy + 1.0).sqrt();
        let occlusion = 1.0 - (1.6 * (low[texel] - point.height)).clamp(0.0, 0.75);
        let [r, g, b] = point.color;
        albedo.push([byte(r), byte(g), byte(b), byte(point.height)]);
        let normal = [-dx / length, -dy / length].map(|part| byte(0.5 + 0.5 * part));
        relief.push([normal[0], normal[1], byte(occlusion), byte(point.roughness)]);
    }
    (levels(albedo, side, true), levels(relief, side, false))
}

/// Draws blades over a layer, later ones on top, repeating across its borders.
fn scatter_blades(points: &mut [Point], side: u32, scatter: &Scatter, seed: u32) {
    let [length, width] = scatter.size.map(|part| part * side as f32);
    for blade in 0..scatter.count as i32 {
        let dice = |face: u32| chance(blade, face.cast_signed(), seed ^ 0xb1ad);
        let from = [dice(0), dice(1)].map(|share| share * side as f32);
        // Directions without sines, whose last bits differ from machine to machine: a point in a disc.
        let (x, y) = (dice(2) - 0.5, dice(3) - 0.5);
        let norm = (x * x + y * y).sqrt().max(0.01);
        let (x, y) = (x / norm, y / norm);
        let length = length * (0.5 + 0.7 * dice(4));
        let bow = (dice(5) - 0.5) * 0.5;
        let patch = octaves(from[0] / side as f32, from[1] / side as f32, 4, 3, seed + 5);
        let bright = (dice(6) * 0.75 + 0.15 + 0.3 * patch).clamp(0.0, 1.0);
        let [dark, light] = scatter.colors;
        let dry = if dice(7) > 0.93 { 0.6 } else { 0.0 };
        let color: [f32; 3] = std::array::from_fn(|i| {
            let fresh = dark[i] + (light[i] - dark[i]) * bright;
            fresh + ([0.60, 0.52, 0.28][i] - fresh) * dry
        });
        let steps = (length * 1.5).max(1.0) as i32;
        for step in 0..steps {
            let t = step as f32 / steps as f32;
            let aside = bow * t * t * length;
            let centre = [from[0] + x * t * length - y * aside, from[1] + y * t * length + x * aside];
            let half = (width * (1.0 - t) * 0.5).max(0.3);
            let reach = half.ceil() as i32;
            for across in -reach..=reach {
                let off = across as f32;
                if off.abs() > half {
                    continue;
                }
                let place = [centre[0] - y * off, centre[1] + x * off];
                let [px, py] = place.map(|at| (at.floor() as i32).rem_euclid(side.cast_signed()) as usize);
                // Blades rise to their tip; those below are hidden.
                let height = 0.30 + 0.55 * t * (0.6 + 0.4 * dice(8)) + 0.1 * dice(9);
                if let Some(point) = points.get_mut(py * side as usize + px)
                    && height >= point.height
                {
                    let shade = 0.45 + 0.65 * t - 0.12 * (off / half.max(0.5));
                    *point = Point { color: color.map(|part| part * shade), height, roughness: 0.8 };
                }
            }
        }
    }
}

/// Heights averaged over a sixteenth of the side, by a box that runs along rows and then along columns.
fn blurred(heights: &[f32], side: u32) -> Vec<f32> {
    let (side, reach) = (side as usize, (side / 32).max(1) as usize);
    let run = |from: &[f32]| -> Vec<f32> {
        // Averages along rows, written as columns: done twice, both directions are back in place.
        let mut to = vec![0.0; from.len()];
        for (y, row) in from.chunks_exact(side).enumerate() {
            let mut sum: f32 = (0..2 * reach + 1).map(|i| row[(i + side - reach) % side]).sum();
            for x in 0..side {
                to[x * side + y] = sum / (2 * reach + 1) as f32;
                sum += row[(x + reach + 1) % side] - row[(x + side - reach) % side];
            }
        }
        to
    };
    run(&run(heights))
}

/// A picture and all its mip levels, one after another; colours are averaged as light.
fn levels(picture: Vec<[u8; 4]>, side: u32, is_srgb: bool) -> Vec<u8> {
    let to_light: Vec<f32> = (0..256)
        .map(|value| {
            let value = value as f32 / 255.0;
            if !is_srgb {
                value
            } else if value <= 0.040_45 {
                value / 12.92
            } else {
                ((value + 0.055) / 1.055).powf(2.4)
            }
        })
        .collect();
    let from_light = |light: f32| {
        if !is_srgb {
            light
        } else if light <= 0.003_130_8 {
            light * 12.92
        } else {
            1.055 * light.powf(1.0 / 2.4) - 0.055
        }
    };
    let mut bytes: Vec<u8> = picture.as_flattened().to_vec();
    let (mut level, mut side) = (picture, side as usize);
    while side > 1 {
        let half = side / 2;
        level = (0..half * half)
            .map(|texel| {
                let (x, y) = (2 * (texel % half), 2 * (texel / half));
                let four = [y * side + x, y * side + x + 1, (y + 1) * side + x, (y + 1) * side + x + 1];
                std::array::from_fn(|channel| {
                    let plain = |at: usize| f32::from(level[at][channel]) / 255.0;
                    if channel == 3 {
                        return byte(four.iter().map(|&at| plain(at)).sum::<f32>() / 4.0);
                    }
                    let light = |at: usize| to_light[usize::from(level[at][channel])];
                    byte(from_light(four.iter().map(|&at| light(at)).sum::<f32>() / 4.0))
                })
            })
            .collect();
        bytes.extend_from_slice(level.as_flattened());
        side = half;
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_hold_all_levels_of_all_layers() {
        let meter = Meter::default();
        let baked = bake(16, 1, &meter);
        let texels = 16 * 16 + 8 * 8 + 4 * 4 + 2 * 2 + 1;
        for image in [&baked.albedo, &baked.relief] {
            assert_eq!(image.data.as_ref().map(Vec::len), Some(RECIPES.len() * texels * 4));
            assert_eq!(image.texture_descriptor.mip_level_count, 5);
        }
        assert_eq!(meter.progress(), 1.0);
    }

    #[test]
    fn layers_are_told_apart_by_their_colour() {
        let mean = |recipe: &Recipe| {
            let (albedo, _) = paint(recipe, 1, 32);
            let last = albedo.len() - 4;
            [albedo[last], albedo[last + 1], albedo[last + 2]]
        };
        // The last two are the same rocks from above.
        let means: Vec<_> = RECIPES[..14].iter().map(mean).collect();
        let from_above = [(9, 14), (10, 15)].map(|(wall, floor)| (means[wall], mean(&RECIPES[floor])));
        for (wall, floor) in from_above {
            assert!(wall.iter().zip(floor).all(|(a, b)| a.abs_diff(b) < 10), "{wall:?} is not {floor:?}");
        }
        for (i, a) in means.iter().enumerate() {
            for (j, b) in means.iter().enumerate().skip(i + 1) {
                let apart: u32 = a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b))).sum();
                assert!(apart > 12, "{} {a:?} looks like {} {b:?}", RECIPES[i].name, RECIPES[j].name);
            }
        }
    }
}
