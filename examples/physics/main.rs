//! `physics`: balls rain on hills that are dug away under them.
//!
//! ```text
//! cargo run --release --features examples --example physics
//! cargo run --release --features examples --example physics -- --headless --out out/physics
//! ```
//!
//! | control | does |
//! | --- | --- |
//! | left mouse button, held | digs where the cursor points |
//! | middle mouse button, held | builds there |
//! | right mouse button, held | looks around |
//! | `W` `A` `S` `D`, `Q`, `E` | moves, down, up; with the left `Shift` faster |
//! | `Space` | throws a ball |
//! | `P` | stops or restarts the digging machine |
//!
//! Without a display, or with `--headless`, it plays automatically for some seconds of game time and saves pictures and
//! `report.json` in `--out`; it fails if a ball is below the ground then.

#[path = "../shared/display.rs"]
mod display;
mod headless;
#[path = "../shared/mouse.rs"]
mod mouse;
mod rain;
mod scene;

use std::path::PathBuf;
use std::process::{ExitCode, Termination};

use avian3d::prelude::*;
use bevy::camera_controller::free_camera::FreeCameraPlugin;
use bevy::prelude::*;
use bevy_burrow::physics::TerrainPhysicsPlugin;
use bevy_burrow::prelude::*;
use clap::Parser;

/// Balls rain on hills that are dug away under them.
#[derive(Parser, Clone, Debug)]
pub struct Options {
    /// Play without a window and write pictures and a report.
    #[arg(long)]
    headless: bool,
    /// Folder for pictures and the report.
    #[arg(long, value_name = "DIR", default_value = "out/physics")]
    out: PathBuf,
    /// How many balls there are at most.
    #[arg(long, default_value_t = 1000)]
    balls: usize,
    /// Seconds of the game's time to play without a window.
    #[arg(long, default_value_t = 20.0, value_parser = seconds)]
    seconds: f32,
    /// Width of pictures, in pixels.
    #[arg(long, default_value_t = 960, value_parser = clap::value_parser!(u32).range(64..=8192))]
    width: u32,
    /// Height of pictures, in pixels.
    #[arg(long, default_value_t = 540, value_parser = clap::value_parser!(u32).range(64..=8192))]
    height: u32,
}

/// From a second to an hour: time for all pictures, and an end.
fn seconds(text: &str) -> Result<f32, String> {
    let seconds: f32 = text.parse().map_err(|error| format!("{error}"))?;
    if (1.0..=3600.0).contains(&seconds) { Ok(seconds) } else { Err("it is not within 1 to 3600".into()) }
}

fn main() -> ExitCode {
    let options = Options::parse();
    if options.headless || !display::has_display() {
        return headless::run(&options);
    }
    let mut app = App::new();
    app.add_plugins((DefaultPlugins, FreeCameraPlugin));
    game(&mut app, &options);
    app.add_systems(Update, (mouse::use_mouse::<4>, scene::press_keys).before(BurrowSystems::Collect));
    app.run().report()
}

/// Everything that needs no window: ten lines of physics, and a scene.
fn game(app: &mut App, options: &Options) {
    app.add_plugins((BurrowPlugins, PhysicsPlugins::default(), TerrainPhysicsPlugin))
        .insert_resource(rain::Rain::new(options.balls))
        .add_systems(Startup, (scene::set_up, rain::prepare))
        .add_systems(FixedUpdate, rain::fall)
        .add_systems(Update, rain::dig.before(BurrowSystems::Collect));
}
