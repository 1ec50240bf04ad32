//! What sculpting does to ground: what each operation promises, measured on the surface itself.

mod bookkeeping;
mod given_back;
mod measured;
mod moved;
mod planes;
mod rim;
mod smoothed;
#[path = "../worlds/mod.rs"]
mod worlds;
