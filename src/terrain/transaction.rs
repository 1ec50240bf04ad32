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

use web_time::Instant;

use super::change::{Change, replaced_bytes};
use super::commit::{Commit, Stages};
use super::dirty::{dirty_cells, joined_mask, sheets_in_reach};
use super::drafting::{Drafted, Drafting};
use super::field_log::{FieldLog, FieldNews, news_of_replaced};
use super::history::{HistoryReceipt, HistoryStep, Restored, Step};
use super::loose::{LoosePiece, LooseSettings};
use super::receipt::{Applied, Receipt};
use super::redraw::{self, MeshUpdates, side_by_side};
use super::world::World;
use super::{Submission, Work};
use crate::backend::{Compute, Cpu, Engine};
use crate::brush::Edit;
use crate::lattice::{ChunkPos, LatticeBox};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::volume::{Bricks, DiggingRules, Draft, Fields, Replaced, UniformBricks, pristine_brick};

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

/// What edits come to, meshes aside.
struct Entered {
    receipts: Vec<Receipt>,
    news: Vec<(ChunkPos, FieldNews)>,
    next_field: u64,
    change: Change,
    /// Bytes of bricks that the change takes away from the world.
    replaced_bytes: usize,
    uniform: UniformBricks,
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
        let commit = match &self.work {
            Work::Edits(submissions) => self.edit(submissions, backend),
            Work::Step(step, target) => self.step(*step, target, backend),
        };
        // The terrain and this hold the world. Where others do, the commit changes a copy: better made here than there.
        let is_shared = Arc::strong_count(&self.world) > 2;
        Commit { copy: is_shared.then(|| Arc::new(World::clone(&self.world))), ..commit }
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
        // Three things that do not depend on each other: new bricks as a table, cells to mesh, cells that may join the mask.
        let (drafted, Stages { edit, meshing, ring, .. }) = (&draft.bricks, &mut stages);
        let table = || drafted.iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))).collect();
        let table = || -> Bricks { Stages::time(edit, table) };
        let changed = || drafted.iter().map(|drafted| (drafted.pos, drafted.changed));
        let dirty = || Stages::time(meshing, || dirty_cells(world.grid, changed()));
        let near = || Stages::time(ring, || sheets_in_reach(world, drafted));
        let count = drafted.len();
        let (bricks, (dirty, near)) = side_by_side(count, table, || side_by_side(count, dirty, near));

        let before = WorldView { samples: world.samples().over(&bricks), ..world.view() };
        let mask = Stages::time(&mut stages.ring, || joined_mask(&before, &near));
        let view = WorldView { mask: MaskView::new(&world.mask).over(&mask), ..before };
        let meshes = || redraw::updates(world, &view, backend, &dirty, &mask, &mut stages);
        let enter = || self.enter(submissions, draft, pieces, &mask);
        let (meshes, entered) = side_by_side(dirty.len(), meshes, enter);

        let mut commit = self.commit(entered.change, entered.replaced_bytes, meshes, entered.uniform);
        (commit.receipts, commit.news) = (entered.receipts, entered.news);
        commit.next_field = entered.next_field;
        stages.whole = start.elapsed();
        Commit { stages, ..commit }
    }

    /// Enters what edits did into fields and receipts, and what they change in the world.
    fn enter(
        &self,
        submissions: &[Submission],
        draft: Draft,
        mut pieces: BTreeMap<usize, Vec<LoosePiece>>,
        mask: &Mask,
    ) -> Entered {
        let mut log = FieldLog::new(&self.world);
        let mut effects = draft.effects.into_iter().enumerate();
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
        // Kept as long as history has it: no larger than it has to be.
        let mut bricks = Vec::with_capacity(draft.bricks.len());
        bricks.extend(draft.bricks.into_iter().map(|drafted| (drafted.pos, Some(drafted.brick))));
        let change = Change {
            bricks,
            fields: log.fields.into_iter().collect(),
            mask: mask.words().collect(),
            sample_hash: draft.hash,
        };
        let replaced_bytes = replaced_bytes(&self.world, &change.bricks);
        Entered { receipts, news, next_field, change, replaced_bytes, uniform: draft.uniform }
    }

    /// Puts in place what a step through history holds.
    fn step(&self, step: HistoryStep, target: &Step, backend: &dyn Compute) -> Commit {
        let (world, start, mut stages) = (&*self.world, Instant::now(), Stages::default());
        let (change, mut bricks) = (target.change.clone(), Bricks::default());
        let (mut replaced, mut changed) = (Replaced::default(), Vec::with_capacity(change.bricks.len()));
        Stages::time(&mut stages.edit, || {
            for (pos, after) in &change.bricks {
                let before = world.bricks.get(pos).map(Arc::as_ref);
                let own = replaced.count(&world.ground, *pos, before, after.as_deref());
                let missing = || Arc::new(pristine_brick(&world.ground, *pos));
                let brick = after.clone().unwrap_or_else(missing);
                changed.extend(own.map(|own| (*pos, own)));
                bricks.insert(*pos, brick);
            }
        });
        let mut mask = Mask::default();
        change.mask.iter().for_each(|&(word, cells)| mask.lay_word(word, cells));
        let view = WorldView {
            samples: world.samples().over(&bricks),
            mask: MaskView::new(&world.mask).over(&mask),
            grid: world.grid,
        };
        let dirty = Stages::time(&mut stages.meshing, || dirty_cells(world.grid, changed.iter().copied()));
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
        let replaced_bytes = replaced_bytes(world, &change.bricks);
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
