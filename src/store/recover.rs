//! Recovers a world from its files: regions of the last checkpoint, then the journal's tail, verified frame by frame.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::IVec3;
use rayon::prelude::*;

use super::base_level::BaseLevel;
use super::checkpoint::Checkpoint;
use super::error::{StoreError, StoreTrouble};
use super::found::Contents;
use super::ground_size::GroundSize;
use super::keys;
use super::mirror::Mirror;
use super::options::{BaseChanged, StoreOptions};
use super::progress::{Progress, Work};
use super::segment::{self, Frame};
use super::shared::{GameData, apply_game};
use crate::format::Batch;
use crate::ground::Ground;
use crate::lattice::{ChunkGrid, RegionPos};
use crate::terrain::{
    Asked, CommitRecord, Meshing, Order, Patch, ReplayError, RestoreError, Terrain, TerrainSettings,
    WorkLimits, WorldParts,
};
use crate::volume::{Field, Fields};

/// The shares of opening after which a world is recovered: as it is on the disk, and as one that has to be saved whole.
const RECOVERED: f32 = 0.97;
const RECOVERED_ANEW: f32 = 0.75;

/// The work of decoding and inserting a byte of a region, and of replaying a byte of a commit, in the same unit.
const DECODE: u64 = 1;
const RESTORE: u64 = 2;
const REPLAY: u64 = 32;

/// A recovered world.
pub(super) struct Recovered {
    pub terrain: Terrain,
    /// Its mirror, which knows the regions that differ from their records.
    pub mirror: Mirror,
    /// The last frame that it contains.
    pub frame: u64,
    /// The frame of the checkpoint it began with; 0 if none of its records is used.
    pub checkpoint: u64,
    /// Commits that were replayed.
    pub replayed: u64,
    /// Whether damaged regions can be rebuilt from the log.
    pub is_log_whole: bool,
    /// Whether the log reaches from the first commit to the checkpoint, and leads elsewhere.
    pub has_other_log: bool,
    /// Whether its records or its log belong to another world than the present one.
    pub is_new: bool,
    pub findings: Findings,
    /// Why the frame after the last one was refused.
    pub refused: Option<String>,
}

/// Findings of a recovery that should be reported.
#[derive(Clone, Debug, Default)]
pub(super) struct Findings {
    /// Damaged regions that were rebuilt or lost, and whether they are lost.
    pub damaged: Vec<RegionPos>,
    pub is_lossy: bool,
    /// Set if the ground changed since the save: the number of affected regions, and how they were converted.
    pub base_changed: Option<(usize, &'static str)>,
    /// Commits of another [`SIMULATION`](crate::terrain::SIMULATION) that were replayed.
    pub remade: Option<u64>,
    /// Whether everything but the regions is lost.
    pub has_lost_rest: bool,
}

/// The end of a replay, and whether the world is compared with the log.
struct Replayed {
    terrain: Terrain,
    game: GameData,
    records: Vec<CommitRecord>,
    frame: u64,
    commits: u64,
    refused: Option<String>,
}

/// Recovers a world from its files.
pub(super) fn recover(
    contents: &Contents,
    ground: &Arc<Ground>,
    options: &StoreOptions,
) -> Result<Recovered, StoreError> {
    let StoreOptions { base_changed, level, progress, .. } = options;
    let (base_changed, level, progress) = (*base_changed, level.as_ref(), progress.as_ref());
    let found = contents.choose_checkpoint();
    let has_lost_rest = found.is_none();
    let checkpoint = match found {
        Some(checkpoint) => checkpoint,
        None if options.salvage => contents.assume_checkpoint(),
        None => {
            let why = "neither journal nor database hold a valid checkpoint";
            return Err(StoreError::Unreadable(why.into()));
        }
    };
    let level = match has_lost_rest {
        false => BaseLevel::needed(checkpoint.level.as_ref(), level)?,
        true if !contents.is_on_level() => None,
        true => {
            let missing = || StoreError::LevelMissing { label: "unknown".into() };
            Some(level.ok_or_else(missing)?)
        }
    };
    let whole = contents.frames_from(1);
    let last = whole.last().map_or(0, |last| last.number);
    let is_contiguous = last >= checkpoint.frame;
    let base = segment::base(ground, level);
    let reaches_back = is_contiguous && whole.iter().all(|frame| frame.base == base);
    let has_other_log = reaches_back && !has_lost_rest && !contents.leads_to(&checkpoint);
    let is_log_whole = match has_lost_rest {
        false => reaches_back && !has_other_log,
        true => reaches_back && contents.reaches(checkpoint.metadata.revision),
    };
    let tail = contents.frames_from(checkpoint.frame + 1);
    let is_same_ground = checkpoint.metadata.ground == ground.hash() || has_lost_rest;
    let other_level = BaseLevel::expect(level, checkpoint.level.as_ref());
    let is_same_base = is_same_ground && other_level.is_ok();
    // Commits after the checkpoint were made by another simulation: they can be replayed, but not verified.
    let is_remade = is_same_base && tail.iter().any(|frame| frame.base != base);
    let size = GroundSize::of(ground);
    let other_size = checkpoint.cells.filter(|saved| *saved != size);
    if let Some(saved) = other_size {
        let replays = base_changed == BaseChanged::Replay && is_contiguous;
        let why = match () {
            () if base_changed == BaseChanged::Refuse => {
                Some("only the ground that it was saved with is allowed")
            }
            () if replays && saved.fits_in(size) => None,
            () if replays => Some("edits beyond it could not be made again"),
            // Where the world ended, edits ended too.
            () if !tail.is_empty() => Some(
                "it was not closed properly, and its last edits can only be made again on a ground of its own size: open it over that \
                 one, and close it, first",
            ),
            () => None,
        };
        if let Some(why) = why {
            return Err(StoreError::GroundSize { saved: saved.to_string(), given: size.to_string(), why });
        }
    }
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
        recovered.findings.base_changed = Some((regions, "replayed"));
        return Ok(recovered);
    }

    let regions = contents.bytes_of(&checkpoint);
    let end = if is_same_base { RECOVERED } else { RECOVERED_ANEW };
    let work = Work::until(progress, end, (DECODE + RESTORE) * regions + REPLAY * bytes_of(&tail));
    let grid = Terrain::new(Arc::clone(ground), &settings).map_err(RestoreError::from)?.world().grid();
    let (parts, damaged) = load_regions(contents, &checkpoint, ground, level, grid, has_lost_rest, &work);
    let restore = |parts: WorldParts| Terrain::restore(Arc::clone(ground), &settings, parts);
    let restored = restore(parts.clone());
    if let (false, Err(RestoreError::Parts(_))) = (is_same_base, &restored)
        && let Some(saved) = reach(&parts.change).filter(|reach| !reach.fits_in(size))
    {
        let saved = other_size.map_or_else(|| format!("at least {saved}"), |saved| saved.to_string());
        let why = "it was dug beyond the rim of this one";
        return Err(StoreError::GroundSize { saved, given: size.to_string(), why });
    }
    work.advance(RESTORE * regions);
    let is_exact = restored.as_ref().is_ok_and(|terrain| terrain.world().hash() == checkpoint.metadata.hash);
    if is_same_base && !is_exact && is_log_whole {
        let work = replaying(progress, &whole);
        let replayed = replay_good(empty, &GameData::new(), &whole, true, &work)?;
        // Behind what can't be replayed, the checkpoint may know more.
        if replayed.frame >= checkpoint.frame {
            let mut recovered = Recovered::whole(replayed, level, &checkpoint);
            recovered.is_log_whole = true;
            recovered.findings = Findings { damaged, ..Findings::default() };
            return Ok(recovered);
        }
    }
    let terrain = restored?;
    let is_checked = is_same_base && is_exact && !is_remade;
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
        has_other_log,
        is_new: !is_checked,
        findings: Findings {
            damaged,
            is_lossy: !is_checked,
            base_changed: (!is_same_base).then_some((regions, "kept")),
            remade: is_remade.then_some(replayed.commits),
            has_lost_rest,
        },
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
            has_other_log: false,
            is_new: true,
            findings: Findings::default(),
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
    let last = contents.choose_checkpoint().map_or(0, |checkpoint| checkpoint.frame);
    if whole.last().map_or(0, |last| last.number) < contents.greatest_frame().max(last) {
        return Err(StoreError::LogNotWhole);
    }
    let empty = BaseLevel::first(level, ground, &settings)?;
    let replayed = replay(empty, GameData::new(), &whole, true, &Work::until(None, 1.0, 0))?;
    match replayed.refused {
        Some(why) => Err(StoreError::LogRefused(why)),
        None => Ok(replayed.terrain),
    }
}

/// The work of replaying a log, after which the world has to be saved.
fn replaying<'a>(progress: Option<&'a Progress>, frames: &[&Frame]) -> Work<'a> {
    Work::until(progress, RECOVERED_ANEW, REPLAY * bytes_of(frames))
}

fn bytes_of(frames: &[&Frame]) -> u64 {
    frames.iter().map(|frame| frame.bytes() as u64).sum()
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
    has_lost_rest: bool,
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
        work.advance(DECODE * record.map_or(0, |record| record.bytes() as u64));
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
                // Of chunks whose size is not known they can't be used.
                if is_same_level && !has_lost_rest {
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
    let mut change = Patch { bricks, fields, next_field };
    if checkpoint.metadata.ground != ground.hash() {
        fit_fields(&mut change, grid);
    }
    if !is_same_level || checkpoint.metadata.ground != ground.hash() {
        // Fields of two levels may overlap and have one name: those of the new level continue, and grow. Beyond the rim
        // of a smaller ground, edits reach into more chunks.
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

/// Cuts fields off where their chunk ends on a ground of another size: the last chunk has one column more than others.
fn fit_fields(change: &mut Patch, grid: ChunkGrid) {
    for (chunk, fields) in &mut change.fields {
        let own = grid.chunk_samples(*chunk).intersection(grid.edit_bounds());
        let own = own.filter(|_| grid.has_tile(chunk.tile()));
        if own.is_some_and(|own| fields.iter().all(|field| own.encloses(field.bounds))) {
            continue;
        }
        let cut = |field: &Field| Some(Field { bounds: field.bounds.intersection(own?)?, ..*field });
        *fields = Fields::restored(fields.iter().filter_map(cut).collect()).unwrap_or_default();
    }
    change.fields.retain(|(_, fields)| !fields.is_empty());
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

/// Replays frames up to the first that does not fit, from the world that `begin` makes, and again without it: a world
/// that was given a part of it can't be used.
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

/// Replays frames, and compares the world with each commit if `is_checked`. Stops before the first frame that does not
/// fit.
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
        let batch = frame.payload().and_then(|payload| Batch::decode(&payload, terrain.world().ground()));
        let batch = match batch {
            Ok(batch) => batch,
            Err(why) => {
                refused = Some(why.to_string());
                break;
            }
        };
        let cost = REPLAY * frame.bytes() as u64 / batch.commits.len().max(1) as u64;
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

/// Replays a record on a world that differs from the one it was made on. Edits that this world rejects are left out.
fn replay_unchecked(terrain: &mut Terrain, record: &CommitRecord) -> Result<(), ReplayError> {
    let orders = record.orders().map(|order| match order {
        // Its fields are those of the other world.
        Order::Parts { change, .. } => {
            let bricks = change.bricks.clone();
            Order::Parts { change: Arc::new(Patch { bricks, ..Patch::default() }), hash: None }
        }
        order => order,
    });
    // Without an entry, all of its edits were rejected.
    if !record.entries.is_empty() {
        let receipts = terrain.apply(orders);
        let mut others = receipts.iter().filter(|receipt| receipt.asked != Asked::Edit);
        if let Some(why) = others.find_map(|receipt| receipt.outcome.as_ref().err()) {
            return Err(ReplayError::of(why, record.revision));
        }
    }
    Ok(())
}

/// The cells along x and z that edited samples of bricks need.
fn reach(change: &Patch) -> Option<GroundSize> {
    let bounds = change.bricks.iter().filter_map(|(pos, brick)| brick.as_ref()?.edited_bounds(*pos));
    let most = bounds.map(|bounds| bounds.max).reduce(IVec3::max)?;
    let cells = |at: i32| u32::try_from(at).unwrap_or_default();
    Some(GroundSize { width: cells(most.x), depth: cells(most.z) })
}

impl Findings {
    /// The troubles to report, given the copies of damaged records, the damage of the file of regions, and its copy.
    pub fn troubles(
        &self,
        copies: &BTreeMap<RegionPos, String>,
        damaged: Option<&str>,
        kept: Option<&str>,
    ) -> Vec<StoreTrouble> {
        let mut troubles = Vec::new();
        for at in &self.damaged {
            let quarantine = copies.get(at).map(String::as_str).or(kept).unwrap_or_default().to_owned();
            troubles.push(match self.is_lossy {
                true => StoreTrouble::RegionLost { region: keys::name(*at), quarantine },
                false => StoreTrouble::Rebuilt {
                    what: format!("the region {} is damaged", keys::name(*at)),
                    quarantine,
                },
            });
        }
        if let (Some(what), true) = (damaged, self.damaged.is_empty()) {
            let quarantine = kept.unwrap_or_default().to_owned();
            troubles.push(StoreTrouble::Rebuilt { what: what.into(), quarantine });
        }
        let has_lost_rest = self.has_lost_rest.then_some(StoreTrouble::CheckpointLost);
        troubles.extend(has_lost_rest);
        let base_changed = self.base_changed;
        troubles.extend(base_changed.map(|(regions, kept)| StoreTrouble::BaseChanged { regions, kept }));
        troubles.extend(self.remade.map(|commits| StoreTrouble::MadeAgain { commits }));
        troubles
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::{SimulatedDisk, Store};
    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::format::frame::WorldId;

    /// Rewrites the frames of a journal as a version with another simulation would have written them: on another base,
    /// and with other hashes.
    fn by_another_simulation(disk: &SimulatedDisk, world: WorldId, ground: &Ground) {
        for number in segment::list(disk).unwrap() {
            let found = segment::read(disk, Some(world), number).unwrap();
            disk.damage(&segment::path(number), |bytes| {
                for frame in found.frames.iter().rev() {
                    let mut batch = Batch::decode(&frame.payload().unwrap(), ground).unwrap();
                    batch.commits.iter_mut().for_each(|record| record.hash ^= 1);
                    let revision = batch.commits.last().map_or(0, |record| record.revision);
                    let entry =
                        segment::entry(world, frame.base ^ 1, frame.number, revision, &batch.encode());
                    drop(bytes.splice(frame.range.clone(), entry));
                }
            });
        }
    }

    #[test]
    fn commits_of_another_simulation_are_made_again() {
        let ground = Arc::new(Ground::flat(64, 64, 4.0).unwrap());
        let disk = SimulatedDisk::new();
        let mut terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).unwrap();
        let created = Store::create_in(Arc::new(disk.clone()), &mut terrain, StoreOptions::default());
        let mut store = created.unwrap();
        for x in 0..8 {
            terrain.apply([Brush::dig(Shape::sphere(Vec3::new(8.0 * x as f32, 4.0, 30.0), 5.0))]);
            store.follow(&mut terrain).unwrap();
            if x == 3 { store.checkpoint() } else { store.flush() }.unwrap();
        }
        let world = store.world_id();
        let killed = disk.image().lose_process();
        by_another_simulation(&killed, world, &ground);
        let now = terrain.world();
        for base_changed in [BaseChanged::Keep, BaseChanged::Replay, BaseChanged::Refuse] {
            let disk = killed.image().lose_process();
            let open = || {
                let options = StoreOptions { base_changed, ..StoreOptions::default() };
                Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options).unwrap()
            };
            let (_, opened) = open();
            assert_eq!((opened.terrain.world().revision(), opened.terrain.world().hash()), (8, now.hash()));
            assert_eq!(opened.troubles, [StoreTrouble::MadeAgain { commits: 4 }]);
            assert!(!opened.is_log_whole);
            let (_, again) = open();
            assert_eq!((again.terrain.world().hash(), again.troubles), (now.hash(), vec![]));
        }
    }
}
