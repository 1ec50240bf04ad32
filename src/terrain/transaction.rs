//! A transaction: edits in order, from a snapshot to a commit.
//!
//! ```text
//! edits -> bricks, fields, receipts -> mask -> dirty blocks -> parts -> chunk meshes
//!                                         \-> touched tiles -> index lists
//! ```

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use web_time::Instant;

use super::Submission;
use super::receipt::{Applied, ChunkScenario, Receipt, Rejection};
use super::redraw::{self, MeshUpdates};
use super::surface::ChunkSurface;
use super::world::World;
use crate::backend::{Compute, Cpu, Engine};
use crate::brush::Edit;
use crate::lattice::{ChunkPos, LatticeBox, TilePos};
use crate::surface::tile::Rings;
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView};
use crate::volume::{Bricks, Draft, EditEffect, EditWork, FieldId, Fields, Ledger, UniformBricks, reach};

/// Something that happened to a field in a commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldNews {
    /// It is new.
    Created(FieldId),
    /// Its samples or its box changed.
    Changed(FieldId),
    /// It went into another field of its chunk.
    Merged {
        /// The field that is gone.
        gone: FieldId,
        /// The field that holds its data now.
        into: FieldId,
    },
}

/// Edits on their way, with the snapshot that they apply to. A clone gives the same commit; a terrain takes one of them.
#[derive(Clone)]
pub struct Transaction {
    ticket: u64,
    world: Arc<World>,
    submissions: Arc<[Submission]>,
    /// Without one, the processor.
    engine: Option<Engine>,
}

/// The result of a transaction: only what changed.
pub struct Commit {
    ticket: u64,
    bricks: Bricks,
    uniform: UniformBricks,
    mask: Mask,
    fields: BTreeMap<ChunkPos, Fields>,
    sample_hash: u64,
    next_field: u64,
    receipts: Vec<Receipt>,
    news: Vec<(ChunkPos, FieldNews)>,
    surfaces: Vec<(ChunkPos, Arc<ChunkSurface>)>,
    rings: Vec<(TilePos, Arc<Rings>)>,
    /// Meshes to be swapped together with this commit. The world keeps its own.
    pub meshes: MeshUpdates,
    /// Where the time went.
    pub stages: Stages,
}

/// How long the stages of a transaction took. In large ones tiles and chunks are made side by side, so stages may take
/// longer than the whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stages {
    /// Edits, from distances to new bricks.
    pub edit: Duration,
    /// Marching cubes over dirty blocks, and finding these.
    pub meshing: Duration,
    /// Putting parts among those that stay.
    pub assembly: Duration,
    /// The mask, rings and index lists.
    pub ring: Duration,
    /// The whole transaction: the above, fields and receipts.
    pub whole: Duration,
}

impl Stages {
    /// Calls `work`, and adds the time it takes to what `stage` names.
    pub(super) fn time<T>(stage: &mut Duration, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        *stage += start.elapsed();
        result
    }
}

impl Transaction {
    pub(super) fn new(
        ticket: u64,
        world: Arc<World>,
        submissions: Arc<[Submission]>,
        engine: Option<Engine>,
    ) -> Self {
        Self { ticket, world, submissions, engine }
    }

    /// How many edits it holds.
    pub fn len(&self) -> usize {
        self.submissions.len()
    }

    /// Does it hold no edit?
    pub fn is_empty(&self) -> bool {
        self.submissions.is_empty()
    }

    /// Computes the commit on another engine than the terrain's own.
    pub fn run_on(self, engine: &Engine) -> Commit {
        Self { engine: Some(engine.clone()), ..self }.run()
    }

    /// Computes the commit. Runs on any thread; large transactions use the threads of the current rayon pool, and the
    /// result does not depend on how many those are.
    pub fn run(self) -> Commit {
        let (world, start, mut stages) = (&*self.world, Instant::now(), Stages::default());
        let edits: Vec<&Edit> = self.submissions.iter().filter_map(|s| s.edit.as_ref().ok()).collect();
        let backend = self.engine.as_ref().map_or(&Cpu as &dyn Compute, Engine::compute);
        let draft = Stages::time(&mut stages.edit, || {
            let apply = |work: &EditWork, each: &mut dyn FnMut(Ledger)| backend.edit(work, each);
            Draft::make(world.samples(), world.grid, &edits, world.sample_hash, &world.uniform, apply)
        });
        let bricks: Bricks =
            draft.bricks.iter().map(|drafted| (drafted.pos, Arc::clone(&drafted.brick))).collect();
        let samples = world.samples().over(&bricks);

        let before = WorldView { samples, ..world.view() };
        let (mask, dirty) = redraw::disturb(&before, &draft.bricks, &mut stages);
        let view = WorldView { samples, mask: MaskView::new(&world.mask).with(&mask), ..world.view() };
        let meshes = redraw::updates(world, &view, backend, &draft.bricks, dirty, &mask, &mut stages);

        let mut log = FieldLog::new(world);
        let mut effects = draft.effects.into_iter();
        let receipts = self.submissions.iter().map(|submission| {
            let outcome = match &submission.edit {
                Err(error) => Err((*error).into()),
                Ok(edit) => log.enter(edit, effects.next().unwrap_or_default()),
            };
            Receipt { tag: submission.tag, outcome }
        });
        let receipts = receipts.collect();
        let news = log.news();
        stages.whole = start.elapsed();
        Commit {
            ticket: self.ticket,
            bricks,
            uniform: draft.uniform,
            mask,
            sample_hash: draft.hash,
            receipts,
            surfaces: meshes.chunks.clone(),
            rings: meshes.tiles.iter().map(|(tile, update)| (*tile, Arc::clone(&update.rings))).collect(),
            meshes,
            next_field: log.next,
            news,
            stages,
            fields: log.fields,
        }
    }
}

/// The fields that a transaction touches, and what happened to them.
struct FieldLog<'a> {
    world: &'a World,
    fields: BTreeMap<ChunkPos, Fields>,
    merged: Vec<(ChunkPos, FieldNews)>,
    next: u64,
}

impl<'a> FieldLog<'a> {
    fn new(world: &'a World) -> Self {
        Self { world, fields: BTreeMap::new(), merged: Vec::new(), next: world.next_field }
    }

    /// Enters what an edit changed; returns what its receipt says.
    fn enter(&mut self, edit: &Edit, effect: EditEffect) -> Result<Applied, Rejection> {
        if reach(self.world.grid, edit).is_none() {
            return Err(Rejection::OutsideWorld);
        }
        let mut bounds = None;
        let mut chunks = Vec::with_capacity(effect.chunks.len());
        for part in &effect.chunks {
            LatticeBox::include(&mut bounds, part.bounds);
            chunks.push(self.absorb(part.chunk, part.bounds));
        }
        Ok(Applied { chunks, bounds, removed: effect.removed, added: effect.added, painted: effect.painted })
    }

    fn absorb(&mut self, chunk: ChunkPos, bounds: LatticeBox) -> ChunkScenario {
        let committed = self.world.fields.get(&chunk);
        let fields = self.fields.entry(chunk).or_insert_with(|| committed.cloned().unwrap_or_default());
        let absorbed = fields.absorb(bounds, || {
            self.next += 1;
            FieldId(self.next)
        });
        let existed = |id| committed.is_some_and(|fields| fields.get(id).is_some());
        let into = absorbed.field;
        // What went into a field that goes now as well is in the last one.
        let merged = if absorbed.gone.is_empty() { &mut [] } else { self.merged.as_mut_slice() };
        for (_, news) in merged.iter_mut().filter(|(at, _)| *at == chunk) {
            if let FieldNews::Merged { into: earlier, .. } = news
                && absorbed.gone.contains(earlier)
            {
                *earlier = into;
            }
        }
        let gone = absorbed.gone.iter().filter(|&&id| existed(id));
        self.merged.extend(gone.map(|&gone| (chunk, FieldNews::Merged { gone, into })));
        ChunkScenario { chunk, scenario: absorbed.scenario, field: absorbed.field }
    }

    /// One line for each field that differs from the snapshot.
    fn news(&self) -> Vec<(ChunkPos, FieldNews)> {
        let mut news = Vec::new();
        for (&chunk, fields) in &self.fields {
            let committed = self.world.fields.get(&chunk);
            for field in fields.iter() {
                match committed.and_then(|fields| fields.get(field.id)) {
                    None => news.push((chunk, FieldNews::Created(field.id))),
                    Some(before) if before != field => news.push((chunk, FieldNews::Changed(field.id))),
                    Some(_) => {}
                }
            }
        }
        news.extend_from_slice(&self.merged);
        news
    }
}

impl Commit {
    pub(super) fn ticket(&self) -> u64 {
        self.ticket
    }

    /// Hash of every edited sample, once this is committed: equal for equal edits of equal samples, whatever ran them.
    pub fn sample_hash(&self) -> u64 {
        self.sample_hash
    }

    /// What happens to fields when this is committed, by chunk.
    pub fn field_news(&self) -> &[(ChunkPos, FieldNews)] {
        &self.news
    }

    /// Makes this the world.
    pub(super) fn install(self, world: &mut World) -> Vec<Receipt> {
        for &pos in self.bricks.keys() {
            let stack = world.stacks.entry((pos.0.x, pos.0.z)).or_default();
            if let Err(at) = stack.binary_search(&pos.0.y) {
                stack.insert(at, pos.0.y);
            }
        }
        world.bricks.extend(self.bricks);
        world.mask.extend(&self.mask);
        world.fields.extend(self.fields);
        world.uniform.extend(self.uniform);
        for (chunk, surface) in self.surfaces {
            if surface.is_empty() {
                world.surfaces.remove(&chunk);
            } else {
                world.surfaces.insert(chunk, surface);
            }
        }
        world.rings.extend(self.rings);
        world.sample_hash = self.sample_hash;
        world.next_field = self.next_field;
        world.revision += 1;
        self.receipts
    }
}
