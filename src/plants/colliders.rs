//! Stems as colliders, near to [`ColliderSource`]s.

use avian3d::prelude::*;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;

use super::{PlantSystems, ShownPlants};
use crate::lattice::Column;
use crate::physics::ColliderSource;
use crate::plugin::{Places, position_on, voxel_metres};
use crate::scatter::PlantId;

/// Metres around a source within which stems have colliders, if its own radius is not smaller.
const NEAR: f32 = 32.0;

/// Gives the [stems](crate::scatter::Stem) of plants colliders near to [`ColliderSource`]s: static cylinders, children
/// of the terrain, which disappear and return with their plants.
#[derive(Default)]
pub struct PlantCollidersPlugin;

impl Plugin for PlantCollidersPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, keep_colliders.in_set(PlantSystems).after(super::follow::follow_commits))
            .add_systems(
                PostUpdate,
                keep_colliders.in_set(PlantSystems).after(super::follow::follow_commits),
            );
    }
}

/// The stems of a terrain that have colliders.
#[derive(Component, Default)]
struct Stems(HashMap<PlantId, Entity>);

fn keep_colliders(
    mut commands: Commands,
    mut terrains: Query<(Entity, &ShownPlants, Option<&mut Stems>)>,
    sources: Query<(Entity, &ColliderSource)>,
    places: Places,
) {
    for (entity, shown, stems) in &mut terrains {
        let Some(mut stems) = stems else {
            commands.entity(entity).try_insert(Stems::default());
            continue;
        };
        let Some(place) = places.of(entity) else { continue };
        let (inverse, voxel) = (place.affine().inverse(), voxel_metres(&place));
        let mut near = HashSet::new();
        let stems = stems.bypass_change_detection();
        for (source, &ColliderSource { radius }) in &sources {
            let at = places.of(source).and_then(|place| position_on(&inverse, &place));
            let (Some(at), Some(patches)) = (at, shown.patches()) else { continue };
            let radius = radius.min(NEAR) / voxel;
            let cell = |more: f32| Column::new((at.x + more).floor() as i32, (at.y + more).floor() as i32);
            let species = patches.scatter().species();
            let has_stem = species.iter().map(|own| own.stem.is_some());
            for plant in patches.near_of(cell(-radius), cell(radius), has_stem) {
                let Some(stem) = species[usize::from(plant.id.species)].stem else { continue };
                near.insert(plant.id);
                stems.0.entry(plant.id).or_insert_with(|| {
                    let size = f32::from(plant.size) / 256.0;
                    let (radius, height) = (stem.radius * size, stem.height * size);
                    let middle = plant.position().as_vec3() + Vec3::Y * height / 2.0;
                    let bundle = (
                        RigidBody::Static,
                        Collider::cylinder(radius, height),
                        Transform::from_translation(middle),
                    );
                    commands.spawn((bundle, ChildOf(entity))).id()
                });
            }
        }
        stems.0.retain(|id, child| {
            let stays = near.contains(id);
            if !stays {
                commands.entity(*child).try_despawn();
            }
            stays
        });
    }
}
