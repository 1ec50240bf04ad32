//! Chooses the checkpoint that recovery starts from.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use super::found::{Contents, decode_checkpoint};
use crate::format::{FormatError, Metadata};
use crate::ground::Ground;
use crate::lattice::RegionPos;
use crate::store::checkpoints::Checkpoint;
use crate::store::journal::segment::Frame;
use crate::terrain::TerrainSettings;

impl Contents {
    /// The checkpoints in the journal, all of which the database had.
    fn heads(&self) -> impl Iterator<Item = Checkpoint> {
        let heads = self.segments.iter().filter_map(|found| decode_checkpoint(&found.checkpoint()?));
        heads.chain(self.copies.iter().cloned())
    }

    /// The checkpoint to start from: one from which the journal leads to the latest state that is known of, exactly if
    /// possible, with which most regions agree. It is the database's, a segment's, or that of another file if the
    /// database has none.
    pub fn choose_checkpoint(&self) -> Option<Checkpoint> {
        let heads: Vec<Checkpoint> = self.heads().collect();
        let others = if self.records.checkpoints.is_empty() { &self.others.checkpoints[..] } else { &[] };
        // A damaged database may hold a checkpoint that was never finished, and other files may be old: they say
        // nothing about what the latest state is.
        let finished = if self.damaged.is_none() { &self.records.checkpoints[..] } else { &[] };
        let known = heads.iter().chain(finished).map(|checkpoint| checkpoint.frame);
        let latest = known.chain([self.greatest_frame()]).max().unwrap_or_default();
        let runs = self.frame_runs();
        let reached = |from: u64| {
            let run = runs.range(..=from.saturating_add(1)).next_back();
            run.map_or(from, |(_, last)| from.max(*last))
        };
        // Those in a file with their regions come first: over another ground, regions have equal revisions and
        // different content.
        let all = self.records.checkpoints.iter().chain(others).chain(&heads);
        // Frames of another simulation do not lead to exactly the same world: the fewer have to be replayed, the better.
        let foreign = |checkpoint: &Checkpoint| {
            let (base, tail) = (checkpoint.base(), checkpoint.frame + 1..=reached(checkpoint.frame));
            self.frames().filter(|frame| tail.contains(&frame.number) && frame.base != base).count()
        };
        // Among equals the newest, after which least has to be replayed.
        let rank = |checkpoint: &&Checkpoint| {
            let (missing, unknown) = self.disagreeing(checkpoint);
            let lag = latest.saturating_sub(reached(checkpoint.frame));
            (lag, foreign(checkpoint), missing, unknown, Reverse(checkpoint.frame))
        };
        all.min_by_key(rank).cloned()
    }

    /// The first and the last number of frames that follow each other.
    fn frame_runs(&self) -> BTreeMap<u64, u64> {
        let numbers: BTreeSet<u64> = self.frames().map(|frame| frame.number).collect();
        let mut runs = BTreeMap::<u64, u64>::new();
        for number in numbers {
            match runs.last_entry() {
                Some(mut last) if *last.get() + 1 == number => drop(last.insert(number)),
                _ => drop(runs.insert(number, number)),
            }
        }
        runs
    }

    /// A checkpoint of all regions that were found, if no checkpoint is left: rules, the game's data and missing
    /// regions are unknown.
    pub fn assume_checkpoint(&self) -> Checkpoint {
        let mut regions = BTreeMap::new();
        for (at, records) in self.records.regions.iter().chain(&self.others.regions) {
            let latest = records.iter().map(|record| record.revision).max().unwrap_or_default();
            let known = regions.entry(*at).or_insert(latest);
            *known = latest.max(*known);
        }
        let revision = regions.values().copied().max().unwrap_or_default();
        let settings = TerrainSettings::default();
        let metadata = Metadata { settings, revision, ..Metadata::default() };
        Checkpoint { frame: 0, metadata, regions, level: None, cells: None }
    }

    /// How many regions of a checkpoint are not there as it says, and how many others are.
    fn disagreeing(&self, checkpoint: &Checkpoint) -> (usize, usize) {
        let is_missing = |(at, revision): &(&RegionPos, &u64)| self.region(**at, **revision).is_none();
        let found = self.records.regions.keys().chain(self.invalid.keys());
        let unknown: BTreeSet<_> = found.filter(|at| !checkpoint.regions.contains_key(at)).collect();
        (checkpoint.regions.iter().filter(is_missing).count(), unknown.len())
    }

    /// Whether the log leads to a checkpoint, as far as its last commit before it says: one of another branch of the
    /// same world does not.
    pub fn leads_to(&self, checkpoint: &Checkpoint) -> bool {
        let metadata = &checkpoint.metadata;
        match self.last_commit(checkpoint.frame) {
            Ok(last) => last.is_none_or(|last| last == (metadata.revision, metadata.hash)),
            Err(_) => false,
        }
    }

    /// Whether the log holds commits up to a revision.
    pub fn reaches(&self, revision: u64) -> bool {
        self.last_commit(u64::MAX).is_ok_and(|last| last.is_some_and(|(last, _)| last >= revision))
    }

    /// Revision and hash after the last commit in frames up to a number.
    fn last_commit(&self, frame: u64) -> Result<Option<(u64, u64)>, FormatError> {
        // Revisions and hashes do not depend on it.
        let any_ground = Ground::flat(1, 1, 0.0).map_err(|_| FormatError::Invalid("ground"))?;
        let mut before: Vec<&Frame> = self.frames().filter(|own| own.number <= frame).collect();
        before.sort_by_key(|own| Reverse(own.number));
        for frame in before {
            let batch = frame.batch_without_content(&any_ground)?;
            if let Some(last) = batch.commits.last() {
                return Ok(Some((last.revision, last.hash)));
            }
        }
        Ok(None)
    }
}
