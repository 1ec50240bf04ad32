//! The encoding of a region's bricks.
//!
//! | part | holds |
//! | --- | --- |
//! | number | how many bricks |
//! | heads | for each brick: its place in the region, as the step from the one before, and what it stores |
//! | bitmaps | which samples are edited, for bricks where not all are |
//! | bytes after their number | [in few bits](super::residuals), how densities differ from [predicted](super::predict) ones |
//! | materials | runs over the solid edited samples of bricks that store materials |

use std::sync::Arc;

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::bytes::{Reader, put_bytes, put_number, put_signed};
use super::error::FormatError;
use super::predict::Known;
use super::residuals::{ResidualReader, ResidualWriter};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, REACH, RegionPos};
use crate::volume::layers::{ALL, Layers, count, indices};
use crate::volume::{Brick, Sample};

/// Bricks in a region.
const MAX_BRICKS: usize = 512;

/// All samples are edited.
const WHOLE: u8 = 1;
/// All samples have one density, which follows.
const FLAT: u8 = 2;
/// Materials are stored.
const MATERIALS: u8 = 4;
/// The flags of a head.
const KNOWN: u8 = WHOLE | FLAT | MATERIALS;

/// The place of a brick in its region: bricks in order have rising places.
pub fn place_of(pos: BrickPos) -> usize {
    let IVec3 { x, y, z } = pos.0 & 7;
    (x << 6 | z << 3 | y) as usize
}

pub fn position(region: RegionPos, place: usize) -> BrickPos {
    let place = place as i32;
    BrickPos(region.first_brick().0 + IVec3::new(place >> 6, place & 7, place >> 3 & 7))
}

/// The already known densities of the bricks of a region, by position.
struct Region {
    slots: [u16; MAX_BRICKS],
    bricks: Vec<[i16; 512]>,
}

impl Region {
    fn new() -> Self {
        Self { slots: [u16::MAX; MAX_BRICKS], bricks: Vec::new() }
    }

    fn enter(&mut self, place: usize, densities: [i16; 512]) {
        self.slots[place] = self.bricks.len() as u16;
        self.bricks.push(densities);
    }

    /// The known densities around a brick.
    fn around(&self, place: usize) -> Known {
        let steps = [64, 8, 1];
        let neighbours = std::array::from_fn(|number| {
            let lower = |(axis, step): (usize, usize)| match number >> axis & 1 {
                0 => Some(0),
                _ => ((place / step) & 7 != 0).then_some(step),
            };
            let back: usize = steps.into_iter().enumerate().map(lower).sum::<Option<usize>>()?;
            self.bricks.get(usize::from(self.slots[place - back]))
        });
        Known::new(&neighbours)
    }
}

/// A flag that is set if a condition holds.
fn flag(is_so: bool, flag: u8) -> u8 {
    if is_so { flag } else { 0 }
}

/// Appends bricks of one region.
pub fn put_bricks<'a>(to: &mut Vec<u8>, bricks: impl IntoIterator<Item = (BrickPos, &'a Brick)>) {
    let mut bricks: Vec<(usize, &Brick)> =
        bricks.into_iter().map(|(pos, brick)| (place_of(pos), brick)).collect();
    bricks.sort_by_key(|(place, _)| *place);
    bricks.dedup_by_key(|(place, _)| *place);
    let [mut heads, mut bitmaps, mut materials] = [const { Vec::new() }; 3];
    let mut residuals = ResidualWriter::new();
    let (mut region, mut next) = (Region::new(), 0);
    for &(place, brick) in &bricks {
        let (edited, densities) = (brick.edited(), brick.samples().map(Sample::bits));
        let is_whole = *edited == ALL;
        let is_flat = is_whole && densities.iter().all(|&density| density == densities[0]);
        let solid = || indices(edited).filter(|&index| densities[index] < 0);
        let has_materials = solid().any(|index| brick.material_at(index) != MaterialId::GROUND);
        put_number(&mut heads, (place - next) as u64);
        next = place + 1;
        heads.push(flag(is_whole, WHOLE) | flag(is_flat, FLAT) | flag(has_materials, MATERIALS));
        if is_flat {
            put_signed(&mut heads, densities[0].into());
        } else {
            if !is_whole {
                edited.iter().for_each(|layer| bitmaps.extend_from_slice(&layer.to_le_bytes()));
            }
            let mut known = region.around(place);
            for index in indices(edited) {
                let (context, predicted) = known.predict(index);
                residuals.put(context, densities[index].wrapping_sub(predicted));
                known.set(index, densities[index]);
            }
        }
        if has_materials {
            put_runs(&mut materials, solid().map(|index| brick.material_at(index)));
        }
        region.enter(place, densities);
    }
    put_number(to, bricks.len() as u64);
    to.extend_from_slice(&heads);
    to.extend_from_slice(&bitmaps);
    put_bytes(to, &residuals.end());
    to.extend_from_slice(&materials);
}

/// Bricks all of whose samples are alike, one of each kind, so that each is stored once however often it comes.
#[derive(Default)]
pub struct FlatBricks(FxHashMap<(i16, MaterialId), Arc<Brick>>);

/// A head as it is read.
struct Head {
    place: usize,
    flags: u8,
    /// The density of all samples, if they are alike.
    flat: Option<i16>,
    edited: Layers,
}

/// Reads what [`put_bricks`] wrote: bricks in order, each position once. Takes memory for at most 512 bricks.
pub fn read_bricks(
    reader: &mut Reader,
    region: RegionPos,
    ground: &Ground,
    flat_bricks: &mut FlatBricks,
) -> Result<Vec<(BrickPos, Arc<Brick>)>, FormatError> {
    if !is_possible(region) {
        return Err(FormatError::Invalid("position of a region"));
    }
    let mut heads = read_heads(reader)?;
    for head in heads.iter_mut().filter(|head| head.flags & WHOLE == 0) {
        for layer in &mut head.edited {
            *layer = u64::from_le_bytes(reader.array()?);
        }
    }
    let mut residuals = ResidualReader::new(reader.bytes()?);
    let (mut decoded, mut bricks) = (Region::new(), Vec::with_capacity(heads.len()));
    for head in &heads {
        let pos = position(region, head.place);
        let mut densities = [head.flat.unwrap_or(i16::MIN); 512];
        if head.flat.is_none() {
            let mut known = decoded.around(head.place);
            for index in indices(&head.edited) {
                let (context, predicted) = known.predict(index);
                densities[index] = residuals.next(context)?.wrapping_add(predicted);
                known.set(index, densities[index]);
            }
        }
        let materials = match head.flags & MATERIALS {
            0 => None,
            _ => Some(runs(reader, &head.edited, &densities)?),
        };
        bricks.push((pos, restored(head, pos, ground, &densities, materials, flat_bricks)?));
        decoded.enter(head.place, densities);
    }
    residuals.end()?;
    Ok(bricks)
}

fn read_heads(reader: &mut Reader) -> Result<Vec<Head>, FormatError> {
    let bricks = reader.count()?;
    if bricks > MAX_BRICKS {
        return Err(FormatError::Invalid("number of bricks"));
    }
    let (mut heads, mut next) = (Vec::with_capacity(bricks), 0);
    for _ in 0..bricks {
        let step = reader.number()?.min(MAX_BRICKS as u64);
        let place = next + step as usize;
        let flags = reader.byte()?;
        let is_known = flags & !KNOWN == 0 && (flags & FLAT == 0 || flags & WHOLE != 0);
        if place >= MAX_BRICKS || !is_known {
            return Err(FormatError::Invalid("head of a brick"));
        }
        next = place + 1;
        let flat = (flags & FLAT != 0).then(|| reader.signed()).transpose()?;
        let flat = flat.map(i16::try_from).transpose();
        let flat = flat.map_err(|_| FormatError::Invalid("density"))?;
        heads.push(Head { place, flags, flat, edited: ALL });
    }
    Ok(heads)
}

/// The brick of a head, which is checked.
fn restored(
    head: &Head,
    pos: BrickPos,
    ground: &Ground,
    densities: &[i16; 512],
    materials: Option<Vec<MaterialId>>,
    flat_bricks: &mut FlatBricks,
) -> Result<Arc<Brick>, FormatError> {
    let material = materials.as_ref().map_or(Some(MaterialId::GROUND), |all| {
        let first = *all.first()?;
        all.iter().all(|&material| material == first).then_some(first)
    });
    let kind = head.flat.zip(material);
    if let Some(known) = kind.and_then(|kind| flat_bricks.0.get(&kind)) {
        return Ok(Arc::clone(known));
    }
    let densities: Vec<i16> = indices(&head.edited).map(|index| densities[index]).collect();
    let brick = Brick::restored(ground, pos, &head.edited, &densities, materials.as_deref());
    let brick = Arc::new(brick.ok_or(FormatError::Brick(pos))?);
    if let Some(kind) = kind {
        flat_bricks.0.insert(kind, Arc::clone(&brick));
    }
    Ok(brick)
}

fn put_runs(to: &mut Vec<u8>, materials: impl Iterator<Item = MaterialId>) {
    let mut materials = materials.peekable();
    while let Some(material) = materials.next() {
        let mut more = 0;
        while materials.next_if_eq(&material).is_some() {
            more += 1;
        }
        put_number(to, more);
        to.push(material.0);
    }
}

/// Reads what [`put_runs`] wrote: materials of all edited samples, of which only solid ones have any.
fn runs(
    reader: &mut Reader,
    edited: &Layers,
    densities: &[i16; 512],
) -> Result<Vec<MaterialId>, FormatError> {
    let (mut left, mut material) = (0, MaterialId::GROUND);
    let mut materials = Vec::with_capacity(count(edited) as usize);
    for index in indices(edited) {
        if densities[index] >= 0 {
            materials.push(MaterialId::GROUND);
            continue;
        }
        if left == 0 {
            left = reader.number()?.saturating_add(1);
            material = MaterialId(reader.byte()?);
        }
        left -= 1;
        materials.push(material);
    }
    if left == 0 { Ok(materials) } else { Err(FormatError::Invalid("run of materials")) }
}

/// Whether a region can be at this position.
pub fn is_possible(region: RegionPos) -> bool {
    const MAX: i32 = REACH / RegionPos::VOXELS + 1;
    region.0.max_element() <= MAX && region.0.min_element() >= -MAX
}
