//! A transaction: edits in order, or one step through history, from a snapshot to a commit.
//!
//! ```text
//! edits -> bricks -> mask -> dirty blocks -> parts -> chunk meshes
//!                \       \-> touched tiles -> index lists
//!                 \-> fields, receipts
//! step  -> bricks, fields, mask of another time -> the same
//! ```

use std::fmt;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;

use web_time::Instant;

use super::Work;
use super::by_brick::PARALLEL_PLACES;
use super::change::{GroupChange, replaced_bytes};
use super::commit::{Commit, Stages};
use super::dirty::dirty_cells;
use super::field_log::news_of_replaced;
use super::history::{HistoryReceipt, HistoryStep, Restored, Step};
use super::redraw::{self, MeshUpdates};
use super::world::World;
use crate::backend::{Compute, Cpu, Engine};
use crate::edits::{Replaced, reach};
use crate::lattice::LatticeBox;
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::volume::pristine_brick;
use crate::volume::{Fields, UniformBricks};

/// Edits on their way, or a step through history, with the snapshot that they apply to. A clone gives the same commit; a
/// terrain takes one of them.
#[derive(Clone)]
pub struct Transaction {
    pub(super) ticket: u64,
    pub(super) world: Arc<World>,
    pub(super) work: Work,
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

/// A transaction panicked.
#[derive(Debug)]
pub(super) struct Panicked;

impl Transaction {
    /// Its number.
    #[cfg(feature = "plugin")]
    pub(crate) fn ticket(&self) -> u64 {
        self.ticket
    }

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
    ///
    /// An edit that panics is [rejected](super::Rejection::Panicked), and the others are applied without it.
    pub fn run(self) -> Commit {
        self.attempt().unwrap_or_else(|_| self.run_without_faults())
    }

    /// Computes the commit, or tells that it panicked: then nothing has changed.
    pub(super) fn attempt(&self) -> Result<Commit, Panicked> {
        // What a transaction reads is the world's, which it does not change, and lists that are cleared before use.
        std::panic::catch_unwind(AssertUnwindSafe(|| self.compute())).map_err(|_| Panicked)
    }

    fn compute(&self) -> Commit {
        let backend = self.engine.as_ref().map_or(&Cpu as &dyn Compute, Engine::compute);
        #[cfg(test)]
        super::order::panic_if_told(&self.work);
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
        let restored = Restored { tags: target.tags.clone(), bounds, removed, added, painted };
        let replaced_bytes = change.bricks.iter().map(|(pos, _)| replaced_bytes(world, *pos)).sum();
        let sample_hash = change.sample_hash;
        let change = GroupChange { change, replaced_bytes, group: target.group, tags: target.tags.clone() };
        stages.whole = start.elapsed();
        Commit {
            moved: Some(HistoryReceipt { step, outcome: Ok(restored) }),
            news,
            stages,
            ..self.commit(vec![change], sample_hash, meshes)
        }
    }

    /// A commit of changes and of what is drawn then.
    pub(super) fn commit(&self, changes: Vec<GroupChange>, sample_hash: u64, meshes: MeshUpdates) -> Commit {
        Commit {
            ticket: self.ticket,
            changes,
            sample_hash,
            uniform: UniformBricks::default(),
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
