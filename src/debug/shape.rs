//! Brushes as gizmos: previews.

use bevy::gizmos::gizmos::GizmoBuffer;
use bevy::prelude::*;

use crate::brush::Shape;

impl Shape {
    /// Draws the shape's outline.
    pub fn draw<Config: GizmoConfigGroup, Clear: 'static + Send + Sync>(
        &self,
        gizmos: &mut GizmoBuffer<Config, Clear>,
        color: impl Into<Color>,
    ) {
        let color = color.into();
        self.outline(|from, to| gizmos.line(from, to, color));
    }
}
