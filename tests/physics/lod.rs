//! Colliders are those of level 0 wherever a source is, at whatever level ground is drawn.

use bevy::prelude::*;
use bevy_burrow::physics::{ColliderSource, GroundBody};
use bevy_burrow::prelude::*;

use crate::stage::{Stage, level, pit};

/// Level ground of 256 x 256 voxels that is drawn at its coarsest, as there is no camera.
fn coarse_stage() -> (Stage, Entity) {
    let mut stage = Stage::with_meshes();
    let terrain = stage.app.world_mut().spawn((level(256, 1.0), LevelsOfDetail::default())).id();
    (stage, terrain)
}

fn source(stage: &mut Stage, at: Vec3) -> Entity {
    stage.app.world_mut().spawn((Transform::from_translation(at), ColliderSource { radius: 24.0 })).id()
}

/// Tiles of level 0 that are not drawn.
fn hidden_tiles(stage: &mut Stage) -> usize {
    let world = stage.app.world_mut();
    let mut tiles = world.query_filtered::<&Tile, Without<Mesh3d>>();
    tiles.iter(world).filter(|tile| tile.level == 0).count()
}

#[test]
fn bodies_lie_on_ground_that_is_drawn_coarsely() {
    let (mut stage, terrain) = coarse_stage();
    let source = source(&mut stage, Vec3::new(40.0, 8.0, 40.0));
    stage.settle();
    assert!(hidden_tiles(&mut stage) > 4 && stage.figures().colliders > 4);
    let drawn = stage.terrain(terrain).drawn_cut().expect("a cut is drawn").cut().clone();
    assert!(drawn.nodes().all(|node| node.level > 0));
    let ball = stage.ball(Vec3::new(40.0, 12.0, 40.0), 0.5, Vec3::ZERO);
    stage.frames(120);
    assert!((stage.place(ball).y - 8.5).abs() < 0.05, "{}", stage.place(ball));
    // A dig under it shows in its collider.
    stage.dig([pit(40.0, 8.0, 40.0, 4.0)]);
    stage.frames(180);
    assert!((4.0..5.5).contains(&stage.place(ball).y), "{}", stage.place(ball));
    // Tiles come and go with the source.
    let far = Vec3::new(200.0, 8.0, 200.0);
    stage.app.world_mut().get_mut::<Transform>(source).expect("the source").translation = far;
    stage.frames(4);
    stage.settle();
    let bodies = stage.ground();
    let world = stage.app.world();
    let near = |body: &Entity| world.get::<GroundBody>(*body).is_some_and(|body| body.drawn.tile().x > 9);
    assert!(!bodies.is_empty() && bodies.iter().all(near));
}

#[test]
fn bodies_far_from_sources_are_held_over_ground_without_tiles() {
    let (mut stage, _) = coarse_stage();
    source(&mut stage, Vec3::new(40.0, 8.0, 40.0));
    stage.settle();
    let ball = stage.ball(Vec3::new(200.0, 9.0, 200.0), 0.5, Vec3::ZERO);
    stage.frames(60);
    assert!(stage.is_held(ball));
    source(&mut stage, Vec3::new(200.0, 8.0, 200.0));
    stage.frames_until("it lies", |stage| !stage.is_held(ball));
    stage.frames(60);
    assert!((stage.place(ball).y - 8.5).abs() < 0.05, "{}", stage.place(ball));
}
