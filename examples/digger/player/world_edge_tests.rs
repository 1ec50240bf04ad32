//! Tests of bringing the player back.

use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{CharacterPlugin, TerrainPhysicsPlugin};

use super::*;
use crate::film::places::{Hillside, Ravine};
use crate::player::body;
use crate::test_support::{spawn_flat_terrain, update_until};

/// The player starts at (20, 32).
fn places() -> Places {
    let mouth = Vec3::new(64.0, 20.0, 32.0);
    let hillside = Hillside { mouth, inward: Vec2::X, onward: Vec2::X };
    let ravine = Ravine { from: mouth, to: mouth, behind: [mouth; 2], bottom: 20.0 };
    Places { hillside, ravine, corner: mouth }
}

/// A flat world with a player in it.
fn app(feet: Vec3) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PhysicsPlugins::default(), BurrowPlugins, TerrainPhysicsPlugin))
        .add_plugins((CharacterPlugin::default(), WorldEdgePlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)))
        .insert_resource(places())
        .add_message::<Hint>();
    spawn_flat_terrain(&mut app);
    let player = app.world_mut().spawn((Player::default(), body::standing_at(feet))).id();
    update_until(&mut app, "the player stands", |app| {
        app.world().get::<CharacterMotion>(player).is_some_and(|motion| motion.grounded)
    });
    (app, player)
}

fn feet(app: &App, player: Entity) -> Vec3 {
    let place = app.world().get::<Transform>(player).expect("a body").translation;
    Character::default().feet(place)
}

fn run_frames(app: &mut App, frames: u32) {
    for _ in 0..frames {
        app.update();
        std::thread::sleep(Duration::from_micros(300));
    }
}

#[test]
fn a_player_outside_the_world_or_in_rock_is_brought_back() {
    let (mut app, player) = app(Vec3::new(40.0, 20.0, 40.0));
    let start = Vec3::new(20.0, 20.0, 32.0);
    for (lost, back) in [
        (Vec3::new(-30.0, 20.0, 10.0), start),
        // The plugin's physics lift players out of the ground.
        (Vec3::new(40.0, -80.0, 40.0), Vec3::new(40.0, 20.0, 40.0)),
        (Vec3::new(500.0, -900.0, 32.0), start),
    ] {
        let place = Character::default().standing_at(lost);
        app.world_mut().entity_mut(player).insert((place, Position(place.translation)));
        // Not at once: undo may just have put ground there, and the physics lift the player out of that.
        run_frames(&mut app, 40);
        assert!(feet(&app, player).distance(start) > 20.0);
        run_frames(&mut app, 200);
        let place = feet(&app, player);
        assert!(place.distance(back) < 0.5, "{lost} led to {place}");
    }
}

#[test]
fn a_player_in_a_cave_or_a_pit_is_not_lost() {
    let floor = |floor: f64, ceiling: Option<f64>| Span { floor, ceiling };
    let cave = [floor(5.0, Some(9.0)), floor(20.0, None)];
    for (feet, lost) in [(5.0, false), (4.0, false), (30.0, false), (12.0, false), (1.5, false), (0.5, true)]
    {
        assert_eq!(is_lost(Vec3::new(3.0, feet, 3.0), &cave), lost, "{feet}");
    }
    assert!(is_lost(Vec3::NAN, &cave) && is_lost(Vec3::ZERO, &[]));
}
