//! `digger`: a small first-person game on a real landscape that can be dug.
//!
//! ```text
//! cargo run --release --features examples --example digger
//! cargo run --release --features examples --example digger -- --headless --out out/digger
//! ```
//!
//! The game starts with a title and a menu. `H` shows the keys, and all of them can be changed. Settings are stored in
//! the user's configuration folder, in `bevy_burrow/digger.json`.
//!
//! | control | action |
//! | --- | --- |
//! | `W` `A` `S` `D` or arrows, `Shift`, `Space` | walk, run, jump |
//! | left button | use the tool; hold to repeat |
//! | right button | build with the chosen material, as far as there is enough of it |
//! | wheel | size of the brush |
//! | `1` to `8` | pickaxe, shovel, drill, builder, painter, bomb, lamp, ball |
//! | `Q` `E`, `C` | material, shape of what is built |
//! | `F`, `Z` `Y` | headlamp; undo, redo |
//! | `F1` | the plugin's panel, with frame times |
//! | `H`, `Esc` | help, pause |
//!
//! Keys are bound by their position on an American keyboard. The menus show the letters of the player's own layout.
//!
//! The world is saved while you dig, with the inventory, the tools, the lamps and the player's place: the title
//! continues the world that was played last, "Worlds" lists all, and `--world NAME` plays one, or a new one of that
//! name. Scripts save only with `--world`.
//!
//! Others can join: choose "Multiplayer" on the title, or start with `--host`, and with `--join ADDRESS` on their
//! machines.
//!
//! The world has 8192 x 8192 cells of a metre: a real elevation model in the middle, and noise around it, which grows
//! into mountains. Ground is computed where it is needed, and drawn at levels of detail up to the view distance.
//!
//! With `--features examples,sound`, digging, steps, bombs and falling ground are heard. Linux needs the headers of
//! ALSA.
//!
//! With `--features examples,gamepad`, a gamepad does all of this except for the panel. Its sticks
//! walk and look, its shoulder buttons change the tool, and its left stick or D-pad selects menu items.
//!
//! Without a display or a graphics adapter, or with `--headless`, a script plays the game: it walks to a hillside, digs
//! a tunnel with a bend and a room, and builds a bridge and a pit. Pictures and a summary are written to `--out`. With
//! `--tour`, a minute of play is recorded frame by frame.
//!
//! | folder | contents |
//! | --- | --- |
//! | `player` | input and bindings, the character, the camera, the headlamp, the game's states |
//! | `tools` | what the player holds: digging, building, bombs, balls and lamps, and the inventory |
//! | `world` | the landscape and its ore, saved worlds, day and night, the sky, plants, particles, debris and sounds |
//! | `ui` | menus, settings, and the heads-up display |
//! | `party` | playing together: hosting, joining, and what other players look like |
//! | `film` | scripts that play the game for pictures and films |

#[path = "../shared/display.rs"]
mod display;
mod film;
#[path = "../shared/offscreen.rs"]
mod offscreen;
mod party;
mod player;
#[cfg(test)]
mod test_support;
mod tools;
mod ui;
mod world;

use std::path::PathBuf;
use std::process::ExitCode;

use bevy::prelude::*;
use bevy_burrow::backend::{Backend, Engine};
use bevy_burrow::prelude::*;
use bevy_burrow::view::GroundTextureCache;
use clap::Parser;

use crate::party::connection::{Address, Party};
use crate::ui::settings::{Quality, Settings, SettingsFile};
use crate::world::folders::{self, WorldsFolder};

/// A first-person game on a landscape that can be dug.
#[derive(Parser, Clone, Debug)]
pub struct Options {
    /// Play the script and write pictures, even if a window could be opened.
    #[arg(long)]
    headless: bool,
    /// Record a minute of play, frame by frame.
    #[arg(long)]
    tour: bool,
    /// Number of frames to draw, evenly spread over the tour. All by default.
    #[arg(long, requires = "tour", value_name = "N", value_parser = clap::value_parser!(u32).range(1..=7200))]
    frames: Option<u32>,
    /// Frames per second of the tour.
    #[arg(long, requires = "tour", value_name = "F", default_value_t = 30)]
    #[arg(value_parser = clap::value_parser!(u32).range(10..=120))]
    fps: u32,
    /// Folder for pictures and the summary.
    #[arg(long, value_name = "DIR", default_value = "out/digger")]
    out: PathBuf,
    /// Width of the window or the pictures, in pixels.
    #[arg(long, default_value_t = 1280, value_parser = clap::value_parser!(u32).range(64..=8192))]
    width: u32,
    /// Height of the window or the pictures, in pixels.
    #[arg(long, default_value_t = 720, value_parser = clap::value_parser!(u32).range(64..=8192))]
    height: u32,
    /// Draw every frame of the script, not only the pictures, to measure frame times.
    #[arg(long, requires = "headless")]
    draw_all: bool,
    /// Draw the script in low quality on a GPU too, as software renderers always do, so that pictures can be compared.
    #[arg(long, requires = "headless")]
    low: bool,
    /// Draw plants in the script and the tour, and in the window in low quality; in others they always are there.
    #[arg(long)]
    plants: bool,
    /// Log events to standard output, for programs that play the game.
    #[arg(long)]
    tell: bool,
    /// The saved world to play: its name, or its folder. By default the one that was played last; scripts save nothing.
    #[arg(long, value_name = "NAME")]
    world: Option<String>,
    /// Let others join, at this port.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "5100", conflicts_with = "tour")]
    host: Option<u16>,
    /// Join the world of a host, at this address.
    #[arg(long, value_name = "ADDRESS", conflicts_with_all = ["host", "tour", "world"])]
    join: Option<Address>,
    /// What others call you.
    #[arg(long)]
    name: Option<String>,
    /// Where edits are computed.
    #[arg(long, value_enum, default_value_t = Computer::Auto)]
    backend: Computer,
}

impl Options {
    /// The folder of the world that was asked for.
    fn saved_world(&self) -> Option<PathBuf> {
        self.world.as_deref().and_then(|name| WorldsFolder::of_user().named(name))
    }

    /// The players in it.
    fn party(&self) -> Party {
        let guest = self.join.map(|Address(host, seed)| Party::Guest(host, seed));
        guest.or(self.host.map(Party::Host)).unwrap_or_default()
    }
}

/// A [`Backend`] on the command line.
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
            println!("--headless is ignored: --tour never opens a window");
        }
        return film::tour::run(&options, renderer);
    }
    if options.headless || !display::has_display() || renderer.is_none() {
        return film::script::run(&options, renderer);
    }
    // It was created without a window. Bevy creates another one for the window.
    drop(renderer);
    match open_window(&options).run() {
        AppExit::Success => ExitCode::SUCCESS,
        AppExit::Error(code) => ExitCode::from(code.get()),
    }
}

/// Adds the whole game to an app with or without a window.
pub fn game(
    app: &mut App,
    engine: BurrowEngine,
    settings: SettingsFile,
    world: Option<PathBuf>,
    party: Party,
) {
    app.insert_resource(engine)
        .add_plugins((BurrowPlugins, ui::settings::SettingsPlugin(settings)))
        .add_plugins((
            party::connection::ConnectionPlugin(party),
            party::players::PlayersPlugin,
            party::figures::FiguresPlugin,
        ))
        .add_plugins((
            player::input::InputPlugin,
            player::game_state::GameStatePlugin,
            player::body::BodyPlugin,
            player::PlayerPlugin,
            player::camera::CameraPlugin,
            player::headlamp::HeadlampPlugin,
            player::world_edge::WorldEdgePlugin,
        ))
        .add_plugins((
            tools::ToolsPlugin,
            tools::aim::AimPlugin,
            tools::tool_in_hand::ToolInHandPlugin,
            tools::digging::DiggingPlugin,
            tools::hardness::HardnessPlugin,
            tools::inventory::InventoryPlugin,
            tools::thrown::ThrownPlugin,
            tools::bombs::BombsPlugin,
            tools::balls::BallsPlugin,
            tools::lamps::LampsPlugin,
        ))
        .add_plugins((
            world::landscape::LandscapePlugin,
            world::saves::SavesPlugin(world),
            world::thumbnails::ThumbnailsPlugin,
            world::sky::SkyPlugin,
            world::air::AirPlugin,
            world::day::DayPlugin,
            world::light::LightPlugin,
            world::particles::ParticlesPlugin,
            world::debris::DebrisEffectsPlugin,
        ))
        .init_resource::<ui::images::Images>()
        .add_plugins((
            ui::widgets::UiPlugin,
            ui::menu::MenuPlugin,
            ui::hud::HudPlugin,
            ui::panel::PanelPlugin,
            film::report::EditLogPlugin,
        ));
    #[cfg(feature = "sound")]
    app.add_plugins(world::sounds::SoundPlugin);
}

fn open_window(options: &Options) -> App {
    let window =
        Window { title: "Digger".into(), resolution: (options.width, options.height).into(), ..default() };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin { primary_window: Some(window), ..default() }));
    app.insert_resource(GroundTextureCache(folders::folder_of_textures()));
    let worlds = WorldsFolder::of_user();
    let world = options.saved_world().or_else(|| worlds.latest());
    // Where that fails, "Play" says why.
    let world = world.or_else(|| options.host.and_then(|_| worlds.create_next().ok()));
    game(&mut app, options.backend.engine(), SettingsFile::of_user(), world, options.party());
    // Low quality is for weak GPUs and software renderers.
    if options.plants || app.world().resource::<Settings>().quality != Quality::Low {
        app.add_plugins((world::plants::PlantEffectsPlugin, bevy_burrow::plants::PlantCollidersPlugin));
    }
    if let Some(name) = &options.name {
        app.world_mut().resource_mut::<Settings>().name.clone_from(name);
    }
    if options.tell {
        app.add_plugins(film::event_log::EventLogPlugin);
    }
    app
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_without_effect_are_rejected() {
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
            ("digger --headless --world mine", true),
            ("digger --host", true),
            ("digger --host 7000 --world mine --name Ann", true),
            ("digger --join 192.168.0.7", true),
            ("digger --join ann", false),
            ("digger --join 192.168.0.7 --host", false),
            ("digger --tour --host", false),
        ] {
            assert_eq!(Options::try_parse_from(line.split(' ')).is_ok(), is_understood, "{line}");
        }
    }
}
