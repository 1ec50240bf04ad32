//! Rises of the ground around a column, and the normal and the slope that follow from them.

use glam::Vec3;

use crate::lattice::ONE;

/// Change of height along one axis around a column.
#[derive(Clone, Copy)]
pub struct Rise {
    /// Height gained, in 1/256 voxel.
    pub rise: i32,
    /// Number of voxels over which it is gained: 2, at the rim 1.
    pub run: i32,
}

/// The unit normal of the surface, from the rises along x and along z.
pub fn normal_of(rises: [Rise; 2]) -> Vec3 {
    let slope = |along: Rise| along.rise as f32 / (along.run * ONE) as f32;
    let [x, z] = rises.map(slope);
    let length = (x * x + z * z + 1.0).sqrt();
    Vec3::new(-x / length, 1.0 / length, -z / length)
}

/// Steepness as rise over run: 0 is level, 1 is 45 degrees.
pub fn slope_of(rises: [Rise; 2]) -> f64 {
    let slope = |along: Rise| f64::from(along.rise) / f64::from(along.run * ONE);
    let [x, z] = rises.map(slope);
    (x * x + z * z).sqrt()
}

/// Square of the steepness, in 1/256 voxel of rise over two voxels of run.
#[inline]
pub fn squared_slope_of(rises: [Rise; 2]) -> u64 {
    let steps = |along: Rise| match along.run {
        2 => u64::from(along.rise.unsigned_abs()),
        run => u64::from((along.rise * 2 / run).unsigned_abs()),
    };
    let [x, z] = rises.map(steps);
    x * x + z * z
}
