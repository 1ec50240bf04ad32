//! Plants in an app: they go in the frame of their ground, and return with undo.

use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::plants::{PlantRemoved, PlantReturned, PlantSource, Plants, PlantsPlugin, ShownPlants};
use bevy_burrow::prelude::*;
use bevy_burrow::scatter::{Clearance, Plant, ScatterRules, Species, ViewDistances};

#[derive(Resource, Default)]
struct Log {
    removed: Vec<PlantRemoved>,
    returned: Vec<PlantReturned>,
}

fn rules() -> ScatterRules {
    let view = ViewDistances { end: 60.0, ..default() };
    let tree = Species {
        spacing: 4.0,
        distance: 3.0,
        clearance: Clearance { radius: 1.0, height: 6.0 },
        view,
        ..Species::named("tree")
    };
    ScatterRules { seed: 2, species: vec![tree, Species { view, ..Species::named("grass") }] }
}

fn ground() -> Ground {
    Ground::from_fn(96, 96, |x, z| 20.0 + f64::from(x % 9) * 0.2 + f64::from(z % 7) * 0.2).expect("finite")
}

/// An app with a terrain with plants around its middle, which are loaded.
fn app(same_frame: bool, more: impl Bundle) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin))
        .add_plugins((BurrowPlugins, PlantsPlugin))
        .init_resource::<Log>()
        .add_systems(
            Last,
            |mut removed: MessageReader<PlantRemoved>,
             mut returned: MessageReader<PlantReturned>,
             mut log: ResMut<Log>| {
                log.removed.extend(removed.read().cloned());
                log.returned.extend(returned.read().cloned());
            },
        );
    app.finish();
    app.cleanup();
    app.world_mut().resource_mut::<BurrowSettings>().same_frame =
        Duration::from_secs(if same_frame { 60 } else { 0 });
    app.world_mut().spawn((PlantSource { radius: 60.0 }, Transform::from_xyz(48.0, 20.0, 48.0)));
    let settings = TerrainSettings { chunk_size: 16, ..TerrainSettings::default() };
    let terrain = Terrain::new(ground(), &settings).expect("valid");
    let entity = app.world_mut().spawn((terrain, Plants(rules()), more)).id();
    wait(&mut app, |world| {
        world.get::<ShownPlants>(entity).is_some_and(|shown| {
            shown.patches().is_some_and(|patches| !patches.is_empty()) && !shown.is_loading()
        })
    });
    (app, entity)
}

fn wait(app: &mut App, is_done: impl Fn(&World) -> bool) {
    let start = Instant::now();
    while !is_done(app.world()) {
        assert!(start.elapsed() < Duration::from_secs(300), "it never came");
        app.update();
        std::thread::sleep(Duration::from_micros(500));
    }
}

/// Whether exactly the plants that stand in the world are shown, and everything near enough is loaded.
fn assert_up_to_date(app: &App, terrain: Entity, when: &str) {
    let (shown, model) = (app.world().get::<ShownPlants>(terrain), app.world().get::<Terrain>(terrain));
    let (shown, world) = (shown.expect("plants"), model.expect("a terrain").world());
    let (scatter, patches) = (shown.scatter().expect("rules"), shown.patches().expect("patches"));
    let mut count = 0;
    for (pos, patch) in patches.iter() {
        assert_eq!(patch.plants(), scatter.patch(world.ground(), pos), "{when}");
        for (index, plant) in patch.plants().iter().enumerate() {
            assert_eq!(patch.stands(index), scatter.stands(world, plant), "{when}: {plant:?}");
        }
        count += patch.plants().len();
    }
    assert!(count > 5000, "{when}: {count} are loaded");
}

fn standing(app: &App, terrain: Entity) -> Vec<Plant> {
    let shown = app.world().get::<ShownPlants>(terrain).expect("plants");
    let patches = shown.patches().expect("patches").iter();
    let mut all: Vec<Plant> = patches.flat_map(|(_, patch)| patch.standing().copied()).collect();
    all.sort_by_key(|plant| plant.id);
    all
}

fn dig(app: &mut App, at: Vec3, radius: f32) {
    app.world_mut().write_message(Brush::dig(Shape::sphere(at, radius))).expect("the plugin added it");
}

#[test]
fn plants_go_in_the_frame_of_their_ground_and_return_with_it() {
    for same_frame in [false, true] {
        let (mut app, terrain) = app(same_frame, ());
        let before = standing(&app, terrain);
        for turn in 0..6 {
            let at = Vec3::new(30.0 + 7.0 * turn as f32, 20.5, 40.0);
            dig(&mut app, at, 3.5);
            let hash = app.world().get::<Terrain>(terrain).expect("there").world().hash();
            // In every frame exactly the plants that stand are shown.
            let start = Instant::now();
            loop {
                app.update();
                assert_up_to_date(&app, terrain, "while digging");
                if app.world().get::<Terrain>(terrain).expect("there").world().hash() != hash {
                    break;
                }
                assert!(start.elapsed() < Duration::from_secs(300));
            }
        }
        app.update();
        let now = standing(&app, terrain);
        let log = std::mem::take(&mut *app.world_mut().resource_mut::<Log>());
        assert!(now.len() < before.len() && now.iter().all(|plant| before.contains(plant)));
        assert_eq!(log.removed.len(), before.len() - now.len());
        for removed in &log.removed {
            assert!(before.contains(&removed.plant) && !now.contains(&removed.plant));
            let foot = removed.plant.position().as_vec3();
            assert!(removed.transform.translation.distance(foot) < 1e-3 && removed.terrain == terrain);
            assert!(!removed.is_felled, "its ground is gone");
        }
        for _ in 0..6 {
            app.world_mut().write_message(Undo::default()).expect("the plugin added it");
        }
        wait(&mut app, |world| world.get::<Terrain>(terrain).expect("there").history().undos == 0);
        assert_up_to_date(&app, terrain, "after undo");
        app.update();
        assert_eq!(standing(&app, terrain), before);
        assert_eq!(app.world().resource::<Log>().returned.len(), log.removed.len());
    }
}

#[test]
fn plants_go_in_the_frame_of_two_commits_and_each_is_told_once() {
    let (mut app, terrain) = app(false, ());
    let before = standing(&app, terrain);
    let revision = |app: &App| app.world().get::<Terrain>(terrain).expect("there").world().revision();
    for turn in 0..4 {
        let (at, first) = (Vec3::new(20.0 + 14.0 * turn as f32, 20.5, 30.0), revision(&app));
        // The first is committed in the frame after its own, in which the second begins and ends. They overlap.
        for (at, seconds) in [(at, 0), (at + Vec3::Z * 4.0, 60)] {
            app.world_mut().resource_mut::<BurrowSettings>().same_frame = Duration::from_secs(seconds);
            dig(&mut app, at, 3.5);
            app.update();
        }
        wait(&mut app, |world| world.get::<Terrain>(terrain).expect("there").world().revision() > first);
        assert_eq!(revision(&app), first + 2, "both are committed in one frame");
        assert_up_to_date(&app, terrain, "in the frame of both");
    }
    (0..3).for_each(|_| app.update());
    assert_up_to_date(&app, terrain, "later");
    let now = standing(&app, terrain);
    let mut told: Vec<Plant> =
        app.world().resource::<Log>().removed.iter().map(|removed| removed.plant).collect();
    told.sort_by_key(|plant| plant.id);
    let gone: Vec<Plant> = before.into_iter().filter(|plant| !now.contains(plant)).collect();
    assert!(gone.len() > 40 && app.world().resource::<Log>().returned.is_empty());
    assert_eq!(told, gone);
}

#[test]
fn a_game_removes_a_plant_with_a_brush() {
    let place = Transform::from_xyz(100.0, -8.0, 64.0);
    let (mut app, terrain) = app(false, place);
    // The source is elsewhere now: the plants at the rim are loaded.
    let plants = standing(&app, terrain);
    let tree = *plants.iter().find(|plant| plant.id.species == 0).expect("a tree");
    let at = *app.world().get::<GlobalTransform>(terrain).expect("placed");
    app.world_mut().write_message(tree.removal_in_world(&at)).expect("the plugin added it");
    wait(&mut app, |world| !world.resource::<Log>().removed.is_empty());
    let removed = app.world().resource::<Log>().removed.iter().find(|removed| removed.plant == tree).cloned();
    let removed = removed.expect("the tree");
    assert!(removed.transform.translation.distance(place.translation + tree.position().as_vec3()) < 1e-3);
    assert!(removed.is_felled);
    assert!(!standing(&app, terrain).contains(&tree));
}

#[test]
fn changes_that_the_game_makes_itself_and_other_worlds_are_followed() {
    let (mut app, terrain) = app(false, ());
    let mut model = app.world_mut().get_mut::<Terrain>(terrain).expect("there");
    model.apply([Brush::dig(Shape::sphere(Vec3::new(48.0, 20.0, 48.0), 5.0))]);
    wait(&mut app, |world| !world.resource::<Log>().removed.is_empty());
    assert_up_to_date(&app, terrain, "after a change of the game's own");
    let other =
        Ground::from_fn(96, 96, |x, z| 30.0 + f64::from(x) * 0.1 + f64::from(z) * 0.05).expect("finite");
    let other = Terrain::new(other, &TerrainSettings::default()).expect("valid");
    app.world_mut().entity_mut(terrain).insert(other);
    wait(&mut app, |world| {
        let is_new = |shown: &ShownPlants| {
            let first =
                shown.patches().and_then(|patches| patches.iter().next().map(|(_, patch)| patch.plants()[0]));
            first.is_some_and(|first| first.position().y > 29.0) && !shown.is_loading()
        };
        world.get::<ShownPlants>(terrain).is_some_and(is_new)
    });
    assert_up_to_date(&app, terrain, "in another world");
}

#[test]
fn other_rules_grow_other_plants_and_bad_ones_none() {
    let (mut app, terrain) = app(false, ());
    let before = standing(&app, terrain);
    app.world_mut().entity_mut(terrain).insert(Plants(ScatterRules { seed: 3, ..rules() }));
    app.update();
    wait(&mut app, |world| !world.get::<ShownPlants>(terrain).expect("plants").is_loading());
    assert_up_to_date(&app, terrain, "with another seed");
    assert_ne!(standing(&app, terrain), before);
    let bad = Species { spacing: -1.0, ..Species::named("bad") };
    app.world_mut().entity_mut(terrain).insert(Plants(ScatterRules { seed: 3, species: vec![bad] }));
    app.update();
    assert!(app.world().get::<ShownPlants>(terrain).expect("plants").patches().is_none());
}

#[test]
fn patches_follow_their_sources() {
    let (mut app, terrain) = app(false, ());
    let world = app.world_mut();
    let source = world.query_filtered::<Entity, With<PlantSource>>().single(world).expect("one");
    world.entity_mut(source).insert((PlantSource { radius: 10.0 }, Transform::from_xyz(2000.0, 0.0, 0.0)));
    wait(&mut app, |world| {
        world.get::<ShownPlants>(terrain).expect("plants").patches().expect("rules").is_empty()
    });
    app.world_mut().entity_mut(source).insert(Transform::from_xyz(90.0, 0.0, 90.0));
    app.update();
    wait(&mut app, |world| {
        let shown = world.get::<ShownPlants>(terrain).expect("plants");
        !shown.is_loading() && !shown.patches().expect("rules").is_empty()
    });
    let shown = app.world().get::<ShownPlants>(terrain).expect("plants");
    for (pos, _) in shown.patches().expect("rules").iter() {
        let (_, high) = shown.scatter().expect("rules").patch_cells(pos);
        assert!(high.x >= 70 && high.z >= 70, "{pos:?}");
    }
}

#[test]
fn without_rules_there_are_no_plants() {
    let (mut app, terrain) = app(false, ());
    let before = standing(&app, terrain);
    let hash = |world: &World| world.get::<Terrain>(terrain).expect("a terrain").world().hash();
    let pristine = hash(app.world());
    app.world_mut().entity_mut(terrain).remove::<Plants>();
    app.update();
    assert!(app.world().get::<ShownPlants>(terrain).expect("state").patches().is_none());
    dig(&mut app, Vec3::new(48.0, 20.5, 48.0), 3.0);
    wait(&mut app, |world| hash(world) != pristine);
    app.world_mut().write_message(Undo::default()).expect("the plugin added it");
    app.world_mut().entity_mut(terrain).insert(Plants(rules()));
    wait(&mut app, |world| {
        let shown = world.get::<ShownPlants>(terrain).expect("state");
        !shown.is_loading() && shown.patches().is_some_and(|patches| !patches.is_empty())
    });
    wait(&mut app, |world| hash(world) == pristine);
    app.update();
    assert_eq!(standing(&app, terrain), before);
}

#[test]
fn what_a_game_digs_through_the_model_is_told_too() {
    let (mut app, terrain) = app(false, ());
    let before = standing(&app, terrain);
    let mut model = app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
    model.apply([Brush::dig(Shape::sphere(Vec3::new(48.0, 20.5, 48.0), 5.0))]);
    wait(&mut app, |world| !world.resource::<Log>().removed.is_empty());
    assert_up_to_date(&app, terrain, "after the dig");
    let gone = before.len() - standing(&app, terrain).len();
    assert!(gone > 0);
    assert_eq!(app.world().resource::<Log>().removed.len(), gone);
}

/// Moves the source away until nothing is loaded, and then to a place.
fn move_source(app: &mut App, terrain: Entity, radius: f32, to: Vec3) {
    let world = app.world_mut();
    let source = world.query_filtered::<Entity, With<PlantSource>>().single(world).expect("one");
    world.entity_mut(source).insert((PlantSource { radius: 10.0 }, Transform::from_xyz(9000.0, 0.0, 0.0)));
    wait(app, |world| {
        world.get::<ShownPlants>(terrain).expect("plants").patches().expect("rules").is_empty()
    });
    app.world_mut().entity_mut(source).insert((PlantSource { radius }, Transform::from_translation(to)));
    app.update();
    wait(app, |world| {
        let shown = world.get::<ShownPlants>(terrain).expect("plants");
        !shown.is_loading() && !shown.patches().expect("rules").is_empty()
    });
}

#[test]
fn a_radius_is_in_metres_under_a_scaled_parent_too() {
    let (mut app, terrain) = app(false, ());
    let parent = app.world_mut().spawn(Transform::from_scale(Vec3::splat(2.0))).id();
    app.world_mut().entity_mut(terrain).insert(ChildOf(parent));
    // Ten voxels around cell 93: the patch of cells 64 to 79 is farther away.
    move_source(&mut app, terrain, 20.0, Vec3::new(186.0, 0.0, 186.0));
    let shown = app.world().get::<ShownPlants>(terrain).expect("plants");
    for (pos, _) in shown.patches().expect("rules").iter() {
        assert_eq!((pos.x, pos.z), (5, 5));
    }
}

#[test]
fn an_infinite_radius_loads_what_is_near_enough() {
    let (mut app, terrain) = app(false, ());
    move_source(&mut app, terrain, f32::INFINITY, Vec3::new(48.0, 0.0, 48.0));
    assert_up_to_date(&app, terrain, "with an infinite radius");
    let shown = app.world().get::<ShownPlants>(terrain).expect("plants");
    assert_eq!(shown.patches().expect("rules").len(), 2 * 36, "all of the world is near enough");
}

#[test]
fn plants_that_load_while_the_ground_changes_are_up_to_date() {
    let (mut app, terrain) = app(false, ());
    let world = app.world_mut();
    let source = world.query_filtered::<Entity, With<PlantSource>>().single(world).expect("one");
    for turn in 0..12 {
        let away = Transform::from_xyz(if turn % 2 == 0 { 9000.0 } else { 48.0 }, 0.0, 48.0);
        app.world_mut().entity_mut(source).insert(away);
        let at = Vec3::new(20.0 + 5.0 * turn as f32, 20.5, 50.0);
        if turn % 4 == 3 {
            let mut model = app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
            model.apply([Brush::dig(Shape::sphere(at, 3.0))]);
        } else {
            dig(&mut app, at, 3.0);
        }
        (0..4).for_each(|_| app.update());
    }
    wait(&mut app, |world| {
        let model = world.get::<Terrain>(terrain).expect("a terrain");
        let shown = world.get::<ShownPlants>(terrain).expect("plants");
        let is_loaded = shown.patches().is_some_and(|patches| !patches.is_empty()) && !shown.is_loading();
        model.history().undos == 12 && is_loaded
    });
    (0..3).for_each(|_| app.update());
    assert_up_to_date(&app, terrain, "at the end");
}
