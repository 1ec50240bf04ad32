//! After every commit, incrementally updated data equals the same data computed from scratch: samples, bits, hash,
//! receipts, mask, meshes and shared bricks. The references here go sample by sample and cell by cell.

mod bits;
mod checked_terrain;
mod meshes;
mod naive;
mod play;
mod sameness;
mod scratch;
mod slabs;
mod soft;
mod state;
#[path = "../worlds/mod.rs"]
mod worlds;
