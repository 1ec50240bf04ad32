//! Edits drafted over a world: all together, or one after the other where each looks for what it cut off.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::loose::{self, LoosePiece, LooseSettings, Samples};
use super::world::World;
use crate::backend::Compute;
use crate::brush::{Edit, Operation};
use crate::lattice::BrickPos;
use crate::volume::{
    Bricks, ChunkEffect, Draft, DraftedBrick, EditEffect, EditWork, Ledger, TakenOut, UniformBricks,
};

/// Who drafts, over what.
pub(super) struct Drafting<'a> {
    pub world: &'a World,
    pub backend: &'a dyn Compute,
}

/// What edits make of a world.
pub(super) struct Drafted {
    pub draft: Draft,
    /// Its bricks, to be laid over those of the world.
    pub over: Bricks,
    /// What was cut off, by the number of the edit.
    pub pieces: BTreeMap<usize, Vec<LoosePiece>>,
}

/// Can the operation turn solid samples into air?
fn can_remove(edit: &Edit) -> bool {
    !matches!(edit.operation(), Operation::Add { .. } | Operation::Paint { .. })
}

/// A brick's place in a draft.
fn key(pos: BrickPos) -> [i32; 3] {
    [pos.0.x, pos.0.z, pos.0.y]
}

impl Drafting<'_> {
    /// What edits make of the world with newer bricks over it; each kind of uniform brick in `known` is shared.
    fn draft(&self, over: Option<&Bricks>, edits: &[&Edit], hash: u64, known: &UniformBricks) -> Draft {
        let (world, samples) = (self.world, self.world.samples());
        let base = over.map_or(samples, |over| samples.over(over));
        let apply = |work: &EditWork, each: &mut dyn FnMut(Ledger)| self.backend.edit(work, each);
        Draft::make(base, world.grid, edits, hash, known, world.rules(), apply)
    }

    /// All edits at once: each brick takes all of its edits.
    pub fn together(&self, edits: &[&Edit]) -> Drafted {
        let draft = self.draft(None, edits, self.world.sample_hash, &self.world.uniform);
        let over = draft.bricks.iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))).collect();
        Drafted { draft, over, pieces: BTreeMap::new() }
    }

    /// The same world, but each edit that can remove ground comes by itself, and what it cuts off falls before the next.
    pub fn one_by_one(&self, edits: &[&Edit], settings: &LooseSettings) -> Drafted {
        let world = self.world;
        let (mut over, mut pieces) = (Bricks::default(), BTreeMap::new());
        let mut all = Draft { hash: world.sample_hash, ..Draft::default() };
        let mut bricks: BTreeMap<[i32; 3], DraftedBrick> = BTreeMap::new();
        let mut known = world.uniform.clone();
        // Under rules an edit looks at what those before it left, so each comes by itself.
        let is_free = |edit: &Edit| world.rules().is_none() && !can_remove(edit);
        for group in edits.chunk_by(|a, b| is_free(a) && is_free(b)) {
            let mut draft = self.draft(Some(&over), group, all.hash, &known);
            known.extend(std::mem::take(&mut draft.uniform));
            let drafted = std::mem::take(&mut draft.bricks);
            let seeds = if group.iter().any(|edit| can_remove(edit)) {
                loose::seeds(world, &over, &drafted)
            } else {
                Samples::default()
            };
            lay(&mut over, &drafted);
            if !seeds.is_empty() {
                let fallen = loose::fall(world, &over, &seeds, settings);
                for TakenOut { mut drafted, hash, chunks } in fallen.taken {
                    draft.hash = draft.hash.wrapping_add(hash);
                    if let Some(effect) = draft.effects.last_mut() {
                        chunks.into_iter().for_each(|chunk| reach(effect, chunk));
                    }
                    share(&mut known, &mut drafted);
                    lay(&mut over, [&drafted]);
                    merge(&mut bricks, drafted);
                }
                if !fallen.pieces.is_empty() {
                    pieces.insert(all.effects.len() + group.len() - 1, fallen.pieces);
                }
            }
            drafted.into_iter().for_each(|drafted| merge(&mut bricks, drafted));
            all.hash = draft.hash;
            all.effects.append(&mut draft.effects);
        }
        for drafted in bricks.values_mut() {
            // What came last is what it is.
            over.get(&drafted.pos).into_iter().for_each(|brick| drafted.brick = Arc::clone(brick));
        }
        all.bricks = bricks.into_values().collect();
        let kinds = all.bricks.iter().filter_map(|drafted| drafted.brick.uniform());
        let fresh = kinds.filter(|kind| !world.uniform.contains_key(kind));
        all.uniform = fresh.filter_map(|kind| Some((kind, Arc::clone(known.get(&kind)?)))).collect();
        Drafted { draft: all, over, pieces }
    }
}

/// Lays bricks over those that are there.
fn lay<'d>(over: &mut Bricks, drafted: impl IntoIterator<Item = &'d DraftedBrick>) {
    over.extend(drafted.into_iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))));
}

/// Takes in what changed in a brick, beside what did before.
fn merge(bricks: &mut BTreeMap<[i32; 3], DraftedBrick>, drafted: DraftedBrick) {
    match bricks.get_mut(&key(drafted.pos)) {
        Some(own) => {
            own.changed = own.changed.union(drafted.changed);
            own.is_extended |= drafted.is_extended;
        }
        None => drop(bricks.insert(key(drafted.pos), drafted)),
    }
}

/// A brick that is all alike is replaced by the one of its kind.
fn share(known: &mut UniformBricks, drafted: &mut DraftedBrick) {
    if let Some(kind) = drafted.brick.uniform() {
        drafted.brick = Arc::clone(known.entry(kind).or_insert_with(|| Arc::clone(&drafted.brick)));
    }
}

/// Takes in that an edit changed samples of a chunk.
fn reach(effect: &mut EditEffect, part: ChunkEffect) {
    match effect.chunks.binary_search_by_key(&part.chunk, |own| own.chunk) {
        Ok(at) => effect.chunks[at].bounds = effect.chunks[at].bounds.union(part.bounds),
        Err(at) => effect.chunks.insert(at, part),
    }
}
