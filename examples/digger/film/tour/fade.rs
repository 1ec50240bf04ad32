//! What hangs before the tour's camera: a curtain between scenes, and the name of the game.

use bevy::prelude::*;

use crate::ui::art::Art;
use crate::ui::widgets;

/// Seconds in which one scene fades into the next.
pub const FADE: f32 = 0.4;

/// A black sheet.
#[derive(Component)]
struct Curtain;

/// The name of the game, on the first and the last frames.
#[derive(Component)]
struct Signature;

/// Hangs up both; of the name nothing is seen yet.
pub fn hang(world: &mut World) {
    let logo = ImageNode::new(world.resource::<Art>().logo.clone());
    let middle =
        Node { align_items: AlignItems::Center, justify_content: JustifyContent::Center, ..widgets::full() };
    let size = Node { width: percent(46), ..default() };
    world.spawn((middle, GlobalZIndex(9), children![(Signature, logo, size)]));
    world.spawn((Curtain, widgets::full(), GlobalZIndex(10), BackgroundColor(Color::BLACK)));
    sign(world, 0.0);
}

/// How dark it is after a part of a scene that takes so many seconds: the curtain goes up at its begin and down at its
/// end. Nobody begins with a black picture, so before the first scene it is up.
pub fn shade(part: f32, seconds: f32, is_first: bool) -> f32 {
    let hangs = if is_first { 0.0 } else { 1.0 };
    (hangs - part * seconds / FADE).max(1.0 - (1.0 - part) * seconds / FADE).clamp(0.0, 1.0)
}

/// How much is seen of the curtain.
pub fn draw(world: &mut World, alpha: f32) {
    let mut sheets = world.query_filtered::<&mut BackgroundColor, With<Curtain>>();
    for mut sheet in sheets.iter_mut(world) {
        sheet.0 = Color::BLACK.with_alpha(alpha);
    }
}

/// How much is seen of the name of the game.
pub fn sign(world: &mut World, alpha: f32) {
    let mut signatures = world.query_filtered::<&mut ImageNode, With<Signature>>();
    for mut signature in signatures.iter_mut(world) {
        signature.color = Color::WHITE.with_alpha(alpha);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_begins_and_ends_in_the_dark_but_for_the_first_begin() {
        for (is_first, begin) in [(true, 0.0), (false, 1.0)] {
            assert_eq!([0.0, 0.5, 1.0].map(|part| shade(part, 8.0, is_first)), [begin, 0.0, 1.0]);
        }
        assert!((shade(0.025, 8.0, false) - 0.5).abs() < 1e-5, "half of a fade");
    }
}
