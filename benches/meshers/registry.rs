//! The lists of all contenders.

use crate::contender::Contender;
use crate::{bricks, fast_surface_nets, isosurface, mcubes, ours, transvoxel};

/// Everything that meshes single grids. The first one, dense f32 with unit normals, is what the others are compared to.
pub fn all() -> Vec<Box<dyn Contender>> {
    let mut all = ours::with_normals();
    all.extend(ours::without_normals());
    all.push(Box::new(fast_surface_nets::FastSurfaceNets::default()));
    all.push(Box::new(transvoxel::Transvoxel::default()));
    all.push(Box::new(mcubes::MarchingCubes::default()));
    all.push(Box::new(isosurface::MarchingCubes::default()));
    all
}

/// What meshes the stream of chunks.
pub fn of_streams() -> Vec<Box<dyn Contender>> {
    let mut all = ours::with_normals();
    all.push(Box::new(bricks::Bricked::default()));
    all.push(Box::new(fast_surface_nets::FastSurfaceNets::default()));
    all
}
