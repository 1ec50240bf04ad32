//! The client: it shows the player's edits at once, and follows the server's log.
//!
//! | file | what it does |
//! | --- | --- |
//! | `client` | the interface for games |
//! | `receive`, `follow` | received messages, and entries of the log |
//! | `join` | catching up with the server: old entries, regions, a comparison |
//! | `outbox` | sends the player's edits and undos as fast as the server's limits allow |
//! | `repair` | hash checks, and regions that differ |
//! | `images` | images, grids and prefabs that are missing |
//! | `replica` | the world of the log, and the shown world |

mod events;
mod follow;
mod give_up;
mod images;
mod join;
mod outbox;
mod pieces;
mod receive;
mod repair;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use glam::IVec3;

use super::ContentTable;
use super::bulk::BulkReader;
use super::message::{ClientId, Entry, Epoch, Hello, Lane, PROTOCOL, Refusal, ToServer};
use super::price::cost;
use super::replica::Replica;
use crate::brush::Edit;
use crate::format::WorldId;
use crate::ground::Ground;
use crate::lattice::RegionPos;
use crate::terrain::{Order, Patch, Receipt, Rejection, Terrain, TerrainError, TerrainSettings, World};
pub use events::{ClientEvent, ClientFigures};
use images::Images;
use join::Stage;
use outbox::Outbox;
use pieces::Pieces;
use repair::{HashChecks, Reaches, Repair};

/// The time between acknowledgements, and the bytes of the bulk lane after which one is sent sooner.
const ACK: Duration = Duration::from_millis(100);
const ACK_BYTES: u64 = 16 << 10;

/// The interval at which a greeting is repeated until it is answered.
const GREET_AGAIN: Duration = Duration::from_secs(1);

/// Greater numbers are refused, so counting can never overflow.
const MAX_NUMBER: u64 = u64::MAX / 2;

/// A client: bytes in, bytes out.
///
/// In each frame, pass received messages to [`receive`](Self::receive) and edits of the player to
/// [`submit`](Self::submit), send the messages of [`take_outgoing`](Self::take_outgoing), call
/// [`advance`](Self::advance), which takes as long as its edits take, apply the changes of
/// [`take_shown`](Self::take_shown) to the shown terrain, and handle the [events](Self::take_events).
pub struct Client {
    replica: Replica,
    contents: ContentTable,
    chunk_size: u32,
    position: IVec3,
    /// Regions within this distance, in voxels, have to be there before play begins.
    near: u32,
    id: Option<ClientId>,
    /// Where the world is; `None` before the first welcome.
    epoch: Option<Epoch>,
    /// Whether the world lacks regions of its number.
    is_part: bool,
    stage: Stage,
    now: Duration,
    /// The stream that it greeted for last.
    stream: u64,
    /// When it greeted last.
    greeted: Duration,
    /// By lane: whether the stream has begun there. Earlier messages belong to a previous stream.
    has_begun: [bool; 2],
    inbox: VecDeque<(Lane, Vec<u8>)>,
    images: Images,
    bulk: BulkReader,
    acknowledged: (u64, u64, Duration),
    /// Entries that came and are not applied yet.
    waiting: BTreeMap<u64, Entry>,
    /// The number of the last entry that came in the main lane.
    received: u64,
    hash_checks: HashChecks,
    reaches: Reaches,
    repair: Option<Repair>,
    /// Regions that differ and were not asked for yet.
    wanted: VecDeque<RegionPos>,
    /// Entries to come that the server could not apply.
    failed: BTreeSet<u64>,
    /// Regions that are to be fetched, whatever their hashes are.
    doubtful: BTreeSet<RegionPos>,
    /// Whether the ground around the player has been complete once.
    is_playable: bool,
    /// The sequence number of the player's next edit or undo.
    next_sequence: u64,
    /// The greatest sequence number of this client that the server of this world can have seen.
    sent: u64,
    /// The sequence number of the last edit whose prediction was reported.
    reported: u64,
    /// Edits from before the first welcome.
    early: Vec<Edit>,
    outbox: Outbox,
    /// The numbers of undos that the server has not answered.
    undos: BTreeSet<u64>,
    pieces: Pieces,
    outgoing: Vec<Vec<u8>>,
    shown: Vec<Order>,
    events: Vec<ClientEvent>,
    figures: ClientFigures,
}

impl Client {
    /// A client with the same ground as the server.
    ///
    /// # Errors
    /// When the chunk size or the voxel size is out of range.
    pub fn new(ground: impl Into<Arc<Ground>>, settings: &TerrainSettings) -> Result<Self, TerrainError> {
        let replica = Replica::new(ground.into(), settings)?;
        Ok(Self {
            replica,
            contents: ContentTable::default(),
            chunk_size: settings.chunk_size,
            position: IVec3::ZERO,
            near: 96,
            id: None,
            epoch: None,
            is_part: false,
            stage: Stage::Disconnected,
            now: Duration::ZERO,
            // Others may have greeted on the same connection.
            stream: WorldId::random().0 as u64 >> 1,
            greeted: Duration::ZERO,
            has_begun: [false; 2],
            inbox: VecDeque::new(),
            images: Images::default(),
            bulk: BulkReader::default(),
            acknowledged: (0, 0, Duration::ZERO),
            waiting: BTreeMap::new(),
            received: 0,
            hash_checks: HashChecks::default(),
            reaches: Reaches::default(),
            repair: None,
            wanted: VecDeque::new(),
            failed: BTreeSet::new(),
            doubtful: BTreeSet::new(),
            is_playable: false,
            next_sequence: 1,
            sent: 0,
            reported: 0,
            early: Vec::new(),
            outbox: Outbox::new([0; 2], 0, Duration::ZERO),
            undos: BTreeSet::new(),
            pieces: Pieces::default(),
            outgoing: Vec::new(),
            shown: Vec::new(),
            events: Vec::new(),
            figures: ClientFigures::default(),
        })
    }

    /// Starts with a world that the game already has, such as a level that it ships, instead of the pristine one: its
    /// parts. Once it joins, only regions that differ from the server's are sent. Call it before the first
    /// [`connect`](Self::connect).
    ///
    /// # Errors
    /// When the parts do not fit the ground or the chunk size.
    pub fn begin_with(&mut self, change: Patch) -> Result<(), Rejection> {
        self.replica.put(change)?;
        // It is in no log, so the server has to compare.
        self.epoch = Some(Epoch { world: WorldId(0), run: 0, number: 0 });
        self.is_part = true;
        Ok(())
    }

    /// The images, grids and prefabs that the player's edits may hold. Others come from the server.
    pub fn contents_mut(&mut self) -> &mut ContentTable {
        &mut self.contents
    }

    /// Sets the player's position, in voxels: regions are sent from there outwards.
    pub fn set_position(&mut self, position: IVec3) {
        self.position = position;
    }

    /// Sets how far around the player the ground must have arrived before play begins, in voxels; 96 by default.
    pub fn set_near(&mut self, near: u32) {
        self.near = near;
    }

    /// Greets the server over a new connection, or again over an existing one. Unfinished messages are dropped; the
    /// world, and edits that the server has not answered, stay.
    pub fn connect(&mut self, now: Duration) {
        self.now = now;
        self.inbox.clear();
        self.outgoing.clear();
        self.greet();
    }

    /// Records that the connection is lost. Edits are still shown.
    pub fn disconnect(&mut self) {
        self.stage = Stage::Disconnected;
        self.inbox.clear();
    }

    /// Begins a new stream.
    fn greet(&mut self) {
        self.stage = Stage::AwaitingWelcome;
        self.repair = None;
        self.stream = self.stream.wrapping_add(1);
        self.has_begun = [false; 2];
        self.bulk = BulkReader::default();
        self.acknowledged = (0, 0, self.now);
        self.images.clear();
        self.say_hello();
    }

    /// Sends the greeting, once more if it was not answered.
    fn say_hello(&mut self) {
        self.greeted = self.now;
        let hello = Hello {
            protocol: PROTOCOL,
            simulation: Terrain::SIMULATION,
            ground: self.replica.world().ground().hash(),
            chunk_size: self.chunk_size,
            // A part of a world has no number: the server determines what is missing.
            epoch: self
                .epoch
                .map(|epoch| if self.is_part { Epoch { number: u64::MAX, ..epoch } } else { epoch }),
            position: self.position,
        };
        self.outgoing.push(ToServer::Greeting { stream: self.stream, hello }.to_bytes());
    }

    /// The world after the entries up to [`number`](Self::number). While regions are still arriving, it is incomplete.
    pub fn world(&self) -> &World {
        self.replica.world()
    }

    /// The number of the last entry that is applied.
    pub fn number(&self) -> u64 {
        self.epoch.map_or(0, |epoch| epoch.number)
    }

    /// The id of this client; `None` before the server has welcomed it.
    pub fn id(&self) -> Option<ClientId> {
        self.id
    }

    /// Whether it has the whole world and follows the log.
    pub fn has_joined(&self) -> bool {
        matches!(self.stage, Stage::Following)
    }

    /// The [hash](World::hash) that the shown terrain has once everything from [`take_shown`](Self::take_shown) is put.
    pub fn shown_hash(&self) -> u64 {
        self.replica.shown_hash()
    }

    /// The order that repairs a shown terrain with this world, for example because a change was refused there. It takes
    /// the place of everything that [`take_shown`](Self::take_shown) would return now.
    pub fn show_whole(&mut self, shown: &World) -> Order {
        let (_, receipts) = self.replica.update();
        self.shown.clear();
        self.report_predictions(receipts.unwrap_or_default());
        self.replica.whole(shown)
    }

    /// The client's statistics.
    pub fn figures(&self) -> ClientFigures {
        let (drafts, drafted) = (self.replica.drafts(), self.replica.drafted());
        ClientFigures { drafts, drafted, ..self.figures }
    }

    /// Edits of the player that the server has not answered.
    pub fn pending(&self) -> usize {
        self.replica.pending().count() + self.early.len()
    }

    /// Submits an edit of the player: it is sent, and shown after the next [`advance`](Self::advance).
    /// [Events](ClientEvent) report its result by its tag.
    pub fn submit(&mut self, edit: Edit) {
        if self.id.is_none() {
            self.early.push(edit);
        } else if !self.contents.can_send(&edit) {
            self.events.push(ClientEvent::Refused { tag: edit.tag(), why: None });
        } else {
            let sequence = self.next_sequence;
            self.replica.predict(sequence, edit.clone());
            self.next_sequence += 1;
            // All others are sent with the next welcome.
            if self.is_welcome() {
                self.send_edit(sequence, edit);
            }
        }
    }

    fn send_edit(&mut self, sequence: u64, edit: Edit) {
        let cost = cost(self.replica.world().grid(), &edit).unwrap_or_default();
        self.outbox.edit(sequence, edit, cost);
    }

    /// Asks the server to undo the last stroke of a player, by default this one, before this position among the
    /// player's edits. If allowed, it arrives as an entry; [`ClientEvent::Undone`] or [`ClientEvent::UndoRefused`]
    /// report the result.
    pub fn undo(&mut self, of: Option<ClientId>) {
        let Some(of) = of.or(self.id).filter(|_| self.is_welcome()) else {
            // By the time it could be sent, it may be of another stroke.
            return self.events.push(ClientEvent::UndoRefused(Some(Refusal::NotJoined)));
        };
        self.undos.insert(self.next_sequence);
        self.outbox.undo(self.next_sequence, of);
        self.next_sequence += 1;
    }

    /// Whether the server has welcomed it on this connection.
    fn is_welcome(&self) -> bool {
        !matches!(self.stage, Stage::Disconnected | Stage::AwaitingWelcome)
    }

    /// Messages to the server, in order; each is returned once.
    pub fn take_outgoing(&mut self) -> Vec<Vec<u8>> {
        if self.is_welcome() {
            self.outgoing.extend(self.outbox.take(self.now));
            self.sent = self.sent.max(self.outbox.sent());
        }
        std::mem::take(&mut self.outgoing)
    }

    /// Receives a message from the server. [`advance`](Self::advance) reads it.
    pub fn receive(&mut self, lane: Lane, bytes: Vec<u8>) {
        self.inbox.push_back((lane, bytes));
    }

    /// The changes of the shown terrain, for [`Terrain::submit_all`](crate::terrain::Terrain::submit_all); each is
    /// returned once.
    pub fn take_shown(&mut self) -> Vec<Order> {
        std::mem::take(&mut self.shown)
    }

    /// What happened since the last call.
    pub fn take_events(&mut self) -> Vec<ClientEvent> {
        std::mem::take(&mut self.events)
    }

    /// Reads received messages, applies entries, and updates the shown world. Returns whether more work can be done at
    /// once.
    pub fn advance(&mut self, now: Duration) -> bool {
        self.now = self.now.max(now);
        while let Some((lane, bytes)) = self.inbox.pop_front() {
            self.read(lane, bytes);
        }
        self.read_bulk();
        if matches!(self.stage, Stage::AwaitingWelcome)
            && self.now.saturating_sub(self.greeted) >= GREET_AGAIN
        {
            self.say_hello();
        }
        if self.replica.can_append() {
            self.show();
        }
        let is_busy = self.follow();
        self.show();
        self.acknowledge(now);
        is_busy
    }

    fn show(&mut self) {
        if !self.is_history() {
            let (shown, receipts) = self.replica.update();
            self.shown.extend(shown);
            self.report_predictions(receipts.unwrap_or_default());
        }
    }

    /// Whether the client is still catching up. Entries are then applied without events and shown all at once.
    fn is_history(&self) -> bool {
        matches!(self.stage, Stage::ByLog { .. }) && !self.is_playable
    }

    fn report_predictions(&mut self, receipts: Vec<Receipt>) {
        let before = self.replica.pending().count().saturating_sub(receipts.len());
        let mut new = Vec::new();
        for ((sequence, _), receipt) in self.replica.pending().skip(before).zip(receipts) {
            if sequence > self.reported {
                self.reported = sequence;
                new.push((sequence, receipt));
            }
        }
        for (sequence, receipt) in new {
            self.predict_pieces(sequence, &receipt);
            self.events.push(ClientEvent::Predicted(receipt));
        }
    }

    fn acknowledge(&mut self, now: Duration) {
        let (bulk, number, last) = self.acknowledged;
        let new = (self.bulk.received(), self.number());
        let is_due = now.saturating_sub(last) >= ACK || new.0 >= bulk + ACK_BYTES;
        if self.is_welcome() && new != (bulk, number) && is_due {
            self.acknowledged = (new.0, new.1, now);
            self.outgoing.push(ToServer::Ack { bulk: new.0, number: new.1 }.to_bytes());
        }
    }
}
