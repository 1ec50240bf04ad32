//! Sources of heights: functions of the column that are called on demand, so that memory depends on the view.

mod function;
mod image;
mod inset;
mod noise;
#[cfg(test)]
mod tests;

use std::ops::Range;

pub use function::FunctionSource;
pub use image::ImageSource;
pub use inset::InsetSource;
pub use noise::NoiseSource;

use super::material::ColumnMaterial;
use crate::lattice::{Column, LIMIT, ONE};

/// Columns at equal distances: `low`, `low + stride` and so on, `width` of them along x in each of `depth` rows along
/// z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ColumnGrid {
    /// The column with the lowest coordinates.
    pub low: Column,
    /// Voxels from one column to the next, along both axes: at least 1.
    pub stride: i32,
    /// Columns along x.
    pub width: usize,
    /// Rows along z.
    pub depth: usize,
}

impl ColumnGrid {
    /// The number of its columns.
    pub fn count(self) -> usize {
        self.width * self.depth
    }

    /// The columns, row by row, x fastest. Coordinates saturate.
    pub fn columns(self) -> impl Iterator<Item = Column> {
        (0..self.depth).flat_map(move |z| (0..self.width).map(move |x| self.column(x, z)))
    }

    /// The column at this place of the grid. Coordinates saturate.
    pub fn column(self, x: usize, z: usize) -> Column {
        let along = |low: i32, steps: usize| {
            let away = i64::from(self.stride) * steps as i64;
            (i64::from(low) + away).clamp(i32::MIN.into(), i32::MAX.into()) as i32
        };
        Column::new(along(self.low.x, x), along(self.low.z, z))
    }

    /// Part of it.
    pub fn part(self, x: Range<usize>, z: Range<usize>) -> Self {
        Self { low: self.column(x.start, z.start), width: x.len(), depth: z.len(), ..self }
    }
}

/// Heights and materials as a function of the column, for a [`Ground`](super::Ground) that computes them where they are
/// needed.
///
/// It must always give the same for the same column, whatever else is asked for with it: worlds, edits and meshes
/// depend on it. It is asked from several threads at once, and only for columns of the world (an [`InsetSource`] asks
/// the source inside only within its rectangle).
///
/// ```
/// use bevy_burrow::ground::{ColumnGrid, HeightSource};
/// # use bevy_burrow::lattice::Column;
/// use bevy_burrow::prelude::*;
///
/// /// Terraces, a voxel higher every 8 voxels.
/// struct Terraces;
///
/// impl HeightSource for Terraces {
///     fn id(&self) -> u64 {
///         0x7e44_ace5
///     }
///     fn bounds(&self) -> (i32, i32) {
///         (0, 1000 * 256)
///     }
///     fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
///         for (height, column) in heights.iter_mut().zip(grid.columns()) {
///             *height = column.x / 8 * 256;
///         }
///     }
/// }
///
/// let ground = Ground::from_source(200_000, 200_000, Terraces)?;
/// assert_eq!(ground.height(Column::new(800, 5)), 100 * 256);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait HeightSource: Send + Sync + 'static {
    /// A number that stands for all that the source gives, in [`Ground::hash`](super::Ground::hash) and where grounds
    /// are compared: sources with equal ids must give equal heights and materials, in every run of every program.
    fn id(&self) -> u64;

    /// The lowest and the highest height that it gives, in 1/256 voxel. Heights outside are clamped to them, as to the
    /// lattice's [limit](crate::lattice::LIMIT). Narrow bounds are no faster; they are what
    /// [`Ground::height_range`](super::Ground::height_range) says.
    fn bounds(&self) -> (i32, i32);

    /// Writes the heights of the columns of a grid, in 1/256 voxel and in the order of [`ColumnGrid::columns`], to
    /// `heights`, which is as long as the grid.
    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]);

    /// Returns `true` if it provides materials too.
    fn has_materials(&self) -> bool {
        false
    }

    /// Fills in materials, if [`Self::has_materials`] returns `true`. On entry every place holds material 0.
    /// [`MaterialId::GROUND`](super::MaterialId::GROUND) is not a material, and becomes 0.
    fn fill_materials(&self, _grid: ColumnGrid, _materials: &mut [ColumnMaterial]) {}

    /// Bytes of memory that it takes.
    fn bytes(&self) -> usize {
        0
    }
}

impl HeightSource for Box<dyn HeightSource> {
    fn id(&self) -> u64 {
        (**self).id()
    }

    fn bounds(&self) -> (i32, i32) {
        (**self).bounds()
    }

    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
        (**self).fill_heights(grid, heights);
    }

    fn has_materials(&self) -> bool {
        (**self).has_materials()
    }

    fn fill_materials(&self, grid: ColumnGrid, materials: &mut [ColumnMaterial]) {
        (**self).fill_materials(grid, materials);
    }

    fn bytes(&self) -> usize {
        (**self).bytes()
    }
}

/// The heights that a source may give: those it promised, within the lattice's limit.
pub(super) fn checked_bounds(source: &dyn HeightSource) -> (i32, i32) {
    let (low, high) = source.bounds();
    let within = |height: i32| height.clamp(-LIMIT * ONE, LIMIT * ONE);
    (within(low.min(high)), within(high.max(low)))
}

/// A height in voxels in 1/256 voxel, halves away from zero; 0 for NaN.
fn rounded(voxels: f64) -> i32 {
    (voxels * f64::from(ONE)).round() as i32
}
