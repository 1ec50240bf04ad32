//! The landscape: a survey of the Jacksboro fault in Tennessee, shrunk and made steeper, as a diggable terrain.
//!
//! The picture of the heights travels inside the program and is loaded through the asset server like any other file.
//! Everything slow happens in a task; meanwhile the app draws and answers.

use std::path::Path;
use std::sync::Arc;

use bevy::asset::AssetLoadFailedEvent;
use bevy::asset::io::embedded::EmbeddedAssetRegistry;
use bevy::prelude::*;
use bevy::tasks::{AsyncComputeTaskPool, Task, futures::check_ready};
use bevy_burrow::ground::OVERLAY_DEPTH;
use bevy_burrow::lattice::ONE;
use bevy_burrow::prelude::*;

use crate::film::places::Places;
use crate::tools::hardness;

pub const ROCK: MaterialId = MaterialId(0);
pub const GRASS: MaterialId = MaterialId(1);
pub const SAND: MaterialId = MaterialId(2);
pub const SNOW: MaterialId = MaterialId(3);
pub const CLAY: MaterialId = MaterialId(4);
pub const CONCRETE: MaterialId = MaterialId(5);
pub const COAL: MaterialId = MaterialId(6);
pub const GOLD: MaterialId = MaterialId(7);

/// The materials in the order of their ids, which is also that of the default `MaterialColors`.
pub const MATERIALS: [(MaterialId, &str); 8] = [
    (ROCK, "rock"),
    (GRASS, "turf"),
    (SAND, "sand"),
    (SNOW, "snow"),
    (CLAY, "clay"),
    (CONCRETE, "concrete"),
    (COAL, "coal"),
    (GOLD, "gold"),
];

/// What a material is called.
pub fn name(material: MaterialId) -> &'static str {
    MATERIALS.iter().find(|(id, _)| *id == material).map_or("ground", |(_, name)| name)
}

/// What a material looks like.
pub fn colour(material: MaterialId) -> LinearRgba {
    MaterialColors::default().0.get(usize::from(material.0)).copied().unwrap_or(LinearRgba::WHITE)
}

/// Heights of 403 x 344 samples, 16 bit.
const SURVEY: &[u8] = include_bytes!("../../../assets/jacksboro_fault.png");
const SURVEY_PATH: &str = "digger/jacksboro_fault.png";
const SURVEY_ASSET: &str = "embedded://digger/jacksboro_fault.png";

/// One sample every three voxels: 1206 x 1029 cells, and 120 voxels from the lowest to the highest.
const SCALE: ImageScale = ImageScale {
    voxels_per_sample: 3,
    low: 0.0,
    high: 120.0,
    detail: Some(Detail { amplitude: 1.2, scale: 9.0, octaves: 4, seed: 17 }),
};

/// Loads the survey, makes ground of it and spawns the terrain; [`Places`] is a resource from then on.
pub struct LandscapePlugin;

impl Plugin for LandscapePlugin {
    fn build(&self, app: &mut App) {
        app.world().resource::<EmbeddedAssetRegistry>().insert_asset(
            SURVEY_PATH.into(),
            Path::new(SURVEY_PATH),
            SURVEY,
        );
        app.add_observer(begin_anew)
            .add_systems(Startup, open_survey)
            .add_systems(Update, (shape_ground, spawn_terrain, give_up));
    }
}

/// The land is to be as it was at first, and so is all that a game changes. Whoever keeps some of that observes it.
#[derive(Event, Clone, Copy, Debug)]
pub struct NewGame;

/// The ground as nobody has dug it yet.
#[derive(Resource, Clone)]
struct Untouched(Arc<Ground>);

/// The picture on its way in.
#[derive(Resource)]
struct Survey(Handle<HeightmapImage>);

/// The ground on its way.
#[derive(Resource)]
struct Shaping(Task<Result<(Arc<Ground>, Terrain, Places), String>>);

/// What is drawn is what tools find: under turf, sand and snow as much of it as the ground has, then rock in its beds. Ore
/// is where the ground has it, see `veins.rs`, and nowhere else.
fn look() -> GroundLook {
    let mut look = GroundLook::default();
    for skin in [SAND, SNOW] {
        if let Some(layer) = look.layers.get_mut(usize::from(skin.0)) {
            layer.kind = GroundLayerKind::Body;
        }
    }
    let GroundStrata { soil, subsoil, seam, vein, .. } = &mut look.strata;
    soil.1 = OVERLAY_DEPTH as f32 / ONE as f32;
    (subsoil.1, seam.1, vein.1) = (0.0, 0.0, 0.0);
    look
}

/// The terrain's entity is there before its terrain: its look makes the textures be painted meanwhile.
fn open_survey(mut commands: Commands, assets: Res<AssetServer>) {
    commands.spawn((Name::new("Jacksboro fault"), look()));
    commands.insert_resource(Survey(assets.load(SURVEY_ASSET)));
}

/// Hands the picture to a task as soon as it is there.
fn shape_ground(mut commands: Commands, survey: Option<Res<Survey>>, images: Res<Assets<HeightmapImage>>) {
    let Some(HeightmapImage(image)) = survey.and_then(|survey| images.get(&survey.0)) else { return };
    let image = image.clone();
    commands.insert_resource(Shaping(AsyncComputeTaskPool::get().spawn(async move { shape(&image) })));
    commands.remove_resource::<Survey>();
}

/// Ground from the survey, a terrain of it, and the places worth digging at.
fn shape(survey: &GreyImage) -> Result<(Arc<Ground>, Terrain, Places), String> {
    let ground = Ground::from_image(survey, &SCALE)
        .and_then(|ground| ground.with_materials(&vegetation()))
        .map_err(|error| error.to_string())?;
    let places = Places::find(&ground)?;
    let ground = Arc::new(ground);
    let terrain = on(&ground).map_err(|error| error.to_string())?;
    Ok((ground, terrain, places))
}

/// A terrain that nobody has dug yet.
fn on(ground: &Arc<Ground>) -> Result<Terrain, BevyError> {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings { chunk_size: 32, voxel_size: 1.0 })?;
    terrain.set_rules(hardness::rules())?;
    Ok(terrain)
}

/// Old ground goes, with everything that was on its way to it; it is seen until the new one has loaded.
fn begin_anew(
    _: On<NewGame>,
    mut commands: Commands,
    ground: Res<Untouched>,
    country: Single<Entity, With<GroundLook>>,
) -> Result {
    commands.entity(*country).insert(on(&ground.0)?);
    Ok(())
}

/// Grass where it is flat enough, rock where it is steep, snow on the tops and sand in the valley.
fn vegetation() -> MaterialControl {
    let everywhere = MaterialRule::default();
    let snow = MaterialRule {
        overlay: SNOW,
        height: (92.0, f64::INFINITY),
        height_fade: 12.0,
        slope: (0.0, 1.0),
        slope_fade: 0.6,
    };
    let sand = MaterialRule {
        overlay: SAND,
        height: (f64::NEG_INFINITY, 7.0),
        height_fade: 4.0,
        slope: (0.0, 0.35),
        slope_fade: 0.3,
    };
    let grass = MaterialRule { overlay: GRASS, slope: (0.0, 0.95), slope_fade: 0.5, ..everywhere };
    MaterialControl::Rules { base: ROCK, rules: vec![snow, sand, grass] }
}

fn spawn_terrain(
    mut commands: Commands,
    shaping: Option<ResMut<Shaping>>,
    country: Single<Entity, With<GroundLook>>,
    mut exit: MessageWriter<AppExit>,
) {
    let Some(shaped) = shaping.and_then(|mut shaping| check_ready(&mut shaping.0)) else { return };
    commands.remove_resource::<Shaping>();
    match shaped {
        Ok((ground, terrain, places)) => {
            commands.insert_resource(places);
            commands.insert_resource(Untouched(ground));
            commands.entity(*country).insert(terrain);
        }
        Err(reason) => {
            error!("the landscape can't be made: {reason}");
            exit.write(AppExit::error());
        }
    }
}

/// The survey is part of the program, so this means that the program is broken.
fn give_up(
    mut failures: MessageReader<AssetLoadFailedEvent<HeightmapImage>>,
    mut exit: MessageWriter<AppExit>,
) {
    for failure in failures.read() {
        error!("the survey can't be read: {}", failure.error);
        exit.write(AppExit::error());
    }
}
