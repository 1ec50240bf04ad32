//! Digging and building with the mouse. Shared by examples, which include this file by path.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

/// Digs and builds balls of a radius in metres where the cursor points.
pub fn use_mouse<const RADIUS: u8>(
    mouse: Res<ButtonInput<MouseButton>>,
    window: Single<&Window>,
    camera: Single<(&Camera, &GlobalTransform)>,
    terrains: Terrains,
    time: Res<Time>,
    mut rest: Local<f32>,
    mut brushes: MessageWriter<Brush>,
) {
    *rest -= time.delta_secs();
    let digs = mouse.pressed(MouseButton::Left);
    let (camera, place) = *camera;
    if *rest > 0.0 || !(digs || mouse.pressed(MouseButton::Middle)) {
        return;
    }
    if let Some(cursor) = window.cursor_position()
        && let Ok(ray) = camera.viewport_to_world(place, cursor)
        && let Some(hit) = terrains.raycast(ray, 500.0)
    {
        *rest = 0.1;
        let ball = Shape::sphere(hit.position, RADIUS.into());
        brushes.write(if digs { Brush::dig(ball) } else { Brush::add(ball, MaterialId(2)) });
    }
}
