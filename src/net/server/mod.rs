//! The server: it owns the log. It numbers the edits of clients, sends them on, and applies them to its own terrain,
//! which has no meshes.
//!
//! | file | what it does |
//! | --- | --- |
//! | `settings`, `events` | its limits, its events and statistics |
//! | `session`, `players` | a connected client, data that is kept for its player |
//! | `recent` | a table of clients that forgets the oldest |
//! | `receive`, `validation` | received messages, and the reasons to refuse edits |
//! | `submit` | orders of the game itself |
//! | `numbering` | numbers entries, and sends them |
//! | `entry_log` | the latest entries, in long messages |
//! | `sequences` | the last sequence numbers of players' edits |
//! | `apply` | applies entries to the world |
//! | `strokes` | strokes that can be undone |
//! | `join`, `sender`, `pace` | clients that join, reconnect, or differ; the bulk lane; how fast it is |
//! | `kept` | older states of the world that are kept for joining clients |
//! | `save`, `saved_log` | a server that survives a restart; the entries that it saves |

mod apply;
mod entry_log;
mod events;
mod join;
mod kept;
#[cfg(feature = "store")]
mod keys;
mod numbering;
mod pace;
mod players;
mod receive;
mod recent;
#[cfg(feature = "store")]
mod save;
#[cfg(feature = "store")]
mod saved_log;
mod sender;
mod sequences;
mod session;
mod settings;
mod strokes;
mod submit;
mod validation;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fmt;
use std::time::Duration;

use glam::IVec3;

use super::ContentTable;
use super::encoding::EntryWriter;
use super::message::{ClientId, Entry, Epoch, KickReason, Lane, ToClient};
use super::never_shown;
use super::regions::RegionSums;
use crate::brush::Edit;
use crate::format::WorldId;
use crate::lattice::RegionPos;
use crate::terrain::{EditSettings, Terrain};
use entry_log::EntryLog;
pub use events::{ServerEvent, ServerFigures};
use kept::Kept;
use players::Players;
use sender::Encodings;
use sequences::Sequences;
use session::Session;
pub use settings::{Reach, ServerSettings, UndoPolicy};
use strokes::Strokes;
pub use submit::OrderError;

/// Decides whether a client may make an edit.
pub type Permission = Box<dyn Fn(ClientId, &Edit) -> bool + Send + Sync>;

/// Decides whether a player may join; otherwise the reason.
pub type Admission = Box<dyn Fn(ClientId) -> Result<(), u32> + Send + Sync>;

/// The most events that wait to be taken.
const MAX_EVENTS: usize = 4096;

/// A message with entries is sent once it has this many bytes, even if more are ordered at the same time.
const FULL_MESSAGE: usize = 16 << 10;

/// A message that waits to be sent.
pub type Outgoing = (ClientId, Lane, Vec<u8>);

/// An entry that was ordered and not yet applied.
struct Ordered {
    entry: Entry,
    /// For an edit: its author's tag and stroke.
    labels: (u64, Option<u64>),
    /// For an edit: its cost.
    cost: u64,
}

/// An undo that waits until all entries before it are applied, because only then its result is known.
struct UndoRequest {
    by: ClientId,
    sequence: u64,
    of: ClientId,
}

/// A waiting undo, or an entry after it.
#[expect(clippy::large_enum_variant, reason = "nearly all that waits are entries")]
enum Later {
    Undo(UndoRequest),
    Entry(Ordered),
}

impl Later {
    fn is_of(&self, client: ClientId) -> bool {
        match self {
            Self::Undo(request) => request.by == client,
            Self::Entry(Ordered { entry, .. }) => {
                entry.edit().is_some() && entry.number_of(Some(client)).is_some()
            }
        }
    }
}

/// The server of a world: bytes in, bytes out.
///
/// In each frame, pass every received message to [`receive`](Self::receive), send the messages of
/// [`take_outgoing`](Self::take_outgoing), call [`advance`](Self::advance), which takes as long as its edits take, and
/// send again. Times count from any start and never decrease.
pub struct Server {
    terrain: Terrain,
    settings: ServerSettings,
    contents: ContentTable,
    permission: Permission,
    admission: Admission,
    /// The latest time.
    now: Duration,
    /// The world, this run, and the number of the last entry.
    epoch: Epoch,
    /// The number that this run began with.
    began: u64,
    /// The number of the last entry that is applied.
    applied: u64,
    waiting: VecDeque<Ordered>,
    waiting_cost: u64,
    writer: EntryWriter,
    log: EntryLog,
    /// Entries of the log that could not be applied.
    failed: BTreeSet<u64>,
    /// Whether the log leads from the pristine world to this one.
    is_whole: bool,
    /// An undo and all later entries, which get numbers after the undo has one, so it applies to everything before it.
    later: VecDeque<Later>,
    strokes: Strokes,
    /// Regions that were touched since the last hash check.
    touched: BTreeSet<RegionPos>,
    /// The number at which each region changed last, as far as this run knows.
    changed: BTreeMap<RegionPos, u64>,
    sums: RegionSums,
    encodings: Encodings,
    /// The client whose bulk lane comes first.
    first_bulk: ClientId,
    /// The time and the number of the last hash check.
    last_hash_check: (Duration, u64),
    sessions: BTreeMap<ClientId, Session>,
    players: Players,
    sequences: Sequences,
    /// The world that new clients get.
    kept: Option<Kept>,
    /// When fetches were answered last.
    fetched: Duration,
    durable: u64,
    #[cfg(feature = "store")]
    saving: save::Saving,
    /// The log in the store; `None` without one.
    #[cfg(feature = "store")]
    saved_log: Option<saved_log::SavedLog>,
    outgoing: Vec<Outgoing>,
    events: VecDeque<ServerEvent>,
    figures: ServerFigures,
}

impl fmt::Debug for Server {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Server")
            .field("epoch", &self.epoch)
            .field("applied", &self.applied)
            .field("clients", &self.sessions.len())
            .field("figures", &self.figures)
            .finish_non_exhaustive()
    }
}

impl Server {
    /// The version of the protocol. It changes whenever the encoding of messages does.
    pub const PROTOCOL: u32 = super::message::PROTOCOL;

    /// A server of a world that is not saved.
    pub fn new(terrain: Terrain, settings: ServerSettings) -> Self {
        Self::at(terrain, WorldId::random(), 0, settings)
    }

    /// A server of a terrain that is at this number of its world's order.
    fn at(mut terrain: Terrain, id: WorldId, number: u64, settings: ServerSettings) -> Self {
        never_shown(&mut terrain);
        let world = terrain.world();
        let is_whole = number == 0
            && world.next_field() == 0
            && world.bricks().next().is_none()
            && world.fields().next().is_none();
        let edit_settings = terrain.edit_settings().clone();
        let run = WorldId::random().0 as u64;
        let mut server = Self {
            terrain,
            settings,
            contents: ContentTable::default(),
            permission: Box::new(|_, _| true),
            admission: Box::new(|_| Ok(())),
            now: Duration::ZERO,
            epoch: Epoch { world: id, run, number },
            began: number,
            applied: number,
            waiting: VecDeque::new(),
            waiting_cost: 0,
            writer: EntryWriter::default(),
            log: EntryLog::new(settings.log_bytes, number),
            failed: BTreeSet::new(),
            is_whole,
            later: VecDeque::new(),
            strokes: Strokes::new(settings.undo_bytes),
            touched: BTreeSet::new(),
            changed: BTreeMap::new(),
            sums: RegionSums::default(),
            encodings: Encodings::default(),
            first_bulk: ClientId(0),
            last_hash_check: (Duration::ZERO, number),
            sessions: BTreeMap::new(),
            players: Players::new(settings),
            sequences: Sequences::default(),
            kept: None,
            fetched: Duration::ZERO,
            durable: number,
            #[cfg(feature = "store")]
            saving: save::Saving::at(0, number),
            #[cfg(feature = "store")]
            saved_log: None,
            outgoing: Vec::new(),
            events: VecDeque::new(),
            figures: ServerFigures::default(),
        };
        // What holds already is part of what leads from the pristine world.
        if is_whole {
            let orders = edit_settings.orders_after(Some(&EditSettings::default()));
            orders.for_each(|order| server.order(Entry::of_server(order)));
        }
        server
    }

    /// The terrain, with all entries up to [`applied`](Self::applied).
    pub fn terrain(&self) -> &Terrain {
        &self.terrain
    }

    /// The world, this run of the server, and the number of the last entry.
    pub fn epoch(&self) -> Epoch {
        self.epoch
    }

    /// The number of the last entry that the server has applied itself.
    pub fn applied(&self) -> u64 {
        self.applied
    }

    /// Everything up to this number is saved.
    pub fn durable(&self) -> u64 {
        self.durable
    }

    /// Marks all entries up to this number as saved, and informs clients: for games that save in another way.
    pub fn set_durable(&mut self, number: u64) {
        if number > self.durable && number <= self.applied {
            self.durable = number;
            self.send_to_all(&ToClient::Durable { number });
        }
    }

    /// The server's statistics.
    pub fn figures(&self) -> ServerFigures {
        self.figures
    }

    /// The settings.
    pub fn settings(&self) -> &ServerSettings {
        &self.settings
    }

    /// The images, grids and prefabs that edits may hold. A client that lacks one gets it at its first use.
    pub fn contents_mut(&mut self) -> &mut ContentTable {
        &mut self.contents
    }

    /// Sets a function that decides about each edit, after all other checks. By default every edit is allowed.
    pub fn set_permission(&mut self, permission: impl Fn(ClientId, &Edit) -> bool + Send + Sync + 'static) {
        self.permission = Box::new(permission);
    }

    /// Sets a function that decides at each greeting whether a player may join. `Err` rejects the player with
    /// [`KickReason::Refused`] and a number chosen by the game. By default all players may join. To remove a player
    /// that has joined already, see [`kick_for`](Self::kick_for).
    pub fn set_admission(&mut self, admission: impl Fn(ClientId) -> Result<(), u32> + Send + Sync + 'static) {
        self.admission = Box::new(admission);
    }

    /// Adds a connected client. If it was connected already, its session starts again. Its player keeps the budget left
    /// from earlier connections.
    pub fn connect(&mut self, client: ClientId, now: Duration) {
        self.now = self.now.max(now);
        self.disconnect(client);
        self.sessions.insert(client, Session::new(&self.settings, now));
        self.players.player(client);
        self.players.trim(|client| self.sessions.contains_key(&client));
        self.sequences.trim(|client| self.sessions.contains_key(&client));
    }

    /// Removes a disconnected client. Messages that wait for it are dropped.
    pub fn disconnect(&mut self, client: ClientId) {
        self.sessions.remove(&client);
        self.outgoing.retain(|(to, ..)| *to != client);
    }

    /// Removes a client. It is notified; close its connection then.
    pub fn kick(&mut self, client: ClientId) {
        self.kick_for(client, KickReason::ByGame);
    }

    /// Removes a client and sends it the reason; close its connection then.
    pub fn kick_for(&mut self, client: ClientId, why: KickReason) {
        if self.sessions.remove(&client).is_some() {
            self.figures.kicked += 1;
            self.outgoing.retain(|(to, ..)| *to != client);
            self.send(client, &ToClient::Kicked(why));
            self.report(ServerEvent::Kicked(client, why));
        }
    }

    /// The clients that are connected, in order.
    pub fn clients(&self) -> impl Iterator<Item = ClientId> {
        self.sessions.keys().copied()
    }

    /// The number that a client's world is at, as it has acknowledged; `None` if it has not joined.
    pub fn acknowledged(&self, client: ClientId) -> Option<u64> {
        let session = self.sessions.get(&client).filter(|session| session.has_joined());
        session.map(|session| session.acknowledged)
    }

    /// Sets the position of a client's player, in voxels, from which its [reach](ServerSettings::reach) is measured;
    /// `None` if it is unknown. It can be set before the client connects, and persists over its connections.
    pub fn set_position(&mut self, client: ClientId, position: Option<IVec3>) {
        if position.is_some() || self.players.get(client).is_some() {
            self.players.player(client).position = position;
            self.players.trim(|client| self.sessions.contains_key(&client));
        }
    }

    /// Sets whether a client may undo strokes of others: see [`UndoPolicy`]. It can be set before the client connects,
    /// and persists over its connections. It is not saved.
    pub fn set_administrator(&mut self, client: ClientId, is_one: bool) {
        if is_one || self.players.get(client).is_some() {
            self.players.player(client).is_administrator = is_one;
        }
    }

    /// Applies ordered entries, welcomes new clients, and sends bulk data within its limits.
    pub fn advance(&mut self, now: Duration) {
        self.now = self.now.max(now);
        let (last, number) = self.last_hash_check;
        let is_due = now.saturating_sub(last) >= self.settings.hash_check;
        if is_due && self.epoch.number > number {
            self.order(Entry::HashCheck);
            self.last_hash_check = (now, self.epoch.number);
        }
        self.apply();
        self.log.trim(self.applied);
        self.failed = self.failed.split_off(&self.log.first());
        self.forget_kept(now);
        self.drop_stuck(now);
        self.welcome_all(now);
        self.send_bulk(now);
    }

    /// Messages to send, in order; each is returned once. Each lane of each client has to deliver all of its messages
    /// in order.
    pub fn take_outgoing(&mut self) -> Vec<Outgoing> {
        self.flush();
        self.catch_up();
        std::mem::take(&mut self.outgoing)
    }

    /// Events since the last call. If they are not taken, the latest 4096 are kept.
    pub fn take_events(&mut self) -> Vec<ServerEvent> {
        std::mem::take(&mut self.events).into()
    }
}

#[cfg(test)]
mod failed_tests;
