//! A brick that edits work on, row by row.

use std::sync::Arc;

use glam::IVec3;
use wide::{i16x8, i32x8};

use super::delta::{Counts, EditDelta};
use super::draft::DraftedBrick;
use super::jobs::Job;
use super::padded_brick::PaddedBrick;
use super::prepared::PreparedEdit;
use super::rule_scope::RunRules;
use crate::brush::{BAND, DEPTH, Kind};
use crate::ground::MaterialId;
use crate::lattice::{BrickPos, ChunkGrid, Column, LatticeBox, ONE, hash};
use crate::volume::{Brick, Layers, PRISTINE, Sample, SampleView, VoxelOutcome, resolve, row, solid_layers};

/// A brick under work.
pub(super) struct BrickEditor<'a> {
    pub(super) view: SampleView<'a>,
    grid: ChunkGrid,
    pub(super) pos: BrickPos,
    /// What it was before.
    base: Option<&'a Brick>,
    /// What it is now; `None` until its first sample changes.
    brick: Option<Brick>,
    /// Heights of its columns.
    heights: [[i32; 8]; 8],
    /// Samples that changed.
    changed: Layers,
}

/// Samples of a layer that changed: a bit each, as in [`Layers`].
#[derive(Clone, Copy, Default)]
pub(super) struct Changed {
    pub all: u64,
    /// Those that were solid.
    pub was: u64,
    /// Those that are solid now.
    pub is: u64,
}

impl<'a> BrickEditor<'a> {
    /// A brick as it is.
    pub fn new(view: SampleView<'a>, grid: ChunkGrid, pos: BrickPos) -> Self {
        let heights = view.ground().heights::<8>(Column::of(pos.origin()));
        Self { view, grid, pos, base: view.brick(pos), brick: None, heights, changed: [0; 8] }
    }

    /// Applies all jobs.
    pub fn take(
        &mut self,
        tools: &[PreparedEdit],
        rules: Option<&RunRules>,
        jobs: &[Job],
        ledger: &mut EditDelta,
    ) {
        let mut distances = [i16x8::ZERO; 64];
        let low = self.pos.origin();
        let rules = rules.map(|rules| rules.of_brick(self.pos));
        for job in jobs {
            let (edit, tool) = (job.edit as usize, &tools[job.edit as usize]);
            let Some(reached) = tool.reach.and_then(|reach| reach.intersection(self.pos.samples())) else {
                continue;
            };
            let (from, to) = (reached.min - low, reached.max - low);
            tool.evaluator.rows(low, from.y..to.y + 1, from.z..to.z + 1, &mut distances);
            let rules = rules.as_ref().filter(|_| tool.is_bound);
            let around = tool.looks_around().then(|| PaddedBrick::new(&self.view, self.pos));
            for chunk in self.grid.chunks_of(reached) {
                let Some(samples) = self.grid.chunk_samples(chunk).intersection(reached) else { continue };
                let counts = &mut ledger.counts(edit);
                let changed = match &around {
                    Some(around) => self.carefully(tool, rules, samples, &distances, around, counts),
                    None => self.apply(tool.operation, samples, &distances, counts),
                };
                self.changed.iter_mut().zip(&changed).for_each(|(all, layer)| *all |= layer);
                if let Some(bounds) = bounds(&changed, low) {
                    ledger.reach(edit, chunk, bounds);
                }
            }
        }
        let Some(changed) = bounds(&self.changed, low) else { return };
        let Some(brick) = self.brick.take() else { return };
        ledger.hash = ledger.hash.wrapping_add(self.hash_change(&brick));
        let before = self.base.map_or([0; 8], |brick| *brick.edited());
        let is_extended = before != *brick.edited();
        ledger.change(DraftedBrick::new(self.pos, Arc::new(brick), changed, is_extended));
    }

    /// The samples as they are now.
    fn samples(&self) -> &[Sample; 512] {
        self.brick.as_ref().or(self.base).map_or(&PRISTINE, Brick::samples)
    }

    /// The brick, to be changed.
    pub(super) fn brick(&mut self) -> &mut Brick {
        let (base, heights, y) = (self.base, &self.heights, self.pos.origin().y);
        self.brick.get_or_insert_with(|| match base {
            Some(base) => base.clone(),
            None => Brick::pristine(solid_layers(heights, y)),
        })
    }

    /// Applies an operation to some samples; returns those that changed.
    fn apply(
        &mut self,
        operation: Kind,
        samples: LatticeBox,
        distances: &[i16x8; 64],
        counts: &mut Counts<'_>,
    ) -> Layers {
        let low = self.pos.origin();
        let (from, to) = ((samples.min - low).as_usizevec3(), (samples.max - low).as_usizevec3());
        let lanes = i16x8::new(std::array::from_fn(|x| -i16::from((from.x..=to.x).contains(&x))));
        let mut changed = [0; 8];
        for (y, layer) in (from.y..=to.y).zip(&mut changed[from.y..]) {
            let rows = (from.z..=to.z).zip(&distances[y * 8 + from.z..]);
            *layer = match operation {
                Kind::Paint { material } => rows.fold(0, |layer, (z, &outside)| {
                    let row = self.paint((y, z), outside, lanes, material, counts);
                    layer | u64::from(row) << (z * 8)
                }),
                _ => self.carve(y, rows, lanes, operation, counts),
            };
        }
        changed
    }

    /// Digs or adds in rows of a layer; returns the samples that changed.
    ///
    /// Densities that 16 bits do not hold are cut off. That changes no sample: the operation compares with depths of a
    /// few voxels, and leaves what is beyond them or puts a depth in its place.
    fn carve<'d>(
        &mut self,
        y: usize,
        rows: impl Iterator<Item = (usize, &'d i16x8)>,
        lanes: i16x8,
        operation: Kind,
        counts: &mut Counts<'_>,
    ) -> u64 {
        let mut changed = Changed::default();
        let height = i32x8::splat((self.pos.origin().y + y as i32) * ONE);
        for (z, &outside) in rows {
            let in_reach = lanes & !outside.simd_gt(i16x8::splat(BAND as i16));
            if in_reach.to_bitmask() == 0 {
                continue;
            }
            let at = y * 64 + z * 8;
            let raw = i16x8::new(row(self.samples(), at));
            let pristine = i16x8::from_i32x8_saturate(height - i32x8::new(self.heights[z]));
            let before = raw.simd_eq(i16x8::splat(i16::MIN)).select(pristine, raw);
            let depth = outside.max(i16x8::splat(-DEPTH as i16));
            let after = if operation == Kind::Dig { before.max(-depth) } else { before.min(depth) };
            let changes = in_reach & !after.simd_eq(before);
            let lanes = bits(changes);
            if lanes != 0 {
                self.brick().set_row(at, changes.select(after, raw).to_array());
                let of_layer = |lanes: u8| u64::from(lanes) << (z * 8);
                changed.all |= of_layer(lanes);
                changed.was |= of_layer(lanes & bits(before));
                changed.is |= of_layer(lanes & bits(after));
            }
        }
        if changed.all != 0 {
            self.brick().set_bits(y, changed.all, changed.is);
            let material = operation.material().unwrap_or(MaterialId::GROUND);
            self.count(y, changed, Some(material), counts);
        }
        changed.all
    }

    /// Counts voxels of a layer that changed sides, and gives new ones this material if they have none yet.
    pub(super) fn count(
        &mut self,
        y: usize,
        changed: Changed,
        material: Option<MaterialId>,
        counts: &mut Counts<'_>,
    ) {
        let (removed, added) = (changed.was & !changed.is, changed.is & !changed.was);
        if removed != 0 {
            self.tally(VoxelOutcome::Removed, y, removed, counts);
            // Air is of no material.
            self.brick().set_materials(y, removed, MaterialId::GROUND);
        }
        if added != 0 {
            if let Some(material) = material {
                self.brick().set_materials(y, added, material);
            }
            match material {
                None | Some(MaterialId::GROUND) => self.tally(VoxelOutcome::Added, y, added, counts),
                Some(material) => counts.add(VoxelOutcome::Added, material, added.count_ones().into()),
            }
        }
    }

    /// Counts voxels of a layer by the materials that they have now.
    fn tally(&mut self, fate: VoxelOutcome, y: usize, voxels: u64, counts: &mut Counts<'_>) {
        let (ground, low) = (self.view.ground(), self.pos.origin());
        let single = ground.single_material();
        let brick = &*self.brick();
        if brick.material_bytes() == 0
            && let Some(material) = single
        {
            return counts.add(fate, material, voxels.count_ones().into());
        }
        // Neighbours mostly are of one material.
        let (mut last, mut count) = (None, 0);
        for bit in ones(voxels) {
            let index = y * 64 + bit;
            let stored = brick.material_at(index);
            let own = || single.unwrap_or_else(|| ground.material(low + offset(index)));
            let material = if stored == MaterialId::GROUND { own() } else { stored };
            if last != Some(material) {
                last.into_iter().for_each(|last| counts.add(fate, last, count));
                (last, count) = (Some(material), 0);
            }
            count += 1;
        }
        last.into_iter().for_each(|last| counts.add(fate, last, count));
    }

    /// Paints the solid samples of a row inside the shape; returns the lanes that changed.
    fn paint(
        &mut self,
        (y, z): (usize, usize),
        outside: i16x8,
        lanes: i16x8,
        material: MaterialId,
        counts: &mut Counts<'_>,
    ) -> u8 {
        let (at, low) = (y * 64 + z * 8, self.pos.origin());
        let mut samples = row(self.samples(), at);
        let inside = bits(lanes & !outside.simd_gt(i16x8::ZERO));
        let mut changed = 0;
        for x in ones(inside.into()) {
            let (index, is_pristine) = (at + x, samples[x] == i16::MIN);
            let old = self.brick.as_ref().or(self.base).map_or(MaterialId::GROUND, |b| b.material_at(index));
            let pristine = (low.y + y as i32) * ONE - self.heights[z][x];
            let before = if is_pristine { pristine } else { samples[x].into() };
            if before >= 0 || !is_pristine && material == old {
                continue;
            }
            let (point, ground) = (low + offset(index), self.view.ground());
            if resolve(ground, point, material) != resolve(ground, point, old) {
                counts.add(VoxelOutcome::Painted, resolve(ground, point, material), 1);
            }
            if is_pristine {
                samples[x] = Sample::edited(before).distance().unwrap_or_default() as i16;
            }
            self.brick().set_material(index, material);
            changed |= 1 << x;
        }
        if changed != 0 {
            let layer = u64::from(changed) << (z * 8);
            self.brick().set_row(at, samples);
            self.brick().set_bits(y, layer, layer);
        }
        changed
    }

    /// By how much the brick changes the hash of the world's samples.
    fn hash_change(&self, brick: &Brick) -> u64 {
        let low = self.pos.origin();
        let mut places = [0; 64];
        for bit in ones(self.changed.iter().fold(0, |all, layer| all | layer)) {
            places[bit] = place_hash(Column::of(low + offset(bit)));
        }
        // Samples that were pristine counted nothing.
        let before = self.base.map_or(0, |base| {
            let stored = std::array::from_fn(|y| self.changed[y] & base.edited()[y]);
            hash_of(base, low.y, &stored, &places)
        });
        hash_of(brick, low.y, &self.changed, &places).wrapping_sub(before)
    }
}

/// What some edited samples of a brick add to the world's hash, by the hashes of their columns.
pub(super) fn hash_of(brick: &Brick, low: i32, layers: &Layers, places: &[u64; 64]) -> u64 {
    let of_layer = |(y, &layer): (usize, &u64)| {
        let height = low + y as i32;
        let of = |bit: usize| {
            let index = y * 64 + bit;
            sample_hash(places[bit], height, brick.samples()[index], brick.material_at(index))
        };
        ones(layer).fold(0u64, |sum, bit| sum.wrapping_add(of(bit)))
    };
    layers.iter().enumerate().map(of_layer).fold(0, u64::wrapping_add)
}

/// From a brick's lowest sample to the one with this index.
pub(super) fn offset(index: usize) -> IVec3 {
    IVec3::new((index & 7) as i32, (index >> 6) as i32, (index >> 3 & 7) as i32)
}

/// What all samples of a column have in common.
pub(super) fn place_hash(column: Column) -> u64 {
    hash::mix(column.x as u32 as u64 | (column.z as u32 as u64) << 32)
}

/// What a sample adds to the world's hash; a pristine one adds nothing.
fn sample_hash(place: u64, y: i32, sample: Sample, material: MaterialId) -> u64 {
    let Some(distance) = sample.distance() else { return 0 };
    hash::mix(place ^ (y as u32 as u64) << 32 ^ (distance as u16 as u64) << 8 ^ u64::from(material.0))
}

/// Lanes below zero, as those of masks are.
#[inline(always)]
fn bits(lanes: i16x8) -> u8 {
    lanes.to_bitmask() as u8
}

/// Positions of the bits that are set, lowest first.
#[inline(always)]
pub(super) fn ones(mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

/// The box around the samples of some layers, which lie from `low` on.
pub(super) fn bounds(layers: &Layers, low: IVec3) -> Option<LatticeBox> {
    let all = layers.iter().fold(0, |all, layer| all | layer);
    if all == 0 {
        return None;
    }
    let row = all.to_le_bytes().iter().fold(0, |row, byte| row | byte);
    let filled = |y: &usize| layers[*y] != 0;
    let (bottom, top) = ((0..8).find(filled).unwrap_or(0), (0..8).rfind(filled).unwrap_or(7));
    let min = IVec3::new(row.trailing_zeros() as i32, bottom as i32, (all.trailing_zeros() >> 3) as i32);
    let max = IVec3::new(7 - row.leading_zeros() as i32, top as i32, 7 - (all.leading_zeros() >> 3) as i32);
    LatticeBox::new(low + min, low + max)
}
