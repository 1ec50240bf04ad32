//! Digging together over replicon, without a transport: messages are handed from app to app.

use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::{ClientEvent, Refusal, Server, ServerSettings, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{
    GroundEdited, GroundJoined, GroundServer, SharedTerrain, TogetherPlugin, WhatBecame,
};
use bevy_replicon::prelude::*;
use bevy_replicon::test_app::ServerTestAppExt;

use crate::stage::{Stage, dig};

fn ground() -> Terrain {
    let noise = NoiseHeights { seed: 4, scale: 30.0, amplitude: 10.0, base: 20.0, ..default() };
    let ground = Ground::from_noise(96, 96, &noise).expect("valid ground");
    Terrain::new(ground, &TerrainSettings { chunk_size: 16, ..default() }).expect("valid settings")
}

fn player() -> Stage {
    let plugins = (MinimalPlugins, StatesPlugin, AssetPlugin::default(), MeshPlugin, TransformPlugin);
    let replicon = RepliconPlugins.set(ServerPlugin::new(PostUpdate));
    Stage::with_all((plugins, replicon), TogetherPlugin)
        .recording::<GroundEdited>()
        .recording::<GroundJoined>()
}

/// A server that lets players take back their own strokes, and refuses edits above a height.
fn server() -> GroundServer {
    let settings = ServerSettings { undo: UndoPolicy::Own, ..default() };
    let mut server = Server::new(ground(), settings);
    server.set_permission(|_, edit| edit.reach().max.y < 60);
    GroundServer::new(server)
}

/// A server and players, who exchange messages in each round.
struct Party {
    server: App,
    players: Vec<(Stage, Entity)>,
}

impl Party {
    fn new(players: usize) -> Self {
        let mut server = App::new();
        let replicon = RepliconPlugins.set(ServerPlugin::new(PostUpdate));
        server
            .add_plugins((MinimalPlugins, StatesPlugin, replicon, BurrowPlugins, TogetherPlugin))
            .insert_resource(self::server())
            .finish();
        let mut party = Self { server, players: Vec::new() };
        (0..players).for_each(|_| party.join());
        party
    }

    fn join(&mut self) {
        let mut stage = player();
        let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
        self.server.connect_client(&mut stage.app);
        self.players.push((stage, terrain));
    }

    fn round(&mut self) {
        self.server.update();
        for (stage, _) in &mut self.players {
            self.server.exchange_with_client(&mut stage.app);
            stage.app.update();
            self.server.exchange_with_client(&mut stage.app);
        }
        std::thread::sleep(Duration::from_millis(1));
    }

    fn rounds_until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < Duration::from_secs(120), "never: {what}");
            self.round();
        }
    }

    fn shared(&self, player: usize) -> &SharedTerrain {
        let (stage, terrain) = &self.players[player];
        stage.app.world().get(*terrain).expect("it is shared")
    }

    /// Does each player show the same world as all others, with nothing under way?
    fn agrees(&self) -> bool {
        let states: Vec<_> = (0..self.players.len())
            .map(|player| {
                let (stage, terrain) = &self.players[player];
                (self.shared(player).number(), stage.terrain(*terrain).world().hash())
            })
            .collect();
        let is_settled = (0..states.len())
            .all(|player| self.shared(player).has_joined() && self.shared(player).pending() == 0);
        is_settled && states.windows(2).all(|pair| pair[0] == pair[1])
    }

    fn height_at(&self, player: usize, x: f64, z: f64) -> f32 {
        let (stage, terrain) = &self.players[player];
        stage.terrain(*terrain).world().height(x, z).unwrap_or_default() as f32
    }

    fn send(&mut self, player: usize, brush: Brush) {
        self.players[player].0.send(brush);
    }
}

#[test]
fn what_one_digs_all_see() {
    let mut party = Party::new(3);
    party.rounds_until("all have joined", |party| (0..3).all(|player| party.shared(player).has_joined()));
    let pristine = ground().world().hash();
    for turn in 0..30 {
        let player = turn % 3;
        let (x, z) = (20.0 + (turn * 7 % 50) as f64, 20.0 + (turn * 13 % 50) as f64);
        let height = party.height_at(player, x, z);
        party.send(player, dig(x as f32, height, z as f32, 4.0));
        party.round();
    }
    party.rounds_until("all agree", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && party.shared(0).number() >= 30 && stage.terrain(*terrain).world().hash() != pristine
    });
    for player in 0..3 {
        let (stage, terrain) = &mut party.players[player];
        let terrain = *terrain;
        stage.assert_whole(terrain, "digging together");
        let edited = stage.recorded::<GroundEdited>();
        let count = |is_such: fn(&WhatBecame) -> bool| {
            edited.iter().filter(|edited| is_such(&edited.outcome)).count()
        };
        assert_eq!(count(|outcome| matches!(outcome, WhatBecame::Predicted(_))), 10);
        assert_eq!(count(|outcome| matches!(outcome, WhatBecame::Confirmed(Some(_)))), 10);
        let receipts = stage.receipts();
        assert_eq!(receipts.iter().filter(|receipt| receipt.receipt.outcome.is_ok()).count(), 10);
        let events = stage.recorded::<GroundJoined>();
        let repairs = events.iter().filter(|joined| matches!(joined.event, ClientEvent::Repaired(_)));
        assert_eq!(repairs.count(), 0);
    }
    // One who comes later sees the same.
    party.join();
    party.rounds_until("the late one agrees", Party::agrees);
}

#[test]
fn what_the_server_refuses_is_gone_again_and_undo_takes_back() {
    let mut party = Party::new(2);
    party.rounds_until("both have joined", |party| (0..2).all(|player| party.shared(player).has_joined()));
    let pristine = ground().world().hash();
    let high = Brush::add(Shape::sphere(Vec3::new(40.0, 66.0, 40.0), 5.0), MaterialId(3)).with_tag(7);
    party.send(0, high);
    party.rounds_until("the answer comes", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && stage.terrain(*terrain).world().revision() > 1
    });
    let (stage, terrain) = &mut party.players[0];
    assert_eq!(stage.terrain(*terrain).world().hash(), pristine);
    let edited: Vec<WhatBecame> =
        stage.recorded::<GroundEdited>().into_iter().map(|edited| edited.outcome).collect();
    assert!(
        matches!(edited[..], [WhatBecame::Predicted(_), WhatBecame::Refused(Some(Refusal::Forbidden))]),
        "{edited:?}"
    );
    let receipt = stage.receipts().last().expect("an answer").receipt.clone();
    assert_eq!((receipt.tag, receipt.outcome), (7, Err(Rejection::Refused)));

    let height = party.height_at(1, 50.0, 50.0);
    party.send(1, dig(50.0, height, 50.0, 5.0));
    party.rounds_until("it is dug", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && stage.terrain(*terrain).world().hash() != pristine
    });
    party.players[1].0.app.world_mut().write_message(Undo::default());
    party.rounds_until("it is taken back", |party| {
        let (stage, terrain) = &party.players[0];
        party.agrees() && stage.terrain(*terrain).world().hash() == pristine
    });
}

#[test]
fn a_host_plays_too() {
    let mut stage = player();
    stage.app.insert_resource(server());
    stage.app.world_mut().resource_mut::<NextState<ServerState>>().set(ServerState::Running);
    let terrain = stage.app.world_mut().spawn((ground(), SharedTerrain::default())).id();
    let pristine = ground().world().hash();
    stage.frames_until("it has joined", |stage| {
        stage.app.world().get::<SharedTerrain>(terrain).is_some_and(SharedTerrain::has_joined)
    });
    stage.send(dig(40.0, 20.0, 40.0, 6.0));
    stage.frames_until("it is dug and confirmed", |stage| {
        let shared = stage.app.world().get::<SharedTerrain>(terrain).expect("it is shared");
        shared.pending() == 0 && shared.number() > 0 && stage.terrain(terrain).world().hash() != pristine
    });
    stage.assert_whole(terrain, "the host's world");
}
