//! What a ground stores for its strata or material function: their records, the materials of the surface, and steep
//! cells.

use super::{OwnMaterials, SteepCells};
use crate::ground::material::MaterialId;

/// What a ground has in addition to the materials of its columns.
#[derive(Clone, PartialEq)]
pub(crate) struct Below {
    pub(super) own: OwnMaterials,
    /// The material of the highest solid voxel of each column, row-major: what the undug surface shows.
    pub(super) tops: Box<[MaterialId]>,
    /// Cells whose tops do not show all materials of their face, if there are any.
    pub(super) steep: Option<Box<SteepCells>>,
}

impl Below {
    pub(crate) fn bytes(&self) -> usize {
        let own = match &self.own {
            OwnMaterials::Strata { given, records } => given.bytes() + records.bytes(),
            OwnMaterials::Function { function, .. } => size_of_val(&**function),
        };
        own + size_of_val(&*self.tops) + self.steep.as_ref().map_or(0, |steep| steep.bytes())
    }
}
