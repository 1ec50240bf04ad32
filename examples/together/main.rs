//! `together`: players dig one world over UDP. A dedicated server, bots that dig, and both at once over a bad network.
//!
//! ```text
//! cargo run --release --features examples --example together -- server
//! cargo run --release --features examples --example together -- bots --count 4
//! cargo run --release --features examples --example together -- loopback --seconds 60 --loss 0.05 --latency 200 --jitter 50
//! ```
//!
//! The server meshes nothing and draws nothing. With `--world DIR` it saves what is dug, and goes on with it when it is started
//! again; players stay, and come back by themselves. Each second it prints a line of JSON with the number of the last edit, the hash
//! of the world and what was sent. Bots print what their edits came to; in the end all of them say which world they see: `loopback`
//! compares these, and fails if they differ, or if anything had to be repaired.
//!
//! | file | subject |
//! | --- | --- |
//! | `server.rs` | the dedicated server |
//! | `bots.rs` | players that dig at random |
//! | `proxy.rs` | a bad network |

mod bots;
#[path = "../shared/party.rs"]
mod party;
mod proxy;
mod server;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use clap::Parser;

use crate::bots::Bots;
use crate::proxy::{Proxy, Weather};
use crate::server::Dedicated;

/// Players dig one world.
#[derive(Parser, Clone, Debug)]
enum Options {
    /// A dedicated server.
    Server {
        /// Where it listens.
        #[arg(long, default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, party::PORT)))]
        address: SocketAddr,
        /// The folder that keeps the world.
        #[arg(long, value_name = "DIR")]
        world: Option<PathBuf>,
        /// It ends after so many seconds; otherwise it goes on.
        #[arg(long)]
        seconds: Option<f64>,
    },
    /// Players that dig at random.
    Bots {
        /// The server's address.
        #[arg(long, default_value_t = SocketAddr::from((Ipv4Addr::LOCALHOST, party::PORT)))]
        address: SocketAddr,
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

/// What bots do.
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
        Options::Server { address, world, seconds } => {
            let mut server = Dedicated::new(address, world.as_deref())?;
            let length = seconds.map(Duration::from_secs_f64);
            server.run_for(length);
            server.finish();
            Ok(true)
        }
        Options::Bots { address, digging } => {
            let mut bots = Bots::new(address, digging)?;
            bots.dig(|| {});
            Ok(bots.report(None))
        }
        Options::Loopback { digging, loss, latency, jitter } => {
            let mut server = Dedicated::new((Ipv4Addr::LOCALHOST, 0).into(), None)?;
            let (latency, jitter) = (Duration::from_millis(latency), Duration::from_millis(jitter));
            let proxy = Proxy::new(server.address, Weather { loss, latency, jitter })?;
            let mut bots = Bots::new(proxy.address, digging)?;
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
