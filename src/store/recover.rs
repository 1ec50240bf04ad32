//! A world from what was found of it: regions of the last checkpoint, then the journal's tail, verified frame by frame.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rayon::prelude::*;

use super::base_level::BaseLevel;
use super::checkpoint::Checkpoint;
use super::error::{StoreError, StoreTrouble};
use super::format::Batch;
use super::found::Contents;
use super::keys;
use super::mirror::Mirror;
use super::options::{BaseChanged, StoreOptions};
use super::progress::{Progress, Work};
use super::segment::{self, Frame};
use super::shared::{GameData, apply_game};
use crate::ground::Ground;
use crate::lattice::{ChunkGrid, RegionPos};
use crate::terrain::{
    CommitRecord, LogEntry, Meshing, ReplayError, RestoreError, Terrain, TerrainSettings, WorkLimits,
    WorldChange, WorldParts,
};
use crate::volume::DiggingRules;

/// The shares of opening after which a world is recovered: as it is on the disk, and as one that has to be saved whole.
const RECOVERED: f32 = 0.97;
const RECOVERED_ANEW: f32 = 0.75;

/// What a byte of a region costs to decode and to put in place, and a byte of a commit to replay, in one unit.
const DECODE: u64 = 1;
const RESTORE: u64 = 2;
const REPLAY: u64 = 32;

/// A world as it was recovered.
pub(super) struct Recovered {
    pub terrain: Terrain,
    /// Says which regions differ from their records.
    pub mirror: Mirror,
    /// The last frame that it contains.
    pub frame: u64,
    /// The frame of the checkpoint it began with; 0 if none of its records is used.
    pub checkpoint: u64,
    /// Commits that were replayed.
    pub replayed: u64,
    /// Can damaged regions be rebuilt from the log?
    pub is_log_whole: bool,
    /// Are its records, or its log, those of another world than it is now?
    pub is_new: bool,
    /// Damaged regions that were rebuilt or lost, and whether they are lost.
    pub damaged: Vec<RegionPos>,
    pub is_lossy: bool,
    /// Regions over another ground than they were saved with, if the ground is another one, and whether edits were made anew.
    pub base_changed: Option<(usize, &'static str)>,
    /// Why the frame after the last one was refused.
    pub refused: Option<String>,
}

/// How far a world is replayed, and whether it is compared with the log.
struct Replayed {
    terrain: Terrain,
    game: GameData,
    records: Vec<CommitRecord>,
    frame: u64,
    commits: u64,
    refused: Option<String>,
}

/// Makes a world of what was found.
pub(super) fn recover(
    contents: &Contents,
    ground: &Arc<Ground>,
    options: &StoreOptions,
) -> Result<Recovered, StoreError> {
    let StoreOptions { base_changed, level, progress, .. } = options;
    let (base_changed, level, progress) = (*base_changed, level.as_ref(), progress.as_ref());
    let Some(checkpoint) = contents.choose_checkpoint() else {
        return Err(StoreError::Unreadable("neither journal nor database hold a valid checkpoint".into()));
    };
    let level = BaseLevel::needed(checkpoint.level.as_ref(), level)?;
    let whole = contents.frames_from(1);
    let last = whole.last().map_or(0, |last| last.number);
    let is_contiguous = last >= checkpoint.frame;
    let base = segment::base(ground, level);
    let is_log_whole = is_contiguous && whole.iter().all(|frame| frame.base == base);
    let is_same_ground = checkpoint.metadata.ground == ground.hash();
    let other_level = BaseLevel::expect(level, checkpoint.level.as_ref());
    let is_same_base = is_same_ground && other_level.is_ok();
    if base_changed == BaseChanged::Refuse {
        other_level?;
    }
    if !is_same_ground && base_changed == BaseChanged::Refuse {
        return Err(StoreError::BaseChanged {
            regions: changed_regions(contents, &checkpoint, ground, level).len(),
        });
    }
    let settings = checkpoint.metadata.settings;
    let empty = || -> Result<Terrain, StoreError> { Ok(BaseLevel::first(level, ground, &settings)?) };
    if !is_same_base && base_changed == BaseChanged::Replay && is_contiguous {
        let work = replaying(progress, &whole);
        let replayed = replay_good(empty, &GameData::new(), &whole, false, &work)?;
        let regions = changed_regions(contents, &checkpoint, ground, level).len();
        let mut recovered = Recovered::whole(replayed, level, &checkpoint);
        recovered.base_changed = Some((regions, "replayed"));
        return Ok(recovered);
    }

    let tail = contents.frames_from(checkpoint.frame + 1);
    let regions = contents.bytes_of(&checkpoint);
    let end = if is_same_base { RECOVERED } else { RECOVERED_ANEW };
    let work = Work::until(progress, end, (DECODE + RESTORE) * regions + REPLAY * bytes_of(&tail));
    let grid = Terrain::new(Arc::clone(ground), &settings).map_err(RestoreError::from)?.world().grid();
    let (parts, damaged) = load_regions(contents, &checkpoint, ground, level, grid, &work);
    let restore = |parts: WorldParts| Terrain::restore(Arc::clone(ground), &settings, parts);
    let restored = restore(parts.clone());
    work.advance(RESTORE * regions);
    let is_exact = restored.as_ref().is_ok_and(|terrain| terrain.world().hash() == checkpoint.metadata.hash);
    if is_same_base && !is_exact && is_log_whole {
        let work = replaying(progress, &whole);
        let replayed = replay_good(empty, &GameData::new(), &whole, true, &work)?;
        // Behind what can't be replayed, the checkpoint may know more.
        if replayed.frame >= checkpoint.frame {
            let mut recovered = Recovered::whole(replayed, level, &checkpoint);
            recovered.is_log_whole = true;
            recovered.damaged = damaged;
            return Ok(recovered);
        }
    }
    let terrain = restored?;
    let is_checked = is_same_base && is_exact;
    let game = checkpoint.metadata.game.iter().cloned().collect::<GameData>();
    let hash = terrain.world().hash();
    let mut mirror = Mirror::new(grid, terrain.parts(), hash, game.clone(), level.cloned());
    let mut restored = Some(terrain);
    let begin = || -> Result<Terrain, StoreError> {
        match restored.take() {
            Some(terrain) => Ok(terrain),
            None => Ok(restore(parts.clone())?),
        }
    };
    let replayed = replay_good(begin, &game, &tail, is_checked, &work)?;
    let frame = replayed.frame.max(checkpoint.frame);
    let regions = changed_regions(contents, &checkpoint, ground, level).len();
    if is_checked {
        mirror.set_revisions(&checkpoint.regions);
        mirror.mark_saved();
        replayed.records.iter().for_each(|record| mirror.apply(record));
        mirror.game = replayed.game;
    } else {
        mirror = Mirror::new(
            grid,
            replayed.terrain.parts(),
            replayed.terrain.world().hash(),
            replayed.game,
            level.cloned(),
        );
        // Also those whose records go.
        mirror.put_back(checkpoint.regions.keys().copied());
    }
    Ok(Recovered {
        terrain: replayed.terrain,
        mirror,
        frame,
        checkpoint: if is_checked { checkpoint.frame } else { 0 },
        replayed: replayed.commits,
        is_log_whole: is_log_whole && is_checked,
        is_new: !is_checked,
        is_lossy: !is_checked,
        damaged,
        base_changed: (!is_same_base).then_some((regions, "kept")),
        refused: replayed.refused,
    })
}

impl Recovered {
    /// The sizes of its chunks and voxels.
    pub fn settings(&self) -> TerrainSettings {
        TerrainSettings { chunk_size: self.mirror.chunk_size(), voxel_size: self.terrain.voxel_size() }
    }

    /// A world that was replayed from its first commit.
    fn whole(replayed: Replayed, level: Option<&BaseLevel>, checkpoint: &Checkpoint) -> Self {
        let world = replayed.terrain.world();
        let parts = replayed.terrain.parts();
        let mut mirror = Mirror::new(world.grid(), parts, world.hash(), replayed.game, level.cloned());
        // Also those whose records go.
        mirror.put_back(checkpoint.regions.keys().copied());
        Self {
            mirror,
            terrain: replayed.terrain,
            frame: replayed.frame,
            checkpoint: 0,
            replayed: replayed.commits,
            is_log_whole: false,
            is_new: true,
            damaged: Vec::new(),
            is_lossy: false,
            base_changed: None,
            refused: replayed.refused,
        }
    }
}

/// Replays the whole log from the first commit on, and verifies it.
pub(super) fn replay_all(
    contents: &Contents,
    ground: &Arc<Ground>,
    settings: TerrainSettings,
    level: Option<&BaseLevel>,
) -> Result<Terrain, StoreError> {
    let whole = contents.frames_from(1);
    if whole.last().map_or(0, |last| last.number) < contents.greatest_frame() {
        return Err(StoreError::Unreadable("the log does not reach back to the first commit".into()));
    }
    let empty = BaseLevel::first(level, ground, &settings)?;
    let replayed = replay(empty, GameData::new(), &whole, true, &Work::until(None, 1.0, 0))?;
    match replayed.refused {
        Some(why) => Err(StoreError::Unreadable(format!("the log can't be replayed: {why}"))),
        None => Ok(replayed.terrain),
    }
}

/// The work of replaying a log, after which the world has to be saved.
fn replaying<'a>(progress: Option<&'a Progress>, frames: &[&Frame]) -> Work<'a> {
    Work::until(progress, RECOVERED_ANEW, REPLAY * bytes_of(frames))
}

fn bytes_of(frames: &[&Frame]) -> u64 {
    frames.iter().map(|frame| frame.payload.len() as u64).sum()
}

/// The regions whose heights below are not those that they were saved with; all of them on another level.
fn changed_regions(
    contents: &Contents,
    checkpoint: &Checkpoint,
    ground: &Ground,
    level: Option<&BaseLevel>,
) -> BTreeSet<RegionPos> {
    if BaseLevel::expect(level, checkpoint.level.as_ref()).is_err() {
        return checkpoint.regions.keys().copied().collect();
    }
    if checkpoint.metadata.ground == ground.hash() {
        return BTreeSet::new();
    }
    let mut hashes = BTreeMap::new();
    let mut is_changed = |(at, revision): &(&RegionPos, &u64)| {
        let now = *hashes.entry(at.column()).or_insert_with(|| ground.region_hash(at.column()));
        contents.region(**at, **revision).is_some_and(|record| record.ground != now)
    };
    checkpoint.regions.iter().filter(|own| is_changed(own)).map(|(at, _)| *at).collect()
}

/// The parts of a world that a checkpoint has, and the regions that can't be read.
fn load_regions(
    contents: &Contents,
    checkpoint: &Checkpoint,
    ground: &Ground,
    level: Option<&BaseLevel>,
    grid: ChunkGrid,
    work: &Work,
) -> (WorldParts, Vec<RegionPos>) {
    let metadata = &checkpoint.metadata;
    let below = level.map(|level| level.parts(ground)).unwrap_or_default();
    let (mut bricks, mut fields) = (below.change.bricks, below.change.fields);
    if below.chunk_size != metadata.settings.chunk_size {
        fields.clear();
    }
    let is_same_level = BaseLevel::expect(level, checkpoint.level.as_ref()).is_ok();
    let decode = |(at, revision): &(RegionPos, u64)| {
        let record = contents.region(*at, *revision);
        let change = record.and_then(|record| record.decode(*at, ground).ok());
        work.advance(DECODE * record.map_or(0, |record| record.payload.len() as u64));
        (*at, change)
    };
    let regions: Vec<(RegionPos, u64)> =
        checkpoint.regions.iter().map(|(at, revision)| (*at, *revision)).collect();
    let decoded: Vec<_> = regions.par_iter().map(decode).collect();
    let mut damaged = Vec::new();
    for (at, change) in decoded {
        match change {
            Some(change) => {
                bricks.extend(change.bricks);
                if is_same_level {
                    fields.extend(change.fields);
                }
            }
            None => damaged.push(at),
        }
    }
    keep_latest(&mut bricks);
    keep_latest(&mut fields);
    bricks.retain(|(_, brick)| brick.is_some());
    fields.retain(|(_, fields)| !fields.is_empty());
    let next_field = metadata.next_field.max(below.change.next_field);
    let mut change = WorldChange { bricks, fields, next_field };
    if !is_same_level {
        // Fields of two levels may overlap, and have one name: the new one's go on, and grow.
        change.cover(grid);
    }
    let parts = WorldParts {
        change,
        chunk_size: metadata.settings.chunk_size,
        revision: metadata.revision,
        rules: metadata.rules.clone(),
        loose: metadata.loose,
    };
    (parts, damaged)
}

/// Sorts a list by key; of those with the same key the last stays.
fn keep_latest<K: Copy + Ord, V>(list: &mut Vec<(K, V)>) {
    list.sort_by_key(|(key, _)| *key);
    list.dedup_by(|later, kept| {
        let is_same = later.0 == kept.0;
        if is_same {
            std::mem::swap(later, kept);
        }
        is_same
    });
}

/// Replays frames up to the first that does not fit, from the world that `begin` makes, and again without it: a world that was
/// given a part of it can't be used.
fn replay_good(
    mut begin: impl FnMut() -> Result<Terrain, StoreError>,
    game: &GameData,
    frames: &[&Frame],
    is_checked: bool,
    work: &Work,
) -> Result<Replayed, StoreError> {
    let replayed = replay(begin()?, game.clone(), frames, is_checked, work)?;
    if replayed.refused.is_none() {
        return Ok(replayed);
    }
    let good: Vec<&Frame> = frames.iter().copied().filter(|frame| frame.number <= replayed.frame).collect();
    Ok(Replayed { refused: replayed.refused, ..replay(begin()?, game.clone(), &good, is_checked, work)? })
}

/// Replays frames, and compares the world with each commit if `is_checked`. Stops before the first frame that does not fit.
fn replay(
    mut terrain: Terrain,
    mut game: GameData,
    frames: &[&Frame],
    is_checked: bool,
    work: &Work,
) -> Result<Replayed, StoreError> {
    terrain.set_meshing(Meshing::Never);
    terrain.keep_log(Some(usize::MAX));
    drop(terrain.take_log());
    let (mut records, mut commits, mut refused, mut last, mut revision) = (Vec::new(), 0, None, 0, None);
    let limits = terrain.work_limits();
    terrain.set_work_limits(WorkLimits::UNBOUNDED);
    for frame in frames {
        let batch = match Batch::decode(&frame.payload, terrain.world().ground()) {
            Ok(batch) => batch,
            Err(why) => {
                refused = Some(why.to_string());
                break;
            }
        };
        let cost = REPLAY * frame.payload.len() as u64 / batch.commits.len().max(1) as u64;
        let replayed = batch.commits.iter().try_for_each(|record| {
            match is_checked {
                true => drop(terrain.replay(record)?),
                false => replay_unchecked(&mut terrain, record)?,
            }
            work.advance(cost);
            Ok::<(), ReplayError>(())
        });
        if let Err(why) = replayed {
            refused = Some(why.to_string());
            break;
        }
        commits += batch.commits.len() as u64;
        revision = batch.commits.last().map(|record| record.revision).or(revision);
        records.append(&mut terrain.take_log());
        apply_game(&mut game, &batch.game);
        last = frame.number;
    }
    terrain.clear_history();
    terrain.set_work_limits(limits);
    terrain.set_meshing(Meshing::All);
    terrain.keep_log(None);
    if !is_checked && let Some(revision) = revision {
        // Other transactions than those of the records may have led here, and bricks have come without fields.
        let (ground, mut parts) = (terrain.world().shared_ground(), terrain.parts());
        let has_grown = parts.change.cover(terrain.world().grid());
        if has_grown || revision != parts.revision {
            let settings = TerrainSettings { chunk_size: parts.chunk_size, voxel_size: terrain.voxel_size() };
            terrain = Terrain::restore(ground, &settings, WorldParts { revision, ..parts })?;
        }
    }
    Ok(Replayed { terrain, game, records, frame: last, commits, refused })
}

/// Does again what a record was asked for, on a world that is not the one it was made on.
fn replay_unchecked(terrain: &mut Terrain, record: &CommitRecord) -> Result<(), ReplayError> {
    for entry in &record.entries {
        match entry {
            LogEntry::Rules(rules) => {
                terrain.set_rules(rules.as_deref().map_or_else(DiggingRules::default, Clone::clone))?;
            }
            LogEntry::Loose(settings) => terrain.set_loose(*settings),
            LogEntry::Edit(edit) => terrain.submit_edit(edit),
            LogEntry::Ground(ground) => terrain.set_ground(Arc::clone(ground))?,
            // Its fields are those of the other world.
            LogEntry::Change => {
                let bricks = record.change.bricks.clone();
                terrain.apply_change(WorldChange { bricks, ..WorldChange::default() }, None)?;
            }
        }
    }
    // Edits that this world rejects are left out.
    terrain.apply::<crate::brush::Brush>([]);
    Ok(())
}

/// What to tell of a recovery, given where copies of damaged parts are.
pub(super) fn troubles(recovered: &Recovered, copies: &BTreeMap<RegionPos, String>) -> Vec<StoreTrouble> {
    let mut troubles = Vec::new();
    for at in &recovered.damaged {
        let quarantine = copies.get(at).cloned().unwrap_or_else(|| "no file, as nothing was left".into());
        troubles.push(match recovered.is_lossy {
            true => StoreTrouble::RegionLost { region: keys::name(*at), quarantine },
            false => StoreTrouble::Rebuilt {
                what: format!("the region {} is damaged", keys::name(*at)),
                quarantine,
            },
        });
    }
    troubles
        .extend(recovered.base_changed.map(|(regions, kept)| StoreTrouble::BaseChanged { regions, kept }));
    troubles
}
