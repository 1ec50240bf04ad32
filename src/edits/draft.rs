//! Edits applied to copies of bricks, before anything is committed.
//!
//! Edits are sorted by the bricks they reach (see `jobs`), a [`backend`](crate::backend) applies them, and here is added up
//! what they changed.
//!
//! Edits that sculpt read what is around a sample, in other bricks too. So they stand in `runs`, one after the other: what
//! an edit of a run reads, no earlier one of the same run changes. No run is so long that its jobs take much memory.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::batches::{EditScope, MOST_BRICKS, runs};
use super::delta::EditDelta;
use super::prepared::{PreparedEdits, is_bound, reach};
use crate::brush::Edit;
use crate::ground::MaterialId;
use crate::lattice::{BrickPos, ChunkGrid, ChunkPos, LatticeBox};
use crate::volume::{
    Brick, Bricks, DiggingRules, MaterialCounts, Refused, Sample, SampleView, UniformBricks, VoxelOutcome,
};

/// What one edit changed in one chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChunkEffect {
    /// The chunk.
    pub chunk: ChunkPos,
    /// Box around the samples that changed, all of them the chunk's own.
    pub bounds: LatticeBox,
}

/// What one edit changed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EditEffect {
    /// Each chunk whose samples changed, in order.
    pub chunks: Vec<ChunkEffect>,
    /// Voxels that were solid and are air now, by the material they had.
    pub removed: MaterialCounts,
    /// Voxels that were air and are solid now, by the material they have.
    pub added: MaterialCounts,
    /// Solid voxels that changed their material, by the material they have now.
    pub painted: MaterialCounts,
    /// Voxels that rules kept from changing.
    pub refused: Refused,
}

impl EditEffect {
    /// Takes in that samples of a chunk changed.
    fn reach(&mut self, chunk: ChunkPos, bounds: LatticeBox) {
        match self.chunks.binary_search_by_key(&chunk, |effect| effect.chunk) {
            Ok(at) => self.chunks[at].bounds = self.chunks[at].bounds.union(bounds),
            Err(at) => self.chunks.insert(at, ChunkEffect { chunk, bounds }),
        }
    }
}

/// A brick that edits changed.
#[derive(Clone, Debug)]
pub struct DraftedBrick {
    /// Which.
    pub pos: BrickPos,
    /// What it holds now.
    pub brick: Arc<Brick>,
    /// Box around the samples that changed.
    pub changed: LatticeBox,
    /// Is a sample among them that had never been edited?
    pub is_extended: bool,
    /// What all samples were edited to, where that is the same.
    pub kind: Option<(Sample, MaterialId)>,
}

impl DraftedBrick {
    /// A brick that changed. Looks at all of its samples, so whoever changed them should call this.
    pub(crate) fn new(pos: BrickPos, brick: Arc<Brick>, changed: LatticeBox, is_extended: bool) -> Self {
        let kind = brick.uniform();
        Self { pos, brick, changed, is_extended, kind }
    }

    /// Takes in that it had changed before.
    pub(crate) fn after(&mut self, earlier: &Self) {
        self.changed = self.changed.union(earlier.changed);
        self.is_extended |= earlier.is_extended;
    }
}

/// What a list of edits makes of a world.
#[derive(Clone, Debug, Default)]
pub struct Draft {
    /// The bricks that changed, by position (x, z, y).
    pub bricks: Vec<DraftedBrick>,
    /// What each edit changed, in order of the edits.
    pub effects: Vec<EditEffect>,
    /// Order-independent hash of every edited sample: point, density, material.
    pub hash: u64,
    /// Kinds of uniform bricks that the world had none of.
    pub uniform: UniformBricks,
}

/// Bricks that some runs have changed.
struct Changes {
    /// What the next run finds in place of older bricks.
    newer: Bricks,
    drafted: FxHashMap<BrickPos, DraftedBrick>,
}

impl Changes {
    fn take(&mut self, bricks: Vec<DraftedBrick>) {
        for mut drafted in bricks {
            self.newer.insert(drafted.pos, Arc::clone(&drafted.brick));
            if let Some(earlier) = self.drafted.get(&drafted.pos) {
                drafted.after(earlier);
            }
            self.drafted.insert(drafted.pos, drafted);
        }
    }

    /// All of them, by position.
    fn bricks(self) -> Vec<DraftedBrick> {
        let mut bricks: Vec<_> = self.drafted.into_values().collect();
        bricks.sort_unstable_by_key(|drafted| (drafted.pos.0.x, drafted.pos.0.z, drafted.pos.0.y));
        bricks
    }
}

/// From how many bricks on threads share what takes little for each.
const PARALLEL: usize = 1 << 13;

/// From how many parts and counts on threads enter them.
const MANY_ENTRIES: usize = 1 << 11;

/// Bricks as a list that a [`SampleView`] can be laid [under](SampleView::under).
pub(crate) fn latest(drafted: &[DraftedBrick]) -> Vec<(BrickPos, &Brick)> {
    if drafted.len() < PARALLEL {
        drafted.iter().map(|drafted| (drafted.pos, &*drafted.brick)).collect()
    } else {
        drafted.par_iter().map(|drafted| (drafted.pos, &*drafted.brick)).collect()
    }
}

/// The numbers of the bricks from `first` on that are all alike.
fn uniform_ones(bricks: &[DraftedBrick], first: usize) -> Vec<usize> {
    let is_uniform = |&(_, drafted): &(usize, &DraftedBrick)| drafted.kind.is_some();
    let number = |(number, _): (usize, &DraftedBrick)| first + number;
    let bricks = &bricks[first..];
    if bricks.len() < PARALLEL {
        bricks.iter().enumerate().filter(is_uniform).map(number).collect()
    } else {
        bricks.par_iter().enumerate().filter(is_uniform).map(number).collect()
    }
}

impl Draft {
    /// What edits make of samples of this hash. Whoever applies them gets them run by run.
    pub(crate) fn make(
        base: SampleView,
        grid: ChunkGrid,
        edits: &[&Edit],
        hash: u64,
        uniform: &UniformBricks,
        rules: Option<&DiggingRules>,
        mut apply: impl FnMut(&PreparedEdits, &mut dyn FnMut(&mut [EditDelta])),
    ) -> Self {
        let scope = |edit: &&Edit| {
            let reach = reach(grid, edit);
            EditScope { reach, is_bound: is_bound(rules, reach, edit.power()) }
        };
        let scopes: Vec<EditScope> = edits.iter().map(scope).collect();
        let runs = runs(edits, &scopes, MOST_BRICKS);
        Self::of_runs(base, edits.len(), &runs, hash, uniform, |base, run, each| {
            let bound = scopes[run.clone()].iter().map(|scope| scope.is_bound);
            apply(&PreparedEdits::new(base, grid, &edits[run.clone()]).bound(rules, bound), each);
        })
    }

    /// What so many edits make of samples of this hash, in these runs.
    fn of_runs(
        base: SampleView,
        edits: usize,
        runs: &[Range<usize>],
        hash: u64,
        uniform: &UniformBricks,
        mut apply: impl FnMut(SampleView, &Range<usize>, &mut dyn FnMut(&mut [EditDelta])),
    ) -> Self {
        let mut draft = Self { hash, ..Self::default() };
        draft.effects.resize_with(edits, EditEffect::default);
        let mut add = |draft: &mut Self, base: SampleView, run: &Range<usize>| {
            apply(base, run, &mut |ledgers| draft.add(ledgers, run, uniform));
        };
        if let [] | [_] = runs {
            runs.iter().for_each(|run| add(&mut draft, base, run));
            return draft;
        }
        // Each run sees what those before it changed, and what others did before all of them.
        let mut changes =
            Changes { newer: base.newer().cloned().unwrap_or_default(), drafted: FxHashMap::default() };
        for run in runs {
            add(&mut draft, base.over(&changes.newer), run);
            changes.take(std::mem::take(&mut draft.bricks));
        }
        draft.bricks = changes.bricks();
        // Kinds that came and went.
        let kinds: FxHashSet<_> = draft.bricks.iter().filter_map(|drafted| drafted.kind).collect();
        draft.uniform.retain(|kind, _| kinds.contains(kind));
        draft
    }

    /// Takes in what these edits did to some bricks; one that is all alike is replaced by the one of its kind.
    fn add(&mut self, ledgers: &mut [EditDelta], edits: &Range<usize>, uniform: &UniformBricks) {
        let (effects, before) = (&mut self.effects[edits.clone()], self.bricks.len());
        enter_effects(ledgers, effects);
        for ledger in ledgers {
            self.hash = self.hash.wrapping_add(ledger.hash);
            effects.iter_mut().zip(ledger.effects.drain(..)).for_each(|(effect, own)| *effect = own);
            if self.bricks.is_empty() {
                self.bricks = std::mem::take(&mut ledger.bricks);
            } else {
                self.bricks.append(&mut ledger.bricks);
            }
        }
        let mut latest: Option<((Sample, MaterialId), Arc<Brick>)> = None;
        for number in uniform_ones(&self.bricks, before) {
            let drafted = &mut self.bricks[number];
            let Some(kind) = drafted.kind else { continue };
            // Bricks beside each other are mostly of one kind.
            let known = match latest.take_if(|(own, _)| *own == kind) {
                Some((_, known)) => known,
                None => {
                    let fresh =
                        || Arc::clone(self.uniform.entry(kind).or_insert_with(|| Arc::clone(&drafted.brick)));
                    uniform.get(&kind).cloned().unwrap_or_else(fresh)
                }
            };
            if !Arc::ptr_eq(&known, &drafted.brick) {
                drafted.brick = Arc::clone(&known);
            }
            latest = Some((kind, known));
        }
    }
}

/// Enters what ledgers say of edits.
pub(crate) fn enter_effects(ledgers: &[EditDelta], effects: &mut [EditEffect]) {
    let entries: usize = ledgers.iter().map(|ledger| ledger.parts.len() + ledger.counts.len()).sum();
    if entries < MANY_ENTRIES {
        return ledgers.iter().for_each(|ledger| enter_some(ledger, 0, effects));
    }
    // Each thread enters what some of the edits did.
    let length = effects.len().div_ceil(rayon::current_num_threads()).max(1);
    effects.par_chunks_mut(length).enumerate().for_each(|(number, effects)| {
        ledgers.iter().for_each(|ledger| enter_some(ledger, number * length, effects));
    });
}

/// Enters what a ledger says of edits, if it is of these; `first` is the number of the first of them.
fn enter_some(ledger: &EditDelta, first: usize, effects: &mut [EditEffect]) {
    for part in &ledger.parts {
        let own = part.edit.checked_sub(first).and_then(|number| effects.get_mut(number));
        if let Some(effect) = own {
            effect.reach(part.chunk, part.bounds);
        }
    }
    for count in &ledger.counts {
        let own = count.edit.checked_sub(first).and_then(|number| effects.get_mut(number));
        let Some(effect) = own else { continue };
        let tally = match count.outcome {
            VoxelOutcome::Removed => &mut effect.removed,
            VoxelOutcome::Added => &mut effect.added,
            VoxelOutcome::Painted => &mut effect.painted,
            VoxelOutcome::Protected => &mut effect.refused.protected,
            VoxelOutcome::Unbreakable => &mut effect.refused.unbreakable,
            VoxelOutcome::TooHard => &mut effect.refused.too_hard,
            VoxelOutcome::Slowed => &mut effect.refused.slowed,
        };
        tally.count_many(count.material, count.voxels);
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::{IVec3, Vec3};

    use super::super::delta::PartEffect;
    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;

    /// Balls around the surface, and one far below and one far above, in which bricks are all alike.
    fn balls(count: usize) -> Vec<Edit> {
        let mut rng = Rng::with_seed(5);
        let ball = |x, y, z, radius| Shape::sphere(Vec3::new(x, y, z), radius);
        let near = |number: usize| {
            let radius = [3.0, 6.0, 16.0][number % 3];
            let shape = ball(rng.f32() * 80.0, rng.f32() * 40.0, rng.f32() * 70.0, radius);
            let material = MaterialId(rng.u8(..4));
            match rng.u32(..4) {
                0 => Brush::paint(shape, material),
                1 => Brush::add(shape, material),
                _ => Brush::dig(shape),
            }
        };
        let mut brushes: Vec<Brush> = (0..count).map(near).collect();
        brushes.push(Brush::dig(ball(40.0, -40.0, 35.0, 16.0)));
        brushes.push(Brush::add(ball(20.0, 80.0, 20.0, 16.0), MaterialId(2)));
        brushes.iter().map(|brush| Edit::quantize(brush).unwrap()).collect()
    }

    #[test]
    fn what_threads_enter_is_what_one_does() {
        let mut rng = Rng::with_seed(3);
        let fates = [
            VoxelOutcome::Removed,
            VoxelOutcome::Added,
            VoxelOutcome::Painted,
            VoxelOutcome::Protected,
            VoxelOutcome::Slowed,
            VoxelOutcome::TooHard,
        ];
        for edits in [1, 37] {
            let mut ledger = || {
                let mut ledger = EditDelta::default();
                for _ in 0..MANY_ENTRIES / 3 {
                    let point = IVec3::new(rng.i32(-90..90), rng.i32(-9..9), rng.i32(-90..90));
                    ledger.parts.push(PartEffect {
                        edit: rng.usize(..edits),
                        chunk: ChunkPos::from_ivec3(IVec3::new(rng.i32(..4), 0, rng.i32(..3))),
                        bounds: LatticeBox::point(point),
                    });
                    let (edit, fate) = (rng.usize(..edits), fates[rng.usize(..fates.len())]);
                    ledger.counts(edit).add(fate, MaterialId(rng.u8(..5)), rng.u64(1..9));
                }
                ledger
            };
            let ledgers = [ledger(), ledger(), ledger()];
            let [mut expected, mut found] = [(); 2].map(|()| vec![EditEffect::default(); edits]);
            ledgers.iter().for_each(|ledger| enter_some(ledger, 0, &mut expected));
            enter_effects(&ledgers, &mut found);
            assert!(expected == found && expected.iter().all(|effect| effect.chunks.len() > 3));
        }
    }

    #[test]
    fn plain_edits_come_to_the_same_in_runs_of_any_length() {
        let ground = Ground::from_fn(80, 70, |x, z| 20.0 + f64::from(x * 7 % 5 + z * 3 % 4)).unwrap();
        let (grid, bricks, edits) = (ChunkGrid::new(25, 80, 70), Bricks::default(), balls(40));
        let edits: Vec<&Edit> = edits.iter().collect();
        let draft = |length: usize| {
            let begins = (0..edits.len()).step_by(length);
            let runs: Vec<_> = begins.map(|from| from..(from + length).min(edits.len())).collect();
            let (base, none) = (SampleView::new(&ground, &bricks), UniformBricks::default());
            Draft::of_runs(base, edits.len(), &runs, 7, &none, |base, run, each| {
                PreparedEdits::new(base, grid, &edits[run.clone()]).run(each);
            })
        };
        let bricks_of = |draft: &Draft| {
            let brick = |own: &DraftedBrick| {
                let samples: Vec<_> = own.brick.edited_samples(own.pos).collect();
                (own.pos, own.changed, own.is_extended, own.kind, *own.brick.solid(), samples)
            };
            draft.bricks.iter().map(brick).collect::<Vec<_>>()
        };
        let kinds = |draft: &Draft| draft.uniform.keys().copied().collect::<FxHashSet<_>>();
        let whole = draft(edits.len());
        assert!(kinds(&whole).len() > 1, "bricks that are all alike");
        for length in [1, 3, 39] {
            let cut = draft(length);
            assert_eq!((cut.hash, &cut.effects), (whole.hash, &whole.effects), "runs of {length}");
            assert!(bricks_of(&cut) == bricks_of(&whole), "bricks in runs of {length}");
            assert_eq!(kinds(&cut), kinds(&whole), "runs of {length}");
        }
    }
}
