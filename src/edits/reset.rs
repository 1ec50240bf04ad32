//! Returns edited samples to the pristine ground. Unlike other edits this takes bricks away, so it is not a job of a
//! backend: it looks at stored bricks alone, on the CPU.

use std::sync::Arc;

use wide::i16x8;

use super::effect::EditEffect;
use super::padded_brick::PaddedBrick;
use super::prepared_edit::PreparedEdit;
use super::rule_scope::{BatchRules, BrickRules};
use crate::brush::{BAND, Edit};
use crate::lattice::{BrickPos, ChunkGrid, LatticeBox};
use crate::volume::layers::{self, Layers, of_row, offset};
use crate::volume::{Brick, DiggingRules, SampleView, pristine_layers};

/// A brick that a reset changed.
pub(crate) struct ResetBrick {
    pub pos: BrickPos,
    /// The remaining brick; `None` if all of it is pristine now.
    pub brick: Option<Arc<Brick>>,
    /// The samples that are pristine now and were not before.
    pub samples: Layers,
}

/// Returns the edited samples within an edit's reach to pristine ones, as far as rules allow. What they refuse is
/// counted in `effect`. The result is in order of position.
pub(crate) fn reset(
    view: SampleView,
    grid: ChunkGrid,
    edit: &Edit,
    rules: Option<&DiggingRules>,
    effect: &mut EditEffect,
) -> Vec<ResetBrick> {
    let edits = [PreparedEdit::new(grid, edit, rules)];
    let [prepared] = &edits;
    let Some(reach) = prepared.reach else { return Vec::new() };
    let batch = rules.and_then(|rules| BatchRules::new(rules, &edits));
    let mut stored = Vec::new();
    view.for_bricks(BrickPos::range(reach), |pos, brick| {
        if prepared.reaches(pos.samples()) {
            stored.push((pos, brick));
        }
    });
    stored.sort_unstable_by_key(|(pos, _)| *pos);
    let mut found = Vec::new();
    for (pos, brick) in stored {
        let near = layers::and(&within_band(prepared, pos), &layers::within(pos, reach));
        let mut samples = layers::and(brick.edited(), &near);
        if let Some(batch) = &batch {
            keep_allowed(&view, prepared, &BrickRules::new(batch, pos), pos, &mut samples, effect);
        }
        if samples == layers::NONE {
            continue;
        }
        let is_whole = layers::without(brick.edited(), &samples) == layers::NONE;
        let rest = || Arc::new(brick.without_edits(&samples, &pristine_layers(view.ground(), pos)));
        found.push(ResetBrick { pos, brick: (!is_whole).then(rest), samples });
    }
    found
}

/// The samples of a brick within a shape and the band around it, where digs and adds leave theirs.
fn within_band(prepared: &PreparedEdit, pos: BrickPos) -> Layers {
    let mut distances = [i16x8::ZERO; 64];
    prepared.evaluator.rows(pos.origin(), 0..8, 0..8, &mut distances);
    let row = |index: usize| !distances[index].simd_gt(i16x8::splat(BAND as i16)).to_bitmask() as u8;
    std::array::from_fn(|y| (0..8).fold(0, |layer, z| layer | of_row(row(y * 8 + z), z)))
}

/// Removes the samples that rules keep as they are. A sample is reset entirely or not at all.
fn keep_allowed(
    view: &SampleView,
    prepared: &PreparedEdit,
    rules: &BrickRules,
    pos: BrickPos,
    samples: &mut Layers,
    effect: &mut EditEffect,
) {
    if *samples == layers::NONE {
        return;
    }
    let (around, ground) = (PaddedBrick::new(view, pos), view.ground());
    for index in layers::indices(&{ *samples }) {
        let point = pos.origin() + offset(index);
        let local = [index & 7, index >> 6, index >> 3 & 7];
        let (before, pristine) = (around.density(local), ground.distance(point));
        let (own, new) = (view.material(point), ground.material(point));
        let is_painted = before < 0 && pristine < 0 && own != new;
        let refused = rules.refusal(view, point, prepared.power, &around.around(local), pristine, is_painted);
        let Some(outcome) = refused else { continue };
        samples[index >> 6] &= !(1 << (index & 63));
        if (before < 0) != (pristine < 0) || is_painted {
            let material = if before < 0 { own } else { new };
            effect.counts_mut(outcome).count_each([material]);
        }
    }
}

/// The box around the edited samples that some bricks have in a box.
pub(crate) fn edited_within<'a>(
    samples: LatticeBox,
    brick: impl Fn(BrickPos) -> Option<&'a Brick>,
) -> Option<LatticeBox> {
    let own = |pos: BrickPos| {
        let edited = layers::and(brick(pos)?.edited(), &layers::within(pos, samples));
        layers::bounds(&edited, pos.origin())
    };
    BrickPos::covering(samples).filter_map(own).reduce(LatticeBox::union)
}
