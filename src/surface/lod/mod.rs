//! Nodes of a quadtree cut, drawn so that everything drawn together is closed.
//!
//! Rules 1 to 6 apply at each level, on that level's lattice; three more rules close the gaps between levels:
//!
//! 7. **Fan.** At an undisturbed interval, where the side of a coarse cell meets two finer ones, the coarse cell fans
//!    over the line of its finer neighbours (`drawing`). Where it is volumetric, a zipper joins both lines. A disturbed
//!    interval makes the cells along it volumetric, on both sides (`volumetric`), and is closed by walls (`walls`).
//! 8. **Descent.** The vertex of a lattice edge with an edited end is that of its half whose ends differ in sign, down
//!    to an edge of one voxel or one without an edited end (`edge`).
//! 9. **Rim.** A column beyond the rim is the rim's, heights and edits, and is drawn there.
//!
//! The mesh of a node depends on its own level and on the levels of the nodes that touch it. A node of level
//! 0 is drawn by its tile and chunks as they are, unless a coarser node changes its mask (`finest`).

mod builder;
mod drawing;
mod edge;
mod finest;
mod near_bricks;
mod shares;
mod sides;
mod view;
mod volumetric;
mod walls;

pub use near_bricks::Stacks;
pub use view::LodView;

use super::SurfaceMesh;
use crate::lattice::Column;
use crate::lod::{Cut, Node};

/// A rule that is broken on purpose, in tests only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// Rule 7: heightmap cells do not fan over finer borders.
    StraightSides,
    /// Rule 7: no zipper where the coarse cell is volumetric.
    NoZipper,
    /// Rule 7: disturbed intervals promote no cells.
    NoPromotion,
    /// Rule 7: no wall squares.
    NoSquares,
    /// Rule 8: walls interpolate along coarse edges instead of descending.
    LinearWalls,
    /// Rule 8 is left out: closed, but no longer nested.
    NoDescent,
    /// Rule 8: descent ends at the stride of the node, so vertices depend on levels.
    OwnDescent,
    /// Locality: a promoted cell promotes all cells of its node.
    NodePromotion,
    /// Walls are drawn twice from the front and once from behind; closed all the same.
    ThreeCoats,
    /// Where levels meet, each edge has its own vertex, even where another one lies at the same place.
    OwnVertices,
    /// Rule 9: cells that reach over the rim are left out.
    WholeCells,
    /// Rule 9: only the heightmap's vertices are drawn at the rim.
    OverTheRim,
}

/// The mesh of a node, relative to its lowest column at y = 0; empty where the world has no such node.
pub fn node_mesh(view: &LodView, node: Node) -> SurfaceMesh {
    match node.level {
        _ if !view.cut.grid().has(node) => SurfaceMesh::default(),
        0 => finest::mesh(view, node),
        _ => drawing::mesh(view, node),
    }
}

/// Returns `true` if a node is drawn by its tile and the chunks below it, unchanged.
pub fn is_plain(view: &LodView, node: Node) -> bool {
    node.level == 0 && view.cut.grid().has(node) && finest::drawn_mask(view, node).is_none()
}

/// The drawn nodes whose meshes may depend on samples of some columns, both ends included; in order.
pub(crate) fn nodes_near(cut: &Cut, low: Column, high: Column) -> Vec<Node> {
    let (mut found, mut asked) = (Vec::new(), cut.grid().roots().collect::<Vec<Node>>());
    while let Some(node) = asked.pop() {
        let (first, end) = cut.grid().columns(node);
        // Neighbouring cells may be promoted by an interval twice their width; gradients reach one column
        // further.
        let by = 2 * node.stride() + 2;
        let is_near = |low: i32, high: i32, first: i32, end: i32| low <= end + by && first - by <= high;
        if !is_near(low.x, high.x, first.x, end.x) || !is_near(low.z, high.z, first.z, end.z) {
            continue;
        }
        match node.children().filter(|_| cut.is_split(node)) {
            Some(children) => asked.extend(children.into_iter().filter(|&child| cut.grid().has(child))),
            None => found.push(node),
        }
    }
    found.sort_unstable();
    found
}

/// A lattice edge that a node above level 0 has a vertex on, for tests.
#[cfg(test)]
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeVertex {
    /// The edge's lower end, axis and length.
    pub edge: (glam::IVec3, usize, i32),
    /// In 1/4096 voxel.
    pub place: glam::IVec3,
    pub is_pristine: bool,
    /// The half that it descends to lies level and is pristine.
    pub is_half_level: bool,
}

/// The vertices of a node above level 0 that lie on lattice edges.
#[cfg(test)]
pub(crate) fn edge_vertices(view: &LodView, node: Node) -> Vec<EdgeVertex> {
    let mut drawing = drawing::Drawing::new(view, node);
    drawing.draw();
    let of = |(&edge, &number): (&edge::Edge, &builder::Number)| {
        let half = edge.half(view);
        EdgeVertex {
            edge: (edge.p, edge.axis, edge.length),
            place: drawing.builder.position(number) + drawing.origin() * crate::lattice::SNAP,
            is_pristine: edge.is_pristine(view),
            is_half_level: edge.length > 1 && half.axis != 1 && half.is_pristine(view),
        }
    };
    drawing.edges.iter().map(of).collect()
}
