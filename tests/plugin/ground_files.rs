//! Grounds of files through the asset server: heights, tiles, maps of materials; files that change; files that are wrong.

use bevy::asset::{AssetLoadFailedEvent, LoadState};
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_burrow::format::Level;
use bevy_burrow::lattice::Column;
use bevy_burrow::plugin::{EditOutbox, GroundAsset, GroundFileRead, GroundFrom};
use bevy_burrow::prelude::*;

use crate::heightmaps::{Folder, png};
use crate::stage::{Stage, dig};

/// All failures: path and reason.
#[derive(Resource, Default)]
struct Failures(Vec<(String, String)>);

fn stage_in(folder: &Folder) -> Stage {
    let assets = AssetPlugin { file_path: folder.path().to_string_lossy().into_owned(), ..default() };
    let mut stage = Stage::with((MinimalPlugins, assets))
        .recording::<GroundFileRead>()
        .recording::<AssetEvent<GroundAsset>>();
    stage.app.init_resource::<Failures>().add_systems(
        Update,
        |mut failed: MessageReader<AssetLoadFailedEvent<GroundAsset>>, mut kept: ResMut<Failures>| {
            kept.0.extend(failed.read().map(|failure| (failure.path.to_string(), failure.error.to_string())));
        },
    );
    stage
}

/// Loads a file again, and waits until its ground is another asset.
fn reload(stage: &mut Stage, name: &'static str) {
    stage.recorded::<AssetEvent<GroundAsset>>();
    stage.app.world().resource::<AssetServer>().reload(name);
    stage.frames_until("the file is read", |stage| {
        let events = stage.recorded::<AssetEvent<GroundAsset>>();
        events.iter().any(|event| matches!(event, AssetEvent::Modified { .. }))
    });
}

/// A picture of 33 x 33 heights.
fn heights(height: impl Fn(u32, u32) -> u16) -> Vec<u8> {
    let picture = image::ImageBuffer::from_fn(33, 33, |x, y| image::Luma([height(x, y)]));
    png(image::DynamicImage::ImageLuma16(picture))
}

const SCALE: &str =
    r#""scale": { "voxels_per_sample": 2, "heights": { "units": { "voxels_per_unit": 1, "base": 0 } } }"#;

fn spawn(stage: &mut Stage, name: &'static str) -> Entity {
    let ground = stage.app.world().resource::<AssetServer>().load(name);
    stage.app.world_mut().spawn(GroundFrom::new(ground)).id()
}

fn wait_for_terrain(stage: &mut Stage, terrain: Entity) {
    stage.frames_until("the terrain is there", |stage| {
        assert!(stage.app.world().resource::<Failures>().0.is_empty());
        stage.app.world().get::<Terrain>(terrain).is_some()
    });
    stage.settle();
}

fn height(stage: &Stage, terrain: Entity, x: i32, z: i32) -> i32 {
    stage.terrain(terrain).world().ground().height(Column::new(x, z)) / 256
}

#[test]
fn a_file_becomes_a_terrain_and_its_ground_changes_with_the_file_below_all_edits() {
    let folder = Folder::new("ground_file");
    folder.put("island.png", &heights(|x, _| 20 + (x / 4) as u16));
    let ids = |id| png(image::GrayImage::from_pixel(4, 4, image::Luma([id])).into());
    folder.put("ids.png", &ids(3));
    folder.put(
        "island.ground.json",
        format!(
            r#"{{ "heights": ["island.png"], {SCALE}, "materials": {{ "ids": {{ "file": "ids.png" }} }} }}"#
        )
        .as_bytes(),
    );
    let mut stage = stage_in(&folder);
    let terrain = spawn(&mut stage, "island.ground.json");
    wait_for_terrain(&mut stage, terrain);
    let read = |stage: &mut Stage| -> Vec<_> {
        let all = stage.recorded::<GroundFileRead>();
        all.into_iter().map(|message| (message.terrain == terrain, message.outcome.is_ok())).collect()
    };
    assert_eq!(read(&mut stage), [(true, true)]);
    assert_eq!(stage.terrain(terrain).world().ground().width(), 64);
    assert_eq!([height(&stage, terrain, 0, 0), height(&stage, terrain, 64, 0)], [20, 28]);
    let material =
        |stage: &Stage| stage.terrain(terrain).world().ground().column_material(Column::new(9, 9)).base;
    assert_eq!(material(&stage), MaterialId(3));

    let hole = DVec3::new(32.0, 22.0, 32.0);
    stage.send(dig(32.0, 24.0, 32.0, 5.0));
    stage.settle();
    let is_open = |stage: &Stage| !stage.terrain(terrain).world().is_solid(hole);
    assert!(is_open(&stage));

    folder.put("island.png", &heights(|_, z| 26 + (z / 8) as u16));
    folder.put("ids.png", &ids(5));
    let server = stage.app.world().resource::<AssetServer>().clone();
    server.reload("island.ground.json");
    stage.frames_until("the ground is another one", |stage| height(stage, terrain, 0, 0) == 26);
    stage.settle();
    assert_eq!(material(&stage), MaterialId(5));
    assert!(is_open(&stage), "the hole stays");
    assert_eq!(read(&mut stage), [(true, true)]);
    let pristine = DVec3::new(8.0, 27.0, 60.0);
    assert!(stage.terrain(terrain).world().is_solid(pristine));

    // The ground of a client is its server's: while edits are collected for one, the file is not followed.
    stage.app.world_mut().entity_mut(terrain).insert(EditOutbox::default());
    folder.put("island.png", &heights(|_, z| 30 + (z / 8) as u16));
    server.reload("island.ground.json");
    let asset = stage.app.world().get::<GroundFrom>(terrain).expect("it stays").ground.clone();
    stage.frames_until("the file is read", |stage| {
        let grounds = stage.app.world().resource::<Assets<GroundAsset>>();
        grounds.get(&asset).is_some_and(|asset| asset.ground.height(Column::new(0, 0)) / 256 == 30)
    });
    stage.frames(5);
    assert_eq!(height(&stage, terrain, 0, 0), 26);
    stage.app.world_mut().entity_mut(terrain).remove::<EditOutbox>();
    stage.frames_until("the ground is the file's", |stage| height(stage, terrain, 0, 0) == 30);
    stage.settle();
    assert!(is_open(&stage), "the hole stays");

    // An unchanged file changes nothing.
    let hash = stage.hash(terrain);
    reload(&mut stage, "island.ground.json");
    assert_eq!(read(&mut stage), [(true, true)]);
    stage.frames(20);
    assert_eq!(stage.hash(terrain), hash);
    assert_eq!(read(&mut stage), []);

    // Neither does one that can't be read, of which there is one message, though Bevy reads it twice.
    let picture = std::fs::read(folder.path().join("island.png")).expect("it is there");
    folder.put("island.png", b"no picture");
    server.reload("island.ground.json");
    stage.frames_until("it is refused", |stage| read(stage) == [(true, false)]);
    stage.frames(20);
    server.reload("island.ground.json");
    stage.frames(20);
    assert_eq!((stage.hash(terrain), read(&mut stage)), (hash, vec![]));
    folder.put("island.png", &picture);
    reload(&mut stage, "island.ground.json");
    stage.frames(20);
    assert_eq!(read(&mut stage), []);

    // Another size takes another terrain.
    folder.put("island.png", &png(image::DynamicImage::ImageLuma16(image::ImageBuffer::new(17, 17))));
    reload(&mut stage, "island.ground.json");
    stage.frames(3);
    assert_eq!((stage.hash(terrain), height(&stage, terrain, 0, 0)), (hash, 30));
    assert_eq!(read(&mut stage), [(true, false)]);
}

#[test]
fn tiles_and_splat_maps_make_one_ground() {
    let folder = Folder::new("ground_tiles");
    folder.put("island_x0_y0.png", &heights(|x, _| 10 + x as u16));
    folder.put("island_x1_y0.png", &heights(|x, _| 42 + x as u16));
    let splat = image::RgbaImage::from_fn(8, 8, |x, _| {
        image::Rgba(if x < 4 { [255, 0, 0, 0] } else { [0, 255, 0, 0] })
    });
    folder.put("splat.png", &png(splat.into()));
    folder.put(
        "wide.ground.json",
        format!(
            r#"{{ "heights": ["island_x0_y0.png", "island_x1_y0.png"], {SCALE},
                "materials": {{ "splats": {{ "files": ["splat.png"], "options": {{ "layers": [4, 7, null, null] }} }} }} }}"#
        )
        .as_bytes(),
    );
    let mut stage = stage_in(&folder);
    let terrain = spawn(&mut stage, "wide.ground.json");
    wait_for_terrain(&mut stage, terrain);
    let ground = stage.terrain(terrain).world().ground();
    assert_eq!((ground.width(), ground.depth()), (128, 64), "tiles share their edges");
    assert_eq!([height(&stage, terrain, 0, 0), height(&stage, terrain, 128, 64)], [10, 74]);
    let ground = stage.terrain(terrain).world().ground();
    let materials = [8, 120].map(|x| ground.column_material(Column::new(x, 8)).base);
    assert_eq!(materials, [MaterialId(4), MaterialId(7)]);
}

#[test]
fn wrong_files_say_what_is_wrong_and_make_no_terrain() {
    let folder = Folder::new("wrong_grounds");
    folder.put("good.png", &heights(|_, _| 20));
    folder.put(
        "photo.png",
        &png(image::RgbImage::from_fn(8, 8, |x, y| image::Rgb([x as u8, y as u8, 9])).into()),
    );
    let files = [
        ("none.ground.json", "{}".into(), "names no file of heights"),
        ("broken.ground.json", "{ \"heights\": ".into(), "wrong"),
        ("unknown.ground.json", r#"{ "height": ["good.png"] }"#.into(), "unknown field `height`"),
        ("lost.ground.json", format!(r#"{{ "heights": ["lost.png"], {SCALE} }}"#), "lost.png"),
        ("photo.ground.json", format!(r#"{{ "heights": ["photo.png"], {SCALE} }}"#), "photo.png"),
        ("tiles.ground.json", format!(r#"{{ "heights": ["good.png", "good.png"], {SCALE} }}"#), "no place"),
        (
            "splat.ground.json",
            format!(
                r#"{{ "heights": ["good.png"], {SCALE},
                    "materials": {{ "splats": {{ "files": ["lost.png"], "options": {{ "layers": [1] }} }} }} }}"#
            ),
            "lost.png",
        ),
        ("large.ground.json", " ".repeat((1 << 20) + 1), "at most"),
    ];
    for (name, text, _) in &files {
        folder.put(name, text.as_bytes());
    }
    let mut stage = stage_in(&folder);
    let terrains: Vec<Entity> = files.iter().map(|(name, ..)| spawn(&mut stage, name)).collect();
    stage.frames_until("all loads are done", |stage| {
        stage.app.world().resource::<Failures>().0.len() == files.len()
    });
    stage.frames(2);
    let failures = &stage.app.world().resource::<Failures>().0;
    for (name, _, reason) in &files {
        let (_, error) = failures.iter().find(|(path, _)| path == name).expect("it fails");
        assert!(error.contains(reason), "{name}: {error}");
    }
    stage.frames(10);
    let read = stage.recorded::<GroundFileRead>();
    assert_eq!(read.len(), files.len(), "one message each");
    for (terrain, (name, _, reason)) in terrains.iter().zip(&files) {
        let own = read.iter().find(|message| message.terrain == *terrain).expect("a message");
        assert!(own.outcome.as_ref().is_err_and(|error| error.contains(reason)), "{name}: {own:?}");
    }
    for terrain in terrains {
        assert!(stage.app.world().get::<Terrain>(terrain).is_none());
        let from = stage.app.world().get::<GroundFrom>(terrain).expect("it waits");
        let state = stage.app.world().resource::<AssetServer>().load_state(&from.ground);
        assert!(matches!(state, LoadState::Failed(_)), "{state:?}");
    }
}

#[test]
fn a_saved_world_on_the_ground_of_a_file_keeps_its_edits() {
    let folder = Folder::new("saved_ground_file");
    folder.put("island.png", &heights(|x, _| 20 + (x / 4) as u16));
    folder.put("island.ground.json", format!(r#"{{ "heights": ["island.png"], {SCALE} }}"#).as_bytes());
    let place = folder.path().join("saved");
    let mut hash = 0;
    for round in 0..2 {
        let mut stage = stage_in(&folder);
        let ground = stage.app.world().resource::<AssetServer>().load("island.ground.json");
        let terrain =
            stage.app.world_mut().spawn((GroundFrom::new(ground), SavedWorld::new(place.clone()))).id();
        wait_for_terrain(&mut stage, terrain);
        stage.frames_until("the world is open", |stage| {
            stage.app.world().get::<WorldStore>(terrain).is_some()
        });
        if round == 0 {
            stage.send(dig(32.0, 24.0, 32.0, 5.0));
            stage.settle();
            hash = stage.hash(terrain);
        } else {
            stage.frames_until("the hole is back", |stage| stage.hash(terrain) == hash);
        }
        stage.app.world_mut().despawn(terrain);
        stage.frames(5);
    }
}

#[test]
fn a_level_begins_on_the_ground_of_a_file() {
    let folder = Folder::new("level_on_ground_file");
    folder.put("island.png", &heights(|x, _| 20 + (x / 4) as u16));
    folder.put("island.ground.json", format!(r#"{{ "heights": ["island.png"], {SCALE} }}"#).as_bytes());
    let mut stage = stage_in(&folder);
    let terrain = spawn(&mut stage, "island.ground.json");
    wait_for_terrain(&mut stage, terrain);
    stage.send(dig(32.0, 24.0, 32.0, 5.0));
    stage.settle();
    let sculpted = stage.hash(terrain);
    let level = BurrowLevel::new(&Level::of(stage.terrain(terrain))).expect("it can be written");
    stage.app.world_mut().despawn(terrain);
    let level = stage.app.world_mut().resource_mut::<Assets<BurrowLevel>>().add(level);
    let ground = stage.app.world().resource::<AssetServer>().load("island.ground.json");
    let terrain = stage.app.world_mut().spawn((GroundFrom::new(ground), StartLevel(level))).id();
    wait_for_terrain(&mut stage, terrain);
    stage.frames_until("the level is there", |stage| stage.hash(terrain) == sculpted);
}
