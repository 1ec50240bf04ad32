//! Draws the nodes of a cut: all of them, those that lead to another cut, and those that show an edit.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use rustc_hash::{FxHashMap, FxHashSet};

use super::cut::{ChooseCut, DrawnCut, NodeUpdate};
use super::source::{SurfaceDraft, TileUpdate};
use crate::lattice::{BrickPos, ChunkPos, Column, ItemCost, ONE, TilePos, parallel_map};
use crate::lod::{Cut, Node};
use crate::surface::ChunkSurface;
use crate::surface::lod::{self, LodView, Stacks};
use crate::surface::vertex::WorldView;
use crate::world::{MeshKey, World};

/// Tiles and chunks that a running transaction changes.
pub(crate) type NewParts<'a> = (&'a [(TilePos, TileUpdate)], &'a [(ChunkPos, Arc<ChunkSurface>)]);

impl World {
    /// A cut as it is drawn, and all meshes for it. In place of a cut of a world of another size, the coarsest is
    /// drawn.
    pub fn draw_cut(&self, cut: Cut) -> (DrawnCut, Vec<NodeUpdate>) {
        let cut = if self.has_cut(&cut) { cut } else { Cut::coarsest(self.lod_grid(u8::MAX)) };
        let mut nodes: Vec<Node> = cut.nodes().collect();
        nodes.sort_unstable();
        let before = DrawnCut { cut: Cut::coarsest(cut.grid()), joined: FxHashSet::default() };
        let state = State::committed(self);
        let updates = state.updates(&cut, &nodes, |_| false);
        (before.after(cut, &updates), updates)
    }

    /// Redraws the nodes that show some of these tiles or border on them.
    #[cfg(feature = "plugin")]
    pub(crate) fn redraw_tiles(
        &self,
        drawn: &Arc<DrawnCut>,
        tiles: impl Iterator<Item = TilePos>,
    ) -> Vec<NodeUpdate> {
        let size = self.grid.size();
        let areas = tiles.map(|tile| (Column::new(tile.x * size, tile.z * size), size));
        let areas = areas.map(|(low, size)| (low, low.offset(size, size)));
        // What the display shows of them is not known.
        redraw(&State::committed(self), drawn, areas, |_| false).1
    }
}

/// The new cut and its redrawn nodes.
pub(crate) type NodeChanges = (Arc<DrawnCut>, Vec<NodeUpdate>);

/// The updates that lead from one cut to another: removed nodes, new nodes, and nodes that touch them.
pub(crate) fn change_cut(world: &World, drawn: &Arc<DrawnCut>, choose: &ChooseCut) -> NodeChanges {
    let chosen = choose(world, &drawn.cut);
    // A cut of another quadtree has no relation to this one.
    let cut = if chosen.grid() == drawn.cut.grid() { chosen } else { drawn.cut.clone() };
    if cut == drawn.cut {
        return (Arc::clone(drawn), Vec::new());
    }
    let state = State::committed(world);
    let step = drawn.cut.changes_to(&cut);
    let mut nodes = step.new;
    nodes.extend(step.touched);
    // Those that touch it may be drawn by their parts before and after.
    let shows = |tile| drawn.shows_parts(tile);
    let mut updates = state.updates(&cut, &nodes, shows);
    let gone = step.gone.into_iter().map(|node| NodeUpdate {
        node,
        mesh: None,
        shown: Vec::new(),
        hidden: if node.level == 0 { state.parts_over(node.tile()) } else { Vec::new() },
    });
    let gone: Vec<NodeUpdate> = gone.collect();
    updates.splice(0..0, gone);
    (Arc::new(drawn.after(cut, &updates)), updates)
}

/// The nodes that show changed cells over these columns, drawn as they are in the view of a running transaction, which
/// changes these bricks.
pub(crate) fn redraw_changed(
    world: &World,
    view: &WorldView,
    drawn: &Arc<DrawnCut>,
    parts: NewParts,
    bricks: &[BrickPos],
    changed: &[(Column, Column)],
) -> NodeChanges {
    let stacks = world.edited_stacks().over(bricks);
    let state = State { world, view: *view, stacks, parts, by_tile: OnceLock::new() };
    redraw(&state, drawn, changed.iter().copied(), |tile| drawn.shows_parts(tile))
}

fn redraw(
    state: &State,
    drawn: &Arc<DrawnCut>,
    areas: impl Iterator<Item = (Column, Column)>,
    shows_parts: impl Fn(TilePos) -> bool,
) -> NodeChanges {
    let mut nodes: Vec<Node> =
        merged(areas).into_iter().flat_map(|(low, high)| lod::nodes_near(&drawn.cut, low, high)).collect();
    // Where no coarser node is near, nodes that are drawn by their parts stay so. Most digs are there.
    if nodes.iter().all(|node| node.level == 0 && shows_parts(node.tile())) {
        return (Arc::clone(drawn), Vec::new());
    }
    nodes.sort_unstable();
    nodes.dedup();
    let updates = state.updates(&drawn.cut, &nodes, shows_parts);
    let changes = |update: &NodeUpdate| {
        update.node.level == 0 && update.mesh.is_some() != drawn.joined.contains(&update.node.tile())
    };
    match updates.iter().any(changes) {
        true => (Arc::new(drawn.after(drawn.cut.clone(), &updates)), updates),
        false => (Arc::clone(drawn), updates),
    }
}

/// Areas that follow each other are taken together while they stay this narrow, in voxels.
const NARROW: i32 = 64;

/// Fewer areas that hold these, both ends included.
fn merged(areas: impl Iterator<Item = (Column, Column)>) -> Vec<(Column, Column)> {
    let mut merged: Vec<(Column, Column)> = Vec::new();
    for (low, high) in areas {
        if let Some(last) = merged.last_mut() {
            let all = (
                Column::new(last.0.x.min(low.x), last.0.z.min(low.z)),
                Column::new(last.1.x.max(high.x), last.1.z.max(high.z)),
            );
            if (all.1.x - all.0.x).max(all.1.z - all.0.z) < NARROW {
                *last = all;
                continue;
            }
        }
        merged.push((low, high));
    }
    merged
}

/// A world as it is drawn: as committed, or with what a running transaction changes.
pub(super) struct State<'a> {
    world: &'a World,
    view: WorldView<'a>,
    stacks: Stacks<'a>,
    /// Empty if everything is committed.
    parts: NewParts<'a>,
    /// `parts` by tile. Computed on first use, because most edits draw no node.
    by_tile: OnceLock<FxHashMap<TilePos, NewOver<'a>>>,
}

/// The parts over one tile that a running transaction changes.
#[derive(Default)]
struct NewOver<'a> {
    tile: Option<&'a TileUpdate>,
    chunks: Vec<(ChunkPos, &'a Arc<ChunkSurface>)>,
}

impl<'a> State<'a> {
    pub fn committed(world: &'a World) -> Self {
        Self {
            world,
            view: world.view(),
            stacks: world.edited_stacks(),
            parts: (&[], &[]),
            by_tile: OnceLock::new(),
        }
    }

    /// What the running transaction changes over a tile.
    fn new_over(&self, tile: TilePos) -> Option<&NewOver<'a>> {
        let by_tile = self.by_tile.get_or_init(|| {
            let (tiles, chunks) = self.parts;
            let mut by_tile = FxHashMap::<TilePos, NewOver<'a>>::default();
            for (tile, update) in tiles {
                by_tile.entry(*tile).or_default().tile = Some(update);
            }
            for (chunk, surface) in chunks {
                by_tile.entry(chunk.tile()).or_default().chunks.push((*chunk, surface));
            }
            by_tile
        });
        by_tile.get(&tile)
    }

    /// The meshes of these nodes of a cut. Nodes of level 0 that were and are drawn by their parts are left out,
    /// because changed parts have their own updates.
    pub fn updates(
        &self,
        cut: &Cut,
        nodes: &[Node],
        shows_parts: impl Fn(TilePos) -> bool,
    ) -> Vec<NodeUpdate> {
        let view = LodView::new(self.view, cut, self.stacks);
        // Most digs draw nothing here, so threads are not involved.
        let changing = nodes.iter().filter_map(|&node| {
            let is_plain = node.level == 0 && lod::is_plain(&view, node);
            (!is_plain || !shows_parts(node.tile())).then_some((node, is_plain))
        });
        parallel_map(&changing.collect::<Vec<_>>(), ItemCost::Surface, |&(node, is_plain)| {
            let parts = if node.level == 0 { self.parts_over(node.tile()) } else { Vec::new() };
            if !is_plain {
                let mesh = Some(Arc::new(lod::node_mesh(&view, node)));
                return NodeUpdate { node, mesh, shown: Vec::new(), hidden: parts };
            }
            let shown = parts.into_iter().map(|drawn| (drawn, self.draft(drawn))).collect();
            NodeUpdate { node, mesh: None, shown, hidden: Vec::new() }
        })
    }

    /// The tile and all chunks over it that draw something.
    fn parts_over(&self, tile: TilePos) -> Vec<MeshKey> {
        let size = self.world.grid.size();
        let mut chunks: Vec<ChunkPos> = Vec::new();
        let rows = self.world.rows_over(tile).unwrap_or(0..0);
        if !rows.is_empty() {
            let ys = rows.start.div_euclid(size)..=(rows.end - 1).div_euclid(size);
            let places = ys.map(|y| ChunkPos { x: tile.x, y, z: tile.z });
            chunks.extend(places.filter(|chunk| self.world.meshes.may_draw(*chunk)));
        }
        chunks.extend(self.new_over(tile).iter().flat_map(|new| &new.chunks).map(|(chunk, _)| *chunk));
        chunks.sort_unstable();
        chunks.dedup();
        std::iter::once(MeshKey::Tile(tile)).chain(chunks.into_iter().map(MeshKey::Chunk)).collect()
    }

    /// The samples that a tile or chunk is built from.
    fn draft(&self, drawn: MeshKey) -> SurfaceDraft {
        let new = self.new_over(drawn.tile());
        match drawn {
            MeshKey::Tile(tile) => {
                let new = new.and_then(|new| new.tile);
                let old = || {
                    TileUpdate::new(self.world, &self.view, tile, |borders| {
                        self.world.tile_rings(tile, borders)
                    })
                };
                SurfaceDraft::Tile(new.cloned().unwrap_or_else(old))
            }
            MeshKey::Chunk(chunk) => {
                let new = new.and_then(|new| new.chunks.iter().find(|(other, _)| *other == chunk));
                match new {
                    Some((_, surface)) => SurfaceDraft::Chunk(Arc::clone(surface)),
                    None => self.world.draft(drawn),
                }
            }
        }
    }
}

impl World {
    /// Lattice y of all cubes that chunks over a tile may draw; `None` where nothing near was edited.
    fn rows_over(&self, tile: TilePos) -> Option<Range<i32>> {
        let (low, high) = self.grid.tile_cells(tile);
        // Edits one brick further may put cells of the tile into the mask.
        let places = ((low.z - 1) >> 3..=(high.z + 1) >> 3)
            .flat_map(|z| ((low.x - 1) >> 3..=(high.x + 1) >> 3).map(move |x| (x, z)));
        let rows = |stack: &Vec<i32>| Some((*stack.first()? * 8 - 2, *stack.last()? * 8 + 10));
        let wider = |a: (i32, i32), b: (i32, i32)| (a.0.min(b.0), a.1.max(b.1));
        let edited = places.filter_map(|place| self.stacks.get(&place).and_then(rows)).reduce(wider)?;
        // Cells of the mask draw their sheet, however high it is.
        let columns = (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| Column::new(x, z)));
        let heights = columns.map(|column| self.ground.height(column).div_euclid(ONE));
        let (first, last) = heights.fold(edited, |rows, y| wider(rows, (y - 2, y + 2)));
        Some(first..last + 1)
    }
}
