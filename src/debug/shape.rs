//! Brushes as gizmos: previews.

use bevy::gizmos::gizmos::GizmoBuffer;
use bevy::prelude::*;

use crate::brush::Shape;

/// Draws the outline of a brush's shape.
pub fn draw_shape<Config: GizmoConfigGroup, Clear: 'static + Send + Sync>(
    gizmos: &mut GizmoBuffer<Config, Clear>,
    shape: &Shape,
    color: impl Into<Color>,
) {
    let color = color.into();
    match *shape {
        Shape::Sphere { center, radius } => {
            gizmos.sphere(center, radius, color).resolution(48);
        }
        Shape::Cuboid { center, half, rotation } => {
            let place = Transform::from_translation(center).with_rotation(rotation).with_scale(2.0 * half);
            gizmos.cube(place, color);
        }
        Shape::Cylinder { base, axis, radius } => {
            rings(gizmos, [(base, radius), (base + axis, radius)], axis, color);
        }
        Shape::Capsule { from, to, radius } => {
            gizmos.sphere(from, radius, color).resolution(32);
            gizmos.sphere(to, radius, color).resolution(32);
            rings(gizmos, [(from, radius), (to, radius)], to - from, color);
        }
        Shape::Cone { base, axis, radius } => {
            rings(gizmos, [(base, radius), (base + axis, 0.0)], axis, color);
        }
    }
}

/// Two circles across an axis, and four lines between them.
fn rings<Config: GizmoConfigGroup, Clear: 'static + Send + Sync>(
    gizmos: &mut GizmoBuffer<Config, Clear>,
    rings: [(Vec3, f32); 2],
    axis: Vec3,
    color: Color,
) {
    let turn = Quat::from_rotation_arc(Vec3::Z, axis.try_normalize().unwrap_or(Vec3::Y));
    for (middle, radius) in rings.into_iter().filter(|ring| ring.1 > 0.0) {
        gizmos.circle(Isometry3d::new(middle, turn), radius, color).resolution(48);
    }
    let [(a, from), (b, to)] = rings;
    for side in [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y].map(|side| turn * side) {
        gizmos.line(a + side * from, b + side * to, color);
    }
}
