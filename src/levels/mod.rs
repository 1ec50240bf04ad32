//! Levels of detail: which squares of the world are drawn how coarsely.
//!
//! A world is a quadtree of [`Node`]s. A node of level 0 is a tile; one of level L covers as many cells, each 2^L voxels wide.
//! A [`Cut`] is what is drawn: nodes that cover the world once, where those that share an edge differ by at most one level.
//! [`Choice`] says which cut an eye needs, and [`Cut::step_to`] leads from one cut to another without ever leaving
//! that rule.
//!
//! Nothing here knows heights or meshes: how rough a node is, it is told.

mod choice;
mod cut;
mod node;
mod steps;

pub use choice::{Choice, Eye, NodeFacts, View};
pub use cut::Cut;
pub use node::{LevelGrid, Node};
pub use steps::Step;
