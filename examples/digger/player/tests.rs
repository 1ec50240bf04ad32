//! Facts about the player's body and eyes.

use std::time::Duration;

use bevy::input::InputPlugin as DevicePlugin;
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::player::input::InputPlugin;

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
