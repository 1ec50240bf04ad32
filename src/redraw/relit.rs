//! Surfaces whose light a commit changes, though their shape stays.
//!
//! Light depends on the ground within a bounded distance, so only what is near changed bricks can differ. There, the light of
//! each vertex is compared before and after.

use glam::IVec3;
use rustc_hash::{FxHashMap, FxHashSet};

use super::cut::{DrawnCut, NodeUpdate};
use super::nodes::State;
use crate::lattice::{BRICK, ChunkPos, Column, ItemCost, LatticeBox, ONE, SNAP, TilePos, parallel_map};
use crate::lod::Node;
use crate::surface::lod;
use crate::world::sky::{LitWorld, REACH, SkyColumns, SkyLights, SkyView, SparseSky, stack_tops};
use crate::world::{MeshKey, World};

/// Columns over which something changes.
#[derive(Clone, Copy)]
struct Area {
    /// The columns of a stack of bricks.
    stack: Column,
    /// Changed tops: the lowest and the highest of their columns, and the highest top before and after.
    open: Option<(Column, Column, i32)>,
    /// Where the highest changed brick ends, in 1/256 voxel.
    highest: i32,
}

impl Area {
    fn last(self) -> Column {
        self.stack.offset(BRICK - 1, BRICK - 1)
    }

    /// The columns whose light it may change.
    fn near(self) -> (Column, Column) {
        (self.stack.offset(-REACH, -REACH), self.last().offset(REACH, REACH))
    }
}

/// The areas that a commit changes, in order.
fn areas(lit: &LitWorld) -> Vec<Area> {
    let mut ends: FxHashMap<(i32, i32), i32> = FxHashMap::default();
    for brick in lit.changed_bricks() {
        let end = ends.entry(brick.stack()).or_insert(i32::MIN);
        *end = (*end).max((brick.0.y + 1) * BRICK * ONE);
    }
    let mut stacks: Vec<(i32, i32)> = lit.changed_stacks().collect();
    stacks.sort_unstable();
    let area = |(x, z): (i32, i32)| {
        let stack = Column::new(x * BRICK, z * BRICK);
        let heights = lit.before().ground().heights::<8>(stack);
        let [before, after] = [SkyView::of(lit.before()), lit.view()].map(|view| {
            let own = stack_tops(view, (x, z)).map(|own| own.tops);
            own.unwrap_or_else(|| heights.as_flattened().try_into().unwrap_or([0; 64]))
        });
        let mut open: Option<(Column, Column, i32)> = None;
        for (at, (&before, &after)) in (0..).zip(before.iter().zip(&after)).filter(|(_, (a, b))| a != b) {
            let (own, top) = (stack.offset(at & 7, at >> 3), before.max(after));
            let (low, high, highest) = open.unwrap_or((own, own, top));
            open = Some((
                Column::new(low.x.min(own.x), low.z.min(own.z)),
                Column::new(high.x.max(own.x), high.z.max(own.z)),
                highest.max(top),
            ));
        }
        Area { stack, open, highest: ends.get(&(x, z)).copied().unwrap_or(i32::MIN) }
    };
    parallel_map(&stacks, ItemCost::Brick, |&stack| area(stack))
}

/// The tiles and chunks whose light differs after a commit, in order, without those that it redraws anyway.
pub(crate) fn relit_parts(lit: &LitWorld, is_redrawn: impl Fn(MeshKey) -> bool + Sync) -> Vec<MeshKey> {
    let (world, grid) = (lit.before(), lit.before().grid());
    let mut by_tile: FxHashMap<TilePos, Vec<Area>> = FxHashMap::default();
    for area in areas(lit) {
        let (low, high) = area.near();
        let [low, high] = [low, high].map(|column| grid.chunk_of(column.at(0)));
        // A tile's last columns are the first of the next one.
        for x in low.x - 1..=high.x {
            for z in low.z - 1..=high.z {
                let tile = TilePos { x, z };
                if grid.has_tile(tile) {
                    by_tile.entry(tile).or_default().push(area);
                }
            }
        }
    }
    let mut chunks: FxHashMap<TilePos, Vec<ChunkPos>> = FxHashMap::default();
    for chunk in world.meshes.maybe_drawn() {
        if by_tile.contains_key(&chunk.tile()) && !is_redrawn(MeshKey::Chunk(chunk)) {
            chunks.entry(chunk.tile()).or_default().push(chunk);
        }
    }
    let mut tiles: Vec<(TilePos, Vec<Area>)> = by_tile.into_iter().collect();
    tiles.sort_unstable_by_key(|(tile, _)| *tile);
    let found = parallel_map(&tiles, ItemCost::Surface, |(tile, areas)| {
        let mut own: Vec<ChunkPos> = chunks.get(tile).cloned().unwrap_or_default();
        own.sort_unstable();
        let is_whole = !is_redrawn(MeshKey::Tile(*tile));
        let compared = Compared::new(lit, *tile, areas, (is_whole, !own.is_empty()));
        compared.map_or(Vec::new(), |mut compared| {
            let mut found = Vec::new();
            if is_whole && compared.tile_differs() {
                found.push(MeshKey::Tile(*tile));
            }
            found.extend(own.into_iter().filter(|&chunk| compared.chunk_differs(chunk)).map(MeshKey::Chunk));
            found
        })
    });
    let mut found = found.concat();
    found.sort_unstable();
    found
}

/// A tile's columns near changes, before and after.
struct Compared<'a> {
    world: &'a World,
    areas: &'a [Area],
    low: Column,
    high: Column,
    before: SkyColumns<'a>,
    after: SkyColumns<'a>,
    /// Where the highest change ends, of tops and of bricks, in 1/256 voxel.
    highest: i32,
}

impl<'a> Compared<'a> {
    /// `None` if nothing differs: neither the tile's light, if that is asked for, nor that of chunks.
    fn new(
        lit: &'a LitWorld,
        tile: TilePos,
        areas: &'a [Area],
        (has_tile, has_chunks): (bool, bool),
    ) -> Option<Self> {
        let world = lit.before();
        let (first, last) = world.grid().tile_cells(tile);
        let around = |area: &Area| match area.open {
            Some((low, high, _)) if !has_chunks => (low, high),
            _ => (area.stack, area.last()),
        };
        let all = areas.iter().map(around);
        let all = all.map(|(low, high)| LatticeBox { min: low.at(0), max: high.at(0) });
        let near = all.reduce(LatticeBox::union)?;
        let near = LatticeBox { min: near.min - REACH, max: near.max + REACH };
        let own = LatticeBox::new(first.at(near.min.y), last.at(near.max.y))?.intersection(near)?;
        let (low, high) = (Column::of(own.min), Column::of(own.max));
        let tops = areas.iter().filter_map(|area| area.open).map(|(.., highest)| highest);
        let highest_top = tops.max().unwrap_or(i32::MIN);
        let highest = areas.iter().map(|area| area.highest).max()?.max(highest_top);
        // Light comes from above, and ground that nothing was built over looks at tops alone.
        let lowest = lit.lowest_ground(low, high);
        let is_open = lit.is_undug(low, high);
        if !has_chunks && (!has_tile || lowest >= if is_open { highest_top } else { highest }) {
            return None;
        }
        let before = SkyColumns::new(SkyView::of(world), low, high);
        let after = before.after(lit);
        Some(Self { world, areas, low, high, before, after, highest })
    }

    /// Whether any vertex over a column of the tile has another light.
    fn tile_differs(&mut self) -> bool {
        let tops = self.areas.iter().filter_map(|area| area.open).map(|(.., highest)| highest);
        let highest = tops.max().unwrap_or(i32::MIN);
        let lowest = self.before.lowest_inside().min(self.after.lowest_inside());
        if lowest < highest && self.before.shows_other_lights(&self.after) {
            return true;
        }
        if !self.before.has_changes() && !self.after.has_changes() {
            return false;
        }
        // Ground under roofs, or that was under one. What was dug is not drawn by a tile.
        let ground = self.world.ground();
        for z in self.low.z..=self.high.z {
            for x in self.low.x..=self.high.x {
                let column = Column::new(x, z);
                if !self.before.is_changed(column) && !self.after.is_changed(column) {
                    continue;
                }
                let height = ground.height(column);
                if self.before.top(column).max(self.after.top(column)) < height {
                    continue;
                }
                let place = (column.at(0) * SNAP).with_y(height * (SNAP / ONE));
                if self.before.light(place) != self.after.light(place) {
                    return true;
                }
            }
        }
        false
    }

    fn chunk_differs(&mut self, chunk: ChunkPos) -> bool {
        let Some(surface) = self.world.meshes.surfaces.get(chunk) else {
            // Its vertices are not known.
            return true;
        };
        let origin = self.world.grid().origin(chunk) * SNAP;
        surface.mesh().vertices.iter().any(|vertex| {
            let place = origin + vertex.position;
            self.may_differ(place) && self.before.light(place) != self.after.light(place)
        })
    }

    /// Light comes from above.
    fn may_differ(&self, place: IVec3) -> bool {
        let column = Column::new(place.x.div_euclid(SNAP), place.z.div_euclid(SNAP));
        place.y < self.highest * (SNAP / ONE)
            && (self.low.x..=self.high.x).contains(&column.x)
            && (self.low.z..=self.high.z).contains(&column.z)
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
    let areas = areas(lit);
    let mut nodes: FxHashSet<Node> = FxHashSet::default();
    for area in &areas {
        let (low, high) = area.near();
        nodes.extend(lod::nodes_near(&drawn.cut, low, high));
    }
    nodes.retain(|&node| !is_redrawn(node) && !drawn.shows_parts(node.tile()) | (node.level > 0));
    let mut nodes: Vec<Node> = nodes.into_iter().collect();
    nodes.sort_unstable();
    let near_areas = NearAreas::of(&areas);
    // Their shapes are those before the commit.
    let updates = State::committed(lit.before()).updates(&drawn.cut, &nodes, |_| true);
    let (mut before, mut after) = (SparseSky::new(SkyView::of(lit.before())), SparseSky::new(lit.view()));
    let mut differs = |update: &NodeUpdate| {
        let origin = drawn.cut.grid().columns(update.node).0.at(0) * SNAP;
        let vertices = update.mesh.iter().flat_map(|mesh| &mesh.vertices);
        let mut near =
            vertices.map(|vertex| origin + vertex.position).filter(|place| near_areas.holds(*place));
        near.any(|place| before.light(place) != after.light(place))
    };
    updates.into_iter().filter(|update| differs(update)).collect()
}

/// Stacks of bricks over which light may change: a long path has thousands of areas, and a vertex is near few of them.
#[cfg_attr(not(feature = "plugin"), allow(dead_code))]
struct NearAreas<'a>(FxHashMap<(i32, i32), Vec<&'a Area>>);

#[cfg_attr(not(feature = "plugin"), allow(dead_code))]
impl<'a> NearAreas<'a> {
    fn of(areas: &'a [Area]) -> Self {
        let mut near: FxHashMap<(i32, i32), Vec<&Area>> = FxHashMap::default();
        for area in areas {
            let (low, high) = area.near();
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
                let (low, high) = area.near();
                (low.x..=high.x).contains(&x) && (low.z..=high.z).contains(&z)
            })
        })
    }
}
