//! Worlds on disk: nothing that was acknowledged is ever lost, whatever happens to the process, the power or the files.

mod damage;
mod faults;
mod ground;
mod kill;
mod levels;
mod opening;
mod other_level;
mod play;
mod power;
mod random;
mod times;
#[path = "../worlds/mod.rs"]
mod worlds;
