//! Regions: the parts of a world that are saved separately.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::lattice::{BrickPos, ChunkPos};
use crate::volume::{Brick, Fields, NO_FIELDS};
use crate::world::{Patch, Positions, State};

/// The content of a region's record.
#[derive(Clone, Debug, Default)]
pub(in crate::store) struct Region {
    /// The region's bricks.
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

    /// The positions at which it holds something.
    pub fn positions(&self) -> Positions {
        Positions {
            bricks: self.bricks.keys().copied().collect(),
            chunks: self.fields.keys().copied().collect(),
        }
    }

    /// Puts the parts of a patch in place.
    pub fn apply(&mut self, patch: Patch) {
        for (pos, brick) in patch.bricks {
            match brick {
                Some(brick) => drop(self.bricks.insert(pos, brick)),
                None => drop(self.bricks.remove(&pos)),
            }
        }
        for (chunk, fields) in patch.fields {
            match fields.is_empty() {
                false => drop(self.fields.insert(chunk, fields)),
                true => drop(self.fields.remove(&chunk)),
            }
        }
    }
}

impl State for Region {
    fn brick(&self, pos: BrickPos) -> Option<&Arc<Brick>> {
        self.bricks.get(&pos)
    }

    fn fields(&self, chunk: ChunkPos) -> &Fields {
        self.fields.get(&chunk).unwrap_or(&NO_FIELDS)
    }
}
