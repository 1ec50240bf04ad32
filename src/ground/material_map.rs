//! Material maps: the materials of columns, sample by sample, as a picture gives them.

use std::fmt;

use super::error::{GroundError, ImageError};
use super::grey_image::ImageLimits;
use super::material::{ColumnMaterial, MaterialId};
use crate::lattice::hash::hash_words;

/// The materials of a world on a grid of samples, stretched over it: each column has those of the nearest sample.
///
/// It is read from [splat maps](Self::decode_splats) and [id maps](Self::decode_ids), or made of any
/// [list](Self::from_columns). [`MaterialControl::Map`](super::MaterialControl::Map) gives it to a ground.
#[derive(Clone, PartialEq, Eq)]
pub struct MaterialMap {
    width: u32,
    height: u32,
    columns: Vec<ColumnMaterial>,
}

impl MaterialMap {
    /// A map of `width` x `height` samples, row by row.
    ///
    /// # Errors
    /// [`ImageError::Empty`], [`ImageError::Dimensions`] (a side over 16385) or [`ImageError::Length`].
    pub fn from_columns(width: u32, height: u32, columns: Vec<ColumnMaterial>) -> Result<Self, ImageError> {
        ImageLimits::check_sides(width, height)?;
        let (expected, actual) = (u64::from(width) * u64::from(height), columns.len() as u64);
        if actual != expected {
            return Err(ImageError::Length { width, height, unit: "samples", expected, actual });
        }
        Ok(Self { width, height, columns })
    }

    /// Samples in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All samples, row by row.
    pub fn columns(&self) -> &[ColumnMaterial] {
        &self.columns
    }

    /// The sample in column `x` of row `z`; beyond the border, the nearest one.
    pub fn column(&self, x: u32, z: u32) -> ColumnMaterial {
        let (x, z) = (x.min(self.width - 1), z.min(self.height - 1));
        self.columns[z as usize * self.width as usize + x as usize]
    }

    pub(super) fn check(&self) -> Result<(), GroundError> {
        self.columns.iter().try_for_each(|column| {
            let all = [column.base, column.overlay];
            all.into_iter().try_for_each(|material: MaterialId| material.check("a material of the map"))
        })
    }

    pub(super) fn hash(&self) -> u64 {
        let size = [self.width, self.height].map(u64::from);
        hash_words(size.into_iter().chain(self.columns.iter().map(|column| column.word())))
    }

    /// Bytes of its samples.
    pub fn bytes(&self) -> usize {
        size_of_val(self.columns.as_slice())
    }
}

impl fmt::Debug for MaterialMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("MaterialMap");
        shown.field("width", &self.width).field("height", &self.height).finish_non_exhaustive()
    }
}
