//! A transaction: edits in order, or one step through history, from a snapshot to a commit.
//!
//! ```text
//! edits -> bricks -> mask -> dirty blocks -> parts -> chunk meshes
//!                \       \-> touched tiles -> index lists
//!                 \-> fields, receipts
//! step  -> bricks, fields, mask of another time -> the same
//! ```

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use rayon::prelude::*;
use web_time::Instant;

use super::by_brick::PARALLEL_PLACES;
use super::change::{Change, replaced_bytes};
use super::commit::{Commit, Stages};
use super::dirty::{dirty_cells, joined_mask};
use super::drafting::{Drafted, Drafting};
use super::field_log::{FieldLog, FieldNews, news_of_replaced};
use super::history::{HistoryReceipt, HistoryStep, Restored, Step};
use super::loose::{LoosePiece, LooseSettings};
use super::receipt::{Applied, Receipt};
use super::redraw::{self, MeshUpdates};
use super::world::World;
use super::{Submission, Work};
use crate::backend::{Compute, Cpu, Engine, PARALLEL_BLOCKS};
use crate::brush::Edit;
use crate::lattice::{BrickPos, ChunkPos, LatticeBox, side_by_side};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::volume::{
    Brick, DiggingRules, Draft, DraftedBrick, EditEffect, Fields, Replaced, UniformBricks, latest,
    pristine_brick, reach,
};

/// Edits on their way, or a step through history, with the snapshot that they apply to. A clone gives the same commit; a
/// terrain takes one of them.
#[derive(Clone)]
pub struct Transaction {
    pub(super) ticket: u64,
    pub(super) world: Arc<World>,
    pub(super) work: Work,
    /// `None`: edits may do everything.
    pub(super) rules: Option<Arc<DiggingRules>>,
    /// Without them, nobody looks for loose pieces.
    pub(super) loose: Option<LooseSettings>,
    /// Without one, the processor.
    pub(super) engine: Option<Engine>,
}

impl fmt::Debug for Transaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Transaction")
            .field("ticket", &self.ticket)
            .field("edits", &self.len())
            .finish_non_exhaustive()
    }
}

/// What edits come to, bricks and meshes aside.
struct Entered {
    receipts: Vec<Receipt>,
    news: Vec<(ChunkPos, FieldNews)>,
    next_field: u64,
    /// All fields of each chunk that a field changed in.
    fields: Vec<(ChunkPos, Fields)>,
    /// Words of the mask that change.
    mask: Vec<((i32, i32), u64)>,
    /// Bytes of bricks that the change takes away from the world.
    replaced_bytes: usize,
}

/// From how many bricks on lists that are only copied are copied side by side.
const LONG: usize = 1 << 13;

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

impl Transaction {
    /// How many edits it holds; a step through history holds none.
    pub fn len(&self) -> usize {
        match &self.work {
            Work::Edits(submissions) => submissions.len(),
            Work::Step(..) => 0,
        }
    }

    /// Does it hold no edit?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Computes the commit on another engine than the terrain's own.
    pub fn run_on(self, engine: &Engine) -> Commit {
        Self { engine: Some(engine.clone()), ..self }.run()
    }

    /// Computes the commit. Runs on any thread; large transactions use the threads of the current rayon pool, and the
    /// result does not depend on how many those are.
    pub fn run(self) -> Commit {
        let backend = self.engine.as_ref().map_or(&Cpu as &dyn Compute, Engine::compute);
        let run = || match &self.work {
            Work::Edits(submissions) => self.edit(submissions, backend),
            Work::Step(step, target) => self.step(*step, target, backend),
        };
        // All of a large one on a thread of the pool: going there and back for each of its stages takes its time.
        let commit = if self.is_large() { rayon::scope(|_| run()) } else { run() };
        // The terrain and this hold the world. Where others do, the commit changes a copy: better made here than there.
        let (is_shared, mut stages) = (Arc::strong_count(&self.world) > 2, commit.stages);
        let copy = || is_shared.then(|| Arc::new(World::clone(&self.world)));
        let copy = Stages::time(&mut stages.whole, copy);
        Commit { copy, stages, ..commit }
    }

    /// May it reach so many bricks that several threads will work on them?
    fn is_large(&self) -> bool {
        let bricks_of = |reach: LatticeBox| LatticeBox { min: reach.min >> 3, max: reach.max >> 3 }.volume();
        match &self.work {
            Work::Edits(submissions) => {
                let edits = submissions.iter().filter_map(|submission| submission.edit.as_ref().ok());
                let bricks = edits.filter_map(|edit| reach(self.world.grid, edit)).map(bricks_of);
                bricks.fold(0, u64::saturating_add) >= PARALLEL_PLACES as u64
            }
            Work::Step(_, target) => target.change.bricks.len() >= PARALLEL_PLACES,
        }
    }

    fn edit(&self, submissions: &[Submission], backend: &dyn Compute) -> Commit {
        let (world, start, mut stages) = (&*self.world, Instant::now(), Stages::default());
        let edits: Vec<&Edit> = submissions.iter().filter_map(|s| s.edit.as_ref().ok()).collect();
        let Drafted { draft, pieces } = Stages::time(&mut stages.edit, || {
            let drafting = Drafting { world, rules: self.rules.as_deref(), backend };
            match &self.loose {
                Some(settings) => drafting.one_by_one(&edits, settings),
                None => drafting.together(&edits),
            }
        });
        let Draft { bricks: drafted, effects, hash, uniform } = draft;
        let changed = |drafted: &DraftedBrick| (drafted.pos, drafted.changed, drafted.is_extended);
        let dirty = || Stages::time(&mut stages.meshing, || dirty_cells(world.grid, &drafted, changed));
        let (dirty, latest) = side_by_side(drafted.len() >= PARALLEL_PLACES, dirty, || latest(&drafted));
        let before = WorldView { samples: world.samples().under(&latest), ..world.view() };
        let mask = Stages::time(&mut stages.ring, || joined_mask(world, &before, &dirty));
        let view = WorldView { mask: MaskView::new(&world.mask).over(&mask), ..before };
        let meshes = || redraw::updates(world, &view, backend, &dirty, &mask, &mut stages);
        let enter = || self.enter(submissions, effects, pieces, &drafted, &mask);
        let (meshes, entered) = side_by_side(dirty.len() >= PARALLEL_BLOCKS, meshes, enter);

        let change = Change {
            bricks: changed_bricks(drafted),
            fields: entered.fields,
            mask: entered.mask,
            sample_hash: hash,
        };
        let mut commit = self.commit(change, entered.replaced_bytes, meshes, uniform);
        (commit.receipts, commit.news) = (entered.receipts, entered.news);
        commit.next_field = entered.next_field;
        stages.whole = start.elapsed();
        Commit { stages, ..commit }
    }

    /// Enters what edits did into fields and receipts, and what becomes of the mask.
    fn enter(
        &self,
        submissions: &[Submission],
        effects: Vec<EditEffect>,
        mut pieces: BTreeMap<usize, Vec<LoosePiece>>,
        drafted: &[DraftedBrick],
        mask: &Mask,
    ) -> Entered {
        let mut log = FieldLog::new(&self.world);
        let mut effects = effects.into_iter().enumerate();
        let receipts = submissions.iter().map(|submission| {
            let outcome = match &submission.edit {
                Err(error) => Err((*error).into()),
                Ok(edit) => {
                    let (number, effect) = effects.next().unwrap_or_default();
                    log.enter(edit, effect).map(|applied| {
                        let loose = pieces.remove(&number).unwrap_or_default();
                        Applied { loose, ..applied }
                    })
                }
            };
            Receipt { tag: submission.tag, outcome }
        });
        let receipts = receipts.collect();
        let (news, next_field) = (log.news(), log.next);
        let replaced_bytes = replaced_bytes(&self.world, drafted.iter().map(|drafted| drafted.pos));
        let (fields, mask) = (log.fields.into_iter().collect(), mask.words().collect());
        Entered { receipts, news, next_field, fields, mask, replaced_bytes }
    }

    /// Puts in place what a step through history holds.
    fn step(&self, step: HistoryStep, target: &Step, backend: &dyn Compute) -> Commit {
        let (world, start, mut stages) = (&*self.world, Instant::now(), Stages::default());
        let (change, mut bricks) = (target.change.clone(), Vec::with_capacity(target.change.bricks.len()));
        let (mut replaced, mut changed) = (Replaced::default(), Vec::with_capacity(change.bricks.len()));
        Stages::time(&mut stages.edit, || {
            for (pos, after) in &change.bricks {
                let before = world.bricks.get(pos).map(Arc::as_ref);
                let own = replaced.count(&world.ground, *pos, before, after.as_deref());
                let missing = || Arc::new(pristine_brick(&world.ground, *pos));
                let brick = after.clone().unwrap_or_else(missing);
                changed.extend(own.map(|own| (*pos, own)));
                bricks.push((*pos, brick));
            }
        });
        let mut mask = Mask::default();
        change.mask.iter().for_each(|&(word, cells)| mask.lay_word(word, cells));
        let latest: Vec<_> = bricks.iter().map(|(pos, brick)| (*pos, brick.as_ref())).collect();
        let view = WorldView {
            samples: world.samples().under(&latest),
            mask: MaskView::new(&world.mask).over(&mask),
            grid: world.grid,
        };
        let dirty = Stages::time(&mut stages.meshing, || {
            dirty_cells(world.grid, &changed, |&(pos, own)| (pos, own, false))
        });
        let meshes = redraw::updates(world, &view, backend, &dirty, &mask, &mut stages);

        let nothing = Fields::default();
        let news = change.fields.iter().flat_map(|(chunk, after)| {
            let before = world.fields.get(chunk).unwrap_or(&nothing);
            news_of_replaced(before, after).into_iter().map(|news| (*chunk, news))
        });
        let news = news.collect();
        let bounds = changed.iter().map(|&(_, own)| own).reduce(LatticeBox::union);
        let Replaced { removed, added, painted } = replaced;
        let restored = Restored { bounds, removed, added, painted };
        let replaced_bytes = replaced_bytes(world, change.bricks.iter().map(|(pos, _)| *pos));
        let mut commit = self.commit(change, replaced_bytes, meshes, UniformBricks::default());
        commit.moved = Some(HistoryReceipt { step, outcome: Ok(restored) });
        commit.news = news;
        stages.whole = start.elapsed();
        Commit { stages, ..commit }
    }

    /// A commit of what is the same for edits and steps.
    fn commit(
        &self,
        change: Change,
        replaced_bytes: usize,
        meshes: MeshUpdates,
        uniform: UniformBricks,
    ) -> Commit {
        Commit {
            ticket: self.ticket,
            replaced_bytes,
            change,
            uniform,
            next_field: self.world.next_field,
            receipts: Vec::new(),
            moved: None,
            news: Vec::new(),
            copy: None,
            surfaces: meshes.chunks.clone(),
            rings: meshes.tiles.iter().map(|(tile, update)| (*tile, Arc::clone(&update.rings))).collect(),
            meshes,
            stages: Stages::default(),
        }
    }
}
