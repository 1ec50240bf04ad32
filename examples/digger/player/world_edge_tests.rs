//! Facts about the world's rim.

use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{CharacterPlugin, CharacterSteering, TerrainPhysicsPlugin};

use super::*;
use crate::film::places::{Hillside, Ravine};
use crate::player::body;

const SIDE: i32 = 64;

/// A flat world, 20 high, with someone in it.
fn app(feet: Vec3) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, PhysicsPlugins::default(), BurrowPlugins, TerrainPhysicsPlugin))
        .add_plugins((CharacterPlugin::default(), RimPlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(16)))
        .insert_resource(places())
        .add_message::<Hint>();
    app.finish();
    app.cleanup();
    let ground = Ground::from_fn(SIDE as u32, SIDE as u32, |_, _| 20.0).expect("a small world");
    app.world_mut().spawn(Terrain::new(ground, &TerrainSettings::default()).expect("default settings"));
    let player = app.world_mut().spawn((Player::default(), body::standing_at(feet))).id();
    for _ in 0..60_000 {
        app.update();
        if app.world().get::<CharacterMotion>(player).is_some_and(|motion| motion.grounded) {
            return (app, player);
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("the world did not load");
}

/// The walk begins at (20, 32).
fn places() -> Places {
    let mouth = Vec3::new(64.0, 20.0, 32.0);
    let hillside = Hillside { mouth, inward: Vec2::X, onward: Vec2::X };
    let ravine = Ravine { from: mouth, to: mouth, behind: [mouth; 2], bottom: 20.0 };
    Places { hillside, ravine, corner: mouth }
}

fn feet(app: &App, player: Entity) -> Vec3 {
    let place = app.world().get::<Transform>(player).expect("a body").translation;
    Character::default().feet(place)
}

fn pass(app: &mut App, frames: u32) {
    for _ in 0..frames {
        app.update();
        std::thread::sleep(Duration::from_micros(300));
    }
}

#[test]
fn nobody_walks_or_jumps_over_the_rim() {
    for direction in [Vec2::X, Vec2::NEG_X, Vec2::Y, Vec2::NEG_Y, Vec2::new(1.0, 1.0)] {
        let (mut app, player) = app(Vec3::new(32.0, 20.0, 32.0));
        app.world_mut().entity_mut(player).insert(CharacterSteering { direction, run: true, jump: true });
        for _ in 0..30 {
            pass(&mut app, 15);
            let place = feet(&app, player);
            let inside = |at: f32| (0.0..=SIDE as f32).contains(&at);
            assert!(inside(place.x) && inside(place.z) && place.y > 19.9, "{place}");
        }
        // At the wall, and not somewhere before it.
        let place = feet(&app, player).xz() - Vec2::splat(32.0);
        assert!(place.dot(direction) > 29.0, "{place}");
    }
}

#[test]
fn who_is_outside_or_in_the_rock_is_brought_back() {
    let (mut app, player) = app(Vec3::new(40.0, 20.0, 40.0));
    let start = Vec3::new(20.0, 20.0, 32.0);
    for (lost, back) in [
        (Vec3::new(-30.0, 20.0, 10.0), start),
        // Whoever is in the ground is lifted by the ground itself.
        (Vec3::new(40.0, -80.0, 40.0), Vec3::new(40.0, 20.0, 40.0)),
        (Vec3::new(500.0, -900.0, 32.0), start),
    ] {
        let place = Character::default().standing_at(lost);
        app.world_mut().entity_mut(player).insert((place, Position(place.translation)));
        // Not at once: undo may just have put ground over him, and he is lifted out of that.
        pass(&mut app, 40);
        assert!(feet(&app, player).distance(start) > 20.0);
        pass(&mut app, 200);
        let place = feet(&app, player);
        assert!(place.distance(back) < 0.5, "{lost} led to {place}");
    }
}

#[test]
fn who_stands_in_a_cave_or_falls_into_a_pit_is_left_alone() {
    let floor = |floor: f64, ceiling: Option<f64>| Span { floor, ceiling };
    let cave = [floor(5.0, Some(9.0)), floor(20.0, None)];
    for (feet, lost) in [(5.0, false), (4.0, false), (30.0, false), (12.0, false), (1.5, false), (0.5, true)]
    {
        assert_eq!(is_lost(Vec3::new(3.0, feet, 3.0), &cave), lost, "{feet}");
    }
    assert!(is_lost(Vec3::NAN, &cave) && is_lost(Vec3::ZERO, &[]));
}
