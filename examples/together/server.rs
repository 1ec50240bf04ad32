//! The dedicated server: no window, no meshes.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_burrow::net::{Server, ServerSettings};
use bevy_burrow::prelude::*;
use bevy_burrow::together::{GroundServer, GroundServerEvent, TogetherPlugin};
use bevy_replicon::prelude::*;
use bevy_replicon_renet::RepliconRenetPlugins;

use crate::party;
use crate::tokens::Key;

/// Time between two frames.
const FRAME: Duration = Duration::from_nanos(1_000_000_000 / 60);

/// Most players.
const PLAYERS: usize = 64;

/// The key and addresses of tokens that clients need to connect.
pub struct Access {
    pub key: Key,
    /// The address that tokens name, if it is another one than the server listens at.
    pub public: Option<SocketAddr>,
}

/// A server without a window.
pub struct Dedicated {
    app: App,
    /// Where it listens.
    pub address: SocketAddr,
    next_line: Instant,
}

impl Dedicated {
    /// Players need tokens that were made with the key, if there is one.
    pub fn new(address: SocketAddr, access: Option<Access>, world: Option<&Path>) -> Result<Self> {
        let settings = ServerSettings::default();
        let terrain = crate::terrain()?;
        let ground = match world {
            Some(folder) => GroundServer::saved(&SavedWorld::new(folder), &terrain, settings),
            None => GroundServer::new(Server::new(terrain, settings)),
        };
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, StatesPlugin, RepliconPlugins, RepliconRenetPlugins))
            .add_plugins((BurrowPlugins, TogetherPlugin))
            .insert_resource(ground);
        app.finish();
        app.cleanup();
        while app.world().resource::<GroundServer>().opening().is_some() {
            app.update();
            std::thread::sleep(Duration::from_millis(1));
        }
        for event in app.world().resource::<Messages<GroundServerEvent>>().iter_current_update_messages() {
            if let GroundServerEvent::Opened(Err(why)) = event {
                return Err(Arc::clone(why).into());
            }
        }
        let address = match access {
            Some(Access { key, public }) => {
                party::listen_as(app.world_mut(), address, public, PLAYERS, key.server())?
            }
            None => party::listen(app.world_mut(), address, PLAYERS)?,
        };
        Ok(Self { app, address, next_line: Instant::now() + Duration::from_secs(1) })
    }

    /// A frame.
    pub fn update(&mut self) {
        self.app.update();
        if Instant::now() >= self.next_line {
            self.next_line += Duration::from_secs(1);
            self.app.world_mut().resource_mut::<GroundServer>().with(|server| {
                let (figures, hash) = (server.figures(), server.terrain().world().hash());
                println!(
                    "{{\"number\":{},\"hash\":\"{hash:#018x}\",\"durable\":{},\"players\":{},\"main_bytes\":{},\"bulk_bytes\":{},\"repairs\":{}}}",
                    server.applied(),
                    server.durable(),
                    server.clients().count(),
                    figures.main_bytes,
                    figures.bulk_bytes,
                    figures.repairs
                );
            });
        }
    }

    /// Runs for a while, or for ever.
    pub fn run_for(&mut self, length: Option<Duration>) {
        let start = Instant::now();
        while length.is_none_or(|length| start.elapsed() < length) {
            let frame = Instant::now();
            self.update();
            std::thread::sleep(FRAME.saturating_sub(frame.elapsed()));
        }
    }

    /// The hash of the world.
    pub fn hash(&mut self) -> Option<u64> {
        let (sender, receiver) = channel();
        let send = move |server: &mut Server| {
            // Nobody may wait any more.
            let _ = sender.send(server.terrain().world().hash());
        };
        self.app.world_mut().resource_mut::<GroundServer>().with(send);
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(10) {
            self.app.update();
            if let Ok(hash) = receiver.try_recv() {
                return Some(hash);
            }
        }
        None
    }

    /// Saves everything.
    pub fn finish(mut self) {
        self.app.world_mut().resource_mut::<GroundServer>().finish();
        party::leave(self.app.world_mut());
    }
}
