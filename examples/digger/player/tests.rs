//! Tests of the player's steering.

use std::time::Duration;

use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::test_support::{app_with_input, hold};
use crate::world::landscape::GroundIsWanted;

/// Physics steps in which a jump was requested.
#[derive(Resource, Default)]
struct Jumps(usize);

#[test]
fn a_tap_between_two_physics_steps_is_one_jump() {
    let mut app = app_with_input();
    // Ten frames for each step.
    app.add_plugins(PlayerPlugin)
        .insert_resource(Time::<Fixed>::from_hz(10.0))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(10)))
        .init_resource::<Jumps>()
        .insert_state(GameState::Playing)
        .add_systems(
            FixedUpdate,
            (|players: Query<&CharacterSteering>, mut jumps: ResMut<Jumps>| {
                jumps.0 += players.iter().filter(|steering| steering.jump).count();
            })
            .in_set(CharacterSystems),
        );
    app.world_mut().spawn((Player::default(), CharacterSteering::default()));
    app.update();
    hold(&mut app, &[Action::Jump]);
    for _ in 0..40 {
        hold(&mut app, &[]);
    }
    assert_eq!(app.world().resource::<Jumps>().0, 1);
}

#[test]
fn the_terrain_of_the_world_before_is_no_place_for_a_player() {
    let mut app = App::new();
    app.add_plugins(PlayerPlugin).insert_resource(GroundIsWanted);
    let entity = app.world_mut().spawn_empty().id();
    for is_ready in [false, true] {
        app.world_mut().trigger(TerrainReady { entity });
        app.world_mut().flush();
        assert_eq!(app.world().contains_resource::<GroundIsReady>(), is_ready);
        app.world_mut().remove_resource::<GroundIsWanted>();
    }
}
