//! Replacing parts of a terrain's world, or the ground below it.

use std::sync::Arc;

use super::history::Restored;
use super::model::Terrain;
use super::replacement::{ChangeError, Put};
use crate::ground::Ground;
use crate::world::Patch;

impl Terrain {
    /// Queues parts that replace parts of the world, after everything that was submitted before; for example
    /// a region of another machine's world. The transaction checks them, and if `hash` is given, also that
    /// the world has this hash afterwards. The undo history is cleared, because its steps refer to the
    /// replaced parts. The [receipts](Self::take_change_receipts) arrive in order.
    ///
    /// # Errors
    /// [`ChangeError::Overloaded`] where too much work waits.
    pub fn submit_change(
        &mut self,
        change: impl Into<Arc<Patch>>,
        hash: Option<u64>,
    ) -> Result<(), ChangeError> {
        if !self.queue.has_room_for_step() {
            return Err(ChangeError::Overloaded);
        }
        self.queue.push_put(Put { change: change.into(), hash, counts: true, ground: None });
        Ok(())
    }

    /// Replaces parts at once, after everything that waits; like [`apply`](Self::apply) for brushes.
    ///
    /// # Errors
    /// When the parts are invalid; then nothing has changed.
    pub fn apply_change(
        &mut self,
        change: impl Into<Arc<Patch>>,
        hash: Option<u64>,
    ) -> Result<Restored, ChangeError> {
        self.abandon();
        self.put_now(Put { change: change.into(), hash, counts: true, ground: None })
    }

    fn put_now(&mut self, put: Put) -> Result<Restored, ChangeError> {
        self.queue.push_put(put);
        let receipts = self.finish();
        receipts.into_iter().for_each(|receipt| self.answer(receipt));
        // It was the last one.
        self.change_receipts.pop_back().unwrap_or(Err(ChangeError::Panicked))
    }

    /// Receipts of parts that were [submitted](Self::submit_change), in order; each is returned once. If they are
    /// not taken, the latest 65,536 are kept.
    pub fn take_change_receipts(&mut self) -> Vec<Result<Restored, ChangeError>> {
        std::mem::take(&mut self.change_receipts).into()
    }

    /// Queues another ground of the same size, after everything that was submitted before. Edited samples,
    /// fields and names stay; pristine samples are those of the new ground, and all is as if the world had
    /// been [restored](Self::restore) on it. The world is built in the transaction and meshed from scratch.
    /// The undo history is cleared. The [receipts](Self::take_change_receipts) arrive in order; their counts
    /// are 0.
    ///
    /// # Errors
    /// [`ChangeError::GroundSize`] where the size is another one, and [`ChangeError::Overloaded`] where too much work
    /// waits.
    pub fn submit_ground(&mut self, ground: impl Into<Arc<Ground>>) -> Result<(), ChangeError> {
        let put = self.ground_put(ground.into())?;
        if !self.queue.has_room_for_step() {
            return Err(ChangeError::Overloaded);
        }
        self.queue.push_put(put);
        Ok(())
    }

    /// Sets another ground of the same size at once, after everything that waits; like
    /// [`submit_ground`](Self::submit_ground) otherwise. A transaction that is under way elsewhere is given up first.
    ///
    /// # Errors
    /// [`ChangeError::GroundSize`] where the size is another one; nothing changed then.
    pub fn set_ground(&mut self, ground: impl Into<Arc<Ground>>) -> Result<(), ChangeError> {
        let put = self.ground_put(ground.into())?;
        self.abandon();
        self.put_now(put).map(drop)
    }

    fn ground_put(&self, ground: Arc<Ground>) -> Result<Put, ChangeError> {
        let size = |ground: &Ground| (ground.width(), ground.depth());
        let (found, expected) = (size(&ground), size(&self.world.ground));
        if found != expected {
            return Err(ChangeError::GroundSize { found, expected });
        }
        Ok(Put { change: Arc::default(), hash: None, counts: false, ground: Some(ground) })
    }
}
