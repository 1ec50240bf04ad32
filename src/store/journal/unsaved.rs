//! A marker file for commits that are in the journal only, so that a removed journal is noticed.
//!
//! It exists from the first durable frame after a world is opened until the world is closed with everything in a
//! checkpoint, and holds the number of the segment of that frame, twice.

use std::io;

use crate::store::files::{Files, Opening};

/// The path of the marker file.
pub(super) const UNSAVED: &str = "unsaved";

/// Records that a segment holds commits that may not be in a checkpoint.
pub(super) fn enter(files: &dyn Files, segment: u64) -> io::Result<()> {
    if files.exists(UNSAVED)? {
        // That of a process that was killed names an earlier segment.
        return Ok(());
    }
    let file = files.open(UNSAVED, Opening::New)?;
    file.write_at(0, format!("{segment} {segment}\n").as_bytes())?;
    file.sync()?;
    files.sync_folder("")
}

/// Records that all commits are in a checkpoint.
pub(in crate::store) fn clear(files: &dyn Files) -> io::Result<()> {
    if files.exists(UNSAVED)? {
        files.remove(UNSAVED)?;
        files.sync_folder("")?;
    }
    Ok(())
}

/// The segment from which on commits may be in no checkpoint: 0 if nothing is known of it, `None` if there are none.
pub(in crate::store) fn read(files: &dyn Files) -> Option<u64> {
    let bytes = match files.read(UNSAVED) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
        bytes => bytes.unwrap_or_default(),
    };
    let text = String::from_utf8(bytes).unwrap_or_default();
    let (first, second) = text.trim_end().split_once(' ').unwrap_or_default();
    first.parse().ok().filter(|_| first == second).or(Some(0))
}
