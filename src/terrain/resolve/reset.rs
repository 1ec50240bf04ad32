//! A reset: an edit that returns ground to pristine, so that bricks and fields disappear.
//!
//! It is a transaction of its own, like a step through history, whose parts it computes from what is stored. It joins
//! the step of undo of the edits that it was sent with.

use std::collections::BTreeMap;
use std::sync::Arc;

use rustc_hash::FxHashMap;
use web_time::Instant;

use super::parts::words_of;
use super::resolved::Resolved;
use super::step::{Placed, place};
use crate::brush::Edit;
use crate::edits::{self, EditEffect, ResetBrick, count_replaced, edited_within, reach};
use crate::lattice::{BrickPos, ChunkPos, LatticeBox};
use crate::redraw::{Scene, Stages};
use crate::terrain::history::UndoDelta;
use crate::terrain::queue::Submission;
use crate::terrain::receipt::{Applied, ChunkScenario, Receipt, Rejection};
use crate::volume::{Brick, Field, Fields, Scenario, layers, pristine_layers};
use crate::world::{Change, Patch, World, columns_of, replaced_bytes};

/// Resolves a reset.
pub(super) fn reset(scene: Scene, submission: &Submission, edit: &Edit) -> Resolved {
    let (world, start, mut stages) = (scene.world, Instant::now(), Stages::default());
    let tag = submission.tag;
    if reach(world.grid, edit).is_none() {
        let receipts = vec![Receipt::of_edit(tag, Err(Rejection::OutsideWorld))];
        return Resolved { receipts, ..Resolved::nothing(world) };
    }
    let mut effect = EditEffect::default();
    let rules = submission.context.rules.as_deref();
    let found = Stages::time(&mut stages.edit, || {
        edits::reset(world.samples(), world.grid, edit, rules, &mut effect)
    });
    let (mut bricks, mut whole) = (Vec::with_capacity(found.len()), Vec::with_capacity(found.len()));
    let (mut changed, mut sample_hash) = (Vec::with_capacity(found.len()), world.sample_hash);
    for ResetBrick { pos, brick, .. } in &found {
        let before = world.bricks.get(pos);
        let pair = [before.map(Arc::as_ref), brick.as_deref()];
        changed.extend(count_replaced(&world.ground, *pos, pair, &mut effect).map(|own| (*pos, own)));
        let columns = columns_of(*pos);
        let hash = |brick: Option<&Arc<Brick>>| {
            brick.map_or(0, |brick| brick.hash(pos.origin().y, brick.edited(), &columns))
        };
        sample_hash = sample_hash.wrapping_add(hash(brick.as_ref())).wrapping_sub(hash(before));
        let pristine = || Arc::new(Brick::pristine(pristine_layers(&world.ground, *pos)));
        whole.push((*pos, brick.clone().unwrap_or_else(pristine)));
        bricks.push((*pos, brick.clone()));
    }
    let mask = Stages::time(&mut stages.ring, || words_of(world, &whole, &changed));
    let (fields, chunks) = shrunk_fields(world, &found);
    let patch = Patch { bricks, fields, next_field: world.next_field };
    let change = Change { patch, mask, sample_hash };
    let Placed { meshes, news } = place(scene, &change, &whole, &changed, &mut stages);
    let bounds = changed.iter().map(|&(_, own)| own).reduce(LatticeBox::union);
    let tags = if found.is_empty() { Vec::new() } else { vec![tag] };
    let replaced = change.patch.bricks.iter().map(|(pos, _)| replaced_bytes(world, *pos)).sum();
    let delta = UndoDelta::new(change, replaced, submission.context.group, (tags, Vec::new()));
    let EditEffect { removed, added, painted, refused, .. } = effect;
    let applied = Applied { chunks, bounds, removed, added, painted, refused, ..Applied::default() };
    stages.whole = start.elapsed();
    Resolved {
        receipts: vec![Receipt::of_edit(tag, Ok(applied))],
        news,
        stages,
        ..Resolved::new(world, vec![delta], sample_hash, meshes)
    }
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
