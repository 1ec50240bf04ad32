//! One material for a terrain, whichever it is: put it on the terrain's entity.

use std::marker::PhantomData;

use bevy::prelude::*;

use crate::plugin::{BurrowSystems, GroundPiece, hand_on};
use crate::terrain::Terrain;

/// Hands the `MeshMaterial3d<M>` of a terrain's entity on to its tiles and chunks, and again whenever it changes; and to
/// each [`GroundPiece`] once.
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
        hand_on::<MeshMaterial3d<M>>(app);
        app.add_systems(Update, dress_pieces::<M>.in_set(BurrowSystems::Dress));
    }
}

fn dress_pieces<M: Material>(
    mut commands: Commands,
    bare: Query<(Entity, &GroundPiece), Without<MeshMaterial3d<M>>>,
    terrains: Query<&MeshMaterial3d<M>, With<Terrain>>,
) {
    for (entity, piece) in &bare {
        if let Ok(material) = terrains.get(piece.terrain) {
            commands.entity(entity).try_insert(material.clone());
        }
    }
}
