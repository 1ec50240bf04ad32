//! Counts the voxels that a brush covers.

use super::{Brush, BrushError, Edit};
use crate::lattice::LatticeBox;

/// Log2 of the side of cells that are looked at together.
const CELL: i32 = 6;

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
        let cells = LatticeBox { min: reach.min >> CELL, max: reach.max >> CELL };
        let (mut distances, mut voxels) = ([0; 1 << CELL], 0);
        for at in cells.points() {
            let own = LatticeBox { min: at << CELL, max: (at << CELL) + (1 << CELL) - 1 };
            // Long paths leave most of the box around them empty.
            let Some(own) = own.intersection(reach).filter(|own| !evaluator.is_out_of_reach(*own)) else {
                continue;
            };
            let row = &mut distances[..own.size().x as usize];
            for (z, y) in (own.min.z..=own.max.z).flat_map(|z| (own.min.y..=own.max.y).map(move |y| (z, y))) {
                evaluator.row(own.min.with_y(y).with_z(z), row);
                voxels += row.iter().filter(|distance| **distance < 0).count() as u64;
            }
        }
        Ok(voxels)
    }
}
