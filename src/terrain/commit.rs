//! The result of a transaction, and how it becomes the world.

use std::sync::Arc;
use std::time::Duration;

use web_time::Instant;

use super::change::Change;
use super::field_log::FieldNews;
use super::history::{HistoryReceipt, Step};
use super::receipt::Receipt;
use super::redraw::MeshUpdates;
use super::surface::ChunkSurface;
use super::world::World;
use crate::lattice::{ChunkPos, TilePos};
use crate::surface::tile::Rings;
use crate::volume::UniformBricks;

/// The result of a transaction: only what changed.
pub struct Commit {
    pub(super) ticket: u64,
    pub(super) change: Change,
    /// Bytes of bricks that the change takes away from the world.
    pub(super) replaced_bytes: usize,
    pub(super) uniform: UniformBricks,
    pub(super) next_field: u64,
    pub(super) receipts: Vec<Receipt>,
    pub(super) moved: Option<HistoryReceipt>,
    pub(super) news: Vec<(ChunkPos, FieldNews)>,
    pub(super) surfaces: Vec<(ChunkPos, Arc<ChunkSurface>)>,
    pub(super) rings: Vec<(TilePos, Arc<Rings>)>,
    /// Meshes to be swapped together with this commit. The world keeps its own.
    pub meshes: MeshUpdates,
    /// Where the time went.
    pub stages: Stages,
}

/// How long the stages of a transaction took. In large ones tiles and chunks are made side by side, so stages may take
/// longer than the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stages {
    /// Edits, from distances to new bricks.
    pub edit: Duration,
    /// Marching cubes over dirty blocks, and finding these.
    pub meshing: Duration,
    /// Putting parts among those that stay.
    pub assembly: Duration,
    /// The mask, rings and index lists.
    pub ring: Duration,
    /// The whole transaction: the above, fields and receipts.
    pub whole: Duration,
}

impl Stages {
    /// Calls `work`, and adds the time it takes to what `stage` names.
    pub(super) fn time<T>(stage: &mut Duration, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        *stage += start.elapsed();
        result
    }
}

/// What a commit leaves behind.
pub(super) struct Installed {
    pub receipts: Vec<Receipt>,
    /// What became of a step through history, if the commit was one.
    pub moved: Option<HistoryReceipt>,
    /// What was replaced; `None` where nothing was.
    pub replaced: Option<Step>,
}

impl Commit {
    /// Hash of every edited sample, once this is committed: equal for equal edits of equal samples, whatever ran them.
    pub fn sample_hash(&self) -> u64 {
        self.change.sample_hash
    }

    /// What happens to fields when this is committed, by chunk.
    pub fn field_news(&self) -> &[(ChunkPos, FieldNews)] {
        &self.news
    }

    /// Makes this the world.
    pub(super) fn install(mut self, world: &mut World) -> Installed {
        self.change.swap(world);
        world.uniform.extend(self.uniform);
        for (chunk, surface) in self.surfaces {
            if surface.is_empty() {
                world.surfaces.remove(&chunk);
            } else {
                world.surfaces.insert(chunk, surface);
            }
        }
        for (tile, rings) in self.rings {
            if rings.is_empty() {
                world.rings.remove(&tile);
            } else {
                world.rings.insert(tile, rings);
            }
        }
        world.next_field = self.next_field;
        world.revision += 1;
        let replaced = (!self.change.bricks.is_empty()).then(|| Step::new(self.change, self.replaced_bytes));
        Installed { receipts: self.receipts, moved: self.moved, replaced }
    }
}
