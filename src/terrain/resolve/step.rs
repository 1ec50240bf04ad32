//! Replaces the present bricks, fields and mask by those of another time, for a step through history; parts from a save
//! use the same code.

use std::sync::Arc;

use web_time::Instant;

use super::field_log::{FieldChange, news_of_replaced};
use super::resolved::Resolved;
use crate::edits::{EditEffect, count_replaced};
use crate::lattice::{BrickPos, ChunkPos, LatticeBox};
use crate::loose::ReturnedPiece;
use crate::redraw::{self, MeshUpdates, Scene, Stages, dirty_cells};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::terrain::history::{Step, UndoDelta};
use crate::terrain::receipt::{Applied, Asked, Receipt};
use crate::volume::{Brick, Fields, pristine_layers};
use crate::world::{Change, replaced_bytes};

/// How meshes and fields change when parts are replaced.
pub(crate) struct Placed {
    pub meshes: MeshUpdates,
    pub news: Vec<(ChunkPos, FieldChange)>,
}

/// Draws the world with a change; `bricks` are those of the change with pristine ones made, `changed` says where
/// samples differ.
pub(crate) fn place(
    scene: Scene,
    change: &Change,
    bricks: &[(BrickPos, Arc<Brick>)],
    changed: &[(BrickPos, LatticeBox)],
    stages: &mut Stages,
) -> Placed {
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
        dirty_cells(world.grid, changed, |&(pos, own)| (pos, own, false))
    });
    let positions = || bricks.iter().map(|(pos, _)| *pos).collect();
    let meshes = redraw::updates(scene, &view, &dirty, &mask, positions, stages);
    let nothing = Fields::default();
    let news = change.patch.fields.iter().flat_map(|(chunk, after)| {
        let before = world.fields.get(chunk).unwrap_or(&nothing);
        news_of_replaced(before, after).into_iter().map(|news| (*chunk, news))
    });
    Placed { meshes, news: news.collect() }
}

/// Resolves a step through history.
pub(crate) fn step(scene: Scene, asked: Asked, target: &UndoDelta) -> Resolved {
    let (world, start, mut stages) = (scene.world, Instant::now(), Stages::default());
    let mut change = target.change.clone();
    // A stroke's parts are in the order of its commits.
    change.sort();
    let mut bricks = Vec::with_capacity(change.patch.bricks.len());
    let (mut effect, mut changed) = (EditEffect::default(), Vec::with_capacity(change.patch.bricks.len()));
    Stages::time(&mut stages.edit, || {
        for (pos, after) in &change.patch.bricks {
            let before = world.bricks.get(pos).map(Arc::as_ref);
            let own = count_replaced(&world.ground, *pos, [before, after.as_deref()], &mut effect);
            let pristine = || Arc::new(Brick::pristine(pristine_layers(&world.ground, *pos)));
            let brick = after.clone().unwrap_or_else(pristine);
            changed.extend(own.map(|own| (*pos, own)));
            bricks.push((*pos, brick));
        }
    });
    let Placed { meshes, news } = place(scene, &change, &bricks, &changed, &mut stages);
    let bounds = changed.iter().map(|&(_, own)| own).reduce(LatticeBox::union);
    let EditEffect { removed, added, painted, .. } = effect;
    let (mut returned, mut cut_again) = (Vec::new(), Vec::new());
    match Step::of(asked) {
        Some(Step::Undo) => {
            returned.extend(target.pieces.iter().map(|(tag, piece)| ReturnedPiece::new(*tag, piece)))
        }
        _ => cut_again.clone_from(&target.pieces),
    }
    let tags = target.tags.clone();
    let applied = Applied {
        bounds,
        removed,
        added,
        painted,
        tags: tags.clone(),
        returned,
        cut_again,
        ..Applied::default()
    };
    let replaced_bytes = change.patch.bricks.iter().map(|(pos, _)| replaced_bytes(world, *pos)).sum();
    let sample_hash = change.sample_hash;
    let delta = UndoDelta::new(change, replaced_bytes, target.group, (tags, target.pieces.clone()));
    stages.whole = start.elapsed();
    Resolved {
        receipts: vec![Receipt::of(asked, Ok(applied))],
        news,
        stages,
        ..Resolved::new(world, vec![delta], sample_hash, meshes)
    }
}
