//! Undo and redo: back and forth by whole steps, exact to the bit, within a budget of bytes.

mod budget;
mod hundreds;
mod named;
mod scripts;
mod state;
mod walks;
#[path = "../worlds/mod.rs"]
mod worlds;
