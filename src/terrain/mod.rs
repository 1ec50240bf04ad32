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

mod inspect;
mod query;
mod ray;
mod receipt;
mod redraw;
mod surface;
mod transaction;
mod world;

pub use query::{RayHit, Span};
pub use receipt::{Applied, ChunkScenario, Receipt, Rejection, ScenarioCounts};
pub use redraw::{MeshUpdates, TileUpdate};
pub use surface::ChunkSurface;
pub use transaction::{Commit, FieldNews, Stages, Transaction};
pub use world::{Drawn, Memory, Version, World};

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::backend::Engine;
use crate::brush::{Brush, BrushError, Edit};
use crate::ground::Ground;
use crate::lattice::LatticeBox;

/// How a terrain is cut up and how large it is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerrainSettings {
    /// Cells along a chunk's side, 8..=128. Small chunks redraw faster, large ones need fewer draws.
    pub chunk_size: u32,
    /// Metres along a voxel's side: a power of two from 1/8 to 8, so that scaling loses no bits. The model itself counts
    /// in voxels.
    pub voxel_size: f32,
}

impl Default for TerrainSettings {
    fn default() -> Self {
        Self { chunk_size: 32, voxel_size: 1.0 }
    }
}

/// Why a terrain can't be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// The chunk size is out of range.
    #[error("chunk size {0} is not in 8..=128")]
    ChunkSize(u32),
    /// The voxel size is no power of two from 1/8 to 8.
    #[error("voxel size {0} is not one of 1/8, 1/4, 1/2, 1, 2, 4, 8")]
    VoxelSize(f32),
}

/// A commit that its terrain does not wait for: from another terrain, or from a transaction that was given up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "this terrain does not wait for that commit; its transaction was given up, or belongs to another terrain"
)]
pub struct StaleCommit;

/// A number that no other transaction or world of this process has.
fn unique() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// A brush on its way into the world.
#[derive(Clone, Debug)]
pub(crate) struct Submission {
    tag: u64,
    edit: Result<Edit, BrushError>,
}

/// A world, the edits that wait for it, and the one transaction that may be under way.
///
/// In a Bevy app it is a component, and the plugin runs its transactions: send `Brush` messages, or [`submit`](Self::submit)
/// to it. Committing by oneself, with [`apply`](Self::apply) say, works too, but then all of its meshes are made again.
pub struct Terrain {
    world: Arc<World>,
    engine: Option<Engine>,
    voxel_size: f32,
    queue: Vec<Submission>,
    in_flight: Option<InFlight>,
    answered: Vec<Receipt>,
}

/// The transaction under way, as far as its terrain keeps it.
struct InFlight {
    ticket: u64,
    submissions: Arc<[Submission]>,
}

impl Terrain {
    /// A terrain that nobody has edited yet.
    ///
    /// # Errors
    /// When the chunk size or the voxel size is out of range.
    pub fn new(ground: impl Into<Arc<Ground>>, settings: &TerrainSettings) -> Result<Self, TerrainError> {
        if !(8..=128).contains(&settings.chunk_size) {
            return Err(TerrainError::ChunkSize(settings.chunk_size));
        }
        if !(-3..=3).any(|power| settings.voxel_size == 2f32.powi(power)) {
            return Err(TerrainError::VoxelSize(settings.voxel_size));
        }
        let world = World::new(ground.into(), settings.chunk_size as i32);
        Ok(Self {
            world: Arc::new(world),
            engine: None,
            voxel_size: settings.voxel_size,
            queue: Vec::new(),
            in_flight: None,
            answered: Vec::new(),
        })
    }

    /// From now on, transactions run on this engine. The world is the same whichever it is. Without one of its own a
    /// terrain runs on the processor, or on whatever the plugin has.
    pub fn set_engine(&mut self, engine: Engine) {
        self.engine = Some(engine);
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

    /// The world as last committed, to be read elsewhere. While a snapshot is held, the next commit copies the world's
    /// index first, so let go of it soon.
    pub fn snapshot(&self) -> Arc<World> {
        Arc::clone(&self.world)
    }

    /// Queues a brush. One that is not valid is queued too: its receipt says why it was rejected.
    pub fn submit(&mut self, brush: &Brush) {
        self.queue.push(Submission { tag: brush.tag, edit: Edit::quantize(brush) });
    }

    /// Queues an edit, say from a file or the network. It is checked like a brush.
    pub fn submit_edit(&mut self, edit: &Edit) {
        self.queue.push(Submission { tag: edit.tag(), edit: edit.check().map(|()| edit.clone()) });
    }

    /// Queues a brush if it reaches some column of this world; says whether it does.
    ///
    /// # Errors
    /// When the brush is not valid; it is not queued then.
    pub fn offer(&mut self, brush: &Brush) -> Result<bool, BrushError> {
        let edit = Edit::quantize(brush)?;
        let is_in_reach = edit.reach().intersection(self.world.grid.edit_bounds()).is_some();
        if is_in_reach {
            self.queue.push(Submission { tag: brush.tag, edit: Ok(edit) });
        }
        Ok(is_in_reach)
    }

    /// Brushes that wait for their transaction.
    pub fn queued(&self) -> usize {
        self.queue.len()
    }

    /// Is a transaction under way?
    pub fn is_busy(&self) -> bool {
        self.in_flight.is_some()
    }

    /// Makes one transaction of everything queued; `None` when nothing is, or when one is under way already. Run it
    /// anywhere, then hand its commit to [`commit`](Self::commit).
    pub fn begin(&mut self) -> Option<Transaction> {
        if self.queue.is_empty() || self.is_busy() {
            return None;
        }
        let submissions: Arc<[Submission]> = std::mem::take(&mut self.queue).into();
        let ticket = unique();
        self.in_flight = Some(InFlight { ticket, submissions: Arc::clone(&submissions) });
        Some(Transaction::new(ticket, self.snapshot(), submissions, self.engine.clone()))
    }

    /// Makes a transaction's result the world, all at once, and returns the receipts in order of submission.
    ///
    /// # Errors
    /// When the commit is not that of the transaction under way; nothing is changed then.
    pub fn commit(&mut self, commit: Commit) -> Result<Vec<Receipt>, StaleCommit> {
        self.in_flight.take_if(|waiting| waiting.ticket == commit.ticket()).ok_or(StaleCommit)?;
        Ok(commit.install(Arc::make_mut(&mut self.world)))
    }

    /// Gives up the transaction that is under way, whose task was lost; its edits are queued again, in front.
    pub fn abandon(&mut self) {
        if let Some(lost) = self.in_flight.take() {
            self.queue.splice(0..0, lost.submissions.iter().cloned());
        }
    }

    /// Applies brushes at once, after everything that waits: queue, transaction and commit in one call, on this thread.
    /// Returns the receipts of these brushes; those of brushes that waited are kept for [`take_answered`](Self::take_answered). Tools and tests want this; a game lets the plugin do it.
    ///
    /// A transaction that is under way elsewhere is given up first; its commit will be refused as stale.
    pub fn apply<'a, B: std::borrow::Borrow<Brush> + 'a>(
        &mut self,
        brushes: impl IntoIterator<Item = B>,
    ) -> Vec<Receipt> {
        self.abandon();
        let waiting = self.queue.len();
        for brush in brushes {
            self.submit(brush.borrow());
        }
        let Some(transaction) = self.begin() else { return Vec::new() };
        let mut receipts = self.commit(transaction.run()).unwrap_or_default();
        let own = receipts.split_off(waiting.min(receipts.len()));
        self.answered.append(&mut receipts);
        own
    }

    /// Receipts of brushes that waited when [`apply`](Self::apply) was called, in order; each is handed out once.
    pub fn take_answered(&mut self) -> Vec<Receipt> {
        std::mem::take(&mut self.answered)
    }

    /// Is there any receipt to [take](Self::take_answered)?
    pub fn has_answered(&self) -> bool {
        !self.answered.is_empty()
    }

    /// Tags of all brushes without a receipt, in order.
    #[cfg(feature = "plugin")]
    pub(crate) fn unanswered(&self) -> impl Iterator<Item = u64> {
        let in_flight = self.in_flight.iter().flat_map(|waiting| waiting.submissions.iter());
        in_flight.chain(&self.queue).map(|submission| submission.tag)
    }

    /// Is no edit on its way to these samples?
    pub fn is_ready(&self, bounds: LatticeBox) -> bool {
        let in_flight = self.in_flight.iter().flat_map(|waiting| waiting.submissions.iter());
        let mut coming = in_flight.chain(&self.queue).filter_map(|submission| submission.edit.as_ref().ok());
        coming.all(|edit| edit.reach().intersection(bounds).is_none())
    }
}
