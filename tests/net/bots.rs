//! A server, players that dig at random, and the lines between them; all worlds are checked in every frame.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::lattice::ChunkPos;
use bevy_burrow::net::{
    Client, ClientEvent, ClientId, ContentTable, Entries, Entry, Lane, Server, ServerSettings, ToClient,
};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use bevy_burrow::volume::{FieldId, Fields};
use fastrand::Rng;
use glam::{IVec3, Vec2, Vec3};

use crate::follower::terrain;
use crate::link::{Line, Way};
use crate::worlds::{any_random_brush, contents, random_rules};

/// A frame of a player; every other one is one of the server.
pub const FRAME: Duration = Duration::from_micros(16_667);
/// A frame of the server.
pub const TICK: Duration = Duration::from_micros(2 * 16_667);
/// Frames between two edits of a player.
const EDIT: u64 = 12;

/// The plants that stand in a world.
#[cfg(feature = "scatter")]
fn plants(world: &World) -> Vec<bevy_burrow::scatter::Plant> {
    use bevy_burrow::scatter::{Clearance, Scatter, ScatterRules, Species};
    let clearance = Clearance { radius: 1.5, height: 6.0 };
    let tree = Species { spacing: 3.0, distance: 2.5, clearance, ..Species::named("tree") };
    let scatter = Scatter::new(&ScatterRules { seed: 4, species: vec![tree, Species::named("grass")] });
    let all = glam::DVec3::splat(1e6);
    scatter.expect("valid rules").in_box(world, -all, all, |_| true)
}

/// The world that results from the log, entry by entry, and its hash at every number.
pub struct Reference {
    terrain: Terrain,
    ground: Arc<Ground>,
    contents: ContentTable,
    pub number: u64,
    pub hashes: BTreeMap<u64, u64>,
    pub loose: usize,
    /// Edits of players: the number in the log, the player, and the player's number.
    pub done: Vec<(u64, ClientId, u64)>,
    /// Applied parts, by the player that asked for the undo.
    pub undone: BTreeMap<ClientId, Vec<Applied>>,
    pub rule_changes: usize,
}

impl Reference {
    fn new(ground: &Arc<Ground>, contents: ContentTable) -> Self {
        let terrain = terrain(ground);
        let hashes = BTreeMap::from([(0, terrain.world().hash())]);
        let ground = Arc::clone(ground);
        let undone = BTreeMap::new();
        Self {
            terrain,
            ground,
            contents,
            number: 0,
            hashes,
            loose: 0,
            done: Vec::new(),
            undone,
            rule_changes: 0,
        }
    }

    /// Returns to the state of a restarted server.
    pub fn begin_again(&mut self, terrain: Terrain, number: u64) {
        self.terrain = terrain;
        self.number = number;
        self.hashes.retain(|at, _| *at <= number);
        self.done.retain(|(at, ..)| *at <= number);
        self.hashes.insert(number, self.terrain.world().hash());
    }

    /// Applies the new entries of a message.
    fn obey(&mut self, message: &[u8]) {
        let message = ToClient::from_bytes(message, &self.ground, &self.contents).expect("a message");
        let ToClient::Entries(Entries { first, entries }) = message else { return };
        for (number, entry) in (first..).zip(entries) {
            if number != self.number + 1 {
                continue;
            }
            match entry {
                Entry::Order { by: Some((author, sequence)), order: order @ Order::Edit(_) } => {
                    self.terrain.submit(order);
                    while let Some(transaction) = self.terrain.begin() {
                        for receipt in self.terrain.commit(transaction.run()).expect("it waits for it") {
                            self.loose += receipt.outcome.map_or(0, |applied| applied.loose.len());
                        }
                    }
                    self.done.push((number, author, sequence));
                }
                Entry::Order { order: order @ (Order::Rules(_) | Order::Loose(_)), .. } => {
                    assert_eq!(self.terrain.apply([order]), [], "valid rules");
                    self.rule_changes += 1;
                }
                Entry::Order { by, order } => {
                    let restored = self.terrain.apply_one(order).outcome.expect("they fit");
                    if let Some((by, _)) = by {
                        self.undone.entry(by).or_default().push(restored);
                    }
                }
                _ => {}
            }
            self.number = number;
            self.hashes.insert(number, self.terrain.world().hash());
        }
    }
}

/// A player.
pub struct Bot {
    pub id: ClientId,
    pub client: Client,
    /// The world that the player sees. It changes only by shown changes.
    pub shown: Terrain,
    up: Way,
    pub order: Way,
    pub bulk: Way,
    free: [Duration; 2],
    rng: Rng,
    pub is_digging: bool,
    pub is_undoing: bool,
    pub is_connected: bool,
    /// Whether its world may differ from the others', because its messages are tampered with.
    pub may_differ: bool,
    edits: u64,
    /// The frames of edits that are not shown yet, by tag.
    dug: BTreeMap<u64, u64>,
    /// The arrival times of messages that are not applied yet.
    arrived: VecDeque<(Duration, u64)>,
    /// The most frames until an own edit was shown.
    pub own_frames: u64,
    /// When the latest message arrived that may hold a grid or a prefab which entries wait for.
    content_at: Duration,
    /// The longest time from the arrival of an entry, and of what it needs, until it was shown.
    pub lag: Duration,
    pub events: BTreeMap<&'static str, u64>,
    pub playable_at: Option<Duration>,
    pub joined_at: Option<Duration>,
    pub durable: u64,
    pub bytes: [u64; 2],
    /// Undos that were requested.
    pub undos: u64,
    /// Applied parts.
    pub undone: Vec<Applied>,
    /// How many tags were answered.
    pub answered: u64,
    /// Tags of edits that are not answered.
    pub open: BTreeSet<u64>,
    /// Tags of edits that were refused.
    pub refused: BTreeSet<u64>,
}

impl std::fmt::Debug for Bot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} {:?} {:?} joined {:?}", self.id, self.client.figures(), self.events, self.joined_at)?;
        write!(f, ", on the way {:?}", [self.up.bytes, self.order.bytes, self.bulk.bytes])
    }
}

impl Bot {
    fn new(id: u64, ground: &Arc<Ground>, image: &Arc<GreyImage>, now: Duration) -> Self {
        let mut client =
            Client::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings");
        client.contents_mut().add(Arc::clone(image));
        // Others get what they lack from the server.
        if id.is_multiple_of(2) {
            add_contents(client.contents_mut());
        }
        client.set_position(IVec3::new(20, 20, 20));
        client.connect(now);
        let (up, order, bulk, free, dug, arrived, events) = Default::default();
        Self {
            id: ClientId(id),
            client,
            shown: terrain(ground),
            up,
            order,
            bulk,
            free,
            rng: Rng::with_seed(id),
            is_digging: true,
            is_undoing: true,
            is_connected: true,
            may_differ: false,
            edits: 0,
            dug,
            arrived,
            own_frames: 0,
            content_at: Duration::ZERO,
            lag: Duration::ZERO,
            events,
            playable_at: None,
            joined_at: None,
            durable: 0,
            bytes: [0; 2],
            undos: 0,
            undone: Vec::new(),
            answered: 0,
            open: BTreeSet::new(),
            refused: BTreeSet::new(),
        }
    }

    pub fn event(&self, name: &str) -> u64 {
        self.events.get(name).copied().unwrap_or_default()
    }

    pub fn edits(&self) -> u64 {
        self.edits
    }

    fn dig(&mut self, ground: &Ground, image: &Arc<GreyImage>, frame: u64) {
        let brush = match self.rng.u32(0..12) {
            0 => {
                let at = Vec3::new(self.rng.f32() * 90.0, 20.0, self.rng.f32() * 90.0);
                let stamp = Stamp::new(Arc::clone(image), at, Vec2::splat(9.0), 3.0);
                Brush::stamp(Shape::sphere(at, 6.0), stamp)
            }
            _ => any_random_brush(&mut self.rng, ground),
        };
        self.edits += 1;
        let brush = brush.with_tag(self.edits).with_stroke(self.edits / 4);
        let Ok(edit) = Edit::quantize(&brush) else { return self.edits -= 1 };
        if !self.client.contents_mut().can_send(&edit) {
            return self.edits -= 1;
        }
        self.dug.insert(self.edits, frame);
        self.open.insert(self.edits);
        self.client.submit(edit);
        if self.is_undoing && self.rng.u32(0..30) == 0 {
            self.client.undo(None);
            self.undos += 1;
        }
    }

    fn look(&mut self, frame: u64, now: Duration) {
        for order in self.client.take_shown() {
            self.shown.apply_one(order).outcome.expect("it fits");
        }
        for event in self.client.take_events() {
            let name = match event {
                ClientEvent::Predicted(receipt) => {
                    if let Some(dug) = self.dug.remove(&receipt.tag) {
                        self.own_frames = self.own_frames.max(frame - dug);
                    }
                    "predicted"
                }
                ClientEvent::Confirmed { tag, .. } => {
                    self.answered += 1;
                    self.open.remove(&tag);
                    "confirmed"
                }
                ClientEvent::Refused { tag, .. } => {
                    self.dug.remove(&tag);
                    self.answered += 1;
                    self.open.remove(&tag);
                    self.refused.insert(tag);
                    "refused"
                }
                ClientEvent::Playable => {
                    self.playable_at.get_or_insert(now);
                    "playable"
                }
                ClientEvent::Joined => {
                    self.joined_at = Some(now);
                    "joined"
                }
                ClientEvent::Durable(number) => {
                    self.durable = number;
                    "durable"
                }
                ClientEvent::Undone(restored) => {
                    // The reference keeps no list of the pieces that games were notified of.
                    self.undone.extend(restored.map(|restored| Applied { returned: Vec::new(), ..restored }));
                    "undone"
                }
                ClientEvent::UndoRefused(_) => "not undone",
                ClientEvent::RemoteEdit { .. } => "others",
                ClientEvent::Repaired(_) => "repaired",
                ClientEvent::Kicked(why) => panic!("{:?} was kicked: {why}", self.id),
                _ => "other",
            };
            *self.events.entry(name).or_default() += 1;
        }
    }
}

/// Changes or drops messages to clients.
type Tamper = Box<dyn FnMut(ClientId, Lane, Vec<u8>) -> Option<Vec<u8>>>;

/// Everything.
pub struct Play {
    pub server: Server,
    pub ground: Arc<Ground>,
    pub image: Arc<GreyImage>,
    pub reference: Reference,
    pub bots: Vec<Bot>,
    pub line: Line,
    pub now: Duration,
    frame: u64,
    rng: Rng,
    pub tamper: Option<Tamper>,
    /// Whether the server changes rules and settings.
    pub changes_rules: bool,
    /// The longest time from an edit's arrival at the server until the server ordered it.
    pub up_lag: Duration,
}

/// Adds the grids and prefabs of random brushes.
fn add_contents(table: &mut ContentTable) {
    let (grids, prefabs) = contents();
    for grid in grids {
        table.add(Arc::clone(grid.image()));
    }
    for prefab in prefabs {
        table.add_prefab(Arc::clone(prefab)).expect("it is small");
    }
}

impl Play {
    pub fn new(ground: &Arc<Ground>, bots: u64, settings: ServerSettings) -> Self {
        let samples = (0..64).map(|at: u16| at * 900).collect();
        let image = Arc::new(GreyImage::from_samples(8, 8, samples).expect("an image"));
        let mut server = Server::new(terrain(ground), settings);
        let mut contents = ContentTable::default();
        contents.add(Arc::clone(&image));
        add_contents(&mut contents);
        server.contents_mut().add_all(&contents);
        let reference = Reference::new(ground, contents);
        let mut play = Self {
            server,
            ground: Arc::clone(ground),
            image,
            reference,
            bots: Vec::new(),
            line: Line::BAD,
            now: Duration::from_secs(1),
            frame: 0,
            rng: Rng::with_seed(bots),
            tamper: None,
            changes_rules: false,
            up_lag: Duration::ZERO,
        };
        (0..bots).for_each(|_| play.join());
        play
    }

    /// Adds a player.
    pub fn join(&mut self) {
        let bot = Bot::new(self.bots.len() as u64 + 1, &self.ground, &self.image, self.now);
        self.server.connect(bot.id, self.now);
        self.bots.push(bot);
    }

    /// Breaks a player's connection.
    pub fn cut(&mut self, at: usize) {
        let bot = &mut self.bots[at];
        bot.client.disconnect();
        (bot.up, bot.order, bot.bulk) = Default::default();
        bot.arrived.clear();
        bot.is_connected = false;
        self.server.disconnect(bot.id);
    }

    /// Restores a player's connection.
    pub fn reconnect(&mut self, at: usize) {
        let bot = &mut self.bots[at];
        bot.is_connected = true;
        bot.joined_at = None;
        bot.client.connect(self.now);
        self.server.connect(bot.id, self.now);
    }

    /// Sends the server's messages.
    pub fn send(&mut self) {
        for (to, lane, message) in self.server.take_outgoing() {
            if lane == Lane::Main {
                self.reference.obey(&message);
            }
            let Some(bot) = self.bots.iter_mut().find(|bot| bot.id == to && bot.is_connected) else {
                continue;
            };
            let message = match &mut self.tamper {
                Some(tamper) => tamper(to, lane, message),
                None => Some(message),
            };
            let Some(message) = message else { continue };
            bot.bytes[lane as usize] += message.len() as u64;
            let way = if lane == Lane::Main { &mut bot.order } else { &mut bot.bulk };
            way.send(message, self.now, &mut bot.free[0], &self.line, &mut self.rng);
        }
    }

    fn serve(&mut self) {
        if self.changes_rules && self.frame.is_multiple_of(180) {
            let rules = if self.rng.bool() {
                random_rules(&mut self.rng, &self.ground)
            } else {
                DiggingRules::default()
            };
            self.server.submit(Order::rules(rules)).expect("valid rules");
        }
        if self.changes_rules && self.frame % 240 == 120 {
            let loose = LooseSettings { largest: 4000, crumbs: 9, debris: self.rng.u32(0..4000) };
            let loose = (self.rng.u32(0..4) > 0).then_some(loose);
            self.server.submit(Order::Loose(loose)).expect("it can be shared");
        }
        for bot in &mut self.bots {
            while let Some((at, message)) = bot.up.next(self.now) {
                self.up_lag = self.up_lag.max(self.now - at);
                self.server.receive(bot.id, &message, self.now);
            }
        }
        self.send();
        self.server.advance(self.now);
        self.send();
        assert_eq!(self.reference.number, self.server.epoch().number, "everything is sent at once");
        let applied = self.server.applied();
        assert_eq!(self.reference.hashes[&applied], self.server.terrain().world().hash(), "at {applied}");
    }

    /// Runs a frame of the server and all players.
    pub fn step(&mut self) {
        self.now += FRAME;
        self.frame += 1;
        if self.frame.is_multiple_of(2) {
            self.serve();
        }
        for bot in &mut self.bots {
            if bot.is_connected {
                for (lane, way) in [(Lane::Main, &mut bot.order), (Lane::Bulk, &mut bot.bulk)] {
                    while let Some((at, message)) = way.next(self.now) {
                        if let Ok(ToClient::Entries(Entries { first, entries })) =
                            ToClient::from_bytes(&message, &self.ground, &self.reference.contents)
                        {
                            bot.arrived.push_back((at, first + entries.len() as u64 - 1));
                        }
                        if lane == Lane::Bulk {
                            bot.content_at = at;
                        }
                        bot.client.receive(lane, message);
                    }
                }
            }
            let is_due = (self.frame + bot.id.0).is_multiple_of(EDIT);
            if bot.is_digging && is_due && bot.client.id().is_some() {
                bot.dig(&self.ground, &self.image, self.frame);
            }
            let is_busy = bot.client.advance(self.now);
            bot.look(self.frame, self.now);
            for message in bot.client.take_outgoing() {
                bot.up.send(message, self.now, &mut bot.free[1], &self.line, &mut self.rng);
            }
            let number = bot.client.number();
            if bot.client.has_joined() && !bot.may_differ {
                let hash = bot.client.world().hash();
                assert_eq!(self.reference.hashes.get(&number), Some(&hash), "{:?} at {number}", bot.id);
            }
            assert_eq!(bot.shown.world().hash(), bot.client.shown_hash(), "{:?} at {number}", bot.id);
            while let Some((at, _)) = bot.arrived.pop_front_if(|(_, last)| *last <= number) {
                if bot.joined_at.is_some_and(|joined| joined < at) && !is_busy {
                    bot.lag = bot.lag.max(self.now - at.max(bot.content_at));
                }
            }
        }
    }

    pub fn seconds(&mut self, seconds: f64) {
        (0..(seconds / FRAME.as_secs_f64()) as u64).for_each(|_| self.step());
    }

    /// Stops digging and waits until all worlds are equal.
    pub fn settle(&mut self) {
        self.bots.iter_mut().for_each(|bot| bot.is_digging = false);
        self.changes_rules = false;
        for _ in 0..40 {
            self.seconds(0.5);
            let last = self.server.epoch().number;
            let is_done = |bot: &Bot| bot.client.number() == last && bot.client.pending() == 0;
            if self.bots.iter().filter(|bot| bot.is_connected).all(is_done) && self.server.applied() == last {
                break;
            }
        }
        // Waits until hash checks have arrived and are compared.
        self.seconds(3.0);
        let hash = self.server.terrain().world().hash();
        for bot in self.bots.iter().filter(|bot| bot.is_connected) {
            assert_eq!(bot.client.number(), self.server.epoch().number, "{bot:?}");
            assert_eq!(bot.client.pending(), 0, "{:?}", bot.id);
            assert_eq!(bot.client.world().hash(), hash, "{:?}", bot.id);
            assert_eq!(bot.shown.world().hash(), hash, "{:?}", bot.id);
            assert_eq!(names(bot.client.world()), names(self.server.terrain().world()), "{:?}", bot.id);
            #[cfg(feature = "scatter")]
            assert_eq!(plants(bot.client.world()), plants(self.server.terrain().world()), "{:?}", bot.id);
            assert_eq!(bot.client.figures().malformed, 0, "{:?}", bot.id);
        }
        let figures = self.server.figures();
        assert_eq!((figures.malformed, figures.failed, figures.kicked), (0, 0, 0));
    }
}

/// The names of all fields, and the greatest name ever used.
fn names(world: &World) -> (BTreeMap<ChunkPos, Vec<FieldId>>, u64) {
    let names = |fields: &Fields| fields.iter().map(|field| field.id).collect();
    (world.fields().map(|(chunk, fields)| (chunk, names(fields))).collect(), world.next_field())
}
