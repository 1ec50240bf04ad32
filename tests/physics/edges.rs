//! Walls around a terrain, and how bodies collide with them.

use bevy::prelude::*;
use bevy_burrow::physics::{CharacterSteering, EdgeWalls};

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
