//! Worlds on disk: nothing that was acknowledged is ever lost, whatever happens to the process, the power or the files.

mod damage;
mod durable;
mod faults;
mod gated;
mod ground;
mod kill;
mod levels;
mod log;
mod opening;
mod other_level;
mod play;
mod power;
mod random;
mod times;
mod trouble;
#[path = "../worlds/mod.rs"]
mod worlds;
