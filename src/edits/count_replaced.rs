//! Counts the voxels that differ between two states of a brick, for undo and redo.

use super::effect::EditEffect;
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, LatticeBox};
use crate::volume::layers::{self, Layers, offset};
use crate::volume::{Brick, MaterialCounts, pristine_layers, resolve};

/// Counts the voxels that change when a brick is put in place of another; `None` stands for a pristine one. Returns the
/// box around samples that differ.
pub(crate) fn count_replaced(
    ground: &Ground,
    pos: BrickPos,
    [before, after]: [Option<&Brick>; 2],
    effect: &mut EditEffect,
) -> Option<LatticeBox> {
    let differ = Brick::differences([before, after]);
    let changed = layers::bounds(&differ, pos.origin())?;
    let solid = |brick: Option<&Brick>| brick.map_or_else(|| pristine_layers(ground, pos), |b| *b.solid());
    let (was, is) = (solid(before), solid(after));
    let material = |brick: Option<&Brick>, index| {
        let stored = brick.map_or(MaterialId::GROUND, |brick| brick.material_at(index));
        resolve(ground, pos.origin() + offset(index), stored)
    };
    let count = |counts: &mut MaterialCounts, voxels: Layers, brick| {
        counts
            .count_each(layers::indices(&layers::and(&voxels, &differ)).map(|index| material(brick, index)));
    };
    count(&mut effect.removed, layers::without(&was, &is), before);
    count(&mut effect.added, layers::without(&is, &was), after);
    let both = layers::and(&layers::and(&was, &is), &differ);
    let is_painted = |index: &usize| material(before, *index) != material(after, *index);
    effect.painted.count_each(layers::indices(&both).filter(is_painted).map(|index| material(after, index)));
    Some(changed)
}
