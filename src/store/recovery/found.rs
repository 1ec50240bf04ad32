//! Reads everything that the files of a world contain, before recovery chooses from it.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::ops::RangeBounds;

use crate::format::bytes::Reader;
use crate::format::change::read_change;
use crate::format::frame::{self, Kind, WorldId};
use crate::format::ids::ContentId;
use crate::format::{self, FormatError, Metadata};
use crate::ground::Ground;
use crate::lattice::RegionPos;
use crate::store::checkpoints::{Checkpoint, checkpoint_copy};
use crate::store::error::StoreError;
use crate::store::files::Files;
use crate::store::journal::segment::{self, Bad, FRAME_LIMIT, Found, Frame, MAX_NUMBER};
use crate::store::journal::{FoundContents, unsaved};
use crate::store::progress::{Progress, Work};
use crate::store::regions::database::DATABASE;
use crate::store::regions::keys::{self, Key};
use crate::store::regions::sources::{self, Source};
use crate::terrain::Patch;

/// The share of opening after which the database is read, and all files.
const DATABASE_READ: f32 = 0.08;
const FILES_READ: f32 = 0.1;

/// A region's record as it was found.
#[derive(Clone, Debug)]
pub(in crate::store) struct RegionRecord {
    pub revision: u64,
    /// Hash of the ground below.
    pub ground: u64,
    world: WorldId,
    /// The record's bytes. Unpacked they may be far more.
    sealed: Box<[u8]>,
    /// Whether it holds the differences from the level below instead of the whole region.
    is_change: bool,
}

impl RegionRecord {
    fn open(record: Vec<u8>, world: WorldId, key: &[u8]) -> Result<Self, (FormatError, Vec<u8>)> {
        let open = |kind| frame::open(&record, kind, world, key, FRAME_LIMIT);
        let opened = match open(Kind::Region) {
            Err(FormatError::Kind { .. }) => open(Kind::RegionChange).map(|opened| (opened, true)),
            opened => opened.map(|opened| (opened, false)),
        };
        match opened {
            Ok((frame::Opened { revision, ground_hash: ground, .. }, is_change)) => {
                Ok(Self { revision, ground, world, sealed: record.into(), is_change })
            }
            Err(why) => Err((why, record)),
        }
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.sealed.len()
    }

    /// The record's content, over a ground.
    pub fn decode(&self, at: RegionPos, ground: &Ground) -> Result<Patch, FormatError> {
        let kind = if self.is_change { Kind::RegionChange } else { Kind::Region };
        let payload = frame::open(&self.sealed, kind, self.world, &keys::region(at), FRAME_LIMIT)?.payload;
        if self.is_change {
            let mut reader = Reader(&payload);
            let change = read_change(&mut reader, ground)?;
            reader.end()?;
            return Ok(change);
        }
        let (bricks, fields) = format::decode_region(&payload, at, ground)?;
        let bricks = bricks.into_iter().map(|(pos, brick)| (pos, Some(brick))).collect();
        Ok(Patch { bricks, fields, ..Patch::default() })
    }
}

/// The valid records of files.
#[derive(Default)]
pub(in crate::store) struct FoundRecords {
    pub checkpoints: Vec<Checkpoint>,
    pub regions: BTreeMap<RegionPos, Vec<RegionRecord>>,
}

impl FoundRecords {
    /// Adds a record, or returns why it is not valid.
    fn enter(&mut self, world: WorldId, key: &[u8], record: Vec<u8>) -> Result<(), (FormatError, Vec<u8>)> {
        match Key::of(key) {
            Some(Key::Checkpoint) => match frame::open(&record, Kind::Checkpoint, world, key, FRAME_LIMIT) {
                Ok(opened) => self.checkpoints.extend(decode_checkpoint(&opened.payload)),
                Err(why) => return Err((why, record)),
            },
            Some(Key::Region(at)) => {
                let (found, known) =
                    (RegionRecord::open(record, world, key)?, self.regions.entry(at).or_default());
                if known.iter().all(|own| own.revision != found.revision) {
                    known.push(found);
                }
            }
            None => {}
        }
        Ok(())
    }
}

/// The files of a world.
pub(in crate::store) struct Contents {
    pub world: WorldId,
    pub segments: Vec<Found>,
    /// The content that their frames name.
    pub named: FoundContents,
    /// The fault of the file of regions, if it can't be used.
    pub damaged: Option<String>,
    /// Whether there is a file of regions, so that a copy of what is damaged can be kept.
    pub has_database: bool,
    /// Whether the process that wrote the world last put all of it into a checkpoint.
    is_closed: bool,
    /// Whether a journal with commits is missing.
    pub has_lost_journal: bool,
    /// Why the file of regions can't be read at the moment.
    error: Option<io::Error>,
    /// The records of the file of regions. It holds each checkpoint twice, and one record of a region, but for what was
    /// salvaged from a damaged file.
    pub records: FoundRecords,
    /// The records of other files that may hold regions.
    pub others: FoundRecords,
    /// The copies of checkpoints next to the journal.
    pub copies: Vec<Checkpoint>,
    /// Records that are not valid, by region.
    pub invalid: BTreeMap<RegionPos, Vec<u8>>,
}

impl Contents {
    /// Reads all of a world's files, and changes nothing.
    pub fn read(files: &dyn Files, progress: Option<&Progress>) -> Result<Self, StoreError> {
        let numbers = segment::list(files).map_err(StoreError::files("reading the journal"))?;
        let reading = Work::until(progress, DATABASE_READ, 1);
        let source = Source::read(files, DATABASE)?;
        let has_database = !matches!(source, Source::Missing);
        let (raw, damaged, error) = database_of(source);
        reading.finish();
        let reading = Work::until(progress, FILES_READ, numbers.len() as u64);
        let mut world = world_of(&raw, true);
        let segments = read_segments(files, numbers, &mut world, &reading)?;
        let named = FoundContents::read(files, segments.iter().flat_map(|found| found.names(..)).collect());
        check_numbers(&segments)?;
        let unsaved = unsaved::read(files);
        let is_there = |first: u64| segments.iter().any(|found| found.number >= first);
        let mut contents = Self {
            world: world.unwrap_or_default(),
            damaged,
            has_database,
            is_closed: unsaved.is_none(),
            has_lost_journal: unsaved.is_some_and(|first| !is_there(first)),
            segments,
            named,
            error,
            records: FoundRecords::default(),
            others: FoundRecords::default(),
            copies: Vec::new(),
            invalid: BTreeMap::new(),
        };
        // An interrupted step may have left more.
        let is_damaged = contents.damaged.is_some();
        let others = if is_damaged { read_others(files, &mut world)? } else { Vec::new() };
        let all = || std::iter::once(&raw[..]).chain(others.iter().map(Source::records));
        match world.or_else(|| all().find_map(|records| world_of(records, false))) {
            Some(world) => contents.world = world,
            None => return Err(contents.no_world(&raw)?),
        }
        contents.enter_records(raw)?;
        contents.enter_others(others);
        contents.enter_copies(files)?;
        reading.finish();
        Ok(contents)
    }

    /// Adds the records of the file of regions.
    fn enter_records(&mut self, records: Vec<(Vec<u8>, Vec<u8>)>) -> Result<(), StoreError> {
        for (key, record) in records {
            let entered = self.records.enter(self.world, &key, record);
            let Err((error, record)) = entered else { continue };
            refuse_newer(error.newer_schema())?;
            if let Some(Key::Region(at)) = Key::of(&key) {
                self.invalid.insert(at, record);
            }
        }
        Ok(())
    }

    /// Adds the records of other files that may hold regions.
    fn enter_others(&mut self, others: Vec<Source>) {
        for (key, record) in others.into_iter().flat_map(Source::into_records) {
            let is_invalid = self.others.enter(self.world, &key, record).is_err();
            if let (true, Some(Key::Region(at))) = (is_invalid, Key::of(&key)) {
                // There was a region, whatever it held.
                self.others.regions.entry(at).or_default();
            }
        }
    }

    /// Adds the copies of checkpoints.
    fn enter_copies(&mut self, files: &dyn Files) -> Result<(), StoreError> {
        for copy in checkpoint_copy::read(files, self.world) {
            match copy {
                Ok(copy) => self.copies.extend(decode_checkpoint(&copy)),
                Err(error) => refuse_newer(error.newer_schema())?,
            }
        }
        Ok(())
    }

    /// The error if the world can't be identified.
    fn no_world(&mut self, raw: &[(Vec<u8>, Vec<u8>)]) -> Result<StoreError, StoreError> {
        let newer = |(key, record): &(Vec<u8>, Vec<u8>)| sources::check(key, record).err()?.newer_schema();
        refuse_newer(raw.iter().find_map(newer))?;
        let segment = self.segments.iter_mut().find_map(|found| found.error.take());
        Ok(match (self.error.take(), segment) {
            (Some(error), _) => StoreError::Files { doing: "reading the regions", error },
            (None, Some(error)) => StoreError::Files { doing: "reading the journal", error },
            (None, None) => StoreError::Unreadable("neither journal nor database hold a valid record".into()),
        })
    }

    /// The record of a region at a revision.
    pub fn region(&self, at: RegionPos, revision: u64) -> Option<&RegionRecord> {
        let all = [&self.records, &self.others].into_iter().filter_map(|own| own.regions.get(&at));
        all.flatten().find(|record| record.revision == revision)
    }

    /// Bytes of the regions of a checkpoint.
    pub fn bytes_of(&self, checkpoint: &Checkpoint) -> u64 {
        let records = checkpoint.regions.iter().filter_map(|(at, revision)| self.region(*at, *revision));
        records.map(|record| record.bytes() as u64).sum()
    }

    /// All frames of the journal, in the order in which they lie there.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.segments.iter().flat_map(|found| &found.frames)
    }

    /// The names of content in frames with these numbers.
    pub fn names(&self, numbers: impl RangeBounds<u64> + Clone) -> BTreeSet<ContentId> {
        self.segments.iter().flat_map(|found| found.names(numbers.clone())).collect()
    }

    /// The frames from a number on for as long as none is missing.
    pub fn frames_from(&self, first: u64) -> Vec<&Frame> {
        let mut next = first;
        let mut chain = Vec::new();
        for frame in self.frames() {
            if frame.number == next {
                chain.push(frame);
                next += 1;
            }
        }
        chain
    }

    /// Whether the frames from the first on reach this one, and all were written on this [base](segment::base).
    pub fn reaches_back(&self, frame: u64, base: u64) -> bool {
        let whole = self.frames_from(1);
        whole.last().map_or(0, |last| last.number) >= frame && whole.iter().all(|own| own.base == base)
    }

    /// The greatest number of a frame that was found, or 0.
    pub fn greatest_frame(&self) -> u64 {
        self.frames().map(|frame| frame.number).max().unwrap_or_default()
    }

    /// Whether regions are stored as they differ from a level.
    pub fn is_on_level(&self) -> bool {
        self.records
            .regions
            .values()
            .chain(self.others.regions.values())
            .flatten()
            .any(|record| record.is_change)
    }

    /// Whether what can't be read of a segment makes no difference to a world at a frame: frames that follow are part
    /// of it, or the one that began there is.
    pub fn is_harmless(&self, segment: u64, bad: &Bad, frame: u64) -> bool {
        let is_part = |own: &Frame| own.number <= frame;
        let is_after = |own: &Found, at: &Frame| {
            own.number > segment || own.number == segment && at.range.start >= bad.range.end
        };
        let mut all = self.segments.iter().flat_map(|own| own.frames.iter().map(move |at| (own, at)));
        let begins = bad.number.is_some_and(|number| (1..=frame).contains(&number));
        begins || all.any(|(own, at)| is_after(own, at) && is_part(at))
    }

    /// Refuses a world of which a file can't be read at the moment, if something may be in that file only: commits after
    /// the last frame, or what has been lost of regions.
    pub fn refuse_unread(
        &mut self,
        frame: u64,
        is_log_whole: bool,
        has_lost_regions: bool,
    ) -> Result<(), StoreError> {
        if let Some(error) = self.error.take_if(|_| !is_log_whole) {
            return Err(StoreError::Files { doing: "reading the regions", error });
        }
        let is_missed = |found: &Found| {
            let is_harmless =
                self.is_closed || found.bad.iter().all(|bad| self.is_harmless(found.number, bad, frame));
            found.error.is_some() && (has_lost_regions || !is_harmless)
        };
        let missed = self.segments.iter().position(is_missed);
        let segment = missed.and_then(|at| self.segments.get_mut(at)?.error.take());
        let names = if has_lost_regions { self.names(..) } else { self.names(frame + 1..) };
        match segment.or_else(|| self.named.take_error(&names)) {
            Some(error) => Err(StoreError::Files { doing: "reading the journal", error }),
            None => Ok(()),
        }
    }
}

/// The records of the file of regions; its fault, if it can't be used; and the error, if it can't be read at the moment.
fn database_of(source: Source) -> (Vec<(Vec<u8>, Vec<u8>)>, Option<String>, Option<io::Error>) {
    match source {
        Source::Whole(raw) => (raw, None, None),
        Source::Damaged { what, records } => (records, Some(what), None),
        Source::Missing => (Vec::new(), Some(format!("the file {DATABASE} is missing")), None),
        Source::Unreadable(error) => {
            let what = format!("the file {DATABASE} can't be read: {error}");
            (Vec::new(), Some(what), Some(error))
        }
    }
}

/// Reads the segments with these numbers. The first that names a world decides which one it is, if that is not known.
fn read_segments(
    files: &dyn Files,
    numbers: Vec<u64>,
    world: &mut Option<WorldId>,
    reading: &Work,
) -> Result<Vec<Found>, StoreError> {
    let mut segments = Vec::with_capacity(numbers.len());
    for number in numbers {
        let found = segment::read(files, *world, number);
        let found = found.map_err(StoreError::files("reading the journal"))?;
        refuse_newer(found.newer)?;
        *world = world.or(found.world);
        segments.push(found);
        reading.advance(1);
    }
    Ok(segments)
}

/// Refuses a journal whose numbers leave none for what follows.
fn check_numbers(segments: &[Found]) -> Result<(), StoreError> {
    let numbers = segments.iter().flat_map(|found| {
        let own = found.frames.iter().map(|frame| frame.number);
        own.chain((found.length > 0).then_some(found.number))
    });
    if numbers.max() > Some(MAX_NUMBER / 2) {
        return Err(StoreError::Unreadable("the numbers in its journal leave none for what follows".into()));
    }
    Ok(())
}

/// Reads other files that may hold regions. Whole ones come before what is left of others. The first that names a world
/// decides which one it is, if that is not known.
fn read_others(files: &dyn Files, world: &mut Option<WorldId>) -> Result<Vec<Source>, StoreError> {
    let mut others = Vec::new();
    for path in sources::others(files).map_err(StoreError::files("reading the regions"))? {
        if let Ok(source @ (Source::Whole(_) | Source::Damaged { .. })) = Source::read(files, &path) {
            *world = world.or_else(|| world_of(source.records(), true));
            others.push(source);
        }
    }
    others.sort_by_key(|source| matches!(source, Source::Damaged { .. }));
    Ok(others)
}

/// The world that records belong to: that of a checkpoint, or of any valid record.
fn world_of(records: &[(Vec<u8>, Vec<u8>)], is_checkpoint: bool) -> Option<WorldId> {
    let is_asked = |(key, _): &&(Vec<u8>, Vec<u8>)| keys::CHECKPOINTS.contains(&&key[..]) == is_checkpoint;
    records.iter().filter(is_asked).find_map(|(key, record)| sources::check(key, record).ok())
}

/// A checkpoint whose numbers others can follow.
pub(super) fn decode_checkpoint(payload: &[u8]) -> Option<Checkpoint> {
    let checkpoint = Checkpoint::decode(payload)?;
    let Metadata { revision, next_field, .. } = checkpoint.metadata;
    let numbers = checkpoint.regions.values().copied().chain([checkpoint.frame, revision, next_field]);
    (numbers.max() <= Some(MAX_NUMBER / 2)).then_some(checkpoint)
}

/// Refuses a world that a newer version wrote to, because data that this version can't read is not damage.
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

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::store::regions::database::{self, Records};
    use crate::store::{SimulatedDisk, Store, StoreOptions};
    use crate::terrain::{Terrain, TerrainSettings};

    /// The frame as a newer version would write it.
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

    /// The records of a disk's database.
    fn all(disk: &SimulatedDisk) -> Vec<(Vec<u8>, Vec<u8>)> {
        database::read_all(disk.read(DATABASE).unwrap()).unwrap()
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
    fn numbers_that_no_others_can_follow_are_none() {
        let ground = Arc::new(Ground::flat(64, 64, 4.0).unwrap());
        for which in ["frame", "revision", "field", "region"] {
            for number in [u64::MAX, u64::MAX - 1, MAX_NUMBER + 1] {
                let disk = world(&ground);
                let expected = {
                    let opened = Store::open_in(
                        Arc::new(disk.image().lose_process()),
                        Arc::clone(&ground),
                        StoreOptions::default(),
                    );
                    opened.unwrap().1.terrain
                };
                for (key, record) in all(&disk).into_iter().filter(|(key, _)| key.len() == 1) {
                    let world = frame::peek(&record).unwrap().world;
                    let opened = frame::open(&record, Kind::Checkpoint, world, &key, FRAME_LIMIT).unwrap();
                    let mut crafted = Checkpoint::decode(&opened.payload).unwrap();
                    match which {
                        "frame" => crafted.frame = number,
                        "revision" => crafted.metadata.revision = number,
                        "field" => crafted.metadata.next_field = number,
                        _ => crafted.regions.values_mut().for_each(|revision| *revision = number),
                    }
                    let record = frame::seal(Kind::Checkpoint, world, &key, 1, 0, &crafted.encode());
                    Records::open(&disk).unwrap().write(&[(key, Some(record))]).unwrap();
                }
                let (files, options) = (Arc::new(disk.clone()), StoreOptions::default());
                crate::store::inspect_in(&disk).unwrap();
                let (_, opened) = Store::open_in(files, Arc::clone(&ground), options).unwrap();
                assert_eq!(opened.terrain.world().hash(), expected.world().hash(), "{which} {number}");
            }
        }
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
                for (key, mut record) in all(&disk) {
                    if keys::CHECKPOINTS.contains(&&key[..]) == (which == "checkpoint") {
                        newer(&mut record);
                        Records::open(&disk).unwrap().write(&[(key, Some(record))]).unwrap();
                    }
                }
            }
            let content = |disk: &SimulatedDisk| {
                let log = disk.paths().into_iter().filter(|path| path.starts_with(segment::FOLDER));
                let log: Vec<_> = log.map(|path| (disk.read(&path).unwrap(), path)).collect();
                let is_copy = |path: &&String| path.starts_with("quarantine");
                (log, disk.paths().iter().filter(is_copy).count(), all(disk))
            };
            let before = content(&disk);
            let opened = Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), StoreOptions::default());
            if which == "nothing" {
                assert_eq!(opened.unwrap().1.replayed, 1);
                continue;
            }
            let error = opened.expect_err("it is newer");
            assert!(matches!(error, StoreError::Newer { found: 9, known: 2 }), "{which}: {error}");
            assert!(content(&disk) == before, "{which} is not as it was");
        }
    }
}
