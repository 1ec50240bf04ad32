//! The encoding of the fields of chunks.

use glam::IVec3;

use super::bytes::{Reader, put_number, put_signed};
use super::error::FormatError;
use crate::lattice::{ChunkPos, LatticeBox};
use crate::volume::{Field, FieldId, Fields};

/// Appends the fields of chunks.
pub fn put_fields<'a>(
    to: &mut Vec<u8>,
    fields: impl IntoIterator<Item = (ChunkPos, &'a Fields), IntoIter: ExactSizeIterator>,
) {
    let fields = fields.into_iter();
    put_number(to, fields.len() as u64);
    let mut last = IVec3::ZERO;
    for (ChunkPos { x, y, z }, own) in fields {
        let chunk = IVec3::new(x, y, z);
        put_point(to, chunk.wrapping_sub(last));
        last = chunk;
        put_number(to, own.len() as u64);
        let mut name = 0u64;
        for field in own.iter() {
            put_number(to, field.id.0.wrapping_sub(name));
            name = field.id.0;
            put_number(to, field.revision);
            put_point(to, field.bounds.min);
            put_point(to, field.bounds.max.wrapping_sub(field.bounds.min));
        }
    }
}

/// Reads what [`put_fields`] appended.
pub fn read_fields(reader: &mut Reader) -> Result<Vec<(ChunkPos, Fields)>, FormatError> {
    let (mut fields, mut last) = (Vec::new(), IVec3::ZERO);
    for _ in 0..reader.count()? {
        last = last.wrapping_add(point(reader)?);
        let IVec3 { x, y, z } = last;
        let (chunk, mut name, mut own) = (ChunkPos { x, y, z }, 0u64, Vec::new());
        for _ in 0..reader.count()? {
            name = name.wrapping_add(reader.number()?);
            let (revision, min) = (reader.number()?, point(reader)?);
            let bounds = LatticeBox { min, max: min.wrapping_add(point(reader)?) };
            own.push(Field { id: FieldId(name), bounds, revision });
        }
        fields.push((chunk, Fields::restored(own).ok_or(FormatError::Fields(chunk))?));
    }
    Ok(fields)
}

/// Appends a point; those near the origin are short.
pub fn put_point(to: &mut Vec<u8>, point: IVec3) {
    point.to_array().iter().for_each(|&part| put_signed(to, part.into()));
}

/// Reads what [`put_point`] appended.
pub fn point(reader: &mut Reader) -> Result<IVec3, FormatError> {
    let mut part = || i32::try_from(reader.signed()?).map_err(|_| FormatError::Invalid("point"));
    Ok(IVec3::new(part()?, part()?, part()?))
}
