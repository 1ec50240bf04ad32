//! Counts the voxels that a brush covers.

use super::{Brush, BrushError, Edit};

impl Brush {
    /// Counts the voxels within the brush's shape, roughness included: the most that it digs, adds or paints. A game
    /// that charges for building checks this before it sends the brush; the receipt says what the brush really changed.
    ///
    /// The brush must be in voxels of the terrain. A brush in world space is that if the terrain has a voxel size of 1
    /// and was not moved; otherwise [transform](Brush::transformed) it first. Every lattice point of the shape is
    /// visited.
    ///
    /// ```
    /// use bevy_burrow::prelude::*;
    /// use glam::Vec3;
    ///
    /// let brush = Brush::add(Shape::sphere(Vec3::splat(8.0), 1.2), MaterialId(0));
    /// // The middle and its six neighbours.
    /// assert_eq!(brush.voxel_count(), Ok(7));
    /// ```
    ///
    /// # Errors
    /// A [`BrushError`] if the brush is not valid.
    pub fn voxel_count(&self) -> Result<u64, BrushError> {
        let edit = Edit::quantize(self)?;
        let (reach, evaluator) = (edit.reach(), edit.evaluator());
        let mut distances = vec![0; reach.size().x as usize];
        let mut voxels = 0;
        for z in reach.min.z..=reach.max.z {
            for y in reach.min.y..=reach.max.y {
                evaluator.row(reach.min.with_y(y).with_z(z), &mut distances);
                voxels += distances.iter().filter(|distance| **distance < 0).count() as u64;
            }
        }
        Ok(voxels)
    }
}
