//! Digging together: one order, the same world everywhere.

mod bots;
mod follower;
mod hostile;
mod laws;
mod link;
mod load;
mod one_hash;
mod server;
#[path = "../worlds/mod.rs"]
mod worlds;
