//! The encoding of patches: bricks by regions, pristine ones by position only, and fields.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::bricks::{FlatBricks, is_possible, place_of, position, put_bricks, read_bricks};
use super::bytes::{Reader, put_number};
use super::error::FormatError;
use super::fields::{point, put_fields, put_point, read_fields};
use crate::ground::Ground;
use crate::lattice::{BrickPos, RegionPos};
use crate::terrain::Patch;
use crate::volume::Brick;

/// Appends a change.
pub fn put_change(to: &mut Vec<u8>, change: &Patch) {
    let mut regions = BTreeMap::<RegionPos, (Vec<(BrickPos, &Brick)>, Vec<usize>)>::new();
    for (pos, brick) in &change.bricks {
        let (stored, pristine) = regions.entry(RegionPos::of(*pos)).or_default();
        match brick {
            Some(brick) => stored.push((*pos, brick)),
            None => pristine.push(place_of(*pos)),
        }
    }
    put_number(to, regions.len() as u64);
    for (region, (stored, mut pristine)) in regions {
        put_point(to, region.0);
        put_bricks(to, stored);
        pristine.sort_unstable();
        put_number(to, pristine.len() as u64);
        pristine.iter().for_each(|&place| put_number(to, place as u64));
    }
    put_fields(to, change.fields.iter().map(|(chunk, fields)| (*chunk, fields)));
    put_number(to, change.next_field);
}

/// Reads what [`put_change`] appended.
pub fn read_change(reader: &mut Reader, ground: &Ground) -> Result<Patch, FormatError> {
    let (mut bricks, mut flat_bricks) = (Vec::<(BrickPos, Option<Arc<Brick>>)>::new(), FlatBricks::default());
    for _ in 0..reader.count()? {
        let region = RegionPos(point(reader)?);
        if !is_possible(region) {
            return Err(FormatError::Invalid("position of a region"));
        }
        let stored = read_bricks(reader, region, ground, &mut flat_bricks)?;
        bricks.extend(stored.into_iter().map(|(pos, brick)| (pos, Some(brick))));
        for _ in 0..reader.count()? {
            let place = usize::try_from(reader.number()?).ok().filter(|&place| place < 512);
            let place = place.ok_or(FormatError::Invalid("place of a brick"))?;
            bricks.push((position(region, place), None));
        }
    }
    bricks.sort_by_key(|(pos, _)| *pos);
    if let Some(pair) = bricks.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(FormatError::Brick(pair[0].0));
    }
    Ok(Patch { bricks, fields: read_fields(reader)?, next_field: reader.number()? })
}
