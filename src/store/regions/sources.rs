//! Files that may hold the regions of a world: the current one, and others that an interrupted step or damage left.

use std::io;

use super::database::{self, DATABASE, DatabaseError, UNFINISHED};
use super::keys::{self, Key};
use super::salvage;
use crate::format::FormatError;
use crate::format::frame::{self, Kind, WorldId};
use crate::store::checkpoints::Checkpoint;
use crate::store::error::StoreError;
use crate::store::files::{FileBytes, Files, Opening, is_refused, quarantine, read_file};
use crate::store::journal::segment::{self, FRAME_LIMIT};

/// Files in quarantine that are looked at, the latest first.
const MAX_KEPT: usize = 8;

/// The records of a file.
pub(in crate::store) enum Source {
    /// All of the file is as it was written.
    Whole(Vec<(Vec<u8>, Vec<u8>)>),
    /// The file is damaged, and these valid records were found in it.
    Damaged {
        /// In words.
        what: String,
        records: Vec<(Vec<u8>, Vec<u8>)>,
    },
    /// There is no file.
    Missing,
    /// Nothing of the file can be read at the moment.
    Unreadable(io::Error),
}

impl Source {
    /// Reads a file, and changes nothing.
    ///
    /// # Errors
    /// When a newer version wrote it, and when it must not be read.
    pub fn read(files: &dyn Files, path: &str) -> Result<Self, StoreError> {
        let again = || read_file(files, path);
        let read = match again() {
            Ok(read) => read,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::Missing),
            Err(error) if is_refused(&error) => {
                return Err(StoreError::Files { doing: "reading the regions", error });
            }
            Err(error) => return Ok(Self::Unreadable(error)),
        };
        let lost = read.unreadable_bytes();
        let what = match database::read_all(read.bytes) {
            Ok(records) if lost == 0 => return Ok(Self::Whole(records)),
            Err(DatabaseError::Newer(found)) => {
                return Err(StoreError::NewerDatabase { found, known: database::FILE_FORMAT });
            }
            Err(error) if lost == 0 => error.to_string(),
            _ => format!("{lost} bytes of the file {path} can't be read"),
        };
        let FileBytes { bytes, .. } = match again() {
            Ok(read) => read,
            Err(error) => return Ok(Self::Unreadable(error)),
        };
        Ok(Self::Damaged { what, records: salvage(&bytes) })
    }

    /// The records of the file.
    pub fn into_records(self) -> Vec<(Vec<u8>, Vec<u8>)> {
        match self {
            Self::Whole(records) | Self::Damaged { records, .. } => records,
            Self::Missing | Self::Unreadable(_) => Vec::new(),
        }
    }

    /// The records of the file.
    pub fn records(&self) -> &[(Vec<u8>, Vec<u8>)] {
        match self {
            Self::Whole(records) | Self::Damaged { records, .. } => records,
            Self::Missing | Self::Unreadable(_) => &[],
        }
    }
}

/// The valid records of a damaged file.
fn salvage(bytes: &[u8]) -> Vec<(Vec<u8>, Vec<u8>)> {
    let mut records = Vec::new();
    salvage::records(bytes, |key, record| {
        check(key, record)?;
        records.push((key.to_vec(), record.to_vec()));
        Ok(())
    });
    records
}

/// Whether a record matches its key; and the world that it belongs to.
pub(in crate::store) fn check(key: &[u8], record: &[u8]) -> Result<WorldId, FormatError> {
    let world = frame::peek(record).map(|peeked| peeked.world).unwrap_or_default();
    let open = |kind| frame::open(record, kind, world, key, FRAME_LIMIT).map(drop);
    match Key::of(key) {
        Some(Key::Checkpoint) => open(Kind::Checkpoint)?,
        Some(Key::Region(_)) => match open(Kind::Region) {
            Err(FormatError::Kind { .. }) => open(Kind::RegionChange)?,
            opened => opened?,
        },
        None => return Err(FormatError::Key),
    }
    Ok(world)
}

/// The latest checkpoint among records.
fn checkpoint_of(records: &[(Vec<u8>, Vec<u8>)]) -> Option<Checkpoint> {
    let decode = |(key, record): &(Vec<u8>, Vec<u8>)| {
        let world = frame::peek(record)?.world;
        Checkpoint::decode(&frame::open(record, Kind::Checkpoint, world, key, FRAME_LIMIT).ok()?.payload)
    };
    let own = records.iter().filter(|(key, _)| keys::CHECKPOINTS.contains(&&key[..]));
    own.filter_map(decode).max_by_key(|checkpoint| checkpoint.frame)
}

/// Whether a file holds all of a world at a frame or a later one.
pub(super) fn is_complete(files: &dyn Files, path: &str, least_frame: u64) -> bool {
    match Source::read(files, path) {
        Ok(Source::Whole(records)) => {
            checkpoint_of(&records).is_some_and(|checkpoint| checkpoint.frame >= least_frame)
        }
        _ => false,
    }
}

/// Other files that may hold regions, the most recent first.
pub(in crate::store) fn others(files: &dyn Files) -> io::Result<impl Iterator<Item = String>> {
    let kept = quarantine::of(files, DATABASE)?.into_iter().chain(quarantine::of(files, UNFINISHED)?);
    Ok(std::iter::once(UNFINISHED.to_owned()).chain(kept.take(MAX_KEPT)))
}

/// Whether a folder holds anything of a world. Files without a byte do not count, nor does one that was not complete
/// when the process ended that created the world.
pub(in crate::store) fn has_world(files: &dyn Files) -> io::Result<bool> {
    let holds_bytes = |path: &str| match files.open(path, Opening::Existing) {
        Ok(file) => Ok(file.length()? > 0),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        // It is there.
        Err(_) => Ok::<bool, io::Error>(true),
    };
    if files.exists(DATABASE)? && holds_bytes(DATABASE)? {
        return Ok(true);
    }
    for number in segment::list(files)? {
        if holds_bytes(&segment::path(number))? {
            return Ok(true);
        }
    }
    let holds_world = |path: String| match Source::read(files, &path) {
        Ok(Source::Damaged { .. }) if path == UNFINISHED => false,
        Ok(source) => checkpoint_of(source.records()).is_some(),
        Err(_) => false,
    };
    for path in others(files)? {
        if files.exists(&path)? && holds_world(path) {
            return Ok(true);
        }
    }
    Ok(false)
}
