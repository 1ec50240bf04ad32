//! What a tool would change, drawn on the ground.

use bevy::prelude::*;
use bevy_burrow::debug::draw_shape;

use crate::phase::Phase;
use crate::player::Playing;
use crate::tools::{Hand, Tool};

/// Shows what would be changed.
pub struct PreviewPlugin;

impl Plugin for PreviewPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, lift_gizmos)
            .add_systems(Update, show_preview.in_set(Playing).run_if(in_state(Phase::Playing)));
    }
}

/// A brush is half inside the ground, and all of it should be seen.
fn lift_gizmos(mut store: ResMut<GizmoConfigStore>) {
    let (config, _) = store.config_mut::<DefaultGizmoConfigGroup>();
    config.depth_bias = -1.0;
    config.line.width = 1.5;
}

/// The rim of what a tool would change, laid on the ground, or the body that it would build.
fn show_preview(hand: Res<Hand>, mut gizmos: Gizmos) {
    let Some(aim) = hand.aim.filter(|_| hand.preview) else { return };
    let colour = Color::srgba(1.0, 0.85, 0.25, 0.75);
    let radius = hand.radius(hand.tool);
    match hand.tool {
        Tool::Pickaxe | Tool::Shovel | Tool::Drill | Tool::Painter => {
            let flat = Quat::from_rotation_arc(Vec3::Z, aim.normal.normalize_or(Vec3::Y));
            let place = aim.place + aim.normal * 0.05;
            gizmos.circle(Isometry3d::new(place, flat), radius, colour).resolution(48);
        }
        Tool::Builder => draw_shape(&mut gizmos, &hand.form.shape(&aim, radius), colour),
        Tool::Bomb | Tool::Lamp | Tool::Ball => {}
    }
}
