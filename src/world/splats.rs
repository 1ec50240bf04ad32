//! The materials of the surface as splat maps, for terrain tools.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::state::World;
use crate::ground::{HeightFormat, ImportError, MAX_LAYERS, MaterialId};
use crate::lattice::Column;
use crate::surface::MaterialMix;

/// Splat maps of a world.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SplatMaps {
    /// The material of each channel, of all files one after the other.
    pub layers: Vec<MaterialId>,
    /// PNG files of 8 bits with red, green, blue and alpha, four layers each. Channels without a layer are 0.
    pub files: Vec<Vec<u8>>,
}

impl World {
    /// The materials of the topmost ground over every column, edits included: a sample for each column, whose weights
    /// sum up to 255. [`MaterialMap::decode_splats`](crate::ground::MaterialMap::decode_splats) reads them again.
    ///
    /// # Errors
    /// [`ImportError::TooManyMaterials`] for a surface of more than 16 materials, [`ImportError::Limit`] for a world of
    /// more than 16384 columns along a side.
    pub fn splat_maps(&self) -> Result<SplatMaps, ImportError> {
        let (width, depth) = (self.ground().width(), self.ground().depth());
        self.check_map_size()?;
        let top = |x: i32, z: i32| {
            let is_edited = [x - 1, x + 1]
                .iter()
                .any(|&x| [z - 1, z + 1].iter().any(|&z| self.stacks.contains_key(&(x >> 3, z >> 3))));
            let found = if is_edited { self.height(x.into(), z.into()) } else { None };
            match found {
                Some(y) => MaterialMix::pure(self.material_under(DVec3::new(x.into(), y, z.into()))),
                None => MaterialMix::column(self.ground().surface_material(Column::new(x, z))),
            }
        };
        let rows = (0..=depth).into_par_iter();
        let tops: Vec<MaterialMix> =
            rows.flat_map_iter(|z| (0..=width).map(move |x| (x, z))).map(|(x, z)| top(x, z)).collect();
        let parts = |mix: &MaterialMix| {
            let (ids, weights) = (mix.ids, mix.weights);
            ids.into_iter().zip(weights).filter(|(_, weight)| *weight > 0)
        };
        let found: BTreeSet<u8> = tops.iter().flat_map(parts).map(|(id, _)| id).collect();
        if found.len() > MAX_LAYERS {
            return Err(ImportError::TooManyMaterials { found: found.len(), most: MAX_LAYERS });
        }
        let layers: Vec<u8> = found.into_iter().collect();
        let file = |own: &[u8]| {
            let mut pixels = vec![0; tops.len() * 4];
            for (pixel, mix) in pixels.chunks_exact_mut(4).zip(&tops) {
                for (id, weight) in parts(mix) {
                    if let Some(channel) = own.iter().position(|layer| *layer == id) {
                        pixel[channel] = weight;
                    }
                }
            }
            encode(width as u32 + 1, depth as u32 + 1, &pixels)
        };
        let files = layers.chunks(4).map(file).collect::<Result<_, _>>()?;
        Ok(SplatMaps { layers: layers.into_iter().map(MaterialId).collect(), files })
    }
}

/// A PNG of red, green, blue and alpha.
fn encode(width: u32, height: u32, pixels: &[u8]) -> Result<Vec<u8>, ImportError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(pixels));
    let failed = |error: png::EncodingError| ImportError::Encode {
        format: HeightFormat::Png,
        reason: error.to_string(),
    };
    written.map_err(failed)?;
    Ok(file)
}
