//! The client: it shows the player's edits at once, and follows the server's order.
//!
//! | file | what it does |
//! | --- | --- |
//! | `client` | the interface for games, and received messages |
//! | `join` | catching up with the server: old entries, regions, a comparison |
//! | `outbox` | sends the player's edits and undos as fast as the server's limits allow |
//! | `repair` | marks, and regions that differ |
//! | `images` | images of stamps that are missing |
//! | `replica` | the world of the order, and the shown world |

mod events;
mod give_up;
mod images;
mod join;
mod outbox;
mod pieces;
mod repair;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use glam::IVec3;

use super::Stamps;
use super::bulk::BulkReader;
use super::encoding::{PIECE, entry_bytes};
use super::message::{
    ClientId, Entries, Entry, Epoch, Hello, KickReason, Lane, PROTOCOL, Refusal, ToClient, ToServer,
};
use super::price::{UNDO, UNDO_BYTES, cost};
use super::replica::{Replica, ShownChange};
use crate::brush::Edit;
use crate::format::WorldId;
use crate::ground::Ground;
use crate::lattice::{LatticeBox, RegionPos};
use crate::terrain::{Order, Patch, Receipt, Rejection, SIMULATION, TerrainError, TerrainSettings, World};
pub use events::{ClientEvent, ClientFigures};
use images::Images;
use join::Stage;
use outbox::Outbox;
use pieces::Pieces;
use repair::{Marks, Reaches, Repair};

/// Most entries that one [`advance`](Client::advance) applies.
const BATCH: usize = 2048;

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
    stamps: Stamps,
    chunk_size: u32,
    place: IVec3,
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
    /// The number of the last entry that came in the order lane.
    received: u64,
    marks: Marks,
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
    shown: Vec<ShownChange>,
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
            stamps: Stamps::default(),
            chunk_size: settings.chunk_size,
            place: IVec3::ZERO,
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
            marks: Marks::default(),
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

    /// Begins with a world that is here already, such as the level that the game ships, instead of the pristine one:
    /// its [parts](crate::terrain::Terrain::parts). Once it joins, only regions that differ from the server's are sent.
    /// Call it before the first [`connect`](Self::connect).
    ///
    /// # Errors
    /// When the parts do not fit the ground or the chunk size.
    pub fn begin_with(&mut self, change: Patch) -> Result<(), Rejection> {
        self.replica.put(change)?;
        // It is in no order, so the server has to compare.
        self.epoch = Some(Epoch { world: WorldId(0), run: 0, number: 0 });
        self.is_part = true;
        Ok(())
    }

    /// The images that stamps may have: those that the player uses. Others come from the server.
    pub fn stamps_mut(&mut self) -> &mut Stamps {
        &mut self.stamps
    }

    /// Sets the player's position, in voxels: regions are sent from there outwards.
    pub fn set_place(&mut self, place: IVec3) {
        self.place = place;
    }

    /// Sets how far around the player the ground has to be there before play begins, in voxels; 96 by default.
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
            simulation: SIMULATION,
            ground: self.replica.world().ground().hash(),
            chunk_size: self.chunk_size,
            // A part of a world has no number: the server determines what is missing.
            epoch: self
                .epoch
                .map(|epoch| if self.is_part { Epoch { number: u64::MAX, ..epoch } } else { epoch }),
            place: self.place,
        };
        self.outgoing.push(ToServer::Greeting { stream: self.stream, hello }.to_bytes());
    }

    /// The world after the entries up to [`number`](Self::number). While regions come, it is a part of it.
    pub fn world(&self) -> &World {
        self.replica.world()
    }

    /// The number of the last entry that is applied.
    pub fn number(&self) -> u64 {
        self.epoch.map_or(0, |epoch| epoch.number)
    }

    /// Who this client is; `None` before the server has welcomed it.
    pub fn id(&self) -> Option<ClientId> {
        self.id
    }

    /// Whether it has the whole world and follows the order.
    pub fn has_joined(&self) -> bool {
        matches!(self.stage, Stage::Following)
    }

    /// The [hash](World::hash) that the shown terrain has once everything from [`take_shown`](Self::take_shown) is put.
    pub fn shown_hash(&self) -> u64 {
        self.replica.shown_hash()
    }

    /// All that is to be put into a terrain that does not hold what it should, for example because a change was refused
    /// there. It takes the place of everything that [`take_shown`](Self::take_shown) would return now.
    pub fn show_whole(&mut self, shown: &World) -> ShownChange {
        let (_, receipts) = self.replica.update();
        self.shown.clear();
        self.report_predictions(receipts.unwrap_or_default());
        self.replica.whole(shown)
    }

    /// Its statistics.
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
        } else if !self.stamps.can_send(&edit) {
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

    /// An earlier name of [`submit`](Self::submit).
    #[doc(hidden)]
    pub fn dig(&mut self, edit: Edit) {
        self.submit(edit);
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

    /// Changes for the shown terrain, in order, for [`Terrain::submit`](crate::terrain::Terrain::submit);
    /// each is returned once.
    pub fn take_shown(&mut self) -> Vec<ShownChange> {
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

    /// Looks at a message. Entries with stamps whose images are missing wait for these.
    fn read(&mut self, lane: Lane, bytes: Vec<u8>) {
        let ground = self.replica.world().shared_ground();
        match ToClient::read(&bytes, &ground, &self.stamps) {
            Ok((message, missing)) if missing.is_empty() => self.take(lane, message),
            Ok((ToClient::Entries(entries), missing)) => {
                if self.has_begun[lane as usize] {
                    self.note_received(lane, &entries);
                    self.outgoing.extend(self.images.park(lane, bytes, missing));
                }
            }
            _ => self.figures.malformed += 1,
        }
    }

    fn take(&mut self, lane: Lane, message: ToClient) {
        if !self.has_begun[lane as usize]
            && !matches!(message, ToClient::Stream { .. } | ToClient::Kicked(_) | ToClient::Greet)
        {
            return;
        }
        match message {
            // Two servers have answered the greeting, one in the place of the other.
            ToClient::Stream { stream } if stream == self.stream && self.has_begun[lane as usize] => {
                self.greet()
            }
            ToClient::Stream { stream } => self.has_begun[lane as usize] = stream == self.stream,
            ToClient::Greet => {
                // One that has greeted waits for the answer.
                if self.is_welcome() {
                    self.greet();
                }
            }
            ToClient::Welcome(welcome) => self.begin(welcome),
            ToClient::Kicked(why) => self.leave(why),
            ToClient::Entries(entries) => self.take_entries(lane, entries),
            ToClient::Failed { number } => self.take_failed(number),
            ToClient::Refused { sequence, why } => self.take_refusal(sequence, why),
            ToClient::Hashes { number, regions } => self.marks.take_theirs(number, regions),
            ToClient::Table { number, regions } => self.take_table(number, &regions),
            ToClient::Region(content) => self.take_region(content),
            ToClient::Durable { number } => self.events.push(ClientEvent::Durable(number)),
            ToClient::Piece(piece) => self.bulk.add(&piece),
            ToClient::Image(image) => self.take_image(image),
            ToClient::Prefab(prefab) => self.take_prefab(prefab),
        }
    }

    fn take_refusal(&mut self, sequence: u64, why: Refusal) {
        self.outbox.answer(sequence, None, self.now);
        if self.undos.remove(&sequence) {
            self.events.push(ClientEvent::UndoRefused(Some(why)));
        } else if why == Refusal::NotJoined {
            // The server has forgotten the session: the edit is sent again.
            if self.is_welcome() {
                self.greet();
            }
        } else if let Some(edit) = self.replica.take_back(sequence) {
            self.refuse_pieces(sequence);
            self.events.push(ClientEvent::Refused { tag: edit.tag(), why: Some(why) });
        }
    }

    fn leave(&mut self, why: KickReason) {
        self.stage = Stage::Disconnected;
        self.events.push(ClientEvent::Kicked(why));
    }

    /// Reads the bulk lane. Messages that arrive there before the welcome wait for it: there is no order between lanes.
    fn read_bulk(&mut self) {
        while self.is_welcome() {
            match self.bulk.next_bytes() {
                Ok(Some(message)) if !matches!(message.first(), Some(&PIECE)) => {
                    self.read(Lane::Bulk, message)
                }
                Ok(None) => return,
                _ => {
                    // Nothing more can be read of this stream.
                    self.figures.malformed += 1;
                    return self.greet();
                }
            }
        }
    }

    /// Records received entries; greets again if others before them are missing.
    fn note_received(&mut self, lane: Lane, Entries { first, entries }: &Entries) {
        let last = first.saturating_add(entries.len() as u64).saturating_sub(1);
        if lane == Lane::Order && self.is_welcome() {
            if *first > self.received.saturating_add(1) {
                // Something is missing: what follows waits until it has come.
                self.figures.gaps += 1;
                self.greet();
            }
            self.received = self.received.max(last);
        }
    }

    fn take_entries(&mut self, lane: Lane, entries: Entries) {
        self.note_received(lane, &entries);
        let from = self.number();
        let Entries { first, entries } = entries;
        let numbered =
            entries.into_iter().enumerate().map(|(at, entry)| (first.saturating_add(at as u64), entry));
        self.waiting.extend(numbered.filter(|(number, _)| *number > from));
    }

    /// Applies entries that have come, as many as one call may; returns whether more could be.
    fn follow(&mut self) -> bool {
        let mut left = BATCH;
        loop {
            self.finish_repair();
            self.begin_repair();
            let Some(end) = self.applicable() else { return false };
            let batch = self.next_batch(end, left);
            if batch.is_empty() {
                return left == 0;
            }
            left -= batch.len();
            self.apply(batch);
        }
    }

    /// The number up to which entries may be applied now; `None` if none may.
    fn applicable(&self) -> Option<u64> {
        match self.stage {
            Stage::ByLog { to, .. } => Some(to),
            Stage::Following => self.repair.as_ref().map_or(Some(u64::MAX), Repair::number),
            _ => None,
        }
    }

    /// The next entries up to a number, at most `most`. A mark ends them, and parts are returned alone, because pieces
    /// that they turn into ground have to be found.
    fn next_batch(&mut self, end: u64, most: usize) -> Vec<Entry> {
        let (mut batch, mut number) = (Vec::new(), self.number());
        let is_parts = |entry: Option<&Entry>| entry.is_some_and(|entry| entry.parts().is_some());
        while number < end
            && batch.len() < most
            && (batch.is_empty() || !is_parts(self.waiting.get(&(number + 1))))
            && let Some(entry) = self.waiting.remove(&(number + 1))
        {
            number += 1;
            let entry = self.valid(number, entry);
            let is_compared = matches!((&entry, &self.stage), (Entry::HashCheck, Stage::Following));
            let is_checked = is_compared || entry.parts().is_some();
            batch.push(entry);
            if is_checked {
                break;
            }
        }
        batch
    }

    fn apply(&mut self, batch: Vec<Entry>) {
        let Some(mut epoch) = self.epoch else { return };
        let id = self.id;
        let sequence_of = |entry: &Entry| entry.edit().and_then(|_| entry.number_of(id));
        let is_reported = !self.is_history();
        let tag = |sequence| Some((sequence, self.replica.pending_edit(sequence)?.tag()));
        let tags: BTreeMap<u64, u64> = batch.iter().filter_map(sequence_of).filter_map(tag).collect();
        for entry in &batch {
            if let Some(sequence) = entry.number_of(id) {
                let cost = entry.parts().map(|_| UNDO + entry_bytes(entry) as u64 / UNDO_BYTES);
                self.outbox.answer(sequence, cost, self.now);
            }
        }
        let reach_of_parts = batch.first().and_then(|first| reach(first.parts()?));
        let ground = reach_of_parts.map(|reach| self.ground_pieces(Some(reach))).unwrap_or_default();
        let applied = self.replica.apply(&batch, sequence_of);
        let mut receipts = applied.receipts.into_iter();
        for entry in &batch {
            epoch.number += 1;
            let Entry::Order { by, order } = entry else { continue };
            match order {
                Order::Edit(edit) => {
                    self.reaches.note(epoch.number, edit.reach());
                    let Some(receipt) = receipts.next() else { continue };
                    // Its player may have been here before, in another client.
                    match sequence_of(entry).and_then(|sequence| tags.get(&sequence).copied()) {
                        Some(tag) => {
                            let receipt = Receipt { tag, ..receipt };
                            self.confirm_pieces(sequence_of(entry), &receipt);
                            self.events.push(ClientEvent::Confirmed { tag, receipt: Some(receipt) });
                        }
                        None if is_reported => {
                            self.confirm_pieces(None, &receipt);
                            let author = by.map_or(ClientId::SERVER, |(author, _)| author);
                            self.events.push(ClientEvent::RemoteEdit { author, receipt });
                        }
                        None => {}
                    }
                }
                Order::Parts { change, .. } => {
                    let mut restored = receipts.next().and_then(|receipt| receipt.outcome.ok());
                    let is_missing = restored.is_none();
                    let reach = reach(change);
                    let returned =
                        reach.map(|reach| self.check_pieces(Some(reach), &ground)).unwrap_or_default();
                    restored.iter_mut().for_each(|restored| restored.returned.clone_from(&returned));
                    if entry.number_of(id).is_some_and(|sequence| self.undos.remove(&sequence)) {
                        self.events.push(ClientEvent::Undone(restored));
                    }
                    reach.into_iter().for_each(|reach| self.reaches.note(epoch.number, reach));
                    if applied.failed_locally && is_missing {
                        let regions = change.bricks.iter().map(|(pos, _)| RegionPos::of(*pos));
                        self.doubtful.extend(regions);
                    }
                }
                _ => {}
            }
        }
        self.figures.applied += batch.len() as u64;
        self.epoch = Some(epoch);
        if matches!(self.stage, Stage::Following) {
            self.marks.touch(applied.regions);
            if matches!(batch.last(), Some(Entry::HashCheck)) {
                self.marks.mark(epoch.number, &mut self.replica);
            }
        }
        self.finish_log();
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

/// A box around all bricks of a change.
fn reach(change: &Patch) -> Option<LatticeBox> {
    change.bricks.iter().map(|(pos, _)| pos.samples()).reduce(LatticeBox::union)
}
