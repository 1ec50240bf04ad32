//! A server and clients of this crate, with lines between them that lose nothing.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{
    Client, ClientEvent, ClientId, ContentTable, Hello, Server, ServerSettings, ToServer,
};
use bevy_burrow::prelude::*;
use glam::{DVec3, IVec3, Vec3};

use crate::follower::terrain;

pub const FRAME: Duration = Duration::from_millis(50);
pub const BEGIN: Duration = Duration::from_secs(1);
pub const ONE: ClientId = ClientId(1);

pub fn flat(side: u32) -> Arc<Ground> {
    Arc::new(Ground::flat(side, side, 20.0).expect("a valid ground"))
}

pub fn ball(x: f32, z: f32, radius: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 20.0, z), radius))
}

pub fn edit(brush: &Brush) -> Edit {
    Edit::quantize(brush).expect("a valid brush")
}

/// A client of this test, which greets, joins, and can send any messages.
pub fn let_in(server: &mut Server, id: ClientId, ground: &Ground, now: Duration) {
    let (chunk_size, ground, position) = (32, ground.hash(), IVec3::splat(20));
    let (protocol, simulation) = (Server::PROTOCOL, Terrain::SIMULATION);
    let hello = Hello { protocol, simulation, ground, chunk_size, epoch: None, position };
    server.connect(id, now);
    server.receive(id, &ToServer::Hello(hello).to_bytes(), now);
    server.advance(now);
    drop(server.take_outgoing());
}

pub fn send(server: &mut Server, id: ClientId, first: u64, edits: Vec<Edit>, now: Duration) {
    server.receive(id, &ToServer::Edits { first, edits }.to_bytes(), now);
}

/// A server and clients of this crate; lines between them lose nothing.
pub struct Play {
    pub ground: Arc<Ground>,
    pub server: Server,
    pub players: Vec<Player>,
    pub now: Duration,
}

pub struct Player {
    pub id: ClientId,
    pub client: Client,
    /// What the player sees, in tests that look at it.
    pub shown: Option<Terrain>,
    pub is_connected: bool,
    pub events: Vec<ClientEvent>,
}

impl Player {
    pub fn count(&self, is_such: impl Fn(&ClientEvent) -> bool) -> usize {
        self.events.iter().filter(|event| is_such(event)).count()
    }

    pub fn confirmed(&self) -> usize {
        self.count(|event| matches!(event, ClientEvent::Confirmed { .. }))
    }

    pub fn refused(&self) -> usize {
        self.count(|event| matches!(event, ClientEvent::Refused { .. }))
    }

    pub fn kicked(&self) -> usize {
        self.count(|event| matches!(event, ClientEvent::Kicked(_)))
    }
}

impl Play {
    pub fn new(ground: &Arc<Ground>, settings: ServerSettings) -> Self {
        Self::of(ground, Server::new(terrain(ground), settings))
    }

    pub fn of(ground: &Arc<Ground>, server: Server) -> Self {
        Self { ground: Arc::clone(ground), server, players: Vec::new(), now: BEGIN }
    }

    pub fn join(&mut self, id: u64) -> usize {
        self.join_with(id, ContentTable::default(), None)
    }

    /// A player with this content joins, and sees the world in a terrain.
    pub fn join_with(&mut self, id: u64, contents: ContentTable, shown: Option<Terrain>) -> usize {
        let mut client = Client::new(Arc::clone(&self.ground), &TerrainSettings::default()).expect("valid");
        client.contents_mut().add_all(&contents);
        let (id, is_connected, events) = (ClientId(id), false, Vec::new());
        self.players.push(Player { id, client, shown, is_connected, events });
        self.connect(self.players.len() - 1);
        self.frames(4);
        self.players.len() - 1
    }

    pub fn connect(&mut self, at: usize) {
        let player = &mut self.players[at];
        self.server.connect(player.id, self.now);
        player.client.connect(self.now);
        player.is_connected = true;
    }

    pub fn cut(&mut self, at: usize) {
        let player = &mut self.players[at];
        self.server.disconnect(player.id);
        player.client.disconnect();
        player.is_connected = false;
    }

    pub fn dig(&mut self, at: usize, brush: &Brush) {
        self.players[at].client.submit(edit(brush));
    }

    pub fn frames(&mut self, count: u32) {
        for _ in 0..count {
            self.now += FRAME;
            for player in self.players.iter_mut().filter(|player| player.is_connected) {
                for message in player.client.take_outgoing() {
                    self.server.receive(player.id, &message, self.now);
                }
            }
            self.server.advance(self.now);
            for (to, lane, bytes) in self.server.take_outgoing() {
                let player = self.players.iter_mut().find(|player| player.id == to && player.is_connected);
                player.into_iter().for_each(|player| player.client.receive(lane, bytes.clone()));
            }
            for player in &mut self.players {
                while player.client.advance(self.now) {}
                for order in player.client.take_shown() {
                    if let Some(shown) = &mut player.shown {
                        shown.apply_one(order).outcome.expect("it fits");
                    }
                }
                player.events.extend(player.client.take_events());
            }
        }
    }

    pub fn hash(&self) -> u64 {
        self.server.terrain().world().hash()
    }

    pub fn is_solid(&self, x: f64, z: f64) -> bool {
        self.server.terrain().world().is_solid(DVec3::new(x, 18.0, z))
    }
}
