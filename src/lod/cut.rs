//! Cuts: sets of nodes that are drawn together.

use std::sync::Arc;

use rustc_hash::FxHashSet;

use super::{LodGrid, Node};
use crate::lattice::TilePos;

/// Nodes that together cover the world once. Those that share an edge differ by at most one level; across a corner they
/// may differ by more.
///
/// It is kept as the set of nodes that are split. A node of the cut is one that is not split, of a parent that is.
/// Clones share the set until one of them changes, so that an unchanged cut is copied and compared at no cost.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cut {
    grid: LodGrid,
    split: Arc<FxHashSet<Node>>,
}

impl Cut {
    /// The nodes of the coarsest level.
    pub fn coarsest(grid: LodGrid) -> Self {
        Self { grid, split: Arc::default() }
    }

    /// The coarsest cut in which every node is split for which `is_split` returns `true`. It is called from coarse
    /// nodes to fine ones, and not for the children of nodes that are not split.
    pub fn new(grid: LodGrid, mut is_split: impl FnMut(Node) -> bool) -> Self {
        let mut cut = Self::coarsest(grid);
        let mut asked: Vec<Node> = grid.roots().collect();
        while let Some(node) = asked.pop() {
            if node.level > 0 && !cut.split.contains(&node) && is_split(node) {
                cut.require(node, &mut asked);
            }
        }
        cut
    }

    /// A cut in which each node is split with a chance of `percent`; equal for equal seeds.
    #[cfg(any(test, feature = "tools"))]
    pub fn random(grid: LodGrid, seed: u64, percent: u64) -> Self {
        Self::new(grid, |node| (hash_node(node, seed) >> 7) % 100 < percent)
    }

    /// Splits a node, and before it those that must be split; adds the children of each to `made`.
    fn require(&mut self, node: Node, made: &mut Vec<Node>) {
        let mut wanted = vec![node];
        while let Some(node) = wanted.pop() {
            if self.split.contains(&node) {
                continue;
            }
            self.split(node);
            made.extend(node.children().into_iter().flatten().filter(|&child| self.grid.has(child)));
            wanted.extend(self.required_by(node));
        }
    }

    /// The nodes that must be split for this one to be: its parent, and those of its neighbours across edges.
    pub(super) fn required_by(&self, node: Node) -> impl Iterator<Item = Node> {
        let grid = self.grid;
        let beside = node.beside().into_iter().filter(move |&other| grid.has(other));
        let parents = beside.map(Node::parent).chain([node.parent()]);
        parents.filter(move |parent| parent.level <= grid.top())
    }

    /// The quadtree that it cuts.
    pub const fn grid(&self) -> LodGrid {
        self.grid
    }

    /// Returns `true` if a node is split, so that finer ones are drawn in its place.
    pub fn is_split(&self, node: Node) -> bool {
        self.split.contains(&node)
    }

    /// Returns `true` if a node is drawn.
    pub fn contains(&self, node: Node) -> bool {
        self.grid.has(node)
            && !self.is_split(node)
            && (node.level == self.grid.top() || self.is_split(node.parent()))
    }

    /// The node that draws a tile; `None` where the world has no such tile.
    pub fn node_at(&self, tile: TilePos) -> Option<Node> {
        if !self.grid.chunks().has_tile(tile) {
            return None;
        }
        // From below: the parents of a split node are split too, and fine nodes are asked for most often.
        let nodes = (0..=self.grid.top()).map(|level| Node::over(tile, level));
        nodes.into_iter().find(|node| node.level == self.grid.top() || self.is_split(node.parent()))
    }

    /// Every node that is drawn, in no order.
    pub fn nodes(&self) -> impl Iterator<Item = Node> {
        let children = self.split.iter().filter_map(|node| node.children()).flatten();
        self.grid.roots().chain(children).filter(|&node| self.grid.has(node) && !self.is_split(node))
    }

    /// The nodes that are drawn and touch a node, over an edge or at a corner: those whose meshes may change with its
    /// level.
    pub fn touching(&self, node: Node) -> Vec<Node> {
        let (TilePos { x, z }, size) = (node.tile(), node.stride());
        let beside = (-1..=size).flat_map(|at| [(at, -1), (at, size), (-1, at), (size, at)]);
        let tiles = beside.map(|(dx, dz)| TilePos { x: x + dx, z: z + dz });
        let mut found: Vec<Node> = tiles.filter_map(|tile| self.node_at(tile)).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The nodes that are drawn in place of a node, or the one that is drawn over it.
    pub(super) fn nodes_within(&self, node: Node) -> Vec<Node> {
        let (mut found, mut asked) = (Vec::new(), vec![node]);
        while let Some(node) = asked.pop() {
            match node.children().filter(|_| self.is_split(node)) {
                Some(children) => asked.extend(children.into_iter().filter(|&child| self.grid.has(child))),
                None => found.extend(self.node_at(node.tile())),
            }
        }
        found
    }

    /// The nodes one level finer that are split, and could not be if this one were drawn.
    pub(super) fn splits_that_require(&self, node: Node) -> impl Iterator<Item = Node> {
        let children = node.children().into_iter().flatten();
        children
            .flat_map(|child| child.beside().into_iter().chain([child]))
            .filter(|&near| self.is_split(near))
    }

    pub(super) fn split(&mut self, node: Node) {
        Arc::make_mut(&mut self.split).insert(node);
    }

    pub(super) fn merge(&mut self, node: Node) {
        Arc::make_mut(&mut self.split).remove(&node);
    }

    /// The nodes that are split, in no order.
    pub(super) fn split_nodes(&self) -> impl Iterator<Item = Node> {
        self.split.iter().copied()
    }
}

/// A pseudo-random hash of a node and a seed.
#[cfg(any(test, feature = "tools"))]
pub(super) fn hash_node(node: Node, seed: u64) -> u64 {
    let words = [node.level.into(), node.x, node.z].map(|word: i32| u64::from(word.cast_unsigned()));
    let add = |hash: u64, word: u64| (hash ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
    words.into_iter().fold(seed, add)
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lattice::ChunkGrid;

    pub fn random_cut(grid: LodGrid, seed: u64, percent: u64) -> Cut {
        Cut::random(grid, seed, percent)
    }

    /// Every tile is drawn by one node, and no neighbour over an edge is more than one level away.
    pub fn assert_is_cut(cut: &Cut) {
        let tiles = cut.grid().chunks();
        let mut covered = 0;
        for node in cut.nodes() {
            assert!(cut.contains(node));
            let (low, size) = (node.tile(), node.stride());
            for z in low.z..low.z + size {
                for x in low.x..low.x + size {
                    if tiles.has_tile(TilePos { x, z }) {
                        assert_eq!(cut.node_at(TilePos { x, z }), Some(node));
                        covered += 1;
                    }
                }
            }
        }
        assert_eq!(covered, tiles.tiles().count());
        for tile in tiles.tiles() {
            let level = cut.node_at(tile).map(|node| i32::from(node.level));
            for (x, z) in Node::BESIDE {
                let beside = cut.node_at(TilePos { x: tile.x + x, z: tile.z + z });
                let Some(beside) = beside else { continue };
                assert!((level.unwrap_or(-9) - i32::from(beside.level)).abs() <= 1, "at {tile:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn cuts_cover_the_world_once_and_change_by_one_level_over_edges(
            width in 1i32..700, depth in 1i32..700, size in prop::sample::select(vec![8, 25, 32]), top in 0u8..6,
            seed: u64, percent in 0u64..100,
        ) {
            let grid = LodGrid::new(ChunkGrid::new(size, width, depth), top);
            let cut = random_cut(grid, seed, percent);
            assert_is_cut(&cut);
            // Every node that should be split is split, if it exists.
            for node in cut.nodes().filter(|node| node.level > 0) {
                prop_assert!((hash_node(node, seed) >> 7) % 100 >= percent, "{node:?}");
            }
        }

        #[test]
        fn touching_nodes_are_those_that_share_a_side_or_a_corner(seed: u64, percent in 20u64..80) {
            let cut = random_cut(LodGrid::new(ChunkGrid::new(8, 170, 130), 4), seed, percent);
            for node in cut.nodes() {
                let mut expected: Vec<Node> = cut.nodes().filter(|&other| node.touches(other)).collect();
                expected.sort_unstable();
                prop_assert_eq!(cut.touching(node), expected);
            }
        }
    }

    #[test]
    fn a_world_without_levels_is_drawn_tile_by_tile() {
        let chunks = ChunkGrid::new(16, 100, 50);
        let cut = Cut::coarsest(LodGrid::new(chunks, 0));
        let mut tiles: Vec<TilePos> = cut.nodes().map(Node::tile).collect();
        tiles.sort_unstable();
        let mut expected: Vec<TilePos> = chunks.tiles().collect();
        expected.sort_unstable();
        assert_eq!(tiles, expected);
    }
}
