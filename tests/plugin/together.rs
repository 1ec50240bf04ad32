//! Digging together over replicon, without a transport: messages are handed from app to app.

mod access;
#[cfg(feature = "avian")]
mod debris;
mod digging;
mod joints;
mod scripts;
mod sessions;
mod troubles;
#[cfg(feature = "examples")]
mod udp;

use std::time::{Duration, Instant};

use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::{Server, ServerSettings, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{
    EditOutcome, GroundEdited, GroundJoined, GroundServer, SharedTerrain, SharingError, SharingErrorFound,
    TogetherPlugin,
};
use bevy_replicon::prelude::*;
use bevy_replicon::test_app::{ServerTestAppExt, TestClientEntity};

use crate::stage::Stage;

/// How long a party waits for something: the machine may be busy.
const PATIENCE: Duration = Duration::from_secs(120);

fn terrain(ground: Ground, chunk_size: u32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size, ..default() }).expect("valid settings")
}

fn ground() -> Terrain {
    let noise = NoiseHeights { seed: 4, scale: 30.0, amplitude: 10.0, base: 20.0, ..default() };
    terrain(Ground::from_noise(96, 96, &noise).expect("valid ground"), 16)
}

/// Another ground of the same size.
fn other_ground() -> Terrain {
    terrain(Ground::flat(96, 96, 20.0).expect("valid ground"), 16)
}

/// Ground that takes many messages to join.
fn large_ground() -> Terrain {
    let noise = NoiseHeights { seed: 4, scale: 60.0, amplitude: 30.0, base: 40.0, ..default() };
    terrain(Ground::from_noise(384, 384, &noise).expect("valid ground"), 32)
}

/// This ground, with rough digs everywhere.
fn dug(mut terrain: Terrain, count: u64) -> Terrain {
    let side = f64::from(terrain.world().ground().width());
    let brushes: Vec<Brush> = (0..count)
        .map(|number| {
            let (x, z) = (number as f64 * 12.0 % side, (number as f64 * 12.0 / side).floor() * 12.0 % side);
            let y = terrain.world().height(x, z).unwrap_or_default();
            let shape = Shape::sphere(Vec3::new(x as f32, y as f32, z as f32), 6.0);
            Brush::dig(shape).with_roughness(Roughness::new(1.5, 3.0, number as u32))
        })
        .collect();
    terrain.apply(brushes);
    terrain
}

/// An app of a player, with this login.
fn player_with(auth_method: AuthMethod) -> Stage {
    let plugins = (MinimalPlugins, StatesPlugin, AssetPlugin::default(), MeshPlugin, TransformPlugin);
    let replicon =
        RepliconPlugins.set(ServerPlugin::new(PostUpdate)).set(RepliconSharedPlugin { auth_method });
    Stage::with_all((plugins, replicon), TogetherPlugin)
        .recording::<GroundEdited>()
        .recording::<GroundJoined>()
        .recording::<HistoryMoved>()
        .recording::<SharingErrorFound>()
}

fn player() -> Stage {
    player_with(AuthMethod::ProtocolCheck)
}

fn settings() -> ServerSettings {
    ServerSettings { undo: UndoPolicy::Own, ..default() }
}

/// A server that lets players take back their own strokes, and refuses edits above a height.
fn server() -> GroundServer {
    let mut server = Server::new(ground(), settings());
    server.set_permission(|_, edit| edit.reach().max.y < 60);
    GroundServer::new(server)
}

/// An app of a server, with this login and without ground.
fn server_app(auth_method: AuthMethod) -> App {
    let mut server = App::new();
    let replicon =
        RepliconPlugins.set(ServerPlugin::new(PostUpdate)).set(RepliconSharedPlugin { auth_method });
    server.add_plugins((MinimalPlugins, StatesPlugin, replicon, BurrowPlugins, TogetherPlugin)).finish();
    server
}

/// A server and players, who exchange messages in each round.
struct Party {
    server: App,
    players: Vec<(Stage, Entity)>,
}

impl Party {
    fn new(players: usize) -> Self {
        let mut party = Self::without_ground(AuthMethod::ProtocolCheck);
        party.server.insert_resource(self::server());
        (0..players).for_each(|_| party.join());
        party
    }

    fn without_ground(auth_method: AuthMethod) -> Self {
        Self { server: server_app(auth_method), players: Vec::new() }
    }

    fn join(&mut self) {
        self.join_with(ground(), AuthMethod::ProtocolCheck);
    }

    fn join_with(&mut self, terrain: Terrain, auth_method: AuthMethod) {
        let mut stage = player_with(auth_method);
        let terrain = stage.app.world_mut().spawn((terrain, SharedTerrain::default())).id();
        self.connect(stage, terrain);
    }

    /// Lets an app of a player connect.
    fn connect(&mut self, mut stage: Stage, terrain: Entity) {
        self.server.connect_client(&mut stage.app);
        self.players.push((stage, terrain));
    }

    fn disconnect(&mut self, player: usize) {
        self.server.disconnect_client(&mut self.players[player].0.app);
    }

    fn reconnect(&mut self, player: usize) {
        self.server.connect_client(&mut self.players[player].0.app);
    }

    fn is_connected(&self, player: usize) -> bool {
        self.players[player].0.app.world().contains_resource::<TestClientEntity>()
    }

    /// The server's entity of a player.
    fn client(&self, player: usize) -> Entity {
        **self.players[player].0.app.world().resource::<TestClientEntity>()
    }

    fn round(&mut self) {
        self.server.update();
        for (stage, _) in &mut self.players {
            let is_connected = stage.app.world().contains_resource::<TestClientEntity>();
            if is_connected {
                self.server.exchange_with_client(&mut stage.app);
            }
            stage.app.update();
            if is_connected {
                self.server.exchange_with_client(&mut stage.app);
            }
        }
        std::thread::sleep(Duration::from_millis(1));
    }

    fn rounds(&mut self, count: usize) {
        (0..count).for_each(|_| self.round());
    }

    fn rounds_until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < PATIENCE, "never: {what}; {}", self.describe());
            self.round();
        }
    }

    /// What each player has.
    fn describe(&self) -> String {
        let one = |(stage, terrain): &(Stage, Entity)| {
            let shared = stage.app.world().get::<SharedTerrain>(*terrain);
            let model = stage.app.world().get::<Terrain>(*terrain);
            let shared = shared.map(|shared| {
                (shared.has_joined(), shared.number(), shared.pending(), shared.id(), shared.error())
            });
            let model = model.map(|model| (model.world().hash(), model.queued(), model.is_busy()));
            format!("{shared:?} {model:x?}")
        };
        self.players.iter().map(one).collect::<Vec<_>>().join("; ")
    }

    fn all_join(&mut self) {
        self.rounds_until("all have joined", Self::agrees);
    }

    fn world_mut(&mut self, player: usize) -> &mut World {
        self.players[player].0.app.world_mut()
    }

    fn shared(&self, player: usize) -> &SharedTerrain {
        let (stage, terrain) = &self.players[player];
        stage.app.world().get(*terrain).expect("it is shared")
    }

    fn terrain_hash(&self, player: usize) -> u64 {
        let (stage, terrain) = &self.players[player];
        stage.terrain(*terrain).world().hash()
    }

    /// Whether all players show the same world, with nothing under way.
    fn agrees(&self) -> bool {
        let count = self.players.len();
        let state = |player| (self.shared(player).number(), self.terrain_hash(player));
        let is_settled = |player| self.shared(player).has_joined() && self.shared(player).pending() == 0;
        (0..count).all(is_settled) && (1..count).all(|player| state(player) == state(0))
    }

    /// Whether all players have joined the world of this hash.
    fn all_show(&self, hash: u64) -> bool {
        self.agrees() && (0..self.players.len()).all(|player| self.terrain_hash(player) == hash)
    }

    fn height_at(&self, player: usize, x: f64, z: f64) -> f32 {
        let (stage, terrain) = &self.players[player];
        stage.terrain(*terrain).world().height(x, z).unwrap_or_default() as f32
    }

    fn send(&mut self, player: usize, brush: Brush) {
        self.players[player].0.send(brush);
    }

    /// Digs a ball out of the surface.
    fn dig_at(&mut self, player: usize, x: f32, z: f32) {
        let y = self.height_at(player, x.into(), z.into());
        self.send(player, Brush::dig(Shape::sphere(Vec3::new(x, y, z), 4.0)));
    }

    /// What became of a player's edits since the last call.
    fn outcomes(&mut self, player: usize) -> Vec<EditOutcome> {
        let edited = self.players[player].0.recorded::<GroundEdited>();
        edited.into_iter().map(|edited| edited.outcome).collect()
    }

    /// What was reported to a player since the last call.
    fn errors(&mut self, player: usize) -> Vec<SharingError> {
        let found = self.players[player].0.recorded::<SharingErrorFound>();
        found.into_iter().map(|found| found.error).collect()
    }
}
