//! Changes of fields in a transaction.

use std::collections::{BTreeMap, BTreeSet};

use crate::brush::Edit;
use crate::edits::{EditEffect, reach};
use crate::lattice::{ChunkPos, LatticeBox};
use crate::terrain::receipt::{Applied, ChunkScenario, Rejection};
use crate::volume::{Absorbed, FieldId, Fields};
use crate::world::World;

/// A change of a field in a commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldChange {
    /// A field was created.
    Created(FieldId),
    /// A field's samples or box changed.
    Changed(FieldId),
    /// A field was merged into another field of its chunk.
    Merged {
        /// The field that is gone.
        gone: FieldId,
        /// The field that holds its data now.
        into: FieldId,
    },
    /// A field was removed, because its edits were undone.
    Removed(FieldId),
}

/// The fields that a transaction touches, and what happened to them.
pub(crate) struct FieldLog<'a> {
    world: &'a World,
    fields: BTreeMap<ChunkPos, Fields>,
    /// Chunks whose fields changed since they were last taken.
    changed: BTreeSet<ChunkPos>,
    /// Fields that were merged, in order, and the fields that they went into.
    merged: Vec<(ChunkPos, FieldId)>,
    merged_into: BTreeMap<FieldId, FieldId>,
    /// The greatest name that any field has had.
    pub next_field: u64,
}

impl<'a> FieldLog<'a> {
    pub fn new(world: &'a World) -> Self {
        let (fields, changed) = (BTreeMap::new(), BTreeSet::new());
        let (merged, merged_into) = (Vec::new(), BTreeMap::new());
        Self { world, fields, changed, merged, merged_into, next_field: world.next_field }
    }

    /// Enters what an edit changed; returns what its receipt says.
    pub fn enter(&mut self, edit: &Edit, effect: EditEffect) -> Result<Applied, Rejection> {
        if reach(self.world.grid, edit).is_none() {
            return Err(Rejection::OutsideWorld);
        }
        let mut bounds = None;
        let mut chunks = Vec::with_capacity(effect.chunks.len());
        for part in &effect.chunks {
            LatticeBox::include(&mut bounds, part.bounds);
            chunks.push(self.absorb(part.chunk, part.bounds));
        }
        let EditEffect { removed, added, painted, refused, .. } = effect;
        Ok(Applied { chunks, bounds, removed, added, painted, refused, ..Applied::default() })
    }

    /// All fields of each chunk that a field changed in since the last call, by chunk.
    pub fn take_changed(&mut self) -> Vec<(ChunkPos, Fields)> {
        let changed = std::mem::take(&mut self.changed);
        // Exactly: capacity counts as history's bytes.
        let mut fields = Vec::with_capacity(changed.len());
        fields
            .extend(changed.into_iter().filter_map(|chunk| Some((chunk, self.fields.get(&chunk)?.clone()))));
        fields
    }

    fn absorb(&mut self, chunk: ChunkPos, bounds: LatticeBox) -> ChunkScenario {
        self.changed.insert(chunk);
        let committed = || self.world.fields.get(&chunk).cloned().unwrap_or_default();
        let fields = self.fields.entry(chunk).or_insert_with(committed);
        let Absorbed { scenario, field, gone } = fields.absorb(bounds, || {
            self.next_field += 1;
            FieldId(self.next_field)
        });
        self.merged.extend(gone.iter().map(|&gone| (chunk, gone)));
        self.merged_into.extend(gone.into_iter().map(|gone| (gone, field)));
        ChunkScenario { chunk, scenario, field }
    }

    /// One line for each field that differs from the snapshot.
    pub fn news(&self) -> Vec<(ChunkPos, FieldChange)> {
        let (mut news, nothing) = (Vec::new(), Fields::default());
        let before = |chunk| self.world.fields.get(chunk).unwrap_or(&nothing);
        for (chunk, fields) in &self.fields {
            news.extend(changes(before(chunk), fields).map(|own| (*chunk, own)));
        }
        for &(chunk, gone) in self.merged.iter().filter(|(chunk, gone)| before(chunk).get(*gone).is_some()) {
            let next = |field: &FieldId| self.merged_into.get(field).copied();
            let into = std::iter::successors(Some(gone), next).last().unwrap_or(gone);
            news.push((chunk, FieldChange::Merged { gone, into }));
        }
        news
    }
}

/// The fields of a chunk that are new or changed.
fn changes(before: &Fields, after: &Fields) -> impl Iterator<Item = FieldChange> {
    after.iter().filter_map(|field| match before.get(field.id) {
        None => Some(FieldChange::Created(field.id)),
        Some(old) if old != field => Some(FieldChange::Changed(field.id)),
        Some(_) => None,
    })
}

/// One line for each field that differs, when the fields of a chunk are replaced by those of another time.
pub(crate) fn news_of_replaced(before: &Fields, after: &Fields) -> Vec<FieldChange> {
    let mut news: Vec<FieldChange> = changes(before, after).collect();
    for gone in before.iter().filter(|field| after.get(field.id).is_none()) {
        let into = after.iter().find(|field| field.bounds.encloses(gone.bounds));
        news.push(match into {
            Some(field) => FieldChange::Merged { gone: gone.id, into: field.id },
            None => FieldChange::Removed(gone.id),
        });
    }
    news
}
