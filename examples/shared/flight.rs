//! A flying camera. Shared by examples, which include this file by path.

use bevy::camera_controller::free_camera::FreeCamera;
use bevy::prelude::*;

/// A camera that flies at `walk_speed` metres per second, and at `run_speed` with the left Shift key.
pub fn free_camera(walk_speed: f32, run_speed: f32) -> FreeCamera {
    FreeCamera {
        walk_speed,
        run_speed,
        // A key that no keyboard has. With Bevy's default, M, the cursor would vanish until M is pressed again.
        keyboard_key_toggle_cursor_grab: KeyCode::F35,
        ..default()
    }
}
