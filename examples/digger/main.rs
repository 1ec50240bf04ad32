//! `digger`: first person on a real landscape, with a shovel.
//!
//! ```text
//! cargo run --release --features examples --example digger
//! cargo run --release --features examples --example digger -- --headless --out out/digger
//! ```
//!
//! A title, a menu and a game: `H` shows its keys, and all of them can be bound anew. Settings are kept in the user's
//! folder of settings, in `bevy_burrow/digger.json`.
//!
//! | control | does |
//! | --- | --- |
//! | `W` `A` `S` `D` or arrows, `Shift`, `Space` | walk, run, jump |
//! | left button | uses the tool in hand; held, again and again |
//! | right button | builds with the chosen material, as far as what was dug allows |
//! | wheel | size of the brush |
//! | `1` to `8` | pickaxe, shovel, drill, builder, painter, bomb, lamp, ball |
//! | `Q` `E`, `C` | material, form of what is built |
//! | `F`, `Z` `Y` | headlamp; undo, redo |
//! | `F1` `F3` | panel, frame times |
//! | `H`, `Esc` | help, pause |
//!
//! Keys are bound by their place, as an American keyboard has them, and called by the letters that they turn out to have.
//!
//! A gamepad does that too, all but the panel and the frame times, with `--features examples,gamepad`: its sticks walk and
//! look, its shoulders go through the tools, and its left stick or its cross through the menus.
//! The title leads on with a game that was left, or begins a new one: fresh land, and nothing in the bag.
//!
//! Without a display or a graphics adapter, or with `--headless`, it plays a script instead: a walk up to a hillside, a
//! tunnel with a bend and a room, a bridge, a pit across a chunk corner. Pictures and a summary go to `--out`. With
//! `--tour` it films a minute of play, frame by frame.
//!
//! | file | subject |
//! | --- | --- |
//! | `phase.rs`, `menu.rs` and `menu/`, `ui.rs`, `art.rs` | title, pause, settings, controls, help |
//! | `input.rs`, `bindings.rs`, `labels.rs`, `settings.rs` | actions, their keys and what stands on those; what the player may set |
//! | `player.rs`, `body.rs`, `rim.rs` | the player's eyes and body, and where the world ends |
//! | `tools.rs`, `form.rs`, `preview.rs`, `held.rs` | the tools, what they would do, and how they look in hand |
//! | `work.rs`, `toughness.rs`, `amount.rs`, `inventory.rs` | what they do to the ground, what resists them, and what is left of it |
//! | `bombs.rs`, `balls.rs`, `thrown.rs`, `lamps.rs`, `debris.rs`, `particles.rs` | what flies, what bounces, what shines, what falls and crumbles |
//! | `landscape.rs`, `veins.rs`, `sky.rs`, `day.rs`, `light.rs` | the land, and the light on it at any hour |
//! | `hud.rs`, `frames.rs`, `panel.rs` | what is written over it all |
//! | `places.rs`, `works.rs` | where scripts dig, and what |
//! | `script.rs`, `tour.rs` and `tour/` | two stories |
//! | `studio.rs`, `film.rs`, `headless.rs` | who plays and films them; the app without a window |
//! | `report.rs`, `tell.rs` | receipts, times and the summary; what goes on |

#[path = "../shared/display.rs"]
mod display;
mod film;
#[path = "../shared/offscreen.rs"]
mod offscreen;
mod player;
mod tools;
mod ui;
mod world;

use std::path::PathBuf;
use std::process::ExitCode;

use bevy::prelude::*;
use bevy_burrow::backend::{Backend, Engine};
use bevy_burrow::prelude::*;
use clap::Parser;

use crate::ui::settings::SettingsFile;

/// First person on a real landscape, with a shovel.
#[derive(Parser, Clone, Debug)]
pub struct Options {
    /// Play the script and write pictures, even where a window could be opened.
    #[arg(long)]
    headless: bool,
    /// Film a minute of play instead, frame by frame.
    #[arg(long)]
    tour: bool,
    /// Frames of the tour that are drawn, evenly spread; all of them without it.
    #[arg(long, requires = "tour", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=7200))]
    frames: Option<u32>,
    /// Frames in a second of the tour.
    #[arg(long, requires = "tour", value_name = "F", default_value_t = 30)]
    #[arg(value_parser = clap::value_parser!(u32).range(10..=120))]
    fps: u32,
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
    #[arg(long, requires = "headless")]
    draw_all: bool,
    /// Say on standard output what goes on, for programs that play the game.
    #[arg(long)]
    tell: bool,
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
    let renderer = offscreen::find_renderer();
    if options.tour {
        if options.headless {
            println!("--tour is filmed without a window anyway, and instead of the script");
        }
        return film::tour::run(&options, renderer);
    }
    if options.headless || !display::has_display() || renderer.is_none() {
        return film::script::run(&options, renderer);
    }
    // The one that was found knows nothing of windows: the window's app gets its own.
    drop(renderer);
    match open_window(&options).run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

/// Everything of the game, in a window or not.
pub fn game(app: &mut App, engine: BurrowEngine, settings: SettingsFile) {
    app.insert_resource(engine)
        .add_plugins((
            BurrowPlugins,
            ui::settings::SettingsPlugin(settings),
            player::input::InputPlugin,
            player::game_state::PhasePlugin,
            world::landscape::LandscapePlugin,
            world::veins::VeinsPlugin,
            world::sky::SkyPlugin,
            world::day::DayPlugin,
            world::light::LightPlugin,
        ))
        .add_plugins((
            player::body::BodyPlugin,
            player::PlayerPlugin,
            tools::thrown::ThrownPlugin,
            player::world_edge::RimPlugin,
            tools::ToolsPlugin,
            tools::aim::PreviewPlugin,
            tools::tool_in_hand::HeldPlugin,
            tools::digging::WorkPlugin,
            tools::hardness::ToughnessPlugin,
            tools::inventory::InventoryPlugin,
            world::particles::ParticlesPlugin,
            tools::bombs::BombsPlugin,
            tools::balls::BallsPlugin,
            tools::lamps::LampsPlugin,
            world::debris::RubblePlugin,
        ))
        .add_plugins((
            ui::art::ArtPlugin,
            ui::widgets::UiPlugin,
            ui::menu::MenuPlugin,
            ui::hud::HudPlugin,
            film::frames::FramesPlugin,
            ui::panel::PanelPlugin,
            film::report::LogbookPlugin,
        ));
}

fn open_window(options: &Options) -> App {
    let window =
        Window { title: "Digger".into(), resolution: (options.width, options.height).into(), ..default() };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }));
    game(&mut app, options.backend.engine(), SettingsFile::of_user());
    if options.tell {
        app.add_plugins(film::event_log::TellPlugin);
    }
    app
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_would_do_nothing_is_refused() {
        for (line, is_understood) in [
            ("digger", true),
            ("digger --tour", true),
            ("digger --tour --fps 10 --frames 12", true),
            ("digger --fps 24", false),
            ("digger --frames 12", false),
            ("digger --headless --fps 24", false),
            ("digger --headless --draw-all --backend cpu", true),
            ("digger --draw-all", false),
            ("digger --tour --draw-all", false),
        ] {
            assert_eq!(Options::try_parse_from(line.split(' ')).is_ok(), is_understood, "{line}");
        }
    }
}
