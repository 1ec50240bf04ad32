//! Code that bombs and balls share: throwing.

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::player::camera::{self, PlayerCamera};
use crate::world::landscape::DespawnOnNewGame;

/// Nearer to the camera than this many metres, a thrown thing is hidden, because it would fill the view.
const VISIBLE_DISTANCE: f32 = 0.7;
/// After this many seconds it is visible everywhere: it may have bounced back from a wall.
const MAX_HIDDEN_TIME: f32 = 0.1;

/// Shows things some time after they were thrown.
pub struct ThrownPlugin;

impl Plugin for ThrownPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, show.after(camera::follow_player).after(BurrowSystems::Commit));
    }
}

/// A thrown object that is still hidden, and the seconds since it was thrown.
#[derive(Component, Clone, Copy, Debug, Default)]
struct JustThrown(f32);

/// The components of a thing that starts at the camera and rolls as it flies.
pub fn thrown(place: Vec3, velocity: Vec3, spin: f32) -> impl Bundle {
    (
        JustThrown::default(),
        DespawnOnNewGame,
        Visibility::Hidden,
        Transform::from_translation(place),
        LinearVelocity(velocity),
        AngularVelocity(velocity.cross(Vec3::Y) * -spin),
    )
}

fn show(
    mut commands: Commands,
    time: Res<Time>,
    cameras: Query<&Transform, With<PlayerCamera>>,
    mut things: Query<(Entity, &mut JustThrown, &Transform, &mut Visibility)>,
) {
    for (entity, mut thrown, place, mut visibility) in &mut things {
        let is_near =
            cameras.iter().any(|camera| camera.translation.distance(place.translation) < VISIBLE_DISTANCE);
        if !is_near || thrown.0 >= MAX_HIDDEN_TIME {
            *visibility = Visibility::Inherited;
            commands.entity(entity).try_remove::<JustThrown>();
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
    fn a_thrown_thing_is_shown_once_it_is_away_from_the_camera_or_after_some_time() {
        let mut app = App::new();
        app.add_plugins(MinimalPlugins)
            .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(20)))
            .add_systems(Update, show);
        app.world_mut().spawn((PlayerCamera, Transform::default()));
        let place = Vec3::new(0.0, 0.0, -0.25);
        let [flies, stays] = [(); 2].map(|()| app.world_mut().spawn(thrown(place, Vec3::ZERO, 0.0)).id());
        let is_shown =
            |app: &App, thing| app.world().get::<Visibility>(thing) == Some(&Visibility::Inherited);
        for _ in 0..3 {
            app.update();
            assert!(!is_shown(&app, flies) && !is_shown(&app, stays));
        }
        app.world_mut().get_mut::<Transform>(flies).expect("a place").translation.z = -0.8;
        app.update();
        assert!(is_shown(&app, flies) && !is_shown(&app, stays));
        // It is not hidden again when it comes back.
        app.world_mut().get_mut::<Transform>(flies).expect("a place").translation.z = -0.25;
        for _ in 0..4 {
            app.update();
            assert!(is_shown(&app, flies));
        }
        assert!(is_shown(&app, stays));
    }
}
