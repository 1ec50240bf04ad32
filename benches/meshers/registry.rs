//! The lists of all contenders.

use crate::contender::Contender;
use crate::{bricks, fast_surface_nets, isosurface, mcubes, ours, transvoxel};

/// All contenders for single grids. The others are compared with the first one, dense f32 with unit normals.
pub fn all() -> Vec<Box<dyn Contender>> {
    let mut all = ours::with_normals();
    all.extend(ours::without_normals());
    all.push(Box::new(fast_surface_nets::FastSurfaceNets::default()));
    all.push(Box::new(transvoxel::Transvoxel::default()));
    all.push(Box::new(mcubes::MarchingCubes::default()));
    all.push(Box::new(isosurface::MarchingCubes::default()));
    all
}

/// All contenders for the streams of chunks.
pub fn of_streams() -> Vec<Box<dyn Contender>> {
    let mut all = ours::with_normals();
    all.push(Box::new(bricks::Bricked::default()));
    all.push(Box::new(fast_surface_nets::FastSurfaceNets::default()));
    all
}
