//! Contact properties of single terrains, and terrains without physics.

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::physics::{
    ColliderSource, GroundBody, GroundContact, PhysicsFigures, TerrainContact, TerrainPhysicsDisabled,
};

use crate::stage::{STEP, Stage, level};

/// Two terrains side by side, the second one with these components, and a source that reaches both.
fn two(more: impl Bundle) -> (Stage, [Entity; 2]) {
    let mut stage = Stage::new();
    let world = stage.app.world_mut();
    let first = world.spawn(level(32, 1.0)).id();
    let second = world.spawn((level(32, 1.0), Transform::from_xyz(100.0, 0.0, 0.0), more)).id();
    world.spawn((Transform::default(), ColliderSource { radius: 1e4 }));
    stage.settle();
    (stage, [first, second])
}

/// How many bodies a terrain has.
fn bodies(stage: &mut Stage, terrain: Entity) -> usize {
    let world = stage.app.world_mut();
    world.query::<&GroundBody>().iter(world).filter(|body| body.terrain == terrain).count()
}

#[test]
fn a_terrain_without_physics_has_no_colliders_and_holds_nothing() {
    let (mut stage, [first, second]) = two(TerrainPhysicsDisabled);
    assert_eq!((bodies(&mut stage, first), bodies(&mut stage, second)), (4, 0));
    let balls = [16.0, 116.0].map(|x| stage.ball(Vec3::new(x, 10.0, 16.0), 0.5, Vec3::ZERO));
    stage.frames((3.0 / STEP) as usize);
    assert!(!stage.is_held(balls[1]));
    let [on, through] = balls.map(|ball| stage.place(ball).y);
    assert!((8.0..9.0).contains(&on) && through < 0.0, "{on} and {through}");
    // It may change.
    stage.app.world_mut().entity_mut(second).remove::<TerrainPhysicsDisabled>();
    stage.settle();
    assert_eq!(bodies(&mut stage, second), 4);
    stage.app.world_mut().entity_mut(first).insert(TerrainPhysicsDisabled);
    stage.frames_until("its colliders go", |stage| bodies(stage, first) == 0);
    assert_eq!(stage.app.world().resource::<PhysicsFigures>().missing, 0);
}

#[test]
fn layers_are_those_of_the_terrain() {
    #[derive(PhysicsLayer, Default)]
    enum Layer {
        #[default]
        All,
        Ghosts,
    }
    let ghosts = CollisionLayers::new(Layer::Ghosts, [Layer::Ghosts]);
    let contact = TerrainContact(GroundContact { layers: ghosts, ..default() });
    let (mut stage, [first, second]) = two(contact);
    let layers = |stage: &mut Stage, terrain: Entity| -> Vec<CollisionLayers> {
        let world = stage.app.world_mut();
        let mut bodies = world.query::<(&GroundBody, &CollisionLayers)>();
        let own = bodies.iter(world).filter(|(body, _)| body.terrain == terrain);
        own.map(|(_, layers)| *layers).collect()
    };
    assert_eq!(layers(&mut stage, first), [CollisionLayers::default(); 4]);
    assert_eq!(layers(&mut stage, second), [ghosts; 4]);
    // An ordinary ball falls through the second one, and nothing holds or lifts it there.
    let balls = [16.0, 116.0].map(|x| stage.ball(Vec3::new(x, 10.0, 16.0), 0.5, Vec3::ZERO));
    let ghost = stage.ball(Vec3::new(110.0, 10.0, 16.0), 0.5, Vec3::ZERO);
    stage.app.world_mut().entity_mut(ghost).insert(ghosts);
    stage.frames((3.0 / STEP) as usize);
    let [on, through, ghost] = [balls[0], balls[1], ghost].map(|ball| stage.place(ball).y);
    assert!((8.0..9.0).contains(&on) && (8.0..9.0).contains(&ghost), "{on} and {ghost}");
    assert!(through < 0.0, "{through}");
    assert_eq!(stage.figures().lifted, 0);
    // They change at once, and without the component they are those of all terrains.
    stage.app.world_mut().entity_mut(second).insert(TerrainContact::default());
    assert_eq!(layers(&mut stage, second), [CollisionLayers::default(); 4]);
    stage.app.world_mut().entity_mut(second).insert(TerrainContact(GroundContact {
        friction: Some(Friction::new(0.05)),
        layers: ghosts,
        ..default()
    }));
    let frictions = |stage: &mut Stage| {
        let world = stage.app.world_mut();
        world.query_filtered::<&Friction, With<GroundBody>>().iter(world).count()
    };
    assert_eq!((layers(&mut stage, second), frictions(&mut stage)), (vec![ghosts; 4], 4));
    stage.app.world_mut().entity_mut(second).remove::<TerrainContact>();
    assert_eq!(layers(&mut stage, second), [CollisionLayers::default(); 4]);
    assert_eq!(frictions(&mut stage), 0);
}
