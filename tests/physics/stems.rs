//! Stems of plants are colliders near sources, and follow their plants.

use std::collections::BTreeSet;

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::physics::ColliderSource;
use bevy_burrow::plants::{PlantCollidersPlugin, PlantSource, Plants, PlantsPlugin, ShownPlants};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Plant, ScatterRules, Species, Stem, ViewDistances};

use crate::stage::{Stage, level};

/// Metres from a source to the farthest stems that have colliders.
const NEAR: f32 = 32.0;

fn rules() -> ScatterRules {
    let view = ViewDistances { end: 100.0, ..default() };
    let stem = Some(Stem { radius: 0.3, height: 4.0 });
    let tree = Species { spacing: 5.0, stem, view, ..Species::named("tree") };
    ScatterRules { seed: 5, species: vec![tree, Species { view, ..Species::named("grass") }] }
}

/// The plants of a species that stand, near a place or everywhere.
fn standing(stage: &Stage, terrain: Entity, species: u8, near: Option<Vec3>) -> Vec<Plant> {
    let shown = stage.app.world().get::<ShownPlants>(terrain).expect("plants");
    let plants = shown.patches().expect("rules").iter().flat_map(|(_, patch)| patch.standing().copied());
    let is_near = |plant: &Plant| {
        let (cell, within) = (plant.cell(), |at: f32, cell: i32| {
            ((at - NEAR).floor() as i32..=(at + NEAR).floor() as i32).contains(&cell)
        });
        near.is_none_or(|near| within(near.x, cell.x) && within(near.z, cell.z))
    };
    plants.filter(|plant| plant.id.species == species && is_near(plant)).collect()
}

/// Asserts that these plants have stems, and no others. Returns their number.
fn assert_stems(stage: &mut Stage, terrain: Entity, expected: &[Plant], when: &str) -> usize {
    let key = |at: Vec3| [at.x, at.z].map(|at| (at * 256.0).round() as i32);
    let world = stage.app.world_mut();
    let mut bodies =
        world.query_filtered::<(&ChildOf, &Transform, &RigidBody), (With<Collider>, Without<Tile>)>();
    let stems: Vec<[i32; 2]> = bodies
        .iter(world)
        .filter(|(child, transform, body)| {
            child.parent() == terrain && **body == RigidBody::Static && transform.translation != Vec3::ZERO
        })
        .map(|(_, transform, _)| key(transform.translation))
        .collect();
    let found: BTreeSet<[i32; 2]> = stems.iter().copied().collect();
    assert_eq!(found.len(), stems.len(), "two stems at one place {when}");
    let expected: BTreeSet<[i32; 2]> = expected.iter().map(|plant| key(plant.position().as_vec3())).collect();
    assert_eq!(found, expected, "{when}");
    found.len()
}

#[test]
fn stems_near_sources_follow_digs_undos_and_sources() {
    let mut app = App::new();
    app.add_plugins((PlantsPlugin, PlantCollidersPlugin));
    let mut stage = Stage::within(app);
    let terrain = stage.app.world_mut().spawn((level(160, 1.0), Plants(rules()))).id();
    let mut at = Vec3::new(48.0, 10.0, 48.0);
    let source =
        (Transform::from_translation(at), ColliderSource { radius: 60.0 }, PlantSource { radius: 400.0 });
    let source = stage.app.world_mut().spawn(source).id();
    stage.settle();
    stage.frames_until("plants are loaded", |stage| {
        stage.app.world().get::<ShownPlants>(terrain).is_some_and(|shown| {
            shown.patches().is_some_and(|patches| !patches.is_empty()) && !shown.is_loading()
        })
    });
    stage.frame();
    let near = |stage: &Stage, at: Vec3| standing(stage, terrain, 0, Some(at));
    let trees = near(&stage, at);
    let count = assert_stems(&mut stage, terrain, &trees, "once plants are loaded");
    assert!(count > 20 && count < standing(&stage, terrain, 0, None).len(), "{count}");
    assert!(!standing(&stage, terrain, 1, None).is_empty(), "grass has no stems");

    let foot = trees[count / 2].position().as_vec3();
    stage.app.world_mut().write_message(Brush::dig(Shape::sphere(foot, 3.0))).expect("the plugin added it");
    stage.frame();
    stage.catch_up();
    let left = near(&stage, at);
    assert!(left.len() < count);
    assert_stems(&mut stage, terrain, &left, "in the frame of a dig");
    stage.app.world_mut().write_message(Undo::default()).expect("the plugin added it");
    stage.frame();
    stage.catch_up();
    assert_stems(&mut stage, terrain, &trees, "after its undo");

    at.x += 40.0;
    stage.app.world_mut().get_mut::<Transform>(source).expect("the source").translation = at;
    stage.frames(2);
    let other = near(&stage, at);
    assert_ne!(other, trees);
    assert_stems(&mut stage, terrain, &other, "near the source's new place");
    stage.app.world_mut().entity_mut(terrain).insert(Plants(ScatterRules { seed: 6, ..rules() }));
    stage.frame();
    stage.frames_until("others are loaded", |stage| {
        !stage.app.world().get::<ShownPlants>(terrain).expect("plants").is_loading()
    });
    stage.frame();
    let reseeded = near(&stage, at);
    assert_ne!(reseeded, other);
    assert_stems(&mut stage, terrain, &reseeded, "with other rules");
    stage.app.world_mut().entity_mut(source).remove::<ColliderSource>();
    stage.frame();
    assert_stems(&mut stage, terrain, &[], "without a source");
}
