//! A material of any type for a terrain.

use std::marker::PhantomData;

use bevy::prelude::*;

use super::vertex::VertexPlugin;
use crate::plugin::propagate_material;

/// Propagates the `MeshMaterial3d<M>` of a terrain's entity to its tiles, chunks and
/// [pieces](crate::plugin::GroundPiece), also when it changes or is removed. A piece that is spawned with its own keeps
/// it until the terrain's changes.
///
/// A terrain is drawn with one material: the one of a [`GroundLook`](super::GroundLook) before any other, or else the
/// one whose plugin was added last. A warning names the others.
///
/// `BurrowPlugins` contain it for `StandardMaterial`; add it for each material type of your own, before or after Bevy's
/// plugins. Vertex colours carry the terrain's [`MaterialColors`](crate::plugin::MaterialColors); the attributes
/// [`Terrain::ATTRIBUTE_MATERIAL_IDS`](crate::terrain::Terrain::ATTRIBUTE_MATERIAL_IDS) and
/// [`Terrain::ATTRIBUTE_MATERIAL_WEIGHTS`](crate::terrain::Terrain::ATTRIBUTE_MATERIAL_WEIGHTS) are there for shaders.
/// A material with a vertex shader of its own also needs [`prepass_vertex_shader`](super::prepass_vertex_shader).
pub struct TerrainMaterialPlugin<M: Material>(PhantomData<fn() -> M>);

impl<M: Material> Default for TerrainMaterialPlugin<M> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<M: Material> Plugin for TerrainMaterialPlugin<M> {
    fn build(&self, app: &mut App) {
        VertexPlugin::add_once(app);
        propagate_material::<M>(app);
    }
}
