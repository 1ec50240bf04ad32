//! Writes the file of regions: by transactions in place, or by replacing the whole file.

use std::io;

use super::database::{Change, DATABASE, DatabaseError, Records, UNFINISHED};
use super::sources;
use crate::store::files::{Files, Old, Replaced};

/// How the next checkpoint is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// By a transaction in the file that is there.
    InPlace,
    /// Into a new file, which holds all regions.
    Whole(Old),
    /// Into a new file that is as small as it can be.
    Compact,
}

/// The file of regions.
pub(in crate::store) struct RegionFile {
    open: Option<Records>,
    next: Next,
    /// An unfinished file is that of an interrupted replacement if its checkpoint is no older than this frame.
    least_frame: u64,
    /// Where the file that was replaced last is kept.
    kept: Option<String>,
}

impl RegionFile {
    /// A file that does not exist yet, or is opened when something has to be written.
    pub fn new() -> Self {
        Self { open: None, next: Next::InPlace, least_frame: 0, kept: None }
    }

    /// A file that can't be used as it is: the next checkpoint replaces it. What is left of an interrupted replacement
    /// has a checkpoint of this frame or a later one.
    pub fn damaged(least_frame: u64) -> Self {
        Self { next: Next::Whole(Old::Quarantined), least_frame, ..Self::new() }
    }

    /// Makes the next checkpoint, which must hold all regions, write a file that is as small as possible.
    pub fn compact_next(&mut self) {
        if self.next == Next::InPlace {
            self.next = Next::Compact;
        }
    }

    /// Where the file that was replaced last is kept.
    pub fn kept(&self) -> Option<&str> {
        self.kept.as_deref()
    }

    /// Opens the file where it is not open. Returns whether the next checkpoint has to hold all regions, since it goes
    /// into a new file.
    pub fn ready(&mut self, files: &dyn Files) -> Result<bool, DatabaseError> {
        if !files.exists(DATABASE)? {
            (self.open, self.next) = (None, Next::Whole(Old::Quarantined));
        }
        if self.next != Next::InPlace {
            return Ok(true);
        }
        if self.open.is_some() {
            return Ok(false);
        }
        match Records::open(files) {
            Ok(open) => {
                self.open = Some(open);
                return Ok(false);
            }
            Err(DatabaseError::Files(error)) if is_about_writing(&error) => return Err(error.into()),
            Err(error @ DatabaseError::Newer(_)) => return Err(error),
            // The world is in memory, and the file stays until a new one is complete.
            Err(DatabaseError::Missing | DatabaseError::Damaged(_) | DatabaseError::Files(_)) => {
                self.next = Next::Whole(Old::Quarantined);
            }
        }
        Ok(true)
    }

    /// Writes the records of the checkpoint at a frame, all or none: those that changed, or all of them, as
    /// [`ready`](Self::ready) says.
    pub fn write(&mut self, files: &dyn Files, frame: u64, records: &[Change]) -> Result<(), DatabaseError> {
        self.write_records(files, records)?;
        self.least_frame = frame;
        Ok(())
    }

    fn write_records(&mut self, files: &dyn Files, records: &[Change]) -> Result<(), DatabaseError> {
        if let (Some(open), Next::InPlace) = (&self.open, self.next) {
            let written = open.write(records);
            if written.is_err() {
                if open.has_failed() {
                    self.next = Next::Whole(Old::Removed);
                }
                // After an error it accepts no writes, and has to be opened again.
                self.open = None;
            }
            return written;
        }
        let (old, is_small) = match self.next {
            Next::Whole(old) => (old, false),
            Next::Compact => (Old::Removed, true),
            Next::InPlace => return Err(DatabaseError::Missing),
        };
        self.open = None;
        files.create_folder("")?;
        let file = Replaced { path: DATABASE, unfinished: UNFINISHED };
        let is_complete = || sources::is_complete(files, UNFINISHED, self.least_frame);
        let build = |path: &str| Records::create(files, path, records, is_small);
        let replaced = file.replace(files, old, is_complete, build);
        if self.next == Next::Compact {
            // It need not be tried again.
            self.next = Next::InPlace;
        }
        self.kept = replaced?.or(self.kept.take());
        self.next = Next::InPlace;
        // Else it is opened when it is needed.
        self.open = Records::open(files).ok();
        Ok(())
    }
}

/// Whether a file can't be written for a reason that another file in its place does not change.
fn is_about_writing(error: &io::Error) -> bool {
    use io::ErrorKind::{PermissionDenied, QuotaExceeded, ReadOnlyFilesystem, StorageFull, WouldBlock};
    matches!(error.kind(), PermissionDenied | QuotaExceeded | ReadOnlyFilesystem | StorageFull | WouldBlock)
}
