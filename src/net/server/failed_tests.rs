//! Entries that fail on the server for a reason that other machines do not have: no client applies them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use glam::{IVec3, Vec3};

use super::*;
use crate::brush::{Brush, Shape};
use crate::ground::Ground;
use crate::net::regions::regions_of;
use crate::net::{Client, ClientEvent, region_hash};
use crate::terrain::{Order, Patch, TerrainSettings, WorkLimits};

fn terrain(ground: &Arc<Ground>) -> Terrain {
    Terrain::new(Arc::clone(ground), &TerrainSettings::default()).expect("valid settings")
}

fn dig(x: f32, z: f32) -> Edit {
    Edit::quantize(&Brush::dig(Shape::sphere(Vec3::new(x, 20.0, z), 5.0))).expect("a valid brush")
}

/// A server and clients without a line between them.
struct Play {
    ground: Arc<Ground>,
    server: Server,
    clients: BTreeMap<ClientId, (Client, Vec<ClientEvent>)>,
    now: Duration,
}

impl Play {
    fn new() -> Self {
        let ground = Arc::new(Ground::flat(128, 128, 20.0).expect("a valid ground"));
        let server = Server::new(terrain(&ground), ServerSettings::default());
        let mut play = Self { ground, server, clients: BTreeMap::new(), now: Duration::from_secs(1) };
        (1..3).for_each(|id| play.join(id));
        play.frames(3);
        play
    }

    fn join(&mut self, id: u64) {
        let mut client =
            Client::new(Arc::clone(&self.ground), &TerrainSettings::default()).expect("valid settings");
        client.set_position(IVec3::new(64, 20, 64));
        client.connect(self.now);
        self.server.connect(ClientId(id), self.now);
        self.clients.insert(ClientId(id), (client, Vec::new()));
    }

    fn dig(&mut self, id: u64, edit: Edit) {
        self.clients.get_mut(&ClientId(id)).expect("a client").0.submit(edit);
    }

    /// To the clients go the messages that wait.
    fn deliver(&mut self) {
        for (to, lane, bytes) in self.server.take_outgoing() {
            self.clients.get_mut(&to).expect("a client").0.receive(lane, bytes);
        }
        for (client, events) in self.clients.values_mut() {
            client.advance(self.now);
            events.extend(client.take_events());
        }
    }

    /// What clients have to say gets to the server.
    fn collect(&mut self) {
        self.now += Duration::from_millis(50);
        for (id, (client, _)) in &mut self.clients {
            for message in client.take_outgoing() {
                self.server.receive(*id, &message, self.now);
            }
        }
    }

    fn frames(&mut self, count: u32) {
        for _ in 0..count {
            self.collect();
            self.server.advance(self.now);
            self.deliver();
        }
    }

    /// The server applies edits that wait, while its terrain has no room for them: it is to dig in the air.
    fn apply_without_room(&mut self) {
        let (hash, terrain) = (self.server.terrain.world().hash(), &mut self.server.terrain);
        terrain.submit(Brush::dig(Shape::sphere(Vec3::new(60.0, 90.0, 60.0), 5.0)));
        terrain.set_work_limits(WorkLimits { waiting: 1, ..WorkLimits::UNBOUNDED });
        self.server.apply();
        self.server.terrain.set_work_limits(WorkLimits::UNBOUNDED);
        assert_eq!(self.server.terrain.world().hash(), hash);
    }

    /// The server fails at the next entry.
    fn fail_at_next(&mut self) {
        assert!(self.server.waiting.pop_front().is_some());
        self.server.fail(self.server.applied + 1);
        self.server.applied += 1;
    }

    fn events(&self, id: u64, is_one: impl Fn(&ClientEvent) -> bool) -> usize {
        self.clients[&ClientId(id)].1.iter().filter(|event| is_one(event)).count()
    }

    /// Everybody has the server's world, with fields of the same names; returns its hash.
    fn agreed(&mut self) -> u64 {
        self.frames(60);
        let world = self.server.terrain().world();
        let regions = regions_of(world);
        assert_eq!(self.server.figures().malformed, 0);
        for (client, _) in self.clients.values() {
            assert_eq!((client.number(), client.pending()), (self.server.epoch().number, 0));
            assert_eq!(client.world().hash(), world.hash());
            assert_eq!(client.shown_hash(), world.hash());
            assert_eq!(regions_of(client.world()), regions);
            for region in &regions {
                assert_eq!(region_hash(client.world(), *region), region_hash(world, *region));
            }
        }
        world.hash()
    }

    fn repairs(&self) -> Vec<u64> {
        self.clients.values().map(|(client, _)| client.figures().repairs).collect()
    }
}

/// The edit is not done, and nobody is to blame.
const REFUSED: fn(&ClientEvent) -> bool = |event| matches!(event, ClientEvent::Refused { why: None, .. });

#[test]
fn clients_that_applied_a_failed_entry_fetch_its_regions() {
    let mut play = Play::new();
    let pristine = play.agreed();
    play.dig(1, dig(40.0, 40.0));
    play.collect();
    play.deliver();
    assert!(play.clients.values().all(|(client, _)| client.world().hash() != pristine), "they are ahead");
    play.apply_without_room();
    assert_eq!(play.agreed(), pristine);
    assert_eq!(play.server.figures().failed, 1);
    assert!(play.repairs().iter().all(|repairs| *repairs > 0));
    // Later names of fields are equal too.
    play.dig(2, dig(80.0, 80.0));
    let repairs = play.repairs();
    assert_ne!(play.agreed(), pristine);
    assert_eq!(play.repairs(), repairs);
}

#[test]
fn a_failed_entry_that_clients_have_not_applied_does_nothing() {
    let mut play = Play::new();
    let pristine = play.agreed();
    play.dig(1, dig(40.0, 40.0).with_labels(7, None));
    play.collect();
    play.apply_without_room();
    // The entry and the report of its failure arrive together.
    assert_eq!(play.agreed(), pristine);
    assert_eq!((play.events(1, REFUSED), play.events(2, REFUSED)), (1, 0));
    assert_eq!(play.events(1, |event| matches!(event, ClientEvent::Confirmed { .. })), 0);
    assert_eq!(play.repairs(), [0, 0]);
}

#[test]
fn a_client_that_joins_later_by_the_log_skips_failed_entries_too() {
    let mut play = Play::new();
    play.dig(1, dig(30.0, 30.0));
    play.agreed();
    for x in 0..3 {
        play.dig(1, dig(50.0 + 20.0 * x as f32, 40.0));
        play.collect();
        if x == 1 {
            play.apply_without_room();
        }
        play.frames(3);
    }
    play.agreed();
    let repairs = play.repairs();
    play.join(3);
    play.agreed();
    assert_eq!(play.repairs(), [&repairs[..], &[0]].concat());
    let is_whole = play.clients[&ClientId(3)].0.figures().applied == play.server.epoch().number;
    assert!(is_whole, "it did not get the log");
}

#[test]
fn regions_of_failed_parts_are_fetched() {
    let mut play = Play::new();
    let pristine = play.agreed();
    let mut other = terrain(&play.ground);
    other.apply([Brush::dig(Shape::sphere(Vec3::new(40.0, 20.0, 40.0), 5.0))]);
    let Patch { bricks, fields, next_field } = other.parts().change;
    for is_known in [false, true] {
        let change = Patch { bricks: bricks.clone(), fields: fields.clone(), next_field };
        play.server.submit(Order::parts(change, None)).expect("it is short");
        if is_known {
            play.deliver();
        }
        play.fail_at_next();
        assert_eq!(play.agreed(), pristine);
        assert_eq!(play.repairs().iter().all(|repairs| *repairs > 0), is_known);
    }
}
