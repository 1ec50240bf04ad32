//! Creates a terrain from saved data: from parts, or by replaying records.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use super::edit_settings::EditSettings;
use super::model::Terrain;
use super::order::Order;
use super::parts_error::PartsError;
use super::queue::WorkLimits;
use super::receipt::{Receipt, Rejection};
use super::record::{CommitRecord, WorldParts};
use super::resolve::world_of;
use crate::ground::Ground;
use crate::volume::RulesError;
use crate::world::{Patch, TerrainError, TerrainSettings, World};

/// An error of restoring a terrain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RestoreError {
    /// The settings are out of range.
    #[error(transparent)]
    Settings(#[from] TerrainError),
    /// The rules are invalid.
    #[error(transparent)]
    Rules(#[from] RulesError),
    /// Bricks or fields are invalid.
    #[error(transparent)]
    Parts(#[from] PartsError),
    /// Restoring panicked.
    #[error("restoring the world panicked: this is a bug in bevy_burrow")]
    Panicked,
}

/// An error of replaying a record. The terrain may then hold a part of the record, and should be dropped.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The record does not follow the world's revision, or makes more than one commit.
    #[error("the record leads to revision {found}, but the world is at revision {at}")]
    Revision {
        /// The world's.
        at: u64,
        /// The record's.
        found: u64,
    },
    /// The world has another hash than the record says: it is another world, or the record was written by a version of
    /// the crate with another [`Terrain::SIMULATION`].
    #[error("revision {revision} has the hash {found:#018x} here, but {expected:#018x} in the record")]
    Hash {
        /// The record's revision.
        revision: u64,
        /// The hash here.
        found: u64,
        /// The record's.
        expected: u64,
    },
    /// An order was rejected that had been applied.
    #[error("an order of revision {0} is rejected, although the record says that it was applied")]
    Rejected(u64),
    /// The rules are invalid.
    #[error(transparent)]
    Rules(#[from] RulesError),
    /// Bricks or fields are invalid.
    #[error(transparent)]
    Parts(#[from] PartsError),
}

impl ReplayError {
    /// The error of a record of which an order was rejected.
    pub(crate) fn of(why: &Rejection, revision: u64) -> Self {
        match why {
            Rejection::Rules(why) => Self::Rules(*why),
            Rejection::Parts(why) => Self::Parts(why.clone()),
            _ => Self::Rejected(revision),
        }
    }
}

impl WorldParts {
    /// All of a world but its ground, under these rules and settings of loose pieces. Bricks are shared, not copied,
    /// but listing them takes long in a large world.
    pub(crate) fn of(world: &World, edit_settings: EditSettings) -> Self {
        let (change, chunk_size) = (world.all_parts(), world.grid.size() as u32);
        Self { change, chunk_size, revision: world.revision, edit_settings }
    }
}

impl Terrain {
    /// All of the world but its ground, as [`restore`](Self::restore) takes it. Bricks are shared, not copied. History
    /// and what waits are not part of it.
    #[doc(hidden)]
    pub fn parts(&self) -> WorldParts {
        WorldParts::of(&self.world, self.edit_settings.clone())
    }

    /// A terrain from the parts of a world over this ground. Nothing is meshed: surfaces are made when they are asked
    /// for. There is no history.
    ///
    /// Samples and hash do not depend on the chunk size. Fields do: for another size than they were saved with, there
    /// is one for each connected group of boxes around the samples of a brick.
    ///
    /// # Errors
    /// When settings or rules are out of range, or when parts do not fit this ground.
    #[doc(hidden)]
    pub fn restore(
        ground: impl Into<Arc<Ground>>,
        settings: &TerrainSettings,
        parts: WorldParts,
    ) -> Result<Self, RestoreError> {
        let mut terrain = Self::new(ground, settings)?;
        let WorldParts { mut change, chunk_size, revision, edit_settings } = parts;
        if chunk_size != settings.chunk_size {
            change.fields.clear();
            change.fit_fields(terrain.world.grid());
        }
        let ground = terrain.world.shared_ground();
        let made = || world_of(ground, settings.chunk_size as i32, change, revision);
        // Unwind safe: nothing else sees what it makes.
        let world = catch_unwind(AssertUnwindSafe(made)).map_err(|_| RestoreError::Panicked)??;
        terrain.world = Arc::new(world);
        terrain.edit_settings.loose = edit_settings.loose;
        terrain.replace_rules(edit_settings.rules)?;
        Ok(terrain)
    }

    /// Applies a record of a [log](Self::take_log) at once, after everything that waits, and compares the
    /// world with it: its revision, and its hash. Returns the receipts of its orders. A log that this terrain
    /// keeps records it too.
    ///
    /// Fields of steps and of parts belong to the chunk size of the terrain that they were logged by, which this one
    /// needs too.
    ///
    /// A transaction that is running elsewhere is abandoned first; its commit will be rejected as
    /// [stale](super::StaleCommit).
    ///
    /// # Errors
    /// When the record does not follow, or does not lead to the world that it says.
    pub fn replay(&mut self, record: &CommitRecord) -> Result<Vec<Receipt>, ReplayError> {
        self.abandon();
        let waiting = self.finish();
        waiting.into_iter().for_each(|receipt| self.answer(receipt));
        let at = self.world.revision;
        if record.revision != at + u64::from(record.is_commit()) {
            return Err(ReplayError::Revision { at, found: record.revision });
        }
        let limits = std::mem::replace(&mut self.queue.limits, WorkLimits::UNBOUNDED);
        let receipts = self.replay_orders(record);
        self.queue.limits = limits;
        let (receipts, at) = (receipts?, self.world.revision);
        if record.revision != at {
            return Err(ReplayError::Revision { at, found: record.revision });
        }
        let (found, expected) = (self.world.hash(), record.hash);
        if found != expected {
            return Err(ReplayError::Hash { revision: record.revision, found, expected });
        }
        Ok(receipts)
    }

    fn replay_orders(&mut self, record: &CommitRecord) -> Result<Vec<Receipt>, ReplayError> {
        // All of its orders were rejected: a commit that changes nothing.
        let nothing = [Order::parts(Patch::default(), Some(record.hash))];
        let orders = if record.orders.is_empty() { &nothing[..] } else { &record.orders[..] };
        let receipts = self.apply(orders);
        match receipts.iter().find_map(|receipt| receipt.outcome.as_ref().err()) {
            None => Ok(receipts),
            Some(why) => Err(ReplayError::of(why, record.revision)),
        }
    }
}
