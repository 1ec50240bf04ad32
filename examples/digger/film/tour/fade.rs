//! What is drawn over the tour: the fade between scenes, and the logo.

use bevy::prelude::*;

use crate::ui::images::Images;
use crate::ui::widgets;

/// Seconds of a fade.
pub const FADE: f32 = 0.4;

/// A black sheet over the picture.
#[derive(Component)]
struct FadeOverlay;

/// The name of the game, at the start and the end.
#[derive(Component)]
struct Logo;

/// Spawns both, invisible.
pub fn spawn(world: &mut World) {
    let logo = ImageNode::new(world.resource::<Images>().logo.clone()).with_color(Color::NONE);
    let size = Node { width: percent(46), ..default() };
    world.spawn((widgets::centered(), GlobalZIndex(9), children![(Logo, logo, size)]));
    world.spawn((FadeOverlay, widgets::full(), GlobalZIndex(10), BackgroundColor(Color::NONE)));
}

/// The opacity of the overlay at a part, 0 to 1, of a scene. Scenes fade in and out, but the first one starts bright.
pub fn opacity(part: f32, seconds: f32, is_first: bool) -> f32 {
    let start = if is_first { 0.0 } else { 1.0 };
    (start - part * seconds / FADE).max(1.0 - (1.0 - part) * seconds / FADE).clamp(0.0, 1.0)
}

pub fn set_overlay(world: &mut World, opacity: f32) {
    let mut overlays = world.query_filtered::<&mut BackgroundColor, With<FadeOverlay>>();
    for mut overlay in overlays.iter_mut(world) {
        overlay.0 = Color::BLACK.with_alpha(opacity);
    }
}

pub fn set_logo(world: &mut World, opacity: f32) {
    let mut logos = world.query_filtered::<&mut ImageNode, With<Logo>>();
    for mut logo in logos.iter_mut(world) {
        logo.color = Color::WHITE.with_alpha(opacity);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_fade_in_and_out_except_for_the_first_start() {
        for (is_first, start) in [(true, 0.0), (false, 1.0)] {
            assert_eq!([0.0, 0.5, 1.0].map(|part| opacity(part, 8.0, is_first)), [start, 0.0, 1.0]);
        }
        assert!((opacity(0.025, 8.0, false) - 0.5).abs() < 1e-5, "half of a fade");
    }
}
