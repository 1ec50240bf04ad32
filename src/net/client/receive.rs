//! Received messages.

use super::super::encoding::PIECE;
use super::super::message::{Entries, KickReason, Lane, Refusal, ToClient};
use super::join::Stage;
use super::{Client, ClientEvent};

impl Client {
    /// Looks at a message. Entries whose contents are missing wait for these.
    pub(super) fn read(&mut self, lane: Lane, bytes: Vec<u8>) {
        let ground = self.replica.world().shared_ground();
        match ToClient::read(&bytes, &ground, &self.contents) {
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
            ToClient::Hashes { number, regions } => self.hash_checks.take_theirs(number, regions),
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
    pub(super) fn read_bulk(&mut self) {
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
        if lane == Lane::Main && self.is_welcome() {
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
}
