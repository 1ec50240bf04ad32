//! Writes the journal: frames in segments, of which the oldest are removed beyond a limit of bytes.

use std::collections::{BTreeSet, VecDeque};
use std::io;
use std::sync::Arc;

use super::contents;
use super::segment::{self, FOLDER};
use super::unsaved;
use crate::format::Batch;
use crate::format::contents::ContentTable;
use crate::format::frame::WorldId;
use crate::format::ids::ContentId;
use crate::store::files::{Files, OpenFile, Opening};

/// The most bytes of a segment. Whole segments are removed, so the log is cut in steps of this.
const SEGMENT_BYTES: u64 = 1 << 20;

/// The least number of segments of a log of full length.
const LEAST_SEGMENTS: u64 = 16;

/// A frame that is not durable yet.
#[derive(Debug)]
struct Waiting {
    frame: u64,
    entry: Vec<u8>,
    /// The content that it names.
    contents: ContentTable,
}

/// The segment that is written.
#[derive(Debug)]
struct Current {
    number: u64,
    file: Box<dyn OpenFile>,
    end: u64,
    /// Whether no frame in it is durable yet.
    is_fresh: bool,
}

/// A segment on the disk.
#[derive(Clone, Debug)]
pub(in crate::store) struct Segment {
    pub number: u64,
    /// The greatest number of its frames, 0 if it has none.
    pub last_frame: u64,
    pub bytes: u64,
    /// The names of content in its frames.
    pub names: BTreeSet<ContentId>,
}

/// The journal as it is written.
#[derive(Debug)]
pub(in crate::store) struct Journal {
    files: Arc<dyn Files>,
    world: WorldId,
    /// The [base](segment::base) of its frames.
    base: u64,
    current: Option<Current>,
    waiting: VecDeque<Waiting>,
    waiting_bytes: usize,
    segments: Vec<Segment>,
    /// The content that this process has made durable.
    written: BTreeSet<ContentId>,
    /// Other content that stays.
    kept: BTreeSet<ContentId>,
    next_frame: u64,
    next_segment: u64,
    /// The head of the next segment: a revision and its checkpoint.
    head: (u64, Vec<u8>),
    /// Whether the marker of unsaved commits was written.
    is_entered: bool,
}

impl Journal {
    /// Continues after these segments with this frame. The next segment begins with a checkpoint.
    pub fn new(
        files: Arc<dyn Files>,
        world: WorldId,
        base: u64,
        segments: Vec<Segment>,
        next_frame: u64,
    ) -> Self {
        let next_segment = segments.last().map_or(1, |last| last.number + 1);
        let (current, waiting) = (None, VecDeque::new());
        Self {
            files,
            world,
            base,
            current,
            waiting,
            waiting_bytes: 0,
            segments,
            written: BTreeSet::new(),
            kept: BTreeSet::new(),
            next_frame,
            next_segment,
            head: (0, Vec::new()),
            is_entered: false,
        }
    }

    /// The [base](segment::base) of later frames.
    pub fn set_base(&mut self, base: u64) {
        self.base = base;
    }

    /// Keeps the content of these names, whether or not a frame of this journal names it.
    pub fn keep_content(&mut self, names: BTreeSet<ContentId>) {
        self.kept = names;
    }

    /// The number of the last frame.
    pub fn last_frame(&self) -> u64 {
        self.next_frame - 1
    }

    /// Bytes of frames that are not durable yet.
    pub fn waiting_bytes(&self) -> usize {
        self.waiting_bytes
    }

    /// Adds a frame; it is durable after the next successful [`write`](Self::write).
    pub fn push(&mut self, revision: u64, batch: &Batch, payload: &[u8]) {
        let frame = self.next_frame;
        self.next_frame += 1;
        let contents = batch.table();
        let entry = match contents.names().is_empty() {
            true => segment::entry(self.world, self.base, frame, revision, payload),
            false => segment::named_entry(self.world, self.base, frame, revision, payload),
        };
        self.waiting_bytes += entry.len();
        self.waiting.push_back(Waiting { frame, entry, contents });
    }

    /// Drops the frames that are not durable yet, and leaves a gap in their numbers.
    pub fn drop_waiting(&mut self) {
        self.waiting.clear();
        self.waiting_bytes = 0;
        self.next_frame += 1;
    }

    /// Makes all frames durable.
    pub fn write(&mut self) -> io::Result<()> {
        let Some(last) = self.waiting.back() else { return Ok(()) };
        let written = self.write_waiting(last.frame);
        if written.is_err() {
            // Nothing is known of what it holds: all goes into another one.
            if let Some(current) = self.current.take().filter(|current| current.is_fresh) {
                // It may stay, as frames that come twice are harmless.
                drop(self.files.remove(&segment::path(current.number)));
            }
            return written;
        }
        self.waiting.clear();
        self.waiting_bytes = 0;
        Ok(())
    }

    /// Whether any segment is on the disk.
    pub fn has_segments(&self) -> bool {
        !self.segments.is_empty()
    }

    /// Whether the present segment has reached its full length in a log limited to `log_bytes`.
    pub fn is_long(&self, log_bytes: u64) -> bool {
        let most = SEGMENT_BYTES.min(log_bytes / LEAST_SEGMENTS);
        self.current.as_ref().is_some_and(|current| current.end >= most)
    }

    fn write_waiting(&mut self, last_frame: u64) -> io::Result<()> {
        let is_there = |files: &dyn Files, current: &Current| files.exists(&segment::path(current.number));
        if let Some(current) = &self.current
            && !is_there(&*self.files, current)?
        {
            return Err(io::Error::new(io::ErrorKind::NotFound, "the journal's file has been removed"));
        }
        for waiting in &self.waiting {
            contents::write(&*self.files, &waiting.contents, &mut self.written)?;
        }
        let current = match &mut self.current {
            Some(current) => current,
            none => none.insert(begin(&*self.files, self.world, &mut self.next_segment, &self.head)?),
        };
        let (number, start) = (current.number, current.end);
        let bytes: Vec<u8> = self.waiting.iter().flat_map(|waiting| &waiting.entry).copied().collect();
        current.file.write_at(start, &bytes)?;
        current.file.sync()?;
        if current.is_fresh {
            self.files.sync_folder(FOLDER)?;
            current.is_fresh = false;
            // It is needed once.
            self.head.1 = Vec::new();
        }
        if !self.is_entered {
            unsaved::enter(&*self.files, number)?;
            self.is_entered = true;
        }
        current.end = start + bytes.len() as u64;
        let names = self.waiting.iter().flat_map(|waiting| waiting.contents.names());
        match self.segments.last_mut().filter(|last| last.number == number) {
            Some(last) => {
                (last.last_frame, last.bytes) = (last_frame, current.end);
                last.names.extend(names);
            }
            None => {
                self.segments.push(Segment { number, last_frame, bytes: current.end, names: names.collect() })
            }
        }
        Ok(())
    }

    /// Makes the next frame begin a segment, whose head is this checkpoint of a revision.
    pub fn begin_segment(&mut self, revision: u64, checkpoint: Vec<u8>) {
        self.current = None;
        self.head = (revision, checkpoint);
    }

    /// Removes the oldest segments until the rest takes at most `bytes` on the disk, but none with frames after
    /// `needed`.
    pub fn trim(&mut self, bytes: u64, needed: u64) -> io::Result<()> {
        let mut total: u64 = self.segments.iter().map(|segment| segment::on_disk(segment.bytes)).sum();
        let own = self.current.as_ref().map(|current| current.number);
        // One stays, so that the removal of a journal is detected.
        while let [oldest, _, ..] = &self.segments[..] {
            if total <= bytes || oldest.last_frame > needed || own == Some(oldest.number) {
                break;
            }
            match self.files.remove(&segment::path(oldest.number)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
            total -= segment::on_disk(oldest.bytes);
            self.segments.remove(0);
        }
        let mut needed = self.kept.clone();
        needed.extend(self.segments.iter().flat_map(|own| &own.names));
        needed.extend(self.waiting.iter().flat_map(|waiting| waiting.contents.names()));
        contents::retain(&*self.files, &needed, &mut self.written)
    }
}

/// Creates a segment and writes its head; the number that it gets is counted up.
fn begin(
    files: &dyn Files,
    world: WorldId,
    next_segment: &mut u64,
    (revision, checkpoint): &(u64, Vec<u8>),
) -> io::Result<Current> {
    files.create_folder(FOLDER)?;
    let (number, file) = loop {
        let number = *next_segment;
        *next_segment += 1;
        match files.open(&segment::path(number), Opening::New) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            file => break (number, file?),
        }
    };
    let head = segment::head(world, number, *revision, checkpoint);
    if let Err(error) = file.write_at(0, &head) {
        drop(files.remove(&segment::path(number)));
        return Err(error);
    }
    Ok(Current { number, file, end: head.len() as u64, is_fresh: true })
}
