//! A backend for Bevy's picking: pointers hit the ground as it is drawn at level 0, dug caves and tunnels included.

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_picking::backend::ray::RayMap;
use bevy_picking::backend::{HitData, PointerHits};
use bevy_picking::{Pickable, PickingSystems};

use super::{TerrainHit, Terrains};
use crate::terrain::Terrain;

/// Lets pointers hit terrains: `On<Pointer<Click>>` and all other events of `bevy_picking` come to the entity of the
/// [`Terrain`], with the [`TerrainHit`] as extra data.
///
/// `BurrowPlugins` contain it with the feature `picking`. It needs Bevy's `DefaultPickingPlugins`, which
/// `DefaultPlugins` have with Bevy's own feature `bevy_picking`; without them it does nothing.
///
/// Pointers hit terrains that are visible and on a layer of the camera, unless they have a `Pickable` with
/// `is_hoverable: false`.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// # use bevy_picking::events::{Click, Pointer};
/// fn dig(click: On<Pointer<Click>>, mut brushes: MessageWriter<Brush>) {
///     if let Some(hit) = click.hit.extra_as::<TerrainHit>() {
///         brushes.write(Brush::dig(Shape::sphere(hit.position, 3.0)));
///     }
/// }
/// # fn setup(mut commands: Commands, terrain: Terrain) {
/// commands.spawn((terrain, GroundLook::default())).observe(dig);
/// # }
/// ```
#[derive(Default)]
pub struct TerrainPickingPlugin;

impl Plugin for TerrainPickingPlugin {
    fn build(&self, app: &mut App) {
        let has_picking = resource_exists::<RayMap>.and_then(resource_exists::<Messages<PointerHits>>);
        app.add_systems(PreUpdate, hit_terrains.in_set(PickingSystems::Backend).run_if(has_picking));
    }
}

/// Reports what each pointer hits.
fn hit_terrains(
    rays: Res<RayMap>,
    terrains: Terrains,
    cameras: Query<(&Camera, Option<&RenderLayers>)>,
    facts: Query<(Option<&InheritedVisibility>, Option<&RenderLayers>, Option<&Pickable>), With<Terrain>>,
    mut hits: MessageWriter<PointerHits>,
) {
    for (&ray_id, &ray) in rays.iter() {
        let Ok((camera, layers)) = cameras.get(ray_id.camera) else { continue };
        let layers = layers.cloned().unwrap_or_default();
        let is_seen = |entity: Entity| {
            facts.get(entity).is_ok_and(|(visibility, own, pickable)| {
                visibility.is_none_or(|visibility| visibility.get())
                    && layers.intersects(&own.cloned().unwrap_or_default())
                    && pickable.is_none_or(|pickable| pickable.is_hoverable)
            })
        };
        let Some(hit) = terrains.raycast_where(ray, f32::MAX, is_seen) else { continue };
        let TerrainHit { terrain, distance, position, normal, .. } = hit;
        let data = HitData::new_with_extra(ray_id.camera, distance, Some(position), Some(normal), hit);
        hits.write(PointerHits::new(ray_id.pointer, vec![(terrain, data)], camera.order as f32));
    }
}
