//! Worlds on disk: a journal of commits, checkpoints of regions, recovery after a crash.

mod checkpoint;
mod checkpointing;
mod database;
mod disk;
mod error;
mod files;
mod format;
mod found;
mod inspect;
mod journal;
mod keys;
mod mirror;
mod options;
mod portable;
mod quarantine;
mod recover;
mod salvage;
mod segment;
mod settle;
mod shared;
mod store;
mod writer;

pub use disk::{DiskFault, DiskImage, SimulatedDisk};
pub use error::{StoreError, StoreTrouble};
pub use files::{Files, Folder, Lock, OpenFile, Opening};
pub use format::frame::WorldId;
pub use inspect::{WorldCheck, WorldInfo, check, check_in, inspect, inspect_in, replay};
pub use options::{BaseChanged, StoreOptions};
pub use portable::{Imported, from_bytes, to_bytes};
pub use store::{Opened, Store};
