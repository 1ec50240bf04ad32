//! A camera that flies. Examples have it in common; each takes it in by its path.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;

/// Flies at so many metres a second, and faster with the left Shift key.
pub fn free_camera(walk_speed: f32, run_speed: f32) -> FreeCamera {
    FreeCamera {
        walk_speed,
        run_speed,
        // No keyboard has it. On Bevy's M the cursor would go, and not come back before M is pressed again.
        keyboard_key_toggle_cursor_grab: KeyCode::F35,
        ..default()
    }
}
