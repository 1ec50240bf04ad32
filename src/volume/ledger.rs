//! What edits did to bricks, entered brick by brick and added up later.

use super::DraftedBrick;
use crate::ground::MaterialId;
use crate::lattice::{ChunkPos, LatticeBox};

/// What edits did to some bricks.
#[derive(Default)]
pub(crate) struct Ledger {
    pub bricks: Vec<DraftedBrick>,
    pub parts: Vec<PartEffect>,
    pub counts: Vec<Count>,
    /// By how much the hash of the world's samples changes.
    pub hash: u64,
}

impl Ledger {
    /// An empty one, with room for what edits do to so many bricks as a rule.
    pub fn with_room(bricks: usize) -> Self {
        Self {
            bricks: Vec::with_capacity(bricks),
            parts: Vec::with_capacity(bricks),
            counts: Vec::with_capacity(bricks),
            hash: 0,
        }
    }
}

/// What one edit changed in one chunk's part of one brick.
pub(crate) struct PartEffect {
    pub edit: usize,
    pub chunk: ChunkPos,
    pub bounds: LatticeBox,
}

/// What became of voxels.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fate {
    Removed,
    Added,
    Painted,
    /// Rules were against it.
    Protected,
    Unbreakable,
    TooHard,
    Slowed,
}

/// Voxels of one material that an edit dealt with in one brick.
pub(crate) struct Count {
    pub edit: usize,
    pub fate: Fate,
    pub material: MaterialId,
    pub voxels: u64,
}

/// What one edit does to one brick is counted here.
pub(super) struct Counts<'l> {
    pub edit: usize,
    pub list: &'l mut Vec<Count>,
    /// Where this edit's counts of this brick begin.
    pub first: usize,
}

impl Counts<'_> {
    pub fn add(&mut self, fate: Fate, material: MaterialId, voxels: u64) {
        let own = &mut self.list[self.first..];
        match own.iter_mut().find(|count| count.fate == fate && count.material == material) {
            Some(count) => count.voxels += voxels,
            None => self.list.push(Count { edit: self.edit, fate, material, voxels }),
        }
    }
}
