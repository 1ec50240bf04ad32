//! Handles messages from clients.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use super::sequences::SequenceCheck;
use super::session::Fetch;
use super::{Later, Server, UndoRequest};
use crate::brush::Edit;
use crate::format::bricks::is_possible;
use crate::format::contents::MAX_IMAGE;
use crate::ground::GreyImage;
use crate::lattice::RegionPos;
use crate::net::ContentId;
use crate::net::message::{ClientId, KickReason, MAX_REGIONS, Refusal, ToClient, ToServer};
use crate::net::price::{UNDO, cost};

/// The cost of a greeting in the count of flooding. The greetings that are [answered](super::players) in a second cost
/// more work.
const HELLO: u64 = 200;
/// The cost of each fetched region.
const REGION: u64 = 1;
/// Bytes of a message that cost 1.
const BYTES: u64 = 64;

/// The maximum number of messages and regions that wait in a client's bulk lane before it may fetch more.
const MAX_JOBS: usize = 2 * MAX_REGIONS;

impl Server {
    /// Handles a message of a client. Any bytes are answered, or counted as invalid.
    pub fn receive(&mut self, client: ClientId, bytes: &[u8], now: Duration) {
        self.now = self.now.max(now);
        self.figures.messages += 1;
        if !self.sessions.contains_key(&client) {
            self.figures.strays += 1;
            return;
        }
        if !self.may_go_on(client, 1 + bytes.len() as u64 / BYTES, now) {
            return;
        }
        let is_valid = match ToServer::read(bytes, &self.contents) {
            Ok((ToServer::Hello(hello), _)) if self.may_go_on(client, HELLO, now) => {
                self.greet(client, None, hello);
                true
            }
            Ok((ToServer::Greeting { stream, hello }, _)) if self.may_go_on(client, HELLO, now) => {
                self.greet(client, Some(stream), hello);
                true
            }
            Ok((ToServer::Hello(_) | ToServer::Greeting { .. }, _)) => true,
            Ok((ToServer::Edits { first, edits }, refused)) => {
                self.receive_edits(client, first, edits, &refused, now)
            }
            Ok((ToServer::Undo { sequence, of }, _)) => self.receive_undo(client, sequence, of, now),
            Ok((message, _)) => {
                // Messages of an earlier stream are ignored.
                let has_joined = self.sessions.get(&client).is_some_and(|session| session.has_joined());
                !has_joined || self.receive_joined(client, message, now)
            }
            Err(_) => false,
        };
        if !is_valid {
            self.figures.malformed += 1;
            if self.sessions.contains_key(&client) && !self.players.player(client).malformed.spend(now, 1) {
                self.kick_for(client, KickReason::Malformed);
            }
        }
    }

    /// Handles a message that only joined clients send.
    fn receive_joined(&mut self, client: ClientId, message: ToServer, now: Duration) -> bool {
        match message {
            ToServer::Fetch { number, regions } => self.receive_fetch(client, number, regions, now),
            ToServer::Ack { bulk, number } => self.receive_ack(client, bulk, number),
            ToServer::Images { images } => self.receive_images(client, images),
            _ => false,
        }
    }

    /// Counts what messages cost, and kicks a client that floods.
    fn may_go_on(&mut self, client: ClientId, cost: u64, now: Duration) -> bool {
        let may = self.players.player(client).flood.spend(now, cost);
        if !may {
            self.kick_for(client, KickReason::Flood);
        }
        may
    }

    /// `refused` are the positions of edits with content that the server lacks, or that are beyond the limits of edits.
    fn receive_edits(
        &mut self,
        client: ClientId,
        first: u64,
        edits: Vec<Edit>,
        refused: &BTreeMap<usize, Refusal>,
        now: Duration,
    ) -> bool {
        if first == 0 || first.checked_add(edits.len() as u64).is_none() {
            return false;
        }
        for (index, edit) in edits.into_iter().enumerate() {
            let sequence = first + index as u64;
            self.figures.edits += 1;
            if !self.sessions.get(&client).is_some_and(|session| session.takes_edits()) {
                // It counts as not seen: the client may send it again once it has joined.
                self.refuse(client, sequence, Refusal::NotJoined);
                continue;
            }
            match self.sequences.judge(client, sequence) {
                SequenceCheck::New => self.sequences.note(client, sequence),
                SequenceCheck::Old => continue,
                SequenceCheck::Impossible => return false,
            }
            // An edit that is too large is refused each time, and does not count as flooding.
            let cost = cost(self.terrain.world().grid(), &edit);
            let counted = cost.unwrap_or_default().min(self.settings.cost.burst / 16);
            if !self.may_go_on(client, counted, now) {
                return true;
            }
            if let Some(why) = refused.get(&index) {
                self.refuse(client, sequence, *why);
                continue;
            }
            match self.validate(client, &edit, cost, now) {
                Ok(cost) => self.order_edit(client, sequence, edit, cost),
                Err(why) => self.refuse(client, sequence, why),
            }
        }
        true
    }

    fn receive_undo(&mut self, client: ClientId, sequence: u64, of: ClientId, now: Duration) -> bool {
        if !self.sessions.get(&client).is_some_and(|session| session.takes_edits()) {
            self.refuse(client, sequence, Refusal::NotJoined);
            return true;
        }
        match self.sequences.judge(client, sequence) {
            SequenceCheck::New => self.sequences.note(client, sequence),
            SequenceCheck::Old => return true,
            SequenceCheck::Impossible => return false,
        }
        if !self.may_go_on(client, UNDO, now) {
            return true;
        }
        match self.validate_undo(client, of, now) {
            Ok(()) => {
                self.waiting_cost += UNDO;
                self.later.push_back(Later::Undo(UndoRequest { by: client, sequence, of }));
            }
            Err(why) => self.refuse(client, sequence, why),
        }
        true
    }

    fn receive_fetch(
        &mut self,
        client: ClientId,
        number: u64,
        regions: Vec<RegionPos>,
        now: Duration,
    ) -> bool {
        let Some(session) = self.sessions.get(&client) else { return true };
        let is_valid = number <= self.epoch.number
            && session.regions_waiting().saturating_add(regions.len()) <= MAX_JOBS
            && regions.iter().all(|region| is_possible(*region));
        if is_valid
            && self.may_go_on(client, REGION * regions.len() as u64, now)
            && let Some(session) = self.sessions.get_mut(&client)
        {
            session.fetches.push_back(Fetch { number, regions });
        }
        is_valid
    }

    fn receive_ack(&mut self, client: ClientId, bulk: u64, number: u64) -> bool {
        let Some(session) = self.sessions.get_mut(&client) else { return true };
        if number > self.epoch.number || !session.bulk.acknowledge(bulk, self.now) {
            return false;
        }
        session.acknowledged = number;
        session.order.acknowledge(number);
        session.compared.take_if(|(compared, _)| number > *compared);
        true
    }

    /// Sends images and prefabs that a client lacks, each once.
    fn receive_images(&mut self, client: ClientId, images: Vec<ContentId>) -> bool {
        for id in images {
            let is_small = |image: &&Arc<GreyImage>| size_of_val(image.samples()) <= MAX_IMAGE;
            let image = self.contents.get(id).filter(is_small);
            let prefab = self.contents.prefab(id);
            if image.is_none() && prefab.is_none() {
                return false;
            }
            let Some(session) = self.sessions.get_mut(&client) else { return true };
            if session.images.insert(id) {
                image.map(Arc::clone).into_iter().for_each(|image| session.bulk.push_image(image));
                prefab.map(Arc::clone).into_iter().for_each(|prefab| session.bulk.push_prefab(prefab));
            }
        }
        true
    }

    pub(super) fn refuse(&mut self, client: ClientId, sequence: u64, why: Refusal) {
        self.figures.refused += 1;
        self.send(client, &ToClient::Refused { sequence, why });
    }
}
