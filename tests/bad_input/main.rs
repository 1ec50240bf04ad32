//! Whatever comes in from outside: no panic, no lost edit, no broken surface.

mod brushes;
mod ends;
mod integers;
mod operations;
mod terrains;
mod transactions;
#[path = "../worlds/mod.rs"]
mod worlds;
