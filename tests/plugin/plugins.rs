//! The plugin among others: in any order, without a clock, and with systems whose order is known.

use std::collections::HashMap;

use bevy::app::ScheduleRunnerPlugin;
use bevy::ecs::schedule::SystemKey;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, steep};

#[test]
fn a_terrain_may_be_there_before_the_plugin() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin));
    let place = Transform::from_xyz(64.0, 0.0, 0.0);
    let terrain = app.world_mut().spawn((level(0.5), place, LooseSettings::default())).id();
    // Queries in `Startup` find it where it is.
    #[derive(Resource)]
    struct Found(Option<f32>);
    app.add_systems(Startup, |mut commands: Commands, terrains: Terrains| {
        commands.insert_resource(Found(terrains.height(70.0, 10.0)));
    });
    app.add_plugins(BurrowPlugins);
    app.finish();
    app.cleanup();
    let mut stage = Stage::of(app);
    stage.frame();
    assert_eq!(stage.app.world().resource::<Found>().0, Some(4.0));
    stage.settle();
    assert_eq!(stage.count::<Tile>(), 16);
    assert!(stage.app.world().entity(terrain).contains::<MaterialColors>());
    stage.send(dig(70.0, 4.0, 10.0, 2.0));
    stage.settle();
    assert!(stage.terrain(terrain).loose().is_some());
    assert_eq!(stage.receipts().len(), 1);
}

#[test]
fn nothing_needs_a_clock() {
    // `MinimalPlugins` without their `TimePlugin`.
    let plugins =
        (TaskPoolPlugin::default(), bevy::diagnostic::FrameCountPlugin, ScheduleRunnerPlugin::default());
    let mut stage = Stage::with((plugins, AssetPlugin::default(), MeshPlugin, TransformPlugin));
    assert!(!stage.app.world().contains_resource::<Time>());
    let camera =
        (Camera::default(), bevy::camera::Projection::default(), Transform::from_xyz(9.0, 60.0, 9.0));
    stage.app.world_mut().spawn(camera);
    let terrain = stage.app.world_mut().spawn((steep(), LevelsOfDetail::default())).id();
    stage.settle();
    stage.send(dig(30.0, 8.0, 30.0, 6.0));
    stage.settle();
    assert!(stage.terrain(terrain).world().revision() > 0);
}

#[cfg(feature = "debug")]
#[test]
fn debug_views_need_no_clock() {
    use bevy_burrow::debug::{BurrowDebug, BurrowDebugPlugin, DebugLines};

    let plugins =
        (TaskPoolPlugin::default(), bevy::diagnostic::FrameCountPlugin, ScheduleRunnerPlugin::default());
    let mut stage = Stage::with_all((plugins, AssetPlugin::default(), TransformPlugin), BurrowDebugPlugin);
    stage.app.init_asset::<GizmoAsset>();
    stage.app.insert_resource(BurrowDebug { chunks: true, focus: Some(Vec3::splat(30.0)), ..default() });
    let terrain = stage.show(level(1.0));
    stage.app.world_mut().entity_mut(terrain).insert(InheritedVisibility::VISIBLE);
    stage.frames(2);
    assert!(stage.count::<DebugLines>() > 0);
}

/// Pairs of systems of a schedule that conflict and whose order is left open, with what they conflict about.
fn ambiguities(world: &World, schedule: &Schedule) -> Vec<String> {
    let components = world.components();
    // Without Bevy's feature `debug` systems have no names of their own.
    let systems = schedule.systems().expect("it ran");
    let names: HashMap<SystemKey, String> =
        systems.map(|(key, system)| (key, system.name().to_string())).collect();
    let name = |id: &bevy::ecs::component::ComponentId| {
        components.get_name(*id).map_or_else(String::new, |name| name.to_string())
    };
    let conflicts = schedule.graph().conflicting_systems().iter();
    let conflicts = conflicts.map(|(one, other, about)| {
        format!("{} / {}: {:?}", names[one], names[other], about.iter().map(name).collect::<Vec<_>>())
    });
    conflicts.collect()
}

/// Checks the order of all systems in all schedules that ran, those within `Update` included.
fn check_order(mut stage: Stage) {
    stage.show(level(1.0));
    stage.frames(2);
    let world = stage.app.world();
    let schedules = world.resource::<Schedules>();
    let ran: Vec<&Schedule> = schedules
        .iter()
        .map(|(_, schedule)| schedule)
        .filter(|schedule| schedule.systems().is_ok())
        .collect();
    let names: Vec<String> = ran.iter().map(|schedule| format!("{:?}", schedule.label())).collect();
    for name in ["Update", "Worlds", "Load", "Collect", "Begin", "Propagate", "PostUpdate"] {
        assert!(names.iter().any(|own| own == name), "{name} is not among {names:?}");
    }
    for (schedule, name) in ran.into_iter().zip(names) {
        let found = ambiguities(world, schedule);
        // Where systems have no names, all of them count.
        let own: Vec<_> =
            found.iter().filter(|line| line.contains("burrow") || !line.contains("::")).collect();
        assert!(own.is_empty(), "{name}: {own:#?}");
    }
}

#[test]
fn all_systems_of_the_plugin_have_an_order() {
    check_order(Stage::server());
    check_order(Stage::drawing());
}

#[test]
fn systems_of_a_game_need_no_order_relative_to_those_of_the_plugin() {
    let mut stage = Stage::drawing();
    stage.app.add_systems(Update, |mut frames: Local<u32>| *frames += 1);
    check_order(stage);
}

#[cfg(feature = "debug")]
#[test]
fn all_systems_of_debug_views_have_an_order() {
    let mut stage = Stage::with_all(
        (MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin),
        (bevy::camera::visibility::VisibilityPlugin, bevy_burrow::debug::BurrowDebugPlugin),
    );
    stage.app.init_asset::<GizmoAsset>();
    check_order(stage);
}

#[cfg(feature = "examples")]
#[test]
fn all_systems_of_looks_have_an_order() {
    let mut stage = Stage::windowless();
    stage.app.insert_resource(GroundTextures::Baked { side: 16, anisotropy: 1 });
    check_order(stage);
}

#[test]
fn figures_count_as_changed_only_when_something_was_committed() {
    #[derive(Resource, Default)]
    struct Changes(usize);
    let mut stage = Stage::drawing();
    stage.app.init_resource::<Changes>().add_systems(
        Last,
        (|mut changes: ResMut<Changes>| changes.0 += 1).run_if(resource_changed::<BurrowFigures>),
    );
    stage.show(level(1.0));
    stage.frames(4);
    let before = stage.app.world().resource::<Changes>().0;
    stage.frames(20);
    assert_eq!(stage.app.world().resource::<Changes>().0, before, "nothing happened");
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.settle();
    stage.frames(1);
    assert!(stage.app.world().resource::<Changes>().0 > before);
}

/// Tiles and chunks that came, and those of them that belonged to no terrain then.
#[derive(Resource, Default)]
struct Seen(usize, usize);

#[test]
fn tiles_and_chunks_belong_to_their_terrain_when_they_are_added() {
    fn see(new: On<Add, (Tile, Chunk)>, parents: Query<&ChildOf>, mut seen: ResMut<Seen>) {
        seen.0 += 1;
        seen.1 += usize::from(!parents.contains(new.entity));
    }
    fn see_field(
        new: On<Add, Field>,
        parents: Query<&ChildOf>,
        chunks: Query<&Chunk>,
        mut seen: ResMut<Seen>,
    ) {
        seen.0 += 1;
        let chunk = parents.get(new.entity).ok().filter(|parent| chunks.contains(parent.parent()));
        seen.1 += usize::from(chunk.is_none());
    }
    let mut stage = Stage::drawing();
    stage.app.init_resource::<Seen>().add_observer(see).add_observer(see_field);
    stage.show(level(1.0));
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.settle();
    let Seen(all, orphans) = *stage.app.world().resource::<Seen>();
    assert!(all > 17, "{all}");
    assert_eq!(orphans, 0, "of {all} came without a parent");
}

#[cfg(feature = "store")]
#[test]
fn levels_are_assets_in_whatever_order_plugins_are_added() {
    use bevy_burrow::saves::BurrowLevel;

    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BurrowPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin));
    app.finish();
    app.cleanup();
    assert!(app.world().contains_resource::<Assets<BurrowLevel>>());
    let assets = app.world().resource::<AssetServer>();
    let loader = bevy::tasks::block_on(assets.get_asset_loader_with_extension("burrow_level"));
    assert!(loader.is_ok(), "{:?}", loader.err());
}
