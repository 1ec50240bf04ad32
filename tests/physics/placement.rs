//! Terrains that are moved, rotated, or scaled by a parent.

use std::f32::consts::{FRAC_PI_2, PI};

use avian3d::parry::shape::{CompositeShape, Shape as _, SharedShape};
use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::lattice::TilePos;
use bevy_burrow::physics::{ColliderSource, GroundBody, GroundShape};

use crate::stage::{STEP, Stage, level, pit};

#[test]
fn colliders_go_along_with_ground_that_turns_slowly() {
    let (mut stage, terrain) = Stage::with_ground(level(64, 1.0));
    // By less than a tenth of a degree in each step.
    for _ in 0..(3.0 / STEP) as usize {
        let mut place = stage.app.world_mut().get_mut::<Transform>(terrain).expect("terrains have one");
        place.rotate_y(6f32.to_radians() * STEP);
        stage.frame();
    }
    let ground = stage.ground();
    assert_eq!(ground.len(), 16);
    let world = stage.app.world();
    for body in ground {
        let part = world.get::<ChildOf>(body).expect("a child of its tile or chunk").parent();
        let there = world.get::<GlobalTransform>(part).expect("parts have one").compute_transform();
        let place = world.get::<Position>(body).expect("a body has a place");
        let turn = world.get::<Rotation>(body).expect("a body has a place");
        let angle = turn.angle_between(Rotation(there.rotation));
        assert!(place.distance(there.translation) < 1e-3, "{place:?} for {there:?}");
        assert!(angle.abs() < 0.01, "{angle} off");
    }
}

#[test]
fn bodies_in_a_turned_terrain_are_lifted_along_its_up_axis() {
    for angle in [0.0, 0.6, FRAC_PI_2, PI] {
        let turn = Quat::from_rotation_z(angle);
        let mut stage = Stage::new();
        stage.app.world_mut().spawn((level(64, 1.0), Transform::from_rotation(turn)));
        stage.app.world_mut().spawn((Transform::default(), ColliderSource { radius: 1e4 }));
        stage.settle();
        let ball = stage.ball(turn * Vec3::new(20.0, 5.0, 20.0), 0.5, Vec3::ZERO);
        let sinks = (GravityScale(0.0), LinearVelocity(turn * Vec3::NEG_Y));
        stage.app.world_mut().entity_mut(ball).insert(sinks);
        stage.frames(30);
        let place = turn.inverse() * stage.place(ball);
        let aside = place.xz().distance(Vec2::splat(20.0));
        assert!((8.4..9.0).contains(&place.y) && aside < 0.1, "turned by {angle}: {place}");
    }
}

#[test]
fn a_scaled_parent_changes_neither_the_reach_of_sources_nor_the_holding_of_bodies() {
    let mut stage = Stage::new();
    let world = stage.app.world_mut();
    let parent = world.spawn(Transform::from_scale(Vec3::splat(0.1))).id();
    world.spawn((level(256, 1.0), ChildOf(parent)));
    world.spawn((Transform::from_xyz(6.0, 0.8, 6.0), ColliderSource { radius: 4.0 }));
    stage.settle();
    let ground = stage.ground();
    // Tiles are 1.6 m wide.
    let middle = |body| stage.app.world().get::<Position>(body).expect("a body").xz() + 0.8;
    let distances = ground.into_iter().map(|body| middle(body).distance(Vec2::splat(6.0)));
    let farthest = distances.fold(0.0, f32::max);
    assert!((3.0..7.0).contains(&farthest), "{farthest}");
    let ball = stage.ball(Vec3::new(20.0, 2.8, 20.0), 0.1, Vec3::ZERO);
    stage.frames(10);
    assert!(stage.is_held(ball) && stage.place(ball).y > 2.5, "{}", stage.place(ball));
}

/// The normal that a triangle's shape makes of a tilted contact normal.
fn pushed(shape: &GroundShape, triangle: u32, normal: Vec3) -> Option<Vec3> {
    let mut pushed = None;
    shape.map_part_at(triangle, &mut |_, _, cone| {
        pushed = cone.and_then(|cone| cone.project_local_normal(normal));
    });
    pushed
}

#[test]
fn a_scaled_shape_equals_that_of_larger_voxels() {
    let mut terrain = level(32, 1.0);
    terrain.apply([pit(14.0, 8.0, 14.0, 4.3)]);
    let surface = terrain.world().tile_mesh(TilePos { x: 0, z: 0 });
    let [small, large] = [1.0, 2.0].map(|size| GroundShape::new(&surface, size).expect("it has triangles"));
    let scaled = small.scale_dyn(Vec3::splat(2.0), 0).expect("it can be scaled");
    let scaled = scaled.as_shape::<GroundShape>().expect("it is ground as before");
    assert_eq!(scaled.triangles(), large.triangles());
    for triangle in 0..large.triangles() as u32 {
        for lean in [Vec3::ZERO, Vec3::X, Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z, Vec3::NEG_Y * 2.0] {
            let normal = (Vec3::Y + lean).normalize();
            let [scaled, large] = [scaled, &large].map(|shape| pushed(shape, triangle, normal));
            let is_same = scaled.zip(large).is_none_or(|(scaled, large)| scaled.abs_diff_eq(large, 1e-4));
            assert!(is_same && scaled.is_some() == large.is_some(), "{scaled:?} for {large:?}");
        }
    }
}

#[test]
fn colliders_of_turned_ground_keep_their_shape_from_the_frame_that_brings_them() {
    let mut stage = Stage::new();
    let terrain = stage.app.world_mut().spawn(level(32, 0.5)).id();
    stage.app.world_mut().spawn((Transform::default(), ColliderSource { radius: 1e4 }));
    stage.settle();
    stage.app.world_mut().resource_mut::<Time<Physics>>().pause();
    for step in 0..24 {
        // Of such angles, about every fourth has a scale that is not exactly 1 in floats.
        let turn = Quat::from_euler(EulerRot::YXZ, 0.11 * step as f32, 0.05 * step as f32, 0.0);
        stage.app.world_mut().get_mut::<Transform>(terrain).expect("it has one").rotation = turn;
        stage.frame();
        let place = Vec3::new(2.0 + 0.5 * step as f32, 4.0, 8.0);
        let before = stage.changed();
        stage.send(pit(0.0, 0.0, 0.0, 1.5).transformed(turn, turn * place, 1.0));
        stage.frames_until("it is dug", |stage| {
            let world = stage.app.world_mut();
            let mut bodies = world.query_filtered::<&Collider, With<GroundBody>>();
            for collider in bodies.iter(world) {
                let is_ground = |shape: &SharedShape| shape.as_shape::<GroundShape>().is_some();
                assert!(is_ground(collider.shape_scaled()), "a plain mesh, at step {step}");
                assert_eq!(collider.scale(), Vec3::ONE);
            }
            stage.changed() > before
        });
    }
}
