//! A cache of facts about the nodes of a world's quadtree, and the choice of cuts from them.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard};

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
    settled: Mutex<Option<Settled>>,
}

/// What a cut was chosen from that stayed as it was: chosen from the same again, it stays so again. After most digs,
/// nothing else has to be looked at, however many nodes there are.
#[derive(PartialEq)]
struct Settled {
    cut: Cut,
    choice: LodSettings,
    eyes: Vec<Viewpoint>,
    edited_nodes: u64,
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

    fn settled(&self) -> MutexGuard<'_, Option<Settled>> {
        self.settled.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn read(&self) -> RwLockReadGuard<'_, FxHashMap<Node, GroundFacts>> {
        self.facts.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// One step of `most` meshes at most, or of one change, towards the cut that these eyes need. Nodes that were not
    /// drawn yet, and so are not known, are not split: what is coarse comes first.
    pub fn next_cut(
        &self,
        world: &World,
        cut: &Cut,
        choice: &LodSettings,
        eyes: &[Viewpoint],
        most: usize,
    ) -> Cut {
        let now = Settled {
            cut: cut.clone(),
            choice: choice.clone(),
            eyes: eyes.to_vec(),
            edited_nodes: world.edited_nodes_version(),
        };
        if self.settled().as_ref() == Some(&now) {
            return now.cut;
        }
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
        *self.settled() = (next == *cut).then_some(now);
        next
    }

    /// Forgets nodes that are neither in this cut nor above it, once more than `most` and many more than these are
    /// known.
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
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;
    use crate::lod::View;
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

    /// What was chosen before has no influence beyond the cut itself.
    #[test]
    fn a_cut_is_chosen_as_if_none_had_been_chosen_before() {
        let settings = TerrainSettings { chunk_size: 8, ..TerrainSettings::default() };
        let mut terrain = Terrain::new(Ground::flat(320, 270, 40.0).unwrap(), &settings).unwrap();
        let grid = terrain.world().lod_grid(u8::MAX);
        let all = || {
            (0..=grid.top()).flat_map(move |level| {
                Cut::new(grid, move |node| node.level > level).nodes().collect::<Vec<_>>()
            })
        };
        let fresh = |world: &World| {
            let known = KnownNodes::default();
            known.learn(world, grid, all());
            known
        };
        let known = fresh(terrain.world());
        let mut choice = LodSettings::default();
        let mut eye = Viewpoint {
            position: Vec3::new(160.0, 60.0, 140.0),
            velocity: Vec3::ZERO,
            pixels: 60.0,
            view: View::Perspective,
        };
        let (mut cut, mut rng) = (Cut::coarsest(grid), fastrand::Rng::with_seed(6));
        let (mut same, mut changed) = (0, 0);
        for _ in 0..300 {
            match rng.u32(0..8) {
                0 => eye.position.x = rng.f32() * 320.0,
                1 => choice.edited_pixels = 2.0 + 6.0 * rng.f32(),
                2 => {
                    let at = Vec3::new(rng.f32() * 320.0, 40.0, rng.f32() * 270.0);
                    terrain.apply([Brush::dig(Shape::sphere(at, 3.0))]);
                }
                3 => drop(terrain.undo()),
                _ => {}
            }
            let world = terrain.world();
            let next = known.next_cut(world, &cut, &choice, &[eye], 40);
            assert_eq!(next, fresh(world).next_cut(world, &cut, &choice, &[eye], 40));
            *(if next == cut { &mut same } else { &mut changed }) += 1;
            cut = next;
        }
        assert!(same > 30 && changed > 30, "{same} and {changed}");
    }
}
