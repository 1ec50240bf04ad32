//! Messages that come from clients.

use std::time::Duration;

use super::session::Stage;
use super::validation::{UNDO, cost};
use super::{Server, UndoRequest};
use crate::brush::Edit;
use crate::lattice::RegionPos;
use crate::net::message::{ClientId, Hello, Kick, PROTOCOL, Refusal, ToClient, ToServer};
use crate::store::format::bricks::is_possible;
use crate::terrain::SIMULATION;

/// What beginning costs, as flooding is counted: regions are listed, or hashed.
const HELLO: u64 = 4000;
/// What each region costs that is fetched.
const REGION: u64 = 1;
/// Bytes of a message that cost 1.
const BYTES: u64 = 64;

/// Most undos that wait.
const MOST_UNDOS: usize = 256;
/// Most messages and regions that wait in a client's bulk lane before it may fetch more.
const MOST_JOBS: usize = 2 * crate::net::message::MOST_REGIONS;

impl Server {
    /// Takes a message of a client's. Whatever its bytes are, it is answered, or counted as invalid.
    pub fn receive(&mut self, client: ClientId, bytes: &[u8], now: Duration) {
        self.figures.messages += 1;
        if !self.sessions.contains_key(&client) {
            self.figures.strays += 1;
            return;
        }
        if !self.may_go_on(client, 1 + bytes.len() as u64 / BYTES, now) {
            return;
        }
        let is_valid = match ToServer::from_bytes(bytes, &self.stamps) {
            Ok(ToServer::Hello(hello)) => self.greet(client, hello, now),
            Ok(ToServer::Edits { first, edits }) => self.receive_edits(client, first, edits, now),
            Ok(ToServer::Undo { own, of }) => self.receive_undo(client, own, of, now),
            Ok(ToServer::Fetch { number, regions }) => self.receive_fetch(client, number, regions, now),
            Ok(ToServer::Ack { bulk, number }) => self.receive_ack(client, bulk, number),
            Err(_) => false,
        };
        if !is_valid {
            self.figures.malformed += 1;
            let session = self.sessions.get_mut(&client);
            if session.is_some_and(|session| !session.malformed.spend(now, 1)) {
                self.kick_for(client, Kick::Malformed);
            }
        }
    }

    /// Counts what messages cost, and kicks a client that floods.
    fn may_go_on(&mut self, client: ClientId, cost: u64, now: Duration) -> bool {
        let session = self.sessions.get_mut(&client);
        let may = session.is_some_and(|session| session.flood.spend(now, cost));
        if !may {
            self.kick_for(client, Kick::Flood);
        }
        may
    }

    fn greet(&mut self, client: ClientId, hello: Hello, now: Duration) -> bool {
        let world = self.terrain.world();
        let checks = [
            (hello.protocol == PROTOCOL, Kick::Protocol),
            (hello.simulation == SIMULATION, Kick::Simulation),
            (hello.ground == world.ground().hash(), Kick::Ground),
            (i64::from(hello.chunk_size) == i64::from(world.grid().size()), Kick::ChunkSize),
        ];
        if let Some((_, why)) = checks.into_iter().find(|(is_same, _)| !is_same) {
            self.kick_for(client, why);
        } else if self.may_go_on(client, HELLO, now)
            && let Some(session) = self.sessions.get_mut(&client)
        {
            session.stage = Stage::Greeted(hello);
            session.bulk.cancel();
            session.compared = None;
        }
        true
    }

    fn receive_edits(&mut self, client: ClientId, first: u64, edits: Vec<Edit>, now: Duration) -> bool {
        if first == 0 || first.checked_add(edits.len() as u64).is_none() {
            return false;
        }
        for (own, edit) in (first..).zip(edits) {
            self.figures.edits += 1;
            if !self.own_numbers.is_new(client, own) {
                continue;
            }
            // One that is too large is refused, however often it comes: that is no flood.
            let cost = cost(self.terrain.world().grid(), &edit).unwrap_or_default();
            let counted = cost.min(self.settings.cost.burst / 16);
            if !self.may_go_on(client, counted, now) {
                return true;
            }
            match self.validate(client, &edit, now) {
                Ok(cost) => self.order_edit(client, own, edit, cost),
                Err(why) => self.refuse(client, own, why),
            }
        }
        true
    }

    fn receive_undo(&mut self, client: ClientId, own: u64, of: ClientId, now: Duration) -> bool {
        if own == 0 {
            return false;
        }
        if !self.own_numbers.is_new(client, own) || !self.may_go_on(client, UNDO, now) {
            return true;
        }
        let is_full = self.undos.len() >= MOST_UNDOS;
        match self.validate_undo(client, of, now) {
            Ok(()) if is_full => self.refuse(client, own, Refusal::Overloaded),
            Ok(()) => self.undos.push_back(UndoRequest { by: client, own, of }),
            Err(why) => self.refuse(client, own, why),
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
        let waiting = session.bulk.waiting().saturating_add(self.fetches_of(client));
        let is_valid = session.has_joined()
            && number <= self.epoch.number
            && waiting.saturating_add(regions.len()) <= MOST_JOBS
            && regions.iter().all(|region| is_possible(*region));
        if is_valid && self.may_go_on(client, REGION * regions.len() as u64, now) {
            self.fetch(client, number, regions);
        }
        is_valid
    }

    fn receive_ack(&mut self, client: ClientId, bulk: u64, number: u64) -> bool {
        let Some(session) = self.sessions.get_mut(&client) else { return true };
        if !session.has_joined() || number > self.epoch.number || !session.bulk.acknowledge(bulk) {
            return false;
        }
        session.acknowledged = number;
        session.compared.take_if(|(compared, _)| number > *compared);
        true
    }

    pub(super) fn refuse(&mut self, client: ClientId, own: u64, why: Refusal) {
        self.figures.refused += 1;
        self.send(client, &ToClient::Refused { own, why });
    }
}
