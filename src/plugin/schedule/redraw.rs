//! Rebuilds all meshes on request.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;

use super::load::Loading;
use crate::plugin::entities::TerrainEntities;
use crate::terrain::Terrain;

/// Rebuilds all meshes of terrains: trigger it after the graphics device was lost, as meshes are kept in the render
/// world only, or after a change of [`BurrowSettings::mesh_usages`](crate::plugin::BurrowSettings::mesh_usages) or of
/// [`MaterialColors`](crate::plugin::MaterialColors). Edits continue, old meshes stay until the new ones are there, and
/// [`TerrainReady`](crate::plugin::TerrainReady) follows.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::plugin::Redraw;
/// fn after_device_loss(mut commands: Commands) {
///     commands.trigger(Redraw::default());
/// }
/// ```
#[derive(Event, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Redraw {
    /// The terrain's entity; `None` for every terrain there is.
    pub terrain: Option<Entity>,
}

/// Makes terrains load again.
pub(in crate::plugin) fn redraw(
    asked: On<Redraw>,
    mut commands: Commands,
    mut terrains: Query<(Entity, Option<&mut TerrainEntities>), (With<Terrain>, Allow<Disabled>)>,
) {
    let Redraw { terrain } = *asked;
    for (entity, entities) in &mut terrains {
        if terrain.is_none_or(|terrain| terrain == entity) {
            if let Some(mut entities) = entities {
                entities.is_outdated = true;
            }
            commands.entity(entity).try_remove::<Loading>();
        }
    }
}
