//! Whether a brush comes near a world: decides which terrains get a brush, before it is quantised and checked.

use glam::Vec3;

use super::shapes::Extent;
use super::{BAND, Shape};
use crate::lattice::{ChunkGrid, ONE};

/// Whether a shape, in voxels, comes near a world's columns. `None` if its position is not a number.
pub(crate) fn reaches(shape: &Shape, grid: ChunkGrid) -> Option<bool> {
    let (low, high) = bounds(shape)?;
    let (world, band) = (grid.edit_bounds(), (BAND / ONE) as f32);
    let (min, max) = (world.min.as_vec3() - band, world.max.as_vec3() + band);
    Some(low.cmple(max).all() && min.cmple(high).all())
}

/// A box around a shape, larger than necessary for round shapes. Invalid sizes count as 0.
fn bounds(shape: &Shape) -> Option<(Vec3, Vec3)> {
    let Extent { ends: [from, to], around } = shape.extent();
    if from.is_nan() || to.is_nan() {
        return None;
    }
    let around = Vec3::select(around.cmpgt(Vec3::ZERO), around, Vec3::ZERO);
    let (low, high) = (from.min(to) - around, from.max(to) + around);
    (!low.is_nan() && !high.is_nan()).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use glam::Quat;

    use super::*;
    use crate::brush::{Brush, Edit};

    #[test]
    fn every_edit_inside_a_world_is_near_it() {
        let (grid, mut rng) = (ChunkGrid::new(16, 64, 64), fastrand::Rng::with_seed(2));
        let (mut near, mut far) = (0, 0);
        for _ in 0..2000 {
            let mut place =
                |side: f32| Vec3::new(rng.f32() * side, rng.f32() * side, rng.f32() * side) - side / 4.0;
            let (at, arrow, half) = (place(128.0), place(16.0), place(16.0).abs() + 0.5);
            let turn = Quat::from_scaled_axis(place(8.0));
            for shape in [
                Shape::sphere(at, half.x),
                Shape::turned_cuboid(at, half, turn),
                Shape::cylinder(at, arrow + Vec3::Y * 20.0, half.x),
                Shape::capsule(at, at + arrow, half.x),
                Shape::cone(at, arrow + Vec3::Y * 20.0, half.x),
                Shape::torus(at, arrow + Vec3::Y * 20.0, half.x + half.y, half.x),
            ] {
                let edit = Edit::quantize(&Brush::dig(shape)).unwrap();
                let is_near = reaches(&shape, grid).unwrap();
                // Rounding apart: the edit's own box may be a voxel wider.
                let is_reached = edit.reach().grown(-1).intersection(grid.edit_bounds()).is_some();
                assert!(is_near || !is_reached, "{shape:?}");
                near += usize::from(is_near);
                far += usize::from(!is_near);
            }
        }
        assert!(near > 500 && far > 500, "{near} near, {far} far");
    }

    #[test]
    fn invalid_sizes_are_near_and_invalid_positions_are_not() {
        let grid = ChunkGrid::new(16, 64, 64);
        let at = Vec3::new(30.0, 8.0, 30.0);
        for radius in [f32::NAN, -3.0, 0.0, 1e9, f32::INFINITY] {
            assert_eq!(reaches(&Shape::sphere(at, radius), grid), Some(true));
        }
        assert_eq!(reaches(&Shape::sphere(at * 1e9, 3.0), grid), Some(false));
        let endless = Shape::turned_cuboid(at - 500.0, Vec3::new(f32::INFINITY, 1.0, 1.0), Quat::IDENTITY);
        assert_eq!(reaches(&endless, grid), Some(true));
        for place in [f32::NAN, f32::INFINITY] {
            let shape = Shape::capsule(at, Vec3::splat(place), 2.0);
            assert_eq!(reaches(&shape, grid).is_none(), place.is_nan());
        }
    }
}
