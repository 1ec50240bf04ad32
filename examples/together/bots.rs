//! Players that dig at random.

use std::net::SocketAddr;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::ClientEvent;
use bevy_burrow::prelude::*;
use bevy_burrow::together::{EditOutcome, GroundEdited, GroundJoined, SharedTerrain, TogetherPlugin};
use bevy_replicon::prelude::*;
use bevy_replicon_renet::RepliconRenetPlugins;
use fastrand::Rng;

use crate::reconnect::{ReconnectPlugin, StayConnected};
use crate::tokens::Key;
use crate::{Digging, party};

/// Time between two frames.
const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// Time between two tries to connect.
const RETRY: Duration = Duration::from_secs(1);

/// How long bots wait at the end until all that they did is confirmed, and all of them see the same.
const PATIENCE: Duration = Duration::from_secs(60);

/// The results that a bot has received for its edits.
#[derive(Resource, Default)]
struct Seen {
    predicted: usize,
    confirmed: usize,
    refused: usize,
    repaired: usize,
}

struct Bot {
    app: App,
    terrain: Entity,
    next: Duration,
}

/// Players that dig.
pub struct Bots {
    all: Vec<Bot>,
    digging: Digging,
}

impl Bots {
    /// Bots that connect with tokens of this key, if there is one, in the place of a login service.
    pub fn new(server: SocketAddr, key: Option<Key>, digging: Digging) -> Result<Self> {
        let all = (0..digging.count as u64).map(|number| Bot::new(server, key, number + 1));
        Ok(Self { all: all.collect::<Result<_>>()?, digging })
    }

    /// Digs for a while, then waits until all see the same. `each_frame` runs in each frame.
    pub fn dig(&mut self, mut each_frame: impl FnMut()) {
        let (start, mut rng) = (Instant::now(), Rng::with_seed(7));
        let length = Duration::from_secs_f64(self.digging.seconds);
        let pause = Duration::from_secs_f64(1.0 / self.digging.rate.max(0.01));
        loop {
            let frame = Instant::now();
            let time = start.elapsed();
            for bot in &mut self.all {
                if bot.shared().has_joined() && time < length && bot.next <= time {
                    bot.next = time + pause.mul_f64(0.5 + rng.f64());
                    bot.dig(&mut rng);
                }
                bot.app.update();
            }
            each_frame();
            if time > length && self.agree() || time > length + PATIENCE {
                return;
            }
            std::thread::sleep(FRAME.saturating_sub(frame.elapsed()));
        }
    }

    /// Whether all have joined, everything is confirmed, and all see the same world.
    fn agree(&self) -> bool {
        let is_settled = |bot: &Bot| bot.shared().has_joined() && bot.shared().pending() == 0;
        let first = self.all.first().map(Bot::state);
        self.all.iter().all(|bot| is_settled(bot) && Some(bot.state()) == first)
    }

    /// Prints what became of their edits. Do all see the same, the world of this hash if it is known, and was nothing
    /// repaired?
    pub fn report(&self, hash: Option<u64>) -> bool {
        let mut repaired = 0;
        for (number, bot) in self.all.iter().enumerate() {
            let seen = bot.app.world().resource::<Seen>();
            let (at, own) = bot.state();
            println!(
                "bot {number}: {} predicted, {} confirmed, {} refused, {} repaired; at {at}, {own:#018x}",
                seen.predicted, seen.confirmed, seen.refused, seen.repaired
            );
            repaired += seen.repaired;
        }
        let is_right = self.agree() && repaired == 0;
        let is_servers = hash.is_none_or(|hash| self.all.iter().all(|bot| bot.state().1 == hash));
        println!("{}", if is_right && is_servers { "all see the same world" } else { "THEY DIFFER" });
        is_right && is_servers
    }
}

impl Bot {
    fn new(server: SocketAddr, key: Option<Key>, player: u64) -> Result<Self> {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, StatesPlugin, RepliconPlugins, RepliconRenetPlugins))
            .add_plugins((BurrowPlugins, TogetherPlugin, ReconnectPlugin))
            .init_resource::<Seen>()
            .insert_resource(StayConnected::new(RETRY, move |world| match key {
                Some(key) => party::connect_as(world, server, key.issue(player, vec![server])?),
                None => party::connect(world, server, player),
            }))
            .add_systems(Last, watch);
        app.finish();
        app.cleanup();
        let terrain = app.world_mut().spawn((crate::terrain()?, SharedTerrain::default())).id();
        Ok(Self { app, terrain, next: Duration::ZERO })
    }

    fn shared(&self) -> &SharedTerrain {
        self.app.world().get(self.terrain).expect("the terrain is shared")
    }

    /// The number that it is at, and the hash of what it shows.
    fn state(&self) -> (u64, u64) {
        let terrain = self.app.world().get::<Terrain>(self.terrain).expect("the terrain is there");
        (self.shared().number(), terrain.world().hash())
    }

    fn dig(&mut self, rng: &mut Rng) {
        let world = self.app.world().get::<Terrain>(self.terrain).expect("the terrain is there").world();
        // Near the middle, so that they get in each other's way.
        let mut near = |size: f32| 256.0 + (rng.f32() - 0.5) * size;
        let (x, z) = (near(80.0), near(80.0));
        let height = world.height(x.into(), z.into()).unwrap_or_default() as f32;
        let shape = Shape::sphere(Vec3::new(x, height, z), 2.0 + rng.f32() * 3.0);
        let brush = match rng.u32(0..6) {
            0 => Brush::add(shape, MaterialId(5)),
            1 => Brush::smooth(shape, 0.5),
            2 => Brush::paint(shape, MaterialId(3)),
            _ => Brush::dig(shape),
        };
        self.app.world_mut().write_message(brush);
    }
}

fn watch(
    mut edited: MessageReader<GroundEdited>,
    mut joined: MessageReader<GroundJoined>,
    mut seen: ResMut<Seen>,
) {
    for message in edited.read() {
        match message.outcome {
            EditOutcome::Predicted(_) => seen.predicted += 1,
            EditOutcome::Confirmed(_) => seen.confirmed += 1,
            EditOutcome::Refused(_) => seen.refused += 1,
        }
    }
    seen.repaired +=
        joined.read().filter(|message| matches!(message.event, ClientEvent::Repaired(_))).count();
}
