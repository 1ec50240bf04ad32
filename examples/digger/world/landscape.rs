//! The landscape: an elevation model of the Jacksboro fault in Tennessee, scaled down and made steeper.
//!
//! The heightmap is embedded in the program and loaded by the asset server like any other file. Slow work runs in a
//! task, so the game keeps drawing meanwhile.

use std::path::Path;
use std::sync::Arc;

use bevy::asset::AssetLoadFailedEvent;
use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_burrow::physics::EdgeWalls;
use bevy_burrow::prelude::*;

use crate::film::places::Places;
use crate::tools::hardness;
use crate::world::strata::strata;

pub const ROCK: MaterialId = MaterialId(0);
pub const GRASS: MaterialId = MaterialId(1);
pub const SAND: MaterialId = MaterialId(2);
pub const SNOW: MaterialId = MaterialId(3);
pub const CLAY: MaterialId = MaterialId(4);
pub const CONCRETE: MaterialId = MaterialId(5);
pub const COAL: MaterialId = MaterialId(6);
pub const GOLD: MaterialId = MaterialId(7);
pub const SOIL: MaterialId = MaterialId(8);
pub const SANDSTONE: MaterialId = MaterialId(9);
pub const SHALE: MaterialId = MaterialId(10);

/// The materials and their names, in the order of their ids and of the default `MaterialColors`.
pub const MATERIALS: [(MaterialId, &str); 11] = [
    (ROCK, "rock"),
    (GRASS, "turf"),
    (SAND, "sand"),
    (SNOW, "snow"),
    (CLAY, "clay"),
    (CONCRETE, "concrete"),
    (COAL, "coal"),
    (GOLD, "gold"),
    (SOIL, "soil"),
    (SANDSTONE, "sandstone"),
    (SHALE, "shale"),
];

/// The name of a material.
pub fn name(material: MaterialId) -> &'static str {
    MATERIALS.iter().find(|(id, _)| *id == material).map_or("ground", |(_, name)| name)
}

/// The colour of a material.
pub fn colour(material: MaterialId) -> LinearRgba {
    MaterialColors::default().0.get(usize::from(material.0)).copied().unwrap_or(LinearRgba::WHITE)
}

/// Heights of 403 x 344 samples, 16 bit.
const HEIGHTMAP: &[u8] = include_bytes!("../../../assets/jacksboro_fault.png");
const HEIGHTMAP_PATH: &str = "digger/jacksboro_fault.png";
const HEIGHTMAP_ASSET: &str = "embedded://digger/jacksboro_fault.png";

/// One sample every three voxels: 1206 x 1029 cells, and 120 voxels from the lowest to the highest.
const SCALE: ImageScale = ImageScale {
    voxels_per_sample: 3,
    low: 0.0,
    high: 120.0,
    detail: Some(Detail { amplitude: 1.2, scale: 9.0, octaves: 4, seed: 17 }),
};

/// Loads the heightmap and spawns the terrain. From then on there are [`Places`].
pub struct LandscapePlugin;

impl Plugin for LandscapePlugin {
    fn build(&self, app: &mut App) {
        app.world().resource::<EmbeddedAssetRegistry>().insert_asset(
            HEIGHTMAP_PATH.into(),
            Path::new(HEIGHTMAP_PATH),
            HEIGHTMAP,
        );
        app.add_observer(replace_terrain)
            .add_observer(despawn_on_new_game)
            .add_systems(Startup, load_heightmap)
            .add_systems(Update, (start_generation, spawn_terrain, exit_on_failure));
    }
}

/// A new game begins: everything that play changed goes back to its start. Whoever owns such a thing observes this.
#[derive(Event, Clone, Copy, Debug)]
pub struct NewGame;

/// The entity is despawned when a new game begins.
#[derive(Component, Clone, Copy, Debug, Default)]
pub struct DespawnOnNewGame;

/// The ground without any edits, from which new games begin.
#[derive(Resource, Clone)]
struct OriginalGround(Arc<Ground>);

/// The heightmap while it loads.
#[derive(Resource)]
struct LoadingHeightmap(Handle<HeightmapImage>);

/// The task that generates the ground.
#[derive(Resource)]
struct Generation(Task<Result<(Arc<Ground>, Terrain, Places), String>>);

/// Spawns the terrain's entity with its look before there is a terrain, so that the textures are made meanwhile.
fn load_heightmap(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((Name::new("Jacksboro fault"), GroundLook::default()));
    commands.insert_resource(LoadingHeightmap(assets.load(HEIGHTMAP_ASSET)));
}

/// Starts the task as soon as the heightmap is loaded.
fn start_generation(
    mut commands: Commands,
    loading: Option<Res<LoadingHeightmap>>,
    images: Res<Assets<HeightmapImage>>,
) {
    let Some(HeightmapImage(image)) = loading.and_then(|loading| images.get(&loading.0)) else { return };
    let image = image.clone();
    commands.insert_resource(Generation(AsyncComputeTaskPool::get().spawn(async move { generate(&image) })));
    commands.remove_resource::<LoadingHeightmap>();
}

fn generate(heightmap: &GreyImage) -> Result<(Arc<Ground>, Terrain, Places), String> {
    let ground = Ground::from_image(heightmap, &SCALE)
        .and_then(|ground| ground.with_strata(&strata()))
        .map_err(|error| error.to_string())?;
    let places = Places::find(&ground)?;
    let ground = Arc::new(ground);
    let terrain = new_terrain(&ground).map_err(|error| error.to_string())?;
    Ok((ground, terrain, places))
}

/// A terrain without any edits.
fn new_terrain(ground: &Arc<Ground>) -> Result<Terrain, BevyError> {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings { chunk_size: 32, voxel_size: 1.0 })?;
    terrain.set_rules(hardness::rules())?;
    Ok(terrain)
}

/// Replaces the terrain and all edits on their way to it. The old one is shown until the new one has loaded.
fn replace_terrain(
    _: On<NewGame>,
    mut commands: Commands,
    ground: Res<OriginalGround>,
    terrain: Single<Entity, With<GroundLook>>,
) -> Result {
    commands.entity(*terrain).insert(new_terrain(&ground.0)?);
    Ok(())
}

fn despawn_on_new_game(
    _: On<NewGame>,
    mut commands: Commands,
    entities: Query<Entity, With<DespawnOnNewGame>>,
) {
    for entity in &entities {
        commands.entity(entity).despawn();
    }
}

fn spawn_terrain(
    mut commands: Commands,
    generation: Option<ResMut<Generation>>,
    terrain: Single<Entity, With<GroundLook>>,
    mut exit: MessageWriter<AppExit>,
) {
    let Some(result) = generation.and_then(|mut task| check_ready(&mut task.0)) else { return };
    commands.remove_resource::<Generation>();
    match result {
        Ok((ground, model, places)) => {
            commands.insert_resource(places);
            commands.insert_resource(OriginalGround(ground));
            commands.entity(*terrain).insert((model, EdgeWalls::default()));
        }
        Err(reason) => {
            error!("the landscape can't be generated: {reason}");
            exit.write(AppExit::error());
        }
    }
}

/// The heightmap is part of the program, so a failure means that the program is broken.
fn exit_on_failure(
    mut failures: MessageReader<AssetLoadFailedEvent<HeightmapImage>>,
    mut exit: MessageWriter<AppExit>,
) {
    for failure in failures.read() {
        error!("the heightmap can't be read: {}", failure.error);
        exit.write(AppExit::error());
    }
}
