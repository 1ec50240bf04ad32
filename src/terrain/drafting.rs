//! Edits drafted over a world: all together, or one after the other where each looks for what it cut off.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::loose::{self, LoosePiece, LooseSettings, Lowest};
use super::queue::Submission;
use super::world::World;
use crate::backend::Compute;
use crate::brush::{Edit, Operation};
use crate::edits::{ChunkEffect, Draft, DraftedBrick, EditDelta, EditEffect, PreparedEdits, TakenOut};
use crate::ground::MaterialId;
use crate::volume::{Brick, Bricks, DiggingRules, Sample, SampleView, UniformBricks};

/// Who drafts, over what: a world, and what was drafted over it so far.
pub(super) struct Drafting<'a> {
    world: &'a World,
    backend: &'a dyn Compute,
    /// Bricks drafted so far, and the lowest of each stack.
    over: Bricks,
    lowest: Lowest,
    /// Hash of all samples.
    hash: u64,
    /// Kinds of uniform bricks; `None`: those of the world.
    known: Option<UniformBricks>,
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

impl<'a> Drafting<'a> {
    pub fn new(world: &'a World, backend: &'a dyn Compute) -> Self {
        let (over, lowest) = (Bricks::default(), Lowest::default());
        Self { world, backend, over, lowest, hash: world.sample_hash, known: None }
    }

    /// The samples as they are so far.
    pub fn samples(&self) -> SampleView<'_> {
        let samples = self.world.samples();
        if self.over.is_empty() { samples } else { samples.over(&self.over) }
    }

    /// What a group of edits makes of the samples so far. What it comes to is [laid](Self::lay) over them before the next.
    pub fn draft(&mut self, group: &[Submission]) -> Drafted {
        let edits: Vec<&Edit> = group.iter().filter_map(|submission| submission.edit.as_ref().ok()).collect();
        let terms = group.first().map(|first| &first.terms);
        let rules = terms.and_then(|terms| terms.rules.as_deref());
        let drafted = match terms.and_then(|terms| terms.loose.as_ref()) {
            Some(settings) => self.one_by_one(&edits, rules, settings),
            None => Drafted { draft: self.together(&edits, rules), pieces: BTreeMap::new() },
        };
        self.hash = drafted.draft.hash;
        drafted
    }

    /// Takes in what was drafted, for more edits to come.
    pub fn lay(&mut self, draft: &Draft) {
        lay(&mut self.over, &mut self.lowest, &draft.bricks);
        self.learn(draft.uniform.iter().map(|(&kind, brick)| (kind, Arc::clone(brick))));
    }

    /// All edits at once: each brick takes all of its edits.
    fn together(&self, edits: &[&Edit], rules: Option<&DiggingRules>) -> Draft {
        let apply =
            |work: &PreparedEdits, each: &mut dyn FnMut(&mut [EditDelta])| self.backend.edit(work, each);
        let known = self.known.as_ref().unwrap_or(&self.world.uniform);
        Draft::make(self.samples(), self.world.grid, edits, self.hash, known, rules, apply)
    }

    fn learn(&mut self, kinds: impl IntoIterator<Item = ((Sample, MaterialId), Arc<Brick>)>) {
        let known = self.known.get_or_insert_with(|| self.world.uniform.clone());
        known.extend(kinds);
    }

    /// The same world, but each edit that can remove ground comes by itself, and what it cuts off falls before the next.
    fn one_by_one(
        &mut self,
        edits: &[&Edit],
        rules: Option<&DiggingRules>,
        settings: &LooseSettings,
    ) -> Drafted {
        let world = self.world;
        let mut pieces = BTreeMap::new();
        let mut all = Draft { hash: self.hash, ..Draft::default() };
        let mut bricks: BTreeMap<[i32; 3], DraftedBrick> = BTreeMap::new();
        // Where one reads what another one left, `Draft::make` sees to it.
        let is_free = |edit: &Edit| !can_remove(edit);
        for group in edits.chunk_by(|a, b| is_free(a) && is_free(b)) {
            let Draft { bricks: mut drafted, mut effects, hash, uniform } = self.together(group, rules);
            self.hash = hash;
            self.learn(uniform);
            let is_looked_after = group.iter().any(|edit| can_remove(edit));
            let seeds = is_looked_after.then(|| loose::seeds(world, &self.over, &drafted));
            lay(&mut self.over, &mut self.lowest, &drafted);
            if let Some(seeds) = seeds {
                let fallen = loose::fall(world, rules, &self.over, &self.lowest, &seeds, settings);
                for TakenOut { drafted: mut taken, hash, chunks } in fallen.taken {
                    self.hash = self.hash.wrapping_add(hash);
                    if let Some(effect) = effects.last_mut() {
                        chunks.into_iter().for_each(|chunk| reach(effect, chunk));
                    }
                    self.share(&mut taken);
                    lay(&mut self.over, &mut self.lowest, [&taken]);
                    drafted.push(taken);
                }
                if !fallen.pieces.is_empty() {
                    pieces.insert(all.effects.len() + group.len() - 1, fallen.pieces);
                }
            }
            drafted.into_iter().for_each(|drafted| merge(&mut bricks, drafted));
            all.effects.append(&mut effects);
        }
        all.hash = self.hash;
        all.bricks = bricks.into_values().collect();
        let kinds = all.bricks.iter().filter_map(|drafted| drafted.kind);
        let fresh = kinds.filter(|kind| !world.uniform.contains_key(kind));
        let known = self.known.as_ref().unwrap_or(&world.uniform);
        all.uniform = fresh.filter_map(|kind| Some((kind, Arc::clone(known.get(&kind)?)))).collect();
        Drafted { draft: all, pieces }
    }

    /// A brick that is all alike is replaced by the one of its kind.
    fn share(&mut self, drafted: &mut DraftedBrick) {
        if let Some(kind) = drafted.kind {
            let known = self.known.get_or_insert_with(|| self.world.uniform.clone());
            drafted.brick = Arc::clone(known.entry(kind).or_insert_with(|| Arc::clone(&drafted.brick)));
        }
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
pub(super) fn merge(bricks: &mut BTreeMap<[i32; 3], DraftedBrick>, mut drafted: DraftedBrick) {
    let key = [drafted.pos.0.x, drafted.pos.0.z, drafted.pos.0.y];
    if let Some(own) = bricks.get(&key) {
        drafted.after(own);
    }
    bricks.insert(key, drafted);
}

/// Takes in that an edit changed samples of a chunk.
fn reach(effect: &mut EditEffect, part: ChunkEffect) {
    match effect.chunks.binary_search_by_key(&part.chunk, |own| own.chunk) {
        Ok(at) => effect.chunks[at].bounds = effect.chunks[at].bounds.union(part.bounds),
        Err(at) => effect.chunks.insert(at, part),
    }
}
