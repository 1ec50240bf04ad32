//! Removes samples from a brick: a loose piece of ground becomes air.

use super::brick_editor::BrickEditor;
use super::delta::EditDelta;
use crate::brush::DEPTH;
use crate::lattice::{BrickPos, ChunkGrid};
use crate::volume::layers::{self, Layers, offset, ones};
use crate::volume::{SampleView, row};

/// Turns samples of a brick to the air that the middle of a large dig is, and enters that into `delta` as changes of
/// the edit with number `edit`. None of them may lie outside the world's columns. Samples that are such air already
/// stay as they are.
pub(crate) fn take_out(
    view: SampleView,
    grid: ChunkGrid,
    pos: BrickPos,
    samples: &Layers,
    edit: usize,
    delta: &mut EditDelta,
) {
    let mut editor = BrickEditor::new(view, pos);
    editor.change(grid, pos.samples(), edit, delta, |editor, part, _| {
        editor.empty(&layers::and(samples, &layers::within(pos, part)))
    });
    editor.finish(delta);
}

impl BrickEditor<'_> {
    /// Turns samples to air; returns those that changed.
    fn empty(&mut self, samples: &Layers) -> Layers {
        let (view, low) = (self.view, self.pos.origin());
        let is_other = |index: &usize| view.distance(low + offset(*index)) < DEPTH;
        let mut changed = layers::NONE;
        layers::indices(samples).filter(is_other).for_each(|index| changed[index >> 6] |= 1 << (index & 63));
        for (y, &layer) in changed.iter().enumerate().filter(|(_, layer)| **layer != 0) {
            let brick = self.brick();
            for (z, own) in layer.to_le_bytes().into_iter().enumerate() {
                let at = y * 64 + z * 8;
                let mut samples = row(brick.samples(), at);
                ones(own.into()).for_each(|x| samples[x] = DEPTH as i16);
                brick.set_row(at, samples);
            }
            brick.set_bits(y, layer, 0);
            brick.clear_materials(y, layer);
        }
        changed
    }
}
