//! Edits drafted over a world: all together, or one after the other where each looks for what it cut off.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::loose::{self, LoosePiece, LooseSettings, Lowest};
use super::world::World;
use crate::backend::Compute;
use crate::brush::{Edit, Operation};
use crate::volume::{
    Bricks, ChunkEffect, DiggingRules, Draft, DraftedBrick, EditEffect, EditWork, Ledger, SampleView,
    TakenOut, UniformBricks,
};

/// Who drafts, over what.
pub(super) struct Drafting<'a> {
    pub world: &'a World,
    /// What edits may do; `None`: everything.
    pub rules: Option<&'a DiggingRules>,
    pub backend: &'a dyn Compute,
}

/// What edits make of a world.
pub(super) struct Drafted {
    pub draft: Draft,
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
        let world = self.world;
        let draft = self.draft(world.samples(), edits, world.sample_hash, &world.uniform);
        Drafted { draft, pieces: BTreeMap::new() }
    }

    /// What edits make of samples of this hash; bricks of a `known` kind are shared.
    fn draft(&self, base: SampleView, edits: &[&Edit], hash: u64, known: &UniformBricks) -> Draft {
        let apply = |work: &EditWork, each: &mut dyn FnMut(&mut [Ledger])| self.backend.edit(work, each);
        Draft::make(base, self.world.grid, edits, hash, known, self.rules, apply)
    }

    /// The same world, but each edit that can remove ground comes by itself, and what it cuts off falls before the next.
    pub fn one_by_one(&self, edits: &[&Edit], settings: &LooseSettings) -> Drafted {
        let world = self.world;
        let (mut over, mut lowest, mut pieces) = (Bricks::default(), Lowest::default(), BTreeMap::new());
        let mut all = Draft { hash: world.sample_hash, ..Draft::default() };
        let mut bricks: BTreeMap<[i32; 3], DraftedBrick> = BTreeMap::new();
        let mut known = world.uniform.clone();
        // Where one reads what another one left, `Draft::make` sees to it.
        let is_free = |edit: &Edit| !can_remove(edit);
        for group in edits.chunk_by(|a, b| is_free(a) && is_free(b)) {
            let base = world.samples().over(&over);
            let Draft { bricks: mut drafted, mut effects, hash, uniform } =
                self.draft(base, group, all.hash, &known);
            all.hash = hash;
            known.extend(uniform);
            let is_looked_after = group.iter().any(|edit| can_remove(edit));
            let seeds = is_looked_after.then(|| loose::seeds(world, &over, &drafted));
            lay(&mut over, &mut lowest, &drafted);
            if let Some(seeds) = seeds {
                let fallen = loose::fall(world, self.rules, &over, &lowest, &seeds, settings);
                for TakenOut { drafted: mut taken, hash, chunks } in fallen.taken {
                    all.hash = all.hash.wrapping_add(hash);
                    if let Some(effect) = effects.last_mut() {
                        chunks.into_iter().for_each(|chunk| reach(effect, chunk));
                    }
                    share(&mut known, &mut taken);
                    lay(&mut over, &mut lowest, [&taken]);
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
        let kinds = all.bricks.iter().filter_map(|drafted| drafted.kind);
        let fresh = kinds.filter(|kind| !world.uniform.contains_key(kind));
        all.uniform = fresh.filter_map(|kind| Some((kind, Arc::clone(known.get(&kind)?)))).collect();
        Drafted { draft: all, pieces }
    }
}

/// Lays bricks over those that are there.
fn lay<'d>(over: &mut Bricks, lowest: &mut Lowest, drafted: impl IntoIterator<Item = &'d DraftedBrick>) {
    for DraftedBrick { pos, brick, .. } in drafted {
        over.insert(*pos, Arc::clone(brick));
        let lowest = lowest.entry((pos.0.x, pos.0.z)).or_insert(pos.0.y);
        *lowest = pos.0.y.min(*lowest);
    }
}

/// Takes in what a brick is now, and what changed in it beside what did before.
fn merge(bricks: &mut BTreeMap<[i32; 3], DraftedBrick>, mut drafted: DraftedBrick) {
    let key = [drafted.pos.0.x, drafted.pos.0.z, drafted.pos.0.y];
    if let Some(own) = bricks.get(&key) {
        drafted.after(own);
    }
    bricks.insert(key, drafted);
}

/// A brick that is all alike is replaced by the one of its kind.
fn share(known: &mut UniformBricks, drafted: &mut DraftedBrick) {
    if let Some(kind) = drafted.kind {
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
