//! Which meshes change with a world, and their new surfaces.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `by_brick`, `dirty` | from changed samples to cells, mask words and blocks |
//! | `updates` | chunks and tiles that change, and their meshes |
//! | `tiles`, `source` | tiles; what a mesh is made from |
//! | `cut`, `nodes` | the cut that is drawn, and the nodes that change |
//! | `relit` | surfaces whose light changes, but not their shape |
//! | `node_facts`, `known_nodes` | facts about nodes by which a cut is chosen |
//! | `stages` | how long each stage took |

mod by_brick;
mod cut;
mod dirty;
mod known_nodes;
mod node_facts;
mod nodes;
mod relit;
mod source;
mod stages;
mod tiles;
mod updates;

pub(crate) use by_brick::ByBrick;
pub use cut::{ChooseCut, DrawnCut, NodeUpdate};
pub(crate) use dirty::{dirty_cells, joined_mask};
pub use known_nodes::KnownNodes;
pub use node_facts::GroundFacts;
pub(crate) use nodes::change_cut;
#[cfg_attr(not(feature = "plugin"), allow(unused_imports))]
pub(crate) use relit::{relit_nodes, relit_parts};
#[cfg(feature = "plugin")]
pub(crate) use source::SurfaceDraft;
pub use source::TileUpdate;
pub use stages::Stages;
pub use updates::MeshUpdates;
pub(crate) use updates::{Scene, updates};
