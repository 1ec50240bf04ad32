//! Inspects, checks and replays a saved world for tools, without changing it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::base_level::{BaseLevel, LevelName};
use super::error::{StoreError, StoreWarning};
use super::files::{Files, Folder};
use super::journal::segment::{self, Bad};
use super::open_store::{Store, read};
use super::options::{BaseChanged, StoreOptions};
use super::recovery::{Contents, recover, replay_all};
use super::regions::keys;
use super::store_thread::apply_game;
use crate::format::frame::WorldId;
use crate::ground::Ground;
use crate::terrain::{Terrain, TerrainSettings};

/// Facts about a saved world that can be read without its ground.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WorldInfo {
    /// The world's id.
    pub world: WorldId,
    /// The world's revision.
    pub revision: u64,
    /// The world's hash at that revision.
    pub hash: u64,
    /// The sizes of its chunks and voxels.
    pub settings: TerrainSettings,
    /// The [`Terrain::SIMULATION`](crate::terrain::Terrain::SIMULATION) that saved it.
    pub simulation: u32,
    /// Hash of its ground.
    pub ground: u64,
    /// Cells of its ground along x and z; `None` if an older version saved it.
    pub ground_size: Option<(u32, u32)>,
    /// The level that it is based on, from which its regions differ.
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
    /// Whether the log reaches from the first commit to the last, and can be replayed by this version.
    pub is_log_whole: bool,
    /// Keys of the game's data, and how many bytes each has.
    pub game: Vec<(String, usize)>,
    /// Descriptions of damage; empty if everything can be read.
    pub damage: Vec<String>,
}

impl Store {
    /// Reads facts about the world in a folder, without its ground.
    ///
    /// # Errors
    /// When there is none, when it is open, and when nothing of it can be read.
    pub fn inspect(folder: impl AsRef<Path>) -> Result<WorldInfo, StoreError> {
        inspect_in(&Folder::new(folder.as_ref()))
    }

    /// Reads all of the world in a folder, over its ground and its level if it has one, without changing it: regions,
    /// the journal's tail, and, if it is whole, the log from the first commit on.
    ///
    /// # Errors
    /// When there is none, when it is open, when its ground is another one, and when nothing of it can be read.
    #[doc(hidden)]
    pub fn check(
        folder: impl AsRef<Path>,
        ground: impl Into<Arc<Ground>>,
        level: Option<&BaseLevel>,
    ) -> Result<WorldCheck, StoreError> {
        check_in(&Folder::new(folder.as_ref()), ground, level)
    }
}

/// Inspects a world in other [files](Files).
///
/// # Errors
/// As for a folder.
pub fn inspect_in(files: &dyn Files) -> Result<WorldInfo, StoreError> {
    let (_lock, contents) = read(files, None)?;
    let unreadable = || StoreError::Unreadable("neither journal nor database hold a valid checkpoint".into());
    let checkpoint = contents.choose_checkpoint().ok_or_else(unreadable)?;
    let mut damage: Vec<String> = contents.damaged.iter().cloned().collect();
    let mut region_bytes = 0;
    for (at, revision) in &checkpoint.regions {
        match contents.region(*at, *revision) {
            Some(record) => region_bytes += record.bytes() as u64,
            None => damage.push(format!("the record of the region {} can't be read", keys::name(*at))),
        }
    }
    let metadata = &checkpoint.metadata;
    let (mut revision, mut hash) = (metadata.revision, metadata.hash);
    let mut game = metadata.game.iter().cloned().collect();
    // Revisions and hashes do not depend on it.
    let any_ground = Ground::flat(1, 1, 0.0).map_err(|why| StoreError::Unreadable(why.to_string()))?;
    let mut frame_before = checkpoint.frame;
    for frame in contents.frames_from(checkpoint.frame + 1) {
        let batch = frame.batch(&any_ground, &contents.named);
        let Ok(batch) = batch else {
            damage.push(format!("the frame {} of the journal can't be read", frame.number));
            break;
        };
        if let Some(last) = batch.commits.last() {
            (revision, hash) = (last.revision, last.hash);
        }
        apply_game(&mut game, &batch.game);
        frame_before = frame.number;
    }
    damage.extend(journal_warnings(&contents, frame_before, revision));
    let last = checkpoint.frame.max(contents.greatest_frame());
    Ok(WorldInfo {
        world: contents.world,
        revision,
        hash,
        settings: metadata.settings,
        simulation: metadata.simulation,
        ground: metadata.ground,
        ground_size: checkpoint.cells.map(|size| (size.width, size.depth)),
        level: checkpoint.level.clone(),
        checkpoint: metadata.revision,
        regions: checkpoint.regions.len(),
        region_bytes,
        segments: contents.segments.len(),
        log_bytes: contents.segments.iter().map(|found| segment::on_disk(found.length as u64)).sum(),
        is_log_whole: contents.reaches_back(last, checkpoint.base()) && contents.leads_to(&checkpoint),
        game: game.into_iter().map(|(key, bytes): (String, Vec<u8>)| (key, bytes.len())).collect(),
        damage,
    })
}

/// Descriptions of unreadable parts of the journal that matter to a world at a frame.
fn journal_warnings(contents: &Contents, frame: u64, revision: u64) -> Vec<String> {
    let mut warnings = Vec::new();
    for found in &contents.segments {
        let matters = |bad: &&Bad| !contents.is_harmless(found.number, bad, frame);
        let bytes: usize = found.bad.iter().filter(matters).map(|bad| bad.range.len()).sum();
        let path = segment::path(found.number);
        match &found.error {
            Some(error) => warnings.push(format!("{path} can't be read: {error}")),
            None if bytes > 0 => warnings.push(format!("{path} holds {bytes} bytes that can't be read")),
            None => {}
        }
    }
    if contents.greatest_frame() > frame {
        warnings.push(format!("the log has frames behind a gap after revision {revision}"));
    }
    if contents.has_lost_journal {
        warnings.push(StoreWarning::LogMissing { revision }.to_string());
    }
    warnings
}

/// A world as it was read.
#[derive(Debug)]
#[non_exhaustive]
pub struct WorldCheck {
    /// The world's id.
    pub world: WorldId,
    /// The world as opening it would restore it.
    pub terrain: Terrain,
    /// The game's data, by key.
    pub game: BTreeMap<String, Vec<u8>>,
    /// The warnings that opening it would report.
    pub warnings: Vec<String>,
    /// Whether replaying the whole log from the first commit gave the same world. `None` if it was not replayed, or
    /// does not reach back to the first commit.
    pub replays: Option<bool>,
}

/// Checks a world in other [files](Files).
///
/// # Errors
/// As for a folder.
pub fn check_in(
    files: &dyn Files,
    ground: impl Into<Arc<Ground>>,
    level: Option<&BaseLevel>,
) -> Result<WorldCheck, StoreError> {
    look(files, &ground.into(), level, true)
}

/// Reads the world in a folder, over its ground and its level if it has one, without changing it, and without replaying
/// its log from the first commit on.
///
/// # Errors
/// As for [`Store::check`].
pub fn read_world(
    folder: impl AsRef<Path>,
    ground: impl Into<Arc<Ground>>,
    level: Option<&BaseLevel>,
) -> Result<WorldCheck, StoreError> {
    look(&Folder::new(folder.as_ref()), &ground.into(), level, false)
}

fn look(
    files: &dyn Files,
    ground: &Arc<Ground>,
    level: Option<&BaseLevel>,
    replays: bool,
) -> Result<WorldCheck, StoreError> {
    let (_lock, mut contents) = read(files, None)?;
    let level = level.cloned();
    let options = StoreOptions { base_changed: BaseChanged::Refuse, level, ..StoreOptions::default() };
    let recovered = recover(&contents, ground, &options)?;
    contents.refuse_unread(recovered.frame, recovered.is_log_whole, recovered.findings.has_lost_regions())?;
    // Nothing was copied, as nothing was changed.
    let told = recovered.findings.warnings(&BTreeMap::new(), contents.damaged.as_deref(), None);
    let mut warnings: Vec<String> = told.iter().map(as_found).collect();
    warnings.extend(recovered.refused.iter().map(|why| format!("the log can't be replayed: {why}")));
    warnings.extend(journal_warnings(&contents, recovered.frame, recovered.mirror.revision));
    let is_asked = replays && recovered.is_log_whole;
    let replays = is_asked.then(|| {
        let world = recovered.terrain.world();
        let level = recovered.mirror.level.as_ref();
        let other = replay_all(&contents, ground, recovered.settings(), level)
            .map_err(|why| format!("the log does not lead to the world: {why}"))?;
        let (found, expected) = (other.world().hash(), world.hash());
        match found == expected && other.world().revision() == world.revision() {
            true => Ok(()),
            false => Err(format!(
                "the log leads to another world, with the hash {found:#018x} and not {expected:#018x}"
            )),
        }
    });
    if let Some(Err(why)) = &replays {
        warnings.push(why.clone());
    }
    if recovered.has_other_log {
        warnings.push(
            "the log does not lead to the last checkpoint: it is that of another branch of the world".into(),
        );
    }
    let replays = replays.map(|replayed| replayed.is_ok());
    let (world, game) = (contents.world, recovered.mirror.game);
    Ok(WorldCheck { world, terrain: recovered.terrain, game, warnings, replays })
}

/// A warning in words that say that nothing was changed.
fn as_found(warning: &StoreWarning) -> String {
    match warning {
        StoreWarning::Rebuilt { what, .. } => {
            format!("{what}; nothing is lost, and it is rebuilt when the world is opened")
        }
        other => other.to_string(),
    }
}

/// Replays the log of the world in a folder from the first commit on, over this ground and its level if it has one, and
/// verifies each commit. Returns the terrain.
///
/// # Errors
/// When there is none, when it is open, when its ground is another one, and when the log does not reach back to the
/// first commit or can't be replayed.
pub fn replay(
    folder: impl AsRef<Path>,
    ground: impl Into<Arc<Ground>>,
    level: Option<&BaseLevel>,
) -> Result<Terrain, StoreError> {
    let files = Folder::new(folder.as_ref());
    let (_lock, contents) = read(&files, None)?;
    let ground = ground.into();
    let checkpoint = contents.choose_checkpoint();
    if checkpoint.as_ref().is_some_and(|own| own.metadata.ground != ground.hash()) {
        return Err(StoreError::BaseChanged { regions: 0 });
    }
    let name = checkpoint.as_ref().and_then(|own| own.level.as_ref());
    let level = BaseLevel::needed(name, level)?;
    BaseLevel::expect(level, name)?;
    let settings = checkpoint.as_ref().map_or_else(TerrainSettings::default, |own| own.metadata.settings);
    replay_all(&contents, &ground, settings, level)
}
