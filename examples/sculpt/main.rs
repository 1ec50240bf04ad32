//! `sculpt`: a landscape editor with the panel, a free camera and every operation.
//!
//! ```text
//! cargo run --release --features examples --example sculpt
//! cargo run --release --features examples --example sculpt -- --stamp assets/stamps/crater.png
//! cargo run --release --features examples --example sculpt -- --headless --out out/sculpt
//! ```
//!
//! | control | does |
//! | --- | --- |
//! | left button, held | a stroke with the panel's brush under the mouse: one step of undo |
//! | the same with `Shift`, `Ctrl` | the opposite operation, smooth |
//! | `Alt` or `L` and the left button | takes the ground's material, draws a straight line from the last stroke |
//! | right button, held | looks around; the wheel changes the speed |
//! | `W` `A` `S` `D`, `Q`, `E`, left `Shift` | flies, down, up, faster |
//! | `F` | flies to what is under the mouse |
//! | wheel, `[`, `]` | size of the brush |
//! | `1` to `9`, `0`, `-`, `=`, `P`, `R`, `X`, `U`, `V`, or `Tab` | operations |
//! | click, `Enter`, `Backspace` with the shape *Path* | sets a point, makes one edit of all points, takes the last one back, as `Ctrl+Z` does; `Esc` drops all |
//! | `G`, `Enter`, `End`, `Esc` | places the brush, with handles to move, turn and scale it; applies it; moves it to the ground; takes it back |
//! | `Ctrl+C`, `Ctrl+Shift+C` | copies what lies in the brush, to paste it; writes it to a `.prefab` file in the folder of pictures too |
//! | `Ctrl+Z`, `Ctrl+Y` or `Ctrl+Shift+Z` | undo, redo |
//! | `Ctrl+N`, `Ctrl+O`, `Ctrl+S`, `Ctrl+Shift+S` | new, open, save, save as |
//! | `H` | takes the height under the mouse for levelling |
//! | `F1`, `Ctrl` with `+` or `-` | shows and hides the panel; makes it larger or smaller |
//! | `F12` | saves a picture |
//! | a PNG dropped on the window | becomes the stamp, as with `--stamp`: plain grey, white is high |
//! | a `.prefab` dropped on the window | is pasted |
//! | a `.glb` or `.gltf` with closed meshes dropped on the window | becomes the brush's shape, as with `--model` |
//! | `Esc` | quits, and asks before changes are lost; cancels a question |
//!
//! With `--headless`, or without a display, a script sculpts instead and saves pictures, panel included, in `--out`.
//! Each stroke's receipt is a line on standard output.
//!
//! | file | subject |
//! | --- | --- |
//! | `scene.rs` | landscape, sun, camera |
//! | `stroke.rs` | aim, preview, strokes |
//! | `keys.rs` | keys and the wheel |
//! | `stamps.rs`, `models.rs` | stamps, prefabs and models from files |
//! | `journal.rs` | a line for each receipt |
//! | `script.rs` | the script for `--headless` |

#[path = "../shared/display.rs"]
mod display;
mod journal;
mod keys;
mod models;
#[path = "../shared/offscreen.rs"]
mod offscreen;
#[path = "../shared/photo.rs"]
mod photo;
mod scene;
mod script;
mod stamps;
mod stroke;

use std::path::PathBuf;
use std::process::{ExitCode, Termination};

use bevy::prelude::*;
use bevy_burrow::debug::BurrowDebugPlugin;
use bevy_burrow::panel::{BrushTool, BurrowPanel, BurrowPanelPlugin};
use bevy_burrow::prelude::*;
use clap::Parser;

/// A landscape like in an editor, with a panel.
#[derive(Parser, Clone, Debug)]
struct Options {
    /// Sculpt by script and write pictures, even where a window could be opened.
    #[arg(long)]
    headless: bool,
    /// Folder for pictures.
    #[arg(long, value_name = "DIR", default_value = "out/sculpt")]
    out: PathBuf,
    /// Width of the window or the pictures, in pixels.
    #[arg(long, default_value_t = 1280, value_parser = clap::value_parser!(u32).range(64..=8192))]
    width: u32,
    /// Height of the window or the pictures, in pixels.
    #[arg(long, default_value_t = 720, value_parser = clap::value_parser!(u32).range(64..=8192))]
    height: u32,
    /// Cells along the sides of the level.
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u32).range(64..=4096))]
    cells: u32,
    /// Image to stamp: a PNG of plain grey with 8 or 16 bits, 2 to 256 samples a side; white is high.
    #[arg(long, value_name = "FILE")]
    stamp: Option<PathBuf>,
    /// Model to dig and build with in a window: a .glb or .gltf file with closed meshes.
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Write each frame, and where the panel's widgets are, to standard output: for scripts that click on them.
    #[arg(long)]
    tell: bool,
}

fn main() -> ExitCode {
    let options = Options::parse();
    if options.headless || !display::has_display() {
        return match script::play(&options) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("sculpt: {error}");
                ExitCode::FAILURE
            }
        };
    }
    let window = Window {
        title: "bevy_burrow: sculpt".into(),
        resolution: (options.width, options.height).into(),
        ..default()
    };
    let mut app = App::new();
    app.add_plugins(DefaultPlugins.set(WindowPlugin {
        primary_window: Some(window),
        // The panel asks first where changes are not saved.
        close_when_requested: false,
        ..default()
    }));
    editor(&mut app, &options);
    app.add_plugins((stroke::StrokePlugin, keys::KeysPlugin, stamps::DropPlugin, models::ModelsPlugin));
    if let Some(file) = options.model {
        app.world_mut().resource_mut::<models::Reading>().start(file);
    }
    if let Some(file) = &options.stamp {
        let taken = stamps::take(file, &mut app.world_mut().resource_mut::<BrushTool>());
        app.world_mut().resource_mut::<BurrowPanel>().report(taken);
    }
    app.run().report()
}

/// Everything that does not need a window.
fn editor(app: &mut App, options: &Options) {
    app.insert_resource(journal::PrintAll(options.tell)).add_plugins((
        BurrowPlugins,
        BurrowPanelPlugin,
        BurrowDebugPlugin,
        scene::ScenePlugin(options.cells),
        stroke::PreviewPlugin,
        journal::JournalPlugin,
    ));
    let mut panel = app.world_mut().resource_mut::<BurrowPanel>();
    panel.pictures = options.out.clone();
    panel.level = options.out.join("level");
}
