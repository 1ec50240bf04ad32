//! `agents`: a dozen agents cross a ridge. A wall is built in their way, then a tunnel is dug, and they take it.
//!
//! ```text
//! cargo run --release --features examples --example agents
//! cargo run --release --features examples --example agents -- --headless --out out/agents
//! ```
//!
//! | control | does |
//! | --- | --- |
//! | left mouse button, held | digs where the cursor points |
//! | middle mouse button, held | builds there |
//! | right mouse button, held | looks around |
//! | `W` `A` `S` `D`, `Q`, `E` | moves, down, up; with the left `Shift` faster |
//! | `G` | shows or hides spans, navigation meshes and paths |
//! | `R` | sends the figures back |
//!
//! Without a display, or with `--headless`, it plays until all have arrived, and saves pictures and `report.json` in
//! `--out`; it fails if one does not arrive.

#[path = "../shared/display.rs"]
mod display;
mod figures;
mod headless;
#[path = "../shared/mouse.rs"]
mod mouse;
mod scene;
mod story;

use std::path::PathBuf;
use std::process::{ExitCode, Termination};

use bevy::camera_controller::free_camera::FreeCameraPlugin;
use bevy::prelude::*;
use bevy_burrow::debug::{BurrowDebug, BurrowDebugPlugin};
use bevy_burrow::paths::NavigationPlugin;
use bevy_burrow::paths::bevy_landmass::debug::{EnableLandmassDebug, Landmass3dDebugPlugin};
use bevy_burrow::paths::bevy_landmass::prelude::*;
use bevy_burrow::prelude::*;
use clap::Parser;

/// A dozen figures cross a ridge.
#[derive(Parser, Clone, Debug)]
pub struct Options {
    /// Play without a window and write pictures and a report.
    #[arg(long)]
    headless: bool,
    /// Folder for pictures and the report.
    #[arg(long, value_name = "DIR", default_value = "out/agents")]
    out: PathBuf,
    /// Show spans, navigation meshes and paths from the beginning.
    #[arg(long)]
    meshes: bool,
    /// Width of pictures, in pixels.
    #[arg(long, default_value_t = 960, value_parser = clap::value_parser!(u32).range(64..=8192))]
    width: u32,
    /// Height of pictures, in pixels.
    #[arg(long, default_value_t = 540, value_parser = clap::value_parser!(u32).range(64..=8192))]
    height: u32,
}

fn main() -> ExitCode {
    let options = Options::parse();
    if options.headless || !display::has_display() {
        return headless::run(&options);
    }
    let mut app = App::new();
    app.add_plugins((DefaultPlugins, FreeCameraPlugin));
    game(&mut app, &options);
    app.add_systems(Update, (mouse::use_mouse::<3>, scene::press_keys).before(BurrowSystems::Collect));
    app.run().report()
}

/// Everything that needs no window.
fn game(app: &mut App, options: &Options) {
    app.add_plugins((BurrowPlugins, Landmass3dPlugin::default(), NavigationPlugin::default()))
        .add_plugins(Landmass3dDebugPlugin::default())
        .insert_resource(EnableLandmassDebug(options.meshes))
        .add_plugins(BurrowDebugPlugin)
        .insert_resource(BurrowDebug {
            walkable: options.meshes,
            agent: scene::AGENT,
            near: 64.0,
            ..default()
        })
        .init_resource::<story::Story>()
        .add_systems(Startup, (scene::set_up, figures::spawn).chain())
        .add_systems(FixedUpdate, figures::walk)
        .add_systems(Update, story::advance_story.before(BurrowSystems::Collect));
}
