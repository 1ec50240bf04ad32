//! Colliders are created near sources and removed with them, and nothing falls where they are missing.

use std::time::{Duration, Instant};

use avian3d::collider_tree::ColliderTreeOptimization;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{ColliderSource, GroundBody, GroundCollider, TerrainPhysicsPlugin};
use bevy_burrow::plugin::ShownSurface;
use bevy_burrow::prelude::*;

use crate::stage::{STEP, Stage, level, pit};

#[test]
fn the_settings_of_the_physics_engine_are_the_games_own() {
    let stage = Stage::new();
    let found = stage.app.world().resource::<ColliderTreeOptimization>();
    assert_eq!(*found, ColliderTreeOptimization::default());
}

#[test]
fn ground_has_colliders_near_sources_only_and_they_move_along() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    let source = stage
        .app
        .world_mut()
        .spawn((Transform::from_xyz(40.0, 20.0, 40.0), ColliderSource { radius: 20.0 }))
        .id();
    stage.settle();
    let near = |stage: &mut Stage, middle: Vec2| {
        let ground = stage.ground();
        let world = stage.app.world();
        let places = ground.iter().map(|&body| world.get::<Position>(body).expect("a body").xz() + 8.0);
        let far = places.map(|place| place.distance(middle)).fold(0.0, f32::max);
        (ground.len(), far)
    };
    let (count, far) = near(&mut stage, Vec2::splat(40.0));
    assert!((9..40).contains(&count) && far < 50.0, "{count} colliders, up to {far} m away");
    stage.app.world_mut().get_mut::<Transform>(source).expect("the source exists").translation.x = 200.0;
    stage.frame();
    stage.settle();
    let (count, far) = near(&mut stage, Vec2::new(200.0, 40.0));
    assert!((9..40).contains(&count) && far < 50.0, "{count} colliders, up to {far} m away");
    stage.app.world_mut().despawn(source);
    stage.frames_until("all colliders go", |stage| stage.ground().is_empty());
}

#[test]
fn a_body_without_ground_is_held_until_a_source_comes() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    let ball = stage.ball(Vec3::new(120.0, 9.0, 120.0), 0.5, Vec3::new(0.0, -3.0, 0.0));
    let person = stage.character(Vec3::new(125.0, 8.3, 120.0), Vec2::ZERO);
    let high = stage.ball(Vec3::new(130.0, 90.0, 120.0), 0.5, Vec3::ZERO);
    stage.frames(200);
    assert!(stage.is_held(ball) && stage.is_held(person) && !stage.is_held(high));
    assert!(stage.place(ball).y > 8.5 && stage.feet(person).y > 8.0 && stage.place(high).y < 60.0);
    stage.app.world_mut().spawn((Transform::from_xyz(120.0, 0.0, 120.0), ColliderSource { radius: 20.0 }));
    stage.settle();
    stage.frames((4.0 / STEP) as usize);
    assert!(!stage.is_held(ball) && !stage.is_held(person) && !stage.is_held(high));
    for body in [ball, high] {
        assert!((stage.place(body).y - 8.5).abs() < 0.05, "{}", stage.place(body));
    }
    assert!((stage.feet(person).y - 8.0).abs() < 0.05, "{}", stage.feet(person));
}

#[test]
fn a_fast_source_always_has_ground_below_its_body() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(512, 1.0));
    let ball = stage.ball(Vec3::new(10.0, 8.6, 250.0), 0.5, Vec3::X * 60.0);
    stage.app.world_mut().entity_mut(ball).insert(ColliderSource { radius: 8.0 });
    let mut lowest = f32::INFINITY;
    stage.frames_until("it crosses the world", |stage| {
        lowest = lowest.min(stage.place(ball).y);
        stage.place(ball).x > 490.0
    });
    assert!(lowest > 8.4, "{lowest}");
}

#[test]
fn colliders_are_built_where_a_held_source_was_going() {
    // The ground that each needs next lies outside its radius: ahead, to both sides, or below its rim.
    let cases = [
        (Vec3::X * 60.0, 0.5, 1.0),
        (Vec3::new(300.0, 0.0, 300.0), 0.5, 1.0),
        (Vec3::new(-3000.0, 0.0, 40.0), 0.5, 0.0),
        (Vec3::ZERO, 6.0, 1.0),
    ];
    for (velocity, ball_radius, radius) in cases {
        let mut stage = Stage::new();
        stage.app.world_mut().spawn(level(512, 1.0));
        // Without a source, ground is shown but has no colliders.
        stage.frames_until("the ground is shown", |stage| {
            let world = stage.app.world_mut();
            world.query::<&Tile>().iter(world).next().is_some()
        });
        let ball = stage.ball(Vec3::new(259.0, 8.1 + ball_radius, 259.0), ball_radius, velocity);
        stage.app.world_mut().entity_mut(ball).insert(ColliderSource { radius });
        stage.frame();
        assert!(stage.is_held(ball), "there is no collider yet");
        stage.frames_until("it is released", |stage| !stage.is_held(ball));
    }
}

#[test]
fn edits_far_from_all_sources_have_colliders_when_a_source_comes() {
    let mut stage = Stage::new();
    let terrain = stage.app.world_mut().spawn(level(256, 1.0)).id();
    let source = stage
        .app
        .world_mut()
        .spawn((Transform::from_xyz(40.0, 8.0, 40.0), ColliderSource { radius: 20.0 }))
        .id();
    stage.settle();
    stage.dig([pit(200.0, 8.0, 200.0, 5.0), pit(40.0, 8.0, 40.0, 3.0)]);
    stage.app.world_mut().get_mut::<Transform>(source).expect("the source exists").translation =
        Vec3::new(200.0, 8.0, 200.0);
    stage.frame();
    stage.settle();
    let ball = stage.ball(Vec3::new(200.0, 6.0, 200.0), 0.5, Vec3::ZERO);
    stage.frames((3.0 / STEP) as usize);
    assert!((3.3..4.0).contains(&stage.place(ball).y), "{}", stage.place(ball));
    // And back to what was dug meanwhile.
    stage.dig([pit(40.0, 5.0, 40.0, 3.0)]);
    stage.app.world_mut().get_mut::<Transform>(source).expect("the source exists").translation =
        Vec3::new(40.0, 8.0, 40.0);
    stage.frame();
    stage.settle();
    let ball = stage.ball(Vec3::new(40.0, 7.0, 40.0), 0.5, Vec3::ZERO);
    stage.frames((3.0 / STEP) as usize);
    assert!((2.2..3.0).contains(&stage.place(ball).y), "{}", stage.place(ball));
    assert!(stage.terrain(terrain).world().check_seams().is_flawless());
}

#[test]
fn edits_just_outside_a_sources_radius_update_existing_colliders() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    let place = Transform::from_xyz(56.0, 8.0, 40.0);
    let source = stage.app.world_mut().spawn((place, ColliderSource { radius: 20.0 })).id();
    stage.settle();
    // The tile from x = 64 on keeps its collider, though it is now outside the radius.
    stage.app.world_mut().get_mut::<Transform>(source).expect("the source exists").translation.x = 40.0;
    stage.frame();
    stage.settle();
    let ball = stage.ball(Vec3::new(72.0, 8.5, 40.0), 0.5, Vec3::ZERO);
    stage.frames(10);
    assert!(!stage.is_held(ball));
    stage.dig([pit(72.0, 8.0, 40.0, 3.0)]);
    stage.frames((2.0 / STEP) as usize);
    assert!(!stage.is_held(ball) && (5.0..6.0).contains(&stage.place(ball).y), "{}", stage.place(ball));
}

#[test]
fn colliders_go_with_their_terrain() {
    let (mut stage, terrain) = Stage::with_ground(level(64, 1.0));
    assert!(!stage.ground().is_empty());
    stage.app.world_mut().entity_mut(terrain).insert(level(32, 1.0));
    stage.frames_until("the new world's colliders are there", |stage| stage.ground().len() == 4);
    stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
    stage.frames_until("all colliders go", |stage| stage.ground().is_empty());
    let world = stage.app.world_mut();
    assert_eq!(world.query::<&GroundBody>().iter(world).count(), 0);
}

#[test]
fn no_collider_is_newer_than_the_shown_ground() {
    let (mut stage, entity) = Stage::with_ground(level(192, 1.0));
    for number in 0..6 {
        // A change made by the game is loaded in the background and shown once complete. Meanwhile a part loses its
        // collider.
        let world = stage.app.world_mut();
        let part =
            world.query_filtered::<Entity, With<GroundCollider>>().iter(world).next().expect("one is there");
        world.entity_mut(part).remove::<GroundCollider>();
        let mut terrain = world.get_mut::<Terrain>(entity).expect("it stays");
        let revision = terrain.world().revision();
        terrain.apply([pit(20.0 + 25.0 * number as f32, 8.0, 90.0, 5.0)]);
        assert!(terrain.world().revision() > revision);
        stage.frames_until("the new ground is shown", |stage| {
            let world = stage.app.world_mut();
            let shown = world.query::<&ShownSurface>().iter(world).map(|shown| shown.revision).max();
            let made = world.query::<&GroundCollider>().iter(world).map(|ground| ground.revision).max();
            assert!(made <= shown, "a collider of revision {made:?}, but {shown:?} is shown");
            shown > Some(revision)
        });
        stage.settle();
    }
}

#[test]
fn a_collider_that_a_game_despawns_is_made_again() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let ground = stage.ground();
    let ball = stage.ball(Vec3::new(20.0, 8.5, 20.0), 0.5, Vec3::ZERO);
    stage.frames(2);
    for &body in &ground {
        stage.app.world_mut().despawn(body);
    }
    stage.settle();
    assert_eq!(stage.ground().len(), ground.len());
    stage.frames((1.0 / STEP) as usize);
    assert!((stage.place(ball).y - 8.5).abs() < 0.05, "{}", stage.place(ball));
}

#[test]
fn pending_colliders_hold_no_reference_to_the_world() {
    let (mut stage, entity) = Stage::with_ground(level(256, 1.0));
    for _ in 0..8 {
        let bodies = stage.ground();
        let world = stage.app.world_mut();
        for body in bodies {
            let part = world.get::<ChildOf>(body).expect("a child of its tile or chunk").parent();
            world.entity_mut(part).remove::<GroundCollider>();
            world.despawn(body);
        }
        // The world is also referenced by its terrain and by this test.
        let mut frames = 0;
        stage.frames_until("the colliders are there", |stage| {
            let world = stage.terrain(entity).snapshot();
            assert_eq!(std::sync::Arc::strong_count(&world), 2, "while {:?}", stage.figures());
            frames += 1;
            frames > 3 && stage.figures().missing == 0
        });
    }
}

#[test]
fn upkeep_visits_only_changed_places() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(1024, 1.0));
    let place = |number: i32| {
        Transform::from_xyz(80.3 + 90.0 * (number % 10) as f32, 9.0, 80.0 + 90.0 * (number / 10) as f32)
    };
    let source = |number| (place(number), ColliderSource { radius: 24.0 }, LinearVelocity(Vec3::X * 6.4));
    let sources: Vec<Entity> =
        (0..100).map(|number| stage.app.world_mut().spawn(source(number)).id()).collect();
    stage.settle();
    let tiles = stage.app.world_mut().query::<&Tile>().iter(stage.app.world()).count() as u64;
    let looked_at = |stage: &Stage| stage.figures().looked_at;
    let before = looked_at(&stage);
    stage.frames(64);
    assert_eq!(looked_at(&stage), before, "nothing happened");
    stage.dig([pit(80.0, 8.0, 80.0, 4.0)]);
    let after_dig = looked_at(&stage);
    assert!((1..40).contains(&(after_dig - before)), "{} for a pit", after_dig - before);
    for _ in 0..64 {
        for &source in &sources {
            stage.app.world_mut().get_mut::<Transform>(source).expect("the source exists").translation.x +=
                0.1;
        }
        stage.frame();
    }
    stage.settle();
    let walked = looked_at(&stage) - after_dig;
    println!("in {tiles} tiles, {walked} were looked at while 100 sources walked for a second");
    assert!((100..tiles).contains(&walked), "{walked}");
    assert!(stage.figures().colliders >= 100 * 9);
}

#[test]
fn an_app_without_a_physics_engine_still_runs() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BurrowPlugins, TerrainPhysicsPlugin))
        .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(STEP)));
    let terrain = app.world_mut().spawn((level(32, 1.0), ColliderSource { radius: f32::INFINITY })).id();
    app.finish();
    app.cleanup();
    let shown = |app: &mut App| app.world_mut().query::<&Tile>().iter(app.world()).count();
    let start = Instant::now();
    while shown(&mut app) == 0 {
        assert!(start.elapsed() < Duration::from_secs(30), "the terrain is not loaded");
        app.update();
    }
    (0..20).for_each(|_| app.update());
    assert!(app.world().get::<Terrain>(terrain).is_some());
}
