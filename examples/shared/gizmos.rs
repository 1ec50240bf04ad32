//! Gizmo settings for brush previews. Shared by examples, which include this file by path.

use bevy::prelude::*;

/// Draws gizmos through the ground: half of a brush is inside it, but all of it should be visible.
pub fn show_through_ground(mut store: ResMut<GizmoConfigStore>) {
    let (config, _) = store.config_mut::<DefaultGizmoConfigGroup>();
    config.depth_bias = -1.0;
    config.line.width = 1.5;
}
