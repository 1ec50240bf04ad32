//! Propagates components from a terrain to its tiles, chunks and pieces: Bevy reads material, layers and shadows from the
//! entity of each mesh, not from the terrain's.
//!
//! Bevy's `HierarchyPropagatePlugin` does not fit: games would have to wrap each component in a `Propagate`, and a piece that
//! is spawned with its own component would lose it.

use std::marker::PhantomData;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::query::QueryFilter;
use bevy::ecs::relationship::Relationship;
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

/// Marks an entity whose component of this type comes from its terrain.
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
    propagate::<C, GroundPiece, ()>(app);
}

/// Propagates a component of a terrain to its tiles and chunks.
pub(crate) fn propagate_to_ground<C: Component + Clone>(app: &mut App) {
    propagate::<C, ChildOf, Or<(With<Tile>, With<Chunk>)>>(app);
}

/// Propagates a component of a terrain along a relationship when it is inserted, changed or removed.
fn propagate<C: Component + Clone, R: Relationship, F: QueryFilter + 'static>(app: &mut App) {
    app.add_systems(
        Update,
        (remove_inherited::<C, R>, insert_on_new::<C, R, F>, insert_changed::<C, R, F>)
            .chain()
            .in_set(BurrowSystems::Propagate),
    );
}

/// Removes a component from the entities that inherited it once their terrain no longer has it.
pub(crate) fn remove_inherited<C: Component, R: Relationship>(
    mut commands: Commands,
    mut removed: RemovedComponents<C>,
    terrains: Query<&R::RelationshipTarget, (With<Terrain>, Without<C>)>,
    inherited: Query<(), With<Inherited<C>>>,
) {
    for sources in removed.read().filter_map(|entity| terrains.get(entity).ok()) {
        for entity in sources.iter().filter(|&entity| inherited.contains(entity)) {
            commands.entity(entity).try_remove::<(C, Inherited<C>)>();
        }
    }
}

/// An entity that is spawned with its own component keeps it until the terrain's changes.
fn insert_on_new<C: Component + Clone, R: Relationship, F: QueryFilter>(
    mut commands: Commands,
    new: Query<(Entity, &R), (F, Added<R>, Without<C>)>,
    terrains: Query<&C, With<Terrain>>,
) {
    for (entity, link) in &new {
        if let Ok(component) = terrains.get(link.get()) {
            commands.entity(entity).try_insert((component.clone(), Inherited::<C>::default()));
        }
    }
}

fn insert_changed<C: Component + Clone, R: Relationship, F: QueryFilter>(
    mut commands: Commands,
    terrains: Query<(&C, &R::RelationshipTarget), (With<Terrain>, Changed<C>)>,
    links: Query<Ref<R>, F>,
) {
    for (component, sources) in &terrains {
        for entity in sources.iter().filter(|&entity| links.get(entity).is_ok_and(|link| !link.is_added())) {
            commands.entity(entity).try_insert((component.clone(), Inherited::<C>::default()));
        }
    }
}
