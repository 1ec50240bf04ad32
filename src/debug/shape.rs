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
    shape.outline(|from, to| gizmos.line(from, to, color));
}
