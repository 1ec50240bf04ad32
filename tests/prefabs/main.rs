//! Copy and paste: a prefab pasted is the place that it was copied from, in memory, in files, in saves and over the
//! network. `BURROW_WORLDS` is the number of random worlds.

mod files;
mod laws;
mod mixed;
mod shared;
mod turns;
#[path = "../worlds/mod.rs"]
mod worlds;
