//! Grounds as assets: a file that lists the heights and material maps of a world.

use std::sync::Arc;

use bevy::asset::io::Reader;
use bevy::asset::{AssetLoader, LoadContext, LoadState, ParseAssetPathError, ReadAssetBytesError};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};

use super::heightmap::{read_limited, register_loader};
use super::{BeforeLoad, EditOutbox, Phase};
use crate::ground::{
    ElevationGrid, ElevationScale, ElevationTile, Ground, GroundError, HeightFormat, IdOptions, ImportError,
    ImportOptions, MaterialControl, MaterialMap, SplatOptions, TileEdges,
};
use crate::terrain::{Order, Request, Terrain, TerrainSettings};

/// The largest file of a [`GroundDescription`], in bytes.
const MAX_DESCRIPTION: u64 = 1 << 20;

/// The description of a ground in a JSON file with the extension `ground.json`. Paths are relative to that file.
///
/// ```
/// # use bevy_burrow::plugin::GroundDescription;
/// let description: GroundDescription = serde_json::from_str(
///     r#"{
///         "heights": ["alps.tif"],
///         "scale": { "voxels_per_sample": 4, "heights": { "units": { "voxels_per_unit": 1, "base": 0 } } },
///         "materials": { "splats": { "files": ["alps_splat.png"], "options": { "layers": [1, 2, 3, null] } } }
///     }"#,
/// )?;
/// # assert_eq!(description.heights, ["alps.tif"]);
/// # Ok::<(), serde_json::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct GroundDescription {
    /// One file of heights, or several whose names contain the place of a tile, as in `island_x3_y5.png`.
    pub heights: Vec<String>,
    /// How the files of heights are read.
    pub import: ImportOptions,
    /// How tiles meet.
    pub tiles: TileEdges,
    /// The scale. `None`: heights in metres, and samples as far apart as the first file says, or a voxel if it says
    /// nothing.
    pub scale: Option<ElevationScale>,
    /// The side of a voxel in metres, if `scale` is `None`: that of the terrain's [`TerrainSettings`]. `None`: 1.
    pub voxel_size: Option<f64>,
    /// The materials. `None`: material 0 everywhere.
    pub materials: Option<MaterialFiles>,
}

/// The files with the materials of a ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum MaterialFiles {
    /// Splat maps or masks.
    Splats {
        /// The files, in the order of their channels.
        files: Vec<String>,
        /// What the channels mean.
        options: SplatOptions,
    },
    /// An id map.
    Ids {
        /// The file.
        file: String,
        /// What the samples mean.
        #[serde(default)]
        options: IdOptions,
    },
}

/// A ground that was made from files.
#[derive(Asset, TypePath, Clone, Debug)]
pub struct GroundAsset {
    /// The ground.
    pub ground: Arc<Ground>,
    /// A report of the files: a line for each file with what was read, and for each guess and doubt.
    pub report: String,
}

/// The reason why a ground can't be made from its files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GroundFileError {
    /// The description can't be read.
    #[error("reading a ground's description: {0}")]
    Read(#[from] std::io::Error),
    /// The description is too large to be one.
    #[error(
        "the description of a ground has at most {MAX_DESCRIPTION} bytes: name the files in it, and put nothing else there"
    )]
    TooLarge,
    /// The description is invalid.
    #[error("the description of a ground is wrong: {0}")]
    Description(#[from] serde_json::Error),
    /// The description lists no heights.
    #[error("the description of a ground names no file of heights: add \"heights\": [\"island.png\"]")]
    NoHeights,
    /// One of several files of heights has no place in its name.
    #[error(
        "`{0}` is one of several files of heights, and no place is in its name: name it like island_x3_y5.png"
    )]
    NoPlace(String),
    /// The path of a file is invalid.
    #[error("`{0}` is not a valid file path: {1}")]
    Path(String, ParseAssetPathError),
    /// A file can't be read.
    #[error("reading `{0}`: {1}")]
    File(String, ReadAssetBytesError),
    /// A file's content can't be used.
    #[error("`{0}`: {1}")]
    Import(String, ImportError),
    /// The heights and materials make no ground.
    #[error(transparent)]
    Ground(#[from] GroundError),
}

/// Loads files with the extension `ground.json`, and the files that they name, as [`GroundAsset`]. Where Bevy's asset
/// server watches files, a change of any of them loads the ground again.
#[derive(Default, TypePath)]
pub struct GroundLoader;

impl AssetLoader for GroundLoader {
    type Asset = GroundAsset;
    type Settings = ();
    type Error = GroundFileError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        (): &(),
        context: &mut LoadContext<'_>,
    ) -> Result<GroundAsset, GroundFileError> {
        let bytes = read_limited(reader, MAX_DESCRIPTION).await?;
        if bytes.len() as u64 > MAX_DESCRIPTION {
            return Err(GroundFileError::TooLarge);
        }
        let description: GroundDescription = serde_json::from_slice(&bytes)?;
        let mut report = Vec::new();
        let (grid, scale) = heights(&description, context, &mut report).await?;
        let ground = grid.into_ground(&scale)?;
        let ground = match &description.materials {
            Some(files) => {
                let map = materials(files, context, &mut report).await?;
                ground.with_materials(&MaterialControl::Map(Arc::new(map)))?
            }
            None => ground,
        };
        Ok(GroundAsset { ground: Arc::new(ground), report: report.join("\n") })
    }

    fn extensions(&self) -> &[&str] {
        &["ground.json"]
    }
}

/// The bytes of a file, whose path is relative to the description.
async fn read(name: &str, context: &mut LoadContext<'_>) -> Result<Vec<u8>, GroundFileError> {
    let path = context.path().resolve_embed_str(name);
    let path = path.map_err(|error| GroundFileError::Path(name.into(), error))?;
    let bytes = context.read_asset_bytes(path).await;
    bytes.map_err(|error| GroundFileError::File(name.into(), error))
}

async fn heights(
    description: &GroundDescription,
    context: &mut LoadContext<'_>,
    report: &mut Vec<String>,
) -> Result<(ElevationGrid, ElevationScale), GroundFileError> {
    let GroundDescription { heights, import, tiles: edges, .. } = description;
    let (mut tiles, mut scale) = (Vec::new(), description.scale);
    for name in heights {
        let failed = |error| GroundFileError::Import(name.clone(), error);
        let format = import.format.or_else(|| HeightFormat::of_name(name));
        let bytes = read(name, context).await?;
        let (grid, found) =
            ElevationGrid::decode(&bytes, &ImportOptions { format, ..import.clone() }).map_err(failed)?;
        report.push(format!("{name}: {found}"));
        if scale.is_none() {
            scale = Some(found.scale(description.voxel_size.unwrap_or(1.0)).map_err(failed)?);
        }
        let place = if heights.len() == 1 { Some((0, 0)) } else { ElevationTile::place_of(name) };
        let (column, row) = place.ok_or_else(|| GroundFileError::NoPlace(name.clone()))?;
        tiles.push(ElevationTile { column, row, grid });
    }
    let (Some(first), Some(scale)) = (heights.first(), scale) else { return Err(GroundFileError::NoHeights) };
    let joined = ElevationGrid::join(tiles, *edges);
    let (grid, notes) = joined.map_err(|error| GroundFileError::Import(first.clone(), error))?;
    report.extend(notes.iter().map(ToString::to_string));
    Ok((grid, scale))
}

async fn materials(
    files: &MaterialFiles,
    context: &mut LoadContext<'_>,
    report: &mut Vec<String>,
) -> Result<MaterialMap, GroundFileError> {
    let (name, read) = match files {
        MaterialFiles::Splats { files, options } => {
            let mut all = Vec::new();
            for file in files {
                all.push(read(file, context).await?);
            }
            (files.first(), MaterialMap::decode_splats(&all, options))
        }
        MaterialFiles::Ids { file, options } => {
            (Some(file), MaterialMap::decode_ids(&read(file, context).await?, options))
        }
    };
    let name = name.cloned().unwrap_or_default();
    let (map, found) = read.map_err(|error| GroundFileError::Import(name.clone(), error))?;
    report.push(format!("{name}: {found}"));
    Ok(map)
}

/// Makes its entity a terrain whose ground comes from a file. The entity gets its [`Terrain`] once the file is loaded;
/// a terrain that exists already gets the file's ground. When the file or one that it names changes, edits stay and the
/// ground below them becomes the new one, as with [`Order::Ground`], which clears the history of undo. A terrain with
/// an [`EditOutbox`], as on a client, follows its server, and not the file.
///
/// Hot reloading needs Bevy's feature `file_watcher`. A ground of another size needs a new terrain: the change is
/// logged and not shown. A [`GroundFileRead`] reports what was read, or why the file can't be used.
///
/// ```no_run
/// # use bevy::prelude::*;
/// # use bevy_burrow::prelude::*;
/// use bevy_burrow::plugin::GroundFrom;
///
/// fn spawn(mut commands: Commands, assets: Res<AssetServer>) {
///     commands.spawn((GroundFrom::new(assets.load("alps.ground.json")), GroundLook::default()));
/// }
/// ```
#[derive(Component, Clone, Debug)]
pub struct GroundFrom {
    /// The file.
    pub ground: Handle<GroundAsset>,
    /// The settings of the terrain that it becomes.
    pub settings: TerrainSettings,
}

impl GroundFrom {
    /// A file, with a terrain's usual settings.
    pub fn new(ground: Handle<GroundAsset>) -> Self {
        Self { ground, settings: TerrainSettings::default() }
    }
}

/// A terrain with a [`GroundFrom`] got the ground of its file, or the file can't be used. Sent each time the file is
/// read with another result than before.
#[derive(Message, Clone, Debug, PartialEq)]
pub struct GroundFileRead {
    /// The terrain's entity.
    pub terrain: Entity,
    /// The [report](GroundAsset::report) of the files; the terrain was inserted in this frame, or its new ground queued
    /// behind the edits that wait. Or the reason why a file can't be used; then nothing changes.
    pub outcome: Result<String, String>,
}

/// Adds the asset of grounds with its loader, and makes terrains of them, where there is an asset server.
#[derive(Default)]
pub struct GroundFilePlugin;

impl Plugin for GroundFilePlugin {
    // At once if possible, as games may load a ground while plugins are built; otherwise once all plugins are there.
    fn build(&self, app: &mut App) {
        register(app);
    }

    fn finish(&self, app: &mut App) {
        register(app);
    }
}

fn register(app: &mut App) {
    if register_loader::<GroundLoader>(app) {
        app.add_message::<GroundFileRead>()
            .add_observer(forget_followed)
            .add_systems(Phase::Worlds, follow_ground_files.before(BeforeLoad::Worlds));
    }
}

/// The hash of the ground that a terrain has from its file, or will have once what it was asked before is done.
#[derive(Component)]
struct FollowedGround(u64);

/// Another terrain in the place of a former one is compared with the file again.
fn forget_followed(inserted: On<Insert, Terrain>, mut commands: Commands) {
    commands.entity(inserted.entity).try_remove::<FollowedGround>();
}

/// Makes terrains of grounds that are loaded, and gives terrains the ground that is loaded again.
fn follow_ground_files(
    mut commands: Commands,
    grounds: Res<Assets<GroundAsset>>,
    mut terrains: Query<
        (Entity, &GroundFrom, Option<&mut Terrain>, Option<&FollowedGround>, Has<EditOutbox>),
        Allow<Disabled>,
    >,
    assets: Res<AssetServer>,
    mut messages: MessageWriter<GroundFileRead>,
    mut failed: Local<EntityHashMap<u64>>,
    mut refused: Local<EntityHashMap<String>>,
) {
    let (last_failed, last_refused) = (std::mem::take(&mut *failed), std::mem::take(&mut *refused));
    for (entity, from, terrain, followed, is_shared) in &mut terrains {
        let mut tell = |outcome| {
            messages.write(GroundFileRead { terrain: entity, outcome });
        };
        // Bevy logs it, and loads a file that can't be read once more: each reason is sent once until the file is read.
        let last_reason = last_refused.get(&entity);
        let reason = match assets.get_load_state(from.ground.id()) {
            Some(LoadState::Failed(error)) => Some(error.to_string()),
            Some(LoadState::Loading) => last_reason.cloned(),
            _ => None,
        };
        if let Some(reason) = reason {
            if !is_shared && last_reason != Some(&reason) {
                tell(Err(reason.clone()));
            }
            refused.insert(entity, reason);
        }
        let Some(asset) = grounds.get(&from.ground) else { continue };
        let GroundAsset { ground, report } = asset;
        let hash = ground.hash();
        let Some(mut terrain) = terrain else {
            if last_failed.get(&entity) == Some(&hash) {
                failed.insert(entity, hash);
                continue;
            }
            let outcome = make_terrain(&mut commands, entity, from, asset);
            if outcome.is_err() {
                failed.insert(entity, hash);
            }
            tell(outcome);
            continue;
        };
        // The ground of a client is its server's.
        if is_shared || followed.is_some_and(|followed| followed.0 == hash) {
            continue;
        }
        let model = terrain.bypass_change_detection();
        let before = model.world().ground();
        if let Some(error) = misfit(entity, before, ground) {
            error!("{error}");
            tell(Err(error));
        } else if followed.is_some() || before.hash() != hash {
            let order = Request::from(Order::Ground(Arc::clone(ground)));
            // In a later frame, if too much waits.
            if model.admit(&order).is_err() {
                continue;
            }
            info!("{report}");
            terrain.submit(order);
            tell(Ok(report.clone()));
        }
        commands.entity(entity).try_insert(FollowedGround(hash));
    }
}

/// Makes a terrain of a ground, and returns what to report.
fn make_terrain(
    commands: &mut Commands,
    entity: Entity,
    from: &GroundFrom,
    GroundAsset { ground, report }: &GroundAsset,
) -> Result<String, String> {
    match Terrain::new(Arc::clone(ground), &from.settings) {
        Ok(terrain) => {
            info!("{report}");
            commands.entity(entity).try_insert(terrain);
            Ok(report.clone())
        }
        Err(error) => {
            error!("no terrain can be made from the ground of {entity}: {error}");
            Err(error.to_string())
        }
    }
}

/// Why a terrain can't get another ground, if that has another size.
fn misfit(entity: Entity, before: &Ground, now: &Ground) -> Option<String> {
    let size = |ground: &Ground| (ground.width(), ground.depth());
    (size(before) != size(now)).then(|| {
        let ((width, depth), (new_width, new_depth)) = (size(before), size(now));
        format!(
            "the file of the ground of {entity} has {new_width} x {new_depth} cells now, and the terrain {width} x {depth}: \
             despawn it and spawn another one to show the file"
        )
    })
}
