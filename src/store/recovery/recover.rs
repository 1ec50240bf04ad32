//! Recovers a world from its files: regions of the last checkpoint, then the journal's tail, verified frame by frame.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::found::Contents;
use super::load_regions::{DECODE, changed_regions, load_regions, reach};
use super::replay_log::{RECOVERED_ANEW, REPLAY, Replayed, bytes_of, replay_good, replaying};
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkGrid, RegionPos};
use crate::store::base_level::BaseLevel;
use crate::store::checkpoints::{Checkpoint, GroundSize, Mirror};
use crate::store::error::{StoreError, StoreWarning};
use crate::store::journal::segment::{self, Frame};
use crate::store::options::{BaseChanged, StoreOptions};
use crate::store::progress::{Progress, Work};
use crate::store::regions::keys;
use crate::store::store_thread::GameData;
use crate::terrain::{RestoreError, Terrain, TerrainSettings, WorldParts};

/// The share of opening after which a world is recovered as it is on the disk.
const RECOVERED: f32 = 0.97;

/// The work of inserting a byte of a region, in the unit of [`DECODE`] and [`REPLAY`].
const RESTORE: u64 = 2;

/// A recovered world.
pub(in crate::store) struct Recovered {
    pub terrain: Terrain,
    /// The mirror of the world, which knows the regions that differ from their records.
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
pub(in crate::store) struct Findings {
    /// Damaged regions that were rebuilt or lost, and whether they are lost.
    pub damaged: Vec<RegionPos>,
    pub is_lossy: bool,
    /// Set if the ground changed since the save: the number of affected regions, and how they were converted.
    pub base_changed: Option<(usize, &'static str)>,
    /// Commits of another [`Terrain::SIMULATION`](crate::terrain::Terrain::SIMULATION) that were replayed.
    pub replayed: Option<u64>,
    /// Whether everything but the regions is lost.
    pub has_lost_rest: bool,
}

/// Takes the bricks of these regions from another state of the world.
fn take_regions(to: &mut WorldParts, regions: &[RegionPos], from: &WorldParts, grid: ChunkGrid) {
    let is_meant = |pos: &BrickPos| regions.contains(&RegionPos::of(*pos));
    let bricks = &mut to.change.bricks;
    bricks.retain(|(pos, _)| !is_meant(pos));
    bricks.extend(from.change.bricks.iter().filter(|(pos, _)| is_meant(pos)).cloned());
    bricks.sort_by_key(|(pos, _)| *pos);
    to.change.fit_fields(grid);
}

impl Findings {
    /// Whether something of damaged regions is lost.
    pub fn has_lost_regions(&self) -> bool {
        self.is_lossy && !self.damaged.is_empty()
    }
}

/// Recovers a world from its files.
pub(in crate::store) fn recover(
    contents: &Contents,
    ground: &Arc<Ground>,
    options: &StoreOptions,
) -> Result<Recovered, StoreError> {
    let recovery = Recovery::of(contents, ground, options)?;
    recovery.check_base(options.base_changed)?;
    let is_same_base = recovery.is_same_base;
    if !is_same_base && options.base_changed == BaseChanged::Replay && recovery.is_contiguous {
        let mut recovered = recovery.recovered_by_log(recovery.replay_log(false)?);
        recovered.findings.base_changed = Some((recovery.changed_regions(), "replayed"));
        return Ok(recovered);
    }

    let regions = contents.bytes_of(&recovery.checkpoint);
    let end = if is_same_base { RECOVERED } else { RECOVERED_ANEW };
    let total = (DECODE + RESTORE) * regions + REPLAY * bytes_of(&recovery.tail);
    let work = Work::until(options.progress.as_ref(), end, total);
    let grid = recovery.grid()?;
    let (mut parts, damaged) = recovery.load_regions(grid, &work);
    let is_rebuilt = recovery.rebuild_unverified(&mut parts, &damaged, grid, &work)?;
    let restored = recovery.restore(parts.clone());
    if !is_same_base && matches!(restored, Err(RestoreError::Parts(_))) {
        recovery.check_rim(&parts)?;
    }
    work.advance(RESTORE * regions);
    let hash = recovery.checkpoint.metadata.hash;
    let is_exact = restored.as_ref().is_ok_and(|terrain| terrain.world().hash() == hash);
    if is_same_base && !is_exact && recovery.is_log_whole {
        let replayed = recovery.replay_log(true)?;
        // Behind what can't be replayed, the checkpoint may know more.
        if replayed.frame >= recovery.checkpoint.frame {
            let mut recovered = recovery.recovered_by_log(replayed);
            recovered.is_log_whole = true;
            recovered.findings.damaged = damaged;
            return Ok(recovered);
        }
    }
    let is_checked = is_same_base && is_exact && !recovery.is_replayed && !is_rebuilt;
    let mut recovered = recovery.replay_tail(restored?, &parts, is_checked, &work)?;
    recovered.findings = Findings {
        damaged,
        is_lossy: !is_checked && !is_rebuilt,
        base_changed: (!is_same_base).then(|| (recovery.changed_regions(), "kept")),
        replayed: recovery.is_replayed.then_some(recovered.replayed),
        has_lost_rest: recovery.has_lost_rest,
    };
    Ok(recovered)
}

/// A world that is being recovered: its sources, and the facts that decide how, before any region is decoded.
struct Recovery<'a> {
    contents: &'a Contents,
    ground: &'a Arc<Ground>,
    /// The level below the world, if it is based on one.
    level: Option<&'a BaseLevel>,
    progress: Option<&'a Progress>,
    /// The checkpoint to begin with.
    checkpoint: Checkpoint,
    /// Whether no checkpoint was found, so that everything but the regions is lost.
    has_lost_rest: bool,
    /// The frames from the first on for as long as none is missing.
    whole: Vec<&'a Frame>,
    /// The frames after the checkpoint.
    tail: Vec<&'a Frame>,
    /// Whether `whole` reaches the checkpoint.
    is_contiguous: bool,
    /// Whether `whole` reaches the checkpoint, and all of it was written on the present ground and level.
    reaches_back: bool,
    /// Whether `whole` reaches the checkpoint, and leads elsewhere.
    has_other_log: bool,
    /// Whether damaged regions can be rebuilt from the log.
    is_log_whole: bool,
    /// Whether the ground and the level are those that the world was saved with.
    is_same_base: bool,
    /// Whether commits after the checkpoint were made by another simulation: they can be replayed, but not verified.
    is_replayed: bool,
}

impl<'a> Recovery<'a> {
    /// Chooses the checkpoint and the level, and compares them with the journal and the ground.
    fn of(
        contents: &'a Contents,
        ground: &'a Arc<Ground>,
        options: &'a StoreOptions,
    ) -> Result<Self, StoreError> {
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
        let given = options.level.as_ref();
        let level = match has_lost_rest {
            false => BaseLevel::needed(checkpoint.level.as_ref(), given)?,
            true if !contents.is_on_level() => None,
            true => {
                let missing = || StoreError::LevelMissing { label: "unknown".into() };
                Some(given.ok_or_else(missing)?)
            }
        };
        let whole = contents.frames_from(1);
        let is_contiguous = whole.last().map_or(0, |last| last.number) >= checkpoint.frame;
        let base = segment::base(ground.hash(), level.map(BaseLevel::name));
        let reaches_back = contents.reaches_back(checkpoint.frame, base);
        let has_other_log = reaches_back && !has_lost_rest && !contents.leads_to(&checkpoint);
        let is_log_whole = match has_lost_rest {
            false => reaches_back && !has_other_log,
            true => reaches_back && contents.reaches(checkpoint.metadata.revision),
        };
        let tail = contents.frames_from(checkpoint.frame + 1);
        let is_same_ground = checkpoint.metadata.ground == ground.hash() || has_lost_rest;
        let is_same_base = is_same_ground && BaseLevel::expect(level, checkpoint.level.as_ref()).is_ok();
        Ok(Self {
            contents,
            ground,
            level,
            progress: options.progress.as_ref(),
            has_lost_rest,
            is_contiguous,
            reaches_back,
            has_other_log,
            is_log_whole,
            is_same_base,
            is_replayed: is_same_base && tail.iter().any(|frame| frame.base != base),
            checkpoint,
            whole,
            tail,
        })
    }

    /// Checks that the world can continue on this ground and level, and may.
    fn check_base(&self, base_changed: BaseChanged) -> Result<(), StoreError> {
        let size = GroundSize::of(self.ground);
        if let Some(saved) = self.other_size() {
            let replays = base_changed == BaseChanged::Replay && self.is_contiguous;
            let why = match () {
                () if base_changed == BaseChanged::Refuse => {
                    Some("only the ground that it was saved with is allowed")
                }
                () if replays && saved.fits_in(size) => None,
                () if replays => Some("edits beyond it could not be made again"),
                // Where the world ended, edits ended too.
                () if !self.tail.is_empty() => Some(
                    "it was not closed properly, and its last edits can only be made again on a ground of its own size: open it over that \
                     one, and close it, first",
                ),
                () => None,
            };
            if let Some(why) = why {
                return Err(StoreError::GroundSize {
                    saved: saved.to_string(),
                    given: size.to_string(),
                    why,
                });
            }
        }
        if base_changed == BaseChanged::Refuse {
            BaseLevel::expect(self.level, self.checkpoint.level.as_ref())?;
            if !self.is_same_base {
                return Err(StoreError::BaseChanged { regions: self.changed_regions() });
            }
        }
        Ok(())
    }

    /// Refuses a world on a smaller ground, beyond whose rim it was dug.
    fn check_rim(&self, parts: &WorldParts) -> Result<(), StoreError> {
        let size = GroundSize::of(self.ground);
        let Some(reach) = reach(&parts.change).filter(|reach| !reach.fits_in(size)) else { return Ok(()) };
        let saved = self.other_size().map_or_else(|| format!("at least {reach}"), |saved| saved.to_string());
        let why = "it was dug beyond the rim of this one";
        Err(StoreError::GroundSize { saved, given: size.to_string(), why })
    }

    /// The size of the ground that the world was saved with, if it is known and another than that of the present one.
    fn other_size(&self) -> Option<GroundSize> {
        self.checkpoint.cells.filter(|saved| *saved != GroundSize::of(self.ground))
    }

    /// The number of saved regions over changed ground; all of them, if the level is another.
    fn changed_regions(&self) -> usize {
        changed_regions(self.contents, &self.checkpoint, self.ground, self.level).len()
    }

    /// The chunks of the world.
    fn grid(&self) -> Result<ChunkGrid, StoreError> {
        let terrain = Terrain::new(Arc::clone(self.ground), &self.checkpoint.metadata.settings);
        Ok(terrain.map_err(RestoreError::from)?.world().grid())
    }

    /// The world before its first commit.
    fn first(&self) -> Result<Terrain, StoreError> {
        Ok(BaseLevel::first(self.level, self.ground, &self.checkpoint.metadata.settings)?)
    }

    /// A world of these parts.
    fn restore(&self, parts: WorldParts) -> Result<Terrain, RestoreError> {
        Terrain::restore(Arc::clone(self.ground), &self.checkpoint.metadata.settings, parts)
    }

    /// The parts of the world that the checkpoint has, and the regions that can't be read.
    fn load_regions(&self, grid: ChunkGrid, work: &Work) -> (WorldParts, Vec<RegionPos>) {
        let (checkpoint, has_lost_rest) = (&self.checkpoint, self.has_lost_rest);
        load_regions(self.contents, checkpoint, self.ground, self.level, grid, has_lost_rest, work)
    }

    /// Takes damaged regions from a replay of the commits up to the checkpoint, if the log can't rebuild them otherwise;
    /// returns whether it did. Commits of another simulation can't be verified, but say what these regions held.
    fn rebuild_unverified(
        &self,
        parts: &mut WorldParts,
        damaged: &[RegionPos],
        grid: ChunkGrid,
        work: &Work,
    ) -> Result<bool, StoreError> {
        let is_lost = self.is_same_base && !damaged.is_empty() && !self.has_lost_rest;
        let is_unverified = self.is_contiguous && !self.reaches_back;
        if !is_lost || !is_unverified || !self.contents.leads_to(&self.checkpoint) {
            return Ok(false);
        }
        let is_before = |frame: &&Frame| frame.number <= self.checkpoint.frame;
        let before: Vec<&Frame> = self.whole.iter().copied().filter(is_before).collect();
        let (game, named) = (GameData::new(), &self.contents.named);
        let replayed = replay_good(|| self.first(), &game, &before, named, false, work)?;
        let is_rebuilt = replayed.refused.is_none();
        if is_rebuilt {
            take_regions(parts, damaged, &replayed.terrain.parts(), grid);
        }
        Ok(is_rebuilt)
    }

    /// Replays the log from the first commit on, and compares the world with each commit if `is_checked`.
    fn replay_log(&self, is_checked: bool) -> Result<Replayed, StoreError> {
        let work = replaying(self.progress, &self.whole);
        let (game, named) = (GameData::new(), &self.contents.named);
        replay_good(|| self.first(), &game, &self.whole, named, is_checked, &work)
    }

    /// A world that was replayed from its first commit.
    fn recovered_by_log(&self, replayed: Replayed) -> Recovered {
        Recovered {
            mirror: mirror_of(&replayed.terrain, replayed.game, self.level, &self.checkpoint),
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

    /// Replays the commits after the checkpoint on a terrain that was restored from these parts. Unless `is_checked`,
    /// commits are not compared with it, and the whole world counts as changed.
    fn replay_tail(
        &self,
        terrain: Terrain,
        parts: &WorldParts,
        is_checked: bool,
        work: &Work,
    ) -> Result<Recovered, StoreError> {
        let game = self.checkpoint.metadata.game.iter().cloned().collect::<GameData>();
        let (grid, hash) = (terrain.world().grid(), terrain.world().hash());
        let mut mirror = Mirror::new(grid, terrain.parts(), hash, game.clone(), self.level.cloned());
        let mut restored = Some(terrain);
        let begin = || -> Result<Terrain, StoreError> {
            match restored.take() {
                Some(terrain) => Ok(terrain),
                None => Ok(self.restore(parts.clone())?),
            }
        };
        let replayed = replay_good(begin, &game, &self.tail, &self.contents.named, is_checked, work)?;
        if is_checked {
            mirror.set_revisions(&self.checkpoint.regions);
            mirror.mark_saved();
            replayed.records.iter().for_each(|record| mirror.apply(record));
            mirror.game = replayed.game;
        } else {
            mirror = mirror_of(&replayed.terrain, replayed.game, self.level, &self.checkpoint);
        }
        Ok(Recovered {
            terrain: replayed.terrain,
            mirror,
            frame: replayed.frame.max(self.checkpoint.frame),
            checkpoint: if is_checked { self.checkpoint.frame } else { 0 },
            replayed: replayed.commits,
            is_log_whole: self.is_log_whole && is_checked,
            has_other_log: self.has_other_log,
            is_new: !is_checked,
            findings: Findings::default(),
            refused: replayed.refused,
        })
    }
}

/// The mirror of a world that takes the place of all records of a checkpoint.
fn mirror_of(
    terrain: &Terrain,
    game: GameData,
    level: Option<&BaseLevel>,
    checkpoint: &Checkpoint,
) -> Mirror {
    let world = terrain.world();
    let mut mirror = Mirror::new(world.grid(), terrain.parts(), world.hash(), game, level.cloned());
    // Also those whose records go.
    mirror.put_back(checkpoint.regions.keys().copied());
    mirror
}

impl Recovered {
    /// The sizes of its chunks and voxels.
    pub fn settings(&self) -> TerrainSettings {
        TerrainSettings { chunk_size: self.mirror.chunk_size(), voxel_size: self.terrain.voxel_size() }
    }
}

impl Findings {
    /// The warnings to report, given the copies of damaged records, the damage of the file of regions, and its copy.
    pub fn warnings(
        &self,
        copies: &BTreeMap<RegionPos, String>,
        damaged: Option<&str>,
        kept: Option<&str>,
    ) -> Vec<StoreWarning> {
        let mut warnings = Vec::new();
        for at in &self.damaged {
            let quarantine = copies.get(at).map(String::as_str).or(kept).unwrap_or_default().to_owned();
            warnings.push(match self.is_lossy {
                true => StoreWarning::RegionLost { region: keys::name(*at), quarantine },
                false => StoreWarning::Rebuilt {
                    what: format!("the region {} is damaged", keys::name(*at)),
                    quarantine,
                },
            });
        }
        if let (Some(what), true) = (damaged, self.damaged.is_empty()) {
            let quarantine = kept.unwrap_or_default().to_owned();
            warnings.push(StoreWarning::Rebuilt { what: what.into(), quarantine });
        }
        let has_lost_rest = self.has_lost_rest.then_some(StoreWarning::CheckpointLost);
        warnings.extend(has_lost_rest);
        let base_changed = self.base_changed;
        warnings.extend(base_changed.map(|(regions, kept)| StoreWarning::BaseChanged { regions, kept }));
        warnings.extend(self.replayed.map(|commits| StoreWarning::Replayed { commits }));
        warnings
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Edit, Shape};
    use crate::format::frame::WorldId;
    use crate::store::regions::database;
    use crate::store::{SimulatedDisk, Store, inspect_in};
    use crate::terrain::{CommitRecord, Order};

    /// Rewrites the frames of a journal as a version with another simulation would have written them: on another base,
    /// and with commits that are changed in this way.
    fn by_another_simulation(
        disk: &SimulatedDisk,
        world: WorldId,
        ground: &Ground,
        change: impl Fn(&mut CommitRecord),
    ) {
        for number in segment::list(disk).unwrap() {
            let found = segment::read(disk, Some(world), number).unwrap();
            disk.damage(&segment::path(number), |bytes| {
                for frame in found.frames.iter().rev() {
                    let mut batch = frame.batch(ground, &Default::default()).unwrap();
                    batch.commits.iter_mut().for_each(&change);
                    let revision = batch.commits.last().map_or(0, |record| record.revision);
                    let entry =
                        segment::entry(world, frame.base ^ 1, frame.number, revision, &batch.encode());
                    drop(bytes.splice(frame.range.clone(), entry));
                }
            });
        }
    }

    #[test]
    fn journals_that_hold_content_whole_are_read() {
        use glam::UVec3;

        use crate::brush::{GridShape, ShapeGrid};
        use crate::store::Files;
        use crate::store::journal::FoundContents;
        let ground = Arc::new(Ground::flat(64, 64, 20.0).unwrap());
        let disk = SimulatedDisk::new();
        let mut terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).unwrap();
        let created = Store::create_in(Arc::new(disk.clone()), &mut terrain, StoreOptions::default());
        let mut store = created.unwrap();
        let grid =
            ShapeGrid::from_fn(UVec3::splat(9), |at| at.as_vec3().distance(Vec3::splat(4.0)) - 3.0).unwrap();
        for x in 0..4 {
            let shape = GridShape::new(grid.clone(), Vec3::new(10.0 + 12.0 * x as f32, 20.0, 30.0));
            terrain.apply([Brush::dig(shape)]);
            store.follow(&mut terrain).unwrap();
            store.flush().unwrap();
        }
        let (world, killed) = (store.world_id(), disk.image().lose_process());
        for number in segment::list(&killed).unwrap() {
            let found = segment::read(&killed, Some(world), number).unwrap();
            assert_eq!(found.names(..).len(), 1);
            let contents = FoundContents::read(&killed, found.names(..));
            killed.damage(&segment::path(number), |bytes| {
                for frame in found.frames.iter().rev() {
                    let batch = frame.batch(&ground, &contents).unwrap();
                    let revision = batch.commits.last().map_or(0, |record| record.revision);
                    let entry = segment::entry(world, frame.base, frame.number, revision, &batch.encode());
                    drop(bytes.splice(frame.range.clone(), entry));
                }
            });
        }
        for path in killed.paths().into_iter().filter(|path| path.ends_with(".content")) {
            killed.remove(&path).unwrap();
        }
        let options = StoreOptions::default();
        let (_, opened) = Store::open_in(Arc::new(killed), Arc::clone(&ground), options).unwrap();
        let now = (terrain.world().revision(), terrain.world().hash());
        assert_eq!((opened.terrain.world().revision(), opened.terrain.world().hash()), now);
        assert_eq!((opened.replayed, opened.warnings), (4, vec![]));
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
        by_another_simulation(&killed, world, &ground, |record| record.hash ^= 1);
        assert!(!inspect_in(&killed).unwrap().is_log_whole, "it can't be verified");
        let now = terrain.world();
        for base_changed in [BaseChanged::Keep, BaseChanged::Replay, BaseChanged::Refuse] {
            let disk = killed.image().lose_process();
            let open = || {
                let options = StoreOptions { base_changed, ..StoreOptions::default() };
                Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options).unwrap()
            };
            let (_, opened) = open();
            assert_eq!((opened.terrain.world().revision(), opened.terrain.world().hash()), (8, now.hash()));
            assert_eq!(opened.warnings, [StoreWarning::Replayed { commits: 4 }]);
            assert!(!opened.is_log_whole);
            let (_, again) = open();
            assert_eq!((again.terrain.world().hash(), again.warnings), (now.hash(), vec![]));
        }
    }

    #[test]
    fn only_lost_regions_are_those_of_another_simulation() {
        let (ground, disk) = (Arc::new(Ground::flat(320, 64, 20.0).unwrap()), SimulatedDisk::new());
        let dig = |x: u32, z: f32| Brush::dig(Shape::sphere(Vec3::new(32.0 + 64.0 * x as f32, 20.0, z), 5.0));
        let mut terrain = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).unwrap();
        let created = Store::create_in(Arc::new(disk.clone()), &mut terrain, StoreOptions::default());
        let mut store = created.unwrap();
        for x in 0..5 {
            terrain.apply([dig(x, 30.0)]);
            store.follow(&mut terrain).unwrap();
            if x == 3 { store.checkpoint() } else { store.flush() }.unwrap();
        }
        let (world, killed) = (store.world_id(), disk.image().lose_process());
        // There, all digs but the last were elsewhere.
        by_another_simulation(&killed, world, &ground, |record| {
            if record.revision < 5 {
                let edit = Edit::quantize(&dig(record.revision as u32 - 1, 40.0)).unwrap();
                record.orders = vec![Order::Edit(edit)];
            }
        });
        let lost = RegionPos::of(BrickPos::of(glam::IVec3::new(96, 20, 30)));
        let records = database::Records::open(&killed).unwrap();
        records.write(&[(keys::region(lost), Some(b"damaged".to_vec()))]).unwrap();
        drop(records);
        let mut expected = Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).unwrap();
        expected.apply((0..5).map(|x| dig(x, if x == 1 { 40.0 } else { 30.0 })));
        let open = || Store::open_in(Arc::new(killed.clone()), Arc::clone(&ground), StoreOptions::default());
        let (_, opened) = open().unwrap();
        assert_eq!(opened.terrain.world().hash(), expected.world().hash());
        let [StoreWarning::Rebuilt { .. }, StoreWarning::Replayed { commits: 1 }] = &opened.warnings[..]
        else {
            panic!("{:?}", opened.warnings)
        };
        assert_eq!(opened.terrain.world().revision(), 5);
        let (_, again) = open().unwrap();
        assert_eq!((again.terrain.world().hash(), again.warnings), (expected.world().hash(), vec![]));
    }
}
