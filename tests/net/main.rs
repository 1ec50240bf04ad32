//! Digging together: one order, the same world everywhere.

mod bots;
mod contents;
mod fields;
mod follower;
#[allow(dead_code, reason = "the tests of the store use all of it")]
#[path = "../store/gated.rs"]
mod gated;
mod hostile;
mod joins;
mod lacking;
mod laws;
mod limits;
mod link;
mod load;
mod one_hash;
mod pair;
mod play;
mod restarts;
mod server;
mod sessions;
mod siege;
mod undo;
#[path = "../worlds/mod.rs"]
mod worlds;
