//! Untrusted input never causes a panic, a lost edit or a broken surface.

mod brushes;
mod contents;
mod ends;
mod integers;
mod operations;
mod terrains;
mod transactions;
#[path = "../worlds/mod.rs"]
mod worlds;
