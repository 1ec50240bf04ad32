//! From one cut to another in small steps, each of which is a cut too.

use std::collections::BTreeSet;

use rustc_hash::{FxHashMap, FxHashSet};

use super::{Cut, Node};

/// One step: some nodes split or merged, and the meshes that change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Step {
    /// Nodes that are no longer drawn.
    pub gone: Vec<Node>,
    /// Nodes that are drawn from now on.
    pub new: Vec<Node>,
    /// Nodes that stay, but touch one that changed.
    pub touched: Vec<Node>,
}

impl Step {
    /// Sorts its nodes, each of which it lists once then.
    fn sort(&mut self) {
        for list in [&mut self.gone, &mut self.new, &mut self.touched] {
            list.sort_unstable();
            list.dedup();
        }
    }

    /// Meshes that it makes.
    pub fn mesh_count(&self) -> usize {
        self.new.len() + self.touched.len()
    }
}

impl Cut {
    /// Takes one step towards another cut of the same quadtree; `None` once they are equal.
    ///
    /// It makes `max_meshes` meshes at most, or more if a single split or merge does. Nodes with a small `rank` are
    /// split first and merged last. Nodes are merged first while there are more of them than the other cut has, so that
    /// on the way there are at most three more than at one of its ends.
    pub fn step_to(&mut self, other: &Self, max_meshes: usize, rank: impl Fn(Node) -> u64) -> Option<Step> {
        // Most steps lead all the way.
        let all = self.changes_to(other);
        if all.mesh_count() <= max_meshes {
            self.clone_from(other);
            return (!all.new.is_empty()).then_some(all);
        }
        let before = self.clone();
        let mut way = Way::new(self, other, rank);
        let mut step = DraftStep::default();
        while let Some((node, is_split)) = way.next(self) {
            let gone = self.nodes_within(node);
            if is_split {
                self.split(node);
            } else {
                self.merge(node);
            }
            let new = self.nodes_within(node);
            let mut touched = self.touching(node);
            touched.retain(|&near| before.contains(near));
            if !step.new.is_empty() && step.mesh_count_with(&gone, &new, &touched) > max_meshes {
                // Taken back.
                if is_split {
                    self.merge(node);
                } else {
                    self.split(node);
                }
                break;
            }
            way.pass(node, is_split, new.len() as isize - gone.len() as isize);
            step.add(gone, new, touched);
        }
        (!step.new.is_empty()).then(|| step.finish())
    }

    /// All differences from another cut of the same quadtree.
    pub fn changes_to(&self, other: &Self) -> Step {
        let mut step = Step {
            gone: self.nodes().filter(|&node| !other.contains(node)).collect(),
            new: other.nodes().filter(|&node| !self.contains(node)).collect(),
            touched: Vec::new(),
        };
        let touching = step.new.iter().flat_map(|&node| other.touching(node));
        step.touched = touching.filter(|&near| self.contains(near)).collect();
        step.sort();
        step
    }

    /// The node itself, or one above that must be split first.
    fn first_to_split(&self, mut node: Node) -> Node {
        while let Some(above) = self.required_by(node).find(|&other| !self.is_split(other)) {
            node = above;
        }
        node
    }

    /// The node itself, or one below that must be merged first.
    fn first_to_merge(&self, mut node: Node) -> Node {
        while let Some(below) = self.splits_that_require(node).next() {
            node = below;
        }
        node
    }
}

/// What is left to do from one cut to another. Nodes that are split or merged on the way stay so, hence all that there
/// is to do is known from the beginning.
struct Way {
    /// Nodes to be split and to be merged by their rank; those of equal rank in order, so that no order of a hash set
    /// shows.
    to_split: BTreeSet<(u64, Node)>,
    to_merge: BTreeSet<(u64, Node)>,
    ranks: FxHashMap<Node, u64>,
    /// How many nodes there are more than the other cut has.
    excess: isize,
}

impl Way {
    fn new(cut: &Cut, other: &Cut, rank: impl Fn(Node) -> u64) -> Self {
        let mut ranks = FxHashMap::default();
        let mut ranked = |nodes: &mut dyn Iterator<Item = Node>| {
            let ranked = nodes.map(|node| {
                let rank = rank(node);
                ranks.insert(node, rank);
                (rank, node)
            });
            ranked.collect::<BTreeSet<_>>()
        };
        let to_split = ranked(&mut other.split_nodes().filter(|&node| !cut.is_split(node)));
        let to_merge = ranked(&mut cut.split_nodes().filter(|&node| !other.is_split(node)));
        let excess = cut.nodes().count() as isize - other.nodes().count() as isize;
        Self { to_split, to_merge, ranks, excess }
    }

    /// The next node to be split, or to be merged.
    fn next(&self, cut: &Cut) -> Option<(Node, bool)> {
        let nearest = self.to_split.first().map(|&(_, node)| node);
        let farthest = self.to_merge.last().map(|&(_, node)| node);
        match (nearest, farthest) {
            (Some(node), farthest) if farthest.is_none() || self.excess <= 0 => {
                Some((cut.first_to_split(node), true))
            }
            (_, Some(node)) => Some((cut.first_to_merge(node), false)),
            _ => None,
        }
    }

    /// Records that a node was split or merged, and how many more nodes there are since.
    fn pass(&mut self, node: Node, is_split: bool, more: isize) {
        self.excess += more;
        if let Some(&rank) = self.ranks.get(&node) {
            let list = if is_split { &mut self.to_split } else { &mut self.to_merge };
            list.remove(&(rank, node));
        }
    }
}

/// A step as far as it is known.
#[derive(Default)]
struct DraftStep {
    gone: FxHashSet<Node>,
    new: FxHashSet<Node>,
    touched: FxHashSet<Node>,
}

impl DraftStep {
    /// The meshes that it makes once nodes are gone, others are new, and these touch them.
    fn mesh_count_with(&self, gone: &[Node], new: &[Node], touched: &[Node]) -> usize {
        let without =
            |own: &FxHashSet<Node>| own.len() - gone.iter().filter(|node| own.contains(*node)).count();
        let more = touched.iter().filter(|node| !self.touched.contains(*node)).count();
        without(&self.new) + new.len() + without(&self.touched) + more
    }

    fn add(&mut self, gone: Vec<Node>, new: Vec<Node>, touched: Vec<Node>) {
        for node in gone {
            self.touched.remove(&node);
            if !self.new.remove(&node) {
                self.gone.insert(node);
            }
        }
        self.new.extend(new);
        self.touched.extend(touched);
    }

    fn finish(self) -> Step {
        let list = |nodes: FxHashSet<Node>| nodes.into_iter().collect::<Vec<Node>>();
        let mut step = Step { gone: list(self.gone), new: list(self.new), touched: list(self.touched) };
        step.sort();
        step
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::LodGrid;
    use super::super::cut::hash_node;
    use super::super::cut::tests::{assert_is_cut, random_cut};
    use super::*;
    use crate::lattice::ChunkGrid;

    proptest! {
        #[test]
        fn steps_lead_from_cut_to_cut(
            width in 30i32..300, depth in 30i32..300, top in 1u8..6, seeds: [u64; 2], percents in [0u64..100, 0u64..100],
            most in 1usize..40,
        ) {
            let grid = LodGrid::new(ChunkGrid::new(8, width, depth), top);
            let [mut cut, target] = [0, 1].map(|at| random_cut(grid, seeds[at], percents[at]));
            let max_nodes = cut.nodes().count().max(target.nodes().count() + 3);
            let mut before = cut.clone();
            while let Some(step) = cut.step_to(&target, most, |node| hash_node(node, 5) % 64) {
                assert_is_cut(&cut);
                prop_assert!(cut.nodes().count() <= max_nodes);
                let sorted = |nodes: &mut dyn Iterator<Item = Node>| {
                    let mut nodes: Vec<Node> = nodes.collect();
                    nodes.sort_unstable();
                    nodes
                };
                prop_assert_eq!(&step.gone, &sorted(&mut before.nodes().filter(|&node| !cut.contains(node))));
                prop_assert_eq!(&step.new, &sorted(&mut cut.nodes().filter(|&node| !before.contains(node))));
                let is_touched = |node: &Node| {
                    before.contains(*node) && step.new.iter().chain(&step.gone).any(|&other| node.touches(other))
                };
                prop_assert_eq!(&step.touched, &sorted(&mut cut.nodes().filter(is_touched)));
                prop_assert_eq!(&step, &before.changes_to(&cut));
                before = cut.clone();
            }
            prop_assert_eq!(cut, target);
        }
    }

    proptest! {
        // Each case takes thousands of steps.
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn a_step_makes_few_meshes_unless_one_change_makes_more(seeds: [u64; 2], most in 16usize..60) {
            let grid = LodGrid::new(ChunkGrid::new(8, 500, 400), 5);
            let [mut cut, target] = seeds.map(|seed| random_cut(grid, seed, 70));
            while let Some(step) = cut.step_to(&target, most, |_| 0) {
                let is_single = step.new.len() == 1 || step.gone.len() == 1;
                prop_assert!(step.mesh_count() <= most || is_single, "{step:?}");
            }
        }
    }
}
