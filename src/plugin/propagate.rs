//! Propagates components from a terrain to its tiles, chunks and pieces: Bevy reads material, layers and shadows from the
//! entity of each mesh, not from the terrain's.
//!
//! Bevy's `HierarchyPropagatePlugin` does not fit: it would also change what a game puts below a terrain, and it would miss
//! pieces that are elsewhere in the hierarchy.

use std::marker::PhantomData;

use bevy::camera::visibility::RenderLayers;
#[cfg(feature = "render")]
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::prelude::*;

use super::{BurrowSystems, Chunk, GroundPiece, Tile};
use crate::terrain::Terrain;

/// Adds the systems that propagate layers and shadows.
pub(super) fn add(app: &mut App) {
    propagate_with_pieces::<RenderLayers>(app);
    #[cfg(feature = "render")]
    {
        propagate_with_pieces::<NotShadowCaster>(app);
        propagate_with_pieces::<NotShadowReceiver>(app);
    }
}

/// Marks a piece whose component of this type comes from its terrain.
#[derive(Component)]
pub(crate) struct Inherited<C: Component>(PhantomData<fn() -> C>);

impl<C: Component> Default for Inherited<C> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

/// Propagates a component of a terrain to its tiles, chunks and pieces.
pub(crate) fn propagate_with_pieces<C: Component + Clone>(app: &mut App) {
    propagate_to_ground::<C>(app);
    app.add_systems(
        Update,
        (remove_from_pieces::<C>, insert_on_pieces::<C>).chain().in_set(BurrowSystems::Propagate),
    );
}

/// Propagates a component of a terrain to its tiles and chunks when it is inserted, changed or removed.
pub(crate) fn propagate_to_ground<C: Component + Clone>(app: &mut App) {
    app.add_systems(
        Update,
        (remove::<C>, insert_on_new::<C>, insert_on_all::<C>).chain().in_set(BurrowSystems::Propagate),
    );
}

/// A tile or chunk.
type Drawn = Or<(With<Tile>, With<Chunk>)>;

/// A tile or chunk that was just spawned.
type New = (Drawn, Or<(Added<Tile>, Added<Chunk>)>);

fn remove<C: Component>(
    mut commands: Commands,
    mut removed: RemovedComponents<C>,
    terrains: Query<&Children, (With<Terrain>, Without<C>)>,
    drawn: Query<(), Drawn>,
) {
    for children in removed.read().filter_map(|entity| terrains.get(entity).ok()) {
        for child in children.iter().filter(|&child| drawn.contains(child)) {
            commands.entity(child).try_remove::<C>();
        }
    }
}

fn insert_on_new<C: Component + Clone>(
    mut commands: Commands,
    new: Query<(Entity, &ChildOf), New>,
    terrains: Query<&C, With<Terrain>>,
) {
    for (entity, parent) in &new {
        if let Ok(own) = terrains.get(parent.parent()) {
            commands.entity(entity).try_insert(own.clone());
        }
    }
}

fn insert_on_all<C: Component + Clone>(
    mut commands: Commands,
    terrains: Query<(&C, &Children), (With<Terrain>, Changed<C>)>,
    drawn: Query<(), Drawn>,
) {
    for (own, children) in &terrains {
        for child in children.iter().filter(|&child| drawn.contains(child)) {
            commands.entity(child).try_insert(own.clone());
        }
    }
}

/// Removes a component from the pieces that inherited it once their terrain no longer has it.
pub(crate) fn remove_from_pieces<C: Component>(
    mut commands: Commands,
    mut removed: RemovedComponents<C>,
    bare: Query<(), (With<Terrain>, Without<C>)>,
    pieces: Query<(Entity, &GroundPiece), With<Inherited<C>>>,
) {
    for terrain in removed.read().filter(|&entity| bare.contains(entity)) {
        for (piece, _) in pieces.iter().filter(|(_, piece)| piece.terrain == terrain) {
            commands.entity(piece).try_remove::<(C, Inherited<C>)>();
        }
    }
}

/// A piece that is spawned with its own component keeps it until the terrain's changes.
fn insert_on_pieces<C: Component + Clone>(
    mut commands: Commands,
    pieces: Query<(Entity, Ref<GroundPiece>, Has<C>)>,
    terrains: Query<Ref<C>, With<Terrain>>,
) {
    for (entity, piece, has_own) in &pieces {
        let Ok(own) = terrains.get(piece.terrain) else { continue };
        let is_due = if piece.is_added() { !has_own } else { own.is_changed() };
        if is_due {
            commands.entity(entity).try_insert((C::clone(&own), Inherited::<C>::default()));
        }
    }
}
