//! Bodies that are held above ground without colliders, while the game keeps changing them.

use std::time::Duration;

use avian3d::physics_transform::PhysicsTransformConfig;
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::physics::{Character, ColliderSource, HeldByGround};
use bevy_burrow::prelude::*;

use crate::stage::{STEP, Stage, level};

/// Positions to which bodies are moved in the next `Update`.
#[derive(Resource, Default)]
struct Teleports(Vec<(Entity, Vec3)>);

fn teleport(mut teleports: ResMut<Teleports>, mut bodies: Query<&mut Transform>) {
    for (body, place) in teleports.0.drain(..) {
        bodies.get_mut(body).expect("the body is there").translation = place;
    }
}

fn source(stage: &mut Stage, x: f32, z: f32) {
    let place = Transform::from_xyz(x, 8.0, z);
    stage.app.world_mut().spawn((place, ColliderSource { radius: 20.0 }));
    stage.settle();
}

/// A ball just above ground that has no collider.
fn held_ball() -> (Stage, Entity) {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    let ball = stage.ball(Vec3::new(120.0, 8.6, 120.0), 0.5, Vec3::ZERO);
    stage.frames_until("the ball is held", |stage| stage.is_held(ball));
    stage.frames(20);
    (stage, ball)
}

fn get<C: Component + Clone>(stage: &Stage, body: Entity) -> Option<C> {
    stage.app.world().get::<C>(body).cloned()
}

#[test]
fn a_body_teleported_over_ground_without_colliders_is_held_before_the_next_step() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    source(&mut stage, 40.0, 40.0);
    stage.app.init_resource::<Teleports>().add_systems(Update, teleport);
    let ball = stage.ball(Vec3::new(40.0, 8.5, 40.0), 0.5, Vec3::ZERO);
    let person = stage.character(Vec3::new(44.0, 8.0, 40.0), Vec2::ZERO);
    stage.frames(30);
    let places = [
        (ball, Vec3::new(200.0, 8.6, 200.0)),
        (person, Character::default().standing_at(Vec3::new(204.0, 8.1, 200.0)).translation),
    ];
    stage.app.world_mut().get_mut::<LinearVelocity>(ball).expect("a body").y = -20.0;
    stage.app.world_mut().resource_mut::<Teleports>().0.extend(places);
    stage.frame();
    // A hitch of the machine: many steps in one frame.
    let hitch = TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(12.0 * STEP));
    stage.app.insert_resource(hitch);
    stage.frames(2);
    stage.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(STEP)));
    for (body, place) in places {
        assert!(stage.is_held(body), "{}", stage.place(body));
        assert!(stage.place(body).distance(place) < 0.01, "{} for {place}", stage.place(body));
    }
    source(&mut stage, 200.0, 200.0);
    stage.frames((2.0 / STEP) as usize);
    assert!(!stage.is_held(ball) && !stage.is_held(person));
    assert!((stage.place(ball).y - 8.5).abs() < 0.05 && (stage.feet(person).y - 8.0).abs() < 0.05);
}

#[test]
fn axes_locked_or_freed_on_a_held_body_stay_so_after_its_release() {
    let locks: [Option<LockedAxes>; 2] = [Some(LockedAxes::ROTATION_LOCKED), None];
    for locked in locks {
        let (mut stage, ball) = held_ball();
        let place = stage.place(ball);
        let mut body = stage.app.world_mut().entity_mut(ball);
        match locked {
            Some(locked) => body.insert(locked),
            None => body.remove::<LockedAxes>(),
        };
        stage.frames(60);
        assert!(stage.is_held(ball) && stage.place(ball).distance(place) < 0.02, "{}", stage.place(ball));
        source(&mut stage, 120.0, 120.0);
        stage.frames(4);
        assert!(!stage.is_held(ball));
        let bits = |locked: Option<LockedAxes>| locked.map(|locked| locked.to_bits());
        assert_eq!(bits(get(&stage, ball)), bits(locked));
    }
}

#[test]
fn a_body_released_by_the_game_has_no_locked_axis() {
    let (mut stage, ball) = held_ball();
    stage.app.world_mut().entity_mut(ball).remove::<HeldByGround>();
    assert!(get::<LockedAxes>(&stage, ball).is_none());
    // There is still no ground.
    stage.frames(4);
    assert!(stage.is_held(ball));
    source(&mut stage, 120.0, 120.0);
    stage.frames(4);
    assert!(!stage.is_held(ball) && get::<LockedAxes>(&stage, ball).is_none());
}

#[test]
fn a_released_body_has_the_velocity_that_the_game_gave_it() {
    let (mut stage, ball) = held_ball();
    let place = stage.place(ball);
    stage.app.world_mut().entity_mut(ball).insert(LinearVelocity(Vec3::X * 6.0));
    stage.frames(60);
    assert!(stage.is_held(ball) && stage.place(ball).distance(place) < 0.2, "{}", stage.place(ball));
    source(&mut stage, 120.0, 120.0);
    stage.frames((0.5 / STEP) as usize);
    assert!(!stage.is_held(ball) && stage.place(ball).x > place.x + 1.0, "{}", stage.place(ball));
}

/// A fast ball that is held above ground with colliders, as there are none where it was going, and has fallen asleep.
fn asleep_on_the_way() -> (Stage, Entity) {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    source(&mut stage, 40.0, 120.0);
    let ball = stage.ball(Vec3::new(48.0, 8.6, 120.0), 0.5, Vec3::X * 150.0);
    stage.frames(120);
    let sleeps = stage.app.world().get::<Sleeping>(ball).is_some();
    assert!(stage.is_held(ball) && sleeps && stage.place(ball).x < 56.0, "{sleeps} {}", stage.place(ball));
    (stage, ball)
}

#[test]
fn a_held_body_that_fell_asleep_continues_when_there_is_ground() {
    let (mut stage, ball) = asleep_on_the_way();
    source(&mut stage, 100.0, 120.0);
    stage.frames_until("it is released", |stage| !stage.is_held(ball));
}

#[test]
fn a_sleeping_held_body_can_be_stopped() {
    let (mut stage, ball) = asleep_on_the_way();
    let mut held = stage.app.world_mut().get_mut::<HeldByGround>(ball).expect("it is held");
    held.velocity = Vec3::ZERO;
    stage.frames(2);
    assert!(!stage.is_held(ball) && stage.place(ball).x < 56.0, "{}", stage.place(ball));
}

#[test]
fn bodies_that_do_not_collide_with_ground_are_not_held() {
    let (mut stage, solid) = held_ball();
    let ghosts = [20.0, 24.0, 28.0, 32.0].map(|x| stage.ball(Vec3::new(x, 8.6, 20.0), 0.5, Vec3::X * 2.0));
    let world = stage.app.world_mut();
    world.entity_mut(ghosts[0]).insert(Sensor);
    world.entity_mut(ghosts[1]).insert(CollisionLayers::NONE);
    world.entity_mut(ghosts[2]).insert(CollisionLayers::new(LayerMask(2), LayerMask(2)));
    world.entity_mut(ghosts[3]).insert(ColliderDisabled);
    let starts = ghosts.map(|ghost| stage.place(ghost));
    for _ in 0..60 {
        stage.frame();
        assert!(stage.is_held(solid) && !ghosts.iter().any(|&ghost| stage.is_held(ghost)));
    }
    for (ghost, start) in ghosts.into_iter().zip(starts) {
        assert!(stage.place(ghost).x > start.x + 1.0, "{} from {start}", stage.place(ghost));
    }
    // A body that the ground no longer collides with is let go.
    stage.app.world_mut().entity_mut(solid).insert(CollisionLayers::NONE);
    stage.frames(2);
    assert!(!stage.is_held(solid) && get::<LockedAxes>(&stage, solid).is_none());
}

/// A box a metre wide on an arm along x, upright; the body itself has no collider.
fn on_an_arm(stage: &mut Stage, x: f32, arm: f32) -> Entity {
    let place = Transform::from_xyz(x, 8.6, 40.0);
    let hand = (Collider::cuboid(1.0, 1.0, 1.0), Transform::from_xyz(arm, 0.0, 0.0));
    let body = (RigidBody::Dynamic, LockedAxes::ROTATION_LOCKED, place);
    stage.app.world_mut().spawn((body, children![hand])).id()
}

#[test]
fn a_body_is_held_if_ground_is_missing_below_its_colliders() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    // Colliders up to x = 64.
    source(&mut stage, 40.0, 40.0);
    let cases = [(57.0, 7.0, true), (70.0, -7.0, false), (57.0, -7.0, false), (70.0, 7.0, true)];
    for (x, arm, is_held) in cases {
        let body = on_an_arm(&mut stage, x, arm);
        stage.frames(60);
        assert_eq!(stage.is_held(body), is_held, "at {x}, with a collider at {}", x + arm);
        let place = stage.place(body);
        let height = if is_held { 8.6 } else { 8.5 };
        assert!((place.y - height).abs() < 0.05, "at {place}");
        stage.app.world_mut().despawn(body);
    }
}

#[test]
fn a_held_source_gets_ground_below_all_of_its_colliders() {
    let mut stage = Stage::new();
    stage.app.world_mut().spawn(level(256, 1.0));
    source(&mut stage, 200.0, 200.0);
    // Outside its radius, in the next column of chunks.
    let body = on_an_arm(&mut stage, 75.0, 7.0);
    stage.app.world_mut().entity_mut(body).insert(ColliderSource { radius: 1.0 });
    stage.frame();
    assert!(stage.is_held(body), "there is no collider yet");
    stage.frames_until("it is released", |stage| !stage.is_held(body));
    stage.frames(60);
    assert!((stage.place(body).y - 8.5).abs() < 0.05, "{}", stage.place(body));
}

#[test]
fn a_held_body_that_is_no_longer_dynamic_is_released() {
    for kind in [RigidBody::Kinematic, RigidBody::Static] {
        let (mut stage, ball) = held_ball();
        let place = stage.place(ball);
        stage.app.world_mut().entity_mut(ball).insert(kind);
        stage.frames(2);
        assert!(!stage.is_held(ball) && get::<LockedAxes>(&stage, ball).is_none(), "{kind:?}");
        stage.frames(30);
        assert!(stage.place(ball).distance(place) < 0.01, "{kind:?}: {}", stage.place(ball));
        stage.app.world_mut().entity_mut(ball).insert(RigidBody::Dynamic);
        stage.frames(2);
        assert!(stage.is_held(ball), "{kind:?}");
        assert_eq!(stage.app.world_mut().query::<&HeldByGround>().iter(stage.app.world()).count(), 1);
    }
}

#[test]
fn a_body_flying_into_a_hill_without_colliders_is_held_before_it() {
    let mut stage = Stage::new();
    let mut terrain = level(256, 1.0);
    // The hill begins at x = 150, and is higher than the flight.
    let hill = Shape::cuboid(Vec3::new(170.0, 24.0, 120.0), Vec3::new(20.0, 17.0, 20.0));
    terrain.apply([Brush::add(hill, MaterialId(2))]);
    stage.app.world_mut().spawn(terrain);
    source(&mut stage, 40.0, 120.0);
    let ball = stage.ball(Vec3::new(100.0, 30.0, 120.0), 0.5, Vec3::X * 60.0);
    stage.frames_until("it is held", |stage| stage.is_held(ball));
    assert!((110.0..149.0).contains(&stage.place(ball).x), "{}", stage.place(ball));
}

#[test]
fn no_body_is_held_over_a_tile_that_the_game_despawned() {
    let (mut stage, ball) = held_ball();
    let tile = |stage: &mut Stage| {
        let world = stage.app.world_mut();
        let mut tiles = world.query::<(Entity, &Tile)>();
        tiles.iter(world).find(|(_, tile)| (tile.x, tile.z) == (7, 7)).map(|(tile, _)| tile)
    };
    stage.frames_until("the ground is shown", |stage| tile(stage).is_some());
    stage.frames(120);
    assert!(stage.is_held(ball) && get::<Sleeping>(&stage, ball).is_some());
    // It is held for the ground below it.
    let floor = (Collider::cuboid(16.0, 1.0, 16.0), Transform::from_xyz(120.0, 7.5, 120.0));
    stage.app.world_mut().spawn((RigidBody::Static, floor));
    let tile = tile(&mut stage).expect("it is shown");
    stage.app.world_mut().despawn(tile);
    stage.frames(60);
    assert!(!stage.is_held(ball) && (stage.place(ball).y - 8.5).abs() < 0.05, "{}", stage.place(ball));
}

#[test]
fn a_server_without_transforms_holds_and_lifts_bodies() {
    let mut app = App::new();
    let (position_to_transform, transform_to_position) = (false, false);
    app.insert_resource(PhysicsTransformConfig { position_to_transform, transform_to_position, ..default() });
    let mut stage = Stage::within(app);
    stage.app.world_mut().spawn(level(256, 1.0));
    source(&mut stage, 40.0, 40.0);
    let [lies, buried, held] = [(36.0, 8.6), (44.0, -30.0), (200.0, 8.6)].map(|(x, y)| {
        let place = (Position::from_xyz(x, y, 40.0), Rotation::IDENTITY, GlobalTransform::IDENTITY);
        stage.app.world_mut().spawn((RigidBody::Dynamic, Collider::sphere(0.5), place)).id()
    });
    stage.frames(60);
    assert!(get::<Transform>(&stage, held).is_none());
    assert!(stage.is_held(held) && !stage.is_held(lies) && !stage.is_held(buried));
    for (body, height) in [(lies, 8.5), (buried, 8.5), (held, 8.6)] {
        let place = get::<Position>(&stage, body).expect("a body");
        assert!((place.y - height).abs() < 0.05, "{place:?} for {height}");
    }
}
