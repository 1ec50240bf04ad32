//! Global transforms of entities in this frame, before Bevy propagates transforms at its end.
//!
//! A place is computed from the `Transform`s of an entity and its ancestors, as Bevy will do. Plugins for floating
//! origins keep places in another way: the root of a `big_space` has no `Transform`, and its children are in cells that
//! a `Transform` knows nothing of. There the `GlobalTransform` is right, and is used as it is.

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::system::SystemParam;
use bevy::math::Vec3A;
use bevy::prelude::*;
#[cfg(feature = "avian")]
use bevy::transform::helper::ComputeGlobalTransformError;

use crate::plugin::reports::{Report, Reports};
use crate::terrain::Terrain;

/// The plugin's state for a terrain's position.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TerrainPlace {
    /// The global transform that the plugin wrote last.
    pub(super) written: GlobalTransform,
    /// The scale that the plugin wrote last.
    pub(in crate::plugin) scale: f32,
    /// Whether something else maintains the `GlobalTransform` of this terrain, so that its `Transform` does not lead to
    /// it.
    pub(super) is_external: bool,
}

/// The `Transform`s of entities and of their ancestors.
#[derive(SystemParam)]
pub(in crate::plugin) struct LocalPlaces<'w, 's> {
    parents: Query<'w, 's, &'static ChildOf, Allow<Disabled>>,
    transforms: Query<'w, 's, &'static Transform, Allow<Disabled>>,
}

impl LocalPlaces<'_, '_> {
    /// The place that Bevy's propagation gives an entity; `None` if the entity or an ancestor has no `Transform`.
    pub(in crate::plugin) fn of(&self, entity: Entity) -> Option<GlobalTransform> {
        self.below(entity, |_| None)
    }

    /// The place of an entity, counted from the first ancestor, or the entity itself, whose place is known. Multiplied
    /// from the top, as Bevy does, so that the bits are the same.
    fn below(
        &self,
        entity: Entity,
        known: impl Fn(Entity) -> Option<GlobalTransform>,
    ) -> Option<GlobalTransform> {
        let mut chain: Vec<Transform> = Vec::new();
        let mut at = entity;
        let base = loop {
            if let Some(base) = known(at) {
                break Some(base);
            }
            chain.push(*self.transforms.get(at).ok()?);
            match self.parents.get(at) {
                Ok(parent) => at = parent.parent(),
                Err(_) => break None,
            }
        };
        let mut locals = chain.into_iter().rev();
        let start = base.or_else(|| locals.next().map(GlobalTransform::from))?;
        Some(locals.fold(start, |place, local| place.mul_transform(local)))
    }
}

/// The positions of entities in this frame.
#[derive(SystemParam)]
pub(crate) struct Places<'w, 's> {
    locals: LocalPlaces<'w, 's>,
    globals: Query<'w, 's, (&'static GlobalTransform, Option<&'static TerrainPlace>), Allow<Disabled>>,
}

impl Places<'_, '_> {
    /// The place of an entity: from its `Transform`s if they lead to it, else its `GlobalTransform`. `None` if it has
    /// neither.
    pub(crate) fn of(&self, entity: Entity) -> Option<GlobalTransform> {
        let known = |at| {
            let (place, terrain) = self.globals.get(at).ok()?;
            terrain.is_some_and(|terrain| terrain.is_external).then_some(*place)
        };
        self.locals.below(entity, known).or_else(|| self.globals.get(entity).ok().map(|(place, _)| *place))
    }

    /// The place of an entity, or an error if it has neither a `Transform` nor a `GlobalTransform`, like Bevy's
    /// `TransformHelper`.
    #[cfg(feature = "avian")]
    pub(crate) fn compute_global_transform(
        &self,
        entity: Entity,
    ) -> Result<GlobalTransform, ComputeGlobalTransformError> {
        self.of(entity).ok_or(ComputeGlobalTransformError::MissingTransform(entity))
    }
}

/// Updates the global transforms of terrains before they are queried; Bevy does so only at the end of the frame, if at
/// all.
pub(in crate::plugin) fn place_terrains(
    places: LocalPlaces,
    mut terrains: Query<(Entity, &Terrain, &mut GlobalTransform, &mut TerrainPlace)>,
    reports: Reports,
) {
    for (entity, terrain, mut global, mut place) in &mut terrains {
        place_terrain(places.of(entity), &mut global, &mut place);
        check_place(entity, terrain, &global, &reports);
    }
}

/// Updates the global transform of one terrain to where its `Transform`s lead, unless something else maintains it.
pub(in crate::plugin) fn place_terrain(
    now: Option<GlobalTransform>,
    global: &mut Mut<GlobalTransform>,
    place: &mut Mut<TerrainPlace>,
) {
    let known = **place;
    let next = match now {
        Some(now) if !known.is_external => {
            global.set_if_neq(now);
            TerrainPlace { written: now, is_external: false, ..known }
        }
        _ => TerrainPlace { is_external: true, ..known },
    };
    place.set_if_neq(next);
}

/// Notes, at the end of a frame, whether something else maintains the global transform of a terrain: it is neither what
/// the `Transform`s lead to nor what the plugin wrote.
pub(in crate::plugin) fn find_external_places(
    places: LocalPlaces,
    mut terrains: Query<(Entity, &GlobalTransform, &mut TerrainPlace), With<Terrain>>,
) {
    for (entity, global, mut place) in &mut terrains {
        let is_elsewhere = |now: GlobalTransform| {
            // An invalid position is not maintained by anything.
            global.affine().is_finite()
                && !is_same_place(&now, global)
                && !is_same_place(&place.written, global)
        };
        let is_external = places.of(entity).is_none_or(is_elsewhere);
        place.set_if_neq(TerrainPlace { is_external, ..*place });
    }
}

/// Whether two places are the same but for rounding.
fn is_same_place(a: &GlobalTransform, b: &GlobalTransform) -> bool {
    let (a, b) = (a.affine(), b.affine());
    let size = a.translation.abs().max_element().max(1.0);
    let scale = a.matrix3.x_axis.abs().max_element().max(a.matrix3.y_axis.abs().max_element()).max(1e-6);
    a.translation.abs_diff_eq(b.translation, 1e-5 * size) && a.matrix3.abs_diff_eq(b.matrix3, 1e-5 * scale)
}

/// The side of a voxel in world space, in metres, including the scale of parents; the longest side if they stretch it.
/// Always positive.
pub(crate) fn voxel_metres(place: &GlobalTransform) -> f32 {
    let matrix = place.affine().matrix3;
    let sides = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(Vec3A::length);
    sides.into_iter().fold(f32::MIN_POSITIVE, f32::max)
}

/// How far from the origin terrains may be, in metres: farther away, places are rounded to more than a centimetre.
const FAR: f32 = 100_000.0;

/// Logs, once for each terrain, what does not work where it is.
fn check_place(entity: Entity, terrain: &Terrain, global: &GlobalTransform, reports: &Reports) {
    let matrix = global.affine().matrix3;
    let voxel = terrain.voxel_size();
    let far = global.translation().length();
    if far.is_finite() && far > FAR && reports.is_new(entity, Report::Far) {
        warn!(
            "the terrain {entity} is {:.0} km from the origin, where places are rounded to {:.0} mm: seams and physics get \
             coarse; keep the origin near the players, as plugins for floating origins do",
            far / 1000.0,
            far * f32::EPSILON * 1000.0
        );
    }
    if !is_usable(global) {
        if reports.is_new(entity, Report::NoPlace) {
            warn!(
                "the terrain {entity} cannot be used: its GlobalTransform is not finite, or a scale is 0; give it and its \
                 parents finite transforms"
            );
        }
    } else if matrix.determinant() < 0.0 {
        if reports.is_new(entity, Report::Mirrored) {
            warn!(
                "the terrain {entity} (voxels of {voxel} m) is mirrored by a parent: it can be dug and queried, but is drawn \
                 inside out, because Bevy does not turn triangles; use positive scales"
            );
        }
    } else if is_stretched(global) {
        if reports.is_new(entity, Report::Stretched) {
            warn!(
                "the terrain {entity} (voxels of {voxel} m) is stretched by a parent: the sizes of brushes, which have no \
                 direction, become means, and hairline cracks may show at its seams; scale it evenly"
            );
        }
    } else if !keeps_bits(global) && reports.is_new(entity, Report::Unaligned) {
        warn!(
            "the terrain {entity} is rotated, its scale is not a power of two, or its position is not in whole voxels of \
             {voxel} m: hairline cracks may show at its seams"
        );
    }
}

/// Scales the entities of terrains to the size of their voxels.
pub(in crate::plugin) fn scale_terrains(
    mut terrains: Query<
        (Entity, &Terrain, &mut Transform, &mut TerrainPlace),
        Or<(Changed<Transform>, Changed<Terrain>)>,
    >,
    reports: Reports,
) {
    for (entity, terrain, mut transform, mut place) in &mut terrains {
        scale((entity, terrain), &mut transform, &mut place, &reports);
    }
}

/// Scales one terrain, and logs once a scale of the game's own that this replaces.
pub(in crate::plugin) fn scale(
    (entity, terrain): (Entity, &Terrain),
    transform: &mut Mut<Transform>,
    place: &mut Mut<TerrainPlace>,
    reports: &Reports,
) {
    let size = terrain.voxel_size();
    let (scale, own) = (Vec3::splat(size), transform.scale);
    let former = Vec3::splat(place.scale);
    place.set_if_neq(TerrainPlace { scale: size, ..**place });
    if own == scale {
        return;
    }
    transform.scale = scale;
    // Not one that the plugin wrote for another voxel size.
    if own != Vec3::ONE && own != former && reports.is_new(entity, Report::ScaleReplaced) {
        warn!(
            "the scale {own} of the terrain {entity} was replaced by the size of its voxels, {size} m: choose another \
             `voxel_size` in its `TerrainSettings`, or scale a parent of it"
        );
    }
}

/// Whether places in the world have a counterpart in a terrain here.
pub(in crate::plugin) fn is_usable(place: &GlobalTransform) -> bool {
    let affine = place.affine();
    affine.is_finite() && affine.inverse().is_finite()
}

fn is_stretched(place: &GlobalTransform) -> bool {
    let scale = place.to_scale_rotation_translation().0;
    !(scale / scale.x).abs_diff_eq(Vec3::ONE, 1e-5)
}

/// Whether both sides of seams keep the same bits: they do if the terrain is not rotated, its scale is a power of two,
/// and it is moved by whole voxels.
fn keeps_bits(place: &GlobalTransform) -> bool {
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    scale == Vec3::splat(scale.x)
        && is_power_of_two(scale.x)
        && rotation == Quat::IDENTITY
        && (translation / scale.x).fract() == Vec3::ZERO
}

fn is_power_of_two(number: f32) -> bool {
    let has_mantissa = number.to_bits().trailing_zeros() < f32::MANTISSA_DIGITS - 1;
    number.is_normal() && number > 0.0 && !has_mantissa
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seams_keep_their_bits_on_whole_voxels_of_a_power_of_two() {
        let place = |x, scale| Transform::from_xyz(x, -3.0, 12.0).with_scale(Vec3::splat(scale));
        let keeps = |place: Transform| keeps_bits(&place.into());
        for (x, scale) in [(70.0, 1.0), (0.5, 0.5), (3.0, 0.0625), (-8.0, 1.0)] {
            assert!(keeps(place(x, scale)), "{scale} at {x}");
        }
        for (x, scale) in [(70.5, 1.0), (0.75, 0.5), (70.0, 2.0), (0.0, 0.3), (12.0, 3.0), (0.0, -1.0)] {
            assert!(!keeps(place(x, scale)), "{scale} at {x}");
        }
        assert!(!keeps(Transform::from_scale(Vec3::new(1.0, 2.0, 1.0))));
        assert!(!keeps(Transform::from_rotation(Quat::from_rotation_y(0.5))));
    }

    #[test]
    fn a_parent_may_have_a_scale_of_a_power_of_two_as_well() {
        let terrain = Transform::from_xyz(1.5, 2.0, -4.0).with_scale(Vec3::splat(0.5));
        let below = |parent: Transform| keeps_bits(&(GlobalTransform::from(parent) * terrain));
        assert!([0.25, 1.0, 4.0].into_iter().all(|scale| below(Transform::from_scale(Vec3::splat(scale)))));
        assert!(!below(Transform::from_scale(Vec3::splat(3.0))));
        // Half a voxel of a metre.
        assert!(!below(Transform::from_xyz(0.5, 0.0, 0.0).with_scale(Vec3::splat(2.0))));
    }

    #[test]
    fn powers_of_two_have_no_mantissa() {
        assert!([1.0, 0.125, 64.0, f32::MIN_POSITIVE].into_iter().all(is_power_of_two));
        assert!(![0.0, 3.0, 1.5, -2.0, f32::INFINITY, f32::NAN].into_iter().any(is_power_of_two));
    }
}
