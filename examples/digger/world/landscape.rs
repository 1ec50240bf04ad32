//! The landscape: an elevation model of the Jacksboro fault in Tennessee, scaled down and made steeper, among hills and
//! mountains of noise up to the horizon.
//!
//! The heightmap is embedded in the program and loaded by the asset server like any other file. Slow work runs in a
//! task, so the game keeps drawing meanwhile.

use std::path::Path;
use std::sync::Arc;

use bevy::asset::AssetLoadFailedEvent;
use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_burrow::ground::{GroundError, ImageSource, InsetSource, NoiseSource};
use bevy_burrow::lattice::Column;
use bevy_burrow::physics::EdgeWalls;
use bevy_burrow::prelude::*;
use bevy_burrow::together::SharedTerrain;

use crate::film::places::Places;
use crate::party::connection::Party;
use crate::party::players::voxel;
use crate::tools::hardness;
use crate::ui::texts;
use crate::world::saves::{self, PlayedWorld};
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
/// What nothing breaks; nobody carries it.
pub const BEDROCK: MaterialId = MaterialId(11);

/// The materials that players carry, in the order of their ids and of the default `MaterialColors`.
pub const MATERIALS: [MaterialId; 11] =
    [ROCK, GRASS, SAND, SNOW, CLAY, CONCRETE, COAL, GOLD, SOIL, SANDSTONE, SHALE];

/// The name of a material.
pub fn name(material: MaterialId) -> &'static str {
    texts::MATERIALS.get(usize::from(material.0)).unwrap_or(&texts::BEDROCK)
}

/// The colour of a material.
pub fn colour(material: MaterialId) -> LinearRgba {
    MaterialColors::default().0.get(usize::from(material.0)).copied().unwrap_or(LinearRgba::WHITE)
}

/// Heights of 403 x 344 samples, 16 bit.
const HEIGHTMAP: &[u8] = include_bytes!("../../../assets/jacksboro_fault.png");
const HEIGHTMAP_PATH: &str = "digger/jacksboro_fault.png";
const HEIGHTMAP_ASSET: &str = "embedded://digger/jacksboro_fault.png";

/// Cells of the world along each side.
const WORLD: u32 = 8192;

/// Where the real land begins: in the middle of the world, at a corner of four chunks.
const REAL_CORNER: Column = Column::new(3456, 3552);
/// Cells that the elevation model covers.
pub const REAL_SIZE: [i32; 2] = [1206, 1029];
/// Over this many cells inside its rim, the real land blends into the hills around it.
const REAL_MARGIN: i32 = 64;

/// The voxel at the origin of space: a corner of the real land. Numbers are small there, so what the player holds does
/// not jitter.
pub const ORIGIN: IVec3 = IVec3::new(REAL_CORNER.x, 0, REAL_CORNER.z);

/// One sample every three voxels: 1206 x 1029 cells, and 120 voxels from the lowest to the highest.
const SCALE: ImageScale = ImageScale {
    voxels_per_sample: 3,
    low: 0.0,
    high: 120.0,
    detail: Some(Detail { amplitude: 1.2, scale: 9.0, octaves: 4, seed: 17 }),
};

/// Hills around the real land, about as high.
const HILLS: NoiseHeights =
    NoiseHeights { seed: 5, kind: NoiseKind::Fractal, octaves: 7, scale: 260.0, amplitude: 85.0, base: 55.0 };

/// Mountains at the horizon.
const MOUNTAINS: NoiseHeights = NoiseHeights {
    seed: 23,
    kind: NoiseKind::Fractal,
    octaves: 7,
    scale: 1500.0,
    amplitude: 380.0,
    base: 250.0,
};

/// There are only mountains up to this many cells from the world's edge. Over `MOUNTAINS_MARGIN` more they sink to
/// hills.
const MOUNTAINS_WIDTH: i32 = 700;
const MOUNTAINS_MARGIN: i32 = 2000;

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
            .add_systems(
                Update,
                (start_generation.run_if(resource_exists::<GroundIsWanted>), spawn_terrain, exit_on_failure),
            );
    }
}

/// A new game begins: everything that play changed is reset. Modules with such state observe this event.
#[derive(Event, Clone, Copy, Debug)]
pub struct NewGame;

/// The entity is despawned when a new game begins.
#[derive(Component, Clone, Copy, Debug, Default)]
pub struct DespawnOnNewGame;

/// The ground without any edits, from which new games begin, and its seed.
#[derive(Resource, Clone)]
pub struct OriginalGround(pub Arc<Ground>, pub u32);

#[derive(Resource)]
struct Heightmap(Handle<HeightmapImage>);

/// The ground has to be generated.
#[derive(Resource)]
pub struct GroundIsWanted;

/// The task that generates the ground of a seed.
#[derive(Resource)]
struct Generation(Task<Result<(Arc<Ground>, Terrain, Places), String>>, u32);

/// Ground of another seed than what is shown.
#[derive(SystemParam)]
pub struct NextGround<'w> {
    wanted: Option<Res<'w, GroundIsWanted>>,
    task: Option<Res<'w, Generation>>,
}

impl NextGround<'_> {
    /// Whether there will be some.
    pub fn is_expected(&self) -> bool {
        self.wanted.is_some() || self.task.is_some()
    }
}

/// Spawns the terrain's entity with its look before there is a terrain, so that the textures are made meanwhile.
fn load_heightmap(mut commands: Commands, assets: Res<AssetServer>) {
    let place = Transform::from_translation(-ORIGIN.as_vec3());
    let mut colors = MaterialColors::default();
    if let Some(bedrock) = colors.0.get_mut(usize::from(BEDROCK.0)) {
        *bedrock = LinearRgba::rgb(0.012, 0.011, 0.016);
    }
    let look = (GroundLook::default(), colors, LevelsOfDetail::default());
    commands.spawn((Name::new("Jacksboro fault"), look, place));
    commands.insert_resource(Heightmap(assets.load(HEIGHTMAP_ASSET)));
    commands.insert_resource(GroundIsWanted);
}

/// Starts the task as soon as the heightmap is loaded.
fn start_generation(
    mut commands: Commands,
    heightmap: Option<Res<Heightmap>>,
    images: Res<Assets<HeightmapImage>>,
    played: Res<PlayedWorld>,
    party: Res<Party>,
) {
    let Some(HeightmapImage(image)) = heightmap.and_then(|heightmap| images.get(&heightmap.0)) else {
        return;
    };
    let (image, seed) = (image.clone(), saves::seed(&played, &party));
    let task = AsyncComputeTaskPool::get().spawn(async move { generate(image, seed) });
    commands.insert_resource(Generation(task, seed));
    commands.remove_resource::<GroundIsWanted>();
}

fn generate(heightmap: GreyImage, seed: u32) -> Result<(Arc<Ground>, Terrain, Places), String> {
    let ground = ground(heightmap, seed).map_err(|error| error.to_string())?;
    let places = Places::find(&ground)?;
    let ground = Arc::new(ground);
    let terrain = new_terrain(&ground).map_err(|error| error.to_string())?;
    Ok((ground, terrain, places))
}

/// The whole world: heights are computed where they are needed. The seed leaves the real land as it is.
fn ground(heightmap: GreyImage, seed: u32) -> Result<Ground, GroundError> {
    let side = WORLD as i32 - 2 * MOUNTAINS_WIDTH;
    let corner = Column::new(MOUNTAINS_WIDTH, MOUNTAINS_WIDTH);
    let (hills, mountains) = (
        NoiseSource::new(&NoiseHeights { seed: HILLS.seed.wrapping_add(seed), ..HILLS })?,
        NoiseSource::new(&NoiseHeights { seed: MOUNTAINS.seed.wrapping_add(seed), ..MOUNTAINS })?,
    );
    let around = InsetSource::new(hills, mountains, corner, [side; 2], MOUNTAINS_MARGIN);
    let real = ImageSource::new(heightmap, &SCALE)?;
    let all = InsetSource::new(real, around, REAL_CORNER, REAL_SIZE, REAL_MARGIN);
    Ground::from_source(WORLD, WORLD, all)?.with_strata(&strata(seed))
}

/// A terrain without any edits.
pub fn new_terrain(ground: &Arc<Ground>) -> Result<Terrain, BevyError> {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings { chunk_size: 32, voxel_size: 1.0 })?;
    terrain.set_rules(hardness::rules())?;
    Ok(terrain)
}

/// Replaces the terrain and all edits on their way to it. The old one is shown until the new one has loaded.
fn replace_terrain(
    _: On<NewGame>,
    mut commands: Commands,
    ground: Option<Res<OriginalGround>>,
    terrain: Single<Entity, With<GroundLook>>,
    played: Res<PlayedWorld>,
    party: Res<Party>,
    places: Option<Res<Places>>,
) -> Result {
    commands.entity(*terrain).remove::<(SavedWorld, SharedTerrain)>();
    commands.remove_resource::<Generation>();
    match (ground, places) {
        (Some(ground), Some(places)) if ground.1 == saves::seed(&played, &party) => {
            insert_terrain(&mut commands.entity(*terrain), new_terrain(&ground.0)?, &played, &party, &places);
        }
        _ => commands.insert_resource(GroundIsWanted),
    }
    Ok(())
}

/// Puts a terrain on its entity; where the world is saved or shared, what is there takes its place.
fn insert_terrain(
    entity: &mut EntityCommands,
    terrain: Terrain,
    played: &PlayedWorld,
    party: &Party,
    places: &Places,
) {
    entity.insert(terrain);
    match (party, played.saved()) {
        (Party::Alone, Some(saved)) => drop(entity.insert(saved)),
        (Party::Alone, None) => {}
        // The host's server saves it.
        (Party::Host(_) | Party::Guest(..), _) => {
            let mut shared = SharedTerrain::default();
            shared.position = voxel(places.hillside.mouth);
            entity.insert(shared);
        }
    }
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
    played: Res<PlayedWorld>,
    party: Res<Party>,
    mut exit: MessageWriter<AppExit>,
) {
    let Some((result, seed)) = generation.and_then(|mut task| Some((check_ready(&mut task.0)?, task.1)))
    else {
        return;
    };
    commands.remove_resource::<Generation>();
    match result {
        Ok((ground, model, places)) => {
            commands.insert_resource(OriginalGround(ground, seed));
            commands.entity(*terrain).insert(EdgeWalls::default());
            insert_terrain(&mut commands.entity(*terrain), model, &played, &party, &places);
            commands.insert_resource(places);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_real_land_is_in_the_middle_and_mountains_are_at_the_edge() {
        let image = GreyImage::decode_png(HEIGHTMAP, &ImageLimits::default()).expect("a valid image");
        let real = Ground::from_image(&image, &SCALE).expect("valid parameters");
        assert_eq!([real.width(), real.depth()], REAL_SIZE);
        let world = ground(image.clone(), 0).expect("valid parameters");
        let inside = |size: i32| (REAL_MARGIN..=size - REAL_MARGIN).step_by(41);
        for (x, z) in inside(REAL_SIZE[1]).flat_map(|z| inside(REAL_SIZE[0]).map(move |x| (x, z))) {
            let here = world.height(Column::new(ORIGIN.x + x, ORIGIN.z + z));
            assert_eq!(here, real.height(Column::new(x, z)), "at {x}, {z}");
        }
        let edge = (0..=WORLD as i32).step_by(64).map(|x| world.height(Column::new(x, 0)));
        let (count, sum) = edge.fold((0, 0), |(count, sum), height| (count + 1, sum + height));
        assert!(sum / count > real.height_range().1, "{} is not high", sum / count);
        Places::find(&world).expect("all places");
        let other = ground(image, 7).expect("valid parameters");
        Places::find(&other).expect("all places");
        assert_ne!(other.hash(), world.hash());
    }
}
