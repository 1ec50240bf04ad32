//! Recovery: reads what the files of a world contain, chooses a checkpoint, and replays the journal from there.

mod choose_checkpoint;
mod found;
mod load_regions;
mod recover;
mod replay_log;
mod settle;

pub(super) use found::Contents;
pub(super) use recover::recover;
pub(super) use replay_log::replay_all;
pub(super) use settle::settle;
