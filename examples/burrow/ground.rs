//! The ground below a saved world, as the options name it.

use std::fs;
use std::path::PathBuf;

use bevy_burrow::format::Level;
use bevy_burrow::ground::{GreyImage, Ground, GroundError, ImageLimits, ImageScale, Strata};
use bevy_burrow::store::{BaseChanged, BaseLevel};
use clap::{Args, ValueEnum};

use crate::json;
use crate::noise_ground::noise_ground;

/// The ground that the world was saved with. A world holds only what differs from it.
#[derive(Args, Debug, Clone)]
pub struct GroundArgs {
    /// Grey PNG of 8 or 16 bits: columns run along +x, rows along +z, the first sample lies at (0, 0)
    #[arg(long, value_name = "FILE", global = true)]
    heights: Option<PathBuf>,
    /// Voxels from one sample to the next, 1 to 64
    #[arg(long, value_name = "N", default_value_t = 1, global = true)]
    voxels_per_sample: u32,
    /// Heights of grey 0 and of full grey, in voxels
    #[arg(long, num_args = 2, value_names = ["LO", "HI"], default_values_t = [0.0, 255.0], global = true)]
    #[arg(allow_negative_numbers = true)]
    height_range: Vec<f64>,
    /// Strata of the ground: alpine, desert or mine, or a JSON file
    #[arg(long, value_name = "PRESET|FILE.json", global = true)]
    strata: Option<PathBuf>,
    /// The hills of the example `server`, with this many cells along each side
    #[arg(long, value_name = "N", conflicts_with = "heights", global = true)]
    side: Option<u32>,
    /// The level that the world was created from: its folder, or the packed file
    #[arg(long, value_name = "PATH", global = true)]
    level: Option<PathBuf>,
    /// What `repair`, `compact` and `import` do if the ground or the level is not the one that the world was saved
    /// with: refuse it, or move the world onto it for good, with edited ground as it is or with all edits made again
    #[arg(long, value_name = "WHAT", value_enum, default_value_t = OtherBase::Refuse, global = true)]
    other_base: OtherBase,
}

/// What to do with another ground or level than the one that the world was saved with.
#[derive(ValueEnum, Clone, Copy, Debug)]
enum OtherBase {
    Refuse,
    Keep,
    Replay,
}

impl GroundArgs {
    /// What to do if the ground is another one.
    pub fn base_changed(&self) -> BaseChanged {
        match self.other_base {
            OtherBase::Refuse => BaseChanged::Refuse,
            OtherBase::Keep => BaseChanged::Keep,
            OtherBase::Replay => BaseChanged::Replay,
        }
    }

    /// Builds the ground; `None` if no option names any.
    pub fn build(&self) -> Result<Option<Ground>, String> {
        let ground = match (&self.heights, self.side) {
            (Some(path), _) => {
                let at = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
                if self.height_range[0] == self.height_range[1] {
                    let heights = "give the heights of black and of white, which differ";
                    return Err(format!("--height-range: {heights}"));
                }
                let bytes = fs::read(path).map_err(|error| at(&error))?;
                let scale = ImageScale {
                    voxels_per_sample: self.voxels_per_sample,
                    low: self.height_range[0],
                    high: self.height_range[1],
                    detail: None,
                };
                let image = GreyImage::decode_png(&bytes, &ImageLimits::default()).map_err(GroundError::from);
                image.and_then(|image| Ground::from_image(&image, &scale)).map_err(|error| at(&error))?
            }
            (None, Some(side)) => noise_ground(side).map_err(|error| error.to_string())?,
            (None, None) => return Ok(None),
        };
        let Some(name) = &self.strata else { return Ok(Some(ground)) };
        let at = |error: &dyn std::fmt::Display| format!("{}: {error}", name.display());
        let strata = match name.to_str().and_then(Strata::preset) {
            Some(preset) => preset,
            None => {
                let bytes = fs::read(name).map_err(|error| at(&error))?;
                json::parse(&bytes).map_err(|error| at(&error))?
            }
        };
        ground.with_strata(&strata).map(Some).map_err(|error| at(&error))
    }

    /// Builds the ground.
    pub fn required(&self) -> Result<Ground, String> {
        self.build()?.ok_or_else(|| {
            "this needs the ground that the world was saved with: give --heights or --side".into()
        })
    }

    /// Reads the level, if there is one.
    pub fn level(&self, ground: &Ground) -> Result<Option<BaseLevel>, String> {
        let Some(path) = &self.level else { return Ok(None) };
        let at = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let level = Level::load(path, ground).map_err(|error| at(&error))?;
        Ok(Some(BaseLevel::new(level, path.display().to_string())))
    }
}
