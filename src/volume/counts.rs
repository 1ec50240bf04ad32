//! Voxels per material, and the outcomes of an edit for a voxel.

use crate::ground::MaterialId;

/// Solid voxels per material, in the order of material ids. A lattice point is one voxel.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(from = "Vec<(MaterialId, u64)>")]
pub struct MaterialCounts(Vec<(MaterialId, u64)>);

impl From<Vec<(MaterialId, u64)>> for MaterialCounts {
    /// Counts of one material are added up; the sum of all stays within 64 bits.
    fn from(list: Vec<(MaterialId, u64)>) -> Self {
        let (mut counts, mut room) = (Self::default(), u64::MAX);
        for (material, voxels) in list {
            let counted = voxels.min(room);
            if counted > 0 {
                counts.count_many(material, counted);
                room -= counted;
            }
        }
        counts
    }
}

impl MaterialCounts {
    /// Counts more voxels of one material.
    pub(crate) fn count_many(&mut self, material: MaterialId, voxels: u64) {
        match self.0.binary_search_by_key(&material, |entry| entry.0) {
            Ok(at) => self.0[at].1 = self.0[at].1.saturating_add(voxels),
            Err(at) => self.0.insert(at, (material, voxels)),
        }
    }

    /// Counts voxels of these materials.
    pub(crate) fn count_each(&mut self, materials: impl IntoIterator<Item = MaterialId>) {
        for_runs(materials, |material, voxels| self.count_many(material, voxels));
    }

    /// Adds all of `other`.
    pub fn add(&mut self, other: &Self) {
        for &(material, voxels) in &other.0 {
            self.count_many(material, voxels);
        }
    }

    /// Bytes of the list.
    pub(crate) fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<(MaterialId, u64)>()
    }

    /// Voxels of one material.
    pub fn of(&self, material: MaterialId) -> u64 {
        self.0.binary_search_by_key(&material, |entry| entry.0).map_or(0, |at| self.0[at].1)
    }

    /// Voxels of all materials.
    pub fn total(&self) -> u64 {
        self.0.iter().fold(0, |sum, entry| sum.saturating_add(entry.1))
    }

    /// Materials that were counted, with their voxels.
    pub fn iter(&self) -> impl Iterator<Item = (MaterialId, u64)> {
        self.0.iter().copied()
    }
}

/// Calls `each` with every run of equal materials and its length. Neighbours mostly are of one material.
pub(crate) fn for_runs(
    materials: impl IntoIterator<Item = MaterialId>,
    mut each: impl FnMut(MaterialId, u64),
) {
    let mut materials = materials.into_iter();
    let Some(mut last) = materials.next() else { return };
    let mut voxels = 1;
    for material in materials {
        if material != last {
            each(last, voxels);
            (last, voxels) = (material, 0);
        }
        voxels += 1;
    }
    each(last, voxels);
}

/// Outcome of an edit for a voxel.
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
