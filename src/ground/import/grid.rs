//! Heights in the unit of their file.

use std::fmt;

use super::error::ImportError;
use super::kind::SampleKind;
use crate::ground::{GreyImage, ImageError, ImageLimits};

/// Heights on a rectangular grid, in the unit of the file that they come from. A sample without a value is NaN.
#[derive(Clone)]
pub struct ElevationGrid {
    width: u32,
    height: u32,
    samples: Vec<f32>,
    sample: SampleKind,
}

impl ElevationGrid {
    /// A grid of `width` x `height` samples, row by row from the top; NaN where there is no value.
    ///
    /// # Errors
    /// [`ImportError::Empty`], [`ImportError::Limit`] (a side over 16385, or not `width * height` samples).
    pub fn from_samples(width: u32, height: u32, samples: Vec<f32>) -> Result<Self, ImportError> {
        Self::with_kind(SampleKind::Float(32), width, height, samples)
    }

    pub(super) fn with_kind(
        sample: SampleKind,
        width: u32,
        height: u32,
        samples: Vec<f32>,
    ) -> Result<Self, ImportError> {
        ImageLimits::check_sides(width, height)?;
        let (expected, actual) = (u64::from(width) * u64::from(height), samples.len() as u64);
        if actual != expected {
            let unit = "samples";
            return Err(ImageError::Length { width, height, unit, expected, actual }.into());
        }
        Ok(Self { width, height, samples, sample })
    }

    /// Samples in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All samples, row by row from the top.
    pub fn samples(&self) -> &[f32] {
        &self.samples
    }

    /// The type that samples had in their file.
    pub fn sample_kind(&self) -> SampleKind {
        self.sample
    }

    /// The sample in column `x` of row `z`; beyond the border, the nearest one.
    pub fn value(&self, x: u32, z: u32) -> f32 {
        let (x, z) = (x.min(self.width - 1), z.min(self.height - 1));
        self.samples[z as usize * self.width as usize + x as usize]
    }

    /// The least and greatest value; `None` if no sample has one.
    pub fn range(&self) -> Option<[f32; 2]> {
        range(&self.samples)
    }

    /// The grid as a grey image whose black and white are the least and greatest value, which are returned: for an
    /// [`ImageSource`](crate::ground::ImageSource) or a stamp. Values are rounded to 1/65535 of that range; voids
    /// become black.
    ///
    /// # Errors
    /// When all samples are voids.
    pub fn to_grey_image(&self) -> Result<(GreyImage, [f32; 2]), ImportError> {
        let count = self.samples.len() as u64;
        let [low, high] = self.range().ok_or(ImportError::AllVoid { samples: count })?;
        let span = f64::from(high) - f64::from(low);
        let scale = if span > 0.0 { 65_535.0 / span } else { 0.0 };
        // NaN becomes 0.
        let grey = |&value: &f32| ((f64::from(value) - f64::from(low)) * scale).round() as u16;
        let image =
            GreyImage::from_samples(self.width, self.height, self.samples.iter().map(grey).collect())?;
        Ok((image, [low, high]))
    }

    /// The samples.
    pub(super) fn into_samples(self) -> Vec<f32> {
        self.samples
    }
}

/// The least and greatest of some values; `None` if there are none.
pub(super) fn range(samples: &[f32]) -> Option<[f32; 2]> {
    let values = samples.iter().copied().filter(|value| !value.is_nan());
    values.fold(None, |range, value| {
        let [low, high] = range.unwrap_or([value, value]);
        Some([low.min(value), high.max(value)])
    })
}

impl fmt::Debug for ElevationGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, sample, .. } = self;
        let mut shown = f.debug_struct("ElevationGrid");
        shown.field("width", width).field("height", height).field("sample", sample).finish_non_exhaustive()
    }
}
