//! Effects of edits: the changed samples of bricks, and for each edit the chunks it reaches and the voxels it counts.

use std::collections::BTreeMap;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::lattice::{BrickPos, ChunkPos, LatticeBox};
use crate::volume::{Brick, Bricks, MaterialCounts, Refused, SampleView, UniformKind, VoxelOutcome};

/// The part of an edit's changes that lies in one chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ChunkEffect {
    pub chunk: ChunkPos,
    /// Box around the samples that changed, all of them inside the chunk.
    pub bounds: LatticeBox,
}

/// The effect of one edit.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct EditEffect {
    /// Each chunk whose samples changed, in order.
    pub chunks: Vec<ChunkEffect>,
    /// Voxels that were solid and are air now, by the material they had.
    pub removed: MaterialCounts,
    /// Voxels that were air and are solid now, by the material they have.
    pub added: MaterialCounts,
    /// Solid voxels that changed their material, by the material they have now.
    pub painted: MaterialCounts,
    /// Voxels that rules kept from changing.
    pub refused: Refused,
}

impl EditEffect {
    /// Enters that samples of a chunk changed.
    pub fn reach(&mut self, chunk: ChunkPos, bounds: LatticeBox) {
        match self.chunks.binary_search_by_key(&chunk, |effect| effect.chunk) {
            Ok(at) => self.chunks[at].bounds = self.chunks[at].bounds.union(bounds),
            Err(at) => self.chunks.insert(at, ChunkEffect { chunk, bounds }),
        }
    }

    /// The counts of voxels with this outcome.
    pub fn counts_mut(&mut self, outcome: VoxelOutcome) -> &mut MaterialCounts {
        match outcome {
            VoxelOutcome::Removed => &mut self.removed,
            VoxelOutcome::Added => &mut self.added,
            VoxelOutcome::Painted => &mut self.painted,
            VoxelOutcome::Protected => &mut self.refused.protected,
            VoxelOutcome::Unbreakable => &mut self.refused.unbreakable,
            VoxelOutcome::TooHard => &mut self.refused.too_hard,
            VoxelOutcome::Slowed => &mut self.refused.slowed,
        }
    }
}

/// A brick that edits changed.
#[derive(Clone, Debug)]
pub(crate) struct DraftedBrick {
    pub pos: BrickPos,
    /// The new content of the brick.
    pub brick: Arc<Brick>,
    /// Box around the samples that changed.
    pub changed: LatticeBox,
    /// Whether any of them had never been edited before.
    pub is_extended: bool,
    /// The common sample, if all samples were edited to the same.
    pub kind: Option<UniformKind>,
}

impl DraftedBrick {
    /// A brick that changed. Looks at all of its samples, so call it on the thread that changed them.
    pub fn new(pos: BrickPos, brick: Arc<Brick>, changed: LatticeBox, is_extended: bool) -> Self {
        let kind = brick.uniform();
        Self { pos, brick, changed, is_extended, kind }
    }
}

/// Drafted bricks by position, each with all that changed in it.
#[derive(Default)]
pub(crate) struct MergedBricks(BTreeMap<BrickPos, DraftedBrick>);

impl MergedBricks {
    /// Puts newer bricks in place of older ones.
    pub fn add(&mut self, bricks: impl IntoIterator<Item = DraftedBrick>) {
        for mut drafted in bricks {
            if let Some(earlier) = self.0.get(&drafted.pos) {
                drafted.changed = drafted.changed.union(earlier.changed);
                drafted.is_extended |= earlier.is_extended;
            }
            self.0.insert(drafted.pos, drafted);
        }
    }

    /// All bricks, in order.
    pub fn into_list(self) -> Vec<DraftedBrick> {
        self.0.into_values().collect()
    }
}

/// Drafted bricks over those of a world, as later edits of a transaction read them.
#[derive(Default)]
pub(crate) struct Overlay {
    bricks: Bricks,
    lowest: FxHashMap<(i32, i32), i32>,
}

impl Overlay {
    /// Lays bricks over those that are there.
    pub fn lay(&mut self, drafted: &[DraftedBrick]) {
        for DraftedBrick { pos, brick, .. } in drafted {
            self.bricks.insert(*pos, Arc::clone(brick));
            let lowest = self.lowest.entry(pos.stack()).or_insert(pos.0.y);
            *lowest = pos.0.y.min(*lowest);
        }
    }

    /// The samples of a world under these bricks.
    pub fn over<'a>(&'a self, world: SampleView<'a>) -> SampleView<'a> {
        if self.bricks.is_empty() { world } else { world.over(&self.bricks) }
    }

    /// The y of the lowest drafted brick of a stack.
    pub fn lowest(&self, stack: (i32, i32)) -> Option<i32> {
        self.lowest.get(&stack).copied()
    }
}
