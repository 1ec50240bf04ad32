//! What of a world is found in its files, before anything is made of it.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use super::checkpoint::Checkpoint;
use super::database::{DATABASE, DatabaseError, Records};
use super::error::StoreError;
use super::files::Files;
use super::format::frame::{self, Kind, WorldId};
use super::keys::{self, Key};
use super::salvage;
use super::segment::{self, FRAME_LIMIT, Found, Frame};
use crate::lattice::RegionPos;

/// A region's record as it was found.
#[derive(Clone, Debug)]
pub(super) struct RegionRecord {
    pub revision: u64,
    /// Hash of the ground below.
    pub ground: u64,
    pub payload: Vec<u8>,
}

/// The files of a world.
pub(super) struct Contents {
    pub world: WorldId,
    pub segments: Vec<Found>,
    pub database: Option<Records>,
    /// What is wrong with the database, if it can't be used.
    pub damaged: Option<String>,
    /// The checkpoints that the database holds: two alike, but for damage.
    checkpoints: Vec<Checkpoint>,
    /// Valid records of each region: one, but for what was salvaged from a damaged database.
    regions: BTreeMap<RegionPos, Vec<RegionRecord>>,
    /// Records that are not valid, by region.
    pub invalid: BTreeMap<RegionPos, Vec<u8>>,
}

impl Contents {
    /// Reads all of a world's files.
    pub fn read(files: &dyn Files) -> Result<Self, StoreError> {
        let numbers = segment::list(files).map_err(StoreError::files("reading the journal"))?;
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
            world = world.or(found.world);
            segments.push(found);
        }
        let world = match world {
            Some(world) => world,
            None => Self::no_world(&segments, &raw)?,
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
        Ok(contents)
    }

    /// Nothing says which world it is.
    fn no_world(segments: &[Found], raw: &[(Vec<u8>, Vec<u8>)]) -> Result<WorldId, StoreError> {
        let of_record = |(key, record): &(Vec<u8>, Vec<u8>)| {
            let world = frame::peek(record)?.world;
            frame::open(record, Kind::Checkpoint, world, key, FRAME_LIMIT).err()?.newer_schema()
        };
        let newer = segments.iter().find_map(|found| found.newer).or_else(|| raw.iter().find_map(of_record));
        match newer {
            Some(found) => Err(StoreError::Newer { found, known: frame::SCHEMA }),
            None => Err(StoreError::Unreadable("neither journal nor database hold a valid record".into())),
        }
    }

    fn enter(&mut self, key: &[u8], record: Vec<u8>) -> Result<(), StoreError> {
        match Key::of(key) {
            Some(Key::Checkpoint) => {
                match frame::open(&record, Kind::Checkpoint, self.world, key, FRAME_LIMIT) {
                    Ok(opened) => self.checkpoints.extend(Checkpoint::decode(&opened.payload)),
                    Err(error) => {
                        if let Some(found) = error.newer_schema() {
                            return Err(StoreError::Newer { found, known: frame::SCHEMA });
                        }
                    }
                }
            }
            Some(Key::Region(at)) => match frame::open(&record, Kind::Region, self.world, key, FRAME_LIMIT) {
                Ok(opened) => {
                    let (revision, ground) = (opened.revision, opened.ground_hash);
                    let found = RegionRecord { revision, ground, payload: opened.payload };
                    self.regions.entry(at).or_default().push(found);
                }
                Err(_) => drop(self.invalid.insert(at, record)),
            },
            None => {}
        }
        Ok(())
    }

    /// The record of a region at a revision.
    pub fn region(&self, at: RegionPos, revision: u64) -> Option<&RegionRecord> {
        self.regions.get(&at)?.iter().find(|record| record.revision == revision)
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
