//! Edits applied to copies of bricks, before anything is committed.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::view::resolve;
use super::{Brick, Bricks, Sample, SampleView, Tally};
use crate::brush::{BAND, Edit, Evaluator, Operation};
use crate::ground::MaterialId;
use crate::lattice::{BRICK, BrickPos, ChunkGrid, ChunkPos, LatticeBox, hash};

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
    pub removed: Tally,
    /// Voxels that were air and are solid now, by the material they have.
    pub added: Tally,
    /// Solid voxels that changed their material, by the material they have now.
    pub painted: Tally,
}

/// Bricks in the making: a transaction's edits in order, over the bricks of its snapshot.
pub struct Draft<'a> {
    base: SampleView<'a>,
    grid: ChunkGrid,
    bricks: FxHashMap<BrickPos, BrickDraft>,
    hash: u64,
}

struct BrickDraft {
    brick: Box<Brick>,
    dirty: LatticeBox,
}

impl<'a> Draft<'a> {
    /// Starts from a snapshot whose edited samples have the given [`hash`](Self::hash).
    pub fn new(base: SampleView<'a>, grid: ChunkGrid, hash: u64) -> Self {
        Self { base, grid, bricks: FxHashMap::default(), hash }
    }

    /// The part of an edit's reach that lies in the world; `None` when it lies outside.
    pub fn reach(&self, edit: &Edit) -> Option<LatticeBox> {
        edit.reach().intersection(self.grid.edit_bounds())
    }

    /// Applies one edit. Samples farther than [`BAND`] outside its shape stay as they are (rule 6).
    pub fn apply(&mut self, edit: &Edit) -> EditEffect {
        let mut effect = EditEffect::default();
        let Some(reach) = self.reach(edit) else { return effect };
        let evaluator = edit.evaluator();
        let mut chunks = BTreeMap::new();
        for pos in BrickPos::covering(reach) {
            let Some(samples) = pos.samples().intersection(reach) else { continue };
            if evaluator.is_out_of_reach(samples) {
                continue;
            }
            for chunk in self.grid.chunks_of(samples) {
                let Some(part) = self.grid.chunk_samples(chunk).intersection(samples) else { continue };
                if let Some(changed) =
                    self.apply_to_brick(pos, part, edit.operation(), &evaluator, &mut effect)
                {
                    LatticeBox::include(chunks.entry(chunk).or_default(), changed);
                }
            }
        }
        let with_bounds =
            |(chunk, bounds): (ChunkPos, Option<LatticeBox>)| Some(ChunkEffect { chunk, bounds: bounds? });
        effect.chunks = chunks.into_iter().filter_map(with_bounds).collect();
        effect
    }

    /// Applies an operation to the samples `part` of one brick; returns the box of those that changed.
    fn apply_to_brick(
        &mut self,
        pos: BrickPos,
        part: LatticeBox,
        operation: Operation,
        evaluator: &Evaluator,
        effect: &mut EditEffect,
    ) -> Option<LatticeBox> {
        let base = self.base.brick(pos);
        let mut draft = self.bricks.remove(&pos);
        let mut changed = None;
        let mut row = [0; BRICK as usize];
        let row = &mut row[..part.size().x as usize];
        for y in part.min.y..=part.max.y {
            for z in part.min.z..=part.max.z {
                let start = IVec3::new(part.min.x, y, z);
                evaluator.row(start, row);
                for (x, &outside) in (part.min.x..).zip(row.iter()) {
                    if outside > BAND {
                        continue;
                    }
                    let point = IVec3::new(x, y, z);
                    let brick = draft.as_ref().map_or(base, |draft| Some(&*draft.brick));
                    let old = State::read(brick, point);
                    let Some(new) = self.edited(point, old, operation, outside, effect) else { continue };
                    self.hash = self.hash.wrapping_sub(old.hash(point)).wrapping_add(new.hash(point));
                    let at = LatticeBox::point(point);
                    LatticeBox::include(&mut changed, at);
                    let draft = draft.get_or_insert_with(|| BrickDraft {
                        brick: Box::new(base.cloned().unwrap_or_default()),
                        dirty: at,
                    });
                    draft.dirty = draft.dirty.union(at);
                    draft.brick.set(point, new.sample, new.material);
                }
            }
        }
        if let Some(draft) = draft {
            self.bricks.insert(pos, draft);
        }
        changed
    }

    /// What a sample becomes, `None` when it stays as it is; voxels that change sides are counted.
    fn edited(
        &self,
        point: IVec3,
        old: State,
        operation: Operation,
        outside: i32,
        effect: &mut EditEffect,
    ) -> Option<State> {
        let ground = self.base.ground();
        let stored = old.sample.distance();
        let before = stored.unwrap_or_else(|| ground.distance(point));
        if let Operation::Paint { material } = operation {
            let unchanged = stored.is_some() && material == old.material;
            if outside > 0 || before >= 0 || unchanged {
                return None;
            }
            if resolve(ground, point, material) != resolve(ground, point, old.material) {
                effect.painted.count(resolve(ground, point, material));
            }
            return Some(State { sample: Sample::edited(before), material });
        }
        let after = operation.apply(before, outside);
        let sample = Sample::edited(after);
        if after == before || sample == old.sample {
            return None;
        }
        let mut material = old.material;
        match (before < 0, after < 0) {
            (true, false) => effect.removed.count(resolve(ground, point, material)),
            (false, true) => {
                if let Operation::Add { material: new } = operation {
                    material = new;
                }
                effect.added.count(resolve(ground, point, material));
            }
            _ => {}
        }
        Some(State { sample, material })
    }

    /// Order-independent hash of every edited sample: point, density, material.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// The changed bricks, and per brick the box of its changed samples.
    pub fn finish(self) -> (Bricks, Vec<LatticeBox>) {
        let dirty = self.bricks.values().map(|draft| draft.dirty).collect();
        let shared = |(pos, draft): (BrickPos, BrickDraft)| (pos, Arc::from(draft.brick));
        (self.bricks.into_iter().map(shared).collect(), dirty)
    }
}

/// One sample with its material.
#[derive(Clone, Copy)]
struct State {
    sample: Sample,
    material: MaterialId,
}

impl State {
    fn read(brick: Option<&Brick>, point: IVec3) -> Self {
        match brick {
            Some(brick) => Self { sample: brick.sample(point), material: brick.material(point) },
            None => Self { sample: Sample::PRISTINE, material: MaterialId::GROUND },
        }
    }

    /// A pristine sample adds nothing to the world's hash.
    fn hash(self, point: IVec3) -> u64 {
        let Some(distance) = self.sample.distance() else { return 0 };
        let place = hash::mix(point.x as u32 as u64 | (point.z as u32 as u64) << 32);
        hash::mix(
            place
                ^ (point.y as u32 as u64) << 32
                ^ (distance as u16 as u64) << 8
                ^ u64::from(self.material.0),
        )
    }
}
