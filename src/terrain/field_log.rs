//! What a transaction does to fields.

use std::collections::{BTreeMap, BTreeSet};

use super::receipt::{Applied, ChunkScenario, Rejection};
use super::world::World;
use crate::brush::Edit;
use crate::edits::{EditEffect, reach};
use crate::lattice::{ChunkPos, LatticeBox};
use crate::volume::{FieldId, Fields};

/// Something that happened to a field in a commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldNews {
    /// It is new.
    Created(FieldId),
    /// Its samples or its box changed.
    Changed(FieldId),
    /// It went into another field of its chunk.
    Merged {
        /// The field that is gone.
        gone: FieldId,
        /// The field that holds its data now.
        into: FieldId,
    },
    /// It is gone, because its edits were undone.
    Removed(FieldId),
}

/// The fields that a transaction touches, and what happened to them.
pub(super) struct FieldLog<'a> {
    world: &'a World,
    fields: BTreeMap<ChunkPos, Fields>,
    /// Chunks whose fields changed since they were last taken.
    changed: BTreeSet<ChunkPos>,
    merged: Vec<(ChunkPos, FieldNews)>,
    /// Where those of each chunk stand among them.
    merged_in: BTreeMap<ChunkPos, Vec<usize>>,
    pub next: u64,
}

impl<'a> FieldLog<'a> {
    pub fn new(world: &'a World) -> Self {
        let (fields, merged_in) = (BTreeMap::new(), BTreeMap::new());
        let (changed, merged) = (BTreeSet::new(), Vec::new());
        Self { world, fields, changed, merged, merged_in, next: world.next_field }
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
        Ok(Applied { chunks, bounds, removed, added, painted, refused, loose: Vec::new() })
    }

    /// All fields of each chunk that a field changed in since the last call, by chunk.
    pub fn take_changed(&mut self) -> Vec<(ChunkPos, Fields)> {
        let changed = std::mem::take(&mut self.changed);
        // History tells its bytes: no list has room to spare.
        let mut fields = Vec::with_capacity(changed.len());
        fields
            .extend(changed.into_iter().filter_map(|chunk| Some((chunk, self.fields.get(&chunk)?.clone()))));
        fields
    }

    fn absorb(&mut self, chunk: ChunkPos, bounds: LatticeBox) -> ChunkScenario {
        let committed = self.world.fields.get(&chunk);
        self.changed.insert(chunk);
        let fields = self.fields.entry(chunk).or_insert_with(|| committed.cloned().unwrap_or_default());
        let absorbed = fields.absorb(bounds, || {
            self.next += 1;
            FieldId(self.next)
        });
        let existed = |id| committed.is_some_and(|fields| fields.get(id).is_some());
        let into = absorbed.field;
        if !absorbed.gone.is_empty() {
            let own = self.merged_in.entry(chunk).or_default();
            // What went into a field that goes now as well is in the last one.
            for &at in &*own {
                if let (_, FieldNews::Merged { into: earlier, .. }) = &mut self.merged[at]
                    && absorbed.gone.contains(earlier)
                {
                    *earlier = into;
                }
            }
            let gone = absorbed.gone.iter().filter(|&&id| existed(id));
            let before = self.merged.len();
            self.merged.extend(gone.map(|&gone| (chunk, FieldNews::Merged { gone, into })));
            own.extend(before..self.merged.len());
        }
        ChunkScenario { chunk, scenario: absorbed.scenario, field: absorbed.field }
    }

    /// One line for each field that differs from the snapshot.
    pub fn news(&self) -> Vec<(ChunkPos, FieldNews)> {
        let mut news = Vec::new();
        for (&chunk, fields) in &self.fields {
            let committed = self.world.fields.get(&chunk);
            for field in fields.iter() {
                match committed.and_then(|fields| fields.get(field.id)) {
                    None => news.push((chunk, FieldNews::Created(field.id))),
                    Some(before) if before != field => news.push((chunk, FieldNews::Changed(field.id))),
                    Some(_) => {}
                }
            }
        }
        news.extend_from_slice(&self.merged);
        news
    }
}

/// One line for each field that differs, when the fields of a chunk are replaced by those of another time.
pub(super) fn news_of_replaced(before: &Fields, after: &Fields) -> Vec<FieldNews> {
    let mut news = Vec::new();
    for field in after.iter() {
        match before.get(field.id) {
            None => news.push(FieldNews::Created(field.id)),
            Some(old) if old != field => news.push(FieldNews::Changed(field.id)),
            Some(_) => {}
        }
    }
    for gone in before.iter().filter(|field| after.get(field.id).is_none()) {
        let into = after.iter().find(|field| field.bounds.encloses(gone.bounds));
        news.push(match into {
            Some(field) => FieldNews::Merged { gone: gone.id, into: field.id },
            None => FieldNews::Removed(gone.id),
        });
    }
    news
}
