//! Queries about the ground in world space, over all terrains.

use bevy::ecs::system::SystemParam;
use bevy::math::{DAffine3, DMat3, DVec3, Vec3A};
use bevy::prelude::*;

use super::entities::TerrainEntities;
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;
use crate::terrain::{Span, Terrain};

/// A system parameter for queries about the ground of all terrains in world space, hidden ones too.
///
/// Terrains may be moved, rotated, scaled, stretched and mirrored. [`height`](Self::height) and [`spans`](Self::spans)
/// leave out those whose y axis does not point straight up. The transform of a terrain is the one at its insertion or
/// at the start of this frame's [`BurrowSystems::Load`](super::BurrowSystems::Load), whichever was later; where another
/// plugin maintains `GlobalTransform`s, as for floating origins, it is the one that this plugin wrote last.
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

/// The stretches of air over (x, z) of a terrain that is upright, in world space.
fn spans_of(terrain: &Terrain, place: &GlobalTransform, x: f32, z: f32) -> Option<Vec<Span>> {
    let space = Space::of(place).filter(Space::is_upright)?;
    let local = space.inverse.transform_point3(DVec3::new(f64::from(x), 0.0, f64::from(z)));
    let world = |y: f64| y * space.world.matrix3.y_axis.y + space.world.translation.y;
    let spans = terrain.world().spans(local.x, local.z).into_iter();
    let spans = spans.map(|span| Span { floor: world(span.floor), ceiling: span.ceiling.map(world) });
    Some(spans.collect())
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
    /// The material of the ground there.
    pub material: MaterialId,
    /// Whether the ray came from inside the ground.
    pub from_inside: bool,
}

impl Terrains<'_, '_> {
    /// The first ground that a ray meets within `max_distance` metres. Bevy's mesh picking does not hit
    /// the ground, because its meshes are in the render world only: use this instead.
    pub fn raycast(&self, ray: Ray3d, max_distance: f32) -> Option<TerrainHit> {
        self.raycast_where(ray, max_distance, |_| true)
    }

    /// The first ground that a ray meets within `max_distance` metres, of the terrains that pass a filter.
    pub fn raycast_where(
        &self,
        ray: Ray3d,
        max_distance: f32,
        filter: impl Fn(Entity) -> bool,
    ) -> Option<TerrainHit> {
        let hits = self.terrains.iter().filter(|(entity, ..)| filter(*entity));
        let hits = hits.filter_map(|(entity, terrain, place, _)| {
            let space = Space::of(place)?;
            let origin = space.inverse.transform_point3(ray.origin.as_dvec3());
            let direction = space.inverse.transform_vector3(ray.direction.as_dvec3());
            // Voxels along the ray in a metre.
            let voxels = direction.length();
            let hit = terrain.world().raycast(origin, direction, f64::from(max_distance) * voxels)?;
            Some(TerrainHit {
                terrain: entity,
                distance: (hit.distance / voxels) as f32,
                position: space.world.transform_point3(hit.position).as_vec3(),
                normal: space.normal(hit.normal),
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
            let spans = spans_of(terrain, place, x, z)?;
            Some((spans.last()?.floor, entity, spans))
        });
        let highest = over.max_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        highest.map(|(_, _, spans)| spans).unwrap_or_default()
    }

    /// The stretches of air of one terrain over (x, z), lowest first, in metres; none if its y axis does not point
    /// straight up.
    #[cfg(feature = "egui")]
    pub(crate) fn spans_on(&self, terrain: Entity, x: f32, z: f32) -> Vec<Span> {
        let spans = self.terrains.get(terrain).ok().and_then(|own| spans_of(own.1, own.2, x, z));
        spans.unwrap_or_default()
    }

    /// The side of a terrain's voxel in metres.
    #[cfg(feature = "egui")]
    pub(crate) fn voxel_metres(&self, terrain: Entity) -> Option<f32> {
        self.terrains.get(terrain).ok().map(|own| super::voxel_metres(own.2))
    }

    /// The unit normal of the surface that is nearest to `place` along the y of its terrain; `None` if there is no
    /// terrain.
    pub fn normal(&self, place: Vec3) -> Option<Vec3> {
        let (terrain, space) = self.nearest(place)?;
        let normal = terrain.world().normal(space.inverse.transform_point3(place.as_dvec3()))?;
        Some(space.normal(normal))
    }

    /// The material of the ground at a position on or in it; `None` if there is no terrain. Where terrains overlap, the
    /// one whose surface is nearest along its y counts.
    pub fn material(&self, place: Vec3) -> Option<MaterialId> {
        let (terrain, space) = self.nearest(place)?;
        let local = space.inverse.transform_point3(place.as_dvec3());
        terrain.world().height(local.x, local.z).map(|_| terrain.world().material_under(local))
    }

    /// The terrain whose surface is nearest to a place along its y; of two at one distance always the same one. If
    /// there is only one terrain, it is returned even if it does not reach there.
    fn nearest(&self, place: Vec3) -> Option<(&Terrain, Space)> {
        if let Ok((_, terrain, at, _)) = self.terrains.single() {
            return Some((terrain, Space::of(at)?));
        }
        let over = self.terrains.iter().filter_map(|(entity, terrain, at, _)| {
            let space = Space::of(at)?;
            let local = space.inverse.transform_point3(place.as_dvec3());
            let spans = terrain.world().spans(local.x, local.z);
            let surfaces = spans.into_iter().flat_map(|span| [Some(span.floor), span.ceiling]).flatten();
            let apart = surfaces.map(|y| (y - local.y).abs()).min_by(f64::total_cmp)?;
            Some((apart * space.world.matrix3.y_axis.length(), entity, terrain, space))
        });
        let nearest = over.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.map(|(_, _, terrain, space)| (terrain, space))
    }

    /// Whether the position is inside the ground.
    pub fn is_solid(&self, place: Vec3) -> bool {
        self.terrains.iter().any(|(_, terrain, at, _)| {
            let local = Space::of(at).map(|space| space.inverse.transform_point3(place.as_dvec3()));
            local.is_some_and(|local| terrain.world().is_solid(local))
        })
    }

    /// Whether all ground between two corners is shown as it is, with no terrain loading and no edit on its way there.
    /// `false` if there is no terrain at all, or a corner is not a number. Infinite corners stand for everywhere.
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
            let is_shown =
                |entities: &TerrainEntities| entities.show(terrain.world()) && !entities.is_outdated;
            let loaded = entities.is_some_and(is_shown);
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

/// Between the world and the voxels of a terrain.
struct Space {
    /// From voxels to the world.
    world: DAffine3,
    /// From the world to voxels.
    inverse: DAffine3,
}

impl Space {
    /// `None` if the place is not finite, or flat.
    fn of(place: &GlobalTransform) -> Option<Self> {
        let affine = place.affine();
        let axis = |axis: Vec3A| Vec3::from(axis).as_dvec3();
        let matrix3 = DMat3::from_cols(
            axis(affine.matrix3.x_axis),
            axis(affine.matrix3.y_axis),
            axis(affine.matrix3.z_axis),
        );
        let world = DAffine3 { matrix3, translation: axis(affine.translation) };
        let inverse = world.inverse();
        inverse.is_finite().then_some(Self { world, inverse })
    }

    /// Whether y of the terrain points straight up, but for rounding.
    fn is_upright(&self) -> bool {
        let DMat3 { x_axis, y_axis, z_axis } = self.world.matrix3;
        let is_small = |part: f64, of: DVec3| part.abs() <= 1e-5 * of.length();
        y_axis.y > 0.0
            && is_small(y_axis.x, y_axis)
            && is_small(y_axis.z, y_axis)
            && is_small(x_axis.y, x_axis)
            && is_small(z_axis.y, z_axis)
    }

    /// The direction in the world of a normal of the terrain.
    fn normal(&self, normal: Vec3) -> Vec3 {
        (self.inverse.matrix3.transpose() * normal.as_dvec3()).normalize_or_zero().as_vec3()
    }
}
