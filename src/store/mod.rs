//! Worlds on disk: a journal of commits, checkpoints of regions, recovery after a crash.

mod format;
