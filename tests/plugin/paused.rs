//! Ways to pause a terrain, as a table of the guide compares them: what continues meanwhile, and what waits.

use std::time::Duration;

use avian3d::prelude::*;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::navigation::WalkSettings;
use bevy_burrow::paths::bevy_landmass::prelude::*;
use bevy_burrow::paths::{Navigation, NavigationArea, NavigationPlugin, NavigationTiles};
use bevy_burrow::physics::{ColliderSource, PhysicsFigures, TerrainPhysicsPlugin};
use bevy_burrow::plants::{PlantRemoved, PlantSource, Plants, PlantsPlugin, ShownPlants};
use bevy_burrow::plugin::Held;
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{ScatterRules, Species};

use crate::heightmaps::Folder;
use crate::stage::{Stage, dig, level};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Pause {
    Held,
    Disabled,
    Gated,
    Hidden,
}

/// A row of the table: the facts about a terrain that is paused.
#[derive(Debug, PartialEq)]
struct Row {
    /// Whether a brush that is sent is applied; `None` if it waits.
    brush: Option<bool>,
    /// Whether `Terrains` answers for it.
    answers: bool,
    /// Whether `SaveNow` is answered.
    saves: bool,
    /// Whether plants on its ground go when that is dug.
    plants: bool,
    /// Whether it has islands of landmass.
    islands: bool,
    /// Whether a ray of avian hits it.
    collides: bool,
    /// Whether its tiles are found by ordinary queries.
    tiles: bool,
}

#[derive(Resource, Clone, PartialEq)]
struct Playing(bool);

fn stage() -> Stage {
    let mut stage = Stage::with_all(
        (MinimalPlugins, AssetPlugin::default()),
        (
            PhysicsPlugins::default(),
            TerrainPhysicsPlugin,
            PlantsPlugin,
            Landmass3dPlugin::default(),
            NavigationPlugin::default(),
        ),
    )
    .recording::<WorldSaved>()
    .recording::<PlantRemoved>();
    stage.app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 64.0)));
    stage.run_while(Playing(true));
    stage
}

/// A terrain with everything that follows its ground.
fn populate(stage: &mut Stage, folder: &Folder) -> Entity {
    let fern = Species { spacing: 3.0, ..Species::named("fern") };
    let plants = Plants(ScatterRules { seed: 3, species: vec![fern] });
    let agent = WalkSettings { radius: 0.4, height: 1.8, ..default() };
    let world = stage.app.world_mut();
    let archipelago = world.spawn(Archipelago3d::new(agent.archipelago_options(1.0))).id();
    world.spawn((
        Transform::from_xyz(32.0, 8.0, 32.0),
        PlantSource { radius: 100.0 },
        ColliderSource { radius: 100.0 },
    ));
    let saved = SavedWorld::new(folder.path().join("world"));
    let terrain = world.spawn((level(1.0), plants, saved)).id();
    let area = NavigationArea::Everywhere;
    world.spawn(Navigation { terrain, archipelago, agent, area });
    stage.settle();
    stage.frames_until("everything is there", |stage| {
        let world = stage.app.world_mut();
        let navigation = world.query::<&NavigationTiles>().single(world).expect("one navigation");
        let has_paths = !navigation.is_loading() && !navigation.is_empty();
        let has_plants = world.get::<ShownPlants>(terrain).is_some_and(|shown| {
            !shown.is_loading() && shown.patches().is_some_and(|patches| !patches.is_empty())
        });
        let has_store = world.get::<WorldStore>(terrain).is_some();
        let has_colliders = world.resource::<PhysicsFigures>().missing == 0;
        has_paths && has_plants && has_store && has_colliders && hits(stage)
    });
    terrain
}

/// Whether a ray of avian hits the ground, away from the hole.
fn hits(stage: &mut Stage) -> bool {
    let cast = |query: SpatialQuery| {
        let from = Vec3::new(52.0, 30.0, 52.0);
        query.cast_ray(from, Dir3::NEG_Y, 60.0, true, &SpatialQueryFilter::default()).is_some()
    };
    stage.app.world_mut().run_system_once(cast).expect("avian can be asked")
}

fn set(stage: &mut Stage, terrain: Entity, pause: Pause, is_on: bool) {
    if pause == Pause::Gated {
        stage.app.world_mut().resource_mut::<Playing>().0 = !is_on;
        return;
    }
    let mut entity = stage.app.world_mut().entity_mut(terrain);
    match (pause, is_on) {
        (Pause::Held, true) => drop(entity.insert(Held)),
        (Pause::Held, false) => drop(entity.remove::<Held>()),
        (Pause::Disabled, true) => drop(entity.insert_recursive::<Children>(Disabled)),
        (Pause::Disabled, false) => drop(entity.remove_recursive::<Children, Disabled>()),
        (_, true) => drop(entity.insert(Visibility::Hidden)),
        (_, false) => drop(entity.insert(Visibility::Inherited)),
    }
}

/// Pauses a terrain, and looks at it meanwhile and afterwards.
fn check(pause: Pause, expected: &Row) {
    let folder = Folder::new(&format!("paused_{pause:?}"));
    let mut stage = stage();
    let terrain = populate(&mut stage, &folder);
    set(&mut stage, terrain, pause, true);
    stage.frames(5);
    stage.recorded::<WorldSaved>();
    let brush = || dig(30.0, 8.0, 30.0, 4.0).with_tag(1);
    stage.send(brush());
    stage.write(SaveNow::default());
    match expected.brush {
        Some(_) => stage.frames_until("it is answered", |stage| stage.tags() == [1]),
        None => assert!(!stage.frames_within(Duration::from_millis(300), |stage| !stage.tags().is_empty())),
    }
    stage.frames_until("it is saved", |stage| !stage.recorded::<WorldSaved>().is_empty());
    stage.frames(10);
    let outcome = stage.receipts().first().map(|applied| applied.receipt.outcome.is_ok());
    let height = |terrains: Terrains| terrains.height(52.0, 52.0).is_some();
    let seen = Row {
        brush: outcome,
        answers: stage.app.world_mut().run_system_once(height).expect("terrains can be asked"),
        saves: true,
        plants: !stage.recorded::<PlantRemoved>().is_empty(),
        islands: stage.count::<Island>() > 0,
        collides: hits(&mut stage),
        tiles: stage.count::<Tile>() > 0,
    };
    assert_eq!(seen, *expected, "{pause:?}");

    set(&mut stage, terrain, pause, false);
    let mut model = level(1.0);
    model.apply([brush()]);
    if expected.brush == Some(false) {
        stage.frames(5);
        stage.send(brush().with_tag(2));
    }
    stage.frames_until("the brush is applied", |stage| stage.hash(terrain) == model.world().hash());
    stage.frames_until("everything is as it was", |stage| {
        let is_found = stage.app.world_mut().run_system_once(height).expect("terrains can be asked");
        is_found && stage.count::<Island>() > 0 && stage.count::<Tile>() == 16 && hits(stage)
    });
    let gone = stage.recorded::<PlantRemoved>();
    assert_eq!(
        gone.is_empty(),
        expected.plants,
        "{pause:?}: messages of the plants that waited are sent afterwards"
    );
    assert!(gone.iter().all(|plant| plant.terrain == terrain && !plant.is_felled));
}

#[test]
fn a_held_terrain_answers_and_keeps_brushes() {
    let row = Row {
        brush: None,
        answers: true,
        saves: true,
        plants: false,
        islands: true,
        collides: true,
        tiles: true,
    };
    check(Pause::Held, &row);
}

#[test]
fn systems_that_are_gated_keep_brushes() {
    let row = Row {
        brush: None,
        answers: true,
        saves: true,
        plants: false,
        islands: true,
        collides: true,
        tiles: true,
    };
    check(Pause::Gated, &row);
}

#[test]
fn a_disabled_terrain_is_not_there_but_saved() {
    let row = Row {
        brush: Some(false),
        answers: false,
        saves: true,
        plants: false,
        islands: false,
        collides: false,
        tiles: false,
    };
    check(Pause::Disabled, &row);
}

#[test]
fn a_hidden_terrain_goes_on() {
    let row = Row {
        brush: Some(true),
        answers: true,
        saves: true,
        plants: true,
        islands: true,
        collides: true,
        tiles: true,
    };
    check(Pause::Hidden, &row);
}

#[test]
fn tiles_of_a_terrain_that_is_disabled_alone_stay() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    stage.app.world_mut().entity_mut(terrain).insert(Disabled);
    stage.frames(5);
    assert_eq!(stage.count::<Tile>(), 16);
    stage.send_to(terrain, dig(30.0, 8.0, 30.0, 4.0).with_tag(1));
    stage.frames(3);
    assert!(stage.receipts().iter().all(|applied| applied.receipt.outcome == Err(Rejection::TerrainGone)));
    assert_eq!(stage.tags(), [1]);
}
