//! Samples and the bricks that store them.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::layers::{self, Layers};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BRICK, BrickPos, Column, LatticeBox, ceil, hash};

/// Samples in a brick.
const LEN: usize = (BRICK * BRICK * BRICK) as usize;

/// The density stored at a lattice point: 1/256 voxel, negative is solid. A pristine sample has no
/// stored density: it is computed from the ground (rule 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Sample(i16);

impl Sample {
    /// Never edited.
    pub const PRISTINE: Self = Self(i16::MIN);

    /// An edited sample. Densities beyond +-127.996 voxels are stored as that: their sign is what counts there.
    pub fn edited(distance: i32) -> Self {
        Self(distance.clamp(-i32::from(i16::MAX), i32::from(i16::MAX)) as i16)
    }

    /// The stored density, `None` for a pristine sample.
    pub fn distance(self) -> Option<i32> {
        (self != Self::PRISTINE).then_some(i32::from(self.0))
    }

    /// The density as it is stored, that of a pristine sample being [`i16::MIN`].
    #[inline]
    pub(crate) fn bits(self) -> i16 {
        self.0
    }
}

/// The samples of a brick that is not stored.
pub(crate) static PRISTINE: [Sample; LEN] = [Sample::PRISTINE; LEN];

/// The eight samples of a row along x, which begins at index `at`.
#[inline(always)]
pub(crate) fn row(samples: &[Sample; LEN], at: usize) -> [i16; 8] {
    samples[at..].first_chunk::<8>().map_or([0; 8], |row| row.map(|sample| sample.0))
}

/// Which pristine samples of a brick are solid, whose lowest samples lie at `y`, under columns of these heights.
pub(crate) fn solid_layers(heights: &[[i32; 8]; 8], y: i32) -> Layers {
    // In each column the lowest samples are solid, as many as lie below its height.
    let solid = |height: i32| (ceil(height) - y).clamp(0, 8);
    let mut rising = [0u64; 9];
    for (bit, &height) in heights.iter().flatten().enumerate() {
        rising[solid(height) as usize] |= 1 << bit;
    }
    let mut layers = [0; 8];
    let mut above = 0;
    for y in (0..8).rev() {
        above |= rising[y + 1];
        layers[y] = above;
    }
    layers
}

/// The solid samples of a pristine brick.
pub(crate) fn pristine_layers(ground: &Ground, pos: BrickPos) -> Layers {
    let low = pos.origin();
    solid_layers(&ground.heights::<8>(Column::of(low)), low.y)
}

/// A word that a backend stores in a brick to find its own copy of it. A clone starts at 0.
#[derive(Debug, Default)]
pub(crate) struct Tag(AtomicU64);

impl Clone for Tag {
    fn clone(&self) -> Self {
        Self::default()
    }
}

#[cfg_attr(not(feature = "cuda"), expect(dead_code))]
impl Tag {
    /// The word stored last; 0 at first.
    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Stores a word. Ordering is relaxed: it says nothing about the brick's samples.
    pub fn set(&self, word: u64) {
        self.0.store(word, Ordering::Relaxed);
    }
}

/// 8x8x8 samples with their materials.
///
/// The brick also stores two bits per sample, so that whole rows are tested at once: whether it is solid (pristine
/// samples included), and whether it is edited.
#[derive(Clone, Debug)]
pub struct Brick {
    samples: [Sample; LEN],
    solid: Layers,
    edited: Layers,
    /// `None` while all are [`MaterialId::GROUND`].
    materials: Option<Box<[MaterialId; LEN]>>,
    #[cfg_attr(not(feature = "cuda"), expect(dead_code))]
    pub(crate) tag: Tag,
}

impl Brick {
    /// Bytes that the samples of a brick take, with their bits.
    pub const BYTES: usize = size_of::<Self>();

    /// A brick without an edited sample, of which these pristine ones are solid.
    pub(crate) fn pristine(solid: Layers) -> Self {
        Self { samples: [Sample::PRISTINE; LEN], solid, edited: [0; 8], materials: None, tag: Tag::default() }
    }

    /// A brick of these samples, none of them pristine, in the order of [`BrickPos::index`].
    pub fn of_edited(samples: &[i16; 512]) -> Self {
        let mut brick = Self::pristine([0; 8]);
        for (row, samples) in samples.as_chunks::<8>().0.iter().enumerate() {
            let samples = samples.map(|sample| sample.max(-i16::MAX));
            let solid = (0..8).fold(0, |bits, x| bits | u8::from(samples[x] < 0) << x);
            brick.set_row(row * 8, samples);
            brick.set_bits(row / 8, layers::of_row(u8::MAX, row % 8), layers::of_row(solid, row % 8));
        }
        brick
    }

    /// A brick of a world over this ground, from its edited samples and their materials, both in order. Which
    /// samples are solid is computed again.
    ///
    /// `None` where there are not as many of them as `edited` has bits, where a density is [`i16::MIN`], or where a
    /// sample of air has a material.
    pub fn restored(
        ground: &Ground,
        pos: BrickPos,
        edited: &Layers,
        densities: &[i16],
        materials: Option<&[MaterialId]>,
    ) -> Option<Self> {
        let count = layers::count(edited) as usize;
        if densities.len() != count || materials.is_some_and(|materials| materials.len() != count) {
            return None;
        }
        let mut brick = Self::pristine(pristine_layers(ground, pos));
        for (number, index) in layers::indices(edited).enumerate() {
            let (sample, material) = (Sample(densities[number]), materials.map(|all| all[number]));
            sample.distance()?;
            let is_solid = sample.0 < 0;
            if !is_solid && material.is_some_and(|material| material != MaterialId::GROUND) {
                return None;
            }
            brick.samples[index] = sample;
            let bit = 1 << (index & 63);
            brick.set_bits(index >> 6, bit, if is_solid { bit } else { 0 });
            if let Some(material) = material {
                brick.set_material(index, material);
            }
        }
        Some(brick)
    }

    /// A brick with these edited samples over other pristine ones, which are solid where `solid` says so.
    pub(crate) fn on_pristine(&self, solid: &Layers) -> Self {
        let mut brick = self.clone();
        for (y, edited) in self.edited.iter().enumerate() {
            brick.solid[y] = self.solid[y] & edited | solid[y] & !edited;
        }
        brick
    }

    /// This brick with some samples pristine again, which are solid where `solid` says so.
    pub(crate) fn without_edits(&self, samples: &Layers, solid: &Layers) -> Self {
        let mut brick = self.clone();
        layers::indices(samples).for_each(|index| brick.samples[index] = Sample::PRISTINE);
        for y in 0..8 {
            brick.clear_materials(y, samples[y]);
            brick.edited[y] &= !samples[y];
            brick.solid[y] = brick.solid[y] & !samples[y] | solid[y] & samples[y];
        }
        brick.materials.take_if(|all| all.iter().all(|&material| material == MaterialId::GROUND));
        brick
    }

    /// A brick of samples, bits that agree with them, and materials.
    #[cfg(feature = "cuda")]
    pub(crate) fn of_parts(
        samples: &[i16; LEN],
        solid: Layers,
        edited: Layers,
        materials: Option<&[u8; LEN]>,
    ) -> Self {
        let materials = materials.map(|materials| Box::new(materials.map(MaterialId)));
        Self { samples: samples.map(Sample), solid, edited, materials, tag: Tag::default() }
    }

    /// A brick all of whose samples were edited to the same. `None`: no material was ever stored in it.
    #[cfg(feature = "cuda")]
    pub(crate) fn of_one(sample: i16, material: Option<MaterialId>) -> Self {
        let sample = Sample::edited(sample.into());
        let solid = if sample.0 < 0 { [u64::MAX; 8] } else { [0; 8] };
        let materials = material.map(|material| Box::new([material; LEN]));
        Self { samples: [sample; LEN], solid, edited: [u64::MAX; 8], materials, tag: Tag::default() }
    }

    /// The sample at a lattice point that lies in this brick.
    pub fn sample(&self, point: IVec3) -> Sample {
        self.samples[BrickPos::index(point)]
    }

    /// The material at a lattice point that lies in this brick; [`MaterialId::GROUND`] if it was never changed.
    pub fn material(&self, point: IVec3) -> MaterialId {
        self.materials.as_ref().map_or(MaterialId::GROUND, |materials| materials[BrickPos::index(point)])
    }

    /// The solid samples: below zero, or pristine and below the ground's surface.
    pub fn solid(&self) -> &Layers {
        &self.solid
    }

    /// The edited samples.
    pub fn edited(&self) -> &Layers {
        &self.edited
    }

    /// The box around the edited samples of the brick at `pos`.
    pub(crate) fn edited_bounds(&self, pos: BrickPos) -> Option<LatticeBox> {
        layers::bounds(&self.edited, pos.origin())
    }

    /// Samples in order: x fastest, then z, then y.
    pub(crate) fn samples(&self) -> &[Sample; LEN] {
        &self.samples
    }

    /// Stores the samples of the row that begins at index `at`; [`Self::set_bits`] says what they are.
    #[inline]
    pub(crate) fn set_row(&mut self, at: usize, row: [i16; 8]) {
        if let Some(samples) = self.samples[at..].first_chunk_mut::<8>() {
            *samples = row.map(Sample);
        }
    }

    /// Stores the sample with this index; [`Self::set_bits`] says what it is.
    #[inline]
    pub(crate) fn set_sample(&mut self, index: usize, sample: Sample) {
        self.samples[index] = sample;
    }

    /// Marks further samples of a layer as edited, and which of them are solid.
    #[inline]
    pub(crate) fn set_bits(&mut self, y: usize, edited: u64, solid: u64) {
        self.edited[y] |= edited;
        self.solid[y] = self.solid[y] & !edited | solid & edited;
    }

    /// Changes the material of the sample with this index.
    pub(crate) fn set_material(&mut self, index: usize, material: MaterialId) {
        if self.materials.is_none() && material == MaterialId::GROUND {
            return;
        }
        self.materials.get_or_insert_with(|| Box::new([MaterialId::GROUND; LEN]))[index] = material;
    }

    /// Changes the material of some samples of a layer: bit `z * 8 + x`.
    pub(crate) fn set_materials(&mut self, y: usize, samples: u64, material: MaterialId) {
        if self.materials.is_none() && material == MaterialId::GROUND {
            return;
        }
        let materials = self.materials.get_or_insert_with(|| Box::new([MaterialId::GROUND; LEN]));
        layers::ones(samples).for_each(|bit| materials[y * 64 + bit] = material);
    }

    /// The material of the sample with this index.
    pub(crate) fn material_at(&self, index: usize) -> MaterialId {
        self.materials.as_ref().map_or(MaterialId::GROUND, |materials| materials[index])
    }

    /// The materials in order of the samples, `None` while all are [`MaterialId::GROUND`].
    #[cfg(feature = "cuda")]
    pub(crate) fn materials(&self) -> Option<&[MaterialId; LEN]> {
        self.materials.as_deref()
    }

    /// Removes the materials of samples of a layer that became air: air has no material.
    pub(crate) fn clear_materials(&mut self, y: usize, samples: u64) {
        self.set_materials(y, samples, MaterialId::GROUND);
    }

    /// Bytes of the brick, and of all that it stores elsewhere.
    pub(crate) fn bytes(&self) -> usize {
        Self::BYTES + self.material_bytes()
    }

    /// Bytes that materials take in addition to the brick.
    pub fn material_bytes(&self) -> usize {
        self.materials.as_deref().map_or(0, size_of_val)
    }

    /// The sample that the whole brick was edited to, if all samples are equal.
    pub(crate) fn uniform(&self) -> Option<UniformKind> {
        let (sample, material) = (self.samples[0], self.material_at(0));
        let is_uniform = self.edited == [u64::MAX; 8]
            && self.samples.iter().all(|&other| other == sample)
            && self.materials.iter().all(|all| all.iter().all(|&other| other == material));
        is_uniform.then_some(UniformKind { sample, material })
    }

    /// The contribution of some edited samples to the world's hash, where `y` is the height of the brick's lowest
    /// sample and `columns` are the [hashes](column_hash) of its columns.
    pub(crate) fn hash(&self, y: i32, samples: &Layers, columns: &[u64; 64]) -> u64 {
        let of_layer = |(layer, &samples): (usize, &u64)| {
            let height = y + layer as i32;
            let of = |bit: usize| {
                let index = layer * 64 + bit;
                sample_hash(columns[bit], height, self.samples[index], self.material_at(index))
            };
            layers::ones(samples).fold(0u64, |sum, bit| sum.wrapping_add(of(bit)))
        };
        samples.iter().enumerate().map(of_layer).fold(0, u64::wrapping_add)
    }

    /// Returns `true` if two bricks hold equal samples. `None` stands for a pristine one.
    pub(crate) fn is_same(a: Option<&Arc<Self>>, b: Option<&Arc<Self>>) -> bool {
        match (a, b) {
            (Some(a), Some(b)) if Arc::ptr_eq(a, b) => true,
            (None, None) => true,
            (a, b) => Self::differences([a.map(Arc::as_ref), b.map(Arc::as_ref)]) == layers::NONE,
        }
    }

    /// The samples in which two bricks differ; `None` stands for a pristine one.
    pub(crate) fn differences([a, b]: [Option<&Self>; 2]) -> Layers {
        let material =
            |brick: Option<&Self>, index| brick.map_or(MaterialId::GROUND, |b| b.material_at(index));
        let [old, new] = [a, b].map(|brick| brick.map_or(&PRISTINE, Self::samples));
        let has_materials = [a, b].iter().flatten().any(|brick| brick.materials.is_some());
        let mut differ = layers::NONE;
        for (index, (old, new)) in old.iter().zip(new).enumerate() {
            let is_same = old == new && (!has_materials || material(a, index) == material(b, index));
            differ[index >> 6] |= u64::from(!is_same) << (index & 63);
        }
        differ
    }

    /// Every edited sample of the brick at `pos`: point, density, material.
    pub fn edited_samples(&self, pos: BrickPos) -> impl Iterator<Item = (IVec3, i32, MaterialId)> {
        pos.samples()
            .points()
            .filter_map(|point| Some((point, self.sample(point).distance()?, self.material(point))))
    }
}

/// The pool of uniform bricks, all of whose samples are alike, one of each kind: the middle of every large cave is the
/// same brick.
pub(crate) type UniformBricks = FxHashMap<UniformKind, Arc<Brick>>;

/// The common sample of a uniform brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct UniformKind {
    pub sample: Sample,
    pub material: MaterialId,
}

/// The part of a hash that all samples of a column have in common.
pub(crate) fn column_hash(column: Column) -> u64 {
    hash::mix(column.x as u32 as u64 | (column.z as u32 as u64) << 32)
}

/// The contribution of a sample to the world's hash; a pristine one adds nothing.
fn sample_hash(column: u64, y: i32, sample: Sample, material: MaterialId) -> u64 {
    let Some(distance) = sample.distance() else { return 0 };
    hash::mix(column ^ (y as u32 as u64) << 32 ^ (distance as u16 as u64) << 8 ^ u64::from(material.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::ONE;

    #[test]
    fn an_edited_sample_is_never_the_sentinel() {
        for distance in [i32::MIN, -32769, -32768, -32767, -1, 0, 1, 32767, 32768, i32::MAX] {
            let stored = Sample::edited(distance).distance().expect("edited samples are numbers");
            assert_eq!(stored.signum(), distance.signum());
            assert!(distance.abs_diff(0) > 32767 || stored == distance);
        }
    }

    #[test]
    fn bricks_know_what_was_edited() {
        let mut brick = Brick::pristine([u64::MAX; 8]);
        let pos = BrickPos(IVec3::new(-1, 0, 2));
        let point = pos.origin() + IVec3::new(3, 5, 7);
        let mut row = row(brick.samples(), 5 * 64 + 7 * 8);
        row[3] = 7;
        brick.set_row(5 * 64 + 7 * 8, row);
        brick.set_bits(5, 1 << 59, 0);
        brick.set_material(BrickPos::index(point), MaterialId(4));
        assert_eq!(brick.edited_samples(pos).collect::<Vec<_>>(), [(point, 7, MaterialId(4))]);
        assert_eq!(layers::count(brick.edited()), 1);
        assert_eq!(brick.solid()[5], !(1 << 59));
        assert_eq!(brick.uniform(), None);
    }

    #[test]
    fn layers_hold_the_sign_of_every_pristine_sample() {
        let heights = std::array::from_fn(|z| std::array::from_fn(|x| (x as i32 * 37 - z as i32 * 300) * 3));
        for low in [-9, -8, -1, 0, 1, 7] {
            let layers = solid_layers(&heights, low);
            for (y, (z, x)) in (0..8).flat_map(|y| (0..64).map(move |i| (y, (i / 8, i % 8)))) {
                let solid = (low + y) * ONE < heights[z][x];
                assert_eq!(layers[y as usize] >> (z * 8 + x) & 1 == 1, solid, "{x} {y} {z} from {low}");
            }
        }
    }

    #[test]
    fn a_brick_of_one_number_is_uniform() {
        let mut brick = Brick::of_edited(&[-5; 512]);
        assert_eq!((brick.solid(), brick.edited()), (&[u64::MAX; 8], &[u64::MAX; 8]));
        assert_eq!(brick.uniform(), Some(UniformKind { sample: Sample(-5), material: MaterialId::GROUND }));
        brick.set_material(77, MaterialId(2));
        assert_eq!(brick.uniform(), None);
    }
}
