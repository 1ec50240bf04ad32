//! `digger`: first person on a real landscape, with a shovel.
//!
//! ```text
//! cargo run --release --features examples --example digger
//! cargo run --release --features examples --example digger -- --headless --out out/digger
//! ```
//!
//! | control | does |
//! | --- | --- |
//! | click, `Esc` | take the mouse, let go of it |
//! | `W` `A` `S` `D` or arrows, `Shift`, `Space` | walk, run, jump |
//! | left button | dig |
//! | right button | build with the chosen material |
//! | middle button or `G` | paint with it |
//! | wheel | radius, 1 to 12 metres |
//! | `1` to `8` | rock, grass, sand, snow, clay, concrete, coal, gold |
//! | `C` | form: sphere, cube, capsule |
//! | `F` | headlamp |
//! | `H` | help |
//! | `Q` | quit |
//!
//! Without a display or a graphics adapter, or with `--headless`, it plays a script instead: a walk up to a hillside, a
//! tunnel with a bend and a room, a bridge, a pit across a chunk corner. Pictures and a summary go to `--out`.
//!
//! | file | subject |
//! | --- | --- |
//! | `landscape.rs` | heights and materials: the terrain |
//! | `sky.rs`, `light.rs` | sky, sun, haze, caves, headlamp, camera |
//! | `mover.rs`, `player.rs` | the walker's body; keys, mouse and eyes |
//! | `tools.rs`, `hud.rs` | dig, build, paint; what is written on the window |
//! | `places.rs`, `works.rs` | where the script digs, and what |
//! | `script.rs`, `studio.rs`, `headless.rs` | the story; who plays it; the app without a window |
//! | `wires.rs`, `report.rs` | lines of a seam; receipts, times and the summary |

mod headless;
mod hud;
mod landscape;
mod light;
mod mover;
mod places;
mod player;
mod report;
mod script;
mod sky;
mod studio;
mod tools;
mod wires;
mod works;

use std::path::PathBuf;
use std::process::ExitCode;

use bevy::prelude::*;
use bevy_burrow::backend::{Backend, Engine};
use bevy_burrow::prelude::*;
use clap::Parser;

/// First person on a real landscape, with a shovel.
#[derive(Parser, Clone, Debug)]
pub struct Options {
    /// Play the script and write pictures, even where a window could be opened.
    #[arg(long)]
    headless: bool,
    /// Folder for the script's pictures and summary.
    #[arg(long, value_name = "DIR", default_value = "out/digger")]
    out: PathBuf,
    /// Width of the window or the pictures, in pixels.
    #[arg(long, default_value_t = 1280, value_parser = clap::value_parser!(u32).range(64..=8192))]
    width: u32,
    /// Height of the window or the pictures, in pixels.
    #[arg(long, default_value_t = 720, value_parser = clap::value_parser!(u32).range(64..=8192))]
    height: u32,
    /// Draw every frame of the script, not only the pictures: for frame times.
    #[arg(long)]
    draw_all: bool,
    /// What edits are computed on.
    #[arg(long, value_enum, default_value_t = Computer::Auto)]
    backend: Computer,
}

/// A [`Backend`] as the command line has it.
#[derive(clap::ValueEnum, Clone, Copy, Debug)]
enum Computer {
    Auto,
    Cpu,
    Cuda,
}

impl Computer {
    fn engine(self) -> BurrowEngine {
        BurrowEngine(Engine::new(match self {
            Self::Auto => Backend::Auto,
            Self::Cpu => Backend::Cpu,
            Self::Cuda => Backend::Cuda,
        }))
    }
}

fn main() -> ExitCode {
    let options = Options::parse();
    let renderer = headless::find_renderer();
    if options.headless || !has_display() || renderer.is_none() {
        return script::run(&options, renderer);
    }
    // The one that was found knows nothing of windows: the window's app gets its own.
    drop(renderer);
    match open_window(&options).run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

/// Everything of the game that needs no window.
pub fn game(app: &mut App, engine: BurrowEngine) {
    app.insert_resource(engine).add_plugins((
        BurrowPlugins,
        landscape::LandscapePlugin,
        sky::SkyPlugin,
        light::LightPlugin,
        player::PlayerPlugin,
        tools::ToolsPlugin,
        report::LogbookPlugin,
    ));
}

fn open_window(options: &Options) -> App {
    let window = Window {
        title: "bevy_burrow: digger".into(),
        resolution: (options.width, options.height).into(),
        ..default()
    };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }));
    game(&mut app, options.backend.engine());
    app.add_plugins(hud::HudPlugin);
    app
}

/// Can a window be opened? The examples are built for X11 on Linux; elsewhere there is always a desktop.
fn has_display() -> bool {
    !cfg!(target_os = "linux") || std::env::var_os("DISPLAY").is_some_and(|display| !display.is_empty())
}
