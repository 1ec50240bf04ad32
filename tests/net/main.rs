//! Digging together: one order, the same world everywhere.

mod follower;
mod hostile;
mod load;
mod server;
#[path = "../worlds/mod.rs"]
mod worlds;
