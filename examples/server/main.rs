//! `server`: the world without rendering, as a dedicated server runs it: brushes in, receipts and a hash out.
//!
//! ```text
//! cargo run --release --features examples --example server
//! cargo run --release --features examples --example server -- --script examples/server/brushes.jsonl
//! some_game | cargo run --release --features examples --example server -- --script -
//! some_game | cargo run --release --features examples --example server -- --world out/world --script -
//! ```
//!
//! It runs Bevy's `MinimalPlugins` and `BurrowPlugins`, so it needs no window, no graphics and no assets. A script has
//! a brush a line, as [`Brush`] describes it, in voxels; `{"undo":true}` and `{"redo":true}` are steps through history,
//! and blank lines and lines that start with `#` are ignored. `-` reads standard input as it comes in; without a
//! script it digs at random, the same each time.
//!
//! For each brush a line with what became of it, then fields, memory, and the hash of the world: a client that got the
//! same brushes in the same order has the same one. With `--per-tick` brushes go in batches, as they would from
//! players; the hash does not depend on that, but for scripts with steps: a step undoes a batch, unless the brushes say
//! of which `"stroke"` they are; then it undoes a stroke, however many ticks that took. From standard input each brush
//! is a batch of its own.
//!
//! With `--world` the world is saved in a folder, and continued from there. Then standard output holds JSON lines only:
//! `{"revision":7,"hash":"0x..."}` for each commit, and `{"durable":7}` once everything up to it would survive a crash
//! or a loss of power.
//!
//! | file | subject |
//! | --- | --- |
//! | `script.rs` | where brushes come from |
//! | `report.rs` | what is printed |
//! | `saving.rs` | the world on disk |

#[path = "../shared/brush_lines.rs"]
mod brush_lines;
#[path = "../shared/noise_ground.rs"]
mod noise_ground;
#[path = "../shared/output.rs"]
mod output;
mod report;
mod saving;
mod script;

use std::path::PathBuf;
use std::process::{ExitCode, Termination};
use std::time::Duration;

use bevy::app::ScheduleRunnerPlugin;
use bevy::prelude::*;
use bevy_burrow::backend::{Backend, Engine};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{Meshing, WorkLimits};
use clap::Parser;

use noise_ground::noise_ground;
use output::complain;

/// The world without rendering: brushes in, receipts and a hash out.
#[derive(Parser, Clone, Debug)]
pub struct Options {
    /// Brushes, one JSON object a line; `-` for standard input.
    #[arg(long, value_name = "FILE")]
    script: Option<PathBuf>,
    /// Brushes to make up without a script.
    #[arg(long, default_value_t = 200)]
    brushes: u64,
    /// Brushes that go in with each tick.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u64).range(1..))]
    per_tick: u64,
    /// Ticks a second, up to 1000; 0 for as many as there can be.
    #[arg(long, default_value_t = 0.0, value_parser = ticks)]
    ticks: f64,
    /// Cells along the world's sides.
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=8192))]
    side: u32,
    /// Cells along a chunk's side.
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u32).range(8..=128))]
    chunk: u32,
    /// Keeps the world in this folder.
    #[arg(long, value_name = "DIR")]
    world: Option<PathBuf>,
    /// Prints no receipts, only the end.
    #[arg(long)]
    quiet: bool,
}

fn ticks(text: &str) -> Result<f64, String> {
    let ticks: f64 = text.parse().map_err(|error| format!("{error}"))?;
    let is_known = ticks == 0.0 || (0.001..=1000.0).contains(&ticks);
    if is_known { Ok(ticks) } else { Err("it is neither 0 nor within 0.001 to 1000".into()) }
}

fn main() -> ExitCode {
    let options = Options::parse();
    // The script first: what is wrong with it should not have to wait for the ground.
    match script::open(&options).and_then(|source| make(&options, source)) {
        Ok(mut app) => app.run().report(),
        Err(error) => {
            complain(format_args!("server: {error}"));
            ExitCode::FAILURE
        }
    }
}

/// The server with its world, new or from its folder.
fn make(options: &Options, source: script::Source) -> Result<App> {
    let untouched = terrain(options)?;
    let Some(folder) = &options.world else { return Ok(app(options, source, untouched)) };
    let (saving, terrain) = saving::open(folder, options, untouched)?;
    let mut app = app(options, source, terrain);
    saving::add(&mut app, saving);
    Ok(app)
}

fn app(options: &Options, source: script::Source, mut terrain: Terrain) -> App {
    // Nothing is shown, so no surfaces are made or kept.
    terrain.set_meshing(Meshing::Never);
    let period = Duration::try_from_secs_f64(1.0 / options.ticks).unwrap_or(Duration::ZERO);
    let mut app = App::new();
    app.add_plugins(MinimalPlugins.set(ScheduleRunnerPlugin::run_loop(period)))
        .insert_resource(BurrowEngine(Engine::new(Backend::Cpu)))
        .add_plugins(BurrowPlugins);
    report::add(&mut app, options.quiet, options.world.is_some());
    script::add(&mut app, source);
    app.world_mut().spawn(terrain);
    app
}

/// Hills in chunks, not touched yet.
fn terrain(options: &Options) -> Result<Terrain> {
    let ground = noise_ground(options.side)?;
    let settings = TerrainSettings { chunk_size: options.chunk, voxel_size: 1.0 };
    let mut terrain = Terrain::new(ground, &settings)?;
    // All of a tick is taken, or the world would depend on how much that is.
    terrain.set_work_limits(WorkLimits { waiting: u64::MAX, ..default() });
    Ok(terrain)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The world after a script, with `per_tick` lines a tick.
    fn play(script: &str, per_tick: &str) -> App {
        let name = format!("bevy_burrow_server_{}_{per_tick}.jsonl", std::process::id());
        let place = std::env::temp_dir().join(name);
        std::fs::write(&place, script).unwrap();
        let words = ["server", "--quiet", "--side", "64", "--per-tick", per_tick, "--script"];
        let words = words.map(std::ffi::OsStr::new);
        let options = Options::parse_from(words.into_iter().chain([place.as_os_str()]));
        let source = script::open(&options).unwrap();
        let mut app = app(&options, source, terrain(&options).unwrap());
        app.finish();
        app.cleanup();
        while app.should_exit().is_none() {
            app.update();
        }
        std::fs::remove_file(place).unwrap();
        app
    }

    fn hash(mut app: App) -> u64 {
        let world = app.world_mut();
        world.query::<&Terrain>().single(world).unwrap().world().hash()
    }

    fn place(i: u32) -> [u32; 2] {
        [8 + i % 4 * 12, 8 + i / 4 * 14]
    }

    fn line(i: u32, stroke: &str) -> String {
        let [x, z] = place(i);
        format!("{{\"shape\":\"sphere\",\"center\":[{x},0,{z}],\"radius\":16,\"op\":\"dig\"{stroke}}}\n")
    }

    fn dig(i: u32) -> Brush {
        let [x, z] = place(i).map(|at| at as f32);
        Brush::dig(Shape::sphere(Vec3::new(x, 0.0, z), 16.0))
    }

    fn untouched() -> Terrain {
        terrain(&Options::parse_from(["server", "--side", "64"])).unwrap()
    }

    #[test]
    fn a_step_undoes_the_batch_before_it_however_fast_that_was() {
        let script = (0..12).map(|i| line(i, "")).collect::<String>() + "{\"undo\":true}\n";
        let mut expected = untouched();
        let receipts = expected.apply((0..8).map(dig));
        let dug = |receipt: &Receipt| receipt.outcome.as_ref().is_ok_and(|own| own.removed.total() > 0);
        assert!(receipts.iter().filter(|receipt| dug(receipt)).count() > 4);
        for _ in 0..3 {
            assert_eq!(hash(play(&script, "4")), expected.world().hash());
        }
    }

    #[test]
    fn with_strokes_the_world_is_the_same_however_many_lines_a_tick_has() {
        let stroke = |i: u32| line(i, &format!(",\"stroke\":{}", i / 5));
        let digs = |range: std::ops::Range<u32>| range.map(stroke).collect::<String>();
        let undo = "{\"undo\":true}\n";
        // The second stroke goes; the third is taken back and done again; its last part is a step of its own.
        let script = digs(0..10) + undo + &digs(10..14) + undo + "{\"redo\":true}\n" + &digs(14..15);
        let mut expected = untouched();
        expected.apply((0..5).chain(10..15).map(dig));
        for per_tick in ["1", "2", "3", "7", "100"] {
            let mut app = play(&script, per_tick);
            let world = app.world_mut();
            let terrain = world.query::<&Terrain>().single(world).unwrap();
            assert_eq!(terrain.world().hash(), expected.world().hash(), "{per_tick} lines a tick");
            assert_eq!(terrain.history().undos, 3, "{per_tick} lines a tick");
        }
    }
}
