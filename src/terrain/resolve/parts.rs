//! Replaces parts of a world by parts from a save or from another machine with the same world.

use std::sync::Arc;

use glam::IVec3;
use rayon::prelude::*;
use rustc_hash::FxHashSet;
use web_time::Instant;

use super::resolved::{Resolved, install};
use super::step::{Placed, place};
use crate::backend::Cpu;
use crate::edits::{EditEffect, count_replaced};
use crate::ground::Ground;
use crate::lattice::{BrickPos, LatticeBox};
use crate::redraw::{Scene, Stages, dirty_cells, joined_mask};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::terrain::history::UndoDelta;
use crate::terrain::parts_error::{PartsError, check_number};
use crate::terrain::receipt::{Applied, Asked, Receipt};
use crate::volume::layers::{self, offset};
use crate::volume::{Brick, Field, FieldId, UniformBricks, pristine_layers};
use crate::world::{self, Change, Meshing, Patch, World, brick_over, columns_of};

/// A replacement brick.
struct NewBrick {
    pos: BrickPos,
    brick: Option<Arc<Brick>>,
    changed: Option<LatticeBox>,
    effect: EditEffect,
    /// By how much the hash of the world's samples changes.
    hash: u64,
}

impl NewBrick {
    fn new(
        world: &World,
        pos: BrickPos,
        brick: Option<&Arc<Brick>>,
        counts: bool,
    ) -> Result<Self, PartsError> {
        let mut brick = brick.map(Arc::clone);
        let (bounds, own) = (world.grid.edit_bounds(), pos.samples());
        // Far out, lattice points do not fit 32 bits, and those that wrap around may seem to lie in the world.
        if BrickPos::of(own.min) != pos || own.intersection(bounds).is_none() {
            return Err(PartsError::OutsideWorld(pos));
        }
        if let Some(new) = &brick {
            let is_inside = |index| bounds.contains(pos.origin() + offset(index));
            if !bounds.encloses(own) && !layers::indices(new.edited()).all(is_inside) {
                return Err(PartsError::OutsideWorld(pos));
            }
            let pristine = layers::without(&pristine_layers(&world.ground, pos), new.edited());
            if layers::without(new.solid(), new.edited()) != pristine {
                return Err(PartsError::OtherGround(pos));
            }
        }
        // One without an edited sample is pristine.
        brick.take_if(|brick| *brick.edited() == layers::NONE);
        let before = world.bricks.get(&pos);
        let mut effect = EditEffect::default();
        let changed = if counts || before.is_some() {
            let pair = [before.map(Arc::as_ref), brick.as_deref()];
            count_replaced(&world.ground, pos, pair, &mut effect)
        } else {
            brick.as_ref().and_then(|brick| layers::bounds(brick.edited(), pos.origin()))
        };
        let columns = columns_of(pos);
        let hash = |brick: Option<&Arc<Brick>>| {
            brick.map_or(0, |brick| brick.hash(pos.origin().y, brick.edited(), &columns))
        };
        let hash = hash(brick.as_ref()).wrapping_sub(hash(before));
        Ok(Self { pos, brick, changed, effect, hash })
    }
}

/// Resolves replaced parts; `hash` is the one that the world must have afterwards.
pub(crate) fn parts(scene: Scene, change: &Patch, hash: Option<u64>) -> Resolved {
    answered(scene.world, Asked::Parts, || replaced(scene, change, hash, true))
}

/// Resolves another ground.
pub(crate) fn ground(scene: Scene, ground: &Arc<Ground>) -> Resolved {
    answered(scene.world, Asked::Ground, || on_ground(scene.world, ground))
}

/// Adds the receipt, and the time that it took.
fn answered(
    world: &World,
    asked: Asked,
    resolve: impl FnOnce() -> Result<(Resolved, Applied), PartsError>,
) -> Resolved {
    let start = Instant::now();
    let (mut resolved, outcome) = match resolve() {
        Ok((resolved, applied)) => (resolved, Ok(applied)),
        Err(why) => (Resolved::nothing(world), Err(why.into())),
    };
    resolved.receipts.push(Receipt::of(asked, outcome));
    resolved.stages.whole = start.elapsed();
    resolved
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
    let (Resolved { changes, uniform, next_field, meshes, .. }, _) = replaced(scene, &parts, None, false)?;
    // The replaced parts are pristine.
    drop(install(&mut world, changes, uniform, meshes.kept(), next_field));
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
    let (next_field, whole) = (world.next_field, Some(Arc::new(world)));
    Ok((Resolved { next_field, whole, ..Resolved::nothing(before) }, Applied::default()))
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
    let all = change.bricks.par_iter().with_min_len(64);
    let all = all.map(|(pos, brick)| NewBrick::new(world, *pos, brick.as_ref(), counts));
    let mut new = Stages::time(&mut stages.edit, || all.collect::<Result<Vec<NewBrick>, PartsError>>())?;
    let delta = new.iter().fold(0u64, |sum, own| sum.wrapping_add(own.hash));
    let sample_hash = world.sample_hash.wrapping_add(delta);
    let found = World::hash_of(world.ground.hash(), sample_hash);
    if let Some(expected) = hash.filter(|&expected| expected != found) {
        return Err(PartsError::Hash { found, expected });
    }
    let uniform = share_uniform(world, &mut new);
    let mut effect = EditEffect::default();
    for own in &mut new {
        let EditEffect { removed, added, painted, .. } = std::mem::take(&mut own.effect);
        effect.removed.add(&removed);
        effect.added.add(&added);
        effect.painted.add(&painted);
    }
    let bricks: Vec<(BrickPos, Option<Arc<Brick>>)> =
        new.iter().map(|own| (own.pos, own.brick.clone())).collect();
    let changed: Vec<(BrickPos, LatticeBox)> =
        new.iter().filter_map(|own| Some((own.pos, own.changed?))).collect();
    let pristine = |pos| Arc::new(Brick::pristine(pristine_layers(&world.ground, pos)));
    let whole: Vec<(BrickPos, Arc<Brick>)> =
        bricks.iter().map(|(pos, brick)| (*pos, brick.clone().unwrap_or_else(|| pristine(*pos)))).collect();
    let words = Stages::time(&mut stages.ring, || words_of(world, &whole, &changed));
    let mut fields = change.fields.clone();
    fields.sort_by_key(|(chunk, _)| *chunk);
    let patch = Patch { bricks, fields, next_field };
    let change = Change { patch, mask: words, sample_hash };
    let replaced_bytes = change.patch.bricks.iter().map(|(pos, _)| world::replaced_bytes(world, *pos)).sum();
    let Placed { meshes, news } = place(scene, &change, &whole, &changed, &mut stages);
    let bounds = changed.iter().map(|&(_, own)| own).reduce(LatticeBox::union);
    let EditEffect { removed, added, painted, .. } = effect;
    let applied = Applied { bounds, removed, added, painted, ..Applied::default() };
    let delta = UndoDelta::new(change, replaced_bytes, 0, Default::default());
    let resolved = Resolved {
        news,
        uniform,
        next_field,
        stages,
        ..Resolved::new(world, vec![delta], sample_hash, meshes)
    };
    Ok((resolved, applied))
}

fn check_order(bricks: &[(BrickPos, Option<Arc<Brick>>)]) -> Result<(), PartsError> {
    let wrong = bricks.windows(2).find(|pair| pair[0].0 >= pair[1].0);
    wrong.map_or(Ok(()), |pair| Err(PartsError::Order(pair[1].0)))
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
fn share_uniform(world: &World, new: &mut [NewBrick]) -> Option<UniformBricks> {
    let mut grown: Option<UniformBricks> = None;
    for brick in new.iter_mut().filter_map(|own| own.brick.as_mut()) {
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

/// Evaluates rule 2 again near changed bricks, as samples may have become pristine again. Returns the mask
/// words that change.
pub(crate) fn words_of(
    world: &World,
    bricks: &[(BrickPos, Arc<Brick>)],
    changed: &[(BrickPos, LatticeBox)],
) -> Vec<((i32, i32), u64)> {
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
}
