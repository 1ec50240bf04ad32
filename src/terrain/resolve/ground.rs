//! Replaces the ground below a world's edits, for example after a heightmap was loaded again. Edited samples
//! stay as they are; pristine ones come from the new ground.

use std::sync::Arc;

use super::parts::ChangeError;
use crate::ground::Ground;
use crate::redraw::MeshUpdates;
use crate::terrain::commit::Commit;
use crate::terrain::history::Restored;
use crate::terrain::model::Terrain;
use crate::terrain::record::WorldParts;
use crate::terrain::replay::RestoreError;
use crate::terrain::transaction::Transaction;
use crate::world::{TerrainSettings, brick_over};

/// The commit that leads to the same edits on another ground.
pub(crate) fn put_on(transaction: &Transaction, ground: &Arc<Ground>) -> Result<Commit, ChangeError> {
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
