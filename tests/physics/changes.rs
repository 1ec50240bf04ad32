//! What a change of the ground does to bodies that rest on it, hang on it, or are in its way.

use std::f32::consts::TAU;

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::physics::{Character, GroundBody, GroundContact, GroundShape, debris_collider};
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::stage::{STEP, Stage, level, pit};

fn seconds(count: f32) -> usize {
    (count / STEP) as usize
}

fn sleeps(stage: &Stage, body: Entity) -> bool {
    stage.app.world().get::<Sleeping>(body).is_some()
}

#[test]
fn a_sleeping_ball_falls_when_its_ground_is_dug_and_others_keep_sleeping() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let near = stage.ball(Vec3::new(20.0, 8.5, 20.0), 0.5, Vec3::ZERO);
    let far = stage.ball(Vec3::new(27.0, 8.5, 27.0), 0.5, Vec3::ZERO);
    stage.frames(seconds(4.0));
    assert!(sleeps(&stage, near) && sleeps(&stage, far));
    stage.dig([pit(20.0, 8.0, 20.0, 3.0)]);
    stage.frames(4);
    assert!(!sleeps(&stage, near) && sleeps(&stage, far));
    stage.frames(seconds(2.0));
    assert!((5.0..6.0).contains(&stage.place(near).y), "{}", stage.place(near));
    assert_eq!(stage.figures().lifted, 0);
}

#[test]
fn bodies_sleeping_on_ground_that_is_removed_or_moved_are_woken() {
    let ways: [(&str, fn(&mut Stage, Entity)); 4] = [
        ("the terrain is despawned", |stage, terrain| {
            stage.app.world_mut().despawn(terrain);
        }),
        ("it is not a terrain any more", |stage, terrain| {
            stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
        }),
        ("its tiles are despawned", |stage, _| {
            let world = stage.app.world_mut();
            let tiles: Vec<Entity> = world.query_filtered::<Entity, With<Tile>>().iter(world).collect();
            for tile in tiles {
                world.despawn(tile);
            }
        }),
        ("it is moved", |stage, terrain| {
            let mut place = stage.app.world_mut().get_mut::<Transform>(terrain).expect("terrains have one");
            place.translation.y -= 3.0;
        }),
    ];
    for (what, happens) in ways {
        let (mut stage, terrain) = Stage::with_ground(level(64, 1.0));
        let ball = stage.ball(Vec3::new(20.0, 8.5, 20.0), 0.5, Vec3::ZERO);
        stage.frames(seconds(4.0));
        assert!(sleeps(&stage, ball));
        happens(&mut stage, terrain);
        stage.frames(4);
        assert!(!sleeps(&stage, ball), "{what}");
    }
}

#[test]
fn bodies_that_are_built_over_are_lifted_on_top() {
    let (mut stage, terrain) = Stage::with_ground(level(64, 1.0));
    let ball = stage.ball(Vec3::new(20.0, 8.5, 20.0), 0.5, Vec3::ZERO);
    let person = stage.character(Vec3::new(21.0, 8.0, 22.0), Vec2::ZERO);
    stage.frames(seconds(1.0));
    stage.dig([Brush::add(Shape::sphere(Vec3::new(20.5, 8.0, 21.0), 4.0), MaterialId(2))]);
    stage.frames(seconds(0.5));
    let model = stage.terrain(terrain).world();
    for body in [ball, person] {
        assert!(!model.is_solid(stage.place(body).as_dvec3()), "{}", stage.place(body));
    }
    assert!(stage.feet(person).y > 10.0 && stage.figures().lifted >= 2);
}

#[test]
fn bodies_that_are_partly_built_over_are_not_squeezed_into_the_ground() {
    let mut rng = Rng::with_seed(5);
    let (mut stage, terrain) = Stage::with_ground(level(256, 1.0));
    let places = (0..20)
        .flat_map(|x| (0..20).map(move |z| Vec3::new(9.3 + 12.0 * x as f32, 8.5, 9.6 + 12.0 * z as f32)));
    let balls: Vec<Entity> = places.map(|place| stage.ball(place, 0.5, Vec3::ZERO)).collect();
    stage.frames(seconds(0.5));
    for round in 0..8 {
        // Overlapping from all sides, mostly from above: the new ground just reaches the ball's centre, or not quite.
        let brush = |&ball: &Entity| {
            let (turn, tilt, radius) = (rng.f32() * TAU, rng.f32() * 1.2 - 0.3, 1.5 + 2.5 * rng.f32());
            let way = Vec3::new(turn.cos() * tilt.cos(), tilt.sin(), turn.sin() * tilt.cos());
            let center = stage.place(ball) + way * (radius - 0.1 + 0.4 * rng.f32());
            Brush::add(Shape::sphere(center, radius), MaterialId(2))
        };
        let brushes: Vec<Brush> = balls.iter().map(brush).collect();
        stage.dig(brushes);
        // The result does not depend on how long the game was paused in between.
        stage.app.world_mut().resource_mut::<Time<Physics>>().pause();
        stage.frames(seconds(3.0));
        stage.app.world_mut().resource_mut::<Time<Physics>>().unpause();
        stage.frames(seconds(1.0));
        let model = stage.terrain(terrain).world();
        let inside = balls.iter().filter(|&&ball| model.is_solid(stage.place(ball).as_dvec3())).count();
        assert_eq!(inside, 0, "of {} balls in round {round}", balls.len());
    }
    assert!(stage.figures().lifted > 800, "{:?}", stage.figures());
}

#[test]
fn bodies_that_do_not_collide_with_ground_are_not_lifted() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let ghosts = [20.0, 24.0].map(|x| {
        let ghost = stage.ball(Vec3::new(x, 7.4, 20.0), 0.5, Vec3::ZERO);
        stage.app.world_mut().entity_mut(ghost).insert(GravityScale(0.0));
        ghost
    });
    stage.app.world_mut().entity_mut(ghosts[0]).insert(Sensor);
    stage.app.world_mut().entity_mut(ghosts[1]).insert(CollisionLayers::NONE);
    stage.frames(seconds(0.2));
    stage.dig([Brush::add(Shape::sphere(Vec3::new(22.0, 8.0, 20.0), 5.0), MaterialId(2))]);
    stage.frames(seconds(0.2));
    for ghost in ghosts {
        assert!((stage.place(ghost).y - 7.4).abs() < 0.01, "{}", stage.place(ghost));
    }
}

#[test]
fn colliders_are_the_surface_that_the_model_has_at_every_scale() {
    for voxel_size in [0.125, 1.0, 4.0] {
        let (mut stage, terrain) = Stage::with_ground(level(32, voxel_size));
        stage.dig([pit(14.0 * voxel_size, 8.0 * voxel_size, 16.0 * voxel_size, 4.3 * voxel_size)]);
        let ground = stage.ground();
        for at in 0..200u32 {
            let (x, z) = (1.0 + (at * 37 % 300) as f32 / 10.0, 1.0 + (at * 53 % 300) as f32 / 10.0);
            let model =
                stage.terrain(terrain).world().height(x.into(), z.into()).expect("in the world") as f32;
            let ray = |collider: &Collider, position: &Position, rotation: &Rotation| {
                let from = Vec3::new(x, 30.0, z) * voxel_size;
                collider.cast_ray(*position, *rotation, from, Vec3::NEG_Y, 60.0 * voxel_size, true)
            };
            let world = stage.app.world();
            let hits = ground.iter().filter_map(|&body| {
                let collider = world.get::<Collider>(body).expect("a body has a collider");
                ray(collider, world.get::<Position>(body)?, world.get::<Rotation>(body)?)
            });
            let hits: Vec<f32> = hits.map(|(distance, _)| 30.0 - distance / voxel_size).collect();
            let highest = hits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            assert!((highest - model).abs() < 1e-3, "at ({x}, {z}): {highest} for {model}, of {hits:?}");
        }
    }
}

#[test]
fn colliders_only_have_drawn_triangles() {
    let (mut stage, terrain) = Stage::with_ground(level(48, 1.0));
    stage.dig([pit(16.0, 8.0, 16.0, 4.0), pit(30.0, 5.0, 24.0, 4.0)]);
    let drawn: usize = stage.terrain(terrain).world().drawn().map(|(_, mesh)| mesh.indices.len() / 3).sum();
    let world = stage.app.world_mut();
    let mut bodies = world.query_filtered::<&Collider, With<GroundBody>>();
    let shapes = bodies.iter(world).map(|body| body.shape().as_shape::<GroundShape>().expect("ground"));
    // Only triangles without area are left out.
    let colliding: usize = shapes.map(GroundShape::triangles).sum();
    assert!(colliding <= drawn && colliding > drawn * 99 / 100, "{colliding} of {drawn}");
}

#[test]
fn a_ball_that_is_dug_down_stays_on_the_ground_all_the_way() {
    let (mut stage, terrain) = Stage::with_ground(level(64, 1.0));
    let ball = stage.ball(Vec3::new(32.0, 8.5, 32.0), 0.5, Vec3::ZERO);
    let mut step = 0;
    stage.frames_until("it is dug down", |stage| {
        let place = stage.place(ball);
        assert!(!stage.terrain(terrain).world().is_solid(place.as_dvec3()), "step {step}: {place}");
        if step % 6 == 0 {
            stage.send(pit(place.x + 0.3, place.y - 1.0, place.z - 0.2, 2.0));
        }
        step += 1;
        place.y < 2.0
    });
}

#[test]
fn a_walker_climbs_steps_and_hills_and_stops_at_walls() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let built = |x: f32, z: f32, height: f32| {
        let (half, top) = (Vec3::new(4.0, 2.0, 3.0), 8.0 + height);
        Brush::add(Shape::cuboid(Vec3::new(x, top - 2.0, z), half), MaterialId(2))
    };
    stage.dig([built(30.0, 10.0, 0.4), built(30.0, 20.0, 2.0)]);
    let up = stage.character(Vec3::new(20.0, 8.0, 10.0), Vec2::X);
    let stopped = stage.character(Vec3::new(20.0, 8.0, 20.0), Vec2::X);
    stage.frames(seconds(2.0));
    assert!((8.3..8.6).contains(&stage.feet(up).y), "{}", stage.feet(up));
    stage.frames(seconds(2.0));
    assert!(stage.feet(up).x > 36.0, "{}", stage.feet(up));
    assert!(stage.feet(stopped).x < 26.0 && stage.feet(stopped).y < 8.2, "{}", stage.feet(stopped));
    assert!(stage.motion(up).grounded && stage.motion(stopped).grounded);
}

#[test]
fn a_walker_jumps_to_its_jump_height_and_stands_still_without_input() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let person = stage.character(Vec3::new(20.0, 8.0, 10.0), Vec2::ZERO);
    stage.frames(seconds(1.0));
    let before = stage.feet(person);
    stage.frames(seconds(2.0));
    assert_eq!(stage.feet(person), before);
    let steering = bevy_burrow::physics::CharacterSteering { jump: true, ..default() };
    stage.app.world_mut().entity_mut(person).insert(steering);
    stage.frame();
    stage.app.world_mut().entity_mut(person).insert(bevy_burrow::physics::CharacterSteering::default());
    let mut highest = f32::NEG_INFINITY;
    for _ in 0..seconds(1.5) {
        stage.frame();
        highest = highest.max(stage.feet(person).y);
    }
    let jump = Character::default().jump_height;
    assert!((highest - before.y - jump).abs() < 0.2, "{} for {jump}", highest - before.y);
    assert!((stage.feet(person).y - before.y).abs() < 0.02 && stage.motion(person).grounded);
}

#[test]
fn a_loose_piece_becomes_a_body_with_its_volume() {
    let mut terrain = level(64, 1.0);
    // A ball in the air, whose surface is a closed mesh.
    terrain.apply([Brush::add(Shape::sphere(Vec3::new(24.0, 24.0, 24.0), 4.0), MaterialId(2))]);
    let chunk = terrain.world().grid().chunk_of(IVec3::new(24, 24, 24));
    let piece = terrain.world().chunk_mesh(chunk);
    for voxel_size in [1.0f32, 0.5] {
        let collider = debris_collider(&piece, voxel_size).expect("a ball has volume");
        let volume = collider.mass_properties(1.0).mass / voxel_size.powi(3);
        assert!((volume / 268.0 - 1.0).abs() < 0.06, "{volume}");
    }
    assert!(debris_collider(&Default::default(), 1.0).is_none());
}

#[test]
fn edits_during_a_pause_do_not_pile_up() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let ball = stage.ball(Vec3::new(20.0, 8.5, 20.0), 0.5, Vec3::ZERO);
    stage.frames(seconds(4.0));
    assert!(sleeps(&stage, ball));
    let swaps = stage.figures().swaps;
    stage.app.world_mut().resource_mut::<Time<Virtual>>().pause();
    for number in 0..40 {
        stage.dig([pit(20.0, 8.0 - number as f32 / 10.0, 20.0, 2.0)]);
    }
    let (swaps, changes) = (stage.figures().swaps - swaps, stage.figures().changes);
    assert!(swaps >= 40 && (1..10).contains(&changes), "{changes} changes of {swaps} colliders");
    assert!(sleeps(&stage, ball));
    stage.app.world_mut().resource_mut::<Time<Virtual>>().unpause();
    stage.frames(seconds(2.0));
    assert!(stage.figures().changes == 0 && stage.figures().woken == 1);
    assert!((2.0..4.0).contains(&stage.place(ball).y), "{}", stage.place(ball));
}

#[test]
fn no_body_is_lifted_onto_ground_that_is_not_shown_yet() {
    let (mut stage, entity) = Stage::with_ground(level(64, 1.0));
    let ball = stage.ball(Vec3::new(20.0, 8.5, 20.0), 0.5, Vec3::ZERO);
    stage.frames(4);
    // A body near a change is watched for a while.
    stage.dig([pit(22.0, 8.0, 20.0, 1.5)]);
    // A change made by the game itself is shown only once it has loaded.
    let mut terrain = stage.app.world_mut().get_mut::<Terrain>(entity).expect("it stays");
    terrain.apply([Brush::add(Shape::sphere(Vec3::new(20.0, 8.0, 20.0), 4.0), MaterialId(2))]);
    stage.frame();
    assert_eq!(stage.figures().lifted, 0);
    stage.frames_until("the ball is lifted", |stage| stage.figures().lifted > 0);
    assert!(stage.place(ball).y > 10.0, "{}", stage.place(ball));
}

#[test]
fn a_body_whose_colliders_are_outside_the_ground_is_not_lifted() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let rock = Shape::cuboid(Vec3::new(30.0, 9.5, 20.0), Vec3::splat(2.0));
    stage.dig([Brush::add(rock, MaterialId(2))]);
    // A ball whose centre of mass lies below it in the ground, and an arch whose transform lies in the rock between
    // its legs.
    let ball = stage.ball(Vec3::new(10.0, 8.5, 20.0), 0.5, Vec3::ZERO);
    stage.app.world_mut().entity_mut(ball).insert((CenterOfMass(Vec3::NEG_Y * 2.0), NoAutoCenterOfMass));
    let leg = |x: f32| (Vec3::new(x, 2.0, 0.0), Quat::IDENTITY, Collider::cuboid(2.0, 4.0, 2.0));
    let top = (Vec3::new(0.0, 4.25, 0.0), Quat::IDENTITY, Collider::cuboid(10.0, 0.5, 2.0));
    let arch = Collider::compound(vec![leg(-4.0), leg(4.0), top]);
    let place = Transform::from_xyz(30.0, 8.0, 20.0);
    let arch = stage.app.world_mut().spawn((RigidBody::Dynamic, arch, place)).id();
    stage.frames(seconds(2.0));
    assert_eq!(stage.figures().lifted, 0);
    for (body, height) in [(ball, 8.5), (arch, 8.0)] {
        assert!((stage.place(body).y - height).abs() < 0.1, "{} for {height}", stage.place(body));
    }
    // A body that is itself in the ground is lifted.
    stage.app.world_mut().get_mut::<Transform>(ball).expect("a body").translation.y = -30.0;
    stage.frames(seconds(1.0));
    assert!(stage.figures().lifted > 0 && stage.place(ball).y > 8.0, "{}", stage.place(ball));
}

#[test]
fn bodies_put_into_the_ground_are_lifted_unless_buried_on_purpose() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    // In ground that never changed.
    let deep = |x: f32| Vec3::new(x, -30.0, 20.0);
    let [lost, kept, off] = [10.0, 20.0, 30.0].map(|x| stage.ball(deep(x), 0.5, Vec3::ZERO));
    stage.app.world_mut().entity_mut(kept).insert(LockedAxes::ALL_LOCKED);
    stage.app.world_mut().entity_mut(off).insert(RigidBodyDisabled);
    stage.frames(seconds(3.0));
    assert!((8.3..8.7).contains(&stage.place(lost).y), "{}", stage.place(lost));
    assert_eq!((stage.place(kept), stage.place(off)), (deep(20.0), deep(30.0)));
    assert_eq!(stage.figures().lifted, 1);
}

#[test]
fn changed_ground_uses_the_current_collision_settings_of_the_game() {
    let (mut stage, _) = Stage::with_ground(level(64, 1.0));
    let before = stage.ground();
    let plain = GroundContact::default();
    let ice = GroundContact {
        friction: Some(Friction::new(0.02)),
        restitution: Some(Restitution::new(0.8)),
        layers: CollisionLayers::from_bits(1, 3),
    };
    let like = |stage: &mut Stage, contact: &GroundContact| {
        let mut ground = stage.ground();
        ground.retain(|&body| {
            let body = stage.app.world().entity(body);
            let (friction, restitution) = (body.get().copied(), body.get().copied());
            let layers = body.get().copied().unwrap_or_default();
            GroundContact { friction, restitution, layers } == *contact
        });
        ground
    };
    stage.app.insert_resource(ice.clone());
    stage.dig([pit(24.0, 8.0, 24.0, 3.0)]);
    let changed = like(&mut stage, &ice);
    assert_eq!(changed.len(), 2, "a tile, and a new chunk");
    assert!(changed.iter().any(|body| before.contains(body)), "the tile's body stays");
    stage.app.insert_resource(plain.clone());
    stage.dig([pit(24.0, 8.0, 24.0, 4.0)]);
    assert_eq!(like(&mut stage, &plain).len(), before.len() + 1);

    // Components that the game adds to one of the bodies survive a dig.
    for &body in &changed {
        stage.app.world_mut().entity_mut(body).insert(Friction::new(0.5));
    }
    stage.dig([pit(24.0, 8.0, 24.0, 5.0)]);
    let rough = GroundContact { friction: Some(Friction::new(0.5)), ..plain };
    let same = like(&mut stage, &rough);
    assert!(same.len() == 2 && same.iter().all(|body| changed.contains(body)), "{same:?} of {changed:?}");
}
