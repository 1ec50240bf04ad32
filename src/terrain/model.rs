//! The terrain: a world, the edits that wait for it, and the one transaction that may be running.

use std::collections::VecDeque;
use std::fmt;
use std::sync::Arc;

use super::commit::Commit;
use super::edit_settings::EditSettings;
use super::history::{DeferredDrop, Step, UndoStack};
use super::log::CommitLog;
use super::order::Order;
#[cfg(feature = "plugin")]
use super::pending_display::PendingDisplay;
use super::queue::Queue;
use super::receipt::{Receipt, Rejection};
use super::transaction::Transaction;
use super::work::Work;
use crate::backend::Engine;
use crate::ground::Ground;
use crate::lattice::LatticeBox;
use crate::loose::LooseSettings;
use crate::redraw::{ChooseCut, DrawnCut};
use crate::volume::{DiggingRules, RulesError};
use crate::world::{Meshing, TerrainError, TerrainSettings, World, unique};

/// Bytes that a terrain's history may take unless [`Terrain::set_undo_budget`] says otherwise.
pub(super) const UNDO_BUDGET: usize = 64 << 20;

/// A commit that its terrain does not wait for: from another terrain, or from a transaction that was given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this terrain is not waiting for that commit: its transaction was abandoned, or belongs to another terrain"
)]
pub struct StaleCommit;

/// A world, the edits that wait for it, and the one transaction that may be under way.
///
/// In a Bevy app it is a component, and the plugin runs its transactions: send `Brush` messages, or
/// [`submit`](Self::submit) to it. A game may also commit directly, for example with [`apply`](Self::apply);
/// the change is shown some frames later.
///
/// The plugin keeps the scale of its `Transform` at the [size of its voxels](TerrainSettings::voxel_size), and
/// overwrites any other; a parent may scale it further.
///
/// To change levels, insert a new one on the same entity, with its own `SavedWorld` if it is saved. A terrain that is
/// assigned through `&mut Terrain` is shown too, but edits that waited in the old one get no receipts, and its debris
/// stays.
pub struct Terrain {
    pub(super) world: Arc<World>,
    engine: Option<Engine>,
    voxel_size: f32,
    pub(super) queue: Queue,
    pub(super) in_flight: Option<InFlight>,
    pub(super) receipts: VecDeque<Receipt>,
    /// What edits obey that are submitted from now on.
    pub(super) edit_settings: EditSettings,
    pub(super) undo_stack: UndoStack,
    pub(super) log: Option<CommitLog>,
    pub(super) meshing: Meshing,
    pub(super) drawn_cut: Option<Arc<DrawnCut>>,
    /// Commits of the game since the plugin last showed the world; `None` while the plugin does not show it.
    #[cfg(feature = "plugin")]
    pub(super) pending_display: Option<PendingDisplay>,
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

/// A terrain's record of the running transaction.
pub(super) struct InFlight {
    pub ticket: u64,
    pub work: Work,
    /// The transaction's work, in the units of the queue.
    estimate: u64,
    /// Whether the plugin runs it.
    #[cfg_attr(not(feature = "plugin"), expect(dead_code))]
    pub is_plugins: bool,
}

impl Terrain {
    /// Changes when the same edits of the same ground no longer give the same [hash](World::hash): a log that was
    /// written under another number can't be replayed.
    pub const SIMULATION: u32 = 2;

    /// A terrain without edits.
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
            receipts: VecDeque::new(),
            edit_settings: EditSettings::default(),
            undo_stack: UndoStack::new(UNDO_BUDGET),
            log: None,
            meshing: Meshing::default(),
            drawn_cut: None,
            #[cfg(feature = "plugin")]
            pending_display: None,
        })
    }

    /// Sets the engine that runs later transactions. The result is the same on every engine. The default is
    /// the plugin's engine, or the CPU without the plugin.
    pub fn set_engine(&mut self, engine: Engine) {
        self.engine = Some(engine);
    }

    /// Sets the rules for edits that are submitted later. Edits that wait or are under way keep theirs. A journal is
    /// replayed exactly only if rules change at the same edits.
    ///
    /// # Errors
    /// When the rules name [`MaterialId::GROUND`](crate::ground::MaterialId::GROUND), which no ground has; nothing is
    /// changed then.
    pub fn set_rules(&mut self, rules: DiggingRules) -> Result<(), RulesError> {
        self.replace_rules(Some(Arc::new(rules)))
    }

    pub(super) fn replace_rules(&mut self, rules: Option<Arc<DiggingRules>>) -> Result<(), RulesError> {
        rules.as_deref().map_or(Ok(()), DiggingRules::check)?;
        self.edit_settings.rules = rules.filter(|rules| !rules.is_empty());
        self.log_settings();
        Ok(())
    }

    /// The rules for edits; `None` if there are none.
    pub fn rules(&self) -> Option<&DiggingRules> {
        self.edit_settings.rules.as_deref()
    }

    /// The engine that was set for this terrain.
    pub fn engine(&self) -> Option<&Engine> {
        self.engine.as_ref()
    }

    /// The side of a voxel, in metres.
    pub fn voxel_size(&self) -> f32 {
        self.voxel_size
    }

    /// The world as last committed.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The world as last committed, to be read elsewhere. Drop it soon: while a snapshot is held, the next transaction
    /// has to copy the world's index, or its commit does, if the snapshot was taken in between.
    pub fn snapshot(&self) -> Arc<World> {
        Arc::clone(&self.world)
    }

    /// Makes later edits search for pieces of ground that they cut off, which receipts then list.
    /// `None`, the default, turns that off. Terrains that must have equal worlds need equal settings.
    pub fn set_loose(&mut self, settings: Option<LooseSettings>) {
        self.edit_settings.loose = settings;
        self.log_settings();
    }

    /// The settings of the search for loose pieces.
    pub fn loose(&self) -> Option<&LooseSettings> {
        self.edit_settings.loose.as_ref()
    }

    /// The rules and the search for loose pieces of edits that are submitted from now on.
    #[cfg(any(feature = "net", all(feature = "plugin", feature = "store")))]
    pub(crate) fn edit_settings(&self) -> &EditSettings {
        &self.edit_settings
    }

    /// The number of orders that wait for their transaction.
    pub fn queued(&self) -> usize {
        self.queue.len()
    }

    /// Returns `true` while a transaction is running.
    pub fn is_busy(&self) -> bool {
        self.in_flight.is_some()
    }

    /// Makes one transaction of what is queued: of the edits up to the first other order, as many as the
    /// [limits](Self::set_work_limits) allow, or of such an order.
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
            let Some((orders, estimate)) = self.queue.take() else {
                // Steps that found nothing may have been the last that waited.
                self.log_settings();
                return None;
            };
            let step = orders.first().and_then(|first| Step::of(first.kind()));
            let target = step.and_then(|step| self.undo_stack.next(step)).cloned();
            match step.filter(|_| target.is_none()) {
                None => break (Work::Orders(orders, target), estimate),
                Some(step) => {
                    self.queue.finish(estimate);
                    self.answer(step.nothing());
                }
            }
        };
        Some(self.start(work, estimate, is_plugins))
    }

    /// Makes a transaction of work that is not queued, unless one is under way.
    pub(super) fn begin_work(&mut self, work: Work, is_plugins: bool) -> Option<Transaction> {
        (!self.is_busy()).then(|| self.start(work, 0, is_plugins))
    }

    fn start(&mut self, work: Work, estimate: u64, is_plugins: bool) -> Transaction {
        let ticket = unique();
        self.in_flight = Some(InFlight { ticket, work: work.clone(), estimate, is_plugins });
        self.transaction(ticket, work)
    }

    /// A transaction on the present world.
    pub(super) fn transaction(&self, ticket: u64, work: Work) -> Transaction {
        Transaction {
            ticket,
            world: self.snapshot(),
            work,
            engine: self.engine.clone(),
            drawn_cut: self.drawn_cut.clone(),
            meshing: self.meshing,
            is_logged: self.log.is_some(),
        }
    }

    /// Makes a transaction's result the world, all at once, and returns the receipts in order of submission.
    ///
    /// # Errors
    /// When the commit is not that of the transaction under way; nothing is changed then.
    pub fn commit(&mut self, commit: Commit) -> Result<Vec<Receipt>, StaleCommit> {
        #[cfg(feature = "plugin")]
        let news = self.pending_display.is_some().then(|| PendingDisplay::of(&commit, self.world.version()));
        let (receipts, _) = self.install(commit)?;
        #[cfg(feature = "plugin")]
        if let (Some(pending), Some(news)) = (&mut self.pending_display, news) {
            pending.add(news, self.world.version());
        }
        Ok(receipts)
    }

    /// Commits without notifying the plugin; the caller may drop the replaced data on another thread.
    pub(super) fn install(
        &mut self,
        mut commit: Commit,
    ) -> Result<(Vec<Receipt>, DeferredDrop), StaleCommit> {
        let done = self.in_flight.take_if(|waiting| waiting.ticket == commit.ticket).ok_or(StaleCommit)?;
        if let Some(drawn) = commit.drawn_cut.take() {
            self.drawn_cut = Some(drawn);
        }
        // The world stays as it is.
        if done.work.is_cut() {
            return Ok(Default::default());
        }
        let mut copy = commit.copy.take();
        if let Some(whole) = commit.outcome.whole.take() {
            copy = Some(std::mem::replace(&mut self.world, whole));
            self.drawn_cut = None;
            #[cfg(feature = "plugin")]
            self.forget_pending_display();
        }
        if Arc::get_mut(&mut self.world).is_none()
            && let Some(copy) = copy.take_if(|copy| copy.version() == self.world.version())
        {
            self.world = copy;
        }
        let record = commit.record.take();
        let installed = commit.install(Arc::make_mut(&mut self.world));
        self.queue.finish(done.estimate);
        let mut dropped = DeferredDrop::default();
        if let Some(log) = &mut self.log {
            log.enter(&self.world, record.unwrap_or_default(), &mut dropped.records);
        }
        self.log_settings();
        dropped.copy = copy;
        let order = done.work.submissions().first().and_then(|first| first.order.as_ref().ok());
        let replaces_parts = order.is_some_and(Order::replaces_parts);
        // Undo steps recorded before the replacement refer to parts that no longer exist.
        if replaces_parts && installed.receipts.iter().all(|receipt| receipt.outcome.is_ok()) {
            self.undo_stack.clear(&mut dropped);
        }
        for replaced in installed.replaced {
            match (order.and_then(|order| Step::of(order.kind())), done.work.target()) {
                (Some(step), Some(used)) => self.undo_stack.record_step(step, used, replaced, &mut dropped),
                _ if replaces_parts => dropped.add(replaced),
                _ => self.undo_stack.record(replaced, &mut dropped),
            }
        }
        Ok((installed.receipts, dropped))
    }

    /// Abandons the running transaction, for example because its task was lost. Its work is queued again, in
    /// front.
    pub fn abandon(&mut self) {
        let Some(lost) = self.in_flight.take() else { return };
        // A new cut was not queued either.
        self.queue.put_back(lost.work.submissions());
    }

    /// Whether no queued or running edit changes these samples. A queued step counts as reaching everything in the
    /// history. Loose pieces are not predicted: a piece may reach farther than the edit that cuts it off.
    pub fn is_ready(&self, bounds: LatticeBox) -> bool {
        let misses = |order: &Result<Order, Rejection>, step: &dyn Fn() -> bool| {
            order.as_ref().map_or(true, |order| order.misses(bounds, step))
        };
        let in_flight = self.in_flight.iter().all(|waiting| {
            let own = waiting.work.target().and_then(|target| target.bounds);
            let step = || own.is_some_and(|own| own.intersection(bounds).is_some());
            waiting.work.submissions().iter().all(|own| misses(&own.order, &step))
        });
        let step = || self.undo_stack.reaches(bounds);
        in_flight && self.queue.iter().all(|own| misses(&own.order, &step))
    }

    /// The cut that is drawn; `None` if all of the world is drawn in full detail.
    #[doc(hidden)]
    pub fn drawn_cut(&self) -> Option<&Arc<DrawnCut>> {
        self.drawn_cut.as_ref()
    }

    /// Draws the nodes of a cut from now on. With `None`, or with a cut for a world of another size, draws
    /// all of the world in full detail. All meshes have to be made again, with [`World::draw_cut`]. A running
    /// transaction is abandoned, and its work queued again.
    #[doc(hidden)]
    pub fn set_drawn_cut(&mut self, drawn: Option<Arc<DrawnCut>>) {
        self.abandon();
        self.drawn_cut = drawn.filter(|drawn| self.world.has_cut(drawn.cut()));
    }

    /// Makes a transaction without edits that leads to another cut; its commit's [`nodes`](super::MeshUpdates::nodes)
    /// are what has to be drawn. `None` while another transaction is under way, and where all of the world is drawn in
    /// full.
    #[doc(hidden)]
    #[must_use = "the terrain waits for the commit of its transaction"]
    pub fn begin_cut(&mut self, choose: Arc<ChooseCut>) -> Option<Transaction> {
        self.begin_cut_for(choose, false)
    }

    pub(crate) fn begin_cut_for(&mut self, choose: Arc<ChooseCut>, is_plugins: bool) -> Option<Transaction> {
        self.drawn_cut.as_ref()?;
        self.begin_work(Work::Cut(choose), is_plugins)
    }

    /// Sets which surfaces later transactions build. [`Meshing::Never`] drops all surfaces,
    /// for terrains that are never shown. A plugin that shows the terrain does not notice changes
    /// then.
    pub fn set_meshing(&mut self, meshing: Meshing) {
        if meshing == Meshing::Never && self.meshing != meshing {
            self.abandon();
            Arc::make_mut(&mut self.world).meshes.forget();
        }
        self.meshing = meshing;
    }

    /// The surfaces that transactions make.
    #[doc(hidden)]
    pub fn meshing(&self) -> Meshing {
        self.meshing
    }

    /// Changes the world in a test.
    #[cfg(test)]
    pub(crate) fn edit_world(&mut self, edit: impl FnOnce(&mut World)) {
        edit(Arc::make_mut(&mut self.world));
    }
}
