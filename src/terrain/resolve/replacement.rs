//! Replacements: bricks and fields in place of those of a world, for steps through history, resets, and parts from a
//! save or from another machine.

use std::sync::Arc;

use glam::IVec3;
use rustc_hash::FxHashSet;

use super::field_log::news_of_replaced;
use super::resolved::{Outcome, Resolved};
use crate::edits::{EditEffect, count_replaced};
use crate::lattice::{BrickPos, ItemCost, LatticeBox, parallel_map};
use crate::loose::LoosePiece;
use crate::redraw::{self, Scene, Stages, dirty_cells, joined_mask};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::terrain::history::UndoDelta;
use crate::terrain::receipt::Applied;
use crate::volume::{Brick, NO_FIELDS, layers, pristine_layers};
use crate::world::{Change, ChangedBrick, columns_of, replaced_bytes};

/// A change whose bricks, in order of position, take the place of a world's.
pub(super) struct Replacement<'a> {
    scene: Scene<'a>,
    pub change: Change,
    /// The bricks of the change; pristine ones are made.
    bricks: Vec<(BrickPos, Arc<Brick>)>,
    /// Boxes around the samples that differ.
    changed: Vec<(BrickPos, LatticeBox)>,
    /// Voxels that differ, and a box around all of them.
    applied: Applied,
    stages: Stages,
}

impl<'a> Replacement<'a> {
    /// Compares the bricks of a change with those of the world. Without `counts`, voxels are not counted where the
    /// world is pristine.
    pub fn new(scene: Scene<'a>, change: Change, counts: bool, mut stages: Stages) -> Self {
        let world = scene.world;
        let compare = |(pos, brick): &ChangedBrick| {
            let (before, mut effect) = (world.bricks.get(pos).map(Arc::as_ref), EditEffect::default());
            let changed = if counts || before.is_some() {
                count_replaced(&world.ground, *pos, [before, brick.as_deref()], &mut effect)
            } else {
                brick.as_ref().and_then(|brick| layers::bounds(brick.edited(), pos.origin()))
            };
            let pristine = || Arc::new(Brick::pristine(pristine_layers(&world.ground, *pos)));
            (brick.clone().unwrap_or_else(pristine), changed, effect)
        };
        let compared =
            Stages::time(&mut stages.edit, || parallel_map(&change.patch.bricks, ItemCost::Brick, compare));
        let (mut bricks, mut changed) =
            (Vec::with_capacity(compared.len()), Vec::with_capacity(compared.len()));
        let mut applied = Applied::default();
        for (&(pos, _), (brick, differs, effect)) in change.patch.bricks.iter().zip(compared) {
            bricks.push((pos, brick));
            if let Some(differs) = differs {
                changed.push((pos, differs));
                LatticeBox::include(&mut applied.bounds, differs);
            }
            applied.removed.add(&effect.removed);
            applied.added.add(&effect.added);
            applied.painted.add(&effect.painted);
        }
        Self { scene, change, bricks, changed, applied, stages }
    }

    /// Sets the hash of all samples to that of the world with these bricks.
    pub fn update_hash(&mut self) {
        let world = self.scene.world;
        let difference = |(pos, brick): &ChangedBrick| {
            let columns = columns_of(*pos);
            let hash = |brick: Option<&Arc<Brick>>| {
                brick.map_or(0, |brick| brick.hash(pos.origin().y, brick.edited(), &columns))
            };
            hash(brick.as_ref()).wrapping_sub(hash(world.bricks.get(pos)))
        };
        let differences = Stages::time(&mut self.stages.edit, || {
            parallel_map(&self.change.patch.bricks, ItemCost::Brick, difference)
        });
        self.change.sample_hash = differences.into_iter().fold(world.sample_hash, u64::wrapping_add);
    }

    /// Sets the words of the mask that change: evaluates rule 2 again near changed bricks, as samples may have become
    /// pristine again.
    pub fn update_mask(&mut self) {
        let (world, bricks, changed) = (self.scene.world, &self.bricks, &self.changed);
        self.change.mask = Stages::time(&mut self.stages.ring, || {
            // A cell has its corners in its own stack of bricks and in those behind it.
            let stacks: FxHashSet<(i32, i32)> = changed.iter().map(|(pos, _)| pos.stack()).collect();
            let behind = |&(x, z): &(i32, i32)| [(x, z), (x - 1, z), (x, z - 1), (x - 1, z - 1)];
            let words: FxHashSet<(i32, i32)> = stacks.iter().flat_map(behind).collect();
            let read: FxHashSet<(i32, i32)> =
                words.iter().flat_map(|&(x, z)| [(x, z), (x + 1, z), (x, z + 1), (x + 1, z + 1)]).collect();
            let mut cleared = Mask::default();
            words.iter().for_each(|&word| cleared.lay_word(word, 0));
            let stored = read.iter().flat_map(|stack| {
                let ys = world.stacks.get(stack).map(Vec::as_slice).unwrap_or_default();
                ys.iter().map(|&y| BrickPos(IVec3::new(stack.0, y, stack.1)))
            });
            let mut near: Vec<BrickPos> = stored.chain(bricks.iter().map(|(pos, _)| *pos)).collect();
            near.sort_unstable();
            near.dedup();
            let latest: Vec<_> = bricks.iter().map(|(pos, brick)| (*pos, brick.as_ref())).collect();
            let view = WorldView {
                samples: world.samples().under(&latest),
                mask: MaskView::new(&world.mask).over(&cleared),
                grid: world.grid,
            };
            let cells = dirty_cells(world.grid, &near, |&pos| (pos, pos.samples(), true));
            let found = joined_mask(world, &view, &cells);
            let words = words.into_iter().map(|word| (word, found.get_word(word).unwrap_or_default()));
            words.filter(|&(word, cells)| cells != world.mask.word(word)).collect()
        });
    }

    /// Draws the world with the change, as part of a group of edits with these tags and pieces. Returns the voxels that
    /// differ too.
    pub fn resolve(
        self,
        group: u64,
        (tags, pieces): (Vec<u64>, Vec<(u64, LoosePiece)>),
    ) -> (Resolved, Applied) {
        let Self { scene, change, bricks, changed, applied, mut stages } = self;
        let world = scene.world;
        let mut mask = Mask::default();
        change.mask.iter().for_each(|&(word, cells)| mask.lay_word(word, cells));
        let latest: Vec<_> = bricks.iter().map(|(pos, brick)| (*pos, brick.as_ref())).collect();
        let view = WorldView {
            samples: world.samples().under(&latest),
            mask: MaskView::new(&world.mask).over(&mask),
            grid: world.grid,
        };
        let dirty = Stages::time(&mut stages.meshing, || {
            dirty_cells(world.grid, &changed, |&(pos, differs)| (pos, differs, false))
        });
        let positions = || bricks.iter().map(|(pos, _)| *pos).collect();
        let meshes = redraw::updates(scene, &view, &dirty, &mask, positions, &mut stages);
        let news = change.patch.fields.iter().flat_map(|(chunk, after)| {
            let before = world.fields.get(chunk).unwrap_or(&NO_FIELDS);
            news_of_replaced(before, after).into_iter().map(|news| (*chunk, news))
        });
        let news = news.collect();
        let replaced_bytes = bricks.iter().map(|(pos, _)| replaced_bytes(world, *pos)).sum();
        let sample_hash = change.sample_hash;
        let next_field = world.next_field.max(change.patch.next_field);
        let delta = UndoDelta::new(change, replaced_bytes, group, (tags, pieces));
        let outcome = Outcome { news, next_field, ..Outcome::new(world, vec![delta], sample_hash) };
        (Resolved { outcome, meshes, stages }, applied)
    }
}
