//! Plays a script of edits over a heightmap, and writes the drawn mesh and a report. Does not use Bevy.
//!
//! ```text
//! cargo run --release --no-default-features --example export -- \
//!     --heights assets/jacksboro_fault.png --voxels-per-sample 3 --height-range 0 150 \
//!     --edits examples/export/edits.jsonl --chunk-size 32 --out out/export
//! ```
//!
//! `--edits` holds one edit a line; blank lines and lines that start with `#` are skipped:
//!
//! ```json
//! {"shape":"sphere","center":[64,40,64],"radius":6,"op":"dig"}
//! {"shape":"capsule","from":[64,40,64],"to":[100,38,80],"radius":4,"op":"dig"}
//! {"shape":"sphere","center":[64,40,64],"radius":9,"op":"smooth","strength":0.5}
//! {"shape":"box","center":[90,50,90],"half":[6,1,3],"rotation":[0,0.383,0,0.924],"op":"add","material":5}
//! {"shape":"cone","base":[20,60,20],"axis":[0,9,0],"radius":5,"op":"paint","material":3}
//! ```
//!
//! `--strata` gives the ground strata: a preset, or a file with [`Strata`] as JSON. `--rules` limits what brushes
//! remove: a file with [`DiggingRules`] as JSON. `--probe` asks what lattice points of the pristine world are made of,
//! `[x,y,z]` a line; `probes.json` has an answer for each, `{"solid":true,"material":7}`.
//!
//! `mesh.obj` holds every drawn triangle with exact positions: y up, one unit per voxel, one group per tile and chunk.
//! Vertices of neighbouring parts are not welded. `report.json` has the hash, scenarios, counts, bytes, seams and
//! timings, and for each line of the edits the voxels by material: `removed`, `added`, `painted`, `refused`.
//!
//! With `--eye X Y Z`, in voxels, the mesh is what would be drawn from there with levels of detail, on a picture
//! `--screen-height` pixels high with an angle of view of 45 degrees; with `--random-cut SEED` any squares that may be
//! drawn together. Then `mesh.obj` has a group for each square, `node_X_Z_level_L`, `report.json` has nodes and
//! triangles by level in `levels`, and `seams` is the report of what was written.
//!
//! `--glb` also writes `mesh.glb`, the same triangles as binary glTF with normals, colours and materials; `--splats`
//! writes the materials of the surface as `splat_0.png` and so on, whose layers `report.json` lists; `--elevation` writes
//! the topmost ground as `elevation.png`, `.asc`, `.tif` or `.exr` (the last two with the feature `import`).
//!
//! | exit code | when |
//! | --- | --- |
//! | 0 | all files were written; edits that lie outside the world are named in the report |
//! | 1 | the files could not be written |
//! | 2 | an argument, the image or a line of the edits is bad: the reason goes to stderr |
//!
//! Unless the exit code is 0, no files are left behind.

#[path = "../shared/brush_lines.rs"]
mod brush_lines;
#[path = "../shared/json.rs"]
mod json;
mod lod;
mod obj;
mod others;
#[path = "../shared/output.rs"]
mod output;
mod play;
mod probes;
mod report;
mod script;
mod staging;
#[cfg(test)]
mod tests;

use std::fs::File;
use std::io::{self, Read, Write};
use std::num::ParseFloatError;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use bevy_burrow::ground::{GreyImage, Ground, GroundError, ImageLimits, ImageScale, Strata};
use bevy_burrow::terrain::{Terrain, TerrainError, TerrainSettings, World};
use bevy_burrow::volume::{DiggingRules, RulesError};
use clap::Parser;
use serde::Serialize;
use serde::de::DeserializeOwned;

use lod::Levels;
use report::{Report, milliseconds};
use staging::Staging;

/// Plays a script of edits over a heightmap and writes mesh.obj and report.json.
#[derive(Parser)]
struct Args {
    /// Grey PNG of 8 or 16 bits: columns run along +x, rows along +z, the first sample lies at (0, 0)
    #[arg(long, value_name = "FILE")]
    heights: PathBuf,
    /// Voxels from one sample to the next, 1 to 64; with 1 lattice heights are the samples
    #[arg(long, value_name = "N", default_value_t = 1)]
    voxels_per_sample: u32,
    /// Heights of grey 0 and of full grey, in voxels
    #[arg(long, num_args = 2, value_names = ["LO", "HI"], default_values_t = [0.0, 255.0])]
    #[arg(allow_negative_numbers = true)]
    height_range: Vec<f64>,
    /// Edits as JSON lines
    #[arg(long, value_name = "FILE")]
    edits: PathBuf,
    /// Strata of the ground: alpine, desert or mine, or a JSON file
    #[arg(long, value_name = "PRESET|FILE.json")]
    strata: Option<PathBuf>,
    /// Digging rules as a JSON file
    #[arg(long, value_name = "FILE.json")]
    rules: Option<PathBuf>,
    /// Lattice points as JSON lines, [x,y,z], to be answered in probes.json
    #[arg(long, value_name = "FILE")]
    probe: Option<PathBuf>,
    /// Cells along a chunk's side, 8 to 128
    #[arg(long, value_name = "N", default_value_t = 32)]
    chunk_size: u32,
    /// Export what would be drawn from here, in voxels, with levels of detail
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_negative_numbers = true, value_parser = finite)]
    eye: Vec<f32>,
    /// Pixels of the picture's height, for an angle of view of 45 degrees
    #[arg(long, value_name = "PIXELS", default_value_t = 1440, value_parser = clap::value_parser!(u32).range(1..=65536))]
    screen_height: u32,
    /// Export a random cut of the quadtree
    #[arg(long, value_name = "SEED", conflicts_with = "eye")]
    random_cut: Option<u64>,
    /// Edits in one transaction; the result is the same, only the timings differ
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    batch: u32,
    /// Also write mesh.glb
    #[arg(long)]
    glb: bool,
    /// Also write the materials of the surface, as splat_0.png and so on
    #[arg(long)]
    splats: bool,
    /// Also write the topmost ground, as elevation.png and so on
    #[arg(long, value_name = "FORMAT")]
    elevation: Option<others::Elevation>,
    /// Folder for mesh.obj and report.json; created if missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// A number that is finite.
fn finite(text: &str) -> Result<f32, String> {
    let number: f32 = text.parse().map_err(|error: ParseFloatError| error.to_string())?;
    if number.is_finite() { Ok(number) } else { Err("it must be finite".into()) }
}

/// Why there is no export.
#[derive(Debug, thiserror::Error)]
enum ExportError {
    #[error("{}: {reason}", path.display())]
    Read { path: PathBuf, reason: io::Error },
    #[error("{}: {reason}", path.display())]
    Ground { path: PathBuf, reason: GroundError },
    #[error("--height-range: {0} twice makes flat land: give the heights of black and of white")]
    HeightRange(f64),
    #[error("{} is neither a file nor one of the presets alpine, desert and mine", .0.display())]
    Strata(PathBuf),
    #[error(transparent)]
    Terrain(#[from] TerrainError),
    #[error(transparent)]
    Script(#[from] script::BadLines),
    #[error("{}: {reason}", path.display())]
    Json { path: PathBuf, reason: serde_json::Error },
    #[error("{}: {reason}", path.display())]
    Rules { path: PathBuf, reason: RulesError },
    #[error("{}: {reason}", path.display())]
    Write { path: PathBuf, reason: io::Error },
}

impl ExportError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Write { .. } => 1,
            _ => 2,
        }
    }
}

fn main() -> ExitCode {
    match export(&Args::parse()) {
        Ok(report) => {
            output::say(format_args!("{report}"));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// The whole command. All input is validated before the first byte is written.
fn export(args: &Args) -> Result<Report, ExportError> {
    let start = Instant::now();
    let edits = script::read(&args.edits)?;
    let settings = TerrainSettings { chunk_size: args.chunk_size, ..TerrainSettings::default() };
    let probes = args.probe.as_deref().map(probes::read).transpose()?;
    let mut terrain = Terrain::new(read_ground(args)?, &settings)?;
    if let Some(path) = &args.rules {
        let set = terrain.set_rules(read_json::<DiggingRules>(path)?);
        set.map_err(|reason| ExportError::Rules { path: path.clone(), reason })?;
    }
    let load_ms = milliseconds(start);

    let played = play::play(&mut terrain, &edits, args.batch as usize);
    let levels = Levels::new(args, terrain.world());
    let mut report = Report::new(terrain.world(), &played, levels.as_ref());
    report.timings.load_ms = load_ms;

    let probes = probes.map(|points| probes::answer(terrain.world().ground(), &points));
    write(args, terrain.world(), levels.as_ref(), &mut report, probes.as_deref())
        .map_err(|reason| ExportError::Write { path: args.out.clone(), reason })?;
    Ok(report)
}

fn write(
    args: &Args,
    world: &World,
    levels: Option<&Levels>,
    report: &mut Report,
    probes: Option<&[probes::Probe]>,
) -> io::Result<()> {
    let start = Instant::now();
    let mut staging = Staging::new(&args.out)?;
    report.bytes.mesh_obj = staging.write("mesh.obj", |out| match levels {
        Some(levels) => obj::write_levels(levels, out),
        None => obj::write(world, out),
    })?;
    others::write(args, world, &mut staging, report)?;
    report.timings.write_ms = milliseconds(start);
    staging.write("report.json", |out| write_json(out, report))?;
    if let Some(probes) = probes {
        staging.write("probes.json", |out| write_json(out, probes))?;
    }
    staging.publish()
}

fn write_json(out: &mut impl Write, content: &(impl Serialize + ?Sized)) -> io::Result<()> {
    serde_json::to_writer_pretty(&mut *out, content)?;
    out.write_all(b"\n")
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, ExportError> {
    let bytes =
        read_at_most(path, MAX_JSON).map_err(|reason| ExportError::Read { path: path.into(), reason })?;
    json::parse(&bytes).map_err(|reason| ExportError::Json { path: path.into(), reason })
}

/// Most bytes of a file with strata or rules.
const MAX_JSON: u64 = 1 << 24;

/// The preset of that name, or the strata in a file.
fn read_strata(name: &Path) -> Result<Strata, ExportError> {
    match name.to_str().and_then(Strata::preset) {
        Some(preset) => Ok(preset),
        None if !name.exists() => Err(ExportError::Strata(name.into())),
        None => read_json(name),
    }
}

fn read_ground(args: &Args) -> Result<Ground, ExportError> {
    let limits = ImageLimits::default();
    if args.height_range[0] == args.height_range[1] {
        return Err(ExportError::HeightRange(args.height_range[0]));
    }
    let bytes = read_at_most(&args.heights, limits.max_file_bytes + 1)
        .map_err(|reason| ExportError::Read { path: args.heights.clone(), reason })?;
    let scale = ImageScale {
        voxels_per_sample: args.voxels_per_sample,
        low: args.height_range[0],
        high: args.height_range[1],
        detail: None,
    };
    let ground = GreyImage::decode_png(&bytes, &limits)
        .map_err(GroundError::from)
        .and_then(|image| Ground::from_image(&image, &scale))
        .map_err(|reason| ExportError::Ground { path: args.heights.clone(), reason })?;
    let Some(name) = &args.strata else { return Ok(ground) };
    let with_strata = ground.with_strata(&read_strata(name)?);
    with_strata.map_err(|reason| ExportError::Ground { path: name.clone(), reason })
}

/// Reads at most `limit` bytes of a file, so that endless ones end too; the decoder then reports that it is too large.
fn read_at_most(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(limit).read_to_end(&mut bytes)?;
    Ok(bytes)
}
