//! The nodes of the quadtree that contain edits, kept up to date with each commit.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::IVec3;
use rustc_hash::FxHashMap;

use crate::lattice::{ChunkGrid, shrink_if_sparse, table_bytes};
use crate::lod::{LodGrid, Node};

/// The nodes of all levels that contain edits. A commit changes only the nodes over stacks that get their first brick
/// or lose their last one, so it costs the same however large the world is.
#[derive(Clone, Debug, Default)]
pub(crate) struct EditedNodes {
    /// At level 0 how many stacks of bricks hold samples of the node, and at coarser levels how many of its children
    /// are here.
    counts: FxHashMap<Node, u32>,
    /// Differs from that of any other set of nodes in this process.
    version: u64,
}

/// The last version of any set of nodes.
static VERSIONS: AtomicU64 = AtomicU64::new(0);

impl EditedNodes {
    /// Counts a stack of bricks that has become edited.
    pub fn add(&mut self, grid: ChunkGrid, stack: (i32, i32)) {
        for node in nodes_of(grid, stack) {
            self.count(grid, node);
        }
    }

    /// Counts a stack of bricks that is pristine again.
    pub fn remove(&mut self, grid: ChunkGrid, stack: (i32, i32)) {
        for node in nodes_of(grid, stack) {
            self.discount(grid, node);
        }
        shrink_if_sparse(&mut self.counts);
    }

    fn count(&mut self, grid: ChunkGrid, mut node: Node) {
        loop {
            let count = self.counts.entry(node).or_default();
            *count += 1;
            let is_new = *count == 1;
            if is_new {
                self.version = VERSIONS.fetch_add(1, Ordering::Relaxed) + 1;
            }
            if !is_new || node.level == LodGrid::new(grid, u8::MAX).top() {
                return;
            }
            node = node.parent();
        }
    }

    fn discount(&mut self, grid: ChunkGrid, mut node: Node) {
        while let Some(count) = self.counts.get_mut(&node) {
            *count -= 1;
            if *count > 0 {
                return;
            }
            self.counts.remove(&node);
            self.version = VERSIONS.fetch_add(1, Ordering::Relaxed) + 1;
            if node.level == LodGrid::new(grid, u8::MAX).top() {
                return;
            }
            node = node.parent();
        }
    }

    /// Whether a node contains edits.
    pub fn contains(&self, node: Node) -> bool {
        self.counts.contains_key(&node)
    }

    /// A number that changes whenever a node gets its first edit or loses its last one. Equal numbers mean equal nodes.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Bytes of the table.
    pub fn bytes(&self) -> usize {
        table_bytes(&self.counts)
    }
}

/// The nodes of level 0 that hold samples of a stack of bricks: one, or up to four where the borders of tiles cross it.
fn nodes_of(grid: ChunkGrid, (x, z): (i32, i32)) -> impl Iterator<Item = Node> {
    let tile = |x: i32, z: i32| grid.chunk_of(IVec3::new(x, 0, z)).tile();
    let low = tile(x * 8, z * 8);
    // Tiles of most sizes begin with a brick.
    let high = if grid.size() % 8 == 0 { low } else { tile(x * 8 + 7, z * 8 + 7) };
    (low.z..=high.z).flat_map(move |z| (low.x..=high.x).map(move |x| Node { level: 0, x, z }))
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::Vec3;
    use rustc_hash::FxHashSet;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;
    use crate::lattice::BrickPos;
    use crate::terrain::{Terrain, TerrainSettings, World};

    /// The nodes with samples of bricks, found by looking at each brick's samples.
    fn nodes_with_bricks(world: &World) -> FxHashSet<Node> {
        let top = world.lod_grid(u8::MAX).top();
        let corners = |pos: BrickPos| {
            let low = pos.origin();
            (0..8).flat_map(move |z| (0..8).map(move |x| low + IVec3::new(x, 0, z)))
        };
        let tiles = world.bricks().flat_map(|(pos, _)| corners(pos));
        let tiles = tiles.map(|sample| world.grid().chunk_of(sample).tile());
        tiles.flat_map(|tile| (0..=top).map(move |level| Node::over(tile, level))).collect()
    }

    #[test]
    fn the_nodes_with_edits_are_known_after_each_commit_and_step() {
        for (seed, chunk_size) in [(1, 8), (2, 25), (3, 32)] {
            let mut rng = Rng::with_seed(seed);
            let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
            let ground = Ground::flat(190, 270, 8.0).expect("valid ground");
            let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
            for _ in 0..60 {
                let at = Vec3::new(rng.f32() * 190.0, 4.0 + rng.f32() * 10.0, rng.f32() * 270.0);
                let shape = Shape::sphere(at, 1.0 + rng.f32() * 9.0);
                match rng.u8(0..6) {
                    0 | 1 => drop(terrain.undo()),
                    2 => drop(terrain.redo()),
                    3 => drop(terrain.apply([Brush::reset(Shape::sphere(at, 40.0))])),
                    _ => drop(terrain.apply([Brush::dig(shape)])),
                }
                let world = terrain.world();
                let known: FxHashSet<Node> = world.edited_nodes.counts.keys().copied().collect();
                assert_eq!(known, nodes_with_bricks(world));
            }
            while terrain.undo().outcome.is_ok() {}
            assert!(terrain.world().edited_nodes.counts.is_empty());
        }
    }
}
