//! The content of a region's record: its bricks, and the fields of chunks that belong to it.

use std::sync::Arc;

use super::bricks::{FlatBricks, put_bricks, read_bricks};
use super::bytes::Reader;
use super::error::FormatError;
use super::fields::{put_fields, read_fields};
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkPos, RegionPos};
use crate::volume::{Brick, Fields};

/// Bricks and fields, each in order.
pub type RegionParts = (Vec<(BrickPos, Arc<Brick>)>, Vec<(ChunkPos, Fields)>);

/// The bytes of bricks that lie in one region, and of fields. The same content gives the same bytes.
pub fn encode_region<'a>(
    bricks: impl IntoIterator<Item = (&'a BrickPos, &'a Arc<Brick>)>,
    fields: impl IntoIterator<Item = (&'a ChunkPos, &'a Fields)>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    put_bricks(&mut bytes, bricks.into_iter().map(|(pos, brick)| (*pos, brick.as_ref())));
    let mut fields: Vec<(ChunkPos, &Fields)> =
        fields.into_iter().map(|(chunk, fields)| (*chunk, fields)).collect();
    fields.sort_by_key(|(chunk, _)| *chunk);
    put_fields(&mut bytes, fields);
    bytes
}

/// Reads what [`encode_region`] wrote, for the region at this place over this ground. Which pristine samples are solid
/// is computed from the ground; all else is as it was, whatever ground it was written over.
///
/// # Errors
/// When anything is invalid. Memory is taken for at most 512 bricks, and for fields by the length of `bytes`.
pub fn decode_region(bytes: &[u8], region: RegionPos, ground: &Ground) -> Result<RegionParts, FormatError> {
    let mut reader = Reader(bytes);
    let bricks = read_bricks(&mut reader, region, ground, &mut FlatBricks::default())?;
    let fields = read_fields(&mut reader)?;
    reader.end()?;
    match fields.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
        Some(pair) => Err(FormatError::Fields(pair[1].0)),
        None => Ok((bricks, fields)),
    }
}

/// The key of a region's record.
pub fn region_key(RegionPos(at): RegionPos) -> Vec<u8> {
    let mut key = vec![b'r'];
    at.to_array().iter().for_each(|part| key.extend_from_slice(&part.to_be_bytes()));
    key
}

/// The region whose record has this key.
pub fn region_of_key(key: &[u8]) -> Option<RegionPos> {
    let at: &[u8; 12] = key.strip_prefix(b"r")?.try_into().ok()?;
    let [x, y, z] = [0, 4, 8].map(|from| i32::from_be_bytes(std::array::from_fn(|byte| at[from + byte])));
    Some(RegionPos([x, y, z].into()))
}
