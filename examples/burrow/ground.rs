//! The ground below a saved world, as the options name it.

use std::fs;
use std::path::PathBuf;

use bevy_burrow::ground::{GreyImage, Ground, GroundError, ImageLimits, ImageScale, Strata};
use clap::Args;

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
    /// The hills of the example `server`, of so many cells along each side
    #[arg(long, value_name = "N", conflicts_with = "heights", global = true)]
    side: Option<u32>,
}

impl GroundArgs {
    /// Builds the ground; `None` if no option names any.
    pub fn build(&self) -> Result<Option<Ground>, String> {
        let ground = match (&self.heights, self.side) {
            (Some(path), _) => {
                let at = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
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
                let text = fs::read_to_string(name).map_err(|error| at(&error))?;
                serde_json::from_str(&text).map_err(|error| at(&error))?
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
}
