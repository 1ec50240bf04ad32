//! `together`: players dig one world over UDP. A dedicated server, bots that dig, and both at once over a bad network.
//!
//! ```text
//! cargo run --release --features examples --example together -- server
//! cargo run --release --features examples --example together -- bots --count 4
//! cargo run --release --features examples --example together -- loopback --seconds 60 --loss 0.05 --latency 200 --jitter 50
//! ```
//!
//! The server meshes nothing and draws nothing. With `--world DIR` it saves the world, and continues it when it is
//! started again: bots reconnect automatically, and their edits are applied then. Each second it prints a line of JSON
//! with the number of the last edit, the hash of the world and the bytes that were sent. Bots print the results of
//! their edits; in the end all of them print the hash of their world: `loopback` compares these, and fails if they
//! differ, or if anything had to be repaired.
//!
//! A client needs a token to connect to the server, and a token can be made only with the server's key. It is made when
//! the server starts for the first time, in `out/together.key`; bots read it there, in the place of a login service
//! that a game has. Connections are encrypted.
//!
//! | file | subject |
//! | --- | --- |
//! | `server.rs` | the dedicated server |
//! | `bots.rs` | players that dig at random |
//! | `proxy.rs` | a bad network |
//! | `../shared/party.rs` | connections over UDP |
//! | `../shared/tokens.rs` | keys and tokens |
//! | `../shared/reconnect.rs` | players reconnect automatically |

mod bots;
#[path = "../shared/party.rs"]
mod party;
mod proxy;
#[path = "../shared/reconnect.rs"]
mod reconnect;
mod server;
#[path = "../shared/tokens.rs"]
mod tokens;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use clap::Parser;

use crate::bots::Bots;
use crate::proxy::{Proxy, Weather};
use crate::server::{Access, Dedicated};
use crate::tokens::Key;

/// The file with the server's key.
const KEY: &str = "out/together.key";

/// Players dig one world.
#[derive(Parser, Clone, Debug)]
enum Options {
    /// A dedicated server.
    Server {
        /// Where it listens.
        #[arg(long, default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, party::PORT)))]
        address: SocketAddr,
        /// The address at which players find it, if that is another one.
        #[arg(long)]
        public: Option<SocketAddr>,
        /// The file with the key of connect tokens; it is made if it is not there.
        #[arg(long, value_name = "FILE", default_value = KEY)]
        key: PathBuf,
        /// The folder that keeps the world.
        #[arg(long, value_name = "DIR")]
        world: Option<PathBuf>,
        /// Ends after this many seconds; otherwise it keeps running.
        #[arg(long)]
        seconds: Option<f64>,
    },
    /// Players that dig at random.
    Bots {
        /// The server's address.
        #[arg(long, default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, party::PORT)))]
        address: SocketAddr,
        /// The file with the server's key.
        #[arg(long, value_name = "FILE", default_value = KEY)]
        key: PathBuf,
        #[command(flatten)]
        digging: Digging,
    },
    /// A server and bots in one program, with a bad network between them.
    Loopback {
        #[command(flatten)]
        digging: Digging,
        /// The share of packets that are lost, 0 to 1.
        #[arg(long, default_value_t = 0.05)]
        loss: f64,
        /// How late packets are, in milliseconds.
        #[arg(long, default_value_t = 200)]
        latency: u64,
        /// By how much that varies, in milliseconds.
        #[arg(long, default_value_t = 50)]
        jitter: u64,
    },
}

/// The options of bots.
#[derive(clap::Args, Clone, Copy, Debug)]
pub struct Digging {
    /// How many there are.
    #[arg(long, default_value_t = 8)]
    count: usize,
    /// Edits of each bot a second.
    #[arg(long, default_value_t = 5.0)]
    rate: f64,
    /// How long they dig.
    #[arg(long, default_value_t = 20.0)]
    seconds: f64,
}

/// The ground that all of them have.
fn ground() -> Result<Ground> {
    let noise = NoiseHeights { seed: 12, scale: 90.0, amplitude: 30.0, base: 40.0, ..default() };
    Ok(Ground::from_noise(512, 512, &noise)?)
}

fn terrain() -> Result<Terrain> {
    Ok(Terrain::new(ground()?, &TerrainSettings::default())?)
}

fn main() -> ExitCode {
    match run(Options::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::FAILURE
        }
    }
}

fn run(options: Options) -> Result<bool> {
    match options {
        Options::Server { address, public, key, world, seconds } => {
            let access = Access { key: Key::of_file(&key)?, public };
            let mut server = Dedicated::new(address, Some(access), world.as_deref())?;
            let length = seconds.map(Duration::from_secs_f64);
            server.run_for(length);
            server.finish();
            Ok(true)
        }
        Options::Bots { address, key, digging } => {
            let mut bots = Bots::new(address, Some(Key::of_file(&key)?), digging)?;
            bots.dig(|| {});
            Ok(bots.report(None))
        }
        Options::Loopback { digging, loss, latency, jitter } => {
            let mut server = Dedicated::new((Ipv4Addr::LOCALHOST, 0).into(), None, None)?;
            let (latency, jitter) = (Duration::from_millis(latency), Duration::from_millis(jitter));
            let proxy = Proxy::new(server.address, Weather { loss, latency, jitter })?;
            let mut bots = Bots::new(proxy.address, None, digging)?;
            bots.dig(|| server.update());
            let hash = server.hash();
            let is_right = bots.report(hash);
            let (packets, lost) = proxy.finish();
            println!("{packets} packets, {lost} of them lost");
            server.finish();
            Ok(is_right)
        }
    }
}
