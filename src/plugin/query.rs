//! Queries about the ground in world space, over all terrains.

use bevy::ecs::system::SystemParam;
use bevy::math::Affine3A;
use bevy::prelude::*;

use super::entities::TerrainEntities;
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;
use crate::terrain::{Span, Terrain};

/// A system parameter for queries about the ground of all terrains in world space, hidden ones too.
///
/// Terrains may be moved, rotated and evenly scaled; for [`height`](Self::height) and [`spans`](Self::spans) they must
/// not be rotated. The place of a terrain is the one at its insertion or at the start of this frame's
/// [`BurrowSystems::Load`](super::BurrowSystems::Load), whichever came last.
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
    /// The first ground that a ray meets within `max_distance` metres. Bevy's mesh picking does not hit
    /// the ground, because its meshes are in the render world only: use this instead.
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
        hits.min_by(|a, b| a.distance.total_cmp(&b.distance).then(a.terrain.cmp(&b.terrain)))
    }

    /// The topmost ground over (x, z), of all terrains there; `None` if there is none.
    pub fn height(&self, x: f32, z: f32) -> Option<f32> {
        self.spans(x, z).last().map(|span| span.floor as f32)
    }

    /// The stretches of air over (x, z), lowest first, in metres. Where terrains overlap, the one with
    /// the topmost ground counts; of two at one height it is always the same one.
    pub fn spans(&self, x: f32, z: f32) -> Vec<Span> {
        let over = self.terrains.iter().filter_map(|(entity, terrain, place, _)| {
            let (origin, scale) = (place.translation().as_dvec3(), f64::from(place.scale().x));
            let local = |at: f32, from: f64| (f64::from(at) - from) / scale;
            let spans = terrain.world().spans(local(x, origin.x), local(z, origin.z));
            let world = |y: f64| y * scale + origin.y;
            let spans = spans
                .into_iter()
                .map(|span| Span { floor: world(span.floor), ceiling: span.ceiling.map(world) })
                .collect::<Vec<_>>();
            Some((spans.last()?.floor, entity, spans))
        });
        let highest = over.max_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        highest.map(|(_, _, spans)| spans).unwrap_or_default()
    }

    /// The unit normal of the surface that is nearest to `place` along the y of its terrain; `None` if there is no terrain.
    pub fn normal(&self, place: Vec3) -> Option<Vec3> {
        let (terrain, affine) = self.nearest(place)?;
        let normal = terrain.world().normal(affine.inverse().transform_point3(place).as_dvec3())?;
        Some(affine.transform_vector3(normal).normalize_or_zero())
    }

    /// What the ground is made of at a place on or in it; `None` if there is no terrain. Where terrains overlap, the one
    /// whose surface is nearest along its y counts.
    pub fn material(&self, place: Vec3) -> Option<MaterialId> {
        let (terrain, affine) = self.nearest(place)?;
        let local = affine.inverse().transform_point3(place).as_dvec3();
        terrain.world().height(local.x, local.z).map(|_| terrain.world().material_under(local))
    }

    /// The terrain whose surface is nearest to a place along its y; of two at one distance always the same one. If there is
    /// only one terrain, it is returned even if it does not reach there.
    fn nearest(&self, place: Vec3) -> Option<(&Terrain, Affine3A)> {
        if let Ok((_, terrain, at, _)) = self.terrains.single() {
            return Some((terrain, at.affine()));
        }
        let over = self.terrains.iter().filter_map(|(entity, terrain, at, _)| {
            let affine = at.affine();
            let local = affine.inverse().transform_point3(place).as_dvec3();
            let spans = terrain.world().spans(local.x, local.z);
            let surfaces = spans.into_iter().flat_map(|span| [Some(span.floor), span.ceiling]).flatten();
            let apart = surfaces.map(|y| (y - local.y).abs()).min_by(f64::total_cmp)?;
            Some((apart * f64::from(at.scale().y), entity, terrain, affine))
        });
        let nearest = over.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.map(|(_, _, terrain, affine)| (terrain, affine))
    }

    /// Is the place inside the ground?
    pub fn is_solid(&self, place: Vec3) -> bool {
        self.terrains.iter().any(|(_, terrain, at, _)| {
            terrain.world().is_solid(at.affine().inverse().transform_point3(place).as_dvec3())
        })
    }

    /// Is all ground between two corners shown as it is, with no terrain loading and no edit on its way there? False
    /// if there is no terrain at all, or a corner is not a number. Infinite corners stand for everywhere.
    ///
    /// A terrain that is shown may not be drawn yet: see [`TerrainReady`](super::TerrainReady).
    pub fn is_ready(&self, min: Vec3, max: Vec3) -> bool {
        if self.terrains.is_empty() || min.is_nan() || max.is_nan() {
            return false;
        }
        // Farther than any terrain reaches; infinite numbers cannot be rotated.
        let far = Vec3::splat(1.0e9);
        let (min, max) = (min.clamp(-far, far), max.clamp(-far, far));
        self.terrains.iter().all(|(_, terrain, place, entities)| {
            let loaded = entities.is_some_and(|entities| entities.show(terrain.world()));
            let inverse = place.affine().inverse();
            let corners = (0..8).map(|corner| {
                let is_high = BVec3::new(corner & 1 > 0, corner & 2 > 0, corner & 4 > 0);
                inverse.transform_point3(Vec3::select(is_high, max, min))
            });
            let (low, high) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| {
                (low.min(corner), high.max(corner))
            });
            let bounds = LatticeBox::new(low.floor().as_ivec3(), high.ceil().as_ivec3());
            loaded && bounds.is_some_and(|bounds| terrain.is_ready(bounds))
        })
    }
}
