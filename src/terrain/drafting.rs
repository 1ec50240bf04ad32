//! Edits drafted over a world: all together, or one after the other where each looks for what it cut off.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::loose::{self, LoosePiece, LooseSettings};
use super::world::World;
use crate::backend::Compute;
use crate::brush::{Edit, Operation};
use crate::volume::{Bricks, ChunkEffect, Draft, DraftedBrick, EditEffect, EditWork, TakenOut};

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

impl Drafting<'_> {
    /// All edits at once: each brick takes all of its edits.
    pub fn together(&self, edits: &[&Edit]) -> Drafted {
        let draft = self.draft(&Bricks::default(), edits, self.world.sample_hash);
        let over = draft.bricks.iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))).collect();
        Drafted { draft, over, pieces: BTreeMap::new() }
    }

    /// What edits make of the world with newer bricks over it, which has this hash.
    fn draft(&self, over: &Bricks, edits: &[&Edit], hash: u64) -> Draft {
        let mut draft = Draft::new(edits.len(), hash);
        let work = EditWork::new(self.world.samples().over(over), self.world.grid, edits);
        self.backend.edit(&work, &mut |ledger| draft.add(ledger, &self.world.uniform));
        draft
    }

    /// The same world, but each edit that can remove ground comes by itself, and what it cuts off falls before the next.
    pub fn one_by_one(&self, edits: &[&Edit], settings: &LooseSettings) -> Drafted {
        let world = self.world;
        let (mut over, mut pieces) = (Bricks::default(), BTreeMap::new());
        let mut all = Draft { hash: world.sample_hash, ..Draft::default() };
        let mut bricks: BTreeMap<[i32; 3], DraftedBrick> = BTreeMap::new();
        for group in edits.chunk_by(|a, b| !can_remove(a) && !can_remove(b)) {
            let Draft { bricks: mut drafted, mut effects, hash, .. } = self.draft(&over, group, all.hash);
            all.hash = hash;
            drafted.iter_mut().for_each(|drafted| share(&mut all, world, drafted));
            let is_looked_after = group.iter().any(|edit| can_remove(edit));
            let seeds = is_looked_after.then(|| loose::seeds(world, &over, &drafted));
            lay(&mut over, &drafted);
            if let Some(seeds) = seeds {
                let fallen = loose::fall(world, &over, &seeds, settings);
                for TakenOut { drafted: mut taken, hash, chunks } in fallen.taken {
                    all.hash = all.hash.wrapping_add(hash);
                    if let Some(effect) = effects.last_mut() {
                        chunks.into_iter().for_each(|chunk| reach(effect, chunk));
                    }
                    share(&mut all, world, &mut taken);
                    lay(&mut over, [&taken]);
                    drafted.push(taken);
                }
                if !fallen.pieces.is_empty() {
                    pieces.insert(all.effects.len() + group.len() - 1, fallen.pieces);
                }
            }
            drafted.into_iter().for_each(|drafted| merge(&mut bricks, drafted));
            all.effects.append(&mut effects);
        }
        all.bricks = bricks.into_values().collect();
        Drafted { draft: all, over, pieces }
    }
}

/// Lays bricks over those that are there.
fn lay<'d>(over: &mut Bricks, drafted: impl IntoIterator<Item = &'d DraftedBrick>) {
    over.extend(drafted.into_iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))));
}

/// Takes in what a brick is now, and what changed in it beside what did before.
fn merge(bricks: &mut BTreeMap<[i32; 3], DraftedBrick>, mut drafted: DraftedBrick) {
    let key = [drafted.pos.0.x, drafted.pos.0.z, drafted.pos.0.y];
    if let Some(own) = bricks.get(&key) {
        drafted.changed = drafted.changed.union(own.changed);
        drafted.is_extended |= own.is_extended;
    }
    bricks.insert(key, drafted);
}

/// A brick that is all alike is replaced by the one of its kind.
fn share(all: &mut Draft, world: &World, drafted: &mut DraftedBrick) {
    if let Some(kind) = drafted.brick.uniform() {
        let known = world.uniform.get(&kind).cloned();
        let fresh = || Arc::clone(all.uniform.entry(kind).or_insert_with(|| Arc::clone(&drafted.brick)));
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
