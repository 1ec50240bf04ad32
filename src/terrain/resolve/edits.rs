//! The edits of a transaction, group by group: each group is one step of undo, and has its own rules and loose
//! settings.
//!
//! Only history and receipts are made group by group. Meshes are made once for all groups.

use std::borrow::Cow;

use rustc_hash::FxHashMap;

use super::draft_group::{Found, LoosePieces, draft_group};
use super::field_log::{FieldChange, FieldLog};
use super::resolved::{Outcome, Resolved};
use crate::brush::Edit;
use crate::edits::{DraftedBrick, Drafter, EditDelta, EditEffect, MergedBricks, PreparedEdits, latest};
use crate::lattice::{BrickPos, ChunkPos, ItemCost, parallel_map_into, side_by_side};
use crate::loose::LoosePiece;
use crate::redraw;
use crate::redraw::{ByBrick, Scene, Stages, dirty_cells, joined_mask};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::terrain::history::UndoDelta;
use crate::terrain::queue::Submission;
use crate::terrain::receipt::{Applied, Receipt};
use crate::volume::{Brick, Fields};
use crate::world::{Change, ChangedBrick, Patch, World, brick_bytes, replaced_bytes};

/// A group of edits, and what it changes.
struct Group<'a> {
    submissions: &'a [Submission],
    bricks: Vec<DraftedBrick>,
    /// Words of the mask.
    mask: Mask,
    /// Hash of all samples after it.
    sample_hash: u64,
}

/// The effects of each edit of a group, and the pieces that it cut off.
type Effects = (Vec<EditEffect>, LoosePieces);

/// The changes by edits in addition to bricks and meshes.
struct Entered {
    receipts: Vec<Receipt>,
    news: Vec<(ChunkPos, FieldChange)>,
    next_field: u64,
    groups: Vec<EnteredGroup>,
}

/// The results of one group, once entered.
struct EnteredGroup {
    /// All fields of each chunk that a field changed in.
    fields: Vec<(ChunkPos, Fields)>,
    /// Bytes of bricks that it takes away from the world.
    replaced_bytes: usize,
    tags: Vec<u64>,
    /// The pieces that it took out of the ground, with the tags of its edits.
    pieces: Vec<(u64, LoosePiece)>,
}

/// A list of exactly this capacity: capacity counts as history's bytes.
fn exact<T>(count: usize, items: impl Iterator<Item = T>) -> Vec<T> {
    let mut list = Vec::with_capacity(count);
    list.extend(items);
    list
}

/// Bricks as history keeps them.
fn changed_bricks(drafted: Vec<DraftedBrick>) -> Vec<ChangedBrick> {
    parallel_map_into(drafted, ItemCost::Copy, |drafted| (drafted.pos, Some(drafted.brick)))
}

/// The cells that changed bricks show in.
fn cells_of(world: &World, bricks: &[DraftedBrick]) -> ByBrick {
    dirty_cells(world.grid, bricks, |drafted| (drafted.pos, drafted.changed, drafted.is_extended))
}

/// All bricks that groups changed, as the last group left them.
fn merged<'a>(earlier: &[Group], last: &'a [DraftedBrick]) -> Cow<'a, [DraftedBrick]> {
    if earlier.is_empty() {
        return Cow::Borrowed(last);
    }
    let mut merged = MergedBricks::default();
    merged.add(earlier.iter().flat_map(|group| &group.bricks).chain(last).cloned());
    Cow::Owned(merged.into_list())
}

/// Resolves edits, in order.
pub(crate) fn edits(scene: Scene, submissions: &[Submission]) -> Resolved {
    let Scene { world, backend, .. } = scene;
    let mut stages = Stages::default();
    let apply = |work: &PreparedEdits, each: &mut dyn FnMut(&mut [EditDelta])| backend.edit(work, each);
    let mut drafter = Drafter::new(world.samples(), world.grid, world.sample_hash, &world.uniform, &apply);
    let (mut groups, mut effects) = (Vec::<Group>::new(), Vec::<Effects>::new());
    let mut rest = submissions.chunk_by(Submission::goes_with);
    let last = rest.next_back().unwrap_or_default();
    // Words of the mask that earlier groups change.
    let mut newer = Mask::default();
    for own in rest {
        let (draft, pieces) = Stages::time(&mut stages.edit, || draft_group(world, &mut drafter, own));
        let cells = Stages::time(&mut stages.meshing, || cells_of(world, &draft.bricks));
        let latest = latest(&draft.bricks);
        let view = WorldView {
            samples: drafter.samples().under(&latest),
            mask: MaskView::new(&world.mask).over(&newer),
            grid: world.grid,
        };
        let mask = Stages::time(&mut stages.ring, || joined_mask(world, &view, &cells));
        drafter.overlay.lay(&draft.bricks);
        newer.lay(&mask);
        effects.push((draft.effects, pieces));
        groups.push(Group { submissions: own, bricks: draft.bricks, mask, sample_hash: draft.hash });
    }

    // The last group, which most often is the only one, together with all meshing.
    let (draft, pieces) = Stages::time(&mut stages.edit, || draft_group(world, &mut drafter, last));
    effects.push((draft.effects, pieces));
    let bricks = merged(&groups, &draft.bricks);
    let find = || Stages::time(&mut stages.meshing, || cells_of(world, &draft.bricks));
    let (mut dirty, latest) =
        side_by_side(ItemCost::Lookup.is_shared(bricks.len()), find, || latest(&bricks));
    let before = WorldView {
        samples: world.samples().under(&latest),
        mask: MaskView::new(&world.mask).over(&newer),
        grid: world.grid,
    };
    let mask = Stages::time(&mut stages.ring, || joined_mask(world, &before, &dirty));
    let mut all_mask = Cow::Borrowed(&mask);
    if !groups.is_empty() {
        dirty = Stages::time(&mut stages.meshing, || cells_of(world, &bricks));
        all_mask = Cow::Owned(newer.clone());
        all_mask.to_mut().lay(&mask);
    }
    let view = WorldView { mask: MaskView::new(&world.mask).over(&all_mask), ..before };
    let positions = || bricks.iter().map(|drafted| drafted.pos).collect();
    let meshes = || redraw::updates(scene, &view, &dirty, &all_mask, positions, &mut stages);
    let all = groups.iter().map(|group| (group.submissions, &*group.bricks));
    let all = all.chain([(last, &*draft.bricks)]).zip(effects);
    let (meshes, entered) =
        side_by_side(ItemCost::Brick.is_shared(dirty.len()), meshes, || enter(world, all));

    drop(bricks);
    groups.push(Group { submissions: last, bricks: draft.bricks, mask, sample_hash: draft.hash });
    let next_field = entered.next_field;
    let changes = groups.into_iter().zip(entered.groups).map(|(group, own)| {
        let Group { submissions, bricks, mask, sample_hash } = group;
        let EnteredGroup { fields, replaced_bytes, tags, pieces } = own;
        let mask = exact(mask.word_count(), mask.words());
        let patch = Patch { bricks: changed_bricks(bricks), fields, next_field };
        let change = Change { patch, mask, sample_hash };
        let number = submissions.first().map_or(0, |first| first.group);
        UndoDelta::new(change, replaced_bytes, number, (tags, pieces))
    });
    let changes = changes.collect();
    let outcome = Outcome {
        uniform: drafter.into_uniform(),
        receipts: entered.receipts,
        news: entered.news,
        next_field: entered.next_field,
        ..Outcome::new(world, changes, draft.hash)
    };
    Resolved { outcome, meshes, stages }
}

/// Updates fields and creates receipts from the effects of edits. Each group comes with the bricks that it changed.
fn enter<'a>(
    world: &World,
    groups: impl Iterator<Item = ((&'a [Submission], &'a [DraftedBrick]), Effects)>,
) -> Entered {
    let (mut log, mut receipts) = (FieldLog::new(world), Vec::new());
    let mut newer: FxHashMap<BrickPos, &Brick> = FxHashMap::default();
    let mut groups = groups.peekable();
    let mut entered = Vec::with_capacity(1);
    while let Some(((submissions, bricks), (effects, mut pieces))) = groups.next() {
        let mut effects = effects.into_iter().enumerate();
        let (mut tags, mut taken) = (Vec::new(), Vec::new());
        receipts.reserve_exact(submissions.len());
        for submission in submissions {
            let mut apply = |edit: &Edit| {
                let (number, effect) = effects.next().unwrap_or_default();
                let applied = log.enter(edit, effect)?;
                if !applied.chunks.is_empty() {
                    tags.push(submission.tag);
                }
                let Found { pieces: loose, has_unsearched } = pieces.remove(&number).unwrap_or_default();
                let gone = loose.iter().filter(|piece| piece.is_gone());
                taken.extend(gone.map(|piece| (submission.tag, piece.clone())));
                Ok(Applied { loose, has_unsearched, ..applied })
            };
            let outcome = match &submission.order {
                Ok(order) => order.edit().map_or_else(|| Ok(Applied::default()), &mut apply),
                Err(rejection) => Err(rejection.clone()),
            };
            receipts.push(Receipt::of_edit(submission.tag, outcome));
        }
        tags.shrink_to_fit();
        taken.shrink_to_fit();
        // Bricks of an earlier group take the place of the world's.
        let replaced = |drafted: &DraftedBrick| match newer.get(&drafted.pos) {
            Some(brick) => brick_bytes(brick),
            None => replaced_bytes(world, drafted.pos),
        };
        let replaced_bytes = bricks.iter().map(replaced).sum();
        if groups.peek().is_some() {
            newer.extend(bricks.iter().map(|drafted| (drafted.pos, &*drafted.brick)));
        }
        entered.push(EnteredGroup { fields: log.take_changed(), replaced_bytes, tags, pieces: taken });
    }
    Entered { groups: entered, receipts, news: log.news(), next_field: log.next_field }
}
