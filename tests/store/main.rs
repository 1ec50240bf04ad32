//! Worlds on disk: nothing that was acknowledged is ever lost, whatever happens to the process, the power or the files.

mod contents;
mod crafted;
mod damage;
mod durable;
mod faults;
mod folders;
mod gated;
mod ground;
mod inspecting;
mod kill;
mod levels;
mod log;
mod opening;
mod other_level;
mod play;
mod power;
mod promises;
mod random;
mod rebuild;
mod sectors;
mod sizes;
mod trouble;
#[path = "../worlds/mod.rs"]
mod worlds;
