//! Bodies over ground that has no collider yet are held, so that they do not fall through it.

use avian3d::prelude::*;
use bevy::prelude::*;

use super::character::Character;
use super::upkeep::ReadyColumns;
use super::{ColliderSource, PhysicsFigures};
use crate::lattice::Column;
use crate::terrain::Terrain;

/// How far ahead of a body ground must have colliders, in seconds: longer than any frame.
const AHEAD: f32 = 0.25;

/// Bodies this far above all ground are not held, in metres beyond what they fall in [`AHEAD`].
const CLEARANCE: f32 = 4.0;

/// This body stands still until the ground under it has colliders: it is over a terrain that loads, or farther from all
/// [`ColliderSource`]s than their radius.
///
/// The plugin puts it on dynamic bodies, whose axes it locks, and on [`Character`]s, and takes it away again; the body goes
/// on with the velocity it had. Bodies high above the ground are not held.
#[derive(Component, Reflect, Clone, Copy, Debug, Default)]
#[reflect(Component, Default)]
pub struct HeldByGround {
    velocity: Vec3,
    spin: Vec3,
    /// What was locked before.
    locked: Option<LockedAxes>,
}

/// Holds bodies and lets them go.
pub(super) fn hold(
    mut commands: Commands,
    mut bodies: Query<
        (
            Entity,
            &RigidBody,
            &Position,
            &mut LinearVelocity,
            &mut AngularVelocity,
            Option<&LockedAxes>,
            Option<&ColliderAabb>,
            Has<Character>,
            Option<&HeldByGround>,
        ),
        Without<super::GroundBody>,
    >,
    places: TransformHelper,
    terrains: Query<(Entity, &Terrain)>,
    sources: Query<(), With<ColliderSource>>,
    ready: Res<ReadyColumns>,
    mut figures: ResMut<PhysicsFigures>,
) {
    let terrains: Vec<(Entity, &Terrain, Affine)> = terrains
        .iter()
        .filter_map(|(entity, terrain)| {
            let place = places.compute_global_transform(entity).ok()?;
            Some((entity, terrain, Affine { inverse: place.affine().inverse(), size: terrain.voxel_size() }))
        })
        .collect();
    let mut held = 0;
    for (entity, body, position, mut velocity, mut spin, locked, bounds, is_character, hold) in &mut bodies {
        if !(body.is_dynamic() || is_character) {
            continue;
        }
        let half = bounds.map_or(Vec3::splat(0.5), |bounds| (bounds.max - bounds.min) / 2.0);
        let half = half.clamp(Vec3::ZERO, Vec3::splat(8.0));
        let towards = hold.map_or(velocity.0, |hold| hold.velocity);
        let lacks_ground = terrains.iter().any(|(terrain, model, affine)| {
            affine.lacks_ground(*terrain, model, &ready, position.0, towards, half)
        });
        held += usize::from(lacks_ground);
        let mut entity = commands.entity(entity);
        match (lacks_ground, hold) {
            (true, None) => {
                let hold = HeldByGround { velocity: velocity.0, spin: spin.0, locked: locked.copied() };
                entity.try_insert(hold);
                if !is_character {
                    (velocity.0, spin.0) = (Vec3::ZERO, Vec3::ZERO);
                    entity.try_insert(LockedAxes::ALL_LOCKED);
                }
            }
            (false, Some(hold)) => {
                entity.try_remove::<HeldByGround>();
                if !is_character {
                    // Told so by the change, avian wakes it.
                    (velocity.0, spin.0) = (hold.velocity, hold.spin);
                    match hold.locked {
                        Some(locked) => entity.try_insert(locked),
                        None => entity.try_remove::<LockedAxes>(),
                    };
                }
            }
            _ => {}
        }
    }
    figures.held = held;
    if held > 0 && sources.is_empty() {
        warn_once!(
            "bodies over a terrain are held still: there is no ColliderSource, so ground has no colliders"
        );
    }
}

/// From the world to a terrain.
struct Affine {
    inverse: bevy::math::Affine3A,
    size: f32,
}

impl Affine {
    /// May a body reach ground without a collider soon?
    fn lacks_ground(
        &self,
        terrain: Entity,
        model: &Terrain,
        ready: &ReadyColumns,
        place: Vec3,
        velocity: Vec3,
        half: Vec3,
    ) -> bool {
        if !(place.is_finite() && velocity.is_finite()) {
            return false;
        }
        let ahead = place + velocity * AHEAD;
        let (low, high) = (place.min(ahead) - half, place.max(ahead) + half);
        let [low, high] = [low, high].map(|corner| self.inverse.transform_point3(corner));
        let (low, high) = (low.min(high).floor().as_ivec3(), low.max(high).floor().as_ivec3());
        let grid = model.world().grid();
        // A body that is off the terrain has nothing to wait for.
        let (first, last) = (
            Column::new(low.x.max(0), low.z.max(0)),
            Column::new(high.x.min(grid.width() - 1), high.z.min(grid.depth() - 1)),
        );
        if first.x > last.x || first.z > last.z {
            return false;
        }
        let (first, last) = (grid.tile_of_cell(first), grid.tile_of_cell(last));
        let mut tiles = (first.z..=last.z).flat_map(|z| (first.x..=last.x).map(move |x| (x, z)));
        let is_missing = |(x, z)| !ready.contains(terrain, crate::lattice::TilePos { x, z });
        tiles.any(is_missing) && self.is_low(model, place, low.y as f32)
    }

    /// Is its lowest point near the ground, or under some of it?
    fn is_low(&self, model: &Terrain, place: Vec3, low: f32) -> bool {
        let local = self.inverse.transform_point3(place).as_dvec3();
        let grid = model.world().grid();
        let (x, z) =
            (local.x.clamp(0.0, f64::from(grid.width())), local.z.clamp(0.0, f64::from(grid.depth())));
        let height = model.world().height(x, z);
        height.is_some_and(|height| f64::from(low) < height + f64::from(CLEARANCE / self.size))
    }
}
