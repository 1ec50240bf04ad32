//! Decodes the regions of a checkpoint, also over another ground or level than they were saved with.

use std::collections::{BTreeMap, BTreeSet};

use glam::IVec3;
use rayon::prelude::*;

use super::found::Contents;
use crate::ground::Ground;
use crate::lattice::{ChunkGrid, RegionPos};
use crate::store::base_level::BaseLevel;
use crate::store::checkpoints::{Checkpoint, GroundSize};
use crate::store::progress::Work;
use crate::terrain::{Patch, WorldParts};
use crate::volume::{Field, Fields};

/// The work of decoding a byte of a region.
pub(super) const DECODE: u64 = 1;

/// The regions whose heights below are not those that they were saved with; all of them on another level.
pub(super) fn changed_regions(
    contents: &Contents,
    checkpoint: &Checkpoint,
    ground: &Ground,
    level: Option<&BaseLevel>,
) -> BTreeSet<RegionPos> {
    if BaseLevel::expect(level, checkpoint.level.as_ref()).is_err() {
        return checkpoint.regions.keys().copied().collect();
    }
    if checkpoint.metadata.ground == ground.hash() {
        return BTreeSet::new();
    }
    let mut hashes = BTreeMap::new();
    let mut is_changed = |(at, revision): &(&RegionPos, &u64)| {
        let now = *hashes.entry(at.column()).or_insert_with(|| ground.region_hash(at.column()));
        contents.region(**at, **revision).is_some_and(|record| record.ground != now)
    };
    checkpoint.regions.iter().filter(|own| is_changed(own)).map(|(at, _)| *at).collect()
}

/// The parts of a world that a checkpoint has, and the regions that can't be read.
pub(super) fn load_regions(
    contents: &Contents,
    checkpoint: &Checkpoint,
    ground: &Ground,
    level: Option<&BaseLevel>,
    grid: ChunkGrid,
    has_lost_rest: bool,
    work: &Work,
) -> (WorldParts, Vec<RegionPos>) {
    let metadata = &checkpoint.metadata;
    let below = level.map(|level| level.parts(ground)).unwrap_or_default();
    let (mut bricks, mut fields) = (below.change.bricks, below.change.fields);
    if below.chunk_size != metadata.settings.chunk_size {
        fields.clear();
    }
    let is_same_level = BaseLevel::expect(level, checkpoint.level.as_ref()).is_ok();
    let decode = |(at, revision): &(RegionPos, u64)| {
        let record = contents.region(*at, *revision);
        let change = record.and_then(|record| record.decode(*at, ground).ok());
        work.advance(DECODE * record.map_or(0, |record| record.bytes() as u64));
        (*at, change)
    };
    let regions: Vec<(RegionPos, u64)> =
        checkpoint.regions.iter().map(|(at, revision)| (*at, *revision)).collect();
    let decoded: Vec<_> = regions.par_iter().map(decode).collect();
    let mut damaged = Vec::new();
    for (at, change) in decoded {
        match change {
            Some(change) => {
                bricks.extend(change.bricks);
                // Of chunks whose size is not known they can't be used.
                if is_same_level && !has_lost_rest {
                    fields.extend(change.fields);
                }
            }
            None => damaged.push(at),
        }
    }
    keep_latest(&mut bricks);
    keep_latest(&mut fields);
    bricks.retain(|(_, brick)| brick.is_some());
    fields.retain(|(_, fields)| !fields.is_empty());
    let next_field = metadata.next_field.max(below.change.next_field);
    let mut change = Patch { bricks, fields, next_field };
    if checkpoint.metadata.ground != ground.hash() {
        cut_fields(&mut change, grid);
    }
    if !is_same_level || checkpoint.metadata.ground != ground.hash() {
        // Fields of two levels may overlap and have one name: those of the new level continue, and fit what is edited
        // now. Beyond the rim of a smaller ground, edits reach into more chunks.
        change.fit_fields(grid);
    }
    let parts = WorldParts {
        change,
        chunk_size: metadata.settings.chunk_size,
        revision: metadata.revision,
        edit_settings: metadata.edit_settings.clone(),
    };
    (parts, damaged)
}

/// Cuts fields off where their chunk ends on a ground of another size: the last chunk has one column more than others.
fn cut_fields(change: &mut Patch, grid: ChunkGrid) {
    for (chunk, fields) in &mut change.fields {
        let own = grid.chunk_samples(*chunk).intersection(grid.edit_bounds());
        let own = own.filter(|_| grid.has_tile(chunk.tile()));
        if own.is_some_and(|own| fields.iter().all(|field| own.encloses(field.bounds))) {
            continue;
        }
        let cut = |field: &Field| Some(Field { bounds: field.bounds.intersection(own?)?, ..*field });
        *fields = Fields::restored(fields.iter().filter_map(cut).collect()).unwrap_or_default();
    }
    change.fields.retain(|(_, fields)| !fields.is_empty());
}

/// Sorts a list by key; of those with the same key the last stays.
fn keep_latest<K: Copy + Ord, V>(list: &mut Vec<(K, V)>) {
    list.sort_by_key(|(key, _)| *key);
    list.dedup_by(|later, kept| {
        let is_same = later.0 == kept.0;
        if is_same {
            std::mem::swap(later, kept);
        }
        is_same
    });
}

/// The cells along x and z that edited samples of bricks need.
pub(super) fn reach(change: &Patch) -> Option<GroundSize> {
    let bounds = change.bricks.iter().filter_map(|(pos, brick)| brick.as_ref()?.edited_bounds(*pos));
    let most = bounds.map(|bounds| bounds.max).reduce(IVec3::max)?;
    let cells = |at: i32| u32::try_from(at).unwrap_or_default();
    Some(GroundSize { width: cells(most.x), depth: cells(most.z) })
}
