//! Edits drafted over a world: all together, or one after the other where each looks for what it cut off.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::loose::{self, LoosePiece, LooseSettings};
use super::world::World;
use crate::backend::Compute;
use crate::brush::{Edit, Operation};
use crate::lattice::BrickPos;
use crate::volume::{
    Bricks, ChunkEffect, Draft, DraftedBrick, EditEffect, EditWork, Ledger, SampleView, TakenOut,
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
    /// What edits make of samples of this hash.
    fn draft(&self, base: SampleView, edits: &[&Edit], hash: u64) -> Draft {
        let apply = |work: &EditWork, each: &mut dyn FnMut(Ledger)| self.backend.edit(work, each);
        Draft::make(base, self.world.grid, edits, hash, &self.world.uniform, apply)
    }

    /// All edits at once: each brick takes all of its edits.
    pub fn together(&self, edits: &[&Edit]) -> Drafted {
        let world = self.world;
        let draft = self.draft(world.samples(), edits, world.sample_hash);
        let over = draft.bricks.iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))).collect();
        Drafted { draft, over, pieces: BTreeMap::new() }
    }

    /// The same world, but each edit that can remove ground comes by itself, and what it cuts off falls before the next.
    pub fn one_by_one(&self, edits: &[&Edit], settings: &LooseSettings) -> Drafted {
        let world = self.world;
        let (mut over, mut pieces) = (Bricks::default(), BTreeMap::new());
        let mut all = Draft { hash: world.sample_hash, ..Draft::default() };
        let mut bricks: BTreeMap<[i32; 3], DraftedBrick> = BTreeMap::new();
        for group in edits.chunk_by(|a, b| !can_remove(a) && !can_remove(b)) {
            let mut draft = self.draft(world.samples().over(&over), group, all.hash);
            // Kinds of uniform bricks are the same for all groups.
            let fresh = std::mem::replace(&mut draft.uniform, std::mem::take(&mut all.uniform));
            for drafted in &mut draft.bricks {
                let known = drafted.brick.uniform().and_then(|kind| draft.uniform.get(&kind));
                known.into_iter().for_each(|brick| drafted.brick = Arc::clone(brick));
            }
            for (kind, brick) in fresh {
                draft.uniform.entry(kind).or_insert(brick);
            }
            let mut drafted = std::mem::take(&mut draft.bricks);
            if group.iter().any(|edit| can_remove(edit)) {
                let seeds = loose::seeds(world, &over, &drafted);
                lay(&mut over, &drafted);
                let fallen = loose::fall(world, &over, &seeds, settings);
                for TakenOut { mut drafted, hash, chunks } in fallen.taken {
                    draft.hash = draft.hash.wrapping_add(hash);
                    if let Some(effect) = draft.effects.last_mut() {
                        chunks.into_iter().for_each(|chunk| reach(effect, chunk));
                    }
                    share(&mut draft, world, &mut drafted);
                    lay(&mut over, [&drafted]);
                    merge(&mut bricks, drafted);
                }
                if !fallen.pieces.is_empty() {
                    pieces.insert(all.effects.len() + group.len() - 1, fallen.pieces);
                }
            } else {
                lay(&mut over, &drafted);
            }
            drafted.drain(..).for_each(|drafted| merge(&mut bricks, drafted));
            (all.hash, all.uniform) = (draft.hash, draft.uniform);
            all.effects.append(&mut draft.effects);
        }
        for (pos, drafted) in &mut bricks {
            debug_assert_eq!(*pos, key(drafted.pos));
            // What came last is what it is.
            over.get(&drafted.pos).into_iter().for_each(|brick| drafted.brick = Arc::clone(brick));
        }
        all.bricks = bricks.into_values().collect();
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
fn share(draft: &mut Draft, world: &World, drafted: &mut DraftedBrick) {
    if let Some(kind) = drafted.brick.uniform() {
        let known = world.uniform.get(&kind).cloned();
        let fresh = || Arc::clone(draft.uniform.entry(kind).or_insert_with(|| Arc::clone(&drafted.brick)));
        drafted.brick = known.unwrap_or_else(fresh);
    }
}

/// Takes in that an edit changed samples of a chunk.
fn reach(effect: &mut EditEffect, part: ChunkEffect) {
    match effect.chunks.binary_search_by_key(&part.chunk, |own| own.chunk) {
        Ok(at) => effect.chunks[at].bounds = effect.chunks[at].bounds.union(part.bounds),
        Err(at) => effect.chunks.insert(at, part),
    }
}
