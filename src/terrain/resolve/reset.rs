//! A reset: an edit that returns ground to pristine, so that bricks and fields disappear.
//!
//! It is a transaction of its own, like a step through history, whose parts it computes from what is stored. It joins
//! the step of undo of the edits that it was sent with.

use std::collections::BTreeMap;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::replacement::Replacement;
use super::resolved::Resolved;
use crate::brush::Edit;
use crate::edits::{self, EditEffect, ResetBrick, edited_within, reach};
use crate::lattice::{BrickPos, ChunkPos, LatticeBox};
use crate::redraw::{Scene, Stages};
use crate::terrain::queue::Submission;
use crate::terrain::receipt::{Applied, ChunkScenario, Receipt, Rejection};
use crate::volume::{Brick, Field, Fields, Scenario, layers};
use crate::world::{Change, Patch, World};

/// Resolves a reset.
pub(super) fn reset(scene: Scene, submission: &Submission, edit: &Edit) -> Resolved {
    let (world, tag, mut stages) = (scene.world, submission.tag, Stages::default());
    if reach(world.grid, edit).is_none() {
        return Resolved::nothing(world).with_receipt(Receipt::of_edit(tag, Err(Rejection::OutsideWorld)));
    }
    // Counts only what rules refuse.
    let mut effect = EditEffect::default();
    let rules = submission.edit_settings.rules.as_deref();
    let found = Stages::time(&mut stages.edit, || {
        edits::reset(world.samples(), world.grid, edit, rules, &mut effect)
    });
    let (fields, chunks) = shrunk_fields(world, &found);
    let tags = if found.is_empty() { Vec::new() } else { vec![tag] };
    let bricks = found.into_iter().map(|ResetBrick { pos, brick, .. }| (pos, brick)).collect();
    let patch = Patch { bricks, fields, next_field: world.next_field };
    let change = Change { patch, ..Change::default() };
    let mut replacement = Replacement::new(scene, change, true, stages);
    replacement.update_hash();
    replacement.update_mask();
    let (resolved, applied) = replacement.resolve(submission.group, (tags, Vec::new()));
    let applied = Applied { chunks, refused: effect.refused, ..applied };
    resolved.with_receipt(Receipt::of_edit(tag, Ok(applied)))
}

/// The fields of each chunk in which samples were reset, shrunk to what is left of them; and what the receipt says.
fn shrunk_fields(world: &World, found: &[ResetBrick]) -> (Vec<(ChunkPos, Fields)>, Vec<ChunkScenario>) {
    let left: FxHashMap<BrickPos, Option<&Brick>> =
        found.iter().map(|own| (own.pos, own.brick.as_deref())).collect();
    let brick = |pos: BrickPos| match left.get(&pos) {
        Some(own) => *own,
        None => world.bricks.get(&pos).map(Arc::as_ref),
    };
    // Boxes of reset samples, by chunk.
    let mut parts: BTreeMap<ChunkPos, Vec<LatticeBox>> = BTreeMap::new();
    for own in found {
        let Some(bounds) = layers::bounds(&own.samples, own.pos.origin()) else { continue };
        for chunk in world.grid.chunks_of(bounds) {
            let Some(part) = world.grid.chunk_samples(chunk).intersection(own.pos.samples()) else {
                continue;
            };
            let samples = layers::and(&own.samples, &layers::within(own.pos, part));
            parts.entry(chunk).or_default().extend(layers::bounds(&samples, own.pos.origin()));
        }
    }
    let (mut fields, mut chunks) = (Vec::new(), Vec::new());
    for (chunk, parts) in parts.into_iter().filter(|(_, parts)| !parts.is_empty()) {
        let Some(before) = world.fields.get(&chunk) else { continue };
        let is_touched = |field: &Field| parts.iter().any(|part| field.bounds.intersection(*part).is_some());
        let shrunk = |field: &Field| match is_touched(field) {
            true => Some(Field {
                bounds: edited_within(field.bounds, brick)?,
                revision: field.revision.saturating_add(1),
                ..*field
            }),
            false => Some(*field),
        };
        if let Some(field) = before.iter().find(|field| is_touched(field)) {
            chunks.push(ChunkScenario { chunk, scenario: Scenario::Changed, field: field.id });
        }
        let after = Fields::restored(before.iter().filter_map(shrunk).collect()).unwrap_or_default();
        fields.push((chunk, after));
    }
    (fields, chunks)
}
