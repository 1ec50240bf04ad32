//! What edits did to bricks, entered brick by brick and added up later.

use std::sync::Arc;

use super::draft::{DraftedBrick, EditEffect};
use crate::ground::MaterialId;
use crate::lattice::{ChunkPos, LatticeBox};
use crate::volume::VoxelOutcome;

/// What edits did to some bricks.
#[derive(Default)]
pub(crate) struct EditDelta {
    pub bricks: Vec<DraftedBrick>,
    pub parts: Vec<PartEffect>,
    pub counts: Vec<Count>,
    /// All that edits did, one after the other, where parts and counts are entered already; else none.
    pub effects: Vec<EditEffect>,
    /// By how much the hash of the world's samples changes.
    pub hash: u64,
}

impl EditDelta {
    /// An empty one, with room for so many bricks, and for what edits do to them as a rule.
    pub fn with_room(bricks: usize) -> Self {
        Self {
            bricks: Vec::with_capacity(bricks),
            parts: Vec::with_capacity(bricks.min(LATEST)),
            counts: Vec::with_capacity(bricks.min(LATEST)),
            effects: Vec::new(),
            hash: 0,
        }
    }

    /// Enters a brick. One that is all alike is mostly alike with one of the latest, and shares that one's memory at once:
    /// who adds ledgers up has fewer bricks to give up.
    pub fn change(&mut self, mut drafted: DraftedBrick) {
        // Materials may be stored though all of them are the ground's own.
        let key = |of: &DraftedBrick| (of.kind, of.brick.material_bytes());
        let mut latest = self.bricks.iter().rev().take(LATEST);
        if drafted.kind.is_some()
            && let Some(same) = latest.find(|other| key(other) == key(&drafted))
        {
            drafted.brick = Arc::clone(&same.brick);
        }
        self.bricks.push(drafted);
    }

    /// Enters that an edit changed samples of a chunk. Bricks beside each other mostly come to the same entry.
    pub fn reach(&mut self, edit: usize, chunk: ChunkPos, bounds: LatticeBox) {
        let mut latest = self.parts.iter_mut().rev().take(LATEST);
        match latest.find(|part| (part.edit, part.chunk) == (edit, chunk)) {
            Some(part) => part.bounds = part.bounds.union(bounds),
            None => self.parts.push(PartEffect { edit, chunk, bounds }),
        }
    }

    /// Where an edit counts voxels: all of its own that stand at the end are looked at, however many materials those are, so
    /// a brick has no two of a kind.
    pub fn counts(&mut self, edit: usize) -> Counts<'_> {
        let own = self.counts.iter().rev().take_while(|count| count.edit == edit).count();
        Counts { edit, first: self.counts.len() - own, list: &mut self.counts }
    }
}

/// How many of the latest entries one more is compared with.
const LATEST: usize = 8;

/// What one edit changed in one chunk, in one brick or in several.
pub(crate) struct PartEffect {
    pub edit: usize,
    pub chunk: ChunkPos,
    pub bounds: LatticeBox,
}

/// Voxels of one material that an edit dealt with, in one brick or in several.
pub(crate) struct Count {
    pub edit: usize,
    pub outcome: VoxelOutcome,
    pub material: MaterialId,
    pub voxels: u64,
}

/// What one edit does to a brick is counted here, beside what it did to the one before.
pub(crate) struct Counts<'l> {
    edit: usize,
    list: &'l mut Vec<Count>,
    /// Where this edit's counts begin.
    first: usize,
}

impl Counts<'_> {
    pub fn add(&mut self, outcome: VoxelOutcome, material: MaterialId, voxels: u64) {
        let own = &mut self.list[self.first..];
        match own.iter_mut().find(|count| count.outcome == outcome && count.material == material) {
            Some(count) => count.voxels += voxels,
            None => self.list.push(Count { edit: self.edit, outcome, material, voxels }),
        }
    }
}
