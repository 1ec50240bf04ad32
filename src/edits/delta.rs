//! Changes that edits made to bricks, recorded brick by brick and summed later.

use std::sync::Arc;

use rayon::prelude::*;

use super::effect::{DraftedBrick, EditEffect};
use crate::ground::MaterialId;
use crate::lattice::{ChunkPos, ItemCost, LatticeBox};
use crate::volume::VoxelOutcome;

/// Changes that edits made to some bricks.
#[derive(Default)]
pub(crate) struct EditDelta {
    pub bricks: Vec<DraftedBrick>,
    pub parts: Vec<PartEffect>,
    pub counts: Vec<Count>,
    /// The effect of each edit, in order, if parts and counts have been summed already; otherwise empty.
    pub effects: Vec<EditEffect>,
    /// The change in the hash of the world's samples.
    pub hash: u64,
}

impl EditDelta {
    /// An empty delta with room for `bricks` bricks.
    pub fn with_room(bricks: usize) -> Self {
        Self {
            bricks: Vec::with_capacity(bricks),
            parts: Vec::with_capacity(bricks.min(LATEST)),
            counts: Vec::with_capacity(bricks.min(LATEST)),
            effects: Vec::new(),
            hash: 0,
        }
    }

    /// Enters a brick. Neighbouring uniform bricks are mostly equal and share memory at once, so fewer of them have to
    /// be freed when deltas are added up.
    pub fn change(&mut self, mut drafted: DraftedBrick) {
        // Materials may be stored though all of them are the ground's own.
        let key = |of: &DraftedBrick| (of.kind, of.brick.bytes());
        let mut latest = self.bricks.iter().rev().take(LATEST);
        if drafted.kind.is_some()
            && let Some(same) = latest.find(|other| key(other) == key(&drafted))
        {
            drafted.brick = Arc::clone(&same.brick);
        }
        self.bricks.push(drafted);
    }

    /// Enters that an edit changed samples of a chunk. Neighbouring bricks mostly share an entry.
    pub fn reach(&mut self, edit: usize, chunk: ChunkPos, bounds: LatticeBox) {
        let mut latest = self.parts.iter_mut().rev().take(LATEST);
        match latest.find(|part| (part.edit, part.chunk) == (edit, chunk)) {
            Some(part) => part.bounds = part.bounds.union(bounds),
            None => self.parts.push(PartEffect { edit, chunk, bounds }),
        }
    }

    /// Where an edit counts voxels. All entries of the edit at the end of the list are searched, so one brick never
    /// gets two entries for the same outcome and material.
    pub fn counts(&mut self, edit: usize) -> Counts<'_> {
        let own = self.counts.iter().rev().take_while(|count| count.edit == edit).count();
        Counts { edit, first: self.counts.len() - own, list: &mut self.counts }
    }
}

/// Number of latest entries that a new one is compared with.
const LATEST: usize = 8;

/// Changes by one edit in one chunk, in one brick or in several.
pub(crate) struct PartEffect {
    pub edit: usize,
    pub chunk: ChunkPos,
    pub bounds: LatticeBox,
}

/// Voxels of one material and outcome that an edit dealt with, in one brick or in several.
pub(crate) struct Count {
    pub edit: usize,
    pub outcome: VoxelOutcome,
    pub material: MaterialId,
    pub voxels: u64,
}

/// The counts of one edit at the end of a delta's list.
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

/// Adds up the parts and counts of deltas, edit by edit.
pub(crate) fn enter_effects(deltas: &[EditDelta], effects: &mut [EditEffect]) {
    let entries: usize = deltas.iter().map(|delta| delta.parts.len() + delta.counts.len()).sum();
    if !ItemCost::Lookup.is_shared(entries) {
        return deltas.iter().for_each(|delta| enter_some(delta, 0, effects));
    }
    // Each thread takes some of the edits.
    let length = effects.len().div_ceil(rayon::current_num_threads()).max(1);
    effects.par_chunks_mut(length).enumerate().for_each(|(number, effects)| {
        deltas.iter().for_each(|delta| enter_some(delta, number * length, effects));
    });
}

/// Adds up what a delta holds about those edits that `effects` are of; `first` is the number of the first of them.
fn enter_some(delta: &EditDelta, first: usize, effects: &mut [EditEffect]) {
    for part in &delta.parts {
        let own = part.edit.checked_sub(first).and_then(|number| effects.get_mut(number));
        if let Some(effect) = own {
            effect.reach(part.chunk, part.bounds);
        }
    }
    for count in &delta.counts {
        let own = count.edit.checked_sub(first).and_then(|number| effects.get_mut(number));
        if let Some(effect) = own {
            effect.counts_mut(count.outcome).count_many(count.material, count.voxels);
        }
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::IVec3;

    use super::*;

    #[test]
    fn many_threads_enter_the_same_effects_as_one() {
        let mut rng = Rng::with_seed(3);
        let outcomes = [
            VoxelOutcome::Removed,
            VoxelOutcome::Added,
            VoxelOutcome::Painted,
            VoxelOutcome::Protected,
            VoxelOutcome::Slowed,
            VoxelOutcome::TooHard,
        ];
        for edits in [1, 37] {
            let mut delta = || {
                let mut delta = EditDelta::default();
                for _ in 0..ItemCost::Lookup.shared_from() / 3 {
                    let point = IVec3::new(rng.i32(-90..90), rng.i32(-9..9), rng.i32(-90..90));
                    delta.parts.push(PartEffect {
                        edit: rng.usize(..edits),
                        chunk: ChunkPos::from_ivec3(IVec3::new(rng.i32(..4), 0, rng.i32(..3))),
                        bounds: LatticeBox::point(point),
                    });
                    let (edit, outcome) = (rng.usize(..edits), outcomes[rng.usize(..outcomes.len())]);
                    delta.counts(edit).add(outcome, MaterialId(rng.u8(..5)), rng.u64(1..9));
                }
                delta
            };
            let deltas = [delta(), delta(), delta()];
            let [mut expected, mut found] = [(); 2].map(|()| vec![EditEffect::default(); edits]);
            deltas.iter().for_each(|delta| enter_some(delta, 0, &mut expected));
            enter_effects(&deltas, &mut found);
            assert!(expected == found && expected.iter().all(|effect| effect.chunks.len() > 3));
        }
    }
}
