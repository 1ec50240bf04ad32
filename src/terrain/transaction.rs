//! A transaction: edits in order, from a snapshot to a commit.
//!
//! ```text
//! edits -> bricks, fields, receipts -> mask -> dirty blocks -> parts -> chunk meshes
//!                                         \-> touched tiles -> index lists
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::IVec3;
use rayon::prelude::*;

use super::Submission;
use super::receipt::{Applied, ChunkScenario, Receipt, Rejection};
use super::world::{ChunkSurface, World};
use crate::brush::Edit;
use crate::lattice::{BrickPos, ChunkPos, Column, LatticeBox, TilePos};
use crate::surface::mask::{cell_sheet, is_disturbed};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView, SurfaceMesh, block, tile};
use crate::volume::{Bricks, Draft, FieldId, Fields};

/// Meshes that a commit puts in place of old ones. An empty one means that nothing is drawn there any more.
#[derive(Clone, Debug, Default)]
pub struct MeshUpdates {
    /// Tiles whose index lists changed.
    pub tiles: Vec<(TilePos, SurfaceMesh)>,
    /// Chunks whose surface changed.
    pub chunks: Vec<(ChunkPos, SurfaceMesh)>,
}

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

/// Edits on their way, with the snapshot that they apply to.
pub struct Transaction {
    ticket: u64,
    world: Arc<World>,
    submissions: Arc<[Submission]>,
}

/// The result of a transaction: only what changed.
pub struct Commit {
    ticket: u64,
    bricks: Bricks,
    mask: Mask,
    fields: BTreeMap<ChunkPos, Fields>,
    surfaces: BTreeMap<ChunkPos, ChunkSurface>,
    sample_hash: u64,
    next_field: u64,
    receipts: Vec<Receipt>,
    news: Vec<(ChunkPos, FieldNews)>,
    /// Meshes to be swapped together with this commit.
    pub meshes: MeshUpdates,
}

/// A block to be meshed: the cells of a brick that lie in a chunk.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Block {
    chunk: ChunkPos,
    /// The brick's position as (y, z, x).
    brick: [i32; 3],
}

/// From how many blocks on meshing is spread over threads; below, handing out costs more than it saves.
const PARALLEL_BLOCKS: usize = 48;

impl Transaction {
    pub(super) fn new(ticket: u64, world: Arc<World>, submissions: Arc<[Submission]>) -> Self {
        Self { ticket, world, submissions }
    }

    /// How many edits it holds.
    pub fn len(&self) -> usize {
        self.submissions.len()
    }

    /// Does it hold no edit?
    pub fn is_empty(&self) -> bool {
        self.submissions.is_empty()
    }

    /// Computes the commit. Runs on any thread; large transactions use the threads of the current rayon pool, and the
    /// result does not depend on how many those are.
    pub fn run(self) -> Commit {
        let world = &*self.world;
        let mut log = FieldLog::new(world);
        let mut draft = Draft::new(world.samples(), world.grid, world.sample_hash);
        let mut receipts = Vec::with_capacity(self.submissions.len());
        for submission in self.submissions.iter() {
            let outcome = match &submission.edit {
                Ok(edit) => apply(&mut draft, &mut log, edit),
                Err(error) => Err((*error).into()),
            };
            receipts.push(Receipt { tag: submission.tag, outcome });
        }
        let sample_hash = draft.hash();
        let (bricks, dirty) = draft.finish();
        let samples = world.samples().over(&bricks);

        let mask = added_cells(&WorldView { samples, ..world.view() }, &dirty);
        let view = WorldView { samples, mask: MaskView::new(&world.mask).with(&mask), ..world.view() };

        let blocks = dirty_blocks(&view, &dirty, &mask);
        let surfaces = mesh_blocks(world, &view, &blocks);
        let chunks = surfaces.iter().map(|(&chunk, surface)| (chunk, surface.mesh())).collect();
        let tiles =
            touched_tiles(&view, &mask).into_iter().map(|tile| (tile, tile::mesh(&view, tile))).collect();
        Commit {
            ticket: self.ticket,
            mask,
            surfaces,
            sample_hash,
            receipts,
            meshes: MeshUpdates { tiles, chunks },
            next_field: log.next,
            news: log.news(),
            fields: log.fields,
            bricks,
        }
    }
}

/// Applies one edit to bricks and fields.
fn apply(draft: &mut Draft, log: &mut FieldLog, edit: &Edit) -> Result<Applied, Rejection> {
    if draft.reach(edit).is_none() {
        return Err(Rejection::OutsideWorld);
    }
    let effect = draft.apply(edit);
    let mut bounds = None;
    let mut chunks = Vec::with_capacity(effect.chunks.len());
    for part in &effect.chunks {
        LatticeBox::include(&mut bounds, part.bounds);
        chunks.push(log.absorb(part.chunk, part.bounds));
    }
    Ok(Applied { chunks, bounds, removed: effect.removed, added: effect.added, painted: effect.painted })
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
        for (_, news) in self.merged.iter_mut().filter(|(at, _)| *at == chunk) {
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

/// Rule 2 for the cells around changed samples. Edited samples stay edited, so cells only ever join the mask.
fn added_cells(view: &WorldView, dirty: &[LatticeBox]) -> Mask {
    let mut added = Mask::default();
    for samples in dirty {
        for z in samples.min.z - 1..=samples.max.z {
            for x in samples.min.x - 1..=samples.max.x {
                let cell = Column::new(x, z);
                if !view.grid.has_cell(cell) || view.mask.contains(cell) || added.contains(cell) {
                    continue;
                }
                let sheet = cell_sheet(view.samples.ground(), cell);
                let may_touch = sheet.start <= samples.max.y && samples.min.y <= sheet.end;
                if may_touch && is_disturbed(&view.samples, cell) {
                    added.insert(cell);
                }
            }
        }
    }
    added
}

/// Every block that may draw something else than before.
fn dirty_blocks(view: &WorldView, dirty: &[LatticeBox], added: &Mask) -> Vec<Block> {
    let mut blocks = BTreeSet::new();
    let mut insert = |low: IVec3, high: IVec3| {
        let world =
            (IVec3::new(0, i32::MIN, 0), IVec3::new(view.grid.width() - 1, i32::MAX, view.grid.depth() - 1));
        let Some(cells) = LatticeBox::new(low.max(world.0), high.min(world.1)) else { return };
        for brick in BrickPos::covering(cells) {
            let Some(cells) = brick.samples().intersection(cells) else { continue };
            for chunk in view.grid.chunks_of(cells) {
                blocks.insert(Block { chunk, brick: [brick.0.y, brick.0.z, brick.0.x] });
            }
        }
    };
    // A sample is a corner of the cells one below it; gradients look one sample further on both sides.
    for samples in dirty {
        insert(samples.min - 2, samples.max + 1);
    }
    // A cell that joins the mask draws its sheet; beside it, vertices leave the mask's border.
    for cell in added.iter() {
        for (dx, dz) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dz| (dx, dz))) {
            let near = cell.offset(dx, dz);
            if view.grid.has_cell(near) && view.mask.contains(near) {
                let sheet = cell_sheet(view.samples.ground(), near);
                insert(near.at(sheet.start), near.at(sheet.end - 1));
            }
        }
    }
    blocks.into_iter().collect()
}

/// Meshes blocks and puts their parts among those of their chunks that stay; leaves out chunks where nothing changed.
fn mesh_blocks(world: &World, view: &WorldView, blocks: &[Block]) -> BTreeMap<ChunkPos, ChunkSurface> {
    let mesh = |block: &Block| {
        let [y, z, x] = block.brick;
        let brick = BrickPos(IVec3::new(x, y, z));
        let cells = brick.samples().intersection(view.grid.chunk_cells(block.chunk));
        let origin = view.grid.origin(block.chunk);
        let part = cells.map(|cells| block::mesh(view, brick, cells, origin)).unwrap_or_default();
        (block.chunk, brick, part)
    };
    let parts: Vec<_> = if blocks.len() < PARALLEL_BLOCKS {
        blocks.iter().map(mesh).collect()
    } else {
        blocks.par_iter().map(mesh).collect()
    };
    let mut surfaces: BTreeMap<ChunkPos, (ChunkSurface, bool)> = BTreeMap::new();
    for (chunk, brick, part) in parts {
        let committed = || world.surfaces.get(&chunk).map(|surface| (**surface).clone()).unwrap_or_default();
        let (surface, changed) = surfaces.entry(chunk).or_insert_with(|| (committed(), false));
        *changed |= surface.replace(brick, part);
    }
    surfaces
        .into_iter()
        .filter(|(_, (_, changed))| *changed)
        .map(|(chunk, (surface, _))| (chunk, surface))
        .collect()
}

/// Tiles that lose a cell to the mask, or border on one that does.
fn touched_tiles(view: &WorldView, added: &Mask) -> BTreeSet<TilePos> {
    let around =
        |cell: Column| [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)].map(|(dx, dz)| cell.offset(dx, dz));
    let cells = added.iter().flat_map(around).filter(|&cell| view.grid.has_cell(cell));
    cells.map(|cell| view.grid.tile_of_cell(cell)).collect()
}

impl Commit {
    pub(super) fn ticket(&self) -> u64 {
        self.ticket
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
        for (chunk, surface) in self.surfaces {
            if surface.is_empty() {
                world.surfaces.remove(&chunk);
            } else {
                world.surfaces.insert(chunk, Arc::new(surface));
            }
        }
        world.sample_hash = self.sample_hash;
        world.next_field = self.next_field;
        world.revision += 1;
        self.receipts
    }
}
