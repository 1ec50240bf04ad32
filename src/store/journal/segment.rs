//! Segments of the journal: files with sequences of frames. Frames are numbered from 1 through all segments.
//!
//! | bytes | of each entry |
//! | --- | --- |
//! | 4 | length of the frame, little-endian |
//! | 8 | number of the frame, little-endian; 0 is the segment's head |
//! | length | the frame, which is sealed with its number as its key |

use std::collections::BTreeSet;
use std::io;
use std::ops::{Range, RangeBounds};

use super::contents::FoundContents;
use crate::format::frame::{self, Kind, WorldId};
use crate::format::ids::ContentId;
use crate::format::{Batch, FormatError};
use crate::ground::Ground;
use crate::store::base_level::LevelName;
use crate::store::files::{Files, is_refused, read_file};
use crate::terrain::Terrain;

/// The folder of segments, and of the content that they name.
pub(in crate::store) use super::contents::FOLDER;

/// Bytes before each frame.
const PREFIX: usize = 12;

/// The most bytes that a frame may hold once it is unpacked.
pub(in crate::store) const FRAME_LIMIT: usize = 256 << 20;

/// Bytes that a file system keeps together: a file takes whole ones.
const BLOCK: u64 = 4096;

/// Bytes that a file of this length takes on the disk.
pub(in crate::store) fn on_disk(length: u64) -> u64 {
    length.next_multiple_of(BLOCK)
}

/// The path of a segment.
pub(in crate::store) fn path(segment: u64) -> String {
    format!("{FOLDER}/{segment:08}.log")
}

/// The greatest number of a segment, a frame or a revision that is read, so that counting cannot overflow. No real
/// world reaches it.
pub(in crate::store) const MAX_NUMBER: u64 = 1 << 60;

/// The segment with this file name. Files that do not belong to the store have other names.
fn number_of(name: &str) -> Option<u64> {
    let number = name.strip_suffix(".log")?.parse().ok().filter(|number| *number <= MAX_NUMBER)?;
    path(number).ends_with(&format!("/{name}")).then_some(number)
}

/// The numbers of all segments, in order.
pub(in crate::store) fn list(files: &dyn Files) -> io::Result<Vec<u64>> {
    let mut numbers: Vec<u64> = files.list(FOLDER)?.iter().filter_map(|name| number_of(name)).collect();
    numbers.sort_unstable();
    Ok(numbers)
}

/// The key with which a frame is sealed; heads have the number of their segment in place of the frame's.
fn key(frame: u64) -> [u8; 8] {
    frame.to_be_bytes()
}

/// Names a ground by its hash, the level on it, and how edits change them: frames that were written under another name
/// can't be replayed exactly.
pub(in crate::store) fn base(ground: u64, level: Option<&LevelName>) -> u64 {
    let level = level.map_or(0, |level| level.hash.rotate_left(1));
    // Any odd number keeps simulations apart.
    ground ^ level ^ u64::from(Terrain::SIMULATION).wrapping_mul(0x9E37_79B9_7F4A_7C15)
}

/// An entry of a segment.
pub(in crate::store) fn entry(
    world: WorldId,
    base: u64,
    frame: u64,
    revision: u64,
    payload: &[u8],
) -> Vec<u8> {
    sealed_entry(frame, &frame::seal(Kind::Journal, world, &key(frame), revision, base, payload))
}

/// An entry of a segment whose commits name content.
pub(super) fn named_entry(world: WorldId, base: u64, frame: u64, revision: u64, payload: &[u8]) -> Vec<u8> {
    sealed_entry(frame, &frame::seal_named(Kind::Journal, world, &key(frame), revision, base, payload))
}

/// The first entry of a segment: a checkpoint, from whose state on its frames lead.
pub(super) fn head(world: WorldId, segment: u64, revision: u64, checkpoint: &[u8]) -> Vec<u8> {
    sealed_entry(0, &frame::seal(Kind::Checkpoint, world, &key(segment), revision, 0, checkpoint))
}

fn sealed_entry(number: u64, sealed: &[u8]) -> Vec<u8> {
    let mut entry = Vec::with_capacity(PREFIX + sealed.len());
    // Frames are shorter than their limit.
    entry.extend_from_slice(&(sealed.len() as u32).to_le_bytes());
    entry.extend_from_slice(&number.to_le_bytes());
    entry.extend_from_slice(sealed);
    entry
}

/// A frame as it was found.
#[derive(Clone, Debug)]
pub(in crate::store) struct Frame {
    pub number: u64,
    /// The [base] that it was written on.
    pub base: u64,
    world: WorldId,
    /// The names of the content of its edits; `None` if these hold it whole.
    pub names: Option<Vec<ContentId>>,
    /// The frame's bytes, which hold the commits. Unpacked they may be far more.
    sealed: Box<[u8]>,
    /// Where its entry is in its segment.
    pub range: Range<usize>,
}

impl Frame {
    /// The commits in it, over the ground of the world.
    ///
    /// # Errors
    /// When anything is invalid, or [`FormatError::ContentMissing`].
    pub fn batch(&self, ground: &Ground, contents: &FoundContents) -> Result<Batch, FormatError> {
        let payload = self.payload()?;
        match &self.names {
            Some(names) => Batch::decode_named(&payload, ground, &contents.table(names)),
            None => Batch::decode(&payload, ground),
        }
    }

    /// The commits in it without the content of their edits. Revisions and hashes depend on no ground.
    pub fn batch_without_content(&self, any_ground: &Ground) -> Result<Batch, FormatError> {
        let payload = self.payload()?;
        match &self.names {
            Some(_) => Batch::decode_without_content(&payload, any_ground),
            None => Batch::decode(&payload, any_ground),
        }
    }

    fn payload(&self) -> Result<Vec<u8>, FormatError> {
        let opened = frame::open(&self.sealed, Kind::Journal, self.world, &key(self.number), FRAME_LIMIT);
        opened.map(|opened| opened.payload)
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.sealed.len()
    }
}

/// A part of a segment that is not an entry.
#[derive(Clone, Debug)]
pub(in crate::store) struct Bad {
    pub range: Range<usize>,
    /// The frame whose entry may have begun there.
    pub number: Option<u64>,
}

/// A segment as it was found.
#[derive(Debug, Default)]
pub(in crate::store) struct Found {
    pub number: u64,
    /// The world that it says it belongs to.
    pub world: Option<WorldId>,
    /// The segment's head as it is stored.
    head: Option<Box<[u8]>>,
    pub frames: Vec<Frame>,
    /// Parts that are not entries.
    pub bad: Vec<Bad>,
    pub length: usize,
    /// The schema of a frame that is newer than what can be read.
    pub newer: Option<u32>,
    /// Why nothing of it can be read at the moment.
    pub error: Option<io::Error>,
}

impl Found {
    /// The names of content in its frames with these numbers.
    pub fn names(&self, numbers: impl RangeBounds<u64>) -> BTreeSet<ContentId> {
        let frames = self.frames.iter().filter(|frame| numbers.contains(&frame.number));
        frames.flat_map(|frame| frame.names.iter().flatten()).copied().collect()
    }

    /// The checkpoint of its head.
    pub fn checkpoint(&self) -> Option<Vec<u8>> {
        let (head, key) = (self.head.as_ref()?, key(self.number));
        frame::open(head, Kind::Checkpoint, self.world?, &key, FRAME_LIMIT).ok().map(|opened| opened.payload)
    }
}

/// Reads a segment of a world, or of whatever world its head names.
pub(in crate::store) fn read(files: &dyn Files, world: Option<WorldId>, number: u64) -> io::Result<Found> {
    let mut found = Found { number, world, ..Found::default() };
    let bytes = match read_file(files, &path(number)) {
        Ok(read) => read.bytes,
        Err(error) if is_refused(&error) => return Err(error),
        Err(error) => {
            found.error = Some(error);
            found.bad.push(Bad { range: 0..0, number: None });
            return Ok(found);
        }
    };
    found.length = bytes.len();
    let (mut at, mut bad) = (0, 0);
    // Each byte is looked at a few times at most, whatever the lengths of entries say.
    let mut budget = bytes.len().saturating_mul(8);
    let enter_bad = |found: &mut Found, range: Range<usize>| {
        if !range.is_empty() {
            let number = bytes.get(range.start + 4..range.start + PREFIX).and_then(<[u8]>::first_chunk);
            let number = number.map(|number| u64::from_le_bytes(*number));
            found.bad.push(Bad { range, number });
        }
    };
    while at < bytes.len() {
        match read_entry(&bytes, at, &mut found, &mut budget) {
            Some(end) => {
                enter_bad(&mut found, bad..at);
                (at, bad) = (end, end);
            }
            None => at = next_magic(&bytes, at + 1),
        }
    }
    enter_bad(&mut found, bad..bytes.len());
    Ok(found)
}

/// Where the next entry may begin.
fn next_magic(bytes: &[u8], from: usize) -> usize {
    let magic = &frame::MAGIC;
    let rest = bytes.get(from + PREFIX..).unwrap_or_default();
    rest.windows(magic.len()).position(|window| window == magic).map_or(bytes.len(), |at| from + at)
}

/// Reads the entry at an offset; returns its end.
fn read_entry(bytes: &[u8], at: usize, found: &mut Found, budget: &mut usize) -> Option<usize> {
    let prefix: &[u8; PREFIX] = bytes.get(at..)?.first_chunk()?;
    let (length, number) = prefix.split_first_chunk::<4>()?;
    let length = u32::from_le_bytes(*length) as usize;
    let frame_number = u64::from_le_bytes(number.try_into().ok()?);
    if frame_number > MAX_NUMBER {
        return None;
    }
    let start = at + PREFIX;
    let end = start.checked_add(length)?;
    let sealed = bytes.get(start..end)?;
    *budget = budget.checked_sub(sealed.len())?;
    let (kind, own) = match frame_number {
        0 => (Kind::Checkpoint, key(found.number)),
        _ => (Kind::Journal, key(frame_number)),
    };
    let world = match found.world {
        Some(world) => world,
        None => frame::peek(sealed)?.world,
    };
    match frame::open(sealed, kind, world, &own, FRAME_LIMIT) {
        Ok(opened) => {
            found.world = Some(world);
            let sealed = sealed.into();
            if frame_number == 0 {
                found.head = Some(sealed);
            } else {
                let base = opened.ground_hash;
                let names = opened.is_named.then(|| Batch::names(&opened.payload).unwrap_or_default());
                found.frames.push(Frame { number: frame_number, base, world, names, sealed, range: at..end });
            }
            Some(end)
        }
        Err(error) => {
            if let Some(schema) = error.newer_schema() {
                found.newer = Some(schema);
            }
            None
        }
    }
}
