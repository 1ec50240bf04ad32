//! The latest entries of the log as data of a store, and the runs of the server that it goes through. A client that
//! was here before a restart gets the entries that it misses, as after a short loss of its connection.
//!
//! | key | value |
//! | --- | --- |
//! | `order/` and the number of the first entry in hexadecimal | the last number, names of content, a message with entries |
//! | `runs` | the runs of the server, each with the number that it began with |
//! | `state` | the number and the [state](state_of) that the entries lead to, and whether they began with the pristine world |
//!
//! The store keeps these together with the commits: after a crash, the log ends with the world that was saved.

use std::collections::{BTreeSet, VecDeque};

use xxhash_rust::xxh3::Xxh3Default;

use super::keys::{NUMBER, RESERVED};
use crate::format::bytes::{Reader, put_number};
use crate::format::{FormatError, plain};
use crate::net::ContentId;
use crate::net::encoding::EntryWriter;
use crate::net::message::{Entry, PROTOCOL};
use crate::store::Store;
use crate::terrain::Terrain;

/// Below [`RESERVED`].
const ORDER: &str = "order/";
const RUNS: &str = "runs";
const STATE: &str = "state";

/// The maximum number of bytes of entries that are saved; a checkpoint holds all of them.
const MAX_BYTES: usize = 256 << 10;

/// Bytes after which a piece is complete. Until then, each frame of the journal has it again.
const PIECE_BYTES: usize = 256;

/// Bytes that a piece takes in addition to its message.
const PIECE_HEAD: usize = 64;

/// The maximum number of entries that wait until the server is saved.
const MAX_UNSAVED: usize = 1 << 16;

/// The maximum number of runs that are known.
const MAX_RUNS: usize = 64;

/// Entries with consecutive numbers, as a message.
#[derive(Clone, Debug)]
pub struct Piece {
    pub first: u64,
    pub last: u64,
    /// The content that its edits name.
    pub names: BTreeSet<ContentId>,
    pub message: Vec<u8>,
}

impl Piece {
    fn key(first: u64) -> String {
        format!("{RESERVED}{ORDER}{first:016x}")
    }

    fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(PIECE_HEAD + self.message.len());
        put_number(&mut bytes, self.last);
        put_number(&mut bytes, self.names.len() as u64);
        self.names.iter().for_each(|name| bytes.extend_from_slice(&name.0.to_le_bytes()));
        bytes.extend_from_slice(&self.message);
        bytes
    }

    fn decode(first: u64, bytes: &[u8]) -> Result<Self, FormatError> {
        let mut reader = Reader(bytes);
        let last = reader.number()?;
        let mut names = BTreeSet::new();
        for _ in 0..reader.count()? {
            names.insert(ContentId(u64::from_le_bytes(reader.array()?)));
        }
        Ok(Self { first, last, names, message: reader.0.to_vec() })
    }
}

/// What a store has of the log of its world.
pub struct FoundLog {
    /// The latest entries, up to the present number.
    pub pieces: Vec<Piece>,
    /// Whether the first entry of all followed the pristine world.
    pub is_whole: bool,
    pub saved: SavedLog,
}

/// The log as it is saved.
pub struct SavedLog {
    /// The runs that the log goes through, oldest first, each with the number that it began with. The last is the
    /// present one.
    runs: VecDeque<(u64, u64)>,
    is_whole: bool,
    /// The maximum number of bytes of saved entries.
    limit: usize,
    /// The number of the last entry that was saved.
    number: u64,
    /// Later entries, with their numbers.
    unsaved: VecDeque<(u64, Entry)>,
    /// The first numbers of the pieces that are saved, and the bytes of each.
    pieces: VecDeque<(u64, usize)>,
    bytes: usize,
    /// The entries of the last piece, which is not complete.
    tail: EntryWriter,
    names: BTreeSet<ContentId>,
    /// Keys that are of no use.
    stale: Vec<String>,
}

impl SavedLog {
    /// Reads the log of a store whose world is at this number and state, for a new run of the server.
    pub fn open(store: &Store, terrain: &Terrain, run: u64, number: u64, log_bytes: usize) -> FoundLog {
        let state = store.get(&format!("{RESERVED}{STATE}")).and_then(|bytes| State::decode(bytes).ok());
        // Otherwise something has changed the world, or lost a part of it, that is in no entry, or another build saved them.
        let state = state.filter(|state| (state.number, state.hash) == (number, state_of(terrain)));
        let runs = store.get(&format!("{RESERVED}{RUNS}")).filter(|_| state.is_some());
        let mut runs = runs.and_then(|bytes| decode_runs(bytes).ok()).unwrap_or_default();
        runs.push_back((run, number));
        let (mut found, mut stale) = (Vec::new(), Vec::new());
        let prefix = format!("{RESERVED}{ORDER}");
        for (key, bytes) in store.game_data().range(prefix.clone()..) {
            let Some(first) = key.strip_prefix(&prefix) else { break };
            let first = u64::from_str_radix(first, 16).ok().filter(|first| Piece::key(*first) == *key);
            match first.and_then(|first| Piece::decode(first, bytes).ok()) {
                Some(piece) => found.push(piece),
                None => stale.push(key.clone()),
            }
        }
        let mut next = number.checked_add(1).filter(|_| state.is_some());
        let is_next = |piece: &&Piece| {
            let is_next = piece.last.checked_add(1) == next && piece.first <= piece.last;
            next = next.filter(|_| is_next).map(|_| piece.first);
            is_next
        };
        let count = found.iter().rev().take_while(is_next).count();
        let pieces = found.split_off(found.len() - count);
        stale.extend(found.iter().map(|piece| Piece::key(piece.first)));
        let sizes: VecDeque<(u64, usize)> =
            pieces.iter().map(|piece| (piece.first, piece.message.len() + PIECE_HEAD)).collect();
        let is_whole = state.is_some_and(|state| state.is_whole);
        let saved = Self {
            runs,
            is_whole,
            limit: log_bytes.min(MAX_BYTES),
            number,
            unsaved: VecDeque::new(),
            bytes: sizes.iter().map(|(_, bytes)| bytes).sum(),
            pieces: sizes,
            tail: EntryWriter::default(),
            names: BTreeSet::new(),
            stale,
        };
        FoundLog { pieces, is_whole, saved }
    }

    /// Sets whether the log begins with the pristine world.
    pub fn set_whole(&mut self, is_whole: bool) {
        self.is_whole = is_whole;
    }

    /// The number up to which the log of an earlier run is the present one.
    pub fn shared_with(&self, run: u64) -> Option<u64> {
        let at = self.runs.iter().position(|(own, _)| *own == run)?;
        // A run continues from what was saved of the one before.
        self.runs.iter().skip(at + 1).map(|(_, began)| *began).min()
    }

    /// Adds an entry that was ordered. It is saved once it is applied.
    pub fn push(&mut self, number: u64, entry: &Entry) {
        if self.unsaved.len() == MAX_UNSAVED {
            // The gap shows in the numbers.
            self.unsaved.clear();
        }
        self.unsaved.push_back((number, entry.clone()));
    }

    /// Takes out an entry that could not be applied, and all before it: the world is not what they lead to.
    pub fn fail(&mut self, number: u64) {
        while self.unsaved.pop_front_if(|(own, _)| *own <= number).is_some() {}
    }

    /// Gives a store the entries up to this number, which lead to this terrain.
    pub fn save(&mut self, store: &mut Store, number: u64, terrain: &Terrain) {
        std::mem::take(&mut self.stale).into_iter().for_each(|key| store.remove(key));
        while let Some((next, entry)) = self.unsaved.pop_front_if(|(own, _)| *own <= number) {
            if self.number.checked_add(1) != Some(next) {
                self.forget(store);
            }
            let edit = entry.edit();
            self.names.extend(edit.iter().flat_map(|edit| edit.contents()).map(ContentId::of_content));
            self.tail.put(&entry);
            self.number = next;
            if self.tail.len() >= PIECE_BYTES {
                self.put_tail(store);
                (self.tail, self.names) = Default::default();
            }
        }
        if self.number != number {
            self.forget(store);
            self.number = number;
        }
        self.put_tail(store);
        while self.bytes > self.limit
            && let Some((first, bytes)) = self.pieces.pop_front()
        {
            store.remove(Piece::key(first));
            self.bytes -= bytes;
            if self.pieces.is_empty() {
                (self.tail, self.names) = Default::default();
            }
        }
        self.runs.drain(..self.runs.len().saturating_sub(MAX_RUNS));
        store.put(format!("{RESERVED}{RUNS}"), encode_runs(&self.runs));
        let state = State { number, hash: state_of(terrain), is_whole: self.is_whole };
        store.put(format!("{RESERVED}{STATE}"), state.encode());
        store.put(format!("{RESERVED}{NUMBER}"), number.to_le_bytes());
    }

    fn put_tail(&mut self, store: &mut Store) {
        let Some(message) = self.tail.message(self.number) else { return };
        let (first, bytes) = (self.number - (self.tail.count() - 1), message.len() + PIECE_HEAD);
        if let Some((_, old)) = self.pieces.pop_back_if(|(own, _)| *own == first) {
            self.bytes -= old;
        }
        self.bytes += bytes;
        self.pieces.push_back((first, bytes));
        let piece = Piece { first, last: self.number, names: self.names.clone(), message };
        store.put(Piece::key(first), piece.encode());
    }

    /// Removes all entries: they do not lead to what follows.
    fn forget(&mut self, store: &mut Store) {
        self.pieces.drain(..).for_each(|(first, _)| store.remove(Piece::key(first)));
        self.bytes = 0;
        (self.tail, self.names) = Default::default();
    }
}

/// The state that the saved entries lead to.
#[derive(Clone, Copy)]
struct State {
    number: u64,
    hash: u64,
    is_whole: bool,
}

impl State {
    fn encode(self) -> Vec<u8> {
        let mut bytes = [self.number.to_le_bytes(), self.hash.to_le_bytes()].concat();
        bytes.push(self.is_whole.into());
        bytes
    }

    fn decode(bytes: &[u8]) -> Result<Self, FormatError> {
        let mut reader = Reader(bytes);
        let [number, hash] = [reader.array()?, reader.array()?].map(u64::from_le_bytes);
        let is_whole = reader.byte()? == 1;
        reader.end()?;
        Ok(Self { number, hash, is_whole })
    }
}

/// A hash of everything that entries lead to: samples and their ground, revision, names of fields, rules, loose
/// settings. Those of a build with another simulation may lead elsewhere, and with another protocol they can't be read.
fn state_of(terrain: &Terrain) -> u64 {
    let (world, mut hash) = (terrain.world(), Xxh3Default::new());
    for number in [world.hash(), world.revision(), world.next_field()] {
        hash.update(&number.to_le_bytes());
    }
    hash.update(&plain::to_bytes(&terrain.rules()));
    hash.update(&plain::to_bytes(&terrain.loose()));
    [Terrain::SIMULATION, PROTOCOL].iter().for_each(|number| hash.update(&number.to_le_bytes()));
    hash.digest()
}

fn encode_runs(runs: &VecDeque<(u64, u64)>) -> Vec<u8> {
    let mut bytes = Vec::new();
    put_number(&mut bytes, runs.len() as u64);
    for (run, began) in runs {
        bytes.extend_from_slice(&run.to_le_bytes());
        put_number(&mut bytes, *began);
    }
    bytes
}

fn decode_runs(bytes: &[u8]) -> Result<VecDeque<(u64, u64)>, FormatError> {
    let mut reader = Reader(bytes);
    let runs = (0..reader.count()?).map(|_| Ok((u64::from_le_bytes(reader.array()?), reader.number()?)));
    let runs: VecDeque<(u64, u64)> = runs.collect::<Result<_, FormatError>>()?;
    reader.end()?;
    Ok(runs)
}
