//! Matter is conserved for every player of a shared terrain: whatever players dig, take back, and are refused, the
//! ground, the debris that a player sees and all inventories together have as many voxels as before.

use std::time::{Duration, Instant};

use avian3d::prelude::PhysicsPlugins;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::net::{Server, ServerSettings, UndoPolicy};
use bevy_burrow::physics::{ColliderSource, DebrisPlugin, DebrisSettings, TerrainPhysicsPlugin};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{GroundServer, SharedTerrain, TogetherPlugin};
use bevy_replicon::prelude::*;
use bevy_replicon::test_app::ServerTestAppExt;
use fastrand::Rng;

use crate::matter::{Owned, built, debris, follow, number, random_brush};
use crate::stage::{STEP, level};

/// The server refuses edits with this tag.
const REFUSED: u64 = 1;

/// Brushes and undos that were answered.
#[derive(Resource, Default)]
struct Answers(usize);

fn player() -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((
        MinimalPlugins,
        StatesPlugin,
        RepliconPlugins.set(ServerPlugin::new(PostUpdate)),
        PhysicsPlugins::default(),
        BurrowPlugins,
        TogetherPlugin,
        TerrainPhysicsPlugin,
        DebrisPlugin,
    ))
    .init_resource::<Owned>()
    .init_resource::<Answers>()
    .insert_resource(DebrisSettings { most: 100_000, stay: 1e9, ..default() })
    .insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(STEP)))
    .add_systems(
        Last,
        (
            follow,
            |mut applied: MessageReader<BrushApplied>,
             mut moved: MessageReader<HistoryMoved>,
             mut answers: ResMut<Answers>| {
                answers.0 += applied.read().count() + moved.read().count()
            },
        ),
    );
    app.finish();
    app.cleanup();
    let terrain = app.world_mut().spawn((level(48, 1.0), SharedTerrain::default())).id();
    app.world_mut().spawn((Transform::default(), ColliderSource { radius: 1e4 }));
    (app, terrain)
}

struct Party {
    server: App,
    players: Vec<(App, Entity)>,
}

impl Party {
    fn new(players: usize) -> Self {
        let settings = ServerSettings { undo: UndoPolicy::Own, ..default() };
        let mut ground = Server::new(level(48, 1.0), settings);
        ground.set_permission(|_, edit| edit.tag() != REFUSED);
        let loose = LooseSettings { largest: 6000, crumbs: 6, debris: 4000 };
        ground.submit(Order::Loose(Some(loose))).expect("it can be shared");
        let mut server = App::new();
        let replicon = RepliconPlugins.set(ServerPlugin::new(PostUpdate));
        server
            .add_plugins((MinimalPlugins, StatesPlugin, replicon, BurrowPlugins, TogetherPlugin))
            .insert_resource(GroundServer::new(ground))
            .finish();
        let mut party = Self { server, players: Vec::new() };
        for _ in 0..players {
            let (mut app, terrain) = player();
            party.server.connect_client(&mut app);
            party.players.push((app, terrain));
        }
        party.rounds_until("all have joined", |party| {
            party.players.iter().all(|(app, terrain)| {
                app.world().get::<SharedTerrain>(*terrain).is_some_and(SharedTerrain::has_joined)
            })
        });
        party
    }

    fn round(&mut self) {
        self.server.update();
        for (app, _) in &mut self.players {
            self.server.exchange_with_client(app);
            app.update();
            self.server.exchange_with_client(app);
        }
        std::thread::sleep(Duration::from_micros(500));
    }

    fn rounds_until(&mut self, what: &str, mut is_so: impl FnMut(&mut Self) -> bool) {
        let start = Instant::now();
        while !is_so(self) {
            assert!(start.elapsed() < Duration::from_secs(120), "never: {what}");
            self.round();
        }
    }

    fn answers(&self) -> usize {
        self.players.iter().map(|(app, _)| app.world().resource::<Answers>().0).sum()
    }

    fn hash(&self, player: usize) -> u64 {
        let (app, terrain) = &self.players[player];
        app.world().get::<Terrain>(*terrain).expect("a terrain").world().hash()
    }

    /// What a player sees: ground and debris; `None` while something is under way.
    fn seen(&mut self, player: usize) -> Option<i64> {
        let (app, terrain) = &mut self.players[player];
        let model = app.world().get::<Terrain>(*terrain).expect("a terrain");
        let is_idle = model.queued() == 0 && !model.is_busy();
        let shared = app.world().get::<SharedTerrain>(*terrain).expect("it is shared");
        let is_answered = shared.pending() == 0;
        let ground = built(model.world());
        debris(app).filter(|_| is_idle && is_answered).map(|debris| ground + debris)
    }
}

#[test]
fn ground_debris_and_all_inventories_are_constant_for_every_player() {
    let mut rng = Rng::with_seed(number("BURROW_SEED", 2));
    let mut party = Party::new(2);
    let mut most = [0; 2];
    let mut fallen = 0;
    for step in 0..number("BURROW_STEPS", 60) {
        let mut sent = 0;
        let before = party.answers();
        for _ in 0..rng.usize(1..3) {
            let (app, _) = &mut party.players[rng.usize(0..2)];
            if rng.u8(0..3) == 0 {
                app.world_mut().write_message(Undo::default()).expect("the plugin added the message");
            } else {
                let tag = if rng.u8(0..4) == 0 { REFUSED } else { 2 + step };
                let brush = random_brush(&mut rng).with_tag(tag);
                app.world_mut().write_message(brush).expect("the plugin added the message");
            }
            sent += 1;
            (0..rng.usize(0..12)).for_each(|_| party.round());
        }
        party.rounds_until("all is answered", |party| party.answers() >= before + sent);
        let mut seen = [None; 2];
        party.rounds_until("both see the same, and debris are bodies", |party| {
            let is_same = party.hash(0) == party.hash(1);
            seen = [0, 1].map(|player| party.seen(player).filter(|_| is_same));
            seen.iter().all(Option::is_some)
        });
        (0..rng.usize(4..20)).for_each(|_| party.round());
        let owned: i64 = party
            .players
            .iter()
            .map(|(app, _)| app.world().resource::<Owned>())
            .map(|owned| owned.inventory + owned.crumbs)
            .sum();
        for (player, most) in most.iter_mut().enumerate() {
            let seen = party.seen(player).expect("nothing is under way");
            assert_eq!(seen + owned, 0, "step {step}, player {player}: {seen} seen, {owned} owned");
            let now = debris(&mut party.players[player].0).unwrap_or_default();
            fallen += usize::from(now != *most);
            *most = now;
        }
    }
    assert!(fallen > 5, "debris changed {fallen} times");
}
