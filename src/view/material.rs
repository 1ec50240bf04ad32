//! One material for a terrain, whichever it is: put it on the terrain's entity.

use std::marker::PhantomData;

use bevy::prelude::*;

use crate::plugin::{BurrowSystems, Chunk, GroundPiece, Tile};
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
        hand_on::<M>(app);
        app.add_systems(Update, dress_pieces::<M>.in_set(BurrowSystems::Dress));
    }
}

/// Has tiles and chunks dressed, and no pieces: for a material that pieces do not share with their terrain.
pub(super) fn hand_on<M: Material>(app: &mut App) {
    app.add_systems(
        Update,
        (undress::<M>, dress_new::<M>, dress_all::<M>).chain().in_set(BurrowSystems::Dress),
    );
}

/// A tile or chunk that just came.
type New = (Or<(With<Tile>, With<Chunk>)>, Or<(Added<Tile>, Added<Chunk>)>);

fn undress<M: Material>(
    mut commands: Commands,
    mut removed: RemovedComponents<MeshMaterial3d<M>>,
    terrains: Query<&Children, (With<Terrain>, Without<MeshMaterial3d<M>>)>,
    drawn: Query<(), Or<(With<Tile>, With<Chunk>)>>,
) {
    for children in removed.read().filter_map(|entity| terrains.get(entity).ok()) {
        for child in children.iter().filter(|&child| drawn.contains(child)) {
            commands.entity(child).try_remove::<MeshMaterial3d<M>>();
        }
    }
}

fn dress_new<M: Material>(
    mut commands: Commands,
    new: Query<(Entity, &ChildOf), New>,
    terrains: Query<&MeshMaterial3d<M>, With<Terrain>>,
) {
    for (entity, parent) in &new {
        if let Ok(material) = terrains.get(parent.parent()) {
            commands.entity(entity).try_insert(material.clone());
        }
    }
}

fn dress_all<M: Material>(
    mut commands: Commands,
    terrains: Query<(&MeshMaterial3d<M>, &Children), (With<Terrain>, Changed<MeshMaterial3d<M>>)>,
    drawn: Query<(), Or<(With<Tile>, With<Chunk>)>>,
) {
    for (material, children) in &terrains {
        for child in children.iter().filter(|&child| drawn.contains(child)) {
            commands.entity(child).try_insert(material.clone());
        }
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
