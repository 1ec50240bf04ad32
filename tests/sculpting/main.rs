//! What each sculpting operation promises, measured on the surface.

mod bookkeeping;
mod given_back;
mod measured;
mod moved;
mod planes;
mod rim;
mod smoothed;
#[path = "../worlds/mod.rs"]
mod worlds;
