//! Frames: the envelope of every part of a saved world, which detects damage, swapped parts and newer versions.
//!
//! | bytes | |
//! | --- | --- |
//! | 4 | [`MAGIC`] |
//! | 1 | schema |
//! | 1 | [`Kind`] |
//! | 1 | bit 0: packed with LZ4; bit 1: has a hash of the ground |
//! | 16 | [`WorldId`] |
//! | number, bytes | key |
//! | number | revision |
//! | 8, if any | hash of the ground below |
//! | number | bytes of the content |
//! | number, if packed | bytes that it takes here |
//! | bytes | content |
//! | 8 | XXH3 over all before |
//!
//! Integers are little-endian; a *number* is an integer of [variable length](super::bytes). In every schema the magic
//! and the schema come first and the checksum comes last.

use xxhash_rust::xxh3::xxh3_64;

use super::bytes::{Reader, put_bytes, put_number};
pub use super::error::FormatError;
pub use super::ids::{Kind, WorldId};

/// How every frame begins.
pub const MAGIC: [u8; 4] = *b"\xB5BRW";

/// The newest schema that can be read. Older ones can be read too; newer ones are refused.
pub const SCHEMA: u32 = 2;

/// The schema of levels, and of all frames but those that name content.
pub const PLAIN: u32 = 1;

/// Content is packed by at most this factor.
const MAX_PACKED: usize = 255;

/// Bytes of the checksum.
const CHECKSUM: usize = 8;

const PACKED: u8 = 1;
const GROUND: u8 = 2;

/// The content of an opened frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Opened {
    /// The revision that it was sealed with.
    pub revision: u64,
    /// The hash of the ground that it was sealed with, or 0.
    pub ground_hash: u64,
    /// Whether its content names [other content](super::contents), as since schema 2.
    #[cfg_attr(not(feature = "store"), allow(dead_code, reason = "for journals"))]
    pub is_named: bool,
    /// The frame's content.
    pub payload: Vec<u8>,
}

/// The unchecked header of a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peeked<'a> {
    /// The world that it belongs to.
    pub world: WorldId,
    /// The frame's place in that world.
    pub key: &'a [u8],
    /// How many bytes it takes.
    pub length: usize,
}

/// Wraps the content of one place of a world. `ground_hash` is 0 where no ground counts.
pub fn seal(
    kind: Kind,
    world: WorldId,
    key: &[u8],
    revision: u64,
    ground_hash: u64,
    payload: &[u8],
) -> Vec<u8> {
    let packed = packed(payload);
    sealed(PLAIN, kind, world, key, revision, ground_hash, payload, packed.as_deref())
}

/// Like [`seal`], for a payload that names content: versions that can't read names refuse it as newer.
#[cfg(feature = "store")]
pub fn seal_named(
    kind: Kind,
    world: WorldId,
    key: &[u8],
    revision: u64,
    ground_hash: u64,
    payload: &[u8],
) -> Vec<u8> {
    let packed = packed(payload);
    sealed(SCHEMA, kind, world, key, revision, ground_hash, payload, packed.as_deref())
}

/// The payload compressed, if that makes it smaller.
fn packed(payload: &[u8]) -> Option<Vec<u8>> {
    let packed = lz4_flex::block::compress(payload);
    (packed.len() + 4 < payload.len()).then_some(packed)
}

/// Seals a payload without compression, for payloads that are compressed or compared elsewhere.
pub fn seal_unpacked(kind: Kind, world: WorldId, key: &[u8], ground_hash: u64, payload: &[u8]) -> Vec<u8> {
    sealed(PLAIN, kind, world, key, 0, ground_hash, payload, None)
}

fn sealed(
    schema: u32,
    kind: Kind,
    world: WorldId,
    key: &[u8],
    revision: u64,
    ground_hash: u64,
    payload: &[u8],
    packed: Option<&[u8]>,
) -> Vec<u8> {
    let stored = packed.unwrap_or(payload);
    let mut frame = Vec::with_capacity(64 + key.len() + stored.len());
    frame.extend_from_slice(&MAGIC);
    let packed_flag = if packed.is_some() { PACKED } else { 0 };
    let flags = packed_flag | if ground_hash != 0 { GROUND } else { 0 };
    frame.extend_from_slice(&[schema as u8, kind as u8, flags]);
    frame.extend_from_slice(&world.0.to_le_bytes());
    put_bytes(&mut frame, key);
    put_number(&mut frame, revision);
    if ground_hash != 0 {
        frame.extend_from_slice(&ground_hash.to_le_bytes());
    }
    put_number(&mut frame, payload.len() as u64);
    if packed.is_some() {
        put_number(&mut frame, stored.len() as u64);
    }
    frame.extend_from_slice(stored);
    let checksum = xxh3_64(&frame);
    frame.extend_from_slice(&checksum.to_le_bytes());
    frame
}

/// A frame taken apart, but not unpacked.
struct Parts<'a> {
    kind: u8,
    world: WorldId,
    key: &'a [u8],
    revision: u64,
    ground_hash: u64,
    is_packed: bool,
    length: u64,
    stored: &'a [u8],
}

/// Takes apart what comes after the schema; returns what follows the content, too.
fn parts(after_schema: &[u8]) -> Result<(Parts<'_>, &[u8]), FormatError> {
    let mut reader = Reader(after_schema);
    let [kind, flags] = reader.array()?;
    if flags & !(PACKED | GROUND) != 0 {
        return Err(FormatError::Invalid("way of packing"));
    }
    let world = WorldId(u128::from_le_bytes(reader.array()?));
    let (key, revision) = (reader.bytes()?, reader.number()?);
    let ground_hash = if flags & GROUND == 0 { 0 } else { u64::from_le_bytes(reader.array()?) };
    let length = reader.number()?;
    let is_packed = flags & PACKED != 0;
    let stored = if is_packed { reader.number()? } else { length };
    let stored = reader.take(usize::try_from(stored).map_err(|_| FormatError::Truncated)?)?;
    Ok((Parts { kind, world, key, revision, ground_hash, is_packed, length, stored }, reader.0))
}

/// The schema, and what comes after it.
fn split_schema(bytes: &[u8]) -> Result<(u8, &[u8]), FormatError> {
    let rest = bytes.strip_prefix(&MAGIC).ok_or(FormatError::Magic)?;
    rest.split_first().map(|(&schema, rest)| (schema, rest)).ok_or(FormatError::Truncated)
}

/// The unchecked header of a frame at the front of `bytes`; `None` if no frame that this version can read begins there.
pub fn peek(bytes: &[u8]) -> Option<Peeked<'_>> {
    let (schema, rest) = split_schema(bytes).ok()?;
    let (parts, after) = (PLAIN..=SCHEMA).contains(&u32::from(schema)).then(|| parts(rest))?.ok()?;
    let length = bytes.len() - after.len() + CHECKSUM;
    (length <= bytes.len()).then_some(Peeked { world: parts.world, key: parts.key, length })
}

/// Unwraps what [`seal`] wrapped.
///
/// # Errors
/// Where `bytes` are not exactly such a frame, or one of another kind, world or key, or of more than `limit` bytes of
/// content, for which no memory is taken then.
pub fn open(
    bytes: &[u8],
    kind: Kind,
    world: WorldId,
    key: &[u8],
    limit: usize,
) -> Result<Opened, FormatError> {
    let rest = open_any_world(bytes, kind, key, limit)?;
    if rest.0 != world {
        return Err(FormatError::World { found: rest.0, expected: world });
    }
    Ok(rest.1)
}

/// Opens a frame of any world.
pub fn open_any_world(
    bytes: &[u8],
    kind: Kind,
    key: &[u8],
    limit: usize,
) -> Result<(WorldId, Opened), FormatError> {
    split_schema(bytes)?;
    let (body, checksum) = bytes.split_last_chunk::<CHECKSUM>().ok_or(FormatError::Truncated)?;
    if xxh3_64(body).to_le_bytes() != *checksum {
        return Err(FormatError::Checksum);
    }
    let (schema, rest) = split_schema(body)?;
    let schema = u32::from(schema);
    if schema > SCHEMA {
        return Err(FormatError::Newer { found: schema, known: SCHEMA });
    }
    if schema < PLAIN {
        return Err(FormatError::Invalid("schema"));
    }
    let (parts, after) = parts(rest)?;
    if !after.is_empty() {
        return Err(FormatError::Invalid("end: more follows"));
    }
    if parts.kind != kind as u8 {
        return Err(FormatError::Kind { found: parts.kind, expected: kind });
    }
    if parts.key != key {
        return Err(FormatError::Key);
    }
    let payload = unpacked(&parts, limit)?;
    let Parts { world, revision, ground_hash, .. } = parts;
    Ok((world, Opened { revision, ground_hash, is_named: schema > PLAIN, payload }))
}

/// The content.
fn unpacked(parts: &Parts, limit: usize) -> Result<Vec<u8>, FormatError> {
    let too_large = FormatError::TooLarge { length: parts.length, limit: limit as u64 };
    let length = usize::try_from(parts.length).ok().filter(|&length| length <= limit).ok_or(too_large)?;
    if !parts.is_packed {
        return Ok(parts.stored.to_vec());
    }
    if length / MAX_PACKED > parts.stored.len() {
        return Err(FormatError::Invalid("length"));
    }
    let unpacked = lz4_flex::block::decompress(parts.stored, length).ok();
    unpacked.filter(|payload| payload.len() == length).ok_or(FormatError::Invalid("packed content"))
}
