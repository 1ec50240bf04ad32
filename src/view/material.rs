//! One material for a terrain, whichever it is: put it on the terrain's entity.

use std::marker::PhantomData;

use bevy::prelude::*;

use crate::plugin::propagate_with_pieces;

/// Hands the `MeshMaterial3d<M>` of a terrain's entity on to its tiles, chunks and
/// [pieces](crate::plugin::GroundPiece), again whenever it changes, and takes it off with the terrain's. A piece that comes
/// with its own keeps that until the terrain's changes.
///
/// `BurrowPlugins` has it for `StandardMaterial`; add it for each material type of your own, before or after Bevy's
/// plugins. Vertex colours carry the terrain's [`MaterialColors`](crate::plugin::MaterialColors); the attributes
/// [`ATTRIBUTE_MATERIAL_IDS`](crate::plugin::ATTRIBUTE_MATERIAL_IDS) and
/// [`ATTRIBUTE_MATERIAL_WEIGHTS`](crate::plugin::ATTRIBUTE_MATERIAL_WEIGHTS) are there for shaders.
pub struct TerrainMaterialPlugin<M: Material>(PhantomData<fn() -> M>);

impl<M: Material> Default for TerrainMaterialPlugin<M> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<M: Material> Plugin for TerrainMaterialPlugin<M> {
    fn build(&self, app: &mut App) {
        propagate_with_pieces::<MeshMaterial3d<M>>(app);
    }
}
