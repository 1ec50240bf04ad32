//! How brushes are drawn before they are used. Examples have it in common; each takes it in by its path.

use bevy::prelude::*;

/// A brush is half inside the ground, and all of it should be seen.
pub fn show_through_ground(mut store: ResMut<GizmoConfigStore>) {
    let (config, _) = store.config_mut::<DefaultGizmoConfigGroup>();
    config.depth_bias = -1.0;
    config.line.width = 1.5;
}
