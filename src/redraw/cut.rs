//! The drawn nodes of a world with levels of detail, and the updates by a commit.
//!
//! A node of a coarser level has one mesh. A node of level 0 is drawn by its tile and chunks, as without levels, or
//! where the seam towards a coarser node needs it, by one mesh that holds all of them.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use rustc_hash::FxHashSet;

use super::source::SurfaceDraft;
use crate::lattice::TilePos;
use crate::lod::{Cut, Node};
use crate::surface::SurfaceMesh;
use crate::world::{MeshKey, World};

/// The drawn part of a world: the nodes of a cut.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DrawnCut {
    pub(crate) cut: Cut,
    /// Nodes of level 0 that are drawn as one mesh.
    pub(crate) joined: FxHashSet<TilePos>,
}

impl DrawnCut {
    /// The nodes of the cut.
    pub fn cut(&self) -> &Cut {
        &self.cut
    }

    /// Whether a tile and its chunks are drawn as separate meshes.
    pub fn shows_parts(&self, tile: TilePos) -> bool {
        self.cut.contains(Node::over(tile, 0)) && !self.joined.contains(&tile)
    }
}

/// The meshes of a node after a commit.
#[derive(Clone)]
pub struct NodeUpdate {
    /// The node.
    pub node: Node,
    /// The node's own mesh, relative to its lowest column at y = 0; `None` if the node is drawn by its tile and chunks,
    /// or not at all.
    pub mesh: Option<Arc<SurfaceMesh>>,
    /// Tile and chunks that are drawn from now on.
    pub(crate) shown: Vec<(MeshKey, SurfaceDraft)>,
    /// Tile and chunks that may have been drawn before and no longer are.
    pub hidden: Vec<MeshKey>,
}

impl NodeUpdate {
    /// The tile and chunks that are drawn from now on, with their surfaces.
    pub fn shown(&self) -> impl Iterator<Item = (MeshKey, Cow<'_, SurfaceMesh>)> {
        self.shown.iter().map(|(drawn, draft)| (*drawn, draft.surface()))
    }
}

impl fmt::Debug for NodeUpdate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("NodeUpdate")
            .field("node", &self.node)
            .field("has_mesh", &self.mesh.is_some())
            .field("shown", &self.shown.len())
            .field("hidden", &self.hidden)
            .finish()
    }
}

/// Chooses the next cut from the world and the cut that is drawn; called in the transaction.
pub type ChooseCut = dyn Fn(&World, &Cut) -> Cut + Send + Sync;

impl DrawnCut {
    /// The state after these updates have been applied, for a new cut.
    pub(crate) fn after(&self, cut: Cut, updates: &[NodeUpdate]) -> Self {
        let mut joined = self.joined.clone();
        for update in updates.iter().filter(|update| update.node.level == 0) {
            if update.mesh.is_some() {
                joined.insert(update.node.tile());
            } else {
                joined.remove(&update.node.tile());
            }
        }
        Self { cut, joined }
    }
}
