//! After every commit, what was kept up to date is what would be made from scratch: samples, bits, hash, receipts, mask,
//! meshes, shared bricks. Everything here is counted again, one sample and one cell at a time.

mod bits;
mod meshes;
mod naive;
mod play;
mod sameness;
mod scratch;
mod slabs;
mod soft;
mod state;
mod witness;
#[path = "../worlds/mod.rs"]
mod worlds;
