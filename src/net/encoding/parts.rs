//! Parts of messages: numbers, flags, reasons, regions, rules.

use std::sync::Arc;

use super::super::message::*;
use crate::format::bytes::{Reader, put_number};
use crate::format::fields::{point, put_point};
use crate::format::{FormatError, plain};
use crate::lattice::RegionPos;
use crate::volume::DiggingRules;

pub(super) fn within(length: usize, limit: usize) -> Result<(), FormatError> {
    if length <= limit {
        Ok(())
    } else {
        Err(FormatError::TooLarge { length: length as u64, limit: limit as u64 })
    }
}

pub(super) fn small(reader: &mut Reader) -> Result<u32, FormatError> {
    u32::try_from(reader.number()?).map_err(|_| FormatError::Invalid("number"))
}

pub(super) fn flag(reader: &mut Reader) -> Result<bool, FormatError> {
    match reader.byte()? {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(FormatError::Invalid("flag")),
    }
}

pub(super) fn index_of<T: PartialEq>(all: &[T], one: &T) -> u8 {
    debug_assert!(all.contains(one), "a reason without a number");
    all.iter().position(|other| other == one).unwrap_or_default() as u8
}

pub(super) fn at_index<T: Copy>(all: &[T], index: u8) -> Result<T, FormatError> {
    all.get(usize::from(index)).copied().ok_or(FormatError::Invalid("reason"))
}

pub(super) fn read_rules(bytes: &[u8]) -> Result<Option<Arc<DiggingRules>>, FormatError> {
    let rules: Option<DiggingRules> = plain::from_bytes(bytes, "rules")?;
    match rules.as_ref().map_or(Ok(()), DiggingRules::check) {
        Ok(()) => Ok(rules.map(Arc::new)),
        Err(_) => Err(FormatError::Invalid("rules")),
    }
}

/// Appends regions, each as the difference from the previous one, and a value for each.
pub(super) fn put_regions(
    to: &mut Vec<u8>,
    regions: impl ExactSizeIterator<Item = RegionPos>,
    mut beside: impl FnMut(&mut Vec<u8>, usize),
) {
    put_number(to, regions.len() as u64);
    let mut last = glam::IVec3::ZERO;
    for (at, region) in regions.enumerate() {
        put_point(to, region.0.wrapping_sub(last));
        last = region.0;
        beside(to, at);
    }
}

pub(super) fn read_regions<T>(
    reader: &mut Reader,
    most: usize,
    mut beside: impl FnMut(&mut Reader) -> Result<T, FormatError>,
) -> Result<Vec<(RegionPos, T)>, FormatError> {
    let count = reader.count()?;
    within(count, most)?;
    let (mut regions, mut last) = (Vec::new(), glam::IVec3::ZERO);
    for _ in 0..count {
        last = last.wrapping_add(point(reader)?);
        regions.push((RegionPos(last), beside(reader)?));
    }
    Ok(regions)
}

pub(super) fn put_hashes(to: &mut Vec<u8>, tag: u8, number: u64, hashes: &RegionHashes) {
    to.push(tag);
    put_number(to, number);
    let hash = |to: &mut Vec<u8>, at: usize| {
        let hash = hashes.get(at).map_or(0, |(_, hash)| *hash);
        to.extend_from_slice(&hash.to_le_bytes());
    };
    put_regions(to, hashes.iter().map(|(pos, _)| *pos), hash);
}

pub(super) fn read_hashes(reader: &mut Reader) -> Result<RegionHashes, FormatError> {
    read_regions(reader, usize::MAX, |reader| reader.array().map(u64::from_le_bytes))
}
