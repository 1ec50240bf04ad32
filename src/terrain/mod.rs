//! The model: a world that is edited by ordered transactions. It knows nothing of Bevy's ECS and runs in tests, servers
//! and tools alike.
//!
//! ```
//! use bevy_burrow::prelude::*;
//! use glam::Vec3;
//!
//! let ground = Ground::flat(64, 64, 10.0)?;
//! let mut terrain = Terrain::new(ground, &TerrainSettings::default())?;
//! let receipts = terrain.apply([Brush::dig(Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 4.0))]);
//! assert!(receipts[0].outcome.as_ref().is_ok_and(|applied| applied.removed.total() > 100));
//! assert!(terrain.world().check_seams().is_flawless());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod by_brick;
mod change;
mod commit;
mod dirty;
mod drafting;
mod faults;
mod field_log;
mod groups;
mod history;
mod inspect;
mod loose;
#[cfg(test)]
mod order;
mod query;
mod queue;
mod ray;
mod receipt;
#[cfg(any(feature = "plugin", test))]
mod recipe;
mod redraw;
mod settings;
mod steps;
mod submit;
mod surface;
mod tiles;
mod transaction;
mod triangles;
#[cfg(feature = "plugin")]
mod unseen;
mod world;

pub use commit::{Commit, Stages};
pub use field_log::FieldNews;
pub use history::{History, HistoryReceipt, HistoryRejection, HistoryStep, Restored};
pub use loose::{LoosePiece, LooseSettings, PieceFate, Run};
pub use query::{RayHit, Span};
#[cfg(feature = "plugin")]
pub(crate) use queue::Together;
pub use queue::WorkLimits;
pub use receipt::{Applied, ChunkScenario, Receipt, Rejection, ScenarioCounts};
#[cfg(feature = "plugin")]
pub(crate) use recipe::{SurfaceDraft, SurfaceRecipe, TileDraft};
pub use redraw::MeshUpdates;
pub use settings::{TerrainError, TerrainSettings};
pub use surface::ChunkSurface;
pub use tiles::TileUpdate;
pub use transaction::Transaction;
#[cfg(feature = "plugin")]
pub(crate) use unseen::Unseen;
pub use world::{Drawn, Memory, Version, World};

use std::collections::VecDeque;
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::backend::Engine;
use crate::ground::Ground;
use crate::lattice::LatticeBox;
use crate::volume::{DiggingRules, RulesError};
use history::{DeferredDrop, Step, UndoStack};
use queue::{Queue, Request, Submission, Taken};

/// A commit that its terrain does not wait for: from another terrain, or from a transaction that was given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this terrain does not wait for that commit; its transaction was given up, or belongs to another terrain"
)]
pub struct StaleCommit;

/// Receipts of a commit, and what history lets go of.
pub(crate) type Settled = (Vec<Receipt>, DeferredDrop);

/// A number that no other transaction, batch or world of this process has.
pub(crate) fn unique() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// What one transaction does.
#[derive(Clone)]
enum Work {
    Edits(Arc<[Submission]>),
    /// The step, and what it puts in place.
    Step(HistoryStep, Arc<Step>),
}

/// A world, the edits that wait for it, and the one transaction that may be under way.
///
/// In a Bevy app it is a component, and the plugin runs its transactions: send `Brush` messages, or [`submit`](Self::submit)
/// to it. Committing by oneself, with [`apply`](Self::apply) say, works too: what that changed is shown some frames later.
///
/// The plugin keeps the scale of its `Transform` at the [size of its voxels](TerrainSettings::voxel_size), and overwrites
/// any other; a parent may scale it further.
///
/// To change levels, insert a new one on the same entity. Assigned through `&mut Terrain`, a new one is shown as well, but
/// what waited in the old one goes without a receipt, and debris that fell from it stays.
pub struct Terrain {
    world: Arc<World>,
    engine: Option<Engine>,
    voxel_size: f32,
    queue: Queue,
    in_flight: Option<InFlight>,
    answered: VecDeque<Receipt>,
    rules: Option<Arc<DiggingRules>>,
    loose: Option<LooseSettings>,
    timeline: UndoStack,
    moves: VecDeque<HistoryReceipt>,
    /// What the game committed itself since the plugin last showed the world; `None` while it shows none.
    #[cfg(feature = "plugin")]
    unseen: Option<Unseen>,
}

impl fmt::Debug for Terrain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Terrain")
            .field("world", &self.world)
            .field("voxel_size", &self.voxel_size)
            .field("waiting", &self.queue.len())
            .field("is_busy", &self.in_flight.is_some())
            .finish_non_exhaustive()
    }
}

/// The transaction under way, as far as its terrain keeps it.
struct InFlight {
    ticket: u64,
    work: Work,
    /// How much that is, as the queue counts.
    estimate: u64,
    /// Has the plugin a task for it?
    #[cfg_attr(not(feature = "plugin"), expect(dead_code))]
    is_plugins: bool,
}

impl Terrain {
    /// A terrain that nobody has edited yet.
    ///
    /// # Errors
    /// When the chunk size or the voxel size is out of range.
    pub fn new(ground: impl Into<Arc<Ground>>, settings: &TerrainSettings) -> Result<Self, TerrainError> {
        settings.check()?;
        let world = World::new(ground.into(), settings.chunk_size as i32);
        Ok(Self {
            world: Arc::new(world),
            engine: None,
            voxel_size: settings.voxel_size,
            queue: Queue::default(),
            in_flight: None,
            answered: VecDeque::new(),
            rules: None,
            loose: None,
            timeline: UndoStack::new(steps::UNDO_BUDGET),
            moves: VecDeque::new(),
            #[cfg(feature = "plugin")]
            unseen: None,
        })
    }

    /// From now on, transactions run on this engine. The world is the same whichever it is. Without one of its own a
    /// terrain runs on the processor, or on whatever the plugin has.
    pub fn set_engine(&mut self, engine: Engine) {
        self.engine = Some(engine);
    }

    /// Edits that are submitted from now on obey these rules; those that wait or are under way keep theirs, and what is there
    /// stays as it is. A journal is replayed exactly only if rules change at the same edits.
    ///
    /// # Errors
    /// When the rules name [`MaterialId::GROUND`](crate::ground::MaterialId::GROUND), which no ground has; nothing is changed
    /// then.
    pub fn set_rules(&mut self, rules: DiggingRules) -> Result<(), RulesError> {
        rules.check()?;
        self.rules = (!rules.is_empty()).then(|| Arc::new(rules));
        Ok(())
    }

    /// What edits may do; `None`: everything.
    pub fn rules(&self) -> Option<&DiggingRules> {
        self.rules.as_deref()
    }

    /// The engine of its own, if it has one.
    pub fn engine(&self) -> Option<&Engine> {
        self.engine.as_ref()
    }

    /// Metres along a voxel's side.
    pub fn voxel_size(&self) -> f32 {
        self.voxel_size
    }

    /// The world as last committed.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The world as last committed, to be read elsewhere. While a snapshot is held, the next transaction copies the
    /// world's index, and a commit does so by itself if the snapshot came in between; so let go of it soon.
    pub fn snapshot(&self) -> Arc<World> {
        Arc::clone(&self.world)
    }

    /// Edits that are submitted from now on look for pieces of ground that they cut off, and receipts list them; `None`
    /// turns that off, as it is at first. A terrain whose world has to be the same elsewhere needs the same settings there.
    pub fn set_loose(&mut self, settings: Option<LooseSettings>) {
        self.loose = settings;
    }

    /// What edits look for, if they do.
    pub fn loose(&self) -> Option<&LooseSettings> {
        self.loose.as_ref()
    }

    /// Brushes, and steps through history, that wait for their transaction.
    pub fn queued(&self) -> usize {
        self.queue.len()
    }

    /// Is a transaction under way?
    pub fn is_busy(&self) -> bool {
        self.in_flight.is_some()
    }

    /// Makes one transaction of what is queued: of the brushes up to the first step through history, as many as the
    /// [limits](Self::set_work_limits) allow, or of such a step.
    /// `None` when nothing waits, or when one is under way already. Run it anywhere, then hand its commit to
    /// [`commit`](Self::commit).
    ///
    /// Steps that find nothing to undo or redo need no transaction; they are answered at once.
    #[must_use = "the terrain waits for the commit of its transaction"]
    pub fn begin(&mut self) -> Option<Transaction> {
        self.begin_for(false)
    }

    pub(crate) fn begin_for(&mut self, is_plugins: bool) -> Option<Transaction> {
        if self.is_busy() {
            return None;
        }
        let (work, estimate) = loop {
            match self.queue.take()? {
                (Taken::Edits(edits), estimate) => break (Work::Edits(edits), estimate),
                (Taken::Step(step), estimate) => match self.timeline.next(step) {
                    Some(target) => break (Work::Step(step, Arc::clone(target)), estimate),
                    None => {
                        self.queue.finish(estimate);
                        self.answer_step(step.nothing());
                    }
                },
            }
        };
        let ticket = unique();
        self.in_flight = Some(InFlight { ticket, work: work.clone(), estimate, is_plugins });
        Some(Transaction { ticket, world: self.snapshot(), work, engine: self.engine.clone() })
    }

    /// Makes a transaction's result the world, all at once, and returns the receipts in order of submission.
    ///
    /// # Errors
    /// When the commit is not that of the transaction under way; nothing is changed then.
    pub fn commit(&mut self, commit: Commit) -> Result<Vec<Receipt>, StaleCommit> {
        #[cfg(feature = "plugin")]
        let news = self.note(&commit);
        let (receipts, _) = self.settle(commit)?;
        #[cfg(feature = "plugin")]
        self.enter_unseen(news);
        Ok(receipts)
    }

    /// The same; what history lets go of is left to the caller, who may free it elsewhere.
    fn settle(&mut self, mut commit: Commit) -> Result<Settled, StaleCommit> {
        let done = self.in_flight.take_if(|waiting| waiting.ticket == commit.ticket).ok_or(StaleCommit)?;
        let mut copy = commit.copy.take();
        if Arc::get_mut(&mut self.world).is_none()
            && let Some(copy) = copy.take_if(|copy| copy.version() == self.world.version())
        {
            self.world = copy;
        }
        let installed = commit.install(Arc::make_mut(&mut self.world));
        self.queue.finish(done.estimate);
        installed.moved.into_iter().for_each(|moved| self.answer_step(moved));
        let mut waste = DeferredDrop::default();
        waste.copy = copy;
        for replaced in installed.replaced {
            match &done.work {
                Work::Edits(_) => self.timeline.record(replaced, &mut waste),
                Work::Step(step, used) => self.timeline.passed(*step, used, replaced, &mut waste),
            }
        }
        Ok((installed.receipts, waste))
    }

    /// Gives up the transaction that is under way, whose task was lost; what it had to do is queued again, in front.
    pub fn abandon(&mut self) {
        let Some(lost) = self.in_flight.take() else { return };
        match lost.work {
            Work::Edits(submissions) => self.queue.put_back(submissions.iter().cloned().map(Request::Edit)),
            Work::Step(step, _) => self.queue.put_back(std::iter::once(Request::Step(step))),
        }
    }

    /// Is a transaction under way that the plugin began?
    #[cfg(feature = "plugin")]
    pub(crate) fn waits_for_plugin(&self) -> bool {
        self.in_flight.as_ref().is_some_and(|waiting| waiting.is_plugins)
    }

    /// Forgets what is queued and under way; all of it has been answered.
    #[cfg(feature = "plugin")]
    pub(crate) fn forget(&mut self) {
        self.in_flight = None;
        self.unseen = None;
        self.queue.clear();
    }

    /// Tags of all brushes without a receipt, in order.
    #[cfg(feature = "plugin")]
    pub(crate) fn unanswered(&self) -> impl Iterator<Item = u64> {
        self.submissions_in_flight().chain(self.queue.edits()).map(|submission| submission.tag)
    }

    #[cfg(feature = "plugin")]
    fn submissions_in_flight(&self) -> impl Iterator<Item = &Submission> {
        self.in_flight.iter().flat_map(|waiting| match &waiting.work {
            Work::Edits(submissions) => &submissions[..],
            Work::Step(..) => &[],
        })
    }

    /// Is nothing on its way to these samples? A step through history that waits may reach all that history does. Pieces
    /// that an edit will cut off nobody knows yet; they may reach further than the edit.
    pub fn is_ready(&self, bounds: LatticeBox) -> bool {
        let in_flight = self.in_flight.iter().all(|waiting| match &waiting.work {
            Work::Edits(submissions) => submissions.iter().all(|submission| submission.misses(bounds)),
            Work::Step(_, target) => target.bounds.is_none_or(|own| own.intersection(bounds).is_none()),
        });
        let mut queued = self.queue.iter();
        in_flight
            && queued.all(|request| match request {
                Request::Edit(submission) => submission.misses(bounds),
                Request::Step(_) => !self.timeline.reaches(bounds),
            })
    }
}
