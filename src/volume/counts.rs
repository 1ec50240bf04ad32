//! Voxels per material, and what can become of them.

use crate::ground::MaterialId;

/// Solid voxels per material, in the order of material ids. A lattice point is one voxel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MaterialCounts(Vec<(MaterialId, u64)>);

impl MaterialCounts {
    /// Counts more voxels of one material.
    pub(crate) fn count_many(&mut self, material: MaterialId, voxels: u64) {
        match self.0.binary_search_by_key(&material, |entry| entry.0) {
            Ok(at) => self.0[at].1 += voxels,
            Err(at) => self.0.insert(at, (material, voxels)),
        }
    }

    /// Adds all of `other`.
    pub fn add(&mut self, other: &Self) {
        for &(material, voxels) in &other.0 {
            self.count_many(material, voxels);
        }
    }

    /// Voxels of one material.
    pub fn of(&self, material: MaterialId) -> u64 {
        self.0.binary_search_by_key(&material, |entry| entry.0).map_or(0, |at| self.0[at].1)
    }

    /// Voxels of all materials.
    pub fn total(&self) -> u64 {
        self.0.iter().map(|entry| entry.1).sum()
    }

    /// Materials that were counted, with their voxels.
    pub fn iter(&self) -> impl Iterator<Item = (MaterialId, u64)> {
        self.0.iter().copied()
    }
}

/// What an edit did to a voxel.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum VoxelOutcome {
    Removed,
    Added,
    Painted,
    /// Not changed: a rule protects it.
    Protected,
    Unbreakable,
    TooHard,
    Slowed,
}
