//! Propagates components from a terrain to its tiles, chunks and pieces: Bevy reads material, layers and shadows from
//! the entity of each mesh, not from the terrain's.
//!
//! Bevy's `HierarchyPropagatePlugin` does not fit: games would have to wrap each component in a `Propagate`, and a
//! piece that is spawned with its own component would lose it.
//!
//! Propagated values are recorded as [`Source`]s on the terrain and [`Inherited`] on the parts, so nothing is missed
//! while a game does not run these systems.

use std::marker::PhantomData;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::query::QueryFilter;
use bevy::ecs::relationship::Relationship;
use bevy::ecs::system::SystemChangeTick;
#[cfg(feature = "render")]
use bevy::light::{NotShadowCaster, NotShadowReceiver};
use bevy::prelude::*;

use crate::plugin::schedule::same_frame::{PropagateSameFrame, SameFrame};
use crate::plugin::{Chunk, GroundPiece, Phase, Tile};
use crate::terrain::Terrain;

/// Propagates a component of any type from a terrain's entity to its tiles, chunks and [pieces](GroundPiece): when it
/// is inserted, changed or removed. `BurrowPlugins` do so for `RenderLayers`, and with the feature `render` for
/// materials, `NotShadowCaster` and `NotShadowReceiver`.
///
/// A tile, chunk or piece that is spawned with its own keeps it until the terrain's changes.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::plugin::TerrainPropagatePlugin;
/// #[derive(Component, Clone)]
/// struct Minimap;
///
/// App::new().add_plugins(TerrainPropagatePlugin::<Minimap>::default());
/// ```
pub struct TerrainPropagatePlugin<C: Component + Clone>(PhantomData<fn() -> C>);

impl<C: Component + Clone> Default for TerrainPropagatePlugin<C> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<C: Component + Clone> Plugin for TerrainPropagatePlugin<C> {
    fn build(&self, app: &mut App) {
        propagate_to_ground::<C>(app);
        propagate_to_pieces::<C>(app);
    }
}

/// The steps of [`Phase::Propagate`], in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum PropagateSteps {
    /// Records the materials of terrains, and chooses one of several.
    Choose,
    /// Propagates components.
    Propagate,
}

/// Adds the systems that propagate layers and shadows.
pub(in crate::plugin) fn add(app: &mut App) {
    app.configure_sets(Phase::Propagate, (PropagateSteps::Choose, PropagateSteps::Propagate).chain())
        .add_plugins(TerrainPropagatePlugin::<RenderLayers>::default());
    #[cfg(feature = "render")]
    app.add_plugins((
        TerrainPropagatePlugin::<NotShadowCaster>::default(),
        TerrainPropagatePlugin::<NotShadowReceiver>::default(),
    ));
}

/// Marks an entity whose component of this type comes from its terrain.
#[derive(Component)]
pub(crate) struct Inherited<C: Component>(PhantomData<fn() -> C>);

impl<C: Component> Default for Inherited<C> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

/// Marks a terrain whose component of this type was propagated along a relationship.
#[derive(Component)]
pub(crate) struct Source<C: Component, R: Relationship>(PhantomData<fn() -> (C, R)>);

impl<C: Component, R: Relationship> Default for Source<C, R> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

/// Marks a terrain whose component of this type is not propagated, as another one takes precedence.
#[derive(Component)]
pub(crate) struct Overruled<C: Component>(PhantomData<fn() -> C>);

impl<C: Component> Default for Overruled<C> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

/// Terrains whose component of this type is propagated.
type Active<C> = (With<Terrain>, Without<Overruled<C>>);

/// Terrains that have no component of this type, or no longer have it.
type Inactive<C> = (With<Terrain>, Or<(Without<C>, With<Overruled<C>>)>);

/// Propagates a component of a terrain to its tiles and chunks.
pub(crate) fn propagate_to_ground<C: Component + Clone>(app: &mut App) {
    propagate::<C, ChildOf, Or<(With<Tile>, With<Chunk>)>>(app);
    app.init_resource::<SameFrame>()
        .add_systems(PostUpdate, insert_on_spawned::<C>.in_set(PropagateSameFrame));
}

/// Propagates a component of a terrain to its pieces.
pub(super) fn propagate_to_pieces<C: Component + Clone>(app: &mut App) {
    propagate::<C, GroundPiece, ()>(app);
}

/// Propagates a component of a terrain along a relationship when it is inserted, changed or removed.
fn propagate<C: Component + Clone, R: Relationship, F: QueryFilter + 'static>(app: &mut App) {
    app.add_systems(
        Phase::Propagate,
        (remove_inherited::<C, R>, insert_changed::<C, R, F>, insert_on_new::<C, R, F>)
            .chain()
            .in_set(PropagateSteps::Propagate),
    );
}

/// Removes a component from the entities that inherited it once their terrain no longer has it.
pub(crate) fn remove_inherited<C: Component, R: Relationship>(
    mut commands: Commands,
    lost: Query<(Entity, Option<&R::RelationshipTarget>), (Inactive<C>, With<Source<C, R>>)>,
    new: Query<Entity, (Active<C>, With<C>, Without<Source<C, R>>)>,
    inherited: Query<(), With<Inherited<C>>>,
) {
    for (terrain, sources) in &lost {
        let sources = sources.into_iter().flat_map(|sources| sources.iter());
        for entity in sources.filter(|&entity| inherited.contains(entity)) {
            commands.entity(entity).try_remove::<(C, Inherited<C>)>();
        }
        commands.entity(terrain).try_remove::<Source<C, R>>();
    }
    for terrain in &new {
        commands.entity(terrain).try_insert(Source::<C, R>::default());
    }
}

/// An entity that is spawned with its own component keeps it until the terrain's changes.
fn insert_on_new<C: Component + Clone, R: Relationship, F: QueryFilter>(
    mut commands: Commands,
    new: Query<(Entity, &R), (F, Added<R>, Without<C>)>,
    terrains: Query<&C, Active<C>>,
) {
    for (entity, link) in &new {
        if let Ok(component) = terrains.get(link.get()) {
            commands.entity(entity).try_insert((component.clone(), Inherited::<C>::default()));
        }
    }
}

/// Inserts the component on tiles and chunks that a commit spawned after [`Phase::Propagate`], and that have
/// none of their own.
fn insert_on_spawned<C: Component + Clone>(
    mut commands: Commands,
    same_frame: Res<SameFrame>,
    ticks: SystemChangeTick,
    new: Query<(Entity, Ref<ChildOf>), (Or<(With<Tile>, With<Chunk>)>, Added<ChildOf>, Without<C>)>,
    terrains: Query<&C, Active<C>>,
) {
    for (entity, link) in &new {
        if same_frame.has_spawned(link.added(), &ticks)
            && let Ok(component) = terrains.get(link.parent())
        {
            commands.entity(entity).try_insert((component.clone(), Inherited::<C>::default()));
        }
    }
}

/// Inserts a component that is new or changed into all entities but those that are new themselves, and have not
/// inherited it yet.
fn insert_changed<C: Component + Clone, R: Relationship, F: QueryFilter>(
    mut commands: Commands,
    terrains: Query<(&C, &R::RelationshipTarget), (Active<C>, Or<(Changed<C>, Added<Source<C, R>>)>)>,
    links: Query<(Ref<R>, Has<Inherited<C>>), F>,
) {
    for (component, sources) in &terrains {
        let has_it = |(link, inherits): (Ref<R>, bool)| inherits || !link.is_added();
        for entity in sources.iter().filter(|&entity| links.get(entity).is_ok_and(has_it)) {
            commands.entity(entity).try_insert((component.clone(), Inherited::<C>::default()));
        }
    }
}
