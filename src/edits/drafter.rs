//! Edits of a transaction drafted as new bricks, before anything is committed.
//!
//! Edits are split into batches, a [`backend`](crate::backend) applies each batch, and their changes are summed here.

use std::borrow::Cow;
use std::sync::Arc;

use super::batches::{MAX_BRICKS, batches};
use super::delta::{EditDelta, enter_effects};
use super::effect::{DraftedBrick, EditEffect, MergedBricks, Overlay};
use super::paste::paste;
use super::prepared::PreparedEdits;
use super::prepared_edit::PreparedEdit;
use crate::brush::Edit;
use crate::lattice::{BrickPos, ChunkGrid, ItemCost, parallel_map};
use crate::volume::{Brick, DiggingRules, SampleView, UniformBricks};

/// The result of a list of edits on a world.
#[derive(Debug, Default)]
pub(crate) struct Draft {
    /// The bricks that changed, in order.
    pub bricks: Vec<DraftedBrick>,
    /// The effect of each edit, in order of the edits.
    pub effects: Vec<EditEffect>,
    /// Order-independent hash of every edited sample: point, density, material.
    pub hash: u64,
}

/// Applies prepared edits and passes on their changes.
pub(crate) type Apply<'a> = dyn Fn(&PreparedEdits, &mut dyn FnMut(&mut [EditDelta])) + 'a;

/// Drafts edits over a world and over its own earlier drafts.
pub(crate) struct Drafter<'a> {
    world: SampleView<'a>,
    grid: ChunkGrid,
    apply: &'a Apply<'a>,
    /// All bricks drafted up to now.
    pub overlay: Overlay,
    /// Hash of all samples.
    pub hash: u64,
    /// The pool of uniform bricks.
    uniform: Cow<'a, UniformBricks>,
}

impl<'a> Drafter<'a> {
    /// Over a world with this hash of all samples and this pool of uniform bricks.
    pub fn new(
        world: SampleView<'a>,
        grid: ChunkGrid,
        hash: u64,
        uniform: &'a UniformBricks,
        apply: &'a Apply<'a>,
    ) -> Self {
        Self { world, grid, apply, overlay: Overlay::default(), hash, uniform: Cow::Borrowed(uniform) }
    }

    /// The samples with all drafts up to now.
    pub fn samples(&self) -> SampleView<'_> {
        self.overlay.over(self.world)
    }

    /// Applies edits to the current samples. [Lay](Overlay::lay) the draft's bricks over these before the
    /// next draft.
    pub fn draft(&mut self, edits: &[&Edit], rules: Option<&DiggingRules>) -> Draft {
        // A paste is a transaction of its own.
        if let [edit] = edits
            && let Some(source) = edit.paste_source()
        {
            let mut deltas = paste(self.samples(), self.grid, edit, &source, rules);
            let mut draft = Draft { effects: vec![EditEffect::default()], ..Draft::default() };
            add(&mut draft, 0, 1, &mut deltas, &mut self.hash, &mut self.uniform);
            return Draft { hash: self.hash, ..draft };
        }
        let edits: Vec<PreparedEdit> =
            edits.iter().map(|edit| PreparedEdit::new(self.grid, edit, rules)).collect();
        let lengths: Vec<usize> = batches(&edits, MAX_BRICKS).into_iter().map(|batch| batch.len()).collect();
        self.draft_batches(edits, &lengths, rules)
    }

    /// Like [`Self::draft`], with edits in batches of these lengths.
    fn draft_batches(
        &mut self,
        edits: Vec<PreparedEdit>,
        lengths: &[usize],
        rules: Option<&DiggingRules>,
    ) -> Draft {
        let mut draft = Draft { effects: vec![EditEffect::default(); edits.len()], ..Draft::default() };
        let (mut edits, mut first) = (edits.into_iter(), 0);
        let mut earlier = MergedBricks::default();
        for &length in lengths {
            if first > 0 {
                self.overlay.lay(&draft.bricks);
                earlier.add(std::mem::take(&mut draft.bricks));
            }
            let batch: Vec<PreparedEdit> = edits.by_ref().take(length).collect();
            let work = PreparedEdits::of(self.overlay.over(self.world), self.grid, batch, rules);
            let (hash, uniform, end) = (&mut self.hash, &mut self.uniform, first + length);
            (self.apply)(&work, &mut |deltas| add(&mut draft, first, end, deltas, hash, uniform));
            first = end;
        }
        if lengths.len() > 1 {
            earlier.add(draft.bricks);
            draft.bricks = earlier.into_list();
        }
        draft.hash = self.hash;
        draft
    }

    /// Adds further changes of a draft's edits to the draft, and lays them over the current samples.
    pub fn extend(&mut self, draft: &mut Draft, delta: EditDelta) {
        let (edits, before) = (draft.effects.len(), draft.bricks.len());
        add(draft, 0, edits, &mut [delta], &mut self.hash, &mut self.uniform);
        draft.hash = self.hash;
        self.overlay.lay(&draft.bricks[before..]);
    }

    /// The pool of uniform bricks, if it has grown.
    pub fn into_uniform(self) -> Option<UniformBricks> {
        match self.uniform {
            Cow::Borrowed(_) => None,
            Cow::Owned(uniform) => Some(uniform),
        }
    }
}

/// Adds what the edits from `first` to `end` did to some bricks. Uniform bricks are replaced by the pool's.
fn add(
    draft: &mut Draft,
    first: usize,
    end: usize,
    deltas: &mut [EditDelta],
    hash: &mut u64,
    uniform: &mut Cow<UniformBricks>,
) {
    let (effects, before) = (&mut draft.effects[first..end], draft.bricks.len());
    enter_effects(deltas, effects);
    for delta in deltas {
        *hash = hash.wrapping_add(delta.hash);
        effects.iter_mut().zip(delta.effects.drain(..)).for_each(|(effect, own)| *effect = own);
        if draft.bricks.is_empty() {
            draft.bricks = std::mem::take(&mut delta.bricks);
        } else {
            draft.bricks.append(&mut delta.bricks);
        }
    }
    for drafted in &mut draft.bricks[before..] {
        let Some(kind) = drafted.kind else { continue };
        match uniform.get(&kind) {
            Some(own) if Arc::ptr_eq(own, &drafted.brick) => {}
            Some(own) => drafted.brick = Arc::clone(own),
            None => drop(uniform.to_mut().insert(kind, Arc::clone(&drafted.brick))),
        }
    }
}

/// Bricks as a list that a [`SampleView`] can be laid [under](SampleView::under).
pub(crate) fn latest(drafted: &[DraftedBrick]) -> Vec<(BrickPos, &Brick)> {
    parallel_map(drafted, ItemCost::Copy, |drafted| (drafted.pos, &*drafted.brick))
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use fastrand::Rng;
    use glam::{IVec3, Vec3};
    use rustc_hash::FxHashSet;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, MaterialId};
    use crate::lattice::LatticeBox;
    use crate::volume::Bricks;

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
    fn plain_edits_have_equal_results_in_batches_of_any_length() {
        let ground = Ground::from_fn(80, 70, |x, z| 20.0 + f64::from(x * 7 % 5 + z * 3 % 4)).unwrap();
        let (grid, bricks, edits) = (ChunkGrid::new(25, 80, 70), Bricks::default(), balls(40));
        let draft = |length: usize| {
            let none = UniformBricks::default();
            let apply = |work: &PreparedEdits, each: &mut dyn FnMut(&mut [EditDelta])| work.run(each);
            let mut drafter = Drafter::new(SampleView::new(&ground, &bricks), grid, 7, &none, &apply);
            let begins = (0..edits.len()).step_by(length);
            let lengths: Vec<_> = begins.map(|from| length.min(edits.len() - from)).collect();
            let edits = edits.iter().map(|edit| PreparedEdit::new(grid, edit, None)).collect();
            let draft = drafter.draft_batches(edits, &lengths, None);
            let uniform = drafter.into_uniform().unwrap_or_default();
            for drafted in draft.bricks.iter().filter(|drafted| drafted.kind.is_some()) {
                let own = drafted.kind.and_then(|kind| uniform.get(&kind)).expect("a brick of this kind");
                assert!(Arc::ptr_eq(own, &drafted.brick), "uniform bricks are shared");
            }
            draft
        };
        let bricks_of = |draft: &Draft| {
            let brick = |own: &DraftedBrick| {
                let samples: Vec<_> = own.brick.edited_samples(own.pos).collect();
                (own.pos, own.changed, own.is_extended, own.kind, *own.brick.solid(), samples)
            };
            draft.bricks.iter().map(brick).collect::<Vec<_>>()
        };
        let whole = draft(edits.len());
        let kinds: FxHashSet<_> = whole.bricks.iter().filter_map(|drafted| drafted.kind).collect();
        assert!(kinds.len() > 1, "uniform bricks");
        for length in [1, 3, 39] {
            let cut = draft(length);
            assert_eq!((cut.hash, &cut.effects), (whole.hash, &whole.effects), "batches of {length}");
            assert!(bricks_of(&cut) == bricks_of(&whole), "bricks in batches of {length}");
        }
    }

    #[test]
    fn edits_that_no_rule_restricts_are_plain_and_share_a_batch() {
        let ground = Ground::flat(200, 60, 0.0).unwrap();
        let (grid, bricks, uniform) =
            (ChunkGrid::new(32, 200, 60), Bricks::default(), UniformBricks::default());
        let dig = |x| Edit::quantize(&Brush::dig(Shape::sphere(Vec3::new(x, 0.0, 30.0), 4.0))).unwrap();
        let batches = |edits: &[Edit], rules: DiggingRules| {
            let batches = RefCell::new(Vec::new());
            let note = |work: &PreparedEdits, _: &mut dyn FnMut(&mut [EditDelta])| {
                let is_plain = !work.edits.iter().any(PreparedEdit::looks_around);
                batches.borrow_mut().push((work.edits.len(), is_plain));
            };
            let view = SampleView::new(&ground, &bricks);
            let edits: Vec<&Edit> = edits.iter().collect();
            Drafter::new(view, grid, 0, &uniform, &note).draft(&edits, Some(&rules));
            batches.take()
        };
        let (none, at) = (DiggingRules::default, |x| LatticeBox::point(IVec3::new(x, 0, 30)));
        let edits = [dig(20.0), dig(22.0), dig(120.0)];
        assert_eq!(batches(&edits, none().with_protected(at(60)).with_bedrock(-90)), [(3, true)]);
        assert_eq!(batches(&edits, none().with_protected(at(120))), [(3, false)]);
        assert_eq!(batches(&edits, none().with_protected(at(22))), [(1, false), (2, false)]);
    }
}
