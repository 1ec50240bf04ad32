//! Questions about the ground in world space, over all terrains.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::entities::TerrainEntities;
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;
use crate::terrain::{Span, Terrain};

/// A system parameter that asks all terrains about the ground, in world space.
///
/// Terrains may be moved and evenly scaled; for [`height`](Self::height) and [`spans`](Self::spans) they must not be
/// rotated.
///
/// ```
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// fn stand_on_the_ground(terrains: Terrains, mut walkers: Query<&mut Transform, With<Camera>>) {
///     for mut walker in &mut walkers {
///         if let Some(floor) = terrains.height(walker.translation.x, walker.translation.z) {
///             walker.translation.y = floor + 1.7;
///         }
///     }
/// }
/// ```
#[derive(SystemParam)]
pub struct Terrains<'w, 's> {
    terrains:
        Query<'w, 's, (Entity, &'static Terrain, &'static GlobalTransform, Option<&'static TerrainEntities>)>,
}

/// Where a ray meets the ground, in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TerrainHit {
    /// The terrain's entity.
    pub terrain: Entity,
    /// Metres from the ray's origin.
    pub distance: f32,
    /// The place.
    pub position: Vec3,
    /// Unit normal of the drawn triangle, towards the air.
    pub normal: Vec3,
    /// What the ground is made of there.
    pub material: MaterialId,
    /// Did the ray come from inside the ground?
    pub from_inside: bool,
}

impl Terrains<'_, '_> {
    /// The first ground that a ray meets within `max_distance` metres.
    pub fn raycast(&self, ray: Ray3d, max_distance: f32) -> Option<TerrainHit> {
        let hits = self.terrains.iter().filter_map(|(entity, terrain, place, _)| {
            let affine = place.affine();
            let inverse = affine.inverse();
            let scale = place.scale().x;
            let origin = inverse.transform_point3(ray.origin);
            let direction = inverse.transform_vector3(*ray.direction);
            let reach = f64::from(max_distance / scale);
            let hit = terrain.world().raycast(origin.as_dvec3(), direction.as_dvec3(), reach)?;
            let normal = affine.transform_vector3(hit.normal).normalize_or_zero();
            Some(TerrainHit {
                terrain: entity,
                distance: hit.distance as f32 * scale,
                position: affine.transform_point3(hit.position.as_vec3()),
                normal,
                material: hit.material,
                from_inside: hit.from_inside,
            })
        });
        hits.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    /// The topmost ground over (x, z); `None` where no terrain is.
    pub fn height(&self, x: f32, z: f32) -> Option<f32> {
        self.spans(x, z).last().map(|span| span.floor as f32)
    }

    /// The stretches of air over (x, z), lowest first, in metres. Where terrains overlap, those of the first one.
    pub fn spans(&self, x: f32, z: f32) -> Vec<Span> {
        let over = self.terrains.iter().map(|(_, terrain, place, _)| {
            let (origin, scale) = (place.translation().as_dvec3(), f64::from(place.scale().x));
            let local = |at: f32, from: f64| (f64::from(at) - from) / scale;
            let spans = terrain.world().spans(local(x, origin.x), local(z, origin.z));
            let world = |y: f64| y * scale + origin.y;
            spans
                .into_iter()
                .map(|span| Span { floor: world(span.floor), ceiling: span.ceiling.map(world) })
                .collect::<Vec<_>>()
        });
        over.into_iter().find(|spans| !spans.is_empty()).unwrap_or_default()
    }

    /// The unit normal of the surface that is nearest to `place` along y; `None` where no terrain is.
    pub fn normal(&self, place: Vec3) -> Option<Vec3> {
        self.terrains.iter().find_map(|(_, terrain, at, _)| {
            let affine = at.affine();
            let normal = terrain.world().normal(affine.inverse().transform_point3(place).as_dvec3())?;
            Some(affine.transform_vector3(normal).normalize_or_zero())
        })
    }

    /// What the ground is made of at a place on or in it; `None` where no terrain is.
    pub fn material(&self, place: Vec3) -> Option<MaterialId> {
        self.terrains.iter().find_map(|(_, terrain, at, _)| {
            let local = at.affine().inverse().transform_point3(place).as_dvec3();
            terrain.world().height(local.x, local.z).map(|_| terrain.world().material_under(local))
        })
    }

    /// Is the place inside the ground?
    pub fn is_solid(&self, place: Vec3) -> bool {
        self.terrains.iter().any(|(_, terrain, at, _)| {
            terrain.world().is_solid(at.affine().inverse().transform_point3(place).as_dvec3())
        })
    }

    /// Is all ground between two corners shown as it is, with no terrain loading and no edit on its way there?
    pub fn is_ready(&self, min: Vec3, max: Vec3) -> bool {
        self.terrains.iter().all(|(_, terrain, place, entities)| {
            let loaded = entities.is_some_and(|entities| entities.show(terrain.world()));
            let inverse = place.affine().inverse();
            let (a, b) = (inverse.transform_point3(min), inverse.transform_point3(max));
            let bounds = LatticeBox::new(a.min(b).floor().as_ivec3(), a.max(b).ceil().as_ivec3());
            loaded && bounds.is_none_or(|bounds| terrain.is_ready(bounds))
        })
    }
}
