//! Prefabs: boxes of a world, copied with every sample, to be pasted elsewhere.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::sync::{Arc, OnceLock};

use glam::IVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use thiserror::Error;

use crate::ground::MaterialId;
use crate::lattice::hash::hash_words;

/// The maximum number of samples along a side of a prefab.
pub const MAX_PREFAB_SIDE: i32 = 1024;

/// The maximum number of samples of a prefab, which take 4 bytes each.
pub const MAX_PREFAB_SAMPLES: u64 = 1 << 23;

/// The maximum number of voxels from the lowest sample of a prefab to its anchor, along each axis.
const FARTHEST_ANCHOR: i32 = 1 << 11;

/// Why a box cannot be a [`Prefab`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum PrefabError {
    /// The box is inverted or has too many samples along a side, or in all.
    #[error(
        "a prefab of {width} x {height} x {depth} samples is not possible: a side has 1 to {MAX_PREFAB_SIDE}, and all \
         together are {MAX_PREFAB_SAMPLES} at most; copy it in parts"
    )]
    Size {
        /// Samples along x.
        width: i64,
        /// Samples along y.
        height: i64,
        /// Samples along z.
        depth: i64,
    },
    /// The box reaches beyond the columns of the world, or beyond the lattice.
    #[error(
        "the box from {min} to {max} reaches beyond the world: copy the part from {world_min} to {world_max}"
    )]
    OutsideWorld {
        /// Lowest point of the box.
        min: IVec3,
        /// Highest point of the box.
        max: IVec3,
        /// Lowest point of the world.
        world_min: IVec3,
        /// Highest point of the world.
        world_max: IVec3,
    },
    /// The anchor is too far from the box.
    #[error(
        "the anchor is {anchor} from the lowest sample, but at most {FARTHEST_ANCHOR} voxels along each axis are possible: \
         choose one that is nearer to the box"
    )]
    Anchor {
        /// From the lowest sample to the anchor.
        anchor: IVec3,
    },
    /// A serialised prefab holds values that no prefab can have.
    #[error("the prefab holds an invalid {what}")]
    Invalid {
        /// The part that is wrong.
        what: &'static str,
    },
}

/// The sample was edited.
const EDITED: u8 = 1;
/// The material of the edited sample was stored; otherwise it was the ground's own there.
const STORED: u8 = 2;

/// A sample of a prefab.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PrefabSample {
    /// Density in 1/256 voxel, as an edited sample stores it.
    pub density: i16,
    /// The material of a solid sample; [`MaterialId::GROUND`] for air.
    pub material: MaterialId,
    /// Whether the sample was edited.
    pub is_edited: bool,
    /// Whether its material was stored. If not, it was that of the ground at its place.
    pub has_stored_material: bool,
}

impl PrefabSample {
    fn marks(self) -> u8 {
        let mark = |is_set: bool, mark: u8| if is_set { mark } else { 0 };
        mark(self.is_edited, EDITED) | mark(self.has_stored_material, STORED)
    }

    /// Whether a world can hold it.
    fn is_valid(self) -> bool {
        let is_solid = self.density < 0;
        self.density != i16::MIN
            && is_solid == (self.material != MaterialId::GROUND)
            && (!self.has_stored_material || is_solid && self.is_edited)
    }
}

/// A box of a world: the density and the material of each of its samples, and which of them were edited.
///
/// [`World::copy`](crate::terrain::World::copy) makes one, and a brush pastes it: see [`Paste`](super::Paste).
/// `Prefab::to_bytes` (feature `format`) makes the bytes of a file of it. What is sent to clients names it by its
/// [hash](Self::hash).
#[derive(Clone)]
pub struct Prefab {
    size: IVec3,
    anchor: IVec3,
    above_ground: i32,
    /// Densities of all samples, x fastest, then z, then y.
    densities: Vec<i16>,
    materials: Vec<MaterialId>,
    marks: Vec<u8>,
    hash: u64,
    /// The prefab as a file, made when it is first needed.
    packed: OnceLock<Arc<[u8]>>,
}

impl Prefab {
    /// A prefab of these samples, x fastest, then z, then y. `anchor` is counted from the lowest sample, and lies
    /// `above_ground` voxels above the ground.
    pub(crate) fn new(
        size: IVec3,
        anchor: IVec3,
        above_ground: i32,
        samples: impl IntoIterator<Item = PrefabSample>,
    ) -> Result<Self, PrefabError> {
        let count = Self::check(size, anchor)?;
        let mut own = Self {
            size,
            anchor,
            above_ground,
            densities: Vec::with_capacity(count),
            materials: Vec::with_capacity(count),
            marks: Vec::with_capacity(count),
            hash: 0,
            packed: OnceLock::new(),
        };
        for sample in samples {
            own.densities.push(sample.density);
            own.materials.push(sample.material);
            own.marks.push(sample.marks());
        }
        own.checked()
    }

    /// Checks size and anchor, and returns the number of samples.
    pub(crate) fn check(size: IVec3, anchor: IVec3) -> Result<usize, PrefabError> {
        let [width, height, depth] = size.to_array().map(i64::from);
        let is_side = |side: i32| (1..=MAX_PREFAB_SIDE).contains(&side);
        let is_fine = size.to_array().into_iter().all(is_side);
        let count = u64::try_from(width.saturating_mul(height).saturating_mul(depth)).unwrap_or(0);
        if !is_fine || count > MAX_PREFAB_SAMPLES {
            return Err(PrefabError::Size { width, height, depth });
        }
        if anchor.to_array().into_iter().any(|part| part.unsigned_abs() > FARTHEST_ANCHOR as u32) {
            return Err(PrefabError::Anchor { anchor });
        }
        Ok(count as usize)
    }

    /// This prefab with its hash, if it is one.
    fn checked(mut self) -> Result<Self, PrefabError> {
        let count = Self::check(self.size, self.anchor)?;
        let lengths = [self.densities.len(), self.materials.len(), self.marks.len()];
        if lengths != [count; 3] {
            return Err(PrefabError::Invalid { what: "number of samples" });
        }
        if !(0..count).all(|index| self.at_index(index).is_valid() && self.marks[index] <= EDITED | STORED) {
            return Err(PrefabError::Invalid { what: "sample" });
        }
        self.hash = self.hash_of_content();
        Ok(self)
    }

    fn hash_of_content(&self) -> u64 {
        let word = |index: usize| {
            let sample = self.at_index(index);
            u64::from(sample.density.cast_unsigned())
                | u64::from(sample.material.0) << 16
                | u64::from(sample.marks()) << 24
        };
        let words = |v: IVec3| v.to_array().map(|part| u64::from(part.cast_unsigned()));
        let head = words(self.size).into_iter().chain(words(self.anchor));
        let head = head.chain([u64::from(self.above_ground.cast_unsigned())]);
        hash_words(head.chain((0..self.densities.len()).map(word)))
    }

    /// Samples along each axis: one more than voxels between the first and the last.
    pub fn size(&self) -> IVec3 {
        self.size
    }

    /// From the lowest sample to the anchor, which is placed where the prefab is pasted.
    pub fn anchor(&self) -> IVec3 {
        self.anchor
    }

    /// Voxels from the ground's surface to the anchor, where it was copied: negative if it lay in the ground.
    pub fn above_ground(&self) -> i32 {
        self.above_ground
    }

    /// The number of its samples that were edited when it was copied.
    pub fn edited_count(&self) -> u64 {
        self.marks.iter().filter(|&&marks| marks & EDITED != 0).count() as u64
    }

    /// A hash of its content, the same on every machine. It is not cryptographic.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Bytes of memory that it takes. They grow by those of its file when it is first sent or saved.
    pub fn bytes(&self) -> usize {
        let packed = self.packed.get().map_or(0, |packed| packed.len());
        size_of::<Self>() + self.densities.len() * (size_of::<i16>() + 2) + packed
    }

    fn at_index(&self, index: usize) -> PrefabSample {
        PrefabSample {
            density: self.densities[index],
            material: self.materials[index],
            is_edited: self.marks[index] & EDITED != 0,
            has_stored_material: self.marks[index] & STORED != 0,
        }
    }

    /// The sample at a place counted from the lowest one, clamped to the box.
    pub(super) fn sample(&self, at: IVec3) -> PrefabSample {
        let at = at.clamp(IVec3::ZERO, self.size - 1).as_usizevec3();
        let size = self.size.as_usizevec3();
        self.at_index((at.y * size.z + at.z) * size.x + at.x)
    }

    /// The bytes of its file, which `pack` makes when they are first needed: a large prefab takes a while.
    #[cfg(feature = "format")]
    pub(crate) fn packed(&self, pack: impl FnOnce(&Self) -> Vec<u8>) -> &Arc<[u8]> {
        self.packed.get_or_init(|| pack(self).into())
    }

    /// A prefab of a single sample of air, which stands for one that is named.
    pub(crate) fn placeholder() -> Self {
        let (size, anchor) = (IVec3::ONE, IVec3::ZERO);
        let own = Self {
            size,
            anchor,
            above_ground: 0,
            densities: vec![0],
            materials: vec![MaterialId::GROUND],
            marks: vec![0],
            hash: 0,
            packed: OnceLock::new(),
        };
        Self { hash: own.hash_of_content(), ..own }
    }

    /// Whether it equals the [placeholder](Self::placeholder).
    pub(crate) fn is_placeholder(&self) -> bool {
        self.size == IVec3::ONE && *self == Self::placeholder()
    }
}

impl fmt::Debug for Prefab {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut to = f.debug_struct("Prefab");
        to.field("size", &self.size).field("anchor", &self.anchor).field("hash", &self.hash);
        to.finish_non_exhaustive()
    }
}

impl PartialEq for Prefab {
    fn eq(&self, other: &Self) -> bool {
        let head = |own: &Self| (own.hash, own.size, own.anchor, own.above_ground);
        head(self) == head(other)
            && self.densities == other.densities
            && self.materials == other.materials
            && self.marks == other.marks
    }
}

impl Eq for Prefab {}

impl Hash for Prefab {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.hash.hash(state);
    }
}

/// A prefab as it is serialised: densities as differences along columns, materials and marks as runs. Samples are in
/// columns, from below upwards, then along x, then along z.
#[derive(Serialize, Deserialize)]
#[serde(rename = "Prefab", deny_unknown_fields)]
struct Stored {
    size: [i32; 3],
    anchor: [i32; 3],
    above_ground: i32,
    densities: Vec<i16>,
    materials: Vec<(u32, MaterialId)>,
    marks: Vec<(u32, u8)>,
}

/// The index of every sample, in the order of columns.
fn by_columns(size: IVec3) -> impl Iterator<Item = usize> {
    let size = size.as_usizevec3();
    (0..size.z).flat_map(move |z| {
        (0..size.x).flat_map(move |x| (0..size.y).map(move |y| (y * size.z + z) * size.x + x))
    })
}

fn runs<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<(u32, T)> {
    let mut runs: Vec<(u32, T)> = Vec::new();
    for one in all {
        match runs.last_mut() {
            Some((count, last)) if *last == one => *count += 1,
            _ => runs.push((1, one)),
        }
    }
    runs
}

/// The items of runs, if there are as many as `count`.
fn unrolled<T: Copy>(runs: &[(u32, T)], count: usize, what: &'static str) -> Result<Vec<T>, PrefabError> {
    let total: u64 = runs.iter().map(|&(length, _)| u64::from(length)).sum();
    if total != count as u64 {
        return Err(PrefabError::Invalid { what });
    }
    Ok(runs.iter().flat_map(|&(length, item)| std::iter::repeat_n(item, length as usize)).collect())
}

impl Serialize for Prefab {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let mut last = 0_i16;
        let difference = |index: usize| {
            let own = self.densities[index];
            own.wrapping_sub(std::mem::replace(&mut last, own))
        };
        Stored {
            size: self.size.to_array(),
            anchor: self.anchor.to_array(),
            above_ground: self.above_ground,
            densities: by_columns(self.size).map(difference).collect(),
            materials: runs(by_columns(self.size).map(|index| self.materials[index])),
            marks: runs(by_columns(self.size).map(|index| self.marks[index])),
        }
        .serialize(to)
    }
}

impl<'de> Deserialize<'de> for Prefab {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Stored::deserialize(from)?.try_into().map_err(serde::de::Error::custom)
    }
}

impl TryFrom<Stored> for Prefab {
    type Error = PrefabError;

    fn try_from(of: Stored) -> Result<Self, PrefabError> {
        let (size, anchor) = (IVec3::from_array(of.size), IVec3::from_array(of.anchor));
        let count = Self::check(size, anchor)?;
        if of.densities.len() != count {
            return Err(PrefabError::Invalid { what: "number of samples" });
        }
        let materials = unrolled(&of.materials, count, "number of materials")?;
        let marks = unrolled(&of.marks, count, "number of marks")?;
        let mut own = Self {
            size,
            anchor,
            above_ground: of.above_ground,
            densities: vec![0; count],
            materials: vec![MaterialId::GROUND; count],
            marks: vec![0; count],
            hash: 0,
            packed: OnceLock::new(),
        };
        let mut density = 0_i16;
        for (from, to) in by_columns(size).enumerate() {
            density = density.wrapping_add(of.densities[from]);
            own.densities[to] = density;
            (own.materials[to], own.marks[to]) = (materials[from], marks[from]);
        }
        own.checked()
    }
}

/// A shared prefab, serialised as the prefab itself.
pub(super) mod shared {
    use std::sync::Arc;

    use super::{Deserialize, Prefab, Serialize};

    pub fn serialize<S: serde::Serializer>(prefab: &Prefab, to: S) -> Result<S::Ok, S::Error> {
        prefab.serialize(to)
    }

    pub fn deserialize<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Arc<Prefab>, D::Error> {
        Prefab::deserialize(from).map(Arc::new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn prefab(seed: u64) -> Prefab {
        let mut rng = fastrand::Rng::with_seed(seed);
        let size = IVec3::new(rng.i32(1..6), rng.i32(1..9), rng.i32(1..5));
        let sample = |_| {
            let (density, is_edited) = (rng.i16(-i16::MAX..), rng.bool());
            let is_solid = density < 0;
            let material = if is_solid { MaterialId(rng.u8(..255)) } else { MaterialId::GROUND };
            PrefabSample {
                density,
                material,
                is_edited,
                has_stored_material: is_solid && is_edited && rng.bool(),
            }
        };
        let samples: Vec<_> = (0..size.element_product()).map(sample).collect();
        Prefab::new(size, IVec3::new(3, -2, 700), -5, samples).unwrap()
    }

    #[test]
    fn a_prefab_comes_back_from_its_serialised_form() {
        for seed in 0..50 {
            let own = prefab(seed);
            let json = serde_json::to_string(&own).unwrap();
            let back: Prefab = serde_json::from_str(&json).unwrap();
            assert_eq!((&back, back.hash()), (&own, own.hash()));
            assert_ne!(own.hash(), prefab(seed + 1).hash());
        }
    }

    #[test]
    fn what_no_world_can_hold_is_refused() {
        let air = PrefabSample {
            density: 9,
            material: MaterialId::GROUND,
            is_edited: true,
            has_stored_material: false,
        };
        let of = |size: IVec3, sample| Prefab::new(size, IVec3::ZERO, 0, std::iter::repeat_n(sample, 8));
        let two = IVec3::splat(2);
        assert!(of(two, air).is_ok());
        for wrong in [
            PrefabSample { density: i16::MIN, ..air },
            PrefabSample { density: -1, ..air },
            PrefabSample { material: MaterialId(3), ..air },
            PrefabSample { has_stored_material: true, ..air },
        ] {
            assert_eq!(of(two, wrong), Err(PrefabError::Invalid { what: "sample" }));
        }
        assert_eq!(of(IVec3::new(2, 2, 3), air), Err(PrefabError::Invalid { what: "number of samples" }));
        for size in
            [IVec3::ZERO, IVec3::new(1025, 1, 1), IVec3::new(-1, -1, 8), IVec3::splat(1000), IVec3::MAX]
        {
            assert!(matches!(of(size, air), Err(PrefabError::Size { .. })), "{size}");
        }
        let far = Prefab::new(IVec3::ONE, IVec3::MIN, 0, [air]);
        assert!(matches!(far, Err(PrefabError::Anchor { .. })));
    }
}
