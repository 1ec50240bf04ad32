//! What of a world is found in its files, before anything is made of it.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use super::checkpoint::Checkpoint;
use super::checkpoint_copy;
use super::database::{DATABASE, DatabaseError, Records};
use super::error::StoreError;
use super::files::Files;
use super::format::bytes::Reader;
use super::format::change::read_change;
use super::format::frame::{self, Kind, WorldId};
use super::format::{self, FormatError};
use super::keys::{self, Key};
use super::progress::{Progress, Work};
use super::salvage;
use super::segment::{self, FRAME_LIMIT, Found, Frame};
use crate::ground::Ground;
use crate::lattice::RegionPos;
use crate::terrain::WorldChange;

/// The share of opening after which the database is read, and all files.
const DATABASE_READ: f32 = 0.08;
const FILES_READ: f32 = 0.1;

/// A region's record as it was found.
#[derive(Clone, Debug)]
pub(super) struct RegionRecord {
    pub revision: u64,
    /// Hash of the ground below.
    pub ground: u64,
    pub payload: Vec<u8>,
    /// Does it say how the region differs from the level below, instead of all that it holds?
    pub is_change: bool,
}

impl RegionRecord {
    fn open(record: &[u8], world: WorldId, key: &[u8]) -> Result<Self, FormatError> {
        let open = |kind| frame::open(record, kind, world, key, FRAME_LIMIT);
        let (opened, is_change) = match open(Kind::Region) {
            Err(FormatError::Kind { .. }) => (open(Kind::RegionChange)?, true),
            opened => (opened?, false),
        };
        let frame::Opened { revision, ground_hash: ground, payload } = opened;
        Ok(Self { revision, ground, payload, is_change })
    }

    /// What it holds, over a ground.
    pub fn decode(&self, at: RegionPos, ground: &Ground) -> Result<WorldChange, FormatError> {
        if self.is_change {
            let mut reader = Reader(&self.payload);
            let change = read_change(&mut reader, ground)?;
            reader.end()?;
            return Ok(change);
        }
        let (bricks, fields) = format::decode_region(&self.payload, at, ground)?;
        let bricks = bricks.into_iter().map(|(pos, brick)| (pos, Some(brick))).collect();
        Ok(WorldChange { bricks, fields, ..WorldChange::default() })
    }
}

/// The files of a world.
pub(super) struct Contents {
    pub world: WorldId,
    pub segments: Vec<Found>,
    pub database: Option<Records>,
    /// What is wrong with the database, if it can't be used.
    pub damaged: Option<String>,
    /// The checkpoints that the database holds, two alike, and the copy beside the journal, but for damage.
    checkpoints: Vec<Checkpoint>,
    /// Valid records of each region: one, but for what was salvaged from a damaged database.
    regions: BTreeMap<RegionPos, Vec<RegionRecord>>,
    /// Records that are not valid, by region.
    pub invalid: BTreeMap<RegionPos, Vec<u8>>,
}

impl Contents {
    /// Reads all of a world's files.
    pub fn read(files: &dyn Files, progress: Option<&Progress>) -> Result<Self, StoreError> {
        let numbers = segment::list(files).map_err(StoreError::files("reading the journal"))?;
        let reading = Work::until(progress, DATABASE_READ, 1);
        let (database, damaged, raw) =
            match Records::open(files).and_then(|open| Ok((open.read_all()?, open))) {
                Ok((records, open)) => (Some(open), None, records),
                Err(DatabaseError::Missing) if numbers.is_empty() => {
                    return Err(StoreError::Missing("this folder".into()));
                }
                Err(error @ DatabaseError::Missing) => (None, Some(error.to_string()), Vec::new()),
                Err(DatabaseError::Files(error)) => {
                    return Err(StoreError::Files { doing: "reading the database", error });
                }
                Err(error @ DatabaseError::Damaged(_)) => {
                    let bytes = files.read(DATABASE).map_err(StoreError::files("reading the database"))?;
                    (None, Some(error.to_string()), salvage::records(&bytes))
                }
            };
        reading.finish();
        let reading = Work::until(progress, FILES_READ, numbers.len() as u64);
        let mut world =
            raw.iter().filter(|(key, _)| keys::CHECKPOINTS.contains(&&key[..])).find_map(|(key, record)| {
                let peeked = frame::peek(record)?;
                frame::open(record, Kind::Checkpoint, peeked.world, key, FRAME_LIMIT).ok()?;
                Some(peeked.world)
            });
        let mut segments = Vec::with_capacity(numbers.len());
        for number in numbers {
            let found = segment::read(files, world, number);
            let found = found.map_err(StoreError::files("reading the journal"))?;
            refuse_newer(found.newer)?;
            world = world.or(found.world);
            segments.push(found);
            reading.advance(1);
        }
        let world = match world {
            Some(world) => world,
            None => Self::no_world(&raw)?,
        };
        let mut contents = Self {
            world,
            segments,
            database,
            damaged,
            checkpoints: Vec::new(),
            regions: BTreeMap::new(),
            invalid: BTreeMap::new(),
        };
        for (key, record) in raw {
            contents.enter(&key, record)?;
        }
        for copy in checkpoint_copy::read(files, world) {
            match copy {
                Ok(copy) => contents.checkpoints.extend(Checkpoint::decode(&copy)),
                Err(error) => refuse_newer(error.newer_schema())?,
            }
        }
        reading.finish();
        Ok(contents)
    }

    /// Nothing says which world it is.
    fn no_world(raw: &[(Vec<u8>, Vec<u8>)]) -> Result<WorldId, StoreError> {
        let of_record = |(key, record): &(Vec<u8>, Vec<u8>)| {
            let world = frame::peek(record)?.world;
            frame::open(record, Kind::Checkpoint, world, key, FRAME_LIMIT).err()?.newer_schema()
        };
        refuse_newer(raw.iter().find_map(of_record))?;
        Err(StoreError::Unreadable("neither journal nor database hold a valid record".into()))
    }

    fn enter(&mut self, key: &[u8], record: Vec<u8>) -> Result<(), StoreError> {
        match Key::of(key) {
            Some(Key::Checkpoint) => {
                match frame::open(&record, Kind::Checkpoint, self.world, key, FRAME_LIMIT) {
                    Ok(opened) => self.checkpoints.extend(Checkpoint::decode(&opened.payload)),
                    Err(error) => refuse_newer(error.newer_schema())?,
                }
            }
            Some(Key::Region(at)) => match RegionRecord::open(&record, self.world, key) {
                Ok(found) => self.regions.entry(at).or_default().push(found),
                Err(error) => {
                    refuse_newer(error.newer_schema())?;
                    self.invalid.insert(at, record);
                }
            },
            None => {}
        }
        Ok(())
    }

    /// The record of a region at a revision.
    pub fn region(&self, at: RegionPos, revision: u64) -> Option<&RegionRecord> {
        self.regions.get(&at)?.iter().find(|record| record.revision == revision)
    }

    /// Bytes of the regions of a checkpoint.
    pub fn bytes_of(&self, checkpoint: &Checkpoint) -> u64 {
        let records = checkpoint.regions.iter().filter_map(|(at, revision)| self.region(*at, *revision));
        records.map(|record| record.payload.len() as u64).sum()
    }

    /// The checkpoint to start from: that which most regions agree with, the database's or a segment's.
    pub fn choose_checkpoint(&self) -> Option<Checkpoint> {
        let heads = self.segments.iter().filter_map(|found| Checkpoint::decode(found.checkpoint.as_deref()?));
        let all = self.checkpoints.iter().cloned().chain(heads);
        // Among equals the newest, after which least has to be replayed.
        all.min_by_key(|checkpoint| (self.disagreeing(checkpoint), Reverse(checkpoint.frame)))
    }

    /// How many regions are not as a checkpoint says.
    fn disagreeing(&self, checkpoint: &Checkpoint) -> usize {
        let said = |(at, revision): &(&RegionPos, &u64)| self.region(**at, **revision).is_none();
        let found = self.regions.keys().chain(self.invalid.keys());
        let unknown: BTreeSet<_> = found.filter(|at| !checkpoint.regions.contains_key(at)).collect();
        checkpoint.regions.iter().filter(said).count() + unknown.len()
    }

    /// The frames from a number on for as long as none is missing.
    pub fn frames_from(&self, first: u64) -> Vec<&Frame> {
        let mut next = first;
        let mut chain = Vec::new();
        for frame in self.segments.iter().flat_map(|found| &found.frames) {
            if frame.number == next {
                chain.push(frame);
                next += 1;
            }
        }
        chain
    }

    /// The greatest number of a frame that was found, or 0.
    pub fn greatest_frame(&self) -> u64 {
        let frames = self.segments.iter().flat_map(|found| &found.frames);
        frames.map(|frame| frame.number).max().unwrap_or_default()
    }
}

/// A world that a newer version wrote to is left alone, whole: what this version can't read is no damage.
fn refuse_newer(schema: Option<u32>) -> Result<(), StoreError> {
    match schema {
        Some(found) => Err(StoreError::Newer { found, known: frame::SCHEMA }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::Vec3;

    use super::super::{Store, StoreOptions};
    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::store::SimulatedDisk;
    use crate::terrain::{Terrain, TerrainSettings};

    /// The same frame as a newer version would write it.
    fn newer(frame: &mut [u8]) {
        let body = frame.len() - 8;
        frame[4] = 9;
        let checksum = xxhash_rust::xxh3::xxh3_64(&frame[..body]);
        frame[body..].copy_from_slice(&checksum.to_le_bytes());
    }

    /// Makes the last frame of a segment a newer one.
    fn newer_journal(bytes: &mut [u8]) {
        let mut at = 0;
        let mut last = 0..0;
        while let Some(length) = bytes.get(at..).and_then(|rest| rest.first_chunk::<4>()) {
            let start = at + 12;
            at = start + u32::from_le_bytes(*length) as usize;
            last = start..at;
        }
        newer(&mut bytes[last]);
    }

    /// A world with a checkpoint and a tail.
    fn world(ground: &Arc<Ground>) -> SimulatedDisk {
        let disk = SimulatedDisk::new();
        let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).unwrap();
        let mut store =
            Store::create_in(Arc::new(disk.clone()), &mut terrain, StoreOptions::default()).unwrap();
        for x in [10.0, 40.0] {
            store.checkpoint().unwrap();
            terrain.apply([Brush::dig(Shape::sphere(Vec3::new(x, 4.0, 30.0), 6.0))]);
            store.follow(&mut terrain).unwrap();
        }
        store.flush().unwrap();
        disk.image().lose_process()
    }

    #[test]
    fn what_a_newer_version_wrote_is_refused_and_left_alone() {
        let ground = Arc::new(Ground::flat(64, 64, 4.0).unwrap());
        for which in ["nothing", "checkpoint", "region", "journal"] {
            let disk = world(&ground);
            if which == "journal" {
                let number = *segment::list(&disk).unwrap().last().unwrap();
                disk.damage(&segment::path(number), |bytes| newer_journal(bytes));
            } else if which != "nothing" {
                let records = Records::open(&disk).unwrap();
                for (key, mut record) in records.read_all().unwrap() {
                    if keys::CHECKPOINTS.contains(&&key[..]) == (which == "checkpoint") {
                        newer(&mut record);
                        records.write(&[(key, Some(record))]).unwrap();
                    }
                }
            }
            let content = |disk: &SimulatedDisk| {
                let log = disk.paths().into_iter().filter(|path| path.starts_with(segment::FOLDER));
                let log: Vec<_> = log.map(|path| (disk.read(&path).unwrap(), path)).collect();
                let is_copy = |path: &&String| path.starts_with("quarantine");
                (
                    log,
                    disk.paths().iter().filter(is_copy).count(),
                    Records::open(disk).unwrap().read_all().unwrap(),
                )
            };
            let before = content(&disk);
            let opened = Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), StoreOptions::default());
            if which == "nothing" {
                assert_eq!(opened.unwrap().1.replayed, 1);
                continue;
            }
            let error = opened.expect_err("it is newer");
            assert!(matches!(error, StoreError::Newer { found: 9, known: 1 }), "{which}: {error}");
            assert!(content(&disk) == before, "{which} is not as it was");
        }
    }
}
