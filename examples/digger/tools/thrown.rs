//! What was just thrown: it leaves the hand right before the eyes, and is seen once it is clear of them.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player;
use crate::world::light::Eyes;

/// Metres from the eyes at which something thrown is seen: nearer by, it would fill the view.
const CLEAR: f32 = 0.7;
/// Seconds after which it is seen wherever it is: a wall may have thrown it back.
const LATEST: f32 = 0.1;

/// Shows what was thrown.
pub struct ThrownPlugin;

impl Plugin for ThrownPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, show.after(player::see).after(BurrowSystems::Commit));
    }
}

/// Just thrown, so many seconds ago, and not seen yet.
#[derive(Component, Clone, Copy, Debug, Default)]
struct Thrown(f32);

/// What bombs and balls have when they leave the hand.
pub fn just_thrown() -> impl Bundle {
    (Thrown::default(), Visibility::Hidden)
}

fn show(
    mut commands: Commands,
    time: Res<Time>,
    eyes: Query<&Transform, With<Eyes>>,
    mut thrown: Query<(Entity, &mut Thrown, &Transform, &mut Visibility)>,
) {
    for (entity, mut thrown, place, mut visibility) in &mut thrown {
        let is_near = eyes.iter().any(|eyes| eyes.translation.distance(place.translation) < CLEAR);
        if !is_near || thrown.0 >= LATEST {
            *visibility = Visibility::Inherited;
            commands.entity(entity).try_remove::<Thrown>();
        }
        thrown.0 += time.delta_secs();
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use bevy::time::TimeUpdateStrategy;

    use super::*;

    #[test]
    fn what_is_thrown_is_seen_once_it_is_clear_of_the_eyes_or_has_had_its_time() {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins)
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(20)))
            .add_systems(Update, show);
        app.world_mut().spawn((Eyes, Transform::default()));
        let mut throw = || app.world_mut().spawn((just_thrown(), Transform::from_xyz(0.0, 0.0, -0.25))).id();
        let (flies, stays) = (throw(), throw());
        let is_seen = |app: &App, thing: Entity| {
            app.world().get::<Visibility>(thing).is_some_and(|visibility| *visibility != Visibility::Hidden)
        };
        for _ in 0..3 {
            app.update();
            assert!(!is_seen(&app, flies) && !is_seen(&app, stays));
        }
        app.world_mut().get_mut::<Transform>(flies).expect("a place").translation.z = -0.8;
        app.update();
        assert!(is_seen(&app, flies) && !is_seen(&app, stays));
        // What comes back is not hidden again.
        app.world_mut().get_mut::<Transform>(flies).expect("a place").translation.z = -0.25;
        for _ in 0..4 {
            app.update();
            assert!(is_seen(&app, flies));
        }
        assert!(is_seen(&app, stays));
    }
}
