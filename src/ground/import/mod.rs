//! Heights from files: what terrain tools, surveys and satellites deliver, read exactly, with a report.
//!
//! | format | what is read |
//! | --- | --- |
//! | PNG | grey of 1 to 16 bits, interlaced or not; palettes and colours that are grey; alpha is ignored |
//! | RAW | 16 and 32 bits, signed or not, and 32-bit floats, in either byte order; see [`RawLayout`] |
//! | TIFF, BigTIFF (feature `import`) | one channel of 1, 2, 4 or 8 to 64 bits, integers or floats; alpha is ignored; GeoTIFF's spacing and place, GDAL's void value, scale and offset |
//! | OpenEXR (feature `import`) | one channel of 16 or 32 bits, or one of several that is named `height` or `Z` |
//! | SRTM `.hgt` | signed 16 bits, high byte first, void value -32768, one degree |
//! | Esri ASCII grid | any numbers, with its cell size, place and void value |
//!
//! [`ElevationGrid::open`] takes at most three times the memory of the finished grid, which has 4 bytes a sample, if
//! the file has one channel. [`ElevationGrid::decode`] takes as much, besides the bytes that it is given.
//!
//! An [`ElevationGrid`] holds the values as the file has them, in whatever unit that is. [`ElevationGrid::into_ground`]
//! makes ground of it:
//!
//! ```no_run
//! # use bevy_burrow::ground::{ElevationGrid, ElevationScale, ImportOptions};
//! let (grid, report) = ElevationGrid::open("island.tif", &ImportOptions::default())?;
//! println!("{report}");
//! let ground = grid.into_ground(&ElevationScale::default())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A [`MaterialMap`] holds materials: of splat maps, whose channels are weights, and of id maps.
//!
//! **Voids** are samples without a value: NaN, infinity, the value that the file or [`ImportOptions`] declares, and
//! well-known ones such as -9999 that lie far outside of all others. **Outliers** are single samples far above or below
//! all that surrounds them. [`Repair`] chooses how each of them is repaired. The report counts both.

mod ascii;
mod decoded;
mod doubts;
mod error;
#[cfg(feature = "import")]
mod exr;
#[cfg(feature = "import")]
mod geotiff;
mod grid;
mod join;
mod kind;
mod materials;
mod onto_ground;
mod open;
mod options;
mod png;
mod raw;
mod repair;
mod report;
mod roughness;
#[cfg(feature = "import")]
mod tiff;
#[cfg(feature = "import")]
mod white_is_zero;
mod write;

pub use super::material_map::MaterialMap;
pub use error::ImportError;
pub use grid::ElevationGrid;
pub use join::{ElevationTile, TileEdges};
pub use kind::{HeightFormat, SampleKind};
#[doc(hidden)]
pub use materials::MAX_LAYERS;
pub use materials::{IdOptions, MaterialNote, MaterialReport, SplatOptions};
pub use onto_ground::{ElevationScale, HeightScale};
pub use options::{ImportOptions, RawLayout, Repair};
pub use report::{ImportNote, ImportReport};
