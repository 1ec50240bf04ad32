//! Clients that join, reconnect, or have a different world.

use std::collections::BTreeSet;
use std::ops::Bound;
use std::sync::Arc;
use std::time::Duration;

use glam::IVec3;

use super::kept::Kept;
use super::sender::Snapshot;
use super::session::{Fetch, Stage};
use super::{Server, ServerEvent};
use crate::lattice::RegionPos;
use crate::net::message::{
    ClientId, Epoch, Hello, Join, KickReason, Lane, PROTOCOL, RegionHashes, ToClient, Welcome,
};
use crate::net::regions::{region_hash, regions_of};

/// The shortest interval between answers to fetches: each one keeps a state of the world, whose index is copied once it
/// changes.
const FETCH_INTERVAL: Duration = Duration::from_millis(100);

/// How often a silent connected client is asked to greet.
const ASK_INTERVAL: Duration = Duration::from_secs(1);

/// The data in the bulk lane after a welcome.
enum Bulk {
    /// Messages that are sent as they are.
    Messages(Vec<Arc<[u8]>>),
    /// Regions of a world.
    Regions(Snapshot, Vec<RegionPos>),
}

impl Server {
    /// Handles a greeting.
    pub(super) fn greet(&mut self, client: ClientId, stream: Option<u64>, hello: Hello) {
        let world = self.terrain.world();
        let checks = [
            (hello.protocol == PROTOCOL, KickReason::Protocol),
            (hello.simulation == crate::terrain::Terrain::SIMULATION, KickReason::Simulation),
            (hello.ground == world.ground().hash(), KickReason::Ground),
            (i64::from(hello.chunk_size) == i64::from(world.grid().size()), KickReason::ChunkSize),
        ];
        if let Some((_, why)) = checks.into_iter().find(|(is_same, _)| !is_same) {
            return self.kick_for(client, why);
        }
        if let Err(reason) = (self.admission)(client) {
            return self.kick_for(client, KickReason::Refused(reason));
        }
        let Some(session) = self.sessions.get_mut(&client) else { return };
        let is_repeated = stream.is_some() && stream == session.stream;
        if is_repeated && !session.has_to_greet() {
            return;
        }
        session.begin(stream, hello, &self.settings);
        // It would be dropped there.
        self.outgoing.retain(|(to, ..)| *to != client);
    }

    /// Welcomes clients that have greeted, asks others to greet, and answers fetches.
    pub(super) fn welcome_all(&mut self, now: Duration) {
        self.flush();
        let (mut greeted, mut silent) = (Vec::new(), Vec::new());
        for (client, session) in &mut self.sessions {
            match std::mem::replace(&mut session.stage, Stage::Joined) {
                // Its earlier edits must have numbers, because the welcome acknowledges them.
                Stage::Greeted(hello)
                    if !self.later.iter().any(|later| later.is_of(*client))
                        && self.kept.as_ref().is_none_or(|kept: &Kept| {
                            kept.is_for(&hello, self.epoch.run, self.sequences.last_applied(*client))
                        })
                        && self.players.player(*client).greetings.spend(now, 1) =>
                {
                    greeted.push((*client, hello));
                }
                stage => session.stage = stage,
            }
            if session.has_to_greet() && now.saturating_sub(session.asked) >= ASK_INTERVAL {
                session.asked = now;
                silent.push(*client);
            }
        }
        for (client, hello) in greeted {
            self.welcome(client, &hello);
        }
        silent.into_iter().for_each(|client| self.send(client, &ToClient::Greet));
        if now.saturating_sub(self.fetched) >= FETCH_INTERVAL {
            self.answer_fetches(now);
        }
    }

    fn welcome(&mut self, client: ClientId, hello: &Hello) {
        let log = match hello.epoch {
            Some(epoch) if self.has_passed(epoch) => self.entries_after(epoch.number),
            Some(_) => None,
            // It has the pristine world.
            None => self.entries_after(0).filter(|_| self.is_whole),
        };
        // Old entries lead up to the last one, regions are those of a world that was kept.
        let (number, (join, bulk)) = match (log, hello.epoch) {
            (Some(log), _) => (self.epoch.number, log),
            // Whatever its state is, it needs the differences.
            (None, Some(_)) => self.compare(client),
            (None, None) => self.all_regions(hello.position),
        };
        let now = self.now;
        let welcome = Welcome {
            client,
            epoch: Epoch { number, ..self.epoch },
            sequence: self.sequences.last(client),
            reach: self.settings.reach.map(|reach| reach.allowed()),
            cost: [self.settings.cost.per_second, self.settings.cost.burst],
            left: self.players.player(client).cost.left(now),
            join,
        };
        let Some(session) = self.sessions.get_mut(&client) else { return };
        session.order = super::sender::EntrySender::new(&self.settings, number);
        match bulk {
            Bulk::Messages(messages) => messages.into_iter().for_each(|message| session.bulk.push(message)),
            Bulk::Regions(world, regions) => session.bulk.push_regions(world, &regions),
        }
        if let Some(stream) = session.stream {
            let start = ToClient::Stream { stream };
            self.send(client, &start);
            self.outgoing.push((client, Lane::Bulk, start.to_bytes()));
        }
        self.send(client, &ToClient::Welcome(welcome));
        self.report(ServerEvent::Joined(client));
    }

    /// Whether the log leads from this position to the present one: a position of this run, or of an earlier run of
    /// which everything up to it was saved.
    fn has_passed(&self, epoch: Epoch) -> bool {
        let of_this_run = (epoch.run == self.epoch.run).then_some(self.epoch.number);
        #[cfg(feature = "store")]
        let last = of_this_run.or_else(|| self.saved_log.as_ref()?.shared_with(epoch.run));
        #[cfg(not(feature = "store"))]
        let last = of_this_run;
        epoch.world == self.epoch.world && last.is_some_and(|last| epoch.number <= last)
    }

    /// The messages with all entries after a number, if the log has them and they take fewer bytes than the regions
    /// that changed since.
    fn entries_after(&mut self, number: u64) -> Option<(Join, Bulk)> {
        let messages = self.log.after(number)?;
        if !self.log.names_after(number).all(|name| self.contents.has(name)) {
            return None;
        }
        let bytes: usize = messages.iter().map(|message| message.len()).sum();
        // A few entries are sent in any case.
        if bytes > super::FULL_MESSAGE {
            let changed = self.changed.iter().filter(|(_, at)| **at > number);
            let changed: Vec<RegionPos> = match number < self.began {
                // Nothing is known of what earlier runs changed.
                true => regions_of(self.terrain.world()).into_iter().collect(),
                false => changed.map(|(region, _)| *region).collect(),
            };
            if bytes > self.encodings.estimate(&(0, self.terrain.snapshot()), &changed) {
                return None;
            }
        }
        let failed = self.failed.range(number.saturating_add(1)..).copied().collect();
        Some((Join::Log { failed }, Bulk::Messages(messages)))
    }

    /// All regions, nearest first.
    fn all_regions(&mut self, position: IVec3) -> (u64, (Join, Bulk)) {
        let (world, state) = self.keep();
        let mut regions: Vec<RegionPos> = regions_of(&world.1).into_iter().collect();
        regions.sort_by_cached_key(|region| squared_distance(*region, position));
        let join = Join::Regions { regions: regions.len() as u32, state: Box::new(state) };
        (world.0, (join, Bulk::Regions(world, regions)))
    }

    /// The table of all regions. The world is kept for the client until it continues.
    fn compare(&mut self, client: ClientId) -> (u64, (Join, Bulk)) {
        let (world, state) = self.keep();
        let table = self.table(&world);
        let number = world.0;
        if let Some(session) = self.sessions.get_mut(&client) {
            session.compared = Some(world);
        }
        (number, (Join::Compare { state: Box::new(state) }, Bulk::Messages(vec![table])))
    }

    /// The hashes of all regions of the kept world, in a message.
    fn table(&mut self, (number, world): &Snapshot) -> Arc<[u8]> {
        if let Some(table) = self.kept.as_ref().and_then(|kept| kept.table.clone()) {
            return table;
        }
        let (new, same): (BTreeSet<RegionPos>, BTreeSet<RegionPos>) = regions_of(world)
            .into_iter()
            .partition(|region| self.changed.get(region).is_some_and(|at| at > number));
        let new = new.into_iter().map(|region| (region, region_hash(world, region)));
        let mut regions: RegionHashes = self.hashes_of(same).into_iter().chain(new).collect();
        regions.sort_unstable_by_key(|(region, _)| *region);
        let table: Arc<[u8]> = ToClient::Table { number: *number, regions }.to_bytes().into();
        self.kept.iter_mut().for_each(|kept| kept.table = Some(Arc::clone(&table)));
        table
    }

    /// Answers fetches, with one world for each client at a time: those of another one wait until its regions are sent.
    fn answer_fetches(&mut self, now: Duration) {
        let is_repair = |session: &super::Session| {
            session.fetches.front().is_some_and(|fetch| {
                let number = fetch.number;
                session.compared.as_ref().is_none_or(|(own, _)| *own != number) && number <= self.applied
            })
        };
        let kept = self.sessions.values().any(is_repair).then(|| self.keep().0);
        let mut repaired = Vec::new();
        for (client, session) in &mut self.sessions {
            while let Some(Fetch { number, .. }) = session.fetches.front() {
                let compared = session.compared.as_ref().filter(|(own, _)| own == number);
                let is_repair = compared.is_none();
                // A repair waits for a world that has all that the client's has.
                let kept = kept.as_ref().filter(|(kept, _)| number <= kept);
                let Some(snapshot) = compared.or(kept).cloned() else { break };
                if !session.bulk.takes(snapshot.0) {
                    break;
                }
                let Some(fetch) = session.fetches.pop_front() else { break };
                session.bulk.push_regions(snapshot, &fetch.regions);
                self.fetched = now;
                if is_repair {
                    repaired.push((*client, fetch.regions));
                }
            }
        }
        for (client, regions) in repaired {
            self.figures.repairs += regions.len() as u64;
            self.report(ServerEvent::Repaired(client, regions));
        }
    }

    /// Sends missing entries to clients, as far as they have acknowledged earlier ones. A client whose missing entries
    /// are no longer in the log has to join again.
    pub(super) fn catch_up(&mut self) {
        for (client, session) in &mut self.sessions {
            while session.has_joined() && session.order.sent() < self.epoch.number {
                let message = match self.log.next_after(session.order.sent()) {
                    Some((last, message)) if session.order.send(last, message.len()) => message.to_vec(),
                    Some(_) => break,
                    None => {
                        (session.stage, session.asked) = (Stage::Stale, self.now);
                        ToClient::Greet.to_bytes()
                    }
                };
                self.figures.main_bytes += message.len() as u64;
                self.outgoing.push((*client, Lane::Main, message));
            }
        }
    }

    /// Sends data of the bulk lanes, within their limits. The first client for which there was no time is the first of
    /// the next call.
    pub(super) fn send_bulk(&mut self, now: Duration) {
        self.encodings.refill();
        let first = self.first_bulk;
        let turns = [(Bound::Included(first), Bound::Unbounded), (Bound::Unbounded, Bound::Excluded(first))];
        for turn in turns {
            for (client, session) in self.sessions.range_mut(turn) {
                let was_short = self.encodings.is_short();
                let bucket = &mut self.players.player(*client).bulk;
                bucket.set_rate(now, session.bulk.rate());
                while let Some(piece) = session.bulk.next_piece(bucket, now, &mut self.encodings) {
                    let message = ToClient::Piece(piece).to_bytes();
                    self.figures.bulk_bytes += message.len() as u64;
                    self.outgoing.push((*client, Lane::Bulk, message));
                }
                if self.encodings.is_short() && !was_short {
                    self.first_bulk = *client;
                }
            }
        }
    }
}

/// The distance from a position to the middle of a region.
fn squared_distance(region: RegionPos, position: IVec3) -> i128 {
    let way = region.samples().min.as_i64vec3() + i64::from(RegionPos::VOXELS / 2) - position.as_i64vec3();
    way.to_array().into_iter().map(|way| i128::from(way).pow(2)).sum()
}
