//! Ground from a grid of heights.

use rayon::prelude::*;

use super::grid::ElevationGrid;
use crate::ground::extent::Extent;
use crate::ground::grey_image::LinePosition;
use crate::ground::noise_heights::check_voxels;
use crate::ground::sources::fill_row;
use crate::ground::{Detail, Ground, GroundError, MAX_VOXELS_PER_SAMPLE};
use crate::lattice::{LIMIT, ONE};

/// The scale of an [`ElevationGrid`]. Its rows run along +x, one after the other along +z; its first sample lies at
/// column (0, 0).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ElevationScale {
    /// Voxels from one sample to the next, along x and z: 1 to [`MAX_VOXELS_PER_SAMPLE`]. Between samples heights
    /// follow Catmull-Rom splines, as with [`ImageScale`](crate::ground::ImageScale).
    pub voxels_per_sample: u32,
    /// What the values of samples mean.
    pub heights: HeightScale,
    /// Small-scale noise for what the samples are too coarse to show.
    pub detail: Option<Detail>,
}

impl Default for ElevationScale {
    /// A voxel for each sample and each unit of height.
    fn default() -> Self {
        Self { voxels_per_sample: 1, heights: HeightScale::default(), detail: None }
    }
}

/// Heights in voxels for the values of a grid.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum HeightScale {
    /// `base + value * voxels_per_unit`: for values in metres, with voxels of 1/`voxels_per_unit` metres.
    Units {
        /// Voxels for each unit.
        voxels_per_unit: f64,
        /// The height of value 0 in voxels.
        base: f64,
    },
    /// The least and greatest value that the samples' type can hold get these heights: for PNG and RAW files of
    /// integers, whose unit is the type's own range. Floats are taken to go from 0 to 1.
    FullScale {
        /// Height of the least value, in voxels.
        low: f64,
        /// Height of the greatest value, in voxels; may lie below `low`.
        high: f64,
    },
    /// The least and greatest value of the file get these heights.
    Range {
        /// Height of the least value, in voxels.
        low: f64,
        /// Height of the greatest value, in voxels; may lie below `low`.
        high: f64,
    },
}

impl Default for HeightScale {
    fn default() -> Self {
        Self::Units { voxels_per_unit: 1.0, base: 0.0 }
    }
}

/// Heights in voxels: `base + (value - from) * factor`.
#[derive(Clone, Copy)]
struct Linear {
    base: f64,
    from: f64,
    factor: f64,
}

impl Linear {
    fn new(scale: &HeightScale, grid: &ElevationGrid) -> Result<Self, GroundError> {
        let between = |low: f64, high: f64, [from, to]: [f64; 2]| {
            check_voxels("height of the least value", low)?;
            check_voxels("height of the greatest value", high)?;
            let factor = if to > from { (high - low) / (to - from) } else { 0.0 };
            Ok(Self { base: low, from, factor })
        };
        match *scale {
            HeightScale::Units { voxels_per_unit, base } => {
                check_voxels("height of value 0", base)?;
                if !voxels_per_unit.is_finite() {
                    let (name, value) = ("voxels per unit".into(), voxels_per_unit);
                    return Err(GroundError::Parameter { name, value, allowed: "finite" });
                }
                Ok(Self { base, from: 0.0, factor: voxels_per_unit })
            }
            HeightScale::FullScale { low, high } => {
                between(low, high, grid.sample_kind().full_scale().unwrap_or([0.0, 1.0]))
            }
            HeightScale::Range { low, high } => {
                between(low, high, grid.range().unwrap_or_default().map(f64::from))
            }
        }
    }

    fn voxels(self, value: f32) -> f64 {
        self.base + (f64::from(value) - self.from) * self.factor
    }
}

impl ElevationGrid {
    /// Ground from this grid: `(samples - 1) * voxels_per_sample` cells along each side. At one voxel for each sample
    /// it takes no memory beyond the grid's.
    ///
    /// # Errors
    /// - [`GroundError::ImageTooSmall`] for a grid of less than 2 x 2 samples.
    /// - [`GroundError::Parameter`] for a parameter out of its range.
    /// - [`GroundError::Size`] if the world would be larger than [`Ground::MAX_SIZE`].
    /// - [`GroundError::Height`] for the first void, or height beyond the lattice's limit.
    /// - [`GroundError::Memory`] if the machine has too little.
    pub fn into_ground(self, scale: &ElevationScale) -> Result<Ground, GroundError> {
        let &ElevationScale { voxels_per_sample: step, heights, detail } = scale;
        let (width, height) = (self.width(), self.height());
        if width < 2 || height < 2 {
            return Err(GroundError::ImageTooSmall { width, height });
        }
        if !(1..=MAX_VOXELS_PER_SAMPLE).contains(&step) {
            let (name, value) = ("voxels per sample".into(), f64::from(step));
            return Err(GroundError::Parameter { name, value, allowed: "1 to 64" });
        }
        let linear = Linear::new(&heights, &self)?;
        let detail = detail.map(Detail::noise).transpose()?;
        let extent = Extent::new((width - 1) * step, (height - 1) * step)?;
        if step == 1 && detail.is_none() {
            return Ok(Ground::new(extent, in_place(self.into_samples(), extent.row_len(), linear)?));
        }
        let heights = extent.fill_rows(|z, row| {
            let across = LinePosition::new(z.unsigned_abs(), step);
            let at_sample = |x: u32| across.interpolate(height, |z| linear.voxels(self.value(x, z)));
            let values: Vec<f64> = (0..width).map(at_sample).collect();
            fill_row(z, row, |x| {
                let along = LinePosition::new(x.unsigned_abs(), step);
                let smooth = along.interpolate(width, |x| values[x as usize]);
                detail.as_ref().map_or(smooth, |detail| smooth + detail(x, z))
            })
        })?;
        Ok(Ground::new(extent, heights))
    }
}

/// Turns values into heights in 1/256 voxel, in the memory that they lie in.
fn in_place(mut values: Vec<f32>, row_len: usize, linear: Linear) -> Result<Vec<i32>, GroundError> {
    let error = values.par_chunks_exact_mut(row_len).enumerate().find_map_first(|(z, row)| {
        for (x, value) in row.iter_mut().enumerate() {
            let voxels = linear.voxels(*value);
            let is_within = voxels.abs() <= f64::from(LIMIT);
            if !is_within {
                return Some(GroundError::Height { x: x as i32, z: z as i32, value: voxels });
            }
            let height = (voxels * f64::from(ONE)).round() as i32;
            *value = f32::from_bits(height.cast_unsigned());
        }
        None
    });
    error.map_or_else(|| Ok(bytemuck::allocation::cast_vec(values)), Err)
}
