//! The systems that run a terrain's transactions, from the game's messages to the commit, and the tasks behind them.

pub(super) mod collect;
pub(super) mod commit;
pub(super) mod engine;
pub(super) mod inbox;
pub(super) mod load;
pub(super) mod lod;
pub(super) mod outdated;
pub(super) mod phases;
pub(super) mod redraw;
pub(super) mod same_frame;
pub(super) mod task;
