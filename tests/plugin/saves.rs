//! Worlds that a `SavedWorld` saves: what was dug is there again, whatever ends the app.
#![cfg(feature = "store")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Level, StoreError, StoreOptions, load_level, pack_level, save_level, write_level};

/// A folder that is removed with this.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("burrow-saves-{}-{name}", std::process::id()));
        drop(std::fs::remove_dir_all(&path));
        Self(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        drop(std::fs::remove_dir_all(&self.0));
    }
}

#[derive(Resource, Default)]
struct Heard {
    opened: Vec<Result<u64, String>>,
    saved: Vec<u64>,
    receipts: usize,
}

fn hear(
    mut opened: MessageReader<WorldOpened>,
    mut saved: MessageReader<WorldSaved>,
    mut receipts: MessageReader<BrushApplied>,
    mut heard: ResMut<Heard>,
) {
    let outcome = |message: &WorldOpened| message.outcome.clone().map_err(|why| why.to_string());
    heard.opened.extend(opened.read().map(outcome));
    heard.saved.extend(saved.read().map(|message| message.revision));
    heard.receipts += receipts.read().filter(|message| message.receipt.outcome.is_ok()).count();
}

fn ground() -> Ground {
    Ground::from_fn(96, 96, |x, z| f64::from((x * 5 + z * 3) % 17) / 4.0 + 10.0).expect("valid")
}

fn terrain() -> Terrain {
    Terrain::new(ground(), &TerrainSettings::default()).expect("valid")
}

/// An app with a saved terrain.
fn app(path: &Path) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BurrowPlugins)).init_resource::<Heard>().add_systems(Last, hear);
    let saved = SavedWorld { loss_window: Duration::from_millis(20), ..SavedWorld::new(path) };
    let entity = app.world_mut().spawn((terrain(), saved)).id();
    (app, entity)
}

fn run_until(app: &mut App, what: &str, is_done: impl Fn(&World) -> bool) {
    let start = Instant::now();
    while !is_done(app.world()) {
        app.update();
        assert!(start.elapsed() < Duration::from_secs(60), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

fn dig(app: &mut App, x: f32) {
    app.world_mut().write_message(Brush::dig(Shape::sphere(Vec3::new(x, 11.0, 40.0), 4.0)));
}

fn hash(app: &App, entity: Entity) -> u64 {
    app.world().get::<Terrain>(entity).expect("a terrain").world().hash()
}

fn run_until_saved(app: &mut App, revision: u64) {
    run_until(app, "everything is durable", |world| world.resource::<Heard>().saved.contains(&revision));
}

#[test]
fn what_was_dug_is_there_in_the_next_app() {
    let folder = Folder::new("next");
    let (mut first, entity) = app(&folder.0);
    // Sent before the world is there.
    dig(&mut first, 20.0);
    run_until(&mut first, "the dig is applied", |world| world.resource::<Heard>().receipts == 1);
    dig(&mut first, 30.0);
    run_until(&mut first, "the dig is applied", |world| world.resource::<Heard>().receipts == 2);
    let mut worlds = first.world_mut().query::<&mut WorldStore>();
    worlds.single_mut(first.world_mut()).expect("it is open").put("coal", *b"7");
    run_until_saved(&mut first, 2);
    let before = hash(&first, entity);
    // As if the process had been killed: nothing is told to end.
    std::mem::forget(first);

    // The lock belongs to the process that is gone; here it is the same one.
    let copy = Folder::new("next-copy");
    copy_folder(&folder.0, &copy.0);
    let (mut second, entity) = app(&copy.0);
    dig(&mut second, 50.0);
    run_until(&mut second, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
    assert_eq!(second.world().resource::<Heard>().opened, [Ok(2)]);
    assert_eq!(second.world().get::<WorldStore>(entity).expect("open").get("coal"), Some(&b"7"[..]));
    assert_eq!(hash(&second, entity), before);
    run_until(&mut second, "the dig is applied", |world| world.resource::<Heard>().receipts == 1);
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
    run_until(&mut first, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
    dig(&mut first, 30.0);
    run_until(&mut first, "the dig is applied", |world| world.resource::<Heard>().receipts == 1);
    let before = hash(&first, entity);
    first.world_mut().write_message(AppExit::Success);
    first.update();
    assert_eq!(first.world().get::<WorldStore>(entity).expect("open").durable(), 1);
    drop(first);

    let (mut second, entity) = app(&folder.0);
    run_until(&mut second, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
    assert_eq!((hash(&second, entity), &second.world().resource::<Heard>().opened), (before, &vec![Ok(1)]));
}

#[test]
fn a_terrain_that_goes_is_saved_and_its_world_can_be_opened_again() {
    let folder = Folder::new("despawn");
    let (mut app_once, entity) = app(&folder.0);
    dig(&mut app_once, 30.0);
    run_until(&mut app_once, "the dig is applied", |world| world.resource::<Heard>().receipts == 1);
    let before = hash(&app_once, entity);
    app_once.world_mut().despawn(entity);
    app_once.update();
    drop(app_once);
    let (mut again, entity) = app(&folder.0);
    run_until(&mut again, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
    assert_eq!(hash(&again, entity), before);
}

#[test]
fn another_terrain_in_its_place_is_saved_in_its_stead() {
    let folder = Folder::new("replaced");
    let (mut first, entity) = app(&folder.0);
    dig(&mut first, 30.0);
    run_until(&mut first, "the dig is applied", |world| world.resource::<Heard>().receipts == 1);
    let mut new = terrain();
    new.apply([Brush::dig(Shape::sphere(Vec3::new(60.0, 11.0, 20.0), 6.0))]);
    let expected = new.world().hash();
    first.world_mut().entity_mut(entity).insert(new);
    run_until_saved(&mut first, 1);
    first.world_mut().write_message(AppExit::Success);
    first.update();
    drop(first);
    let (mut second, entity) = app(&folder.0);
    run_until(&mut second, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
    assert_eq!(hash(&second, entity), expected);
}

#[test]
fn save_now_is_answered_even_where_nothing_is_new() {
    let folder = Folder::new("now");
    let (mut app, entity) = app(&folder.0);
    run_until(&mut app, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
    run_until_saved(&mut app, 0);
    let before = app.world().resource::<Heard>().saved.len();
    app.world_mut().write_message(SaveNow { terrain: Some(entity) });
    run_until(&mut app, "it is saved", |world| world.resource::<Heard>().saved.len() > before);
}

#[test]
fn a_world_that_is_open_already_is_played_in_memory() {
    let folder = Folder::new("locked");
    let (mut first, _) = app(&folder.0);
    run_until(&mut first, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
    let (mut second, entity) = app(&folder.0);
    run_until(&mut second, "it is told", |world| !world.resource::<Heard>().opened.is_empty());
    let told = &second.world().resource::<Heard>().opened[0];
    let expected = StoreError::Locked(folder.0.display().to_string()).to_string();
    assert_eq!(told, &Err(expected));
    assert!(second.world().get::<WorldStore>(entity).is_none());
    dig(&mut second, 30.0);
    run_until(&mut second, "the dig is applied", |world| world.resource::<Heard>().receipts == 1);
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
    let packed = pack_level(&write_level(&level).expect("it can be written")).expect("it is small");
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
    run_until(&mut app, "the dig is applied", |world| world.resource::<Heard>().receipts == 1);
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
        run_until(&mut app, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
        let first = hash(&app, entity);
        for number in 0..digs {
            dig(&mut app, 20.0);
            run_until(&mut app, "it is dug", move |world| world.resource::<Heard>().receipts > number);
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
fn a_folder_of_a_level_changes_only_where_the_level_does() {
    let folder = Folder::new("level-folder");
    let (level, expected) = level();
    save_level(&folder.0, &level).expect("a new folder");
    let files = || {
        let entries = std::fs::read_dir(&folder.0).expect("a folder").flatten();
        entries
            .map(|entry| (entry.file_name(), std::fs::read(entry.path()).expect("a file")))
            .collect::<Vec<_>>()
    };
    let before = files();
    save_level(&folder.0, &level).expect("the same again");
    assert_eq!(files(), before);
    let ground = std::sync::Arc::new(ground());
    let loaded = load_level(&folder.0, &ground).expect("it was just written");
    assert_eq!(loaded.terrain(ground).expect("the same ground").world().hash(), expected);
}

#[test]
fn the_default_loss_window_is_a_second_at_most() {
    assert!(SavedWorld::new("x").loss_window <= Duration::from_secs(1));
    assert_eq!(StoreOptions::default().loss_window, SavedWorld::new("x").loss_window);
}
