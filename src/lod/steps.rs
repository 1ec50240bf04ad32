//! From one cut to another in small steps, each of which is a cut too.

use super::{Cut, Node};

/// One step: some nodes split or merged, and the meshes that change.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Step {
    /// Nodes that are drawn no more.
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
    /// It makes `most_meshes` meshes at most, or more if a single split or merge does. Nodes with a small `rank` are
    /// split first and merged last. Nodes are merged first while there are more of them than the other cut has, so that
    /// on the way there are at most three more than at one of its ends.
    pub fn step_to(&mut self, other: &Self, most_meshes: usize, rank: impl Fn(Node) -> u64) -> Option<Step> {
        // Most steps lead all the way.
        let all = self.changes_to(other);
        if all.mesh_count() <= most_meshes {
            self.clone_from(other);
            return (!all.new.is_empty()).then_some(all);
        }
        let before = self.clone();
        let mut changed = Vec::new();
        let mut step = Step::default();
        while let Some((node, is_split)) = self.next_change(other, &rank) {
            let undone = self.clone();
            if is_split {
                self.split(node);
            } else {
                self.merge(node);
            }
            changed.push(node);
            let longer = self.step_from(&before, &changed);
            if changed.len() > 1 && longer.mesh_count() > most_meshes {
                *self = undone;
                break;
            }
            step = longer;
        }
        (!step.new.is_empty()).then_some(step)
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

    /// The next node to be split, or to be merged.
    fn next_change(&self, other: &Self, rank: impl Fn(Node) -> u64) -> Option<(Node, bool)> {
        let to_split = other.split_nodes().filter(|&node| !self.is_split(node));
        let to_merge = self.split_nodes().filter(|&node| !other.is_split(node));
        // Nodes of equal rank in order, so that no order of a hash set shows.
        let nearest = to_split.min_by_key(|&node| (rank(node), node));
        let farthest = to_merge.max_by_key(|&node| (rank(node), node));
        let has_more = self.nodes().count() > other.nodes().count();
        match (nearest, farthest) {
            (Some(node), farthest) if farthest.is_none() || !has_more => {
                Some((self.first_to_split(node), true))
            }
            (_, Some(node)) => Some((self.first_to_merge(node), false)),
            _ => None,
        }
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

    /// The nodes to draw again after these nodes changed.
    fn step_from(&self, before: &Self, changed: &[Node]) -> Step {
        let mut step = Step::default();
        for &node in changed {
            for near in before.nodes_within(node) {
                if !self.contains(near) {
                    step.gone.push(near);
                }
            }
            for near in self.nodes_within(node) {
                if !before.contains(near) {
                    step.new.push(near);
                }
            }
            step.touched.extend(self.touching(node).into_iter().filter(|&near| before.contains(near)));
        }
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
            let most_nodes = cut.nodes().count().max(target.nodes().count() + 3);
            let mut before = cut.clone();
            while let Some(step) = cut.step_to(&target, most, |node| hash_node(node, 5) % 64) {
                assert_is_cut(&cut);
                prop_assert!(cut.nodes().count() <= most_nodes);
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
