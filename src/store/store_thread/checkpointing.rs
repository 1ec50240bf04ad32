//! Making checkpoints: changed regions are written in one transaction of the database, while commits continue.

use std::sync::mpsc::Receiver;
use std::time::Instant;

use super::message::Message;
use super::writer::{CHECKPOINT_TIME, Writer};
use crate::format;
use crate::format::change::put_change;
use crate::format::frame::{self, Kind};
use crate::lattice::RegionPos;
use crate::store::checkpoints::{Checkpoint, GroundSize, Mirror, checkpoint_copy};
use crate::store::error::StoreError;
use crate::store::journal::segment::FRAME_LIMIT;
use crate::store::progress::Work;
use crate::store::regions::{Region, keys};
use crate::terrain::Terrain;

/// The share of opening after which regions are encoded.
const SAVED: f32 = 0.97;

impl Writer {
    /// Makes a checkpoint, and accepts messages meanwhile.
    pub(super) fn checkpoint(&mut self, messages: Option<&Receiver<Message>>) -> Result<(), StoreError> {
        if !self.state.has_gap {
            self.flush()?;
        }
        match self.database.ready(&*self.files) {
            Ok(false) => {}
            Ok(true) => self.mirror.mark_all(),
            Err(error) => return Err(self.fail(&error.to_string())),
        }
        let (revision, frame, commits) =
            (self.mirror.revision, self.journal.last_frame(), self.state.commits);
        let point = self.point;
        let checkpoint = Checkpoint::of(&self.mirror, frame, self.metadata()).encode();
        if checkpoint.len() > FRAME_LIMIT {
            return Err(self.fail(&format!("the game's data takes more than {FRAME_LIMIT} bytes")));
        }
        let dirty = self.mirror.take_dirty();
        let positions: Vec<RegionPos> = dirty.iter().map(|(at, _)| *at).collect();
        // Later commits are in frames again.
        let had_gap = std::mem::take(&mut self.state.has_gap);
        self.state.after_gap = had_gap;
        self.state.written = None;
        self.state.changed = None;
        let mut records = self.encode_regions(dirty, messages);
        for key in keys::CHECKPOINTS {
            let sealed = frame::seal(Kind::Checkpoint, self.world, key, revision, 0, &checkpoint);
            records.push((key.to_vec(), Some(sealed)));
        }
        self.shared.begin_waiting(CHECKPOINT_TIME);
        let written = self.database.write(&*self.files, frame, &records);
        self.shared.end_waiting();
        let after_gap = std::mem::take(&mut self.state.after_gap);
        if let Err(error) = written {
            self.mirror.put_back(positions);
            self.state.changed.get_or_insert_with(Instant::now);
            if had_gap || self.state.has_gap {
                self.give_up_waiting();
            }
            return Err(self.fail(&error.to_string()));
        }
        self.state.commits -= commits.min(self.state.commits);
        self.shared.set_durable(point);
        if let (true, Some(written)) = (after_gap, self.state.written) {
            self.shared.set_durable(written);
        }
        self.checkpoints = [self.checkpoints[1], frame];
        if !self.state.has_gap {
            self.succeed();
        }
        self.trim_journal(revision, &checkpoint)
    }

    /// The records of regions, by key. Accepts messages meanwhile.
    fn encode_regions(
        &mut self,
        regions: Vec<(RegionPos, Option<Region>)>,
        messages: Option<&Receiver<Message>>,
    ) -> Vec<(Vec<u8>, Option<Vec<u8>>)> {
        let mut records = Vec::with_capacity(regions.len() + 1);
        // Only the first one is waited for, when a world is opened or created.
        let progress = self.options.progress.clone();
        let work = Work::until(progress.as_ref(), SAVED, regions.len() as u64);
        for (at, region) in regions {
            records.push((keys::region(at), region.map(|region| self.encode(at, &region))));
            work.advance(1);
            if let Some(messages) = messages {
                self.listen(messages);
            }
        }
        records
    }

    /// Copies a checkpoint next to the journal, and removes what the journal no longer needs.
    fn trim_journal(&mut self, revision: u64, checkpoint: &[u8]) -> Result<(), StoreError> {
        if self.journal.is_long(self.options.log_bytes) {
            self.begin_segment();
        }
        self.shared.begin_waiting(CHECKPOINT_TIME);
        let copied = checkpoint_copy::write(&*self.files, self.world, revision, checkpoint);
        let trimmed = self.journal.trim(self.options.log_bytes, self.checkpoints[0]);
        self.shared.end_waiting();
        copied.and(trimmed).map_err(|error| self.fail(&error.to_string()))
    }

    fn encode(&mut self, at: RegionPos, region: &Region) -> Vec<u8> {
        let ground = &self.ground;
        let hash = self.state.ground_hashes.entry(at.column());
        let hash = *hash.or_insert_with(|| ground.region_hash(at.column()));
        let (kind, payload) = match &self.mirror.level {
            Some(level) => {
                let mut payload = Vec::new();
                put_change(&mut payload, &level.difference(at, region, self.mirror.chunk_size()));
                (Kind::RegionChange, payload)
            }
            None => (Kind::Region, format::encode_region(&region.bricks, &region.fields)),
        };
        frame::seal(kind, self.world, &keys::region(at), region.revision, hash, &payload)
    }

    pub(super) fn metadata(&self) -> format::Metadata {
        let Mirror { revision, hash, next_field, edit_settings, game, .. } = &self.mirror;
        let mut game = game.iter().map(|(key, value)| (key.clone(), value.clone())).collect();
        GroundSize::of(&self.ground).put(&mut game);
        format::Metadata {
            settings: self.settings,
            revision: *revision,
            hash: *hash,
            next_field: *next_field,
            edit_settings: edit_settings.clone(),
            simulation: Terrain::SIMULATION,
            ground: self.ground.hash(),
            game,
        }
    }
}
