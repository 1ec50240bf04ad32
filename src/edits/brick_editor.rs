//! A brick that is being edited: its samples before and after, and the changes.

use std::sync::Arc;

use super::delta::{Counts, EditDelta};
use super::effect::DraftedBrick;
use crate::ground::MaterialId;
use crate::lattice::{BrickPos, ChunkGrid, Column, LatticeBox};
use crate::volume::layers::{self, Layers, offset, ones};
use crate::volume::{Brick, PRISTINE, Sample, SampleView, VoxelOutcome, column_hash, for_runs, solid_layers};

/// A brick that edits change one after the other.
pub(super) struct BrickEditor<'a> {
    pub view: SampleView<'a>,
    pub pos: BrickPos,
    /// The brick before the edits.
    base: Option<&'a Brick>,
    /// The brick with the edits that were applied; `None` until its first sample changes.
    brick: Option<Brick>,
    /// Heights of its columns.
    pub heights: [[i32; 8]; 8],
    /// Samples that changed.
    changed: Layers,
}

/// Samples of a layer that changed: a bit each, as in [`Layers`].
#[derive(Clone, Copy, Default)]
pub(super) struct Changed {
    pub all: u64,
    /// Changed samples that were solid.
    pub was: u64,
    /// Changed samples that are solid now.
    pub is: u64,
}

impl<'a> BrickEditor<'a> {
    /// An editor for this brick.
    pub fn new(view: SampleView<'a>, pos: BrickPos) -> Self {
        let heights = view.ground().heights::<8>(Column::of(pos.origin()));
        Self { view, pos, base: view.brick(pos), brick: None, heights, changed: layers::NONE }
    }

    /// The present brick; `None` while all samples are pristine.
    pub fn current(&self) -> Option<&Brick> {
        self.brick.as_ref().or(self.base)
    }

    /// The present samples.
    pub fn samples(&self) -> &[Sample; 512] {
        self.current().map_or(&PRISTINE, Brick::samples)
    }

    /// The present brick, for changes.
    #[inline]
    pub fn brick(&mut self) -> &mut Brick {
        let (base, heights, y) = (self.base, &self.heights, self.pos.origin().y);
        self.brick.get_or_insert_with(|| match base {
            Some(base) => base.clone(),
            None => Brick::pristine(solid_layers(heights, y)),
        })
    }

    /// Has an edit change samples of a box, chunk by chunk. `change` gets each chunk's part of the box and returns the
    /// samples that changed.
    pub fn change(
        &mut self,
        grid: ChunkGrid,
        samples: LatticeBox,
        edit: usize,
        delta: &mut EditDelta,
        mut change: impl FnMut(&mut Self, LatticeBox, &mut Counts<'_>) -> Layers,
    ) {
        for chunk in grid.chunks_of(samples) {
            let Some(own) = grid.chunk_samples(chunk).intersection(samples) else { continue };
            let changed = change(self, own, &mut delta.counts(edit));
            self.changed.iter_mut().zip(&changed).for_each(|(all, layer)| *all |= layer);
            if let Some(bounds) = layers::bounds(&changed, self.pos.origin()) {
                delta.reach(edit, chunk, bounds);
            }
        }
    }

    /// Enters the brick and the change of the world's hash into a delta, if any sample changed.
    pub fn finish(mut self, delta: &mut EditDelta) {
        let Some(changed) = layers::bounds(&self.changed, self.pos.origin()) else { return };
        let Some(brick) = self.brick.take() else { return };
        delta.hash = delta.hash.wrapping_add(self.hash_change(&brick));
        let before = self.base.map_or(layers::NONE, |brick| *brick.edited());
        let is_extended = before != *brick.edited();
        delta.change(DraftedBrick::new(self.pos, Arc::new(brick), changed, is_extended));
    }

    /// Counts voxels of a layer that turned solid or air, and gives new solid ones this material unless they have one.
    pub fn count(
        &mut self,
        y: usize,
        changed: Changed,
        material: Option<MaterialId>,
        counts: &mut Counts<'_>,
    ) {
        let (removed, added) = (changed.was & !changed.is, changed.is & !changed.was);
        if removed != 0 {
            self.count_by_material(VoxelOutcome::Removed, y, removed, counts);
            self.brick().clear_materials(y, removed);
        }
        if added != 0 {
            if let Some(material) = material {
                self.brick().set_materials(y, added, material);
            }
            match material {
                None | Some(MaterialId::GROUND) => {
                    self.count_by_material(VoxelOutcome::Added, y, added, counts);
                }
                Some(material) => counts.add(VoxelOutcome::Added, material, added.count_ones().into()),
            }
        }
    }

    /// Counts voxels of a layer by the materials that they have now.
    fn count_by_material(&mut self, outcome: VoxelOutcome, y: usize, voxels: u64, counts: &mut Counts<'_>) {
        let (ground, pos) = (self.view.ground(), self.pos);
        let single = ground.single_material();
        let brick = &*self.brick();
        let mut own = voxels;
        if brick.material_bytes() != 0 {
            let stored = |bit: &usize| brick.material_at(y * 64 + bit);
            own = ones(voxels)
                .filter(|bit| stored(bit) == MaterialId::GROUND)
                .fold(0, |own, bit| own | 1 << bit);
            let others = ones(voxels & !own).map(|bit| stored(&bit));
            for_runs(others, |material, voxels| counts.add(outcome, material, voxels));
        }
        match single {
            _ if own == 0 => {}
            Some(material) => counts.add(outcome, material, own.count_ones().into()),
            None => ground.for_materials(pos, y, own, |material, voxels| {
                counts.add(outcome, material, voxels.count_ones().into());
            }),
        }
    }

    /// The change in the hash of the world's samples.
    fn hash_change(&self, brick: &Brick) -> u64 {
        let low = self.pos.origin();
        let mut columns = [0; 64];
        for bit in ones(layers::columns(&self.changed)) {
            columns[bit] = column_hash(Column::of(low + offset(bit)));
        }
        // Pristine samples contribute nothing to the hash.
        let before = self.base.map_or(0, |base| {
            let stored = layers::and(&self.changed, base.edited());
            base.hash(low.y, &stored, &columns)
        });
        brick.hash(low.y, &self.changed, &columns).wrapping_sub(before)
    }
}
