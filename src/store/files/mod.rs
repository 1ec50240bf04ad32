//! Access to files: an interface that a simulated disk implements too, careful reading and replacing, and quarantine.

mod interface;
pub(super) mod quarantine;
mod reading;
mod replace;
#[cfg(any(test, feature = "tools"))]
mod simulated_disk;

pub use interface::{Files, Folder, Lock, OpenFile, Opening};
pub(super) use reading::{FileBytes, is_refused, read_file};
pub(super) use replace::{Old, Replaced};
#[cfg(any(test, feature = "tools"))]
pub use simulated_disk::{DiskFault, DiskImage, SimulatedDisk};
