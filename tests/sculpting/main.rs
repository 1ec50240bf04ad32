//! What each sculpting operation promises, measured on the surface.

mod bookkeeping;
mod given_back;
mod grids;
mod measured;
mod moved;
mod neighbours;
mod paths;
mod planes;
mod rim;
mod rounded;
mod smoothed;
#[path = "../worlds/mod.rs"]
mod worlds;
