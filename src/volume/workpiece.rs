//! A brick that edits work on, row by row.

use std::sync::Arc;

use glam::IVec3;
use wide::{i16x8, i32x8};

use super::brick::solid_layers;
use super::draft::{Job, Tool};
use super::ledger::{Counts, Fate, Ledger, PartEffect};
use super::view::resolve;
use super::{Brick, DraftedBrick, Sample, SampleView};
use crate::brush::{BAND, DEPTH, Operation};
use crate::ground::MaterialId;
use crate::lattice::{BrickPos, ChunkGrid, Column, LatticeBox, ONE, hash};

/// A brick under work.
pub(super) struct Workpiece<'a> {
    view: SampleView<'a>,
    grid: ChunkGrid,
    pos: BrickPos,
    /// What it was before.
    base: Option<&'a Brick>,
    brick: Brick,
    /// Heights of its columns, and the density of its lowest pristine samples.
    floor: [i32x8; 8],
    /// Samples that changed.
    changed: [u64; 8],
}

/// Samples of a row that changed sides: one bit each.
#[derive(Clone, Copy, Default)]
struct Moved {
    /// Solid before, and air now.
    removed: u8,
    /// Air before, and solid now.
    added: u8,
}

impl<'a> Workpiece<'a> {
    /// A brick as it is.
    pub fn new(view: SampleView<'a>, grid: ChunkGrid, pos: BrickPos) -> Self {
        let low = pos.origin();
        let heights = view.ground().heights::<8>(Column::of(low));
        let base = view.brick(pos);
        let brick = base.cloned().unwrap_or_else(|| Brick::pristine(solid_layers(&heights, low.y)));
        let floor = heights.map(|row| i32x8::splat(low.y * ONE) - i32x8::new(row));
        Self { view, grid, pos, base, brick, floor, changed: [0; 8] }
    }

    /// Applies all jobs.
    pub fn take<'j>(mut self, tools: &[Tool], jobs: impl Iterator<Item = &'j Job>, ledger: &mut Ledger) {
        let mut distances = [[0; 8]; 64];
        let low = self.pos.origin();
        for job in jobs {
            let (edit, tool) = (job.edit as usize, &tools[job.edit as usize]);
            let Some(reached) = tool.reach.and_then(|reach| reach.intersection(self.pos.samples())) else {
                continue;
            };
            let (from, to) = (reached.min - low, reached.max - low);
            tool.evaluator.rows(low, from.y..to.y + 1, from.z..to.z + 1, &mut distances);
            let first = ledger.counts.len();
            let mut counts = Counts { edit, first, list: &mut ledger.counts };
            for chunk in self.grid.chunks_of(reached) {
                let Some(samples) = self.grid.chunk_samples(chunk).intersection(reached) else { continue };
                if let Some(bounds) = self.apply(tool.operation, samples, &distances, &mut counts) {
                    ledger.parts.push(PartEffect { edit, chunk, bounds });
                }
            }
        }
        let Some(changed) = bounds(&self.changed, low) else { return };
        ledger.hash = ledger.hash.wrapping_add(self.hash_change());
        let before = self.base.map_or([0; 8], |brick| *brick.edited());
        let is_extended = before != *self.brick.edited();
        let drafted = DraftedBrick { pos: self.pos, brick: Arc::new(self.brick), changed, is_extended };
        ledger.bricks.push(drafted);
    }

    /// Applies an operation to some samples; returns the box of those that changed.
    fn apply(
        &mut self,
        operation: Operation,
        samples: LatticeBox,
        distances: &[[i32; 8]; 64],
        counts: &mut Counts<'_>,
    ) -> Option<LatticeBox> {
        let low = self.pos.origin();
        let (from, to) = ((samples.min - low).as_usizevec3(), (samples.max - low).as_usizevec3());
        let lanes = i32x8::new(std::array::from_fn(|x| -i32::from((from.x..=to.x).contains(&x))));
        let mut changed = [0; 8];
        for (y, layer) in (from.y..=to.y).zip(&mut changed[from.y..]) {
            for z in from.z..=to.z {
                let outside = i32x8::new(distances[y * 8 + z]);
                let row = match operation {
                    Operation::Paint { material } => self.paint((y, z), outside, lanes, material, counts),
                    _ => self.carve((y, z), outside, lanes, operation, counts),
                };
                *layer |= u64::from(row) << (z * 8);
            }
        }
        self.changed.iter_mut().zip(&changed).for_each(|(all, layer)| *all |= layer);
        bounds(&changed, low)
    }

    /// Digs or adds in a row; returns the lanes that changed.
    #[inline(always)]
    fn carve(
        &mut self,
        (y, z): (usize, usize),
        outside: i32x8,
        lanes: i32x8,
        operation: Operation,
        counts: &mut Counts<'_>,
    ) -> u8 {
        let at = y * 64 + z * 8;
        let row = i16x8::new(self.brick.row(at));
        let raw = i32x8::from_i16x8(row);
        let pristine = self.floor[z] + i32x8::splat(y as i32 * ONE);
        let before = raw.simd_eq(i32x8::splat(i16::MIN.into())).select(pristine, raw);
        let depth = outside.max(i32x8::splat(-DEPTH));
        let after = if operation == Operation::Dig { before.max(-depth) } else { before.min(depth) };
        let most = i32x8::splat(i16::MAX.into());
        let stored = after.max(-most).min(most);
        let kept = outside.simd_gt(i32x8::splat(BAND)) | after.simd_eq(before) | stored.simd_eq(raw);
        let changes = lanes & !kept;
        let changed = bits(changes);
        if changed == 0 {
            return 0;
        }
        let row = i16x8::from_i32x8_saturate(changes.select(stored, raw));
        let (was, is) = (negative(before), negative(after));
        self.brick.set_row(at, row.to_array(), changed, is);
        let moved = Moved { removed: changed & was & !is, added: changed & is & !was };
        if moved.removed | moved.added != 0 {
            self.count(at, moved, operation, counts);
        }
        changed
    }

    /// Counts voxels that changed sides, and gives new ones their material.
    fn count(&mut self, at: usize, moved: Moved, operation: Operation, counts: &mut Counts<'_>) {
        let ground = self.view.ground();
        for x in ones(moved.removed | moved.added) {
            let index = at + x;
            let point = self.pos.origin() + offset(index);
            if moved.removed >> x & 1 == 1 {
                counts.add(Fate::Removed, resolve(ground, point, self.brick.material_at(index)));
                // Air is of no material.
                self.brick.set_material(index, MaterialId::GROUND);
                continue;
            }
            if let Operation::Add { material } = operation {
                self.brick.set_material(index, material);
            }
            counts.add(Fate::Added, resolve(ground, point, self.brick.material_at(index)));
        }
    }

    /// Paints the solid samples of a row inside the shape; returns the lanes that changed.
    fn paint(
        &mut self,
        (y, z): (usize, usize),
        outside: i32x8,
        lanes: i32x8,
        material: MaterialId,
        counts: &mut Counts<'_>,
    ) -> u8 {
        let at = y * 64 + z * 8;
        let mut row = self.brick.row(at);
        let pristine = (self.floor[z] + i32x8::splat(y as i32 * ONE)).to_array();
        let inside = bits(lanes & !outside.simd_gt(i32x8::splat(0)));
        let mut changed = 0;
        for x in ones(inside) {
            let index = at + x;
            let (sample, old) = (self.brick.samples()[index], self.brick.material_at(index));
            let before = sample.or(pristine[x]);
            if before >= 0 || sample != Sample::PRISTINE && material == old {
                continue;
            }
            let point = self.pos.origin() + offset(index);
            let (ground, is_pristine) = (self.view.ground(), sample == Sample::PRISTINE);
            if resolve(ground, point, material) != resolve(ground, point, old) {
                counts.add(Fate::Painted, resolve(ground, point, material));
            }
            if is_pristine {
                row[x] = Sample::edited(before).distance().unwrap_or_default() as i16;
            }
            self.brick.set_material(index, material);
            changed |= 1 << x;
        }
        if changed != 0 {
            self.brick.set_row(at, row, changed, changed);
        }
        changed
    }

    /// By how much the brick changes the hash of the world's samples.
    fn hash_change(&self) -> u64 {
        let low = self.pos.origin();
        let mut columns = self.changed.iter().fold(0, |all, layer| all | layer);
        let mut change = 0u64;
        while columns != 0 {
            let bit = columns.trailing_zeros() as usize;
            columns &= columns - 1;
            let place = place_hash(Column::of(low + offset(bit)));
            for y in (0..8).filter(|&y| self.changed[y] >> bit & 1 == 1) {
                let index = y * 64 + bit;
                let height = low.y + y as i32;
                let of = |brick: &Brick| {
                    sample_hash(place, height, brick.samples()[index], brick.material_at(index))
                };
                change = change.wrapping_add(of(&self.brick)).wrapping_sub(self.base.map_or(0, of));
            }
        }
        change
    }
}

/// From a brick's lowest sample to the one with this index.
fn offset(index: usize) -> IVec3 {
    IVec3::new((index & 7) as i32, (index >> 6) as i32, (index >> 3 & 7) as i32)
}

/// What all samples of a column have in common.
fn place_hash(column: Column) -> u64 {
    hash::mix(column.x as u32 as u64 | (column.z as u32 as u64) << 32)
}

/// What a sample adds to the world's hash; a pristine one adds nothing.
fn sample_hash(place: u64, y: i32, sample: Sample, material: MaterialId) -> u64 {
    let Some(distance) = sample.distance() else { return 0 };
    hash::mix(place ^ (y as u32 as u64) << 32 ^ (distance as u16 as u64) << 8 ^ u64::from(material.0))
}

/// Lanes whose mask is set.
fn bits(mask: i32x8) -> u8 {
    mask.to_bitmask() as u8
}

/// Lanes below zero.
fn negative(values: i32x8) -> u8 {
    bits(values.simd_lt(i32x8::splat(0)))
}

/// Positions of the bits that are set, lowest first.
fn ones(mut bits: u8) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (bit < 8).then_some(bit)
    })
}

/// The box around the samples of some layers, which lie from `low` on.
fn bounds(layers: &[u64; 8], low: IVec3) -> Option<LatticeBox> {
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
