//! The background task of a terrain: it runs a transaction, and builds the surfaces that the next commit shows.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use bevy::platform::collections::HashSet;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::collect::{pieces, pieces_again};
use crate::backend::Engine;
use crate::lattice::TilePos;
use crate::lod::Node;
use crate::plugin::LoosePieceFound;
use crate::plugin::figures::TaskTimes;
use crate::plugin::meshes::{BuiltNode, BuiltSurface, SurfaceBuilder};
use crate::redraw::{relit_nodes, relit_parts};
use crate::terrain::{
    Commit, MeshKey, MeshUpdates, OrderKind, PendingDisplay, Receipt, SurfaceDraft, Terrain, Transaction,
    World,
};
use crate::threads::{ThreadTask, Threads};
use crate::world::sky::{LitWorld, REACH};

/// Meshes of large results that are passed to the renderer in a frame, before all of them are shown in one. A result
/// with no more meshes is shown at once.
pub(super) const UPLOADS_PER_FRAME: usize = 64;

/// The running task of a terrain.
#[derive(Component)]
pub(in crate::plugin) struct InFlight {
    /// Counts tasks over all terrains.
    pub number: u64,
    /// The ticket of the transaction; `None` for changes that the game made itself.
    pub ticket: Option<u64>,
    task: ThreadTask<TaskOutput>,
    /// The result once the task is done.
    pub done: Option<Result<TaskOutput, TaskPanicked>>,
}

/// A task panicked; the panic's message has been printed.
pub(in crate::plugin) struct TaskPanicked;

/// Surfaces that a task built, and what they show.
pub(in crate::plugin) struct TaskOutput {
    pub change: Change,
    pub surfaces: Vec<BuiltSurface>,
    /// Nodes that are drawn otherwise, where a cut is drawn.
    pub nodes: Vec<BuiltNode>,
    pub pieces: Vec<LoosePieceFound>,
    pub times: TaskTimes,
}

/// The source of a change of the ground.
pub(in crate::plugin) enum Change {
    /// A transaction, not committed yet.
    Transaction(Box<Commit>),
    /// Commits that the game made itself.
    PendingDisplay(PendingDisplay),
}

impl InFlight {
    fn start(number: u64, ticket: Option<u64>, work: impl FnOnce() -> TaskOutput + Send + 'static) -> Self {
        Self { number, ticket, task: ThreadTask::start(Threads::Transactions, work), done: None }
    }

    /// Runs a transaction, and builds the surfaces that it changes.
    pub fn transaction(
        number: u64,
        terrain: Entity,
        transaction: Transaction,
        engine: Engine,
        mut builder: SurfaceBuilder,
    ) -> Self {
        Self::start(number, Some(transaction.ticket()), move || {
            let _span = info_span!("burrow_transaction").entered();
            let start = Instant::now();
            let (mut commit, world) =
                info_span!("burrow_edit").in_scope(|| transaction.run_with_world(&engine));
            let edit = start.elapsed();
            // Taken out of the commit, so that they are dropped here and not on the main thread.
            let mut updates = std::mem::take(&mut commit.meshes);
            let relit;
            (builder, relit) = relight(builder, world, &commit, &mut updates);
            let drawn_cut = commit.drawn_cut().cloned();
            let tiles = updates.tiles.into_iter();
            let tiles = tiles.map(|(tile, update)| (MeshKey::Tile(tile), SurfaceDraft::Tile(update)));
            let chunks = updates.chunks.into_iter();
            let chunks = chunks.map(|(at, chunk)| (MeshKey::Chunk(at), SurfaceDraft::Chunk(chunk)));
            let _span = info_span!("burrow_mesh").entered();
            let drafts = tiles.chain(chunks).chain(relit).collect();
            let surfaces = builder.build_all(drafts, drawn_cut.as_deref());
            let nodes = builder.build_nodes(updates.nodes);
            let again = commit.receipts().iter().flat_map(|receipt| pieces_again(terrain, receipt));
            let mut pieces: Vec<LoosePieceFound> = pieces(terrain, commit.receipts()).chain(again).collect();
            if let Some(mesh_builder) = &builder.mesh_builder {
                pieces.iter_mut().for_each(|piece| piece.build_mesh(mesh_builder));
            }
            let total = start.elapsed();
            let times = TaskTimes { edit, mesh: total - edit, total };
            TaskOutput { change: Change::Transaction(Box::new(commit)), surfaces, nodes, pieces, times }
        })
    }

    /// Builds the surfaces that the game changed itself.
    pub fn pending_display(
        number: u64,
        terrain: &Terrain,
        pending: PendingDisplay,
        builder: SurfaceBuilder,
    ) -> Self {
        let (world, cut) = (terrain.snapshot(), terrain.drawn_cut().cloned());
        Self::start(number, None, move || {
            let _span = info_span!("burrow_mesh").entered();
            let mut drawn: BTreeSet<MeshKey> = pending.drawn().collect();
            let mut builder = builder;
            if builder.has_sky_light() {
                // The ground before the changes is not known, so all ground near them is lit again.
                drawn.extend(parts_near(&world, pending.drawn()));
                builder = builder.lit_by(&Arc::new(LitWorld::new(Arc::clone(&world), Vec::new())));
            }
            let drafts = drawn.iter().map(|&drawn| (drawn, world.draft(drawn))).collect();
            // Nodes are made from all of the world. Where there are none it is dropped here: commits copy the index of
            // a world that others hold.
            let cut = cut.map(|cut| (world, cut));
            let surfaces = builder.build_all(drafts, cut.as_ref().map(|(_, cut)| cut.as_ref()));
            let nodes =
                cut.map(|(world, cut)| world.redraw_tiles(&cut, drawn.iter().map(|drawn| drawn.tile())));
            let nodes = builder.build_nodes(nodes.unwrap_or_default());
            let (change, times) = (Change::PendingDisplay(pending), TaskTimes::default());
            TaskOutput { change, surfaces, nodes, pieces: Vec::new(), times }
        })
    }

    /// Whether the task is done.
    pub fn is_done(&mut self) -> bool {
        self.is_done_within(Duration::ZERO)
    }

    /// Whether the task is done, or will be within a time, for which this waits.
    pub fn is_done_within(&mut self, time: Duration) -> bool {
        if self.done.is_none() {
            self.done = self.task.check_within(time).map(|done| done.map_err(|_| TaskPanicked));
        }
        self.done.is_some()
    }

    /// Meshes that are swapped for its result.
    pub fn swaps(&self) -> usize {
        let Some(Ok(output)) = &self.done else { return 0 };
        output.surfaces.len() + output.nodes.iter().map(BuiltNode::swaps).sum::<usize>()
    }

    /// Passes meshes of its result to the renderer, as many as are left of a frame's budget. Returns whether it has
    /// all.
    pub fn upload(&mut self, assets: &mut Assets<Mesh>, budget: &mut usize) -> bool {
        let Some(Ok(output)) = &mut self.done else { return true };
        let surfaces = output.surfaces.iter_mut().filter_map(|built| built.mesh.as_mut());
        let nodes = output.nodes.iter_mut().flat_map(BuiltNode::meshes);
        surfaces.chain(nodes).all(|mesh| mesh.upload(assets, budget))
    }

    /// Whether its result is a transaction with edits or a step through history, and no piece of ground breaks off or
    /// comes back. Debris is made and removed in `Update`: earlier, a piece would be nowhere for a frame, or twice.
    /// Other players' edits arrive as parts, and their pieces separately.
    pub fn is_plain(&self) -> bool {
        let Some(Ok(TaskOutput { change: Change::Transaction(commit), pieces, .. })) = &self.done else {
            return false;
        };
        let is_own = |receipt: &Receipt| match receipt.kind {
            OrderKind::Edit => true,
            OrderKind::Undo | OrderKind::Redo => {
                receipt.outcome.as_ref().is_ok_and(|applied| applied.returned.is_empty())
            }
            _ => false,
        };
        let receipts = commit.receipts();
        let is_own = !receipts.is_empty() && receipts.iter().all(is_own);
        is_own && pieces.is_empty()
    }
}

/// Lights the surfaces of a commit to a world, and adds what it only lights otherwise: tiles and chunks are returned.
fn relight(
    builder: SurfaceBuilder,
    world: Arc<World>,
    commit: &Commit,
    updates: &mut MeshUpdates,
) -> (SurfaceBuilder, Vec<(MeshKey, SurfaceDraft)>) {
    if !builder.has_sky_light() {
        return (builder, Vec::new());
    }
    let bricks = if commit.is_cut() { Vec::new() } else { commit.change().bricks };
    let lit = Arc::new(LitWorld::new(world, bricks));
    // Another world is loaded as a whole.
    let is_relit = !commit.is_cut() && !commit.is_whole();
    let parts = if is_relit {
        let redrawn: HashSet<MeshKey> = {
            let tiles = updates.tiles.iter().map(|(tile, _)| MeshKey::Tile(*tile));
            tiles.chain(updates.chunks.iter().map(|(chunk, _)| MeshKey::Chunk(*chunk))).collect()
        };
        relit_parts(&lit, |drawn| redrawn.contains(&drawn))
    } else {
        Vec::new()
    };
    if let Some(drawn) = commit.drawn_cut().filter(|_| is_relit) {
        let redrawn: HashSet<Node> = updates.nodes.iter().map(|update| update.node).collect();
        updates.nodes.extend(relit_nodes(&lit, drawn, |node| redrawn.contains(&node)));
    }
    let drafts = parts.into_iter().map(|drawn| (drawn, lit.before().draft(drawn))).collect();
    (builder.lit_by(&lit), drafts)
}

/// The tiles and chunks that are so near to some that these may change their light.
fn parts_near(world: &World, of: impl Iterator<Item = MeshKey>) -> Vec<MeshKey> {
    let by = REACH / world.grid().size() + 1;
    let near = |TilePos { x, z }| {
        (x - by..=x + by).flat_map(move |x| (z - by..=z + by).map(move |z| TilePos { x, z }))
    };
    let tiles: HashSet<TilePos> = of.flat_map(|drawn| near(drawn.tile())).collect();
    let chunks = world.drawn_chunks().filter(|chunk| tiles.contains(&chunk.tile())).map(MeshKey::Chunk);
    let tiles = tiles.iter().filter(|tile| world.grid().has_tile(**tile)).map(|&tile| MeshKey::Tile(tile));
    tiles.chain(chunks).collect()
}

/// Numbers tasks over all terrains, so that they are committed in the order in which they began.
#[derive(Resource, Default)]
pub(in crate::plugin) struct TaskCounter(u64);

impl TaskCounter {
    pub fn next(&mut self) -> u64 {
        self.0 += 1;
        self.0
    }
}
