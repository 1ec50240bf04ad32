//! Worlds that a `SavedWorld` saves: edits are there again, whatever ends the app.
#![cfg(feature = "store")]

use std::path::Path;
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::format::Level;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{StoreError, StoreOptions};

use crate::saved::{
    Folder, Heard, app, dig, ground, hash, hear, run_until, run_until_applied, run_until_opened,
    run_until_saved, terrain,
};

#[test]
fn what_was_dug_is_there_in_the_next_app() {
    let folder = Folder::new("next");
    let (mut first, entity) = app(&folder.0);
    // Sent before the world is there.
    dig(&mut first, 20.0);
    run_until_applied(&mut first, 1);
    // With the second commit or before it, so that it is durable once that is.
    let mut worlds = first.world_mut().query::<&mut WorldStore>();
    worlds.single_mut(first.world_mut()).expect("it is open").put("coal", *b"7");
    dig(&mut first, 30.0);
    run_until_applied(&mut first, 2);
    run_until_saved(&mut first, 2);
    let before = hash(&first, entity);
    // As if the process had been killed: nothing ends in order. Nothing is left to be written either.
    std::mem::forget(first);

    // The lock belongs to the process that is gone; here it is the same one.
    let copy = Folder::new("next-copy");
    copy_folder(&folder.0, &copy.0);
    let (mut second, entity) = app(&copy.0);
    dig(&mut second, 50.0);
    run_until_opened(&mut second);
    assert_eq!(second.world().resource::<Heard>().opened, [Ok(2)]);
    assert_eq!(second.world().get::<WorldStore>(entity).expect("open").get("coal"), Some(&b"7"[..]));
    assert_eq!(hash(&second, entity), before);
    run_until_applied(&mut second, 1);
    assert_ne!(hash(&second, entity), before);
    let terrain = second.world().get::<Terrain>(entity).expect("a terrain");
    assert!(terrain.world().check_seams().is_flawless());
}

fn copy_folder(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).expect("a new folder");
    for entry in std::fs::read_dir(from).expect("a folder").flatten() {
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).expect("a file");
        }
    }
}

#[test]
fn an_app_that_exits_saves_first() {
    let folder = Folder::new("exit");
    let (mut first, entity) = app(&folder.0);
    run_until_opened(&mut first);
    dig(&mut first, 30.0);
    run_until_applied(&mut first, 1);
    let before = hash(&first, entity);
    first.world_mut().write_message(AppExit::Success);
    first.update();
    assert_eq!(first.world().get::<WorldStore>(entity).expect("open").durable(), 1);
    drop(first);

    let (mut second, entity) = app(&folder.0);
    run_until_opened(&mut second);
    assert_eq!((hash(&second, entity), &second.world().resource::<Heard>().opened), (before, &vec![Ok(1)]));
}

#[test]
fn a_terrain_that_goes_is_saved_and_its_world_can_be_opened_again() {
    let folder = Folder::new("despawn");
    let (mut app_once, entity) = app(&folder.0);
    dig(&mut app_once, 30.0);
    run_until_applied(&mut app_once, 1);
    let before = hash(&app_once, entity);
    app_once.world_mut().despawn(entity);
    app_once.update();
    drop(app_once);
    let (mut again, entity) = app(&folder.0);
    run_until_opened(&mut again);
    assert_eq!(hash(&again, entity), before);
}

#[test]
fn another_state_of_its_world_is_saved_in_its_stead() {
    let folder = Folder::new("replaced");
    let (mut first, entity) = app(&folder.0);
    dig(&mut first, 30.0);
    run_until_applied(&mut first, 1);
    run_until_saved(&mut first, 1);
    dig(&mut first, 70.0);
    run_until_applied(&mut first, 2);
    let mut new = terrain();
    new.apply([Brush::dig(Shape::sphere(Vec3::new(60.0, 11.0, 20.0), 6.0))]);
    let expected = new.world().hash();
    first.world_mut().resource_mut::<Heard>().saved.clear();
    first.world_mut().entity_mut(entity).insert(new);
    // Its revision is lower than that of the previous terrain, and is reported once it is durable.
    run_until_saved(&mut first, 1);
    let durable = first.world().get::<WorldStore>(entity).expect("it is open").durable();
    assert_eq!((durable, first.world().resource::<Heard>().closed.len()), (1, 0));
    first.world_mut().write_message(AppExit::Success);
    first.update();
    drop(first);
    let (mut second, entity) = app(&folder.0);
    run_until_opened(&mut second);
    assert_eq!(hash(&second, entity), expected);
}

#[test]
fn save_now_is_answered_even_where_nothing_is_new() {
    let folder = Folder::new("now");
    let (mut app, entity) = app(&folder.0);
    run_until_opened(&mut app);
    run_until_saved(&mut app, 0);
    let before = app.world().resource::<Heard>().saved.len();
    app.world_mut().write_message(SaveNow { terrain: Some(entity) });
    run_until(&mut app, "it is saved", |world| world.resource::<Heard>().saved.len() > before);
}

/// Changes the ground through the model in each frame.
fn dig_in_each_frame(mut terrains: Query<&mut Terrain, With<WorldStore>>, mut count: Local<u32>) {
    for mut terrain in &mut terrains {
        *count += 1;
        terrain
            .apply([Brush::dig(Shape::sphere(Vec3::new(8.0 + (*count * 7 % 80) as f32, 11.0, 40.0), 3.0))]);
    }
}

#[test]
fn a_world_that_is_dug_in_each_frame_is_told_to_be_saved() {
    let folder = Folder::new("busy");
    let (mut app, entity) = app(&folder.0);
    app.add_systems(Update, dig_in_each_frame.before(SaveSystems));
    run_until_opened(&mut app);
    run_until(&mut app, "it is told", |world| world.resource::<Heard>().saved.len() > 5);
    let told = app.world().resource::<Heard>().saved.clone();
    assert!(told.is_sorted(), "{told:?}");
    app.world_mut().write_message(SaveNow::default());
    let now = app.world().get::<Terrain>(entity).expect("a terrain").world().revision();
    run_until(&mut app, "everything up to then is reported", move |world| {
        world.resource::<Heard>().saved.last().is_some_and(|revision| *revision >= now)
    });
}

#[test]
fn data_that_is_put_alone_is_told_to_be_saved() {
    let folder = Folder::new("data");
    let (mut app, entity) = app(&folder.0);
    run_until_opened(&mut app);
    run_until_saved(&mut app, 0);
    let before = app.world().resource::<Heard>().saved.len();
    app.world_mut().get_mut::<WorldStore>(entity).expect("it is open").put("coal", *b"7");
    run_until(&mut app, "it is told", |world| world.resource::<Heard>().saved.len() > before);
    let copy = Folder::new("data-copy");
    copy_folder(&folder.0, &copy.0);
    let (store, _) =
        bevy_burrow::store::Store::open(&copy.0, ground(), StoreOptions::default()).expect("a world");
    assert_eq!(store.get("coal"), Some(&b"7"[..]));
}

#[test]
fn a_world_that_is_open_already_is_played_in_memory() {
    let folder = Folder::new("locked");
    let (mut first, _) = app(&folder.0);
    run_until_opened(&mut first);
    let (mut second, entity) = app(&folder.0);
    run_until_opened(&mut second);
    let told = &second.world().resource::<Heard>().opened[0];
    let expected = StoreError::Locked(folder.0.display().to_string()).to_string();
    assert_eq!(told, &Err(expected));
    assert!(second.world().get::<WorldStore>(entity).is_none());
    dig(&mut second, 30.0);
    run_until_applied(&mut second, 1);
}

/// A level of the terrain with a pit.
fn level() -> (Level, u64) {
    let mut terrain = terrain();
    terrain.apply([Brush::dig(Shape::sphere(Vec3::new(48.0, 11.0, 48.0), 7.0))]);
    (Level::of(&terrain), terrain.world().hash())
}

#[test]
fn a_terrain_begins_as_the_level_that_is_loaded() {
    let folder = Folder::new("level");
    let (level, expected) = level();
    std::fs::create_dir_all(&folder.0).expect("a new folder");
    let packed = Level::pack_files(&level.to_files().expect("it can be written")).expect("it is small");
    std::fs::write(folder.0.join("pit.burrow_level"), packed).expect("a new file");

    let mut app = App::new();
    let assets = AssetPlugin { file_path: folder.0.display().to_string(), ..default() };
    app.add_plugins((MinimalPlugins, assets, BurrowPlugins)).init_resource::<Heard>().add_systems(Last, hear);
    let handle = app.world().resource::<AssetServer>().load("pit.burrow_level");
    let entity = app.world_mut().spawn((terrain(), StartLevel(handle))).id();
    dig(&mut app, 20.0);
    let pit =
        move |world: &World| world.get::<Terrain>(entity).is_some_and(|own| own.world().hash() == expected);
    run_until(&mut app, "the level is there", pit);
    // What was sent meanwhile comes on top of it.
    run_until_applied(&mut app, 1);
    assert_ne!(hash(&app, entity), expected);
}

#[test]
fn a_save_begins_as_a_level_and_goes_on_as_itself() {
    let folder = Folder::new("save-of-level");
    let (level, pit) = level();
    let play = |digs: usize| {
        let (mut app, entity) = app(&folder.0);
        app.insert_resource(Assets::<BurrowLevel>::default());
        let asset = BurrowLevel::new(&level).expect("it can be written");
        let handle = app.world_mut().resource_mut::<Assets<BurrowLevel>>().add(asset);
        app.world_mut().entity_mut(entity).insert(StartLevel(handle));
        run_until_opened(&mut app);
        let first = hash(&app, entity);
        for number in 0..digs {
            dig(&mut app, 20.0);
            run_until_applied(&mut app, number + 1);
        }
        app.world_mut().write_message(AppExit::Success);
        app.update();
        (first, hash(&app, entity))
    };
    let (first, dug) = play(1);
    assert_eq!(first, pit);
    let (again, _) = play(0);
    assert_eq!(again, dug);
}

#[test]
fn rules_that_the_game_has_set_hold_in_a_level_without_any() {
    let folder = Folder::new("rules-of-level");
    let (level, pit) = level();
    let rules = DiggingRules::default().with_bedrock(-20);
    let loose = LooseSettings { crumbs: 7, ..LooseSettings::default() };
    // The second time, the save begins without them.
    for sets_rules in [true, false] {
        let (mut app, entity) = app(&folder.0);
        app.insert_resource(Assets::<BurrowLevel>::default());
        let asset = BurrowLevel::new(&level).expect("it can be written");
        let handle = app.world_mut().resource_mut::<Assets<BurrowLevel>>().add(asset);
        let mut terrain = app.world_mut().get_mut::<Terrain>(entity).expect("it is there");
        if sets_rules {
            terrain.set_rules(rules.clone()).expect("valid rules");
            terrain.set_loose(Some(loose));
        }
        app.world_mut().entity_mut(entity).insert(StartLevel(handle));
        run_until_opened(&mut app);
        let found = app.world().get::<Terrain>(entity).expect("it is there");
        assert_eq!((found.rules(), found.loose()), (Some(&rules), Some(&loose)), "{sets_rules}");
        assert_eq!(found.world().hash(), pit);
        app.world_mut().write_message(AppExit::Success);
        app.update();
    }
}

#[test]
fn a_folder_of_a_level_changes_only_where_the_level_does() {
    let folder = Folder::new("level-folder");
    let (level, expected) = level();
    level.save(&folder.0).expect("a new folder");
    let files = || {
        let entries = std::fs::read_dir(&folder.0).expect("a folder").flatten();
        entries
            .map(|entry| (entry.file_name(), std::fs::read(entry.path()).expect("a file")))
            .collect::<Vec<_>>()
    };
    let before = files();
    level.save(&folder.0).expect("the same again");
    assert_eq!(files(), before);
    let ground = std::sync::Arc::new(ground());
    let loaded = Level::load(&folder.0, &ground).expect("it was just written");
    assert_eq!(loaded.terrain(ground).expect("the same ground").world().hash(), expected);
}

#[test]
fn the_default_loss_window_is_a_second_at_most() {
    assert!(SavedWorld::new("x").loss_window <= Duration::from_secs(1));
    assert_eq!(StoreOptions::default().loss_window, SavedWorld::new("x").loss_window);
}
