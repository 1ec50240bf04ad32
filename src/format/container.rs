//! Several frames in one file.
//!
//! | bytes | |
//! | --- | --- |
//! | 4 | [`MAGIC`] |
//! | 4 | length of the head, little-endian |
//! | length | the head, a [frame](super::frame) listing the length and checksum of every other frame |
//! | | the other frames |
//!
//! The first three are the same in every schema.

use xxhash_rust::xxh3::xxh3_64;

use super::bytes::{Reader, put_bytes, put_number};
use super::error::FormatError;
use super::frame::{self, Kind, WorldId};
use super::limits::check;

/// How every file begins.
const MAGIC: [u8; 4] = *b"\xB5BUR";

/// The key of every head.
const KEY: &[u8] = b"head";

/// Bytes that each frame takes in the head, at least.
const ENTRY: usize = 9;

/// A file taken apart.
pub struct Container<'a> {
    pub world: WorldId,
    /// The part of its head that does not describe frames.
    pub data: Vec<u8>,
    /// Frames with the lengths and checksums that the head names.
    pub frames: Vec<&'a [u8]>,
}

/// A file of frames; `data` is additional data in its head.
///
/// # Errors
/// When the head would have more bytes than `limit`.
pub fn write(
    kind: Kind,
    world: WorldId,
    data: &[u8],
    frames: &[Vec<u8>],
    limit: usize,
) -> Result<Vec<u8>, FormatError> {
    let mut head = Vec::new();
    put_bytes(&mut head, data);
    put_number(&mut head, frames.len() as u64);
    for frame in frames {
        put_number(&mut head, frame.len() as u64);
        head.extend_from_slice(&xxh3_64(frame).to_le_bytes());
    }
    check(&head, limit)?;
    let head = frame::seal(kind, world, KEY, 0, 0, &head);
    let mut file = MAGIC.to_vec();
    // A head is shorter than its limit.
    file.extend_from_slice(&(head.len() as u32).to_le_bytes());
    file.extend_from_slice(&head);
    frames.iter().for_each(|frame| file.extend_from_slice(frame));
    Ok(file)
}

/// Takes a file apart.
///
/// # Errors
/// When it is not a file of this kind, when it is cut off, when a frame is not the one that the head names, or when the
/// head has more bytes than `limit`.
pub fn read(kind: Kind, file: &[u8], limit: usize) -> Result<Container<'_>, FormatError> {
    let (world, head, mut rest) = read_head(kind, file, limit)?;
    let mut reader = Reader(&head);
    let data = reader.bytes()?.to_vec();
    let count = entries(&mut reader)?;
    let mut frames = Vec::with_capacity(count);
    for _ in 0..count {
        let length = usize::try_from(reader.number()?).map_err(|_| FormatError::Truncated)?;
        let checksum = u64::from_le_bytes(reader.array()?);
        let frame = rest.take(length)?;
        if xxh3_64(frame) != checksum {
            return Err(FormatError::Checksum);
        }
        frames.push(frame);
    }
    reader.end()?;
    rest.end()?;
    Ok(Container { world, data, frames })
}

/// The world and the additional data in the head, without reading the frames.
pub fn read_own(kind: Kind, file: &[u8], limit: usize) -> Result<(WorldId, Vec<u8>), FormatError> {
    let (world, head, _) = read_head(kind, file, limit)?;
    Ok((world, Reader(&head).bytes()?.to_vec()))
}

fn read_head(kind: Kind, file: &[u8], limit: usize) -> Result<(WorldId, Vec<u8>, Reader<'_>), FormatError> {
    let mut reader = Reader(file.strip_prefix(&MAGIC).ok_or(FormatError::Magic)?);
    let length = u32::from_le_bytes(reader.array()?);
    let (world, opened) = frame::open_any_world(reader.take(length as usize)?, kind, KEY, limit)?;
    Ok((world, opened.payload, reader))
}

/// The number of frames: no more than the head has bytes for.
fn entries(reader: &mut Reader) -> Result<usize, FormatError> {
    let count = reader.count()?;
    if count > reader.0.len() / ENTRY { Err(FormatError::Truncated) } else { Ok(count) }
}
