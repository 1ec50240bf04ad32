//! The simplest client: it applies the log, predicts nothing, and fetches regions that differ. Tests of the server
//! use it.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::lattice::{BrickPos, ChunkPos, RegionPos};
use bevy_burrow::net::{
    BulkReader, ClientId, ContentTable, Entries, Entry, Epoch, Hello, Join, KickReason, Lane, Refusal,
    RegionContent, RegionHashes, RuleState, Server, ToClient, ToServer, Welcome, region_hash,
    touched_regions,
};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{EditSettings, Meshing, Patch};
use bevy_burrow::volume::Fields;
use fastrand::Rng;
use glam::IVec3;

use crate::load::wavy;
use crate::worlds::random_strata;

/// A frame of the tests.
pub const FRAME: Duration = Duration::from_millis(50);

/// A count from the environment, or the default.
pub fn count(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|count| count.parse().ok()).unwrap_or(default)
}

pub use crate::load::hills;

/// Hills with strata.
pub fn layered_hills(side: u32) -> Arc<Ground> {
    let strata = random_strata(&mut Rng::with_seed(6), [-10.0, 25.0]);
    Arc::new(wavy(side).with_strata(&strata).expect("valid strata"))
}

/// A terrain without meshes.
pub fn terrain(ground: &Arc<Ground>) -> Terrain {
    let mut terrain = Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
    terrain.set_meshing(Meshing::Never);
    terrain.set_undo_budget(0);
    terrain
}

/// A client that applies the log.
pub struct Follower {
    pub id: ClientId,
    ground: Arc<Ground>,
    pub contents: ContentTable,
    pub terrain: Terrain,
    pub epoch: Option<Epoch>,
    /// The number of the last applied entry.
    pub number: u64,
    /// The number that the last welcome led to. Hash checks up to it were compared with others.
    joined_at: u64,
    pub last_sequence: u64,
    pub position: IVec3,
    /// Messages to send.
    pub out: Vec<ToServer>,
    /// Received entries that can't be applied yet.
    waiting: VecDeque<(u64, Entry)>,
    /// Regions that are awaited; nothing is applied meanwhile.
    awaited: BTreeSet<RegionPos>,
    /// Whether the awaited regions are those of a join.
    is_joining: bool,
    /// Regions that arrived for a number that is not reached yet.
    regions: Vec<RegionContent>,
    table: Option<Box<RuleState>>,
    touched: BTreeSet<RegionPos>,
    /// Hashes of the regions touched before each hash check, until the server's hashes arrive.
    hash_checks: BTreeMap<u64, BTreeMap<RegionPos, u64>>,
    hashes: VecDeque<(u64, RegionHashes)>,
    bulk: BulkReader,
    bulk_told: u64,
    pub refused: Vec<(u64, Refusal)>,
    pub failed: Vec<u64>,
    pub durable: u64,
    pub kicked: Option<KickReason>,
    /// How it joined, each time.
    pub joins: Vec<&'static str>,
    /// Regions that differed and were fetched.
    pub repairs: usize,
    /// Numbers of its own edits and undos that were confirmed.
    pub confirmed: Vec<u64>,
    /// Received bytes, by lane.
    pub bytes: [u64; 2],
}

impl Follower {
    pub fn new(id: u64, ground: &Arc<Ground>) -> Self {
        Self {
            id: ClientId(id),
            ground: Arc::clone(ground),
            contents: ContentTable::default(),
            terrain: terrain(ground),
            epoch: None,
            number: 0,
            joined_at: 0,
            last_sequence: 0,
            position: IVec3::ZERO,
            out: Vec::new(),
            waiting: VecDeque::new(),
            awaited: BTreeSet::new(),
            is_joining: false,
            regions: Vec::new(),
            table: None,
            touched: BTreeSet::new(),
            hash_checks: BTreeMap::new(),
            hashes: VecDeque::new(),
            bulk: BulkReader::default(),
            bulk_told: 0,
            refused: Vec::new(),
            failed: Vec::new(),
            durable: 0,
            kicked: None,
            joins: Vec::new(),
            repairs: 0,
            confirmed: Vec::new(),
            bytes: [0; 2],
        }
    }

    pub fn hello(&self) -> Hello {
        Hello {
            protocol: Server::PROTOCOL,
            simulation: Terrain::SIMULATION,
            ground: self.ground.hash(),
            chunk_size: 32,
            epoch: self.epoch.map(|epoch| Epoch { number: self.number, ..epoch }),
            position: self.position,
        }
    }

    /// A new connection.
    pub fn connect(&mut self, server: &mut Server, now: Duration) {
        server.connect(self.id, now);
        (self.bulk, self.bulk_told, self.is_joining) = (BulkReader::default(), 0, true);
        self.out = vec![ToServer::Hello(self.hello())];
    }

    pub fn edit(&mut self, brushes: impl IntoIterator<Item = Brush>) {
        let edits: Vec<Edit> =
            brushes.into_iter().map(|brush| Edit::quantize(&brush).expect("a valid brush")).collect();
        let first = self.last_sequence + 1;
        self.last_sequence += edits.len() as u64;
        self.out.push(ToServer::Edits { first, edits });
    }

    pub fn undo(&mut self, of: u64) -> u64 {
        self.last_sequence += 1;
        self.out.push(ToServer::Undo { sequence: self.last_sequence, of: ClientId(of) });
        self.last_sequence
    }

    /// Sends its messages.
    pub fn send(&mut self, server: &mut Server, now: Duration) {
        if self.bulk.received() != self.bulk_told {
            self.bulk_told = self.bulk.received();
            self.out.push(ToServer::Ack { bulk: self.bulk_told, number: self.number });
        }
        for message in std::mem::take(&mut self.out) {
            server.receive(self.id, &message.to_bytes(), now);
        }
    }

    pub fn receive(&mut self, lane: Lane, bytes: &[u8]) {
        self.bytes[(lane == Lane::Bulk) as usize] += bytes.len() as u64;
        let message = ToClient::from_bytes(bytes, &self.ground, &self.contents).expect("a valid message");
        assert_eq!(matches!(message, ToClient::Piece(_)), lane == Lane::Bulk);
        self.take(message);
        while let Some(message) = self.bulk.next(&self.ground, &self.contents).expect("a valid stream") {
            self.take(message);
        }
        self.go_on();
    }

    fn take(&mut self, message: ToClient) {
        match message {
            ToClient::Welcome(welcome) => self.begin(welcome),
            ToClient::Kicked(why) => self.kicked = Some(why),
            ToClient::Entries(Entries { first, entries }) => {
                self.waiting.extend((first..).zip(entries));
                // Old entries arrive in the other lane.
                self.waiting.make_contiguous().sort_by_key(|(number, _)| *number);
            }
            ToClient::Failed { number } => self.failed.push(number),
            ToClient::Refused { sequence, why } => self.refused.push((sequence, why)),
            ToClient::Hashes { number, regions } => self.hashes.push_back((number, regions)),
            ToClient::Table { regions, .. } => self.compare(&regions),
            ToClient::Region(content) => self.regions.push(content),
            ToClient::Durable { number } => self.durable = number,
            ToClient::Piece(piece) => self.bulk.add(&piece),
            other => panic!("unknown: {other:?}"),
        }
    }

    fn begin(&mut self, welcome: Welcome) {
        assert_eq!(welcome.client, self.id);
        self.last_sequence = self.last_sequence.max(welcome.sequence);
        self.epoch = Some(welcome.epoch);
        self.joined_at = welcome.epoch.number;
        self.waiting.clear();
        self.hash_checks.clear();
        self.hashes.clear();
        self.touched.clear();
        self.awaited.clear();
        self.regions.clear();
        let state = match welcome.join {
            Join::Log { failed } => {
                assert!(failed.is_empty());
                self.joins.push("log");
                self.is_joining = false;
                return;
            }
            Join::Regions { regions, state } => {
                self.joins.push("regions");
                self.terrain = terrain(&self.ground);
                self.is_joining = regions > 0;
                state
            }
            Join::Compare { state } => {
                self.joins.push("compare");
                self.table = Some(state.clone());
                state
            }
        };
        self.number = welcome.epoch.number;
        let EditSettings { rules, loose } = state.edit_settings;
        let rules = rules.as_deref().cloned().unwrap_or_default();
        self.terrain.set_rules(rules).expect("valid rules");
        self.terrain.set_loose(loose);
    }

    fn compare(&mut self, regions: &RegionHashes) {
        let world = self.terrain.world();
        let table: BTreeMap<RegionPos, u64> = regions.iter().copied().collect();
        // Also those with fields alone.
        let fields = world.fields().flat_map(|(_, fields)| fields.iter());
        let fields = fields.map(|field| RegionPos::of(BrickPos::of(field.bounds.min)));
        let all: BTreeSet<RegionPos> = world.regions().chain(fields).chain(table.keys().copied()).collect();
        let differs = |at: &RegionPos| region_hash(world, *at) != table.get(at).copied().unwrap_or(0);
        self.awaited = all.into_iter().filter(differs).collect();
        self.is_joining = false;
        if !self.awaited.is_empty() {
            let regions = self.awaited.iter().copied().collect();
            self.out.push(ToServer::Fetch { number: self.number, regions });
        } else if let Some(state) = self.table.take() {
            self.set_names(state.next_field);
        }
    }

    fn go_on(&mut self) {
        loop {
            if self.is_joining {
                // Regions arrive in order; the last one ends the join.
                for content in std::mem::take(&mut self.regions) {
                    self.is_joining &= content.left > 0;
                    self.put(&content);
                }
                if self.is_joining {
                    return;
                }
            }
            self.check_hashes();
            let target = if self.awaited.is_empty() {
                u64::MAX
            } else {
                match self.regions.first() {
                    Some(content) if self.regions.len() == self.awaited.len() => content.number,
                    _ => return,
                }
            };
            if self.number >= target {
                assert_eq!(self.number, target, "a region of the past");
                let regions = std::mem::take(&mut self.regions);
                regions.iter().for_each(|content| self.put(content));
                self.awaited.clear();
                regions.iter().take(1).for_each(|content| self.set_names(content.next_field));
                continue;
            }
            match self.waiting.front() {
                Some((number, _)) if *number <= self.number => drop(self.waiting.pop_front()),
                Some((number, _)) if *number == self.number + 1 => {
                    if let Some((number, entry)) = self.waiting.pop_front() {
                        self.number = number;
                        self.apply(entry);
                    }
                }
                _ => return,
            }
        }
    }

    /// Applies an entry.
    fn apply(&mut self, entry: Entry) {
        match entry {
            Entry::Order { by, order } => {
                self.confirmed.extend(by.filter(|(by, _)| *by == self.id).map(|(_, sequence)| sequence));
                self.terrain.submit(order);
            }
            Entry::HashCheck => {
                let world = self.terrain.world();
                let touched = std::mem::take(&mut self.touched).into_iter();
                let hashes = touched.map(|at| (at, region_hash(world, at))).collect();
                self.hash_checks.insert(self.number, hashes);
            }
            other => panic!("unknown: {other:?}"),
        }
        while let Some(transaction) = self.terrain.begin() {
            let commit = transaction.run();
            let grid = self.terrain.world().grid();
            self.touched.append(&mut touched_regions(grid, &commit.change()));
            self.terrain.commit(commit).expect("its own commit");
        }
        if self.number <= self.joined_at {
            self.touched.clear();
        }
    }

    /// Compares the hashes that it recorded at hash checks with those of the server.
    fn check_hashes(&mut self) {
        while let Some((number, hashes)) = self.hashes.front() {
            if *number > self.number {
                return;
            }
            let noted = self.hash_checks.remove(number).unwrap_or_default();
            let told: BTreeMap<RegionPos, u64> = hashes.iter().copied().collect();
            let world = self.terrain.world();
            // A region that was touched before the hashes arrived and again since the hash check is compared at the
            // next.
            let later: BTreeSet<RegionPos> =
                self.hash_checks.values().flat_map(BTreeMap::keys).chain(&self.touched).copied().collect();
            let own = |at: &RegionPos| match noted.get(at) {
                None if later.contains(at) => None,
                None => Some(region_hash(world, *at)),
                known => known.copied(),
            };
            let all: BTreeSet<RegionPos> = noted.keys().chain(told.keys()).copied().collect();
            let differs = |at: &RegionPos| own(at).is_some_and(|own| told.get(at) != Some(&own));
            let different: Vec<RegionPos> = all.into_iter().filter(differs).collect();
            self.hashes.pop_front();
            if !different.is_empty() && self.awaited.is_empty() {
                self.repairs += different.len();
                self.awaited = different.iter().copied().collect();
                self.out.push(ToServer::Fetch { number: self.number, regions: different });
            }
        }
    }

    /// Replaces a whole region.
    fn put(&mut self, content: &RegionContent) {
        let world = self.terrain.world();
        let mut bricks: BTreeMap<_, _> = world.bricks_in(content.pos).map(|(pos, _)| (pos, None)).collect();
        bricks.extend(content.bricks.iter().map(|(pos, brick)| (*pos, Some(Arc::clone(brick)))));
        let samples = content.pos.samples();
        let touches = |chunk: &ChunkPos| world.grid().chunk_samples(*chunk).intersection(samples).is_some();
        let own = world.fields().map(|(chunk, _)| chunk).filter(touches);
        let mut fields: BTreeMap<_, _> = own.map(|chunk| (chunk, Fields::default())).collect();
        fields.extend(content.fields.iter().cloned());
        let change = Patch {
            bricks: bricks.into_iter().collect(),
            fields: fields.into_iter().collect(),
            next_field: content.next_field,
        };
        self.terrain.apply_one(Order::parts(change, None)).outcome.expect("a valid region");
    }

    /// Makes later fields have the same names as on the server.
    fn set_names(&mut self, next_field: u64) {
        if self.terrain.world().next_field() != next_field {
            let mut parts = self.terrain.parts();
            parts.change.next_field = next_field;
            let settings = TerrainSettings::default();
            self.terrain =
                Terrain::restore(Arc::clone(&self.ground), &settings, parts).expect("a world's own parts");
            self.terrain.set_meshing(Meshing::Never);
            self.terrain.set_undo_budget(0);
        }
    }

    /// Corrupts its world, as a bug would.
    pub fn spoil(&mut self, at: glam::Vec3) {
        self.terrain.apply([Brush::dig(Shape::sphere(at, 3.0))]);
    }
}

/// Delivers messages without delay for a number of frames.
pub fn play(server: &mut Server, followers: &mut [&mut Follower], now: &mut Duration, frames: u32) {
    for _ in 0..frames {
        *now += FRAME;
        for follower in followers.iter_mut() {
            follower.send(server, *now);
        }
        server.advance(*now);
        for (to, lane, bytes) in server.take_outgoing() {
            if let Some(follower) = followers.iter_mut().find(|follower| follower.id == to) {
                follower.receive(lane, &bytes);
            }
        }
    }
}

/// The hash of a server's world, which all of these must have.
pub fn agreed(server: &Server, followers: &[&Follower]) -> u64 {
    let hash = server.terrain().world().hash();
    for follower in followers {
        assert_eq!(follower.number, server.epoch().number, "{:?} is behind", follower.id);
        assert_eq!(follower.terrain.world().hash(), hash, "{:?} has another world", follower.id);
        assert_eq!(follower.terrain.rules(), server.terrain().rules());
        assert_eq!(follower.terrain.loose(), server.terrain().loose());
    }
    hash
}
