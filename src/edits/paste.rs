//! Pastes prefabs. A paste is not a job of a backend: it looks its samples up, on the CPU, brick by brick.

use glam::IVec3;
use rayon::prelude::*;
use wide::i16x8;

use super::brick_editor::BrickEditor;
use super::delta::{Counts, EditDelta};
use super::padded_brick::PaddedBrick;
use super::prepared_edit::PreparedEdit;
use super::rule_scope::{BatchRules, BrickRules};
use crate::brush::{Edit, PasteSource, PrefabSample};
use crate::ground::MaterialId;
use crate::lattice::{BrickPos, ChunkGrid, LatticeBox, ONE};
use crate::volume::{DiggingRules, Layers, Sample, SampleView, VoxelOutcome, layers, resolve};

/// Bricks of a delta, so that threads share the work of a large prefab.
const BRICKS_AT_ONCE: usize = 32;

/// Applies an edit that pastes `source`, as far as rules allow. The result does not depend on how many threads there
/// are.
pub(super) fn paste(
    view: SampleView,
    grid: ChunkGrid,
    edit: &Edit,
    source: &PasteSource,
    rules: Option<&DiggingRules>,
) -> Vec<EditDelta> {
    let edits = [PreparedEdit::new(grid, edit, rules)];
    let [prepared] = &edits;
    let Some(reach) = prepared.reach else { return Vec::new() };
    let batch = rules.and_then(|rules| BatchRules::new(rules, &edits));
    let is_reached = |pos: &BrickPos| prepared.reaches(pos.samples());
    let mut bricks: Vec<BrickPos> = BrickPos::covering(reach).filter(is_reached).collect();
    bricks.sort_unstable();
    let work = |bricks: &[BrickPos]| {
        let mut delta = EditDelta::with_room(bricks.len());
        for &pos in bricks {
            let Some(samples) = reach.intersection(pos.samples()) else { continue };
            let rules = batch.as_ref().map(|batch| BrickRules::new(batch, pos));
            let rules = rules.map(|rules| (rules, PaddedBrick::new(&view, pos)));
            let mut distances = [i16x8::ZERO; 64];
            prepared.evaluator.rows(pos.origin(), 0..8, 0..8, &mut distances);
            let mut editor = BrickEditor::new(view, pos);
            editor.change(grid, samples, 0, &mut delta, |editor, samples, counts| {
                editor.paste(source, samples, &distances, prepared.power, rules.as_ref(), counts)
            });
            editor.finish(&mut delta);
        }
        delta
    };
    bricks.par_chunks(BRICKS_AT_ONCE).map(work).collect()
}

impl BrickEditor<'_> {
    /// Pastes the samples of a box that lie in the shape; returns those that changed.
    fn paste(
        &mut self,
        source: &PasteSource,
        samples: LatticeBox,
        distances: &[i16x8; 64],
        power: u8,
        rules: Option<&(BrickRules, PaddedBrick)>,
        counts: &mut Counts<'_>,
    ) -> Layers {
        let (low, mut changed) = (self.pos.origin(), layers::NONE);
        for index in layers::indices(&layers::within(self.pos, samples)) {
            let (row, x) = (index >> 3, index & 7);
            if distances[row].as_array()[x] > 0 {
                continue;
            }
            let point = low + layers::offset(index);
            let is_changed = source
                .sample(point)
                .is_some_and(|pasted| self.paste_sample(pasted, point, index, power, rules, counts));
            changed[index >> 6] |= u64::from(is_changed) << (index & 63);
        }
        changed
    }

    /// Pastes a sample unless a rule forbids it; returns whether it changed.
    fn paste_sample(
        &mut self,
        pasted: PrefabSample,
        point: IVec3,
        index: usize,
        power: u8,
        rules: Option<&(BrickRules, PaddedBrick)>,
        counts: &mut Counts<'_>,
    ) -> bool {
        let (view, ground) = (self.view, self.view.ground());
        let stored = self.current().map_or(MaterialId::GROUND, |brick| brick.material_at(index));
        let raw = self.samples()[index];
        let pristine = point.y * ONE - self.heights[index >> 3 & 7][index & 7];
        let before = raw.distance().unwrap_or(pristine);
        let own = if before < 0 { resolve(ground, point, stored) } else { MaterialId::GROUND };
        let is_same = Sample::edited(before).bits() == pasted.density && own == pasted.material;
        if is_same && !pasted.is_edited {
            return false;
        }
        // The ground's own material is not stored, as no other edit would.
        let is_own = |material| !pasted.has_stored_material && ground.material(point) == material;
        let material = match pasted.material {
            material if pasted.density >= 0 || is_own(material) => MaterialId::GROUND,
            material => material,
        };
        let after = Sample::edited(pasted.density.into());
        if raw == after && stored == material {
            return false;
        }
        let (was, is) = (before < 0, pasted.density < 0);
        let outcome = match (was, is) {
            (true, false) => Some((VoxelOutcome::Removed, own)),
            (false, true) => Some((VoxelOutcome::Added, pasted.material)),
            (true, true) if own != pasted.material => Some((VoxelOutcome::Painted, pasted.material)),
            _ => None,
        };
        if let Some((rules, around)) = rules {
            let local = [index & 7, index >> 6, index >> 3 & 7];
            let is_painted = matches!(outcome, Some((VoxelOutcome::Painted, _)));
            let refused =
                rules.refusal(&view, point, power, &around.around(local), pasted.density.into(), is_painted);
            if let Some(refused) = refused {
                if outcome.is_some() {
                    counts.add(refused, if was { own } else { pasted.material }, 1);
                }
                return false;
            }
        }
        if let Some((outcome, material)) = outcome {
            counts.add(outcome, material, 1);
        }
        let bit = 1 << (index & 63);
        let brick = self.brick();
        brick.set_material(index, material);
        brick.set_sample(index, after);
        brick.set_bits(index >> 6, bit, if is { bit } else { 0 });
        true
    }
}
