//! Worlds on disk: a journal of commits, checkpoints of regions, recovery after a crash.

mod base_level;
mod checkpoint;
mod checkpoint_copy;
mod checkpointing;
mod closing;
mod database;
mod disk;
mod error;
mod files;
pub(crate) mod format;
mod found;
mod ground_size;
mod inspect;
mod journal;
mod keys;
mod levels;
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
mod salvage;
mod segment;
mod settle;
mod shared;
mod sources;
mod unsaved;
mod writer;

pub use base_level::{BaseLevel, LevelName};
pub use closing::ClosingStore;
pub use disk::{DiskFault, DiskImage, SimulatedDisk};
pub use error::{StoreError, StoreTrouble, WorldSize};
pub use files::{Files, Folder, Lock, OpenFile, Opening};
pub use format::frame::WorldId;
pub use format::level::{Level, LevelFiles, pack_level, read_level, unpack_level, write_level};
pub use format::portable::{
    PortableHead, PortableWorld, SavedRegion, read_portable, read_portable_head, write_portable,
};
pub use format::{Batch, FormatError, Metadata};
pub use inspect::{WorldCheck, WorldInfo, check, check_in, inspect, inspect_in, read_world, replay};
pub use levels::{RestoreLevelError, load_level, read_level_files, save_level};
pub use open_store::{Opened, Store};
pub use options::{BaseChanged, StoreOptions};
pub use portable::{Imported, from_bytes, to_bytes};
pub use progress::Progress;
pub use shared::SavePoint;
