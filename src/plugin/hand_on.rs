//! What a terrain hands on to its tiles, chunks and pieces: Bevy asks the entity of each mesh for its material, layers and
//! shadows, and not that of the terrain.
//!
//! Bevy's `HierarchyPropagatePlugin` would hand them on to everything below a terrain, what a game has put there included,
//! and to no piece that is elsewhere.

use std::marker::PhantomData;

use bevy::camera::visibility::RenderLayers;
#[cfg(feature = "render")]
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::prelude::*;

use super::{BurrowSystems, Chunk, GroundPiece, Tile};
use crate::terrain::Terrain;

/// Has layers and shadows handed on.
pub(super) fn add(app: &mut App) {
    hand_on_with_pieces::<RenderLayers>(app);
    #[cfg(feature = "render")]
    {
        hand_on_with_pieces::<NotShadowCaster>(app);
        hand_on_with_pieces::<NotShadowReceiver>(app);
    }
}

/// On a piece that has a component of this type from its terrain, and not of its own.
#[derive(Component)]
pub(crate) struct HandedOn<C: Component>(PhantomData<fn() -> C>);

impl<C: Component> Default for HandedOn<C> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

/// Has tiles and chunks wear a component of their terrain, and pieces as well.
pub(crate) fn hand_on_with_pieces<C: Component + Clone>(app: &mut App) {
    hand_on::<C>(app);
    app.add_systems(
        Update,
        (take_from_pieces::<C>, give_to_pieces::<C>).chain().in_set(BurrowSystems::Dress),
    );
}

/// Has tiles and chunks wear a component of their terrain, as it is put on, changed and taken off; pieces do not.
pub(crate) fn hand_on<C: Component + Clone>(app: &mut App) {
    app.add_systems(
        Update,
        (take::<C>, give_to_new::<C>, give_to_all::<C>).chain().in_set(BurrowSystems::Dress),
    );
}

/// A tile or chunk.
type Drawn = Or<(With<Tile>, With<Chunk>)>;

/// A tile or chunk that just came.
type New = (Drawn, Or<(Added<Tile>, Added<Chunk>)>);

fn take<C: Component>(
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

fn give_to_new<C: Component + Clone>(
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

fn give_to_all<C: Component + Clone>(
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

/// Pieces of a terrain that has lost a component lose what they have from it.
pub(crate) fn take_from_pieces<C: Component>(
    mut commands: Commands,
    mut removed: RemovedComponents<C>,
    bare: Query<(), (With<Terrain>, Without<C>)>,
    pieces: Query<(Entity, &GroundPiece), With<HandedOn<C>>>,
) {
    for terrain in removed.read().filter(|&entity| bare.contains(entity)) {
        for (piece, _) in pieces.iter().filter(|(_, piece)| piece.terrain == terrain) {
            commands.entity(piece).try_remove::<(C, HandedOn<C>)>();
        }
    }
}

/// A piece that comes with its own keeps that, until the terrain's changes.
fn give_to_pieces<C: Component + Clone>(
    mut commands: Commands,
    pieces: Query<(Entity, Ref<GroundPiece>, Has<C>)>,
    terrains: Query<Ref<C>, With<Terrain>>,
) {
    for (entity, piece, has_own) in &pieces {
        let Ok(own) = terrains.get(piece.terrain) else { continue };
        let is_due = if piece.is_added() { !has_own } else { own.is_changed() };
        if is_due {
            commands.entity(entity).try_insert((C::clone(&own), HandedOn::<C>::default()));
        }
    }
}
