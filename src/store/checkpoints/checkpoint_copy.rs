//! A copy of the last checkpoint in a separate file, because both copies in the database may be in one sector.

use std::io;

use crate::format::FormatError;
use crate::format::frame::{self, Kind, WorldId};
use crate::store::files::{Files, Opening, quarantine};
use crate::store::journal::segment::{FOLDER, FRAME_LIMIT};

/// The file, and its name while it is not complete.
const PATHS: [&str; 2] = ["journal/checkpoint", "journal/checkpoint.new"];

const KEY: &[u8] = b"copy";

/// Writes a copy of a checkpoint in place of the last one.
pub(in crate::store) fn write(
    files: &dyn Files,
    world: WorldId,
    revision: u64,
    checkpoint: &[u8],
) -> io::Result<()> {
    let [complete, unfinished] = PATHS;
    files.create_folder(FOLDER)?;
    remove(files, unfinished)?;
    let file = files.open(unfinished, Opening::New)?;
    file.write_at(0, &frame::seal(Kind::Checkpoint, world, KEY, revision, 0, checkpoint))?;
    file.sync()?;
    drop(file);
    remove(files, complete)?;
    files.rename(unfinished, complete)?;
    files.sync_folder(FOLDER)
}

/// Removes a file. If there is a folder in its place, it is moved aside, because otherwise nothing could be saved.
fn remove(files: &dyn Files, path: &str) -> io::Result<()> {
    use io::ErrorKind::{IsADirectory, NotFound, PermissionDenied};
    match files.remove(path) {
        Err(error) if matches!(error.kind(), IsADirectory | PermissionDenied) => {
            quarantine::file(files, path).map(drop).map_err(|_| error)
        }
        Err(error) if error.kind() != NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The copies of a world's checkpoint that are there, which may be damaged.
pub(in crate::store) fn read(files: &dyn Files, world: WorldId) -> Vec<Result<Vec<u8>, FormatError>> {
    let read = PATHS.into_iter().filter_map(|path| files.read(path).ok());
    let open = |bytes: Vec<u8>| frame::open(&bytes, Kind::Checkpoint, world, KEY, FRAME_LIMIT);
    read.map(open).map(|opened| opened.map(|opened| opened.payload)).collect()
}
