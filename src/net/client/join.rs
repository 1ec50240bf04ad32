//! Joining: catching up with the server.

use std::collections::{BTreeMap, BTreeSet};

use glam::IVec3;

use super::super::message::{
    Join, MAX_REGIONS, MAX_SEQUENCE_JUMP, RegionContent, RegionHashes, RuleState, ToServer, Welcome,
};
use super::super::regions::{region_hash, regions_of};
use super::outbox::Outbox;
use super::{Client, ClientEvent, MAX_NUMBER};
use crate::brush::Edit;
use crate::lattice::RegionPos;
use crate::terrain::Patch;

/// The progress of a join.
pub(super) enum Stage {
    /// There is no connection.
    Disconnected,
    /// The client has greeted and waits for its welcome.
    AwaitingWelcome,
    /// Old entries arrive, up to the number `to`. The server has seen edits of this client up to the
    /// number `sequence`.
    ByLog { to: u64, sequence: u64 },
    /// Regions at the number `to` arrive; `left` more are missing.
    ByRegions { to: u64, left: usize },
    /// The table of regions at a number arrives.
    ByTable { to: u64 },
    /// The client follows the log.
    Following,
}

impl Client {
    /// The server has welcomed it.
    pub(super) fn begin(&mut self, welcome: Welcome) {
        let Welcome { client, epoch, sequence, reach, cost, left, join } = welcome;
        if !matches!(self.stage, Stage::AwaitingWelcome) || sequence.max(epoch.number) > MAX_NUMBER {
            self.figures.malformed += 1;
            return;
        }
        self.outbox = Outbox::new(cost, left, self.now);
        self.wanted.clear();
        self.repair = None;
        self.hash_checks.clear();
        if self.epoch.is_none_or(|known| known.run != epoch.run || known.world != epoch.world) {
            self.waiting.clear();
        }
        self.id = Some(client);
        self.received = epoch.number;
        self.next_sequence = self.next_sequence.max(sequence.saturating_add(1));
        // Another world's server has seen nothing of this client, although it may know its player.
        let is_known = self.epoch.is_some_and(|known| known.world == epoch.world);
        let seen = if is_known { sequence.min(self.sent) } else { 0 };
        self.sent = seen;
        self.renumber(sequence, seen);
        // Undos are not sent again: by now they would be of other strokes.
        for _ in self.undos.split_off(&seen.saturating_add(1)) {
            self.events.push(ClientEvent::UndoRefused(None));
        }
        let to = epoch.number;
        self.is_part = !matches!(join, Join::Log { .. });
        self.failed.clear();
        // Until the join is finished, it keeps its old world.
        let known = self.epoch.map_or(0, |known| known.number);
        match join {
            Join::Log { failed } => {
                self.failed.extend(failed);
                self.epoch = Some(super::Epoch { number: known, ..epoch });
                self.stage = Stage::ByLog { to, sequence };
            }
            Join::Regions { regions, state } => {
                self.epoch = Some(super::Epoch { number: to, ..epoch });
                self.waiting.retain(|number, _| *number > to);
                self.restart(&state, false, sequence);
                self.stage = Stage::ByRegions { to, left: regions as usize };
            }
            Join::Compare { state } => {
                self.epoch = Some(super::Epoch { number: to, ..epoch });
                self.waiting.retain(|number, _| *number > to);
                self.restart(&state, true, sequence);
                self.stage = Stage::ByTable { to };
            }
        }
        self.events.push(ClientEvent::Welcomed { client, reach });
        self.send_again(sequence);
        self.finish_log();
        self.finish_regions();
    }

    /// Continues from another position of the log.
    fn restart(&mut self, state: &RuleState, keeps_world: bool, sequence: u64) {
        if self.replica.restart(state, keeps_world).is_err() {
            self.figures.malformed += 1;
        }
        // The answers to these were sent while the client was disconnected; if they were applied, the world contains
        // them.
        let edit = |tag| ClientEvent::Confirmed { tag, receipt: None };
        self.settle(sequence, edit, || ClientEvent::Undone(None));
    }

    /// Removes pending edits and undos up to a number, and reports an event for each, of an edit with its tag.
    fn settle(&mut self, sequence: u64, edit: impl Fn(u64) -> ClientEvent, undo: impl Fn() -> ClientEvent) {
        let numbers = self.replica.pending().map(|(number, _)| number);
        let answered: Vec<u64> = numbers.filter(|number| *number <= sequence).collect();
        answered.iter().for_each(|number| self.settle_pieces(*number));
        let edits = answered.into_iter().filter_map(|number| self.replica.take_back(number));
        self.events.extend(edits.map(|own| edit(own.tag())));
        let later = self.undos.split_off(&sequence.saturating_add(1));
        let undos = std::mem::replace(&mut self.undos, later);
        self.events.extend(undos.iter().map(|_| undo()));
    }

    /// Sends edits that the server has not seen, and those from before the first welcome.
    fn send_again(&mut self, sequence: u64) {
        let pending = self.replica.pending().filter(|(number, _)| *number > sequence);
        let pending: Vec<(u64, Edit)> = pending.map(|(number, edit)| (number, edit.clone())).collect();
        pending.into_iter().for_each(|(number, edit)| self.send_edit(number, edit));
        std::mem::take(&mut self.early).into_iter().for_each(|edit| self.submit(edit));
    }

    /// Gives edits that the server has not seen numbers that it accepts. It has seen no edit of this client beyond
    /// `seen`, but possibly greater numbers of the same player's earlier client. A restored server may also have seen
    /// less than the one before it, so that pending numbers exceed its last one by too much.
    fn renumber(&mut self, sequence: u64, seen: u64) {
        let mut last = sequence;
        let mut unseen =
            self.replica.pending().map(|(number, _)| number).filter(|number| *number > seen).peekable();
        let is_taken = unseen.peek().is_some_and(|number| *number <= sequence);
        let is_far = unseen.chain([self.next_sequence]).any(|number| {
            let jump = number.saturating_sub(last);
            last = number;
            jump > MAX_SEQUENCE_JUMP / 2
        });
        if is_taken || is_far {
            let reported = self
                .replica
                .pending()
                .filter(|(number, _)| (seen + 1..=self.reported).contains(number))
                .count();
            self.reported = sequence + reported as u64;
            let before: Vec<u64> = self.replica.pending().map(|(number, _)| number).collect();
            self.next_sequence = self.replica.renumber(seen, sequence);
            let after = self.replica.pending().map(|(number, _)| number);
            self.pieces.renumber(before.into_iter().zip(after));
        }
    }

    /// Finishes the join if all old entries are applied.
    pub(super) fn finish_log(&mut self) {
        if let Stage::ByLog { to, sequence } = self.stage
            && self.number() >= to
        {
            // They were refused while the client was away.
            let edit = |tag| ClientEvent::Refused { tag, why: None };
            self.settle(sequence, edit, || ClientEvent::UndoRefused(None));
            self.follow_from_now();
        }
    }

    /// Finishes the join if all regions have arrived.
    fn finish_regions(&mut self) {
        if let Stage::ByRegions { left: 0, .. } = self.stage {
            self.follow_from_now();
        }
    }

    fn follow_from_now(&mut self) {
        self.stage = Stage::Following;
        self.is_part = false;
        self.check_pieces(None, &BTreeSet::new());
        if !self.is_playable {
            self.is_playable = true;
            self.events.push(ClientEvent::Playable);
        }
        self.events.push(ClientEvent::Joined);
    }

    /// Handles the table of all regions: regions that differ are fetched, and regions that the server lacks become
    /// pristine.
    pub(super) fn take_table(&mut self, number: u64, regions: &RegionHashes) {
        let Stage::ByTable { to } = self.stage else { return };
        if number != to {
            return;
        }
        let world = self.replica.world();
        let theirs: BTreeMap<RegionPos, u64> = regions.iter().copied().collect();
        // Regions of ours that the server has not may share chunks with others, so they are fetched too.
        let all: BTreeSet<RegionPos> = regions_of(world).into_iter().chain(theirs.keys().copied()).collect();
        let differs = |region: &RegionPos| {
            region_hash(world, *region) != theirs.get(region).copied().unwrap_or_default()
        };
        let mut wanted: Vec<RegionPos> = all.into_iter().filter(differs).collect();
        wanted.sort_by_key(|region| distance(*region, self.position));
        self.stage = Stage::ByRegions { to, left: wanted.len() };
        self.wanted = wanted.into();
        self.fetch_more();
        self.finish_regions();
    }

    /// Requests more of the regions that differ, once most of the requested ones have arrived.
    fn fetch_more(&mut self) {
        let Stage::ByRegions { to, left } = self.stage else { return };
        let awaited = left.saturating_sub(self.wanted.len());
        if !self.wanted.is_empty() && awaited <= MAX_REGIONS / 2 {
            let count = self.wanted.len().min(MAX_REGIONS);
            let regions = self.wanted.drain(..count).collect();
            self.outgoing.push(ToServer::Fetch { number: to, regions }.to_bytes());
        }
    }

    fn put(&mut self, change: Patch) {
        if self.replica.put(change).is_err() {
            self.figures.malformed += 1;
        }
    }

    /// Handles a region that it waits for.
    pub(super) fn take_region(&mut self, content: RegionContent) {
        if let Some(repair) = &mut self.repair {
            repair.add(content);
            return;
        }
        let Stage::ByRegions { to, left } = self.stage else { return };
        if content.number != to || left == 0 {
            return;
        }
        if distance(content.pos, self.position) > i64::from(self.near) && !self.is_playable {
            self.is_playable = true;
            self.events.push(ClientEvent::Playable);
        }
        let next_field = content.next_field;
        self.put_region(content);
        if left == 1 {
            self.lower_names(next_field);
        }
        self.stage = Stage::ByRegions { to, left: left - 1 };
        self.fetch_more();
        self.finish_regions();
    }

    /// Makes later fields have the same names as on the server.
    pub(super) fn lower_names(&mut self, next_field: u64) {
        if self.replica.world().next_field() > next_field {
            let state = RuleState { next_field, ..self.replica.rule_state() };
            self.figures.malformed += u64::from(self.replica.restart(&state, true).is_err());
        }
    }

    pub(super) fn put_region(&mut self, content: RegionContent) {
        let RegionContent { pos, next_field, bricks, fields, .. } = content;
        let change = self.replica.region_change(pos, bricks, fields, next_field);
        self.put(change);
    }
}

/// The distance from a position to a region along the axis on which it is farthest, in voxels.
fn distance(region: RegionPos, position: IVec3) -> i64 {
    let samples = region.samples();
    let (low, high) = (samples.min.as_i64vec3(), samples.max.as_i64vec3());
    let position = position.as_i64vec3();
    (low - position).max(position - high).max_element().max(0)
}
