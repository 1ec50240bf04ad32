//! Worlds on disk: a journal of commits, checkpoints of regions, recovery after a crash.

mod base_level;
mod checkpoint;
mod checkpoint_copy;
mod checkpointing;
mod choose_checkpoint;
mod closing;
mod contents;
mod database;
#[cfg(any(test, feature = "tools"))]
mod disk;
mod error;
mod files;
mod found;
mod ground_size;
mod inspect;
mod journal;
mod keys;
mod levels;
mod load_regions;
mod message;
mod mirror;
mod open_store;
mod options;
mod portable;
mod progress;
mod quarantine;
mod reading;
mod recover;
mod region;
mod region_file;
mod replace;
mod replay_log;
mod salvage;
mod segment;
mod settle;
mod shared;
mod sources;
mod unsaved;
mod writer;

pub use base_level::BaseLevel;
#[doc(hidden)]
pub use base_level::LevelName;
pub use closing::ClosingStore;
#[cfg(any(test, feature = "tools"))]
#[doc(hidden)]
pub use disk::{DiskFault, DiskImage, SimulatedDisk};
#[doc(hidden)]
pub use error::WorldSize;
pub use error::{StoreError, StoreWarning};
#[doc(hidden)]
pub use files::{Files, Folder, Lock, OpenFile, Opening};
pub use inspect::WorldInfo;
#[doc(hidden)]
pub use inspect::{WorldCheck, check_in, inspect_in, read_world, replay};
#[doc(hidden)]
pub use levels::{RestoreLevelError, read_level_files};
pub use open_store::{Opened, Store};
pub use options::{BaseChanged, StoreOptions};
pub use portable::WorldFile;
pub use progress::Progress;
pub use shared::SavePoint;
