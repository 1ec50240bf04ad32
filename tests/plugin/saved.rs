//! Apps with saved worlds, and ways to wait for them.
#![cfg(feature = "store")]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use bevy_burrow::store::StoreWarning;

/// A folder that is removed with this.
pub struct Folder(pub PathBuf);

impl Folder {
    pub fn new(name: &str) -> Self {
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

/// All messages that were received.
#[derive(Resource, Default)]
pub struct Heard {
    pub opened: Vec<Result<u64, String>>,
    pub saved: Vec<u64>,
    pub closed: Vec<WorldClosed>,
    pub warnings: Vec<StoreWarning>,
    /// Brushes that were applied.
    pub receipts: usize,
    /// Brushes that were answered in any way.
    pub answered: usize,
    pub ready: usize,
}

pub fn hear(
    mut opened: MessageReader<WorldOpened>,
    mut saved: MessageReader<WorldSaved>,
    mut closed: MessageReader<WorldClosed>,
    mut warnings: MessageReader<StoreWarningFound>,
    mut receipts: MessageReader<BrushApplied>,
    mut heard: ResMut<Heard>,
) {
    let outcome = |message: &WorldOpened| message.outcome.clone().map_err(|why| why.to_string());
    heard.opened.extend(opened.read().map(outcome));
    heard.saved.extend(saved.read().map(|message| message.revision));
    heard.closed.extend(closed.read().cloned());
    heard.warnings.extend(warnings.read().map(|message| message.warning.clone()));
    for message in receipts.read() {
        heard.answered += 1;
        heard.receipts += usize::from(message.receipt.outcome.is_ok());
    }
}

/// Lets an app record messages.
pub fn listen(app: &mut App) {
    app.init_resource::<Heard>()
        .add_observer(|_: On<TerrainReady>, mut heard: ResMut<Heard>| heard.ready += 1)
        .add_systems(Last, hear);
}

pub fn empty() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, BurrowPlugins));
    listen(&mut app);
    app
}

/// An app with assets in the folder of temporary files.
pub fn with_assets() -> App {
    let mut app = App::new();
    let assets = AssetPlugin { file_path: std::env::temp_dir().display().to_string(), ..default() };
    app.add_plugins((MinimalPlugins, assets, BurrowPlugins));
    listen(&mut app);
    app.finish();
    app.cleanup();
    app
}

pub fn ground() -> Ground {
    Ground::from_fn(96, 96, |x, z| f64::from((x * 5 + z * 3) % 17) / 4.0 + 10.0).expect("valid")
}

pub fn terrain() -> Terrain {
    Terrain::new(ground(), &TerrainSettings::default()).expect("valid")
}

/// Level ground.
pub fn flat(cells: u32, height: f64, chunk_size: u32, voxel_size: f32) -> Terrain {
    let ground = Ground::flat(cells, cells, height).expect("valid");
    Terrain::new(ground, &TerrainSettings { chunk_size, voxel_size }).expect("valid")
}

pub fn saved(path: &Path) -> SavedWorld {
    SavedWorld { loss_window: Duration::from_millis(20), ..SavedWorld::new(path) }
}

/// An app with a saved terrain.
pub fn app(path: &Path) -> (App, Entity) {
    app_with(path, terrain())
}

pub fn app_with(path: &Path, terrain: Terrain) -> (App, Entity) {
    let mut app = empty();
    let entity = app.world_mut().spawn((terrain, saved(path))).id();
    (app, entity)
}

pub fn run_until(app: &mut App, what: &str, is_done: impl Fn(&World) -> bool) {
    let start = Instant::now();
    while !is_done(app.world()) {
        app.update();
        assert!(start.elapsed() < Duration::from_secs(60), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

pub fn run_until_opened(app: &mut App) {
    run_until(app, "it is opened", |world| !world.resource::<Heard>().opened.is_empty());
}

pub fn run_until_applied(app: &mut App, receipts: usize) {
    run_until(app, "it is applied", |world| world.resource::<Heard>().receipts >= receipts);
}

pub fn run_until_saved(app: &mut App, revision: u64) {
    run_until(app, "everything is durable", |world| world.resource::<Heard>().saved.contains(&revision));
}

pub fn run_until_closed(app: &mut App, worlds: usize) {
    run_until(app, "it is closed", |world| world.resource::<Heard>().closed.len() >= worlds);
}

pub fn heard(app: &App) -> &Heard {
    app.world().resource()
}

pub fn dig(app: &mut App, x: f32) {
    app.world_mut().write_message(Brush::dig(Shape::sphere(Vec3::new(x, 11.0, 40.0), 4.0)));
}

/// Digs and waits until that is applied.
pub fn dig_now(app: &mut App, x: f32) {
    let before = heard(app).receipts;
    dig(app, x);
    run_until_applied(app, before + 1);
}

pub fn model(app: &App, entity: Entity) -> &Terrain {
    app.world().get::<Terrain>(entity).expect("a terrain")
}

pub fn hash(app: &App, entity: Entity) -> u64 {
    model(app, entity).world().hash()
}

pub fn exit(mut app: App) {
    app.world_mut().write_message(AppExit::Success);
    app.update();
}

/// The revision and hash of the world in a folder, opened over the ground of a terrain.
pub fn hash_in(path: &Path, of: Terrain) -> Result<(u64, u64), String> {
    let (mut app, entity) = app_with(path, of);
    run_until_opened(&mut app);
    let opened = heard(&app).opened[0].clone()?;
    Ok((opened, hash(&app, entity)))
}
