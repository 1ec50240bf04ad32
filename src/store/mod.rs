//! Worlds on disk: a journal of commits, checkpoints of regions, recovery after a crash.

mod base_level;
mod checkpoints;
mod error;
mod files;
mod inspect;
mod journal;
mod levels;
mod open_store;
mod options;
mod portable;
mod progress;
mod recovery;
mod regions;
mod store_thread;

pub use base_level::BaseLevel;
#[doc(hidden)]
pub use base_level::LevelName;
#[doc(hidden)]
pub use error::WorldSize;
pub use error::{StoreError, StoreWarning};
#[cfg(any(test, feature = "tools"))]
#[doc(hidden)]
pub use files::{DiskFault, DiskImage, SimulatedDisk};
#[doc(hidden)]
pub use files::{Files, Folder, Lock, OpenFile, Opening};
pub use inspect::WorldInfo;
#[doc(hidden)]
pub use inspect::{WorldCheck, check_in, inspect_in, read_world, replay};
pub use levels::RestoreLevelError;
#[doc(hidden)]
pub use levels::read_level_files;
pub use open_store::{Opened, Store};
pub use options::{BaseChanged, StoreOptions};
pub use portable::WorldFile;
pub use progress::Progress;
pub use store_thread::{ClosingStore, SavePoint};
