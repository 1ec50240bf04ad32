//! Levels of detail: chooses how coarsely each square of the world is drawn.
//!
//! A world is a quadtree of [`Node`]s. A node of level 0 is a tile; one of level L covers as many cells, each 2^L
//! voxels wide. A [`Cut`] is the set of drawn nodes: they cover the world once, and nodes that share an edge differ by
//! at most one level. [`LodSettings`] computes the cut for a set of viewpoints, and [`Cut::step_to`] leads from one cut
//! to another without violating that rule.
//!
//! Nothing here knows heights or meshes: the roughness of nodes is an input.

mod choice;
mod cut;
mod node;
mod steps;

pub use choice::{LodSettings, NodeFacts, View, Viewpoint};
pub use cut::Cut;
pub use node::{LodGrid, Node};
pub use steps::Step;
