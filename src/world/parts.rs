//! Parts of a world: bricks and fields, as they are saved, sent and put in place.

use std::collections::BTreeMap;
#[cfg(feature = "net")]
use std::collections::BTreeSet;
use std::sync::Arc;

use super::patch::Patch;
#[cfg(feature = "net")]
use super::patch::State;
use super::state::World;
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, Column, LatticeBox};
use crate::volume::{Brick, Field, FieldId, Fields, NO_FIELDS, column_hash, layers, pristine_layers};

/// A brick, and the box around its edited samples in one chunk.
type EditedPart<'a> = (BrickPos, &'a Brick, LatticeBox);

/// The part of a brick that was edited in a chunk with these samples, if any.
fn edited_part(pos: BrickPos, brick: &Brick, samples: LatticeBox) -> Option<EditedPart<'_>> {
    let edited = layers::and(brick.edited(), &layers::within(pos, samples));
    Some((pos, brick, layers::bounds(&edited, pos.origin())?))
}

/// The fields of a chunk, made to hold its edited samples and nothing else: each shrinks to what is edited in it, or
/// disappears, and grows over edited samples that none contains. `parts` are all that was edited in the chunk; `next`
/// names new fields.
fn fitted(fields: &Fields, parts: &[EditedPart], next: &mut u64) -> Fields {
    let shrunk = |field: &Field| {
        let near = parts.iter().filter(|(.., own)| own.intersection(field.bounds).is_some());
        let edited = near.filter_map(|(pos, brick, _)| Some(edited_part(*pos, brick, field.bounds)?.2));
        let bounds = edited.reduce(LatticeBox::union)?;
        let revision = field.revision.saturating_add(u64::from(bounds != field.bounds));
        Some(Field { bounds, revision, ..*field })
    };
    let mut after = Fields::restored(fields.iter().filter_map(shrunk).collect()).unwrap_or_default();
    for &(.., own) in parts {
        if after.iter().all(|field| !field.bounds.encloses(own)) {
            after.absorb(own, || {
                *next = next.saturating_add(1);
                FieldId(*next)
            });
        }
    }
    after
}

impl Patch {
    /// Makes the fields of a whole world, all of whose bricks this patch holds, hold the edited samples and nothing
    /// else. New fields get unused names. Returns whether anything changed.
    pub(crate) fn fit_fields(&mut self, grid: ChunkGrid) -> bool {
        let mut chunks: BTreeMap<ChunkPos, Vec<EditedPart>> =
            self.fields.iter().map(|(chunk, _)| (*chunk, Vec::new())).collect();
        for (pos, brick) in self.bricks.iter().filter_map(|(pos, brick)| Some((*pos, brick.as_deref()?))) {
            for chunk in brick.edited_bounds(pos).into_iter().flat_map(|edited| grid.chunks_of(edited)) {
                let part = edited_part(pos, brick, grid.chunk_samples(chunk));
                part.into_iter().for_each(|part| chunks.entry(chunk).or_default().push(part));
            }
        }
        let before: BTreeMap<ChunkPos, Fields> = self.fields.iter().cloned().collect();
        let mut next = self.next_field;
        let fit = |(chunk, parts): (ChunkPos, Vec<EditedPart>)| {
            (chunk, fitted(before.get(&chunk).unwrap_or(&NO_FIELDS), &parts, &mut next))
        };
        let after = chunks.into_iter().map(fit).filter(|(_, fields)| !fields.is_empty());
        let after: BTreeMap<ChunkPos, Fields> = after.collect();
        let has_changed = after != before;
        (self.fields, self.next_field) = (after.into_iter().collect(), next);
        has_changed
    }

    /// Adds the fields that some chunks of a world have once this patch has replaced its bricks, where they differ from
    /// the present ones.
    #[cfg(feature = "net")]
    pub(crate) fn add_fitted_fields(&mut self, world: &World, chunks: impl IntoIterator<Item = ChunkPos>) {
        let (mut next, mut fields) = (self.next_field, Vec::new());
        let own: BTreeMap<BrickPos, Option<&Brick>> =
            self.bricks.iter().map(|(pos, brick)| (*pos, brick.as_deref())).collect();
        let brick = |pos: BrickPos| match own.get(&pos) {
            Some(brick) => *brick,
            None => world.bricks.get(&pos).map(Arc::as_ref),
        };
        let there = |chunk: ChunkPos| (chunk, world.bricks_near(world.grid.chunk_samples(chunk)).collect());
        let mut near: BTreeMap<ChunkPos, BTreeSet<BrickPos>> = chunks.into_iter().map(there).collect();
        for pos in own.keys() {
            for chunk in world.grid.chunks_of(pos.samples()) {
                near.entry(chunk).and_modify(|places| places.extend([*pos]));
            }
        }
        for (chunk, places) in near {
            let (before, samples) = (State::fields(world, chunk), world.grid.chunk_samples(chunk));
            let parts = places.into_iter().filter_map(|pos| edited_part(pos, brick(pos)?, samples));
            let after = fitted(before, &parts.collect::<Vec<_>>(), &mut next);
            fields.extend((after != *before).then_some((chunk, after)));
        }
        self.next_field = next;
        self.fields.append(&mut fields);
        self.fields.sort_by_key(|(chunk, _)| *chunk);
    }
}

impl World {
    /// All bricks and fields, in order.
    pub(crate) fn all_parts(&self) -> Patch {
        let mut bricks: Vec<(BrickPos, Option<Arc<Brick>>)> =
            self.bricks.iter().map(|(pos, brick)| (*pos, Some(Arc::clone(brick)))).collect();
        bricks.sort_unstable_by_key(|(pos, _)| *pos);
        let mut fields: Vec<_> = self.fields.iter().map(|(chunk, fields)| (*chunk, fields.clone())).collect();
        fields.sort_unstable_by_key(|(chunk, _)| *chunk);
        Patch { bricks, fields, next_field: self.next_field }
    }
}

/// The brick with the same edited samples over another ground; the same `Arc` where all its bits are the same.
pub(crate) fn brick_over(ground: &Ground, pos: BrickPos, brick: Arc<Brick>) -> Arc<Brick> {
    let on_ground = brick.on_pristine(&pristine_layers(ground, pos));
    if on_ground.solid() == brick.solid() { brick } else { Arc::new(on_ground) }
}

/// The hashes of a brick's columns.
pub(crate) fn columns_of(pos: BrickPos) -> [u64; 64] {
    let low = Column::of(pos.origin());
    std::array::from_fn(|bit| column_hash(low.offset(bit as i32 & 7, bit as i32 >> 3)))
}
