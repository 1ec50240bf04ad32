//! Replaces the ground below a world's edits, for example after a heightmap was loaded again. Edited samples
//! stay as they are; pristine ones come from the new ground.

use std::sync::Arc;

use super::commit::Commit;
use super::history::Restored;
use super::model::Terrain;
use super::put::{ChangeError, Put};
use super::record::{WorldChange, WorldParts};
use super::redraw::MeshUpdates;
use super::replay::RestoreError;
use super::settings::TerrainSettings;
use super::transaction::Transaction;
use super::world::World;
use crate::ground::Ground;
use crate::lattice::BrickPos;
use crate::volume::{Brick, pristine_layers};

impl Terrain {
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
        Ok(Put { change: WorldChange::default(), hash: None, counts: false, ground: Some(ground) })
    }
}

/// The commit that leads to the same edits on another ground.
pub(super) fn put_on(transaction: &Transaction, ground: &Arc<Ground>) -> Result<Commit, ChangeError> {
    let before = &*transaction.world;
    let settings = TerrainSettings { chunk_size: before.grid.size() as u32, ..TerrainSettings::default() };
    let mut change = before.all_parts();
    for (pos, brick) in &mut change.bricks {
        *brick = brick.take().map(|brick| brick_over(ground, *pos, brick));
    }
    let parts = WorldParts {
        change,
        chunk_size: settings.chunk_size,
        revision: before.revision,
        ..WorldParts::default()
    };
    let restored = Terrain::restore(Arc::clone(ground), &settings, parts).map_err(|why| match why {
        RestoreError::Parts(why) => why,
        RestoreError::Settings(_) | RestoreError::Rules(_) => ChangeError::Panicked,
    })?;
    Ok(Commit {
        put: Some(Ok(Restored::default())),
        next_field: restored.world.next_field,
        whole: Some(restored.world),
        ..transaction.commit(Vec::new(), before.sample_hash, MeshUpdates::default())
    })
}

/// The brick with the same edited samples over another ground; the same `Arc` where all its bits are the same.
pub(crate) fn brick_over(ground: &Ground, pos: BrickPos, brick: Arc<Brick>) -> Arc<Brick> {
    let on_ground = brick.on_pristine(&pristine_layers(ground, pos));
    if on_ground.solid() == brick.solid() { brick } else { Arc::new(on_ground) }
}

impl World {
    /// All bricks and fields, in order.
    pub(crate) fn all_parts(&self) -> WorldChange {
        let mut bricks: Vec<(BrickPos, Option<Arc<Brick>>)> =
            self.bricks.iter().map(|(pos, brick)| (*pos, Some(Arc::clone(brick)))).collect();
        bricks.sort_unstable_by_key(|(pos, _)| *pos);
        let mut fields: Vec<_> = self.fields.iter().map(|(chunk, fields)| (*chunk, fields.clone())).collect();
        fields.sort_unstable_by_key(|(chunk, _)| *chunk);
        WorldChange { bricks, fields, next_field: self.next_field }
    }
}
