//! Looking at a world without playing it: what tools print, check and replay.

use std::path::Path;
use std::sync::Arc;

use super::base_level::{BaseLevel, LevelName};
use super::error::StoreError;
use super::files::{Files, Folder};
use super::format::Batch;
use super::format::frame::WorldId;
use super::found::Contents;
use super::keys;
use super::open_store::{has_world, take_lock};
use super::options::{BaseChanged, StoreOptions};
use super::recover::{self, recover};
use super::segment;
use super::shared::apply_game;
use crate::ground::Ground;
use crate::terrain::{Terrain, TerrainSettings};

/// What is known of a saved world without its ground.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WorldInfo {
    /// Its name.
    pub world: WorldId,
    /// Its revision.
    pub revision: u64,
    /// Its hash at that revision.
    pub hash: u64,
    /// The sizes of its chunks and voxels.
    pub settings: TerrainSettings,
    /// The [`SIMULATION`](crate::terrain::SIMULATION) that saved it.
    pub simulation: u32,
    /// Hash of its ground.
    pub ground: u64,
    /// The level that it was begun on, from which its regions differ.
    pub level: Option<LevelName>,
    /// The revision of its last checkpoint.
    pub checkpoint: u64,
    /// Regions that hold edits.
    pub regions: usize,
    /// Bytes of their records.
    pub region_bytes: u64,
    /// Files of the log.
    pub segments: usize,
    /// Bytes of the log.
    pub log_bytes: u64,
    /// Does the log reach from the first commit to the last?
    pub is_log_whole: bool,
    /// Keys of the game's data, and how many bytes each has.
    pub game: Vec<(String, usize)>,
    /// What is damaged, in words; nothing if all can be read.
    pub damage: Vec<String>,
}

/// Reads what is known of the world in a folder without its ground.
///
/// # Errors
/// When there is none, when it is open, and when nothing of it can be read.
pub fn inspect(folder: impl AsRef<Path>) -> Result<WorldInfo, StoreError> {
    inspect_in(&Folder::new(folder.as_ref()))
}

/// The same in other [files](Files).
///
/// # Errors
/// As for a folder.
pub fn inspect_in(files: &dyn Files) -> Result<WorldInfo, StoreError> {
    let (_lock, contents) = read(files)?;
    let unreadable = || StoreError::Unreadable("neither journal nor database hold a valid checkpoint".into());
    let checkpoint = contents.choose_checkpoint().ok_or_else(unreadable)?;
    let mut damage: Vec<String> = contents.damaged.iter().cloned().collect();
    let mut region_bytes = 0;
    for (at, revision) in &checkpoint.regions {
        match contents.region(*at, *revision) {
            Some(record) => region_bytes += record.payload.len() as u64,
            None => damage.push(format!("the record of the region {} can't be read", keys::name(*at))),
        }
    }
    for found in &contents.segments {
        let bytes: usize = found.bad.iter().map(ExactSizeIterator::len).sum();
        if bytes > 0 {
            damage.push(format!("{} holds {bytes} bytes that can't be read", segment::path(found.number)));
        }
    }
    let metadata = &checkpoint.metadata;
    let (mut revision, mut hash) = (metadata.revision, metadata.hash);
    let mut game = metadata.game.iter().cloned().collect();
    // Revisions and hashes do not depend on it.
    let any_ground = Ground::flat(1, 1, 0.0).map_err(|why| StoreError::Unreadable(why.to_string()))?;
    for frame in contents.frames_from(checkpoint.frame + 1) {
        let Ok(batch) = Batch::decode(&frame.payload, &any_ground) else {
            damage.push(format!("the frame {} of the journal can't be read", frame.number));
            break;
        };
        if let Some(last) = batch.commits.last() {
            (revision, hash) = (last.revision, last.hash);
        }
        apply_game(&mut game, &batch.game);
    }
    let whole = contents.frames_from(1);
    let last = whole.last().map_or(0, |last| last.number);
    Ok(WorldInfo {
        world: contents.world,
        revision,
        hash,
        settings: metadata.settings,
        simulation: metadata.simulation,
        ground: metadata.ground,
        level: checkpoint.level.clone(),
        checkpoint: metadata.revision,
        regions: checkpoint.regions.len(),
        region_bytes,
        segments: contents.segments.len(),
        log_bytes: contents.segments.iter().map(|found| segment::on_disk(found.length as u64)).sum(),
        is_log_whole: last >= checkpoint.frame.max(contents.greatest_frame()),
        game: game.into_iter().map(|(key, bytes): (String, Vec<u8>)| (key, bytes.len())).collect(),
        damage,
    })
}

fn read(files: &dyn Files) -> Result<(Box<dyn super::files::Lock>, Contents), StoreError> {
    if !has_world(files).map_err(StoreError::files("reading the world's folder"))? {
        return Err(StoreError::Missing(files.name()));
    }
    let lock = take_lock(files)?;
    Ok((lock, Contents::read(files, None)?))
}

/// What a check of a world found.
#[derive(Debug)]
#[non_exhaustive]
pub struct WorldCheck {
    /// The world as opening it would bring it back.
    pub terrain: Terrain,
    /// What opening it would tell.
    pub troubles: Vec<String>,
    /// Was the whole log replayed from the first commit, and did it lead to the same world? `None` if it does not reach back so
    /// far.
    pub replays: Option<bool>,
}

/// Reads all of the world in a folder, over its ground and its level if it has one, without changing it: regions, the journal's
/// tail, and, if it is whole, the log from the first commit on.
///
/// # Errors
/// When there is none, when it is open, when its ground is another one, and when nothing of it can be read.
pub fn check(
    folder: impl AsRef<Path>,
    ground: impl Into<Arc<Ground>>,
    level: Option<&BaseLevel>,
) -> Result<WorldCheck, StoreError> {
    check_in(&Folder::new(folder.as_ref()), ground, level)
}

/// The same in other [files](Files).
///
/// # Errors
/// As for a folder.
pub fn check_in(
    files: &dyn Files,
    ground: impl Into<Arc<Ground>>,
    level: Option<&BaseLevel>,
) -> Result<WorldCheck, StoreError> {
    let ground = ground.into();
    let (_lock, contents) = read(files)?;
    let level = level.cloned();
    let options = StoreOptions { base_changed: BaseChanged::Refuse, level, ..StoreOptions::default() };
    let recovered = recover(&contents, &ground, &options)?;
    let told = recover::troubles(&recovered, &std::collections::BTreeMap::new());
    let mut troubles: Vec<String> = contents.damaged.iter().cloned().collect();
    troubles.extend(told.iter().map(ToString::to_string));
    troubles.extend(recovered.refused.iter().map(|why| format!("the log can't be replayed: {why}")));
    if contents.greatest_frame() > recovered.frame {
        troubles
            .push(format!("the log has frames behind a gap after revision {}", recovered.mirror.revision));
    }
    for found in &contents.segments {
        let bytes: usize = found.bad.iter().map(ExactSizeIterator::len).sum();
        if bytes > 0 {
            troubles.push(format!("{} holds {bytes} bytes that can't be read", segment::path(found.number)));
        }
    }
    let world = recovered.terrain.world();
    let replays = recovered.is_log_whole.then(|| {
        let replayed =
            recover::replay_all(&contents, &ground, recovered.settings(), recovered.mirror.level.as_ref());
        replayed.is_ok_and(|other| {
            let other = other.world();
            (other.hash(), other.revision()) == (world.hash(), world.revision())
        })
    });
    Ok(WorldCheck { terrain: recovered.terrain, troubles, replays })
}

/// Replays the log of the world in a folder from the first commit on, over this ground and its level if it has one, and verifies
/// each commit. Returns the terrain.
///
/// # Errors
/// When there is none, when it is open, and when the log does not reach back to the first commit or can't be replayed.
pub fn replay(
    folder: impl AsRef<Path>,
    ground: impl Into<Arc<Ground>>,
    level: Option<&BaseLevel>,
) -> Result<Terrain, StoreError> {
    let files = Folder::new(folder.as_ref());
    let (_lock, contents) = read(&files)?;
    let checkpoint = contents.choose_checkpoint();
    let name = checkpoint.as_ref().and_then(|own| own.level.as_ref());
    let level = BaseLevel::needed(name, level)?;
    BaseLevel::expect(level, name)?;
    let settings = checkpoint.as_ref().map_or_else(TerrainSettings::default, |own| own.metadata.settings);
    recover::replay_all(&contents, &ground.into(), settings, level)
}
