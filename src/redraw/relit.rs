//! Surfaces whose light a commit changes, though their shape stays.
//!
//! Light depends on the ground within a bounded distance, so only what is near changed bricks can differ. There, the
//! light of each vertex is compared before and after.

use glam::IVec3;
use rustc_hash::{FxHashMap, FxHashSet};

use super::cut::{DrawnCut, NodeUpdate};
use super::nodes::State;
use crate::lattice::{ChunkGrid, ChunkPos, Column, ItemCost, SNAP, TilePos, parallel_map};
use crate::lod::Node;
use crate::surface::lod;
use crate::world::sky::{ChangedBox, LightChange, LitWorld, REACH, SkyLights, SkyView, SparseSky};
use crate::world::{MeshKey, World};

/// Rectangles of columns of at most this many along a side are compared as one, and with larger ones each tile for
/// itself.
const MAX_TOGETHER: i32 = 128;

/// The tiles that draw columns whose light may change.
fn tiles(area: &ChangedBox, grid: ChunkGrid) -> impl Iterator<Item = TilePos> {
    let (low, high) = area.lit();
    let [low, high] = [low, high].map(|column| grid.chunk_of(column.at(0)));
    // A tile's last columns are the first of the next one.
    let all = (low.x - 1..=high.x).flat_map(move |x| (low.z - 1..=high.z).map(move |z| TilePos { x, z }));
    all.filter(move |tile| grid.has_tile(*tile))
}

/// What an area changes in the light of some columns, both ends included; `None` if none of them is in the world.
fn change(lit: &LitWorld, area: ChangedBox, (low, high): (Column, Column)) -> Option<LightChange<'_>> {
    let (grid, own) = (lit.before().grid(), area.lit());
    let low = Column::new(low.x.max(own.0.x).max(0), low.z.max(own.0.z).max(0));
    let high = Column::new(high.x.min(own.1.x).min(grid.width()), high.z.min(own.1.z).min(grid.depth()));
    let is_any = low.x <= high.x && low.z <= high.z;
    is_any.then(|| LightChange::new(lit, (low, high), area))
}

/// What a tile and its chunks draw of a world, without what a commit redraws anyway.
struct Unchanged {
    tile: TilePos,
    is_tile_drawn: bool,
    chunks: Vec<ChunkPos>,
}

/// The tiles and chunks whose light differs after a commit, in order, without those that it redraws anyway.
pub(crate) fn relit_parts(lit: &LitWorld, is_redrawn: impl Fn(MeshKey) -> bool + Sync) -> Vec<MeshKey> {
    let (world, grid) = (lit.before(), lit.before().grid());
    let areas = lit.changes();
    let Some(all) = areas.iter().copied().reduce(ChangedBox::union) else { return Vec::new() };
    let is_one = (all.high.x - all.low.x).max(all.high.z - all.low.z) <= MAX_TOGETHER - 2 * REACH;
    let mut by_tile: FxHashMap<TilePos, (ChangedBox, Vec<ChunkPos>)> = FxHashMap::default();
    let mut add = |area: ChangedBox| {
        for tile in tiles(&area, grid) {
            let own = by_tile.entry(tile).or_insert_with(|| (area, Vec::new()));
            own.0 = own.0.union(area);
        }
    };
    if is_one {
        add(all);
    } else {
        areas.into_iter().for_each(&mut add);
    }
    let (low, high) = all.lit();
    let [low, high] = [low, high].map(|column| grid.chunk_of(column.at(0)));
    for chunk in world.meshes.maybe_drawn() {
        let is_near = (low.x - 1..=high.x).contains(&chunk.x) && (low.z - 1..=high.z).contains(&chunk.z);
        if is_near && !is_redrawn(MeshKey::Chunk(chunk)) {
            by_tile.entry(chunk.tile()).and_modify(|(_, chunks)| chunks.push(chunk));
        }
    }
    let parts = by_tile.into_iter().map(|(tile, (area, chunks))| {
        (Unchanged { tile, is_tile_drawn: !is_redrawn(MeshKey::Tile(tile)), chunks }, area)
    });
    let mut parts: Vec<(Unchanged, ChangedBox)> = parts.collect();
    parts.retain(|(own, _)| own.is_tile_drawn || !own.chunks.is_empty());
    let mut found = if is_one {
        let change = if parts.is_empty() { None } else { change(lit, all, all.lit()) };
        change.map_or(Vec::new(), |mut change| {
            parts.iter().flat_map(|(own, _)| own.relit(world, &mut change)).collect()
        })
    } else {
        let relit = parallel_map(&parts, ItemCost::Surface, |(own, area)| {
            let change = change(lit, *area, grid.tile_cells(own.tile));
            change.map_or(Vec::new(), |mut change| own.relit(world, &mut change))
        });
        relit.concat()
    };
    found.sort_unstable();
    found
}

impl Unchanged {
    /// The unchanged meshes whose light differs.
    fn relit(&self, world: &World, change: &mut LightChange) -> Vec<MeshKey> {
        let (mut found, tile) = (Vec::new(), self.tile);
        if self.is_tile_drawn {
            let (low, high) = world.grid().tile_cells(tile);
            let origin = low.at(0) * SNAP;
            let rings = world.meshes.rings.get(&tile);
            let mut rings = rings.iter().flat_map(|rings| rings.vertices());
            let differs = change.shows_on_ground(SkyView::of(world), low, high)
                || rings.any(|vertex| change.shows_at(origin + vertex.position));
            found.extend(differs.then_some(MeshKey::Tile(tile)));
        }
        for &chunk in &self.chunks {
            // If its surface is not kept, its vertices are not known.
            let differs = world.meshes.surfaces.get(chunk).is_none_or(|surface| {
                let origin = world.grid().origin(chunk) * SNAP;
                surface.mesh().vertices.iter().any(|vertex| change.shows_at(origin + vertex.position))
            });
            found.extend(differs.then_some(MeshKey::Chunk(chunk)));
        }
        found
    }
}

/// The nodes of a drawn cut that have meshes of their own and whose light differs after a commit, without those that it
/// redraws anyway.
#[cfg_attr(not(feature = "plugin"), allow(dead_code))]
pub(crate) fn relit_nodes(
    lit: &LitWorld,
    drawn: &DrawnCut,
    is_redrawn: impl Fn(Node) -> bool,
) -> Vec<NodeUpdate> {
    let areas = lit.changes();
    let mut nodes: FxHashSet<Node> = FxHashSet::default();
    for area in &areas {
        let (low, high) = area.lit();
        nodes.extend(lod::nodes_near(&drawn.cut, low, high));
    }
    nodes.retain(|&node| !is_redrawn(node) && !drawn.shows_parts(node.tile()) | (node.level > 0));
    if nodes.is_empty() {
        return Vec::new();
    }
    let mut nodes: Vec<Node> = nodes.into_iter().collect();
    nodes.sort_unstable();
    let near_areas = NearAreas::of(&areas);
    // Their shapes are those before the commit.
    let updates = State::committed(lit.before()).updates(&drawn.cut, &nodes, |_| true);
    let (mut before, mut after) = (SparseSky::new(lit.view_before()), SparseSky::new(lit.view()));
    let mut differs = |update: &NodeUpdate| {
        let origin = drawn.cut.grid().columns(update.node).0.at(0) * SNAP;
        let vertices = update.mesh.iter().flat_map(|mesh| &mesh.vertices);
        let mut near =
            vertices.map(|vertex| origin + vertex.position).filter(|place| near_areas.holds(*place));
        near.any(|place| before.light(place) != after.light(place))
    };
    updates.into_iter().filter(|update| differs(update)).collect()
}

/// Boxes near which light may change: a long path has thousands of areas, and a vertex is near few of them.
#[cfg_attr(not(feature = "plugin"), allow(dead_code))]
struct NearAreas<'a>(FxHashMap<(i32, i32), Vec<&'a ChangedBox>>);

#[cfg_attr(not(feature = "plugin"), allow(dead_code))]
impl<'a> NearAreas<'a> {
    fn of(areas: &'a [ChangedBox]) -> Self {
        let mut near: FxHashMap<(i32, i32), Vec<&ChangedBox>> = FxHashMap::default();
        for area in areas {
            let (low, high) = area.lit();
            for x in low.x >> 3..=high.x >> 3 {
                for z in low.z >> 3..=high.z >> 3 {
                    near.entry((x, z)).or_default().push(area);
                }
            }
        }
        Self(near)
    }

    /// Whether light at a place may change.
    fn holds(&self, place: IVec3) -> bool {
        let (x, z) = (place.x.div_euclid(SNAP), place.z.div_euclid(SNAP));
        self.0.get(&(x >> 3, z >> 3)).is_some_and(|areas| {
            areas.iter().any(|area| {
                let (low, high) = area.lit();
                (low.x..=high.x).contains(&x) && (low.z..=high.z).contains(&z)
            })
        })
    }
}
