//! The world in levels: meshes of the nodes of a cut, and what a choice of cuts must know of them.

use crate::ground::Ground;
use crate::lattice::ONE;
use crate::lod::{Cut, LodGrid, Node, NodeFacts};
use crate::surface::lod::{self, LodView, Stacks};
use crate::surface::{SeamChecker, SeamReport, SurfaceMesh};
use crate::world::World;

/// Greatest width of a node in voxels: up to this width, 1/4096 of a voxel is exact in `f32`.
const WIDEST: i32 = 4096;

/// The part of a node's [`NodeFacts`] that depends on the ground alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroundFacts {
    /// The node's lowest and highest point, in voxels.
    pub heights: [f32; 2],
    /// Greatest distance of the node's heightmap from the heights at half its stride, in voxels; 0 at level 0.
    pub error: f32,
}

impl GroundFacts {
    /// Computes the facts of a node.
    pub fn new(ground: &Ground, grid: LodGrid, node: Node) -> Self {
        if !grid.has(node) {
            return Self::default();
        }
        let ((low, high), stride) = (grid.columns(node), node.stride());
        let half = (stride / 2).max(1);
        let cells = [high.x - low.x, high.z - low.z].map(|width| (width + stride - 1) / stride);
        let [across, down] = cells.map(|cells| (cells * (stride / half)) as usize + 1);
        let heights = ground.page_heights(low, half, [across, down]);
        let (lowest, highest) =
            heights.iter().fold((i32::MAX, i32::MIN), |(low, high), &h| (low.min(h), high.max(h)));
        let height = |x: usize, z: usize| heights[z * across + x];
        // Twice the greatest distance.
        let mut error = 0;
        if half < stride {
            for (z, x) in
                (0..down - 1).step_by(2).flat_map(|z| (0..across - 1).step_by(2).map(move |x| (z, x)))
            {
                let [a, b, c, d] = [(0, 0), (0, 2), (2, 2), (2, 0)].map(|(dx, dz)| height(x + dx, z + dz));
                let middles =
                    [(a, b, (0, 1)), (b, c, (1, 2)), (c, d, (2, 1)), (d, a, (1, 0)), (a, c, (1, 1))];
                for (from, to, (dx, dz)) in middles {
                    error = error.max((from + to).abs_diff(2 * height(x + dx, z + dz)));
                }
            }
        }
        let voxels = |height: i32| height as f32 / ONE as f32;
        Self { heights: [voxels(lowest), voxels(highest)], error: error as f32 / (2 * ONE) as f32 }
    }
}

impl World {
    /// The quadtree over the world's tiles, with levels up to `top`; fewer where one node would cover the world or be
    /// wider than 4,096 voxels.
    pub fn lod_grid(&self, top: u8) -> LodGrid {
        let widest = (0..=top).take_while(|&level| i64::from(self.grid.size()) << level <= i64::from(WIDEST));
        LodGrid::new(self.grid, widest.last().unwrap_or_default())
    }

    /// Where edits are.
    pub(crate) fn edited_stacks(&self) -> Stacks<'_> {
        Stacks::new(&self.stacks)
    }

    /// The world as a cut draws it.
    pub(crate) fn lod_view<'a>(&'a self, cut: &'a Cut) -> LodView<'a> {
        LodView::new(self.view(), cut, self.edited_stacks())
    }

    /// Returns `true` if the cut was made for a world of this size.
    pub(crate) fn has_cut(&self, cut: &Cut) -> bool {
        cut.grid().chunks() == self.grid
    }

    /// The mesh of a node of a cut, relative to its lowest column at y = 0. What it draws depends on the nodes of the
    /// cut that touch it. Empty where the world has no such node, or if the cut is of a world of another size.
    pub fn node_mesh(&self, cut: &Cut, node: Node) -> SurfaceMesh {
        if self.has_cut(cut) { lod::node_mesh(&self.lod_view(cut), node) } else { SurfaceMesh::default() }
    }

    /// Returns `true` if a node of level 0 is drawn by [its tile](Self::tile_mesh) and [the
    /// chunks](Self::chunk_mesh) below it, unchanged.
    pub fn is_plain(&self, cut: &Cut, node: Node) -> bool {
        self.has_cut(cut) && lod::is_plain(&self.lod_view(cut), node)
    }

    /// Everything that a cut draws: its nodes in order, each with its mesh.
    pub fn drawn_in<'a>(&'a self, cut: &'a Cut) -> impl Iterator<Item = (Node, SurfaceMesh)> + 'a {
        let mut nodes: Vec<Node> = cut.nodes().collect();
        nodes.sort_unstable();
        nodes.into_iter().map(|node| (node, self.node_mesh(cut, node)))
    }

    /// Checks that everything that a cut draws is one closed surface. Visits each triangle of the cut.
    ///
    /// Where four nodes meet whose levels go fine, coarse, fine, coarse, an edge may serve four triangles. Triangles
    /// without area may lie in the planes between levels.
    pub fn check_seams_in(&self, cut: &Cut) -> SeamReport {
        let mut checker = SeamChecker::default();
        for (node, mesh) in self.drawn_in(cut) {
            checker.add(&mesh, cut.grid().columns(node).0.at(0));
        }
        checker.check(self.grid)
    }

    /// The properties of a node that a choice depends on.
    pub fn node_facts(&self, grid: LodGrid, node: Node) -> NodeFacts {
        let GroundFacts { heights, error } = GroundFacts::new(&self.ground, grid, node);
        NodeFacts { heights, error, has_edits: self.has_edits(grid, node) }
    }

    /// Returns `true` if a node contains edits.
    pub fn has_edits(&self, grid: LodGrid, node: Node) -> bool {
        let (low, high) = grid.columns(node);
        grid.has(node) && self.edited_stacks().has_any(low, high)
    }
}
