//! Regions: the parts of a world that are saved separately.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::lattice::{BrickPos, ChunkPos};
use crate::volume::{Brick, Fields};

/// The content of a region's record.
#[derive(Clone, Debug, Default)]
pub(super) struct Region {
    /// Its bricks.
    pub bricks: BTreeMap<BrickPos, Arc<Brick>>,
    /// The fields of the chunks whose lowest corners lie in it.
    pub fields: BTreeMap<ChunkPos, Fields>,
    /// The revision that changed it last.
    pub revision: u64,
    /// Whether it has a record. A region that equals the level below has none.
    pub is_stored: bool,
}

impl Region {
    /// Whether it holds neither bricks nor fields.
    pub fn is_empty(&self) -> bool {
        self.bricks.is_empty() && self.fields.is_empty()
    }
}
