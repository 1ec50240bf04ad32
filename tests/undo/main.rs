//! Undo and redo: whole steps in both directions, exact to the bit, within a budget of bytes.

mod budget;
mod hundreds;
mod named;
mod scripts;
mod state;
mod walks;
#[path = "../worlds/mod.rs"]
mod worlds;
