//! What a brush costs in voxels, before it is applied.

use crate::brush::{Brush, BrushError, Edit};

/// Counts the voxels within a brush's shape, roughness included: the most that it digs, adds or paints. A game that
/// charges for building checks this before it sends the brush; the receipt says what the brush really changed.
///
/// The brush is in voxels of the terrain. It is in world space as well if the terrain has a voxel size of 1 and was not
/// moved; otherwise [transform](Brush::transformed) it first. Every lattice point of the shape is visited, so this
/// takes longer for large brushes.
///
/// ```
/// use bevy::math::Vec3;
/// use bevy_burrow::plugin::voxel_cost;
/// use bevy_burrow::prelude::*;
///
/// let brush = Brush::add(Shape::sphere(Vec3::splat(8.0), 1.2), MaterialId(0));
/// // The middle and its six neighbours.
/// assert_eq!(voxel_cost(&brush), Ok(7));
/// ```
///
/// # Errors
///
/// A [`BrushError`] if the brush is not valid.
pub fn voxel_cost(brush: &Brush) -> Result<u64, BrushError> {
    let edit = Edit::quantize(brush)?;
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

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Roughness, Shape};
    use crate::ground::{Ground, MaterialId};
    use crate::terrain::{Terrain, TerrainSettings};

    #[test]
    fn a_brush_in_the_air_adds_what_it_costs() {
        let axis = Vec3::new(1.5, 2.0, -1.0);
        for (number, place) in
            [Vec3::splat(30.0), Vec3::splat(30.5), Vec3::new(30.2, 31.7, 29.4)].into_iter().enumerate()
        {
            for shape in [
                Shape::sphere(place, 3.3),
                Shape::cuboid(place, Vec3::splat(2.5)),
                Shape::capsule(place, place + axis, 2.0),
                Shape::torus(place, axis, 5.0, 1.5),
            ] {
                for roughness in [0.0, 0.8] {
                    let brush = Brush::add(shape, MaterialId(0));
                    let brush = brush.with_roughness(Roughness::new(roughness, 2.0, number as u32));
                    let ground = Ground::from_fn(64, 64, |_, _| 5.0).expect("a small world");
                    let mut terrain =
                        Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
                    let cost = voxel_cost(&brush).expect("a valid brush");
                    let receipts = terrain.apply([brush]);
                    let added = receipts[0].outcome.as_ref().expect("a valid brush").added.total();
                    assert_eq!(added, cost, "{shape:?}, roughness {roughness}");
                }
            }
        }
    }

    #[test]
    fn an_invalid_brush_has_no_cost() {
        assert!(voxel_cost(&Brush::dig(Shape::sphere(Vec3::NAN, 1.0))).is_err());
    }
}
