//! Levels of detail: whatever was dug, and whichever nodes of the quadtree are drawn, everything together is closed.
//!
//! `BURROW_WORLDS=10000 cargo test --release --no-default-features --test lod` draws more random worlds.

#[path = "../worlds/mod.rs"]
mod worlds;

mod check;
mod random;
mod ridges;
mod same;
mod seams;
mod shares;
