//! A whole world in one file, `.burrow`: to share it, and to keep it where there are no folders.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::batch::Batch;
use super::error::FormatError;
use super::frame::{self, Kind, WorldId};
use super::limits::{Limits, within};
use super::metadata::Metadata;
use super::region::{decode_region, encode_region, region_key, region_of_key};
use super::{container, plain};
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkPos, RegionPos};
use crate::terrain::{Patch, WorldParts};
use crate::volume::{Brick, Fields};

/// A region as it is saved.
#[derive(Clone, Debug, Default)]
pub struct SavedRegion {
    /// The revision that changed it last.
    pub revision: u64,
    /// The [hash](Ground::region_hash) of the ground that it was saved over.
    pub ground_hash: u64,
    /// The region's bricks, in order.
    pub bricks: Vec<(BrickPos, Arc<Brick>)>,
    /// The fields of the chunks whose lowest corners lie in it, in order.
    pub fields: Vec<(ChunkPos, Fields)>,
}

impl SavedRegion {
    pub(crate) fn encode(&self) -> Vec<u8> {
        let bricks = self.bricks.iter().map(|(pos, brick)| (pos, brick));
        encode_region(bricks, self.fields.iter().map(|(chunk, fields)| (chunk, fields)))
    }

    pub(super) fn decode(
        opened: &frame::Opened,
        at: RegionPos,
        ground: &Ground,
    ) -> Result<Self, FormatError> {
        let (bricks, fields) = decode_region(&opened.payload, at, ground)?;
        Ok(Self { revision: opened.revision, ground_hash: opened.ground_hash, bricks, fields })
    }
}

/// The content of a portable file.
#[derive(Clone, Debug, Default)]
pub struct PortableWorld {
    /// The world's name.
    pub world: WorldId,
    /// The world without its regions.
    pub metadata: Metadata,
    /// Regions that hold anything.
    pub regions: BTreeMap<RegionPos, SavedRegion>,
    /// Commits that led to it, if they are kept, in order.
    pub journal: Vec<Batch>,
}

/// The head of a portable file, which can be read without the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PortableHead {
    /// The world without its regions.
    pub metadata: Metadata,
    /// How many regions hold anything.
    pub regions: u64,
    /// How many frames of commits follow.
    pub journal: u64,
}

impl PortableWorld {
    /// A world without its journal. The metadata's revision, rules, settings of loose pieces, names and chunk size are
    /// those of the parts.
    pub fn new(world: WorldId, metadata: Metadata, parts: WorldParts, ground: &Ground) -> Self {
        let WorldParts { change, chunk_size, revision, edit_settings } = parts;
        let (mut metadata, next_field) = (metadata, change.next_field);
        metadata.settings.chunk_size = chunk_size;
        let metadata = Metadata { revision, edit_settings, next_field, ..metadata };
        Self {
            world,
            metadata,
            regions: by_region(change, chunk_size, revision, ground),
            journal: Vec::new(),
        }
    }

    /// The world's parts, of which [`Terrain::restore`](crate::terrain::Terrain::restore) makes a terrain.
    pub fn parts(&self) -> WorldParts {
        let Metadata { settings, revision, next_field, edit_settings, .. } = &self.metadata;
        let change = of_regions(&self.regions, *next_field);
        let (chunk_size, edit_settings) = (settings.chunk_size, edit_settings.clone());
        WorldParts { change, chunk_size, revision: *revision, edit_settings }
    }
}

/// Cuts a world into regions. Fields belong to the region with their chunk's lowest corner.
pub fn by_region(
    change: Patch,
    chunk_size: u32,
    revision: u64,
    ground: &Ground,
) -> BTreeMap<RegionPos, SavedRegion> {
    let mut regions = BTreeMap::<RegionPos, SavedRegion>::new();
    let new = |at: RegionPos| {
        let ground_hash = ground.region_hash(at.column());
        SavedRegion { revision, ground_hash, ..SavedRegion::default() }
    };
    for (pos, brick) in change.bricks {
        let at = RegionPos::of(pos);
        if let Some(brick) = brick {
            regions.entry(at).or_insert_with(|| new(at)).bricks.push((pos, brick));
        }
    }
    for (chunk, fields) in change.fields {
        let size = chunk_size.cast_signed();
        let corner = [chunk.x, chunk.y, chunk.z].map(|at| at.saturating_mul(size));
        let at = RegionPos::of(BrickPos::of(corner.into()));
        if !fields.is_empty() {
            regions.entry(at).or_insert_with(|| new(at)).fields.push((chunk, fields));
        }
    }
    for region in regions.values_mut() {
        region.bricks.sort_by_key(|(pos, _)| *pos);
        region.fields.sort_by_key(|(chunk, _)| *chunk);
    }
    regions
}

/// Joins regions to a world.
pub fn of_regions(regions: &BTreeMap<RegionPos, SavedRegion>, next_field: u64) -> Patch {
    let mut change = Patch { next_field, ..Patch::default() };
    for region in regions.values() {
        change.bricks.extend(region.bricks.iter().map(|(pos, brick)| (*pos, Some(Arc::clone(brick)))));
        change.fields.extend_from_slice(&region.fields);
    }
    change.bricks.sort_by_key(|(pos, _)| *pos);
    change.fields.sort_by_key(|(chunk, _)| *chunk);
    change
}

/// The bytes of a portable file. The same world gives the same bytes.
///
/// # Errors
/// [`FormatError::TooLarge`] when a part has more bytes than can be read again: 256 MiB for data of the game's and the
/// list of regions, 256 MiB for a frame of commits, and 8 MiB for a region, which bricks and fields of a terrain never
/// take.
pub fn write_portable(portable: &PortableWorld) -> Result<Vec<u8>, FormatError> {
    write_within(portable, &Limits::FORMAT)
}

pub(crate) fn write_within(portable: &PortableWorld, limits: &Limits) -> Result<Vec<u8>, FormatError> {
    let PortableWorld { world, metadata, regions, journal } = portable;
    let head = PortableHead {
        metadata: metadata.clone(),
        regions: regions.len() as u64,
        journal: journal.len() as u64,
    };
    let region = |(at, region): (&RegionPos, &SavedRegion)| {
        let SavedRegion { revision, ground_hash, .. } = *region;
        let content = within(region.encode(), limits.region)?;
        Ok(frame::seal(Kind::Region, *world, &region_key(*at), revision, ground_hash, &content))
    };
    let batch = |(number, batch): (u64, &Batch)| {
        let revision = batch.commits.last().map_or(0, |last| last.revision);
        let content = within(batch.encode(), limits.journal)?;
        Ok(frame::seal(Kind::Journal, *world, &number.to_be_bytes(), revision, 0, &content))
    };
    let frames = regions.iter().map(region).chain((1..).zip(journal).map(batch));
    let frames = frames.collect::<Result<Vec<Vec<u8>>, FormatError>>()?;
    container::write(Kind::Portable, *world, &plain::to_bytes(&head), &frames, limits.head)
}

/// Reads what [`write_portable`] wrote, over the ground of the world.
///
/// # Errors
/// When anything in the file is damaged or invalid. Memory is taken by the length of the file, and by a limit for each
/// frame.
pub fn read_portable(file: &[u8], ground: &Ground) -> Result<PortableWorld, FormatError> {
    read_within(file, ground, &Limits::FORMAT)
}

pub(crate) fn read_within(
    file: &[u8],
    ground: &Ground,
    limits: &Limits,
) -> Result<PortableWorld, FormatError> {
    let container = container::read(Kind::Portable, file, limits.head)?;
    let (world, head) = (container.world, portable_head(&container.data)?);
    let regions = usize::try_from(head.regions).ok().filter(|&regions| regions <= container.frames.len());
    let (regions, batches) = container.frames.split_at(regions.ok_or(FormatError::Truncated)?);
    if head.journal != batches.len() as u64 {
        return Err(FormatError::Truncated);
    }
    let mut portable = PortableWorld { world, metadata: head.metadata, ..PortableWorld::default() };
    for sealed in regions {
        let peeked = frame::peek(sealed).ok_or(FormatError::Invalid("region"))?;
        let at = region_of_key(peeked.key).ok_or(FormatError::Key)?;
        let opened = frame::open(sealed, Kind::Region, world, peeked.key, limits.region)?;
        if portable.regions.last_key_value().is_some_and(|(last, _)| *last >= at) {
            return Err(FormatError::Invalid("order of regions"));
        }
        portable.regions.insert(at, SavedRegion::decode(&opened, at, ground)?);
    }
    for (number, sealed) in (1u64..).zip(batches) {
        let opened = frame::open(sealed, Kind::Journal, world, &number.to_be_bytes(), limits.journal)?;
        portable.journal.push(Batch::decode(&opened.payload, ground)?);
    }
    Ok(portable)
}

/// Reads the world's id and the head of a portable file. The rest of the file is not read, and no ground is
/// needed.
///
/// # Errors
/// When it is not a portable file, or when its head is damaged.
pub fn read_portable_head(file: &[u8]) -> Result<(WorldId, PortableHead), FormatError> {
    let (world, own) = container::read_own(Kind::Portable, file, Limits::FORMAT.head)?;
    Ok((world, portable_head(&own)?))
}

fn portable_head(own: &[u8]) -> Result<PortableHead, FormatError> {
    plain::from_bytes(own, "description of a world")
}
