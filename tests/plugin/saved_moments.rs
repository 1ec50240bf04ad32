//! The moments in which a world is opened and closed: whatever the game does in one of them, a world is saved in the
//! folder that its component names, nothing is held for ever, and no folder stays locked.
#![cfg(feature = "store")]

use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::window::WindowCloseRequested;
use bevy_burrow::format::Level;
use bevy_burrow::plugin::Held;
use bevy_burrow::prelude::*;
use bevy_burrow::saves::OpeningWorld;
use bevy_burrow::store::{Store, StoreOptions};

use crate::saved::{
    Folder, Heard, app, dig, dig_now, empty, exit, ground, hash, hash_in, heard, listen, model, run_until,
    run_until_closed, run_until_opened, saved, terrain, with_assets,
};

fn run_until_ready(game: &mut App) {
    run_until(game, "it is ready", |world| world.resource::<Heard>().ready > 0);
}

#[test]
fn a_terrain_that_goes_together_with_its_world_holds_no_later_one() {
    let folder = Folder::new("together");
    drop(Store::create(&folder.0, &mut terrain(), StoreOptions::default()).expect("a new world"));
    // It is read for as long as somebody else has it open.
    let holder = Store::open(&folder.0, ground(), StoreOptions::default()).expect("a world");
    let mut game = with_assets();
    let entity = game.world_mut().spawn((terrain(), saved(&folder.0))).id();
    (0..20).for_each(|_| game.update());
    assert!(game.world().get::<OpeningWorld>(entity).is_some());
    game.world_mut().entity_mut(entity).remove::<(Terrain, SavedWorld)>();
    game.update();
    drop(holder);
    // After a level that comes and goes, the next one is loaded.
    let level = game.world().resource::<Assets<BurrowLevel>>().reserve_handle();
    game.world_mut().entity_mut(entity).insert((terrain(), StartLevel(level)));
    (0..10).for_each(|_| game.update());
    game.world_mut().entity_mut(entity).remove::<StartLevel>();
    run_until_ready(&mut game);
    dig_now(&mut game, 30.0);
    exit(game);
    assert_eq!(hash_in(&folder.0, terrain()).map(|(revision, _)| revision), Ok(0));
}

#[test]
fn components_that_an_observer_takes_off_at_once_hold_nothing() {
    let folder = Folder::new("at-once");
    let mut game = with_assets();
    game.add_observer(|new: On<Add, SavedWorld>, mut commands: Commands| {
        commands.entity(new.entity).remove::<SavedWorld>();
    });
    game.add_observer(|new: On<Add, StartLevel>, mut commands: Commands| {
        commands.entity(new.entity).remove::<StartLevel>();
    });
    let level = game.world().resource::<Assets<BurrowLevel>>().reserve_handle();
    game.world_mut().spawn((terrain(), saved(&folder.0), StartLevel(level)));
    run_until_ready(&mut game);
    dig_now(&mut game, 30.0);
    exit(game);
    assert!(!Store::is_in(&folder.0));
}

#[test]
fn a_terrain_that_the_game_holds_stays_held_when_its_world_is_open() {
    let folder = Folder::new("held");
    let mut game = empty();
    let entity = game.world_mut().spawn((terrain(), saved(&folder.0), Held)).id();
    run_until_opened(&mut game);
    dig(&mut game, 30.0);
    (0..100).for_each(|_| game.update());
    assert_eq!((heard(&game).ready, heard(&game).answered), (0, 0));
    game.world_mut().entity_mut(entity).remove::<Held>();
    run_until_ready(&mut game);
    // A terrain without another `Held` continues automatically.
    let other = Folder::new("held-not");
    let entity = game.world_mut().spawn((terrain(), saved(&other.0))).id();
    run_until(&mut game, "it goes on", move |world| world.get::<Held>(entity).is_none());
}

#[test]
fn a_terrain_that_is_spawned_before_the_plugin_is_saved() {
    let folder = Folder::new("before");
    let mut game = App::new();
    let entity = game.world_mut().spawn((terrain(), saved(&folder.0))).id();
    game.add_plugins((MinimalPlugins, BurrowPlugins));
    listen(&mut game);
    run_until_opened(&mut game);
    dig_now(&mut game, 30.0);
    let before = hash(&game, entity);
    exit(game);
    assert_eq!(hash_in(&folder.0, terrain()), Ok((1, before)));
}

#[test]
fn a_level_that_is_spawned_before_the_plugin_is_made() {
    let mut dug = terrain();
    dug.apply([Brush::dig(Shape::sphere(Vec3::new(60.0, 11.0, 20.0), 6.0))]);
    let level = BurrowLevel::new(&Level::of(&dug)).expect("it can be written");
    let mut game = App::new();
    let mut levels = Assets::<BurrowLevel>::default();
    let level = levels.add(level);
    game.insert_resource(levels);
    let entity = game.world_mut().spawn((terrain(), StartLevel(level))).id();
    game.add_plugins((MinimalPlugins, BurrowPlugins));
    listen(&mut game);
    run_until_ready(&mut game);
    assert_eq!(hash(&game, entity), dug.world().hash());
}

/// What a game does in one frame.
#[derive(Resource)]
struct Act {
    frame: u32,
    then: Option<SavedWorld>,
}

fn act(mut act: ResMut<Act>, mut commands: Commands, terrain: Single<Entity, With<Terrain>>) {
    if act.frame == 0 {
        match act.then.take() {
            Some(then) => commands.entity(*terrain).insert(then),
            None => commands.entity(*terrain).remove::<SavedWorld>(),
        };
    }
    act.frame = act.frame.wrapping_sub(1);
}

/// An app in which a game acts in one frame, in a place among the crate's systems.
fn acting(place: usize, frame: u32, then: Option<SavedWorld>) -> App {
    let mut game = App::new();
    game.insert_resource(Act { frame, then });
    // Commands of a system are applied together with those of systems nearby, so these run before, between and after
    // those that open worlds, and added before and after them.
    match place {
        0 => game.add_systems(Update, act.before_ignore_deferred(BurrowSystems::Load)),
        1 => game.add_systems(First, act),
        _ => &mut game,
    };
    game.add_plugins((MinimalPlugins, BurrowPlugins));
    match place {
        2 => game.add_systems(Update, act.before_ignore_deferred(BurrowSystems::Load)),
        3 => game.add_systems(Update, act.before(BurrowSystems::Load)),
        4 => game.add_systems(Update, act.after(SaveSystems)),
        _ => &mut game,
    };
    listen(&mut game);
    game.finish();
    game.cleanup();
    game
}

#[test]
fn a_world_that_is_named_anew_or_left_in_any_place_of_a_frame_is_saved_where_it_is_named() {
    for place in 0..5 {
        for frame in 0..6 {
            for is_named in [true, false] {
                let when = format!("place {place}, frame {frame}, {is_named}");
                let folders =
                    ["named-a", "named-b"].map(|name| Folder::new(&format!("{name}-{place}-{frame}")));
                let paths: [PathBuf; 2] = [0, 1].map(|number: usize| folders[number].0.clone());
                let mut game = acting(place, frame, is_named.then(|| saved(&paths[1])));
                let entity = game.world_mut().spawn((terrain(), saved(&paths[0]))).id();
                run_until(&mut game, "the game has acted", |world| world.resource::<Act>().frame > 1000);
                let named = is_named.then(|| saved(&paths[1]));
                assert_eq!(game.world().get::<SavedWorld>(entity), named.as_ref(), "{when}");
                run_until(&mut game, &when, move |world| {
                    world.get::<Held>(entity).is_none()
                        && world.get::<WorldStore>(entity).is_some() == is_named
                });
                dig_now(&mut game, 30.0);
                let dug = hash(&game, entity);
                // The folder that was left is free again.
                let start = std::time::Instant::now();
                while Store::is_in(&paths[0]) {
                    game.update();
                    match Store::open(&paths[0], ground(), StoreOptions::default()) {
                        Ok((_, opened)) => {
                            assert_eq!(opened.terrain.world().revision(), 0, "{when}");
                            break;
                        }
                        Err(_) if start.elapsed().as_secs() < 20 => {}
                        Err(why) => panic!("{when}: {why}"),
                    }
                }
                exit(game);
                if is_named {
                    assert_eq!(hash_in(&paths[1], terrain()), Ok((1, dug)), "{when}");
                } else {
                    assert!(!Store::is_in(&paths[1]), "{when}");
                }
            }
        }
    }
}

#[test]
fn a_component_that_is_changed_in_its_place_names_another_world() {
    for is_open in [true, false] {
        let folders = ["changed-a", "changed-b"].map(Folder::new);
        let mut game = empty();
        let entity = game.world_mut().spawn((terrain(), saved(&folders[0].0))).id();
        if is_open {
            run_until_opened(&mut game);
            dig_now(&mut game, 30.0);
        } else {
            game.update();
        }
        let before = hash(&game, entity);
        game.world_mut().get_mut::<SavedWorld>(entity).expect("a component").path = folders[1].0.clone();
        run_until(&mut game, "the other one is open", |world| {
            world.resource::<Heard>().opened.len() == 1 + usize::from(is_open)
        });
        dig_now(&mut game, 60.0);
        let last = (model(&game, entity).world().revision(), hash(&game, entity));
        exit(game);
        assert_eq!(hash_in(&folders[1].0, terrain()), Ok(last));
        if is_open {
            assert_eq!(hash_in(&folders[0].0, terrain()), Ok((1, before)));
        }
    }
}

#[test]
fn another_level_that_comes_after_a_terrain_went_is_not_put_into_the_world_of_that() {
    let folder = Folder::new("other-later");
    let mut first = terrain();
    first.apply([Brush::dig(Shape::sphere(Vec3::new(60.0, 11.0, 20.0), 6.0))]);
    let before = first.world().hash();
    drop(Store::create(&folder.0, &mut first, StoreOptions::default()).expect("a new world"));
    let holder = Store::open(&folder.0, ground(), StoreOptions::default()).expect("a world");
    let mut game = empty();
    let entity = game.world_mut().spawn((terrain(), saved(&folder.0))).id();
    (0..20).for_each(|_| game.update());
    game.world_mut().entity_mut(entity).remove::<Terrain>();
    (0..20).for_each(|_| game.update());
    game.world_mut().entity_mut(entity).insert(crate::saved::flat(96, 20.0, 32, 1.0));
    drop(holder);
    run_until_opened(&mut game);
    assert!(heard(&game).opened[0].is_err(), "{:?}", heard(&game).opened);
    assert!(game.world().get::<SavedWorld>(entity).is_none() && game.world().get::<Held>(entity).is_none());
    dig_now(&mut game, 30.0);
    exit(game);
    assert_eq!(hash_in(&folder.0, terrain()), Ok((1, before)));
}

#[test]
fn two_terrains_with_one_folder_do_not_write_into_each_other() {
    let folder = Folder::new("two");
    let (mut game, first) = app(&folder.0);
    run_until_opened(&mut game);
    dig_now(&mut game, 30.0);
    let before = hash(&game, first);
    let second =
        game.world_mut().spawn((terrain(), Transform::from_xyz(500.0, 0.0, 0.0), saved(&folder.0))).id();
    (0..200).for_each(|_| game.update());
    // It waits for the first, and continues with its world once that is closed.
    assert!(game.world().get::<Held>(second).is_some());
    game.world_mut().despawn(first);
    run_until(&mut game, "the second is opened", |world| world.resource::<Heard>().opened.len() == 2);
    assert_eq!(heard(&game).opened[1], Ok(1));
    assert_eq!(hash(&game, second), before);
}

#[test]
fn a_folder_that_is_removed_while_a_world_is_open_is_told_of_and_written_again() {
    let folder = Folder::new("removed");
    let (mut game, entity) = app(&folder.0);
    run_until_opened(&mut game);
    dig_now(&mut game, 30.0);
    drop(std::fs::remove_dir_all(&folder.0));
    dig_now(&mut game, 60.0);
    game.world_mut().write_message(SaveNow::default());
    run_until(&mut game, "it is told", |world| {
        let heard = world.resource::<Heard>();
        !heard.warnings.is_empty() || heard.saved.contains(&2)
    });
    let before = hash(&game, entity);
    game.world_mut().entity_mut(entity).remove::<SavedWorld>();
    run_until_closed(&mut game, 1);
    let closed =
        heard(&game).closed[0].outcome.as_ref().map(|revision| *revision).map_err(ToString::to_string);
    let warnings = heard(&game).warnings.clone();
    exit(game);
    match closed {
        // Everything reported as saved is there.
        Ok(_) => assert_eq!(hash_in(&folder.0, terrain()), Ok((2, before)), "{warnings:?}"),
        Err(why) => assert!(!warnings.is_empty(), "{why}"),
    }
}

#[test]
fn undos_in_each_phase_of_opening_and_closing_are_answered_and_saved() {
    #[derive(Resource, Default)]
    struct Steps(usize);
    for act in ["reading", "open", "saving", "leaving"] {
        let folder = Folder::new(&format!("undo-{act}"));
        let (mut game, entity) = app(&folder.0);
        game.init_resource::<Steps>().add_systems(
            Last,
            |mut moved: MessageReader<HistoryMoved>, mut steps: ResMut<Steps>| {
                steps.0 += moved.read().count()
            },
        );
        let undo = |game: &mut App| {
            game.world_mut().write_message(Undo::default());
        };
        dig(&mut game, 20.0);
        dig(&mut game, 60.0);
        if act == "reading" {
            undo(&mut game);
        }
        run_until_opened(&mut game);
        match act {
            "reading" => {}
            "open" => {
                run_until(&mut game, "both are dug", |world| world.resource::<Heard>().receipts == 2);
                undo(&mut game);
            }
            "saving" => {
                run_until(&mut game, "both are dug", |world| world.resource::<Heard>().receipts == 2);
                game.world_mut().write_message(SaveNow::default());
                undo(&mut game);
            }
            _ => {
                run_until(&mut game, "both are dug", |world| world.resource::<Heard>().receipts == 2);
                undo(&mut game);
                game.update();
                game.world_mut().entity_mut(entity).remove::<SavedWorld>();
            }
        }
        run_until(&mut game, &format!("{act}: it is answered"), |world| world.resource::<Steps>().0 == 1);
        if act == "leaving" {
            // Committed before it was left, or not: either way the folder holds one of the two states, whole.
            run_until_closed(&mut game, 1);
            let saved = *heard(&game).closed[0].outcome.as_ref().expect("it is saved");
            exit(game);
            assert_eq!(hash_in(&folder.0, terrain()).map(|(revision, _)| revision), Ok(saved));
            continue;
        }
        let (revision, before) = (model(&game, entity).world().revision(), hash(&game, entity));
        exit(game);
        assert_eq!(hash_in(&folder.0, terrain()), Ok((revision, before)), "{act}");
    }
}

#[test]
fn an_app_that_ends_in_any_frame_of_opening_leaves_a_world_or_none() {
    for frames in 0..8 {
        for is_told in [true, false] {
            let folder = Folder::new(&format!("ends-{frames}"));
            let (mut game, _) = app(&folder.0);
            dig(&mut game, 30.0);
            (0..frames).for_each(|_| game.update());
            if is_told {
                exit(game);
            } else {
                drop(game);
            }
            let (mut again, entity) = app(&folder.0);
            run_until_opened(&mut again);
            assert!(heard(&again).opened[0].is_ok(), "{frames}: {:?}", heard(&again).opened);
            assert_eq!(heard(&again).warnings, [], "{frames}");
            dig_now(&mut again, 60.0);
            let before = hash(&again, entity);
            exit(again);
            assert_eq!(hash_in(&folder.0, terrain()).map(|(_, hash)| hash), Ok(before));
        }
    }
}

/// Stores the number of digs with the world, as a game stores what they yield.
fn store_count(
    mut applied: MessageReader<BrushApplied>,
    mut count: Local<u8>,
    mut worlds: Query<&mut WorldStore>,
) {
    *count += applied.read().count() as u8;
    worlds.iter_mut().for_each(|mut world| world.put("digs", [*count]));
}

/// An app that ends with its window, with an open world: small digs are committed in their frame.
fn with_window(path: &Path) -> App {
    let mut game = App::new();
    game.add_plugins((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin))
        .add_plugins((WindowPlugin::default(), BurrowPlugins))
        .add_systems(Update, store_count.after(BurrowSystems::Commit).before(SaveSystems));
    listen(&mut game);
    game.finish();
    game.cleanup();
    game.world_mut().resource_mut::<BurrowSettings>().same_frame = Duration::from_secs(60);
    game.world_mut().spawn((terrain(), saved(path)));
    run_until_opened(&mut game);
    run_until_ready(&mut game);
    game
}

#[test]
fn a_dig_in_a_frame_in_which_the_window_closes_is_saved_with_what_the_game_stores_for_it_or_not_at_all() {
    // The dig is in the last frame, or in the one before: that in which the close button is pressed.
    for (is_despawned, exits, is_last) in [
        (false, false, false),
        (false, false, true),
        (false, true, false),
        (false, true, true),
        (true, false, false),
        (true, false, true),
        (true, true, true),
    ] {
        let when = format!("despawned: {is_despawned}, exits: {exits}, last: {is_last}");
        let folder = Folder::new("window");
        let mut game = with_window(&folder.0);
        let world = game.world_mut();
        let window = world.query_filtered::<Entity, With<Window>>().single(world).expect("one window");
        if !is_despawned {
            world.write_message(WindowCloseRequested { window });
        }
        if !is_last {
            dig(&mut game, 30.0);
        }
        game.update();
        assert!(game.should_exit().is_none(), "{when}");
        if is_last {
            dig(&mut game, 30.0);
        }
        if exits {
            game.world_mut().write_message(AppExit::Success);
        }
        if is_despawned {
            game.world_mut().despawn(window);
        }
        game.update();
        assert!(game.should_exit().is_some(), "{when}");
        drop(game);
        let (mut again, entity) = app(&folder.0);
        run_until_opened(&mut again);
        let digs = again.world().get::<WorldStore>(entity).expect("it is open").get("digs");
        let digs = digs.map_or(0, |digs| u64::from(digs[0]));
        assert_eq!((&heard(&again).opened, digs), (&vec![Ok(digs)], u64::from(!is_last)), "{when}");
    }
}
