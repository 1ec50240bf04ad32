//! A cache of facts about the nodes of a world's quadtree, and the choice of cuts from them.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use glam::Vec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::node_facts::GroundFacts;
use crate::lod::{Cut, LodGrid, LodSettings, Node, NodeFacts, Viewpoint};
use crate::world::World;

/// The number of cached nodes above which some are dropped.
const KEPT_NODES: usize = 32_768;

/// Cached facts about nodes, shared with tasks. Heights and errors depend on the ground alone, and are kept for nodes
/// that were drawn once, until there are too many.
#[derive(Default)]
pub struct KnownNodes {
    facts: RwLock<FxHashMap<Node, GroundFacts>>,
    waiting: AtomicUsize,
}

impl KnownNodes {
    /// Finds the facts of these nodes where they are not known yet, in parallel.
    pub fn learn(&self, world: &World, grid: LodGrid, nodes: impl Iterator<Item = Node>) {
        let new: Vec<Node> = {
            let known = self.read();
            nodes.filter(|node| !known.contains_key(node)).collect()
        };
        let facts = |node| (node, GroundFacts::new(world.ground(), grid, node));
        let found: Vec<_> = new.into_par_iter().map(facts).collect();
        self.facts.write().unwrap_or_else(PoisonError::into_inner).extend(found);
    }

    /// Nodes that were still to change when the last cut was chosen.
    pub fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }

    fn read(&self) -> RwLockReadGuard<'_, FxHashMap<Node, GroundFacts>> {
        self.facts.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// One step of `most` meshes at most, or of one change, towards the cut that these eyes need. Nodes that were not drawn
    /// yet, and so are not known, are not split: what is coarse comes first.
    pub fn next_cut(
        &self,
        world: &World,
        cut: &Cut,
        choice: &LodSettings,
        eyes: &[Viewpoint],
        most: usize,
    ) -> Cut {
        self.learn(world, cut.grid(), cut.nodes());
        let target = {
            let facts = self.read();
            choice.cut(cut, eyes, |node| {
                let known = facts.get(&node).copied();
                known.map_or(NodeFacts::default(), |GroundFacts { heights, error }| NodeFacts {
                    heights,
                    error,
                    has_edits: world.is_edited(node),
                })
            })
        };
        let nearest = |node: Node| {
            let (low, high) = cut.grid().columns(node);
            // However high it is.
            let low = Vec3::new(low.x as f32, f32::NEG_INFINITY, low.z as f32);
            let high = Vec3::new(high.x as f32, f32::INFINITY, high.z as f32);
            let distances = eyes.iter().map(|eye| eye.distance(low, high));
            distances.fold(f32::INFINITY, f32::min) as u64
        };
        let mut next = cut.clone();
        let step = next.step_to(&target, most, nearest).unwrap_or_default();
        self.learn(world, cut.grid(), step.new.iter().copied());
        let changed = next.nodes().filter(|&node| !target.contains(node)).count();
        self.waiting.store(changed.max(step.new.len()), Ordering::Relaxed);
        self.forget(&next, KEPT_NODES);
        next
    }

    /// Forgets nodes that are neither in this cut nor above it, once more than `most` and many more than these are known.
    fn forget(&self, cut: &Cut, most: usize) {
        if self.read().len() > most.max(8 * cut.nodes().count()) {
            let mut facts = self.facts.write().unwrap_or_else(PoisonError::into_inner);
            facts.retain(|&node, _| cut.contains(node) || cut.is_split(node));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::Ground;
    use crate::terrain::{Terrain, TerrainSettings};

    #[test]
    fn nodes_that_are_not_drawn_are_forgotten_once_there_are_many() {
        let settings = TerrainSettings { chunk_size: 8, ..TerrainSettings::default() };
        let terrain = Terrain::new(Ground::flat(320, 270, 8.0).unwrap(), &settings).unwrap();
        let (world, known) = (terrain.world(), KnownNodes::default());
        let grid = world.lod_grid(u8::MAX);
        let (coarse, fine) = (Cut::coarsest(grid), Cut::new(grid, |_| true));
        known.learn(world, grid, coarse.nodes().chain(fine.nodes()));
        let all = known.read().len();
        known.forget(&coarse, all);
        known.forget(&fine, 0);
        assert_eq!(known.read().len(), all, "few are known, or all are needed");
        known.forget(&coarse, 0);
        let mut rest: Vec<Node> = known.read().keys().copied().collect();
        let mut drawn: Vec<Node> = coarse.nodes().collect();
        rest.sort_unstable();
        drawn.sort_unstable();
        assert_eq!(rest, drawn);
    }
}
