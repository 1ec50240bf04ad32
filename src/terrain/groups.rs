//! The edits of a transaction, group by group: each is one step of undo, and has its own rules and loose settings.
//!
//! Only what history and receipts need is made for each group. What is drawn is made once, of all of them.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashMap;
use web_time::Instant;

use super::by_brick::{ByBrick, PARALLEL_PLACES};
use super::change::{Change, GroupChange, brick_bytes, replaced_bytes};
use super::commit::{Commit, Stages};
use super::dirty::{dirty_cells, joined_mask};
use super::drafting::{Drafted, Drafting, merge};
use super::field_log::{FieldLog, FieldNews};
use super::loose::LoosePiece;
use super::queue::Submission;
use super::receipt::{Applied, Receipt, Rejection};
use super::redraw;
use super::transaction::Transaction;
use super::world::World;
use crate::backend::{Compute, PARALLEL_BLOCKS};
use crate::edits::{Draft, DraftedBrick, EditEffect, latest};
use crate::lattice::{BrickPos, ChunkPos, side_by_side};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::volume::{Brick, Fields, UniformBricks};

/// A group of edits, and what they come to.
struct Group<'a> {
    submissions: &'a [Submission],
    /// Its effects stand apart.
    draft: Draft,
}

/// What each edit of a group did, and what was cut off, by the number of the edit.
type Effects = (Vec<EditEffect>, BTreeMap<usize, Vec<LoosePiece>>);

/// What edits come to, bricks and meshes aside.
struct Entered {
    receipts: Vec<Receipt>,
    news: Vec<(ChunkPos, FieldNews)>,
    next_field: u64,
    groups: Vec<EnteredGroup>,
}

/// The same of one group.
struct EnteredGroup {
    /// All fields of each chunk that a field changed in.
    fields: Vec<(ChunkPos, Fields)>,
    /// Words of the mask that change.
    mask: Vec<((i32, i32), u64)>,
    /// Bytes of bricks that it takes away from the world.
    replaced_bytes: usize,
    tags: Vec<u64>,
}

/// From how many bricks on lists that are only copied are copied side by side.
const LONG: usize = 1 << 13;

/// A list of so many, without room to spare: history tells its bytes.
fn exact<T>(count: usize, items: impl Iterator<Item = T>) -> Vec<T> {
    let mut list = Vec::with_capacity(count);
    list.extend(items);
    list
}

/// What changes hold of bricks. Kept as long as history has it: no larger than it has to be.
fn changed_bricks(drafted: Vec<DraftedBrick>) -> Vec<(BrickPos, Option<Arc<Brick>>)> {
    let changed = |drafted: DraftedBrick| (drafted.pos, Some(drafted.brick));
    if drafted.len() >= LONG {
        return drafted.into_par_iter().map(changed).collect();
    }
    let mut bricks = Vec::with_capacity(drafted.len());
    bricks.extend(drafted.into_iter().map(changed));
    bricks
}

/// The cells that bricks which changed show in.
fn cells_of(world: &World, bricks: &[DraftedBrick]) -> ByBrick {
    dirty_cells(world.grid, bricks, |drafted| (drafted.pos, drafted.changed, drafted.is_extended))
}

/// All bricks that groups changed, as the last of them left them.
fn merged<'a>(groups: &'a [Group], last: &'a [DraftedBrick]) -> Cow<'a, [DraftedBrick]> {
    if groups.is_empty() {
        return Cow::Borrowed(last);
    }
    let mut bricks = BTreeMap::new();
    let drafted = groups.iter().flat_map(|group| &group.draft.bricks).chain(last);
    drafted.for_each(|drafted| merge(&mut bricks, drafted.clone()));
    Cow::Owned(bricks.into_values().collect())
}

impl Transaction {
    /// Applies edits, in order.
    pub(super) fn edit(&self, submissions: &[Submission], backend: &dyn Compute) -> Commit {
        let (world, start, mut stages) = (&*self.world, Instant::now(), Stages::default());
        let mut drafting = Drafting::new(world, backend);
        let (mut groups, mut masks) = (Vec::<Group>::new(), Vec::<Mask>::new());
        let mut effects = Vec::<Effects>::new();
        let mut rest = submissions.chunk_by(Submission::goes_with);
        let last = rest.next_back().unwrap_or_default();
        // Words of the mask that earlier groups change.
        let mut newer = Mask::default();
        for own in rest {
            let Drafted { mut draft, pieces } = Stages::time(&mut stages.edit, || drafting.draft(own));
            let cells = Stages::time(&mut stages.meshing, || cells_of(world, &draft.bricks));
            let latest = latest(&draft.bricks);
            let view = WorldView {
                samples: drafting.samples().under(&latest),
                mask: MaskView::new(&world.mask).over(&newer),
                grid: world.grid,
            };
            let mask = Stages::time(&mut stages.ring, || joined_mask(world, &view, &cells));
            drafting.lay(&draft);
            newer.lay(&mask);
            effects.push((std::mem::take(&mut draft.effects), pieces));
            groups.push(Group { submissions: own, draft });
            masks.push(mask);
        }

        // The last group, which most often is the only one, and with it all that is drawn anew.
        let Drafted { mut draft, pieces } = Stages::time(&mut stages.edit, || drafting.draft(last));
        effects.push((std::mem::take(&mut draft.effects), pieces));
        let last = Group { submissions: last, draft };
        let bricks = merged(&groups, &last.draft.bricks);
        let find = || Stages::time(&mut stages.meshing, || cells_of(world, &last.draft.bricks));
        let (mut dirty, latest) = side_by_side(bricks.len() >= PARALLEL_PLACES, find, || latest(&bricks));
        let before = WorldView {
            samples: world.samples().under(&latest),
            mask: MaskView::new(&world.mask).over(&newer),
            grid: world.grid,
        };
        let mut all_mask;
        let own_mask = Stages::time(&mut stages.ring, || joined_mask(world, &before, &dirty));
        let mask = if groups.is_empty() {
            &own_mask
        } else {
            dirty = Stages::time(&mut stages.meshing, || cells_of(world, &bricks));
            all_mask = newer.clone();
            all_mask.lay(&own_mask);
            &all_mask
        };
        let view = WorldView { mask: MaskView::new(&world.mask).over(mask), ..before };
        let meshes = || redraw::updates(world, &view, backend, &dirty, mask, &mut stages);
        let all = groups.iter().zip(&masks).chain([(&last, &own_mask)]);
        let enter = || enter(world, all.zip(effects));
        let (meshes, entered) = side_by_side(dirty.len() >= PARALLEL_BLOCKS, meshes, enter);

        let (sample_hash, mut uniform) = (last.draft.hash, UniformBricks::default());
        let changes = groups.into_iter().chain([last]).zip(entered.groups).map(|(group, own)| {
            let Draft { bricks, hash, uniform: kinds, .. } = group.draft;
            uniform.extend(kinds);
            let EnteredGroup { fields, mask, replaced_bytes, tags } = own;
            let change = Change { bricks: changed_bricks(bricks), fields, mask, sample_hash: hash };
            let number = group.submissions.first().map_or(0, |first| first.terms.group);
            GroupChange { change, replaced_bytes, group: number, tags }
        });
        let commit = self.commit(changes.collect(), sample_hash, meshes);
        stages.whole = start.elapsed();
        Commit {
            uniform,
            receipts: entered.receipts,
            news: entered.news,
            next_field: entered.next_field,
            stages,
            ..commit
        }
    }
}

/// Enters what edits did into fields and receipts, and what becomes of the mask.
fn enter<'a>(world: &World, groups: impl Iterator<Item = ((&'a Group<'a>, &'a Mask), Effects)>) -> Entered {
    let (mut log, mut receipts) = (FieldLog::new(world), Vec::new());
    let mut newer: FxHashMap<BrickPos, &Brick> = FxHashMap::default();
    let mut groups = groups.peekable();
    let mut entered = Vec::with_capacity(1);
    while let Some(((group, mask), (effects, mut pieces))) = groups.next() {
        let mut effects = effects.into_iter().enumerate();
        let mut tags = Vec::new();
        receipts.reserve_exact(group.submissions.len());
        for submission in group.submissions {
            let outcome = submission.edit.as_ref().map_err(Rejection::clone).and_then(|edit| {
                let (number, effect) = effects.next().unwrap_or_default();
                let applied = log.enter(edit, effect)?;
                if !applied.chunks.is_empty() {
                    tags.push(submission.tag);
                }
                let loose = pieces.remove(&number).unwrap_or_default();
                Ok(Applied { loose, ..applied })
            });
            receipts.push(Receipt { tag: submission.tag, outcome });
        }
        tags.shrink_to_fit();
        // What an earlier group made takes the place of what the world has.
        let replaced = |drafted: &DraftedBrick| match newer.get(&drafted.pos) {
            Some(brick) => brick_bytes(brick),
            None => replaced_bytes(world, drafted.pos),
        };
        let replaced_bytes = group.draft.bricks.iter().map(replaced).sum();
        if groups.peek().is_some() {
            newer.extend(group.draft.bricks.iter().map(|drafted| (drafted.pos, &*drafted.brick)));
        }
        let mask = exact(mask.word_count(), mask.words());
        entered.push(EnteredGroup { fields: log.take_changed(), mask, replaced_bytes, tags });
    }
    Entered { groups: entered, receipts, news: log.news(), next_field: log.next }
}
