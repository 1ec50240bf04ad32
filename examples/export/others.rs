//! Further files: the mesh as glTF, the surface's materials and heights as pictures.

use std::io::{self, Write};

use bevy_burrow::ground::MaterialId;
use bevy_burrow::terrain::World;
use clap::ValueEnum;
use glam::Vec3;

use crate::Args;
use crate::report::Report;
use crate::staging::Staging;

/// The format of the file with the topmost ground.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Elevation {
    /// 16 bits of grey, from the lowest to the highest ground.
    Png,
    /// Esri ASCII grid, exact.
    Asc,
    /// GeoTIFF's floats, exact.
    #[cfg(feature = "import")]
    Tif,
    /// OpenEXR's floats, exact.
    #[cfg(feature = "import")]
    Exr,
}

/// Splat maps hold at most 16 materials, four a file.
const SPLATS: [&str; 4] = ["splat_0.png", "splat_1.png", "splat_2.png", "splat_3.png"];

/// Colours of materials, linear: soil, grass, sand, rock and so on, round and round.
const COLOURS: [Vec3; 8] = [
    Vec3::new(0.21, 0.13, 0.07),
    Vec3::new(0.28, 0.27, 0.26),
    Vec3::new(0.12, 0.24, 0.06),
    Vec3::new(0.55, 0.43, 0.24),
    Vec3::new(0.80, 0.80, 0.84),
    Vec3::new(0.42, 0.20, 0.11),
    Vec3::new(0.09, 0.09, 0.10),
    Vec3::new(0.60, 0.45, 0.10),
];

/// Writes the files that were asked for.
pub fn write(args: &Args, world: &World, staging: &mut Staging, report: &mut Report) -> io::Result<()> {
    if args.glb {
        let colour = |MaterialId(id)| COLOURS[usize::from(id) % COLOURS.len()];
        let file = world.to_glb(None, 1.0, &colour).map_err(io::Error::other)?;
        staging.write("mesh.glb", |out| out.write_all(&file))?;
    }
    if args.splats {
        let maps = world.splat_maps().map_err(io::Error::other)?;
        for (name, file) in SPLATS.into_iter().zip(&maps.files) {
            staging.write(name, |out| out.write_all(file))?;
        }
        report.splat_layers = Some(maps.layers.iter().map(|MaterialId(id)| *id).collect());
    }
    let Some(format) = args.elevation else { return Ok(()) };
    let grid = world.elevation().map_err(io::Error::other)?;
    let (name, file) = match format {
        Elevation::Png => {
            let (file, range) = grid.encode_png().map_err(io::Error::other)?;
            report.elevation_range = Some(range);
            ("elevation.png", file)
        }
        Elevation::Asc => ("elevation.asc", grid.encode_ascii(1.0).into_bytes()),
        #[cfg(feature = "import")]
        Elevation::Tif => ("elevation.tif", grid.encode_tiff().map_err(io::Error::other)?),
        #[cfg(feature = "import")]
        Elevation::Exr => ("elevation.exr", grid.encode_exr().map_err(io::Error::other)?),
    };
    staging.write(name, |out| out.write_all(&file))
}
