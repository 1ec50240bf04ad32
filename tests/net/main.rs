//! Digging together: one order, the same world everywhere.

mod bots;
mod follower;
mod hostile;
mod joins;
mod laws;
mod limits;
mod link;
mod load;
mod one_hash;
mod restarts;
mod server;
mod sessions;
mod siege;
#[path = "../worlds/mod.rs"]
mod worlds;
