//! Heightmap files through the asset server.

use std::path::{Path, PathBuf};

use bevy::asset::{AssetLoadFailedEvent, LoadState};
use bevy::prelude::*;
use bevy_burrow::ground::ImageLimits;
use bevy_burrow::plugin::{HeightmapPlugin, HeightmapSettings};
use bevy_burrow::prelude::*;

use crate::stage::Stage;
use crate::worlds;

/// All failures: path and reason.
#[derive(Resource, Default)]
struct Failures(Vec<(String, String)>);

fn stage_in(folder: &Path) -> Stage {
    let assets = AssetPlugin { file_path: folder.to_string_lossy().into_owned(), ..default() };
    let mut stage = Stage::with((MinimalPlugins, assets));
    stage.app.init_resource::<Failures>().add_systems(
        Update,
        |mut failed: MessageReader<AssetLoadFailedEvent<HeightmapImage>>, mut kept: ResMut<Failures>| {
            kept.0.extend(failed.read().map(|failure| (failure.path.to_string(), failure.error.to_string())));
        },
    );
    stage
}

/// Loads an image that is valid.
fn load(stage: &mut Stage, path: &'static str) -> Handle<HeightmapImage> {
    let handle: Handle<HeightmapImage> = stage.app.world().resource::<AssetServer>().load(path);
    stage.frames_until("the image is loaded", |stage| {
        let state = stage.app.world().resource::<AssetServer>().load_state(&handle);
        assert!(!matches!(state, LoadState::Failed(_)), "{state:?}");
        stage.app.world().resource::<Assets<HeightmapImage>>().contains(&handle)
    });
    handle
}

/// A temporary folder that is removed when dropped.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("bevy_burrow_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a temporary folder");
        Self(path)
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    pub fn put(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.0.join(name), bytes).expect("a temporary file");
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

pub fn png(image: image::DynamicImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("a PNG");
    bytes.into_inner()
}

#[test]
fn the_shipped_elevation_model_loads_as_an_asset_and_becomes_a_terrain() {
    let mut stage = stage_in(Path::new("assets"));
    let handle = load(&mut stage, "jacksboro_fault.png");
    let HeightmapImage(image) =
        stage.app.world().resource::<Assets<HeightmapImage>>().get(&handle).expect("loaded");
    let expected = worlds::real_image();
    assert_eq!(
        (image.width(), image.height(), image.samples()),
        (expected.width(), expected.height(), expected.samples())
    );
    let scale = ImageScale { voxels_per_sample: 3, low: 0.0, high: 150.0, detail: None };
    let ground = Ground::from_image(image, &scale).expect("a valid landscape");
    assert!(ground.width() >= 1024 && ground.depth() >= 1024);
    assert!(stage.app.world().resource::<Failures>().0.is_empty());
}

#[test]
fn files_that_are_no_heightmap_fail_with_their_reason() {
    let folder = Folder::new("bad_heightmaps");
    let grey = png(image::DynamicImage::ImageLuma16(image::ImageBuffer::from_fn(32, 32, |x, y| {
        image::Luma([(x * y) as u16])
    })));
    let color = png(image::DynamicImage::ImageRgb8(image::ImageBuffer::new(8, 8)));
    folder.put("good.png", &grey);
    let files: [(&str, &[u8], &str); 6] = [
        ("cut.png", &grey[..grey.len() / 2], "truncated"),
        ("color.png", &color, "plain grey"),
        ("empty.png", b"", ""),
        ("words.png", b"this is not an image at all, but text", "decoded"),
        ("heights.raw", &[0; 128], "no header"),
        ("heights.r16", &[0; 128], "no header"),
    ];
    for (name, bytes, _) in files {
        folder.put(name, bytes);
    }
    let mut stage = stage_in(&folder.0);
    let server = stage.app.world().resource::<AssetServer>().clone();
    let good: Handle<HeightmapImage> = server.load("good.png");
    let mut handles: Vec<Handle<HeightmapImage>> =
        files.iter().map(|(name, _, _)| server.load(*name)).collect();
    handles.push(server.load("missing.png"));
    let small = HeightmapSettings { limits: ImageLimits { max_file_bytes: 100, ..default() }, ..default() };
    folder.put("large.png", &grey);
    handles.push(
        server
            .load_builder()
            .with_settings(move |settings: &mut HeightmapSettings| *settings = small.clone())
            .load("large.png"),
    );
    stage.frames_until("all loads are done", |stage| {
        let failed = stage.app.world().resource::<Failures>().0.len() == handles.len();
        failed && stage.app.world().resource::<Assets<HeightmapImage>>().contains(&good)
    });
    let failures = &stage.app.world().resource::<Failures>().0;
    for (name, _, reason) in
        files.into_iter().chain([("missing.png", &[] as &[u8], ""), ("large.png", &[], "limit is 100")])
    {
        let (_, error) =
            failures.iter().find(|(path, _)| path == name).unwrap_or_else(|| panic!("{name}: {failures:?}"));
        assert!(error.contains(reason), "{name}: {error}");
    }
    assert!(handles.iter().all(|handle| matches!(server.load_state(handle), LoadState::Failed(_))));
}

#[test]
fn a_raw_file_loads_with_the_settings_of_its_meta_file() {
    let folder = Folder::new("raw_heightmap");
    let samples: Vec<u16> = (0..12).map(|index| index * 1000 + 7).collect();
    folder.put("heights.raw", &samples.iter().flat_map(|sample| sample.to_be_bytes()).collect::<Vec<u8>>());
    folder.put(
        "heights.raw.meta",
        br#"(
            meta_format_version: "1.0",
            asset: Load(
                loader: "bevy_burrow::plugin::heightmap::HeightmapLoader",
                settings: (
                    raw: Some((width: 4, height: 3, format: BigEndian)),
                    limits: (max_file_bytes: 1000, max_width: 64, max_height: 64, max_alloc_bytes: 10000),
                ),
            ),
        )"#,
    );
    let mut stage = stage_in(&folder.0);
    let handle = load(&mut stage, "heights.raw");
    let HeightmapImage(image) =
        stage.app.world().resource::<Assets<HeightmapImage>>().get(&handle).expect("loaded");
    assert_eq!((image.width(), image.height(), image.samples()), (4, 3, &samples[..]));
}

/// A stand-in for Bevy's own image loader.
#[derive(Default, TypePath)]
struct Pictures;

impl bevy::asset::AssetLoader for Pictures {
    type Asset = Image;
    type Settings = ();
    type Error = std::io::Error;

    async fn load(
        &self,
        _: &mut dyn bevy::asset::io::Reader,
        (): &(),
        _: &mut bevy::asset::LoadContext<'_>,
    ) -> Result<Image, std::io::Error> {
        Ok(Image::default())
    }

    fn extensions(&self) -> &[&str] {
        &["png"]
    }
}

#[test]
fn a_games_own_images_still_load_as_images() {
    let folder = Folder::new("pictures");
    folder.put("colours.png", &png(image::RgbImage::new(4, 4).into()));
    let assets = AssetPlugin { file_path: folder.0.to_string_lossy().into_owned(), ..default() };
    let mut stage = Stage::with((MinimalPlugins, assets, |app: &mut App| {
        app.init_asset::<Image>().init_asset_loader::<Pictures>();
    }));
    let server = stage.app.world().resource::<AssetServer>().clone();
    let untyped = server.load_builder().load_untyped("colours.png");
    stage.frames_until("a picture is loaded", |stage| {
        let state = stage.app.world().resource::<AssetServer>().load_state(&untyped);
        assert!(!matches!(state, LoadState::Failed(_)), "{state:?}");
        matches!(state, LoadState::Loaded)
    });
    let pictures = stage.app.world().resource::<Assets<Image>>();
    assert_eq!(pictures.iter().count(), 1, "no other loader took it");
}

/// A game's own resource that loads a heightmap when it is created.
#[derive(Resource)]
struct Map(Handle<HeightmapImage>);

impl FromWorld for Map {
    fn from_world(world: &mut World) -> Self {
        Self(world.resource::<AssetServer>().load("jacksboro_fault.png"))
    }
}

#[test]
fn a_heightmap_may_be_loaded_while_the_app_is_built() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default())).add_plugins(BurrowPlugins);
    app.init_resource::<Map>();
    assert!(app.world().resource::<Map>().0.is_strong());
}

#[test]
fn heightmaps_may_come_before_bevys_assets() {
    let mut app = App::new();
    app.add_plugins((HeightmapPlugin, MinimalPlugins, AssetPlugin::default()));
    assert!(!app.world().contains_resource::<Assets<HeightmapImage>>());
    app.finish();
    assert!(app.world().contains_resource::<Assets<HeightmapImage>>());
}
