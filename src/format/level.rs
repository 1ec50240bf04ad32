//! The format of levels: a folder of files for version control, or one packed file to ship.
//!
//! - `level.json` describes the level, and names its regions.
//! - `r.X.Y.Z.region` holds a region's bricks and fields. It has neither revision nor time, so it changes only with its
//!   content, and is not packed, so that version control can store differences.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::container;
use super::error::FormatError;
use super::frame::{self, Kind, WorldId};
use super::limits::{Limits, check, within};
use super::portable::{SavedRegion, by_region, of_regions};
use super::region::region_key;
use crate::ground::Ground;
use crate::lattice::RegionPos;
use crate::terrain::{EditSettings, LooseSettings, Terrain, TerrainSettings, WorldParts};
use crate::volume::DiggingRules;

/// The file that describes a level.
pub const LEVEL_JSON: &str = "level.json";

/// The files of a level by name.
pub type LevelFiles = BTreeMap<String, Vec<u8>>;

/// A designer's level: a world without history.
#[derive(Clone, Debug, Default)]
pub struct Level {
    /// Chunk and voxel size.
    pub settings: TerrainSettings,
    /// The [hash](Ground::hash) of the ground that it was made on.
    pub ground: u64,
    /// The greatest name that a field has had.
    #[doc(hidden)]
    pub next_field: u64,
    /// The rules and the search for loose pieces that edits obey.
    #[doc(hidden)]
    pub edit_settings: EditSettings,
    /// The game's data, by key.
    pub game: BTreeMap<String, Vec<u8>>,
    /// Regions that hold anything; their revisions are 0.
    #[doc(hidden)]
    pub regions: BTreeMap<RegionPos, SavedRegion>,
}

/// The content of `level.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    burrow_level: u32,
    simulation: u32,
    settings: TerrainSettings,
    ground: String,
    next_field: u64,
    rules: Option<DiggingRules>,
    loose: Option<LooseSettings>,
    /// In hexadecimal.
    game: BTreeMap<String, String>,
    regions: BTreeSet<String>,
}

impl Level {
    /// A level of the parts of a world over this ground.
    #[doc(hidden)]
    pub fn new(parts: WorldParts, voxel_size: f32, game: BTreeMap<String, Vec<u8>>, ground: &Ground) -> Self {
        let WorldParts { change, chunk_size, edit_settings, .. } = parts;
        let (settings, next_field) = (TerrainSettings { chunk_size, voxel_size }, change.next_field);
        let regions = by_region(change, chunk_size, 0, ground);
        Self { settings, ground: ground.hash(), next_field, edit_settings, game, regions }
    }

    /// The level's parts, from which [`Terrain::restore`](crate::terrain::Terrain::restore) makes a terrain.
    #[doc(hidden)]
    pub fn parts(&self) -> WorldParts {
        let change = of_regions(&self.regions, self.next_field);
        let (chunk_size, edit_settings) = (self.settings.chunk_size, self.edit_settings.clone());
        WorldParts { change, chunk_size, revision: 0, edit_settings }
    }

    /// The files of the level, by name. Equal content gives equal bytes, file by file.
    ///
    /// # Errors
    /// When settings hold numbers that JSON can't, and [`FormatError::TooLarge`] when `level.json` with the game's data
    /// takes more than 64 MiB or a region more than 8 MiB, which bricks and fields of a terrain never do.
    pub fn to_files(&self) -> Result<LevelFiles, FormatError> {
        write_within(self, &Limits::FORMAT)
    }

    /// Reads the files of a level over its ground, or over another one, which [`ground`](Self::ground) and the hashes
    /// of regions reveal.
    ///
    /// # Errors
    /// When a file is damaged or missing, or does not belong to the level.
    pub fn from_files(files: &LevelFiles, ground: &Ground) -> Result<Self, FormatError> {
        read_within(files, ground, &Limits::FORMAT)
    }

    /// A level's files in one, to ship.
    ///
    /// # Errors
    /// [`FormatError::TooLarge`] when a file takes more than 64 MiB, or all together more than a GiB once packed.
    pub fn pack_files(files: &LevelFiles) -> Result<Vec<u8>, FormatError> {
        pack_within(files, &Limits::FORMAT)
    }

    /// Reads what [`pack_files`](Self::pack_files) wrote; no ground is needed.
    ///
    /// # Errors
    /// When it is damaged, or holds a file with a name that is not used in levels.
    pub fn unpack_files(packed: &[u8]) -> Result<LevelFiles, FormatError> {
        unpack_within(packed, &Limits::FORMAT)
    }
}

/// The name of a region's file.
pub fn region_name(RegionPos(at): RegionPos) -> String {
    format!("r.{}.{}.{}.region", at.x, at.y, at.z)
}

/// The region whose file has this name.
pub fn region_of_name(name: &str) -> Option<RegionPos> {
    let mut parts = name.strip_prefix("r.")?.strip_suffix(".region")?.split('.');
    let mut next = || parts.next()?.parse().ok();
    let at = RegionPos([next()?, next()?, next()?].into());
    // Each region has one name: no leading zeros, no plus signs, no more parts.
    (region_name(at) == name).then_some(at)
}

fn file_error(name: &str, why: impl ToString) -> FormatError {
    FormatError::File { name: name.into(), why: why.to_string() }
}

pub(super) fn write_within(level: &Level, limits: &Limits) -> Result<LevelFiles, FormatError> {
    let description = Description {
        burrow_level: frame::PLAIN,
        simulation: Terrain::SIMULATION,
        settings: level.settings,
        ground: format!("{:016x}", level.ground),
        next_field: level.next_field,
        rules: level.edit_settings.rules.as_deref().cloned(),
        loose: level.edit_settings.loose,
        game: level.game.iter().map(|(key, value)| (key.clone(), to_hex(value))).collect(),
        regions: level.regions.keys().map(|at| region_name(*at)).collect(),
    };
    let json = serde_json::to_string_pretty(&description).map_err(|error| file_error(LEVEL_JSON, error))?;
    let mut files =
        LevelFiles::from([(LEVEL_JSON.to_owned(), within((json + "\n").into_bytes(), limits.level_file)?)]);
    for (at, region) in &level.regions {
        let (key, hash) = (region_key(*at), region.ground_hash);
        let content = within(region.encode(), limits.region)?;
        let sealed = frame::seal_unpacked(Kind::Region, WorldId::default(), &key, hash, &content);
        files.insert(region_name(*at), sealed);
    }
    Ok(files)
}

pub(super) fn read_within(
    files: &LevelFiles,
    ground: &Ground,
    limits: &Limits,
) -> Result<Level, FormatError> {
    let json = files.get(LEVEL_JSON).ok_or_else(|| file_error(LEVEL_JSON, "it is missing"))?;
    check(json, limits.level_file)?;
    let of: Description = read_description(json)?;
    let hash = u64::from_str_radix(&of.ground, 16).map_err(|error| file_error(LEVEL_JSON, error))?;
    if let Some(other) = files.keys().find(|name| *name != LEVEL_JSON && !of.regions.contains(*name)) {
        return Err(file_error(other, format!("`{LEVEL_JSON}` does not name it")));
    }
    let mut regions = BTreeMap::new();
    for name in &of.regions {
        let at = region_of_name(name).ok_or_else(|| file_error(name, "no region has this name"))?;
        let file = files.get(name).ok_or_else(|| file_error(name, "it is missing"))?;
        let opened = frame::open(file, Kind::Region, WorldId::default(), &region_key(at), limits.region);
        let region = opened.and_then(|opened| SavedRegion::decode(&opened, at, ground));
        regions.insert(at, region.map_err(|error| file_error(name, error))?);
    }
    let value = |(key, hex): (&String, &String)| Some((key.clone(), of_hex(hex)?));
    let game = of.game.iter().map(value).collect::<Option<_>>();
    let game = game.ok_or_else(|| file_error(LEVEL_JSON, "game data is not hexadecimal"))?;
    let Description { settings, next_field, rules, loose, .. } = of;
    let edit_settings = EditSettings { rules: rules.map(Arc::new), loose };
    Ok(Level { settings, ground: hash, next_field, edit_settings, game, regions })
}

fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn of_hex(hex: &str) -> Option<Vec<u8>> {
    let digit = |digit: u8| char::from(digit).to_digit(16).map(|digit| digit as u8);
    let (pairs, rest) = hex.as_bytes().as_chunks();
    let bytes = pairs.iter().map(|&[high, low]| Some(digit(high)? << 4 | digit(low)?));
    bytes.collect::<Option<_>>().filter(|_| rest.is_empty())
}

fn read_description(json: &[u8]) -> Result<Description, FormatError> {
    /// The part that all schemas have.
    #[derive(Deserialize)]
    struct Schema {
        burrow_level: u32,
    }
    let invalid = |error| file_error(LEVEL_JSON, error);
    let Schema { burrow_level: found } = serde_json::from_slice(json).map_err(invalid)?;
    if found > frame::PLAIN {
        return Err(FormatError::Newer { found, known: frame::PLAIN });
    }
    serde_json::from_slice(json).map_err(invalid)
}

pub(super) fn pack_within(files: &LevelFiles, limits: &Limits) -> Result<Vec<u8>, FormatError> {
    let file = |(name, bytes): (&String, &Vec<u8>)| {
        check(bytes, limits.level_file)?;
        Ok(frame::seal(Kind::LevelFile, WorldId::default(), name.as_bytes(), 0, 0, bytes))
    };
    let frames = files.iter().map(file).collect::<Result<Vec<Vec<u8>>, FormatError>>()?;
    let packed = container::write(Kind::Level, WorldId::default(), &[], &frames, limits.head)?;
    within(packed, limits.packed_level)
}

pub(super) fn unpack_within(packed: &[u8], limits: &Limits) -> Result<LevelFiles, FormatError> {
    check(packed, limits.packed_level)?;
    let mut files = LevelFiles::new();
    for sealed in container::read(Kind::Level, packed, limits.head)?.frames {
        let key = frame::peek(sealed).ok_or(FormatError::Invalid("file"))?.key;
        let name = String::from_utf8(key.to_vec()).map_err(|_| FormatError::Key)?;
        if name != LEVEL_JSON && region_of_name(&name).is_none() {
            return Err(file_error(&name, "no file of a level has this name"));
        }
        let opened =
            frame::open(sealed, Kind::LevelFile, WorldId::default(), name.as_bytes(), limits.level_file)?;
        if files.insert(name.clone(), opened.payload).is_some() {
            return Err(file_error(&name, "it comes twice"));
        }
    }
    Ok(files)
}
