//! Worlds on disk: nothing that was acknowledged is ever lost, whatever happens to the process, the power or the files.

mod crafted;
mod damage;
mod faults;
mod folders;
mod ground;
mod inspecting;
mod kill;
mod levels;
mod opening;
mod other_level;
mod play;
mod power;
mod promises;
mod random;
mod rebuild;
mod sectors;
mod sizes;
mod times;
#[path = "../worlds/mod.rs"]
mod worlds;
