//! Pieces that break off shared ground: each is in the ground or a body, for every player, whatever the server says
//! later.

use std::time::Duration;

use avian3d::prelude::PhysicsPlugins;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;
use bevy_burrow::net::Server;
use bevy_burrow::physics::{
    ColliderSource, Debris, DebrisPlugin, DebrisSettings, PhysicsFigures, TerrainPhysicsPlugin,
};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{EditOutcome, GroundEdited, GroundServer, SharedTerrain, TogetherPlugin};
use bevy_replicon::prelude::*;

use super::{Party, settings, terrain};
use crate::stage::Stage;

/// Edits with this tag are refused.
const REFUSED: u64 = 7;

fn level() -> Terrain {
    terrain(Ground::flat(64, 64, 8.0).expect("valid ground"), 16)
}

/// With a beam high up, that a pillar carries.
fn built() -> Terrain {
    let mut terrain = level();
    terrain.apply([
        Brush::add(Shape::cuboid(Vec3::new(12.0, 34.0, 32.0), Vec3::new(2.2, 30.0, 2.2)), MaterialId(2)),
        Brush::add(Shape::cuboid(Vec3::new(26.0, 62.0, 32.0), Vec3::new(14.2, 2.2, 2.2)), MaterialId(3)),
    ]);
    terrain
}

/// Cuts the beam off.
fn saw(tag: u64) -> Brush {
    Brush::dig(Shape::cuboid(Vec3::new(19.0, 62.0, 32.0), Vec3::new(1.2, 4.0, 4.0))).with_tag(tag)
}

fn player() -> Stage {
    let plugins = (
        MinimalPlugins,
        StatesPlugin,
        RepliconPlugins.set(ServerPlugin::new(PostUpdate)),
        PhysicsPlugins::default(),
    );
    let step = Duration::from_secs_f32(1.0 / 64.0);
    let mut stage = Stage::with_all(plugins, (TogetherPlugin, TerrainPhysicsPlugin, DebrisPlugin));
    stage
        .app
        .insert_resource(DebrisSettings { stay: 1e9, ..default() })
        .insert_resource(TimeUpdateStrategy::ManualDuration(step));
    stage.app.world_mut().spawn((Transform::default(), ColliderSource { radius: 1e4 }));
    stage.recording::<GroundEdited>()
}

impl Party {
    /// Two players with physics on ground with a beam; returns the hash of that as well.
    fn at_the_beam() -> (Self, u64) {
        let hash = built().world().hash();
        let mut server = Server::new(built(), settings());
        server.set_permission(|_, edit| edit.tag() != REFUSED);
        let loose = LooseSettings { crumbs: 8, debris: 9000, ..default() };
        server.submit(Order::Loose(Some(loose))).expect("it can be shared");
        let mut party = Self::without_ground(AuthMethod::ProtocolCheck);
        party.server.insert_resource(GroundServer::new(server));
        for _ in 0..2 {
            let mut stage = player();
            let terrain = stage.app.world_mut().spawn((level(), SharedTerrain::default())).id();
            party.connect(stage, terrain);
        }
        party.rounds_until("both have joined", |party| party.all_show(hash));
        (party, hash)
    }

    fn debris(&mut self, player: usize) -> usize {
        let world = self.world_mut(player);
        world.query::<&Debris>().iter(world).count()
    }

    fn rounds_until_debris(&mut self, what: &str, counts: [usize; 2]) {
        for _ in 0..20_000 {
            self.round();
            if [self.debris(0), self.debris(1)] == counts {
                return;
            }
        }
        panic!("never: {what}");
    }
}

#[test]
fn a_piece_comes_with_the_ground_that_loses_it() {
    for _ in 0..5 {
        let (mut party, before) = Party::at_the_beam();
        party.send(0, saw(8));
        for _ in 0..60 {
            party.round();
            for player in 0..2 {
                let is_early = party.debris(player) > 0 && party.terrain_hash(player) == before;
                assert!(!is_early, "a body lies in the ground that it came from, at {player}");
            }
        }
        party.rounds_until_debris("it falls at both", [1, 1]);
        for player in 0..2 {
            assert_ne!(party.terrain_hash(player), before, "the ground lost it");
            let figures = party.players[player].0.app.world().resource::<PhysicsFigures>();
            assert_eq!(figures.lifted, 0);
        }
    }
}

#[test]
fn a_refused_dig_leaves_no_debris() {
    let (mut party, before) = Party::at_the_beam();
    party.send(0, saw(REFUSED));
    let mut is_refused = false;
    while !is_refused {
        party.round();
        is_refused = party.outcomes(0).iter().any(|outcome| matches!(outcome, EditOutcome::Refused(_)));
    }
    party.rounds_until("the ground is back", |party| party.all_show(before));
    party.rounds(60);
    assert_eq!([party.debris(0), party.debris(1)], [0, 0], "the beam is ground, and debris as well");
    // A control.
    party.send(0, saw(8));
    party.rounds_until_debris("one that is allowed falls", [1, 1]);
}

#[test]
fn an_undo_takes_the_debris_of_all_players() {
    let (mut party, before) = Party::at_the_beam();
    party.send(0, saw(8));
    party.rounds_until_debris("it falls at both", [1, 1]);
    // It may lie anywhere by now.
    party.rounds(300);
    party.players[0].0.write(Undo::default());
    party.rounds_until("it is taken back", |party| party.all_show(before));
    party.rounds(30);
    assert_eq!([party.debris(0), party.debris(1)], [0, 0]);
}
