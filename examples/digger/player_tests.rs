//! Facts about the player's body and eyes.

use std::time::Duration;

use bevy::input::InputPlugin as DevicePlugin;
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::input::InputPlugin;

/// Steps of the physics that were told to jump.
#[derive(Resource, Default)]
struct Jumps(usize);

#[test]
fn a_tap_between_two_steps_of_the_physics_is_one_jump() {
    let mut app = App::new();
    // Ten frames for each step.
    app.add_plugins((MinimalPlugins, StatesPlugin, DevicePlugin, InputPlugin, PlayerPlugin))
        .insert_resource(Time::<Fixed>::from_hz(10.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)))
        .init_resource::<Settings>()
        .init_resource::<Jumps>()
        .insert_state(Phase::Playing)
        .add_systems(
            FixedUpdate,
            (|players: Query<&CharacterSteering>, mut jumps: ResMut<Jumps>| {
                jumps.0 += players.iter().filter(|steering| steering.jump).count();
            })
            .in_set(CharacterSystems),
        );
    app.world_mut().spawn((Player::default(), CharacterSteering::default()));
    app.update();
    app.world_mut().resource_mut::<Actions>().puppet.push(Action::Jump);
    app.update();
    app.world_mut().resource_mut::<Actions>().puppet.clear();
    for _ in 0..40 {
        app.update();
    }
    assert_eq!(app.world().resource::<Jumps>().0, 1);
}

#[test]
fn what_is_thrown_is_seen_once_it_is_clear_of_the_eyes_or_has_had_its_time() {
    let mut app = App::new();
    app.add_plugins(MinimalPlugins)
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(20)))
        .add_systems(Update, show_thrown);
    app.world_mut().spawn((Eyes, Transform::default()));
    let mut throw = || app.world_mut().spawn((thrown(), Transform::from_xyz(0.0, 0.0, -0.25))).id();
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
