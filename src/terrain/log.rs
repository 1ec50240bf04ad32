//! The commit log: records of commits that wait to be taken, within a bound of bytes.

use std::collections::VecDeque;
use std::sync::Arc;

use super::change::brick_bytes;
use super::loose::LooseSettings;
use super::model::Terrain;
use super::receipt::Receipt;
use super::record::{CommitRecord, LogEntry, WorldChange};
use super::transaction::Work;
use super::world::World;
use crate::brush::Edit;
use crate::volume::DiggingRules;

/// Rules and settings of loose pieces.
type Terms = (Option<Arc<DiggingRules>>, Option<LooseSettings>);

/// Records that wait to be taken.
pub(super) struct CommitLog {
    records: VecDeque<CommitRecord>,
    bytes: usize,
    limit: usize,
    /// The terms that hold after the last record; `None` at first.
    terms: Option<Terms>,
}

impl CommitLog {
    fn new(limit: usize) -> Self {
        Self { records: VecDeque::new(), bytes: 0, limit, terms: None }
    }

    /// Enters a commit that led to this world.
    pub fn enter(&mut self, world: &World, work: &Work, receipts: &[Receipt], mut change: WorldChange) {
        change.next_field = world.next_field;
        let mut entries = Vec::new();
        match work {
            Work::Edits(submissions) => {
                entries.reserve_exact(submissions.len());
                for (submission, receipt) in submissions.iter().zip(receipts) {
                    let (Ok(edit), Ok(_)) = (&submission.edit, &receipt.outcome) else { continue };
                    let terms = (submission.terms.rules.clone(), submission.terms.loose);
                    self.enter_terms(terms, &mut entries);
                    entries.push(LogEntry::Edit(edit.clone()));
                }
            }
            Work::Step(..) | Work::Put(_) => entries.push(LogEntry::Change),
            Work::Cut(_) => return,
        }
        self.push(CommitRecord { revision: world.revision(), hash: world.hash(), entries, change });
    }

    /// Enters that these terms hold from now on, if others did.
    fn enter_terms(&mut self, terms: Terms, entries: &mut Vec<LogEntry>) {
        let before = self.terms.as_ref();
        if before.is_none_or(|(rules, _)| *rules != terms.0) {
            entries.push(LogEntry::Rules(terms.0.clone()));
        }
        if before.is_none_or(|(_, loose)| *loose != terms.1) {
            entries.push(LogEntry::Loose(terms.1));
        }
        self.terms = Some(terms);
    }

    fn push(&mut self, record: CommitRecord) {
        self.bytes += bytes_of(&record);
        self.records.push_back(record);
        while self.bytes > self.limit {
            let Some(oldest) = self.records.pop_front() else { break };
            self.bytes -= bytes_of(&oldest);
        }
    }
}

/// Bytes that a record may hold alone.
fn bytes_of(record: &CommitRecord) -> usize {
    let CommitRecord { entries, change, .. } = record;
    let bricks = change.bricks.iter().flat_map(|(_, brick)| brick).map(|brick| brick_bytes(brick));
    let fields = change.fields.iter().map(|(_, fields)| fields.bytes());
    size_of::<CommitRecord>()
        + entries.capacity() * size_of::<LogEntry>()
        + entries.iter().filter(|entry| matches!(entry, LogEntry::Edit(_))).count() * size_of::<Edit>()
        + size_of_val(&change.bricks[..])
        + size_of_val(&change.fields[..])
        + bricks.chain(fields).sum::<usize>()
}

impl Terrain {
    /// From now on a record of each commit is kept until it is [taken](Self::take_log); `None` keeps none and drops those that
    /// wait. Once they hold more than so many bytes, the oldest are dropped: whoever finds a gap between
    /// [revisions](CommitRecord::revision) has to read [all of the world](Self::parts).
    ///
    /// Rules and settings of loose pieces are told with the first edit that obeys them, or once nothing waits.
    pub fn keep_log(&mut self, bytes: Option<usize>) {
        match (&mut self.log, bytes) {
            (Some(log), Some(limit)) => log.limit = limit,
            (log, limit) => {
                *log = limit.map(CommitLog::new);
                // Its commit would hold no record.
                self.abandon();
            }
        }
        self.log_terms();
    }

    /// The records of the commits since the last call, in order; each is returned once.
    pub fn take_log(&mut self) -> Vec<CommitRecord> {
        let Some(log) = &mut self.log else { return Vec::new() };
        log.bytes = 0;
        std::mem::take(&mut log.records).into()
    }

    /// Is there any record to [take](Self::take_log)?
    pub fn has_log(&self) -> bool {
        self.log.as_ref().is_some_and(|log| !log.records.is_empty())
    }

    /// Enters the terms of later edits into the log, unless edits wait that obey others.
    pub(super) fn log_terms(&mut self) {
        if self.is_busy() || self.queue.len() > 0 {
            return;
        }
        let Some(log) = &mut self.log else { return };
        let mut entries = Vec::new();
        log.enter_terms((self.rules.clone(), self.loose), &mut entries);
        if !entries.is_empty() {
            let (revision, hash) = (self.world.revision(), self.world.hash());
            let change = WorldChange { next_field: self.world.next_field, ..WorldChange::default() };
            log.push(CommitRecord { revision, hash, entries, change });
        }
    }
}
