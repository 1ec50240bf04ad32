//! `burrow`: inspects, checks, repairs and converts saved worlds. Does not use Bevy.
//!
//! ```text
//! cargo run --release --no-default-features --features store --example burrow -- info WORLD
//! cargo run --release --no-default-features --features store --example burrow -- check WORLD --side 512
//! ```
//!
//! | command | does | needs the ground |
//! | --- | --- | --- |
//! | `info` | prints facts about a world | no |
//! | `check` | reads all of it, and replays its log from the first commit on; changes nothing | for a full check |
//! | `repair` | opens whatever is left of it, rebuilds damaged parts, and saves it | yes |
//! | `compact` | makes the file of regions as small as possible | yes |
//! | `replay` | replays only the log, and verifies each commit | yes |
//! | `export` | writes the world to one file | yes |
//! | `import` | makes a world from such a file | yes |
//!
//! Each prints one JSON object with `revision` and `hash`. A world holds only the differences from its ground. Choose
//! the ground with `--heights` and the options next to it, as for the example `export`, or with `--side`, as for the
//! example `server`. Choose the level that it is based on, if there is one, with `--level`. `repair`, `compact` and
//! `import` refuse another ground or level than the world's own, because a single wrong number would move the world
//! there permanently; `--other-base keep` or `replay` does so on purpose.
//!
//! `info`, `check`, `replay` and `export` change nothing, so they also work on read-only media. `repair` opens worlds
//! that a game refuses to open because a file can't be read or only regions are left. It replaces a file only once the
//! new one is complete, and keeps the old one in `quarantine`.
//!
//! | exit code | when |
//! | --- | --- |
//! | 0 | all is well |
//! | 1 | the world is damaged, or was; `warnings` lists the damage |
//! | 2 | it could not be done: the reason goes to stderr |

mod ground;
#[path = "../shared/json.rs"]
mod json;
#[path = "../shared/noise_ground.rs"]
mod noise_ground;
#[path = "../shared/output.rs"]
mod output;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use bevy_burrow::store::{self, BaseChanged, Folder, Store, StoreError, StoreOptions, WorldFile};
use bevy_burrow::terrain::World;
use clap::{Parser, Subcommand};
use serde_json::{Map, Value, json};

use ground::GroundArgs;
use output::{complain, say};

/// Looks at saved worlds, checks and repairs them.
#[derive(Parser)]
struct Args {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    ground: GroundArgs,
}

#[derive(Subcommand)]
enum Command {
    /// Prints what is known of a world
    Info {
        /// The world's folder
        world: PathBuf,
    },
    /// Reads all of a world, and changes nothing
    Check {
        /// The world's folder
        world: PathBuf,
    },
    /// Opens whatever is left of a world, rebuilds what is damaged, and saves it
    Repair {
        /// The world's folder
        world: PathBuf,
    },
    /// Makes the file of regions as small as it can be
    Compact {
        /// The world's folder
        world: PathBuf,
    },
    /// Writes a world to one file
    Export {
        /// The world's folder
        world: PathBuf,
        /// The file, which must not exist
        file: PathBuf,
    },
    /// Makes a world of such a file
    Import {
        /// The file
        file: PathBuf,
        /// The world's folder, in which there is none yet
        world: PathBuf,
    },
    /// Replays the log alone, and verifies each commit
    Replay {
        /// The world's folder
        world: PathBuf,
    },
}

fn main() -> ExitCode {
    let args = Args::parse();
    match run(&args) {
        Ok((answer, is_sound)) => {
            say(format_args!("{answer}"));
            ExitCode::from(u8::from(!is_sound))
        }
        Err(why) => {
            complain(format_args!("burrow: {why}"));
            ExitCode::from(2)
        }
    }
}

impl Command {
    /// The folder of a world that should be there.
    fn world(&self) -> Option<&Path> {
        match self {
            Self::Info { world }
            | Self::Check { world }
            | Self::Repair { world }
            | Self::Compact { world }
            | Self::Export { world, .. }
            | Self::Replay { world } => Some(world),
            Self::Import { .. } => None,
        }
    }
}

/// What to print, and whether all is well.
fn run(args: &Args) -> Result<(Value, bool), String> {
    if let Some(world) = args.command.world().filter(|world| world.is_file()) {
        return Err(format!(
            "{} is a file, and a world is a folder: `import` makes a world of an exported file",
            world.display()
        ));
    }
    match &args.command {
        Command::Info { world } => info(world),
        Command::Check { world } => check(world, &args.ground),
        Command::Repair { world } => opened(world, &args.ground, |_| Ok(())),
        Command::Compact { world } => {
            opened(world, &args.ground, |store| store.compact().map(drop).map_err(|why| why.to_string()))
        }
        Command::Export { world, file } => export(world, file, &args.ground),
        Command::Import { file, world } => import(file, world, &args.ground),
        Command::Replay { world } => {
            let ground = args.ground.required()?;
            let level = args.ground.level(&ground)?;
            let terrain = store::replay(world, ground, level.as_ref()).map_err(|why| why.to_string())?;
            Ok((Value::Object(state(terrain.world())), true))
        }
    }
}

fn hex(hash: u64) -> String {
    format!("{hash:#018x}")
}

/// Revision and hash of a world.
fn state(world: &World) -> Map<String, Value> {
    let mut state = Map::new();
    state.insert("revision".into(), world.revision().into());
    state.insert("hash".into(), hex(world.hash()).into());
    state
}

fn info(world: &Path) -> Result<(Value, bool), String> {
    let info = Store::inspect(world).map_err(|why| why.to_string())?;
    let game: Map<String, Value> =
        info.game.iter().map(|(key, bytes)| (key.clone(), (*bytes).into())).collect();
    let answer = json!({
        "revision": info.revision,
        "hash": hex(info.hash),
        "world": info.world.to_string(),
        "chunk_size": info.settings.chunk_size,
        "voxel_size": info.settings.voxel_size,
        "simulation": info.simulation,
        "ground": hex(info.ground),
        "ground_size": info.ground_size,
        "checkpoint": info.checkpoint,
        "regions": info.regions,
        "region_bytes": info.region_bytes,
        "segments": info.segments,
        "log_bytes": info.log_bytes,
        "is_log_whole": info.is_log_whole,
        "game": game,
        "level": info.level.map(|level| level.label),
        "warnings": info.damage,
    });
    Ok((answer, info.damage.is_empty()))
}

fn check(world: &Path, args: &GroundArgs) -> Result<(Value, bool), String> {
    let Some(ground) = args.build()? else { return info(world) };
    let level = args.level(&ground)?;
    let check = Store::check(world, ground, level.as_ref()).map_err(|why| why.to_string())?;
    let is_sound = check.warnings.is_empty() && check.replays != Some(false);
    let mut answer = state(check.terrain.world());
    answer.insert("warnings".into(), check.warnings.into());
    answer.insert("replays".into(), check.replays.into());
    Ok((Value::Object(answer), is_sound))
}

/// Opens a world, whatever is left of it, does something to it, and saves it.
fn opened(
    world: &Path,
    args: &GroundArgs,
    work: impl FnOnce(&mut Store) -> Result<(), String>,
) -> Result<(Value, bool), String> {
    let ground = args.required()?;
    let (level, base_changed) = (args.level(&ground)?, args.base_changed());
    let options = StoreOptions { level, base_changed, salvage: true, ..StoreOptions::default() };
    let opened = Store::open(world, ground, options);
    let (mut store, opened) = opened.map_err(|why| match why {
        StoreError::BaseChanged { .. } | StoreError::LevelChanged { .. } => {
            format!("{why}; nothing was changed, and --other-base keep does that")
        }
        why => why.to_string(),
    })?;
    work(&mut store)?;
    store.checkpoint().map_err(|why| why.to_string())?;
    let warnings: Vec<String> =
        opened.warnings.iter().chain(&store.take_warnings()).map(ToString::to_string).collect();
    let (mut answer, is_sound) = (state(opened.terrain.world()), warnings.is_empty());
    answer.insert("warnings".into(), warnings.into());
    answer.insert("is_log_whole".into(), opened.is_log_whole.into());
    Ok((Value::Object(answer), is_sound))
}

fn export(world: &Path, file: &Path, args: &GroundArgs) -> Result<(Value, bool), String> {
    let ground = args.required()?;
    let level = args.level(&ground)?;
    let read = store::read_world(world, ground, level.as_ref()).map_err(|why| why.to_string())?;
    let bytes = WorldFile::to_bytes(&read.terrain, read.world, &read.game).map_err(|why| why.to_string())?;
    write_new(file, &bytes).map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => format!("{} is there already: give another name", file.display()),
        _ => format!("{}: {error}", file.display()),
    })?;
    let mut answer = state(read.terrain.world());
    answer.insert("bytes".into(), bytes.len().into());
    let is_sound = read.warnings.is_empty();
    answer.insert("warnings".into(), read.warnings.into());
    Ok((Value::Object(answer), is_sound))
}

/// Writes a file that must not exist. It gets its name once it is complete.
fn write_new(file: &Path, bytes: &[u8]) -> io::Result<()> {
    if file.symlink_metadata().is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    let mut unfinished = file.as_os_str().to_owned();
    unfinished.push(".new");
    let write = || {
        let mut out = File::create(&unfinished)?;
        out.write_all(bytes)?;
        out.sync_all()?;
        fs::rename(&unfinished, file)
    };
    write().inspect_err(|_| drop(fs::remove_file(&unfinished)))
}

fn import(file: &Path, world: &Path, args: &GroundArgs) -> Result<(Value, bool), String> {
    let at = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let bytes = fs::read(file).map_err(|error| at(&error))?;
    let ground = args.required()?;
    let level = args.level(&ground)?;
    let imported = WorldFile::from_bytes(&bytes, ground).map_err(|error| match error {
        StoreError::Restore(_) => format!("{}: is it the ground that the world was saved with?", at(&error)),
        error => at(&error),
    })?;
    if imported.is_base_changed && args.base_changed() == BaseChanged::Refuse {
        let why = StoreError::BaseChanged { regions: 0 };
        return Err(format!("{}; --other-base keep does that", at(&why)));
    }
    let mut terrain = imported.terrain;
    let (files, options) = (Arc::new(Folder::new(world)), StoreOptions { level, ..StoreOptions::default() });
    let created = Store::create_with_data_in(files, &mut terrain, imported.game, options);
    drop(created.map_err(|why| why.to_string())?);
    let mut answer = state(terrain.world());
    answer.insert("is_base_changed".into(), imported.is_base_changed.into());
    Ok((Value::Object(answer), true))
}
