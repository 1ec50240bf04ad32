//! Replacing a file by another one: the only way in which files are ever replaced.
//!
//! 1. The complete new file is written next to the old one, and made durable.
//! 2. The old one is moved to quarantine, or removed where the new one holds all that it held.
//! 3. The new one gets its name.
//!
//! At each moment at least one of them is complete. If a step was interrupted, `store::regions::sources` reads the file
//! that is there, and the next replacement finishes the step first.

use std::io;

use super::interface::{Files, Opening};
use super::quarantine;

/// The treatment of the replaced file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Old {
    /// The file may be damaged: it is kept in quarantine.
    Quarantined,
    /// The file held nothing that the new one does not hold.
    Removed,
}

/// A file that may be replaced.
#[derive(Clone, Copy, Debug)]
pub(in crate::store) struct Replaced<'a> {
    /// The file's path.
    pub path: &'a str,
    /// The path of one that is not complete yet.
    pub unfinished: &'a str,
}

impl Replaced<'_> {
    /// Replaces the file by one that `build` writes at the path that it is given, and makes durable. Returns the path
    /// of the kept old file, if there is one. `is_complete` checks whether an unfinished file may replace the old one.
    pub fn replace<E: From<io::Error>>(
        self,
        files: &dyn Files,
        old: Old,
        is_complete: impl FnOnce() -> bool,
        build: impl FnOnce(&str) -> Result<(), E>,
    ) -> Result<Option<String>, E> {
        let mut kept = None;
        let mut old = old;
        if files.exists(self.unfinished)? {
            if is_complete() {
                kept = self.put_in_place(files, old)?;
                // The present file is complete.
                old = Old::Removed;
            } else if files.exists(self.path)? {
                files.remove(self.unfinished)?;
            } else {
                drop(quarantine::file(files, self.unfinished)?);
            }
        }
        if let Err(error) = build(self.unfinished) {
            // The unfinished file takes space, and is removed at the next try at the latest.
            drop(files.remove(self.unfinished));
            return Err(error);
        }
        let last = self.put_in_place(files, old)?;
        Ok(kept.or(last))
    }

    /// Replaces the old file by the unfinished one, which is complete.
    fn put_in_place(self, files: &dyn Files, old: Old) -> io::Result<Option<String>> {
        let folder = self.path.rsplit_once('/').map_or("", |(folder, _)| folder);
        // A killed process may not have synced it.
        files.open(self.unfinished, Opening::Existing)?.sync()?;
        files.sync_folder(folder)?;
        let mut kept = None;
        if files.exists(self.path)? {
            let is_empty = files.open(self.path, Opening::Existing)?.length()? == 0;
            if old == Old::Quarantined && !is_empty {
                kept = Some(quarantine::file(files, self.path)?);
            } else {
                files.remove(self.path)?;
                files.sync_folder(folder)?;
            }
        }
        files.rename(self.unfinished, self.path)?;
        files.sync_folder(folder)?;
        Ok(kept)
    }
}
