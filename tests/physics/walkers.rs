//! Walkers as games build them: with a shield, in a trigger, on a vehicle, crouching.

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::physics::{Character, CharacterSteering};
use bevy_burrow::prelude::*;

use crate::stage::{STEP, Stage, level};

fn seconds(count: f32) -> usize {
    (count / STEP) as usize
}

#[test]
fn a_walker_is_not_in_the_way_of_its_own_shield() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let bare = stage.character(Vec3::new(10.0, 8.0, 20.0), Vec2::X);
    let armed = stage.character(Vec3::new(10.0, 8.0, 30.0), Vec2::X);
    let shield = (Collider::cuboid(0.2, 1.2, 0.8), Transform::from_xyz(0.45, 0.0, 0.0), ChildOf(armed));
    stage.app.world_mut().spawn(shield);
    stage.frames(seconds(3.0));
    let [bare, armed] = [bare, armed].map(|walker| stage.place(walker));
    assert!(bare.x > 22.0 && (armed.x - bare.x).abs() < 0.1, "{armed} instead of {bare}");
    assert!((armed.y - bare.y).abs() < 0.02 && (armed.z - 30.0).abs() < 0.02, "{armed} instead of {bare}");
}

#[test]
fn a_walker_ignores_a_trigger_over_a_step() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    for z in [20.0, 40.0] {
        let step = (Collider::cuboid(10.0, 1.0, 8.0), Transform::from_xyz(25.0, 7.8, z));
        stage.app.world_mut().spawn((RigidBody::Static, step));
    }
    let trigger = (Collider::cuboid(8.0, 6.0, 8.0), Transform::from_xyz(20.0, 9.0, 40.0));
    stage.app.world_mut().spawn((RigidBody::Static, Sensor, trigger));
    // The walker accepts only gentle slopes, so the step's edge counts as too steep: only a look ahead finds its top.
    let walkers = [20.0, 40.0].map(|z| {
        let walker = stage.character(Vec3::new(18.5, 8.0, z), Vec2::X);
        stage.app.world_mut().get_mut::<Character>(walker).expect("a walker").steepest = 0.6;
        walker
    });
    stage.frames(seconds(2.0));
    for walker in walkers {
        let feet = stage.feet(walker);
        assert!((21.0..29.0).contains(&feet.x) && (feet.y - 8.3).abs() < 0.05, "{feet}");
    }
}

#[test]
fn a_walker_climbs_and_descends_a_step_at_any_speed() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let mut walkers = Vec::new();
    for (row, top) in [(15.0, 0.3), (30.0, 0.5), (45.0, 0.58)] {
        let step = (Collider::cuboid(2.0, 1.0, 10.0), Transform::from_xyz(25.0, 7.5 + top, row));
        stage.app.world_mut().spawn((RigidBody::Static, step));
        for (number, speed) in (0..5).zip([0.3, 0.6, 1.0, 2.0, 5.0]) {
            let start = Vec3::new(23.2, 8.0, row - 3.0 + 1.5 * number as f32);
            walkers.push((stage.character(start, Vec2::X * speed / 5.0), top, speed));
        }
    }
    for _ in 0..seconds(18.0) {
        stage.frame();
        for &(walker, top, speed) in &walkers {
            let feet = stage.feet(walker);
            // The soles stay a skin's width above the ground.
            let expected = match feet.x {
                24.1..25.9 => 8.0 + top,
                26.5..30.0 => 8.0,
                _ => continue,
            };
            assert!((feet.y - expected).abs() < 0.05, "at {speed} m/s over {top} m: {feet}");
        }
        walkers.retain(|&(walker, ..)| stage.feet(walker).x < 30.0);
    }
    let late = walkers.iter().find(|&&(walker, ..)| stage.feet(walker).x < 26.5);
    assert_eq!(late.map(|(_, top, speed)| (top, speed)), None, "a walker did not get over the step");
}

#[test]
fn a_walker_does_not_sink_when_the_ground_below_it_is_remeshed() {
    let (mut stage, _) = Stage::with_ground(level(160, 1.0));
    let start =
        |number: usize| Vec3::new(6.0 + 1.3 * (number % 4) as f32, 8.0, 6.5 + 6.1 * (number / 4) as f32);
    let walkers: Vec<Entity> = (0..96).map(|number| stage.character(start(number), Vec2::X)).collect();
    stage.frames(seconds(0.5));
    let mut lowest = f32::INFINITY;
    for frame in 0..seconds(14.0) {
        if frame % 2 == 0 {
            // The surface stays, but is drawn by another part: the tile loses it, and a chunk gets it.
            let ahead = 1.5 + (frame % 13) as f32 * 0.3;
            let place = stage.feet(walkers[frame * 7 % walkers.len()]) + Vec3::X * ahead;
            stage.send(Brush::paint(Shape::sphere(place, 1.5), MaterialId(2)));
        }
        stage.frame();
        let feet = walkers.iter().map(|&walker| stage.feet(walker).y);
        lowest = feet.fold(lowest, f32::min);
    }
    assert!(lowest > 8.0, "{lowest}");
    let went = walkers.iter().map(|&walker| stage.place(walker).x).fold(f32::INFINITY, f32::min);
    assert!(went > 60.0, "{went}");
}

#[test]
fn a_walker_with_a_parent_walks_in_world_space() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let turned = Quat::from_rotation_y(1.2);
    let vehicle = Transform::from_xyz(12.0, 3.0, 7.0).with_rotation(turned).with_scale(Vec3::splat(2.0));
    let parent = stage.app.world_mut().spawn(vehicle).id();
    let character = Character::default();
    let place = character.standing_at(Vec3::new(20.0, 8.1, 30.0));
    let local = GlobalTransform::from(place).reparented_to(&GlobalTransform::from(vehicle));
    // Children have their parents' scale, and so do their colliders.
    let local = local.with_rotation(turned.inverse()).with_scale(Vec3::splat(0.5));
    let steering = CharacterSteering { direction: Vec2::X, ..default() };
    let walker = stage.app.world_mut().spawn((character.clone(), steering, local, ChildOf(parent))).id();
    let place = |stage: &Stage| stage.app.world().get::<Position>(walker).expect("a body").0;
    stage.frames(seconds(2.0));
    let feet = character.feet(place(&stage));
    assert!((28.0..31.0).contains(&feet.x) && (feet.z - 30.0).abs() < 0.05, "{feet}");
    assert!((feet.y - 8.0).abs() < 0.05 && stage.motion(walker).grounded, "{feet}");
    // A standing walker is carried along.
    stage.app.world_mut().get_mut::<CharacterSteering>(walker).expect("a walker").direction = Vec2::ZERO;
    stage.frames(seconds(1.0));
    let before = place(&stage);
    stage.app.world_mut().get_mut::<Transform>(parent).expect("a vehicle").translation.x += 5.0;
    stage.frames(seconds(0.5));
    assert!(place(&stage).distance(before + Vec3::X * 5.0) < 0.05, "{} from {before}", place(&stage));
}

/// The height of a walker's capsule.
fn capsule_height(stage: &Stage, walker: Entity) -> f32 {
    let collider = stage.app.world().get::<Collider>(walker).expect("a walker has a collider");
    let aabb = collider.aabb(Vec3::ZERO, Quat::IDENTITY);
    aabb.max.y - aabb.min.y
}

/// Checks that a walker with this character stands at height 8 for half a second.
fn check_standing(stage: &mut Stage, walker: Entity, character: &Character) {
    let height = character.height;
    for _ in 0..seconds(0.5) {
        stage.frame();
        let feet = character.feet(stage.place(walker));
        assert!((feet.y - 8.0).abs() < 0.03, "{height} m tall, at {feet}");
    }
    assert!(
        (capsule_height(stage, walker) - height).abs() < 0.01,
        "{} for {height}",
        capsule_height(stage, walker)
    );
    assert!(stage.motion(walker).grounded);
}

#[test]
fn a_walker_that_crouches_is_lower_and_keeps_its_feet_on_the_ground() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let walker = stage.character(Vec3::new(20.0, 8.0, 30.0), Vec2::ZERO);
    stage.frames(seconds(1.0));
    for height in [1.0, 1.8, 1.2] {
        let character = |stage: &mut Stage| {
            let mut character = stage.app.world_mut().get_mut::<Character>(walker).expect("a walker");
            character.height = height;
            character.clone()
        };
        let character = character(&mut stage);
        check_standing(&mut stage, walker, &character);
    }
}

#[test]
fn a_walker_that_is_given_another_character_keeps_its_feet_on_the_ground() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let walker = stage.character(Vec3::new(20.0, 8.0, 30.0), Vec2::ZERO);
    stage.frames(seconds(1.0));
    for height in [1.0, 2.4, 1.8] {
        let character = Character { height, ..default() };
        stage.app.world_mut().entity_mut(walker).insert(character.clone());
        check_standing(&mut stage, walker, &character);
    }
}

#[test]
fn a_walker_whose_character_was_removed_gets_its_capsule_again() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let walker = stage.character(Vec3::new(20.0, 8.0, 30.0), Vec2::ZERO);
    stage.frames(2);
    stage.app.world_mut().entity_mut(walker).remove::<(Character, Collider)>();
    stage.frames(2);
    stage.app.world_mut().entity_mut(walker).insert(Character { height: 1.2, ..default() });
    stage.frames(2);
    assert!((capsule_height(&stage, walker) - 1.2).abs() < 0.01, "{}", capsule_height(&stage, walker));
}

#[test]
fn a_walker_keeps_the_collider_of_the_game_while_its_size_stays() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let walker = stage.character(Vec3::new(20.0, 8.0, 30.0), Vec2::ZERO);
    stage.frames(2);
    stage.app.world_mut().entity_mut(walker).insert(Collider::cuboid(0.8, 1.5, 0.8));
    for speed in [3.0, 4.0] {
        stage.app.world_mut().get_mut::<Character>(walker).expect("a walker").walk_speed = speed;
        stage.frames(2);
        assert_eq!(capsule_height(&stage, walker), 1.5);
    }
}
