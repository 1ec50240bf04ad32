//! Replaces parts of a world by parts from a save or from another machine with the same world.

use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::FxHashSet;

use super::replacement::Replacement;
use super::resolved::Resolved;
use crate::backend::Cpu;
use crate::ground::Ground;
use crate::lattice::BrickPos;
use crate::redraw::{Scene, Stages};
use crate::terrain::parts_error::{PartsError, check_number};
use crate::terrain::receipt::{Applied, OrderKind, Receipt};
use crate::volume::layers::{self, offset};
use crate::volume::{Brick, Field, FieldId, UniformBricks, pristine_layers};
use crate::world::{Change, ChangedBrick, Meshing, Patch, World, brick_over};

/// A brick that fits the world, or `None` if it has no edited sample and so is pristine.
fn checked(
    world: &World,
    pos: BrickPos,
    brick: Option<&Arc<Brick>>,
) -> Result<Option<Arc<Brick>>, PartsError> {
    let (bounds, samples) = (world.grid.edit_bounds(), pos.samples());
    // Far out, lattice points do not fit 32 bits, and those that wrap around may seem to lie in the world.
    if BrickPos::of(samples.min) != pos || samples.intersection(bounds).is_none() {
        return Err(PartsError::OutsideWorld(pos));
    }
    if let Some(brick) = brick {
        let is_inside = |index| bounds.contains(pos.origin() + offset(index));
        if !bounds.encloses(samples) && !layers::indices(brick.edited()).all(is_inside) {
            return Err(PartsError::OutsideWorld(pos));
        }
        let pristine = layers::without(&pristine_layers(&world.ground, pos), brick.edited());
        if layers::without(brick.solid(), brick.edited()) != pristine {
            return Err(PartsError::OtherGround(pos));
        }
    }
    Ok(brick.filter(|brick| *brick.edited() != layers::NONE).cloned())
}

/// Resolves replaced parts; `hash` is the one that the world must have afterwards.
pub(crate) fn parts(scene: Scene, change: &Patch, hash: Option<u64>) -> Resolved {
    answered(scene.world, OrderKind::Parts, replaced(scene, change, hash, true))
}

/// Resolves another ground.
pub(crate) fn ground(scene: Scene, ground: &Arc<Ground>) -> Resolved {
    answered(scene.world, OrderKind::Ground, on_ground(scene.world, ground))
}

/// Adds the receipt.
fn answered(world: &World, kind: OrderKind, result: Result<(Resolved, Applied), PartsError>) -> Resolved {
    let (resolved, outcome) = match result {
        Ok((resolved, applied)) => (resolved, Ok(applied)),
        Err(why) => (Resolved::nothing(world), Err(why.into())),
    };
    resolved.with_receipt(Receipt::of(kind, outcome))
}

/// A world of these parts. Nothing is meshed: surfaces are made when they are asked for.
pub(crate) fn world_of(
    ground: Arc<Ground>,
    chunk_size: i32,
    parts: Patch,
    revision: u64,
) -> Result<World, PartsError> {
    check_number(revision)?;
    let mut world = World::new(ground, chunk_size);
    let scene = Scene { world: &world, meshing: Meshing::Never, cut: None, backend: &Cpu };
    let (Resolved { outcome, meshes, .. }, _) = replaced(scene, &parts, None, false)?;
    // The replaced parts are pristine.
    drop(outcome.install(&mut world, meshes.kept()));
    world.revision = revision;
    Ok(world)
}

/// Rebuilds the world with its edits on another ground.
fn on_ground(before: &World, ground: &Arc<Ground>) -> Result<(Resolved, Applied), PartsError> {
    let size = |ground: &Ground| (ground.width(), ground.depth());
    let (found, expected) = (size(ground), size(&before.ground));
    if found != expected {
        return Err(PartsError::GroundSize { found, expected });
    }
    let mut parts = before.all_parts();
    for (pos, brick) in &mut parts.bricks {
        *brick = brick.take().map(|brick| brick_over(ground, *pos, brick));
    }
    let world = world_of(Arc::clone(ground), before.grid.size(), parts, before.revision)?;
    let mut resolved = Resolved::nothing(before);
    resolved.outcome.next_field = world.next_field;
    resolved.outcome.whole = Some(Arc::new(world));
    Ok((resolved, Applied::default()))
}

/// Replaces parts. Without `counts` the receipt counts no voxels.
fn replaced(
    scene: Scene,
    change: &Patch,
    hash: Option<u64>,
    counts: bool,
) -> Result<(Resolved, Applied), PartsError> {
    let (world, mut stages) = (scene.world, Stages::default());
    check_order(&change.bricks)?;
    let next_field = check_fields(world, change)?;
    let bricks = change.bricks.par_iter().with_min_len(64);
    let bricks = bricks.map(|(pos, brick)| Ok((*pos, checked(world, *pos, brick.as_ref())?)));
    let mut bricks: Vec<ChangedBrick> =
        Stages::time(&mut stages.edit, || bricks.collect::<Result<_, PartsError>>())?;
    let uniform = share_uniform(world, &mut bricks);
    let mut fields = change.fields.clone();
    fields.sort_by_key(|(chunk, _)| *chunk);
    let change = Change { patch: Patch { bricks, fields, next_field }, ..Change::default() };
    let mut replacement = Replacement::new(scene, change, counts, stages);
    replacement.update_hash();
    let found = World::hash_of(world.ground.hash(), replacement.change.sample_hash);
    if let Some(expected) = hash.filter(|&expected| expected != found) {
        return Err(PartsError::Hash { found, expected });
    }
    replacement.update_mask();
    let (mut resolved, applied) = replacement.resolve(0, Default::default());
    resolved.outcome.uniform = uniform;
    Ok((resolved, applied))
}

fn check_order(bricks: &[ChangedBrick]) -> Result<(), PartsError> {
    let wrong = bricks.windows(2).find(|pair| pair[0].0 >= pair[1].0);
    wrong.map_or(Ok(()), |pair| Err(PartsError::Unsorted(pair[1].0)))
}

/// Checks the fields of a change; returns the greatest name that a field will have had.
fn check_fields(world: &World, change: &Patch) -> Result<u64, PartsError> {
    let (mut chunks, mut names) = (FxHashSet::default(), FxHashSet::default());
    let mut greatest = check_number(world.next_field.max(change.next_field))?;
    for (chunk, fields) in &change.fields {
        let own = world.grid.chunk_samples(*chunk).intersection(world.grid.edit_bounds());
        let is_inside = |field: &Field| own.is_some_and(|own| own.encloses(field.bounds));
        if !world.grid.has_tile(chunk.tile()) || !chunks.insert(*chunk) || !fields.iter().all(is_inside) {
            return Err(PartsError::Fields(*chunk));
        }
        for FieldId(name) in fields.iter().map(|field| field.id) {
            greatest = greatest.max(check_number(name)?);
            if !names.insert(name) {
                return Err(PartsError::Fields(*chunk));
            }
        }
    }
    Ok(greatest)
}

/// Shares equal uniform bricks; returns the pool, if it has grown.
fn share_uniform(world: &World, bricks: &mut [ChangedBrick]) -> Option<UniformBricks> {
    let mut grown: Option<UniformBricks> = None;
    for brick in bricks.iter_mut().filter_map(|(_, brick)| brick.as_mut()) {
        let Some(kind) = brick.uniform() else { continue };
        let pool = grown.as_ref().unwrap_or(&world.uniform);
        match pool.get(&kind) {
            Some(shared) => *brick = Arc::clone(shared),
            None => {
                grown.get_or_insert_with(|| world.uniform.clone()).insert(kind, Arc::clone(brick));
            }
        }
    }
    grown
}
