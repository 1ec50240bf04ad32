//! Walls around a terrain, and how bodies collide with them.

use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_burrow::physics::{CharacterSteering, EdgeWalls};
use bevy_burrow::prelude::*;

use crate::stage::{STEP, Stage, level};

#[test]
fn walkers_cannot_leave_a_terrain_with_walls() {
    for (side, size) in [(64, 1.0), (64, 0.5)] {
        let (mut stage, terrain) = Stage::with_ground(level(side, size));
        stage.app.world_mut().entity_mut(terrain).insert(EdgeWalls::default());
        let (middle, end) = (side as f32 * size / 2.0, side as f32 * size);
        let walkers = [Vec2::X, Vec2::NEG_X, Vec2::Y, Vec2::NEG_Y, Vec2::ONE].map(|direction| {
            let walker = stage.character(Vec3::new(middle, 8.0 * size, middle), direction);
            let steering = CharacterSteering { direction, run: true, jump: true };
            stage.app.world_mut().entity_mut(walker).insert(steering);
            (walker, direction)
        });
        for _ in 0..(8.0 / STEP) as usize {
            stage.frame();
            for (walker, _) in walkers {
                let feet = stage.feet(walker);
                let is_inside = |at: f32| (0.0..=end).contains(&at);
                assert!(is_inside(feet.x) && is_inside(feet.z) && feet.y > 8.0 * size - 0.1, "{feet}");
            }
        }
        // They walked until the walls stopped them.
        for (walker, direction) in walkers {
            let way = stage.feet(walker).xz() - middle;
            assert!(way.dot(direction) > middle - 3.0, "{way} for {direction}");
        }
    }
}

/// The number of walls, and the largest x among them.
fn walls_of(stage: &mut Stage) -> (usize, f32) {
    let mut names = stage.app.world_mut().query::<(&Name, &Transform)>();
    let walls = names.iter(stage.app.world()).filter(|(name, _)| name.as_str() == "edge wall");
    walls.map(|(_, place)| place.translation.x).fold((0, 0.0), |(n, far), x| (n + 1, x.max(far)))
}

#[test]
fn walls_go_with_their_component_and_follow_another_terrain() {
    let (mut stage, terrain) = Stage::with_ground(level(64, 1.0));
    stage.app.world_mut().entity_mut(terrain).insert(EdgeWalls::default());
    assert_eq!(walls_of(&mut stage), (4, 68.0));
    stage.app.world_mut().entity_mut(terrain).insert(level(128, 1.0));
    stage.frames_until("the other terrain has walls", |stage| walls_of(stage) == (4, 132.0));
    stage.app.world_mut().entity_mut(terrain).remove::<EdgeWalls>();
    assert_eq!(walls_of(&mut stage).0, 0);
}

#[test]
fn walls_of_impossible_sizes_are_left_out_until_they_are_possible() {
    let (mut stage, terrain) = Stage::with_ground(level(64, 1.0));
    for size in [f32::NAN, f32::INFINITY, 0.0, -3.0] {
        for walls in [EdgeWalls { height: size, ..default() }, EdgeWalls { thickness: size, ..default() }] {
            stage.app.world_mut().entity_mut(terrain).insert(walls);
            stage.frames(2);
            assert_eq!(walls_of(&mut stage).0, 0, "{size}");
        }
    }
    stage.app.world_mut().entity_mut(terrain).insert(EdgeWalls::default());
    assert_eq!(walls_of(&mut stage).0, 4);
}

/// Level ground at a height above or below the origin, with walls.
fn walled(height: f64) -> (Stage, Entity) {
    let ground = Ground::flat(64, 64, height).expect("valid ground");
    let settings = TerrainSettings { chunk_size: 16, voxel_size: 1.0 };
    let (mut stage, entity) = Stage::with_ground(Terrain::new(ground, &settings).expect("valid settings"));
    stage.app.world_mut().entity_mut(entity).insert(EdgeWalls { height: 20.0, ..default() });
    stage.settle();
    (stage, entity)
}

#[test]
fn walls_are_where_the_ground_is() {
    for height in [8.0, 2000.0, -700.0] {
        let (mut stage, _) = walled(height);
        let ball = stage.ball(Vec3::new(50.0, height as f32 + 1.0, 32.0), 0.5, Vec3::X * 10.0);
        stage.frames((3.0 / STEP) as usize);
        let at = stage.place(ball);
        assert!(at.x < 65.0 && at.y > height as f32 - 1.0, "{at} on ground at {height}");
    }
}

#[test]
fn walls_rise_with_another_ground() {
    let (mut stage, terrain) = walled(8.0);
    let middle = |stage: &mut Stage| {
        let mut names = stage.app.world_mut().query::<(&Name, &Transform)>();
        let walls = names.iter(stage.app.world()).filter(|(name, _)| name.as_str() == "edge wall");
        walls.map(|(_, place)| place.translation.y).fold(f32::NAN, f32::max)
    };
    assert_eq!(middle(&mut stage), 8.0);
    let higher = Ground::flat(64, 64, 900.0).expect("valid ground");
    let mut model = stage.app.world_mut().get_mut::<Terrain>(terrain).expect("it is there");
    model.apply_one(Order::Ground(higher.into())).outcome.expect("the same size");
    stage.frames_until("the walls rise", |stage| middle(stage) == 900.0);
}

#[test]
fn walls_go_with_their_terrain() {
    let (mut stage, terrain) = walled(8.0);
    assert_eq!(walls_of(&mut stage).0, 4);
    stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
    stage.frame();
    assert_eq!(walls_of(&mut stage).0, 0);
    // Those of a terrain that is disabled go too.
    let (mut stage, terrain) = walled(8.0);
    stage.app.world_mut().entity_mut(terrain).insert_recursive::<Children>(Disabled);
    stage.app.world_mut().entity_mut(terrain).remove::<EdgeWalls>();
    stage.frame();
    let world = stage.app.world_mut();
    let mut names = world.query_filtered::<&Name, With<Disabled>>();
    assert_eq!(names.iter(world).filter(|name| name.as_str() == "edge wall").count(), 0);
}
