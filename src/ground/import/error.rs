//! Errors of importing heights: what is wrong, and what to do about it.

use thiserror::Error;

use super::kind::HeightFormat;
use crate::ground::ImageError;

/// An error of importing heights. Each message is one sentence with a remedy.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// The file cannot be read from the disk.
    #[error("{path} cannot be read: {reason}")]
    File {
        /// The path.
        path: String,
        /// The system's own words.
        reason: String,
    },
    /// The file is in a format that holds no heights, or that is not read.
    #[error("this is {found}, which is not read: export the heights as PNG or RAW of 16 bits, TIFF or EXR")]
    Format {
        /// The format found, with its article.
        found: &'static str,
    },
    /// The format needs a feature of this crate that is switched off.
    #[error("{format} files are read with the feature `import` of bevy_burrow: switch it on in Cargo.toml")]
    Feature {
        /// The format.
        format: HeightFormat,
    },
    /// The file is larger than the limits allow, or empty.
    #[error("{0}: raise `ImportOptions::limits`, or cut the file into tiles")]
    Limit(ImageError),
    /// The machine has too little memory for the samples.
    #[error(
        "the machine cannot allocate {bytes} bytes for the samples: cut the file into tiles, or make it coarser"
    )]
    Memory {
        /// Bytes asked for.
        bytes: u64,
    },
    /// The file has no samples.
    #[error("the file has no samples: it is empty, or was not written to its end; export it again")]
    Empty,
    /// The file is damaged, ends too early, or uses something that the decoder does not know.
    #[error("the {format} file cannot be decoded ({reason}): export it again, without unusual compression")]
    Damaged {
        /// The format.
        format: HeightFormat,
        /// The decoder's own words.
        reason: String,
    },
    /// The file has colours, from which no heights can be derived.
    #[error("the {format} file has colours, first at sample ({x}, {z}): export the heights as plain grey")]
    Colour {
        /// The format.
        format: HeightFormat,
        /// Column of the first sample that is not grey.
        x: u32,
        /// Row of that sample.
        z: u32,
    },
    /// The file has channels of which none is known to hold heights.
    #[error("the {format} file has the channels {found}: export the heights alone, as one channel")]
    Channels {
        /// The format.
        format: HeightFormat,
        /// The channels found.
        found: String,
    },
    /// The size of a RAW file cannot be guessed from its length.
    #[error(
        "no size and sample type fit a RAW file of {bytes} bytes: set `RawLayout::size`, `sample` and `header` as the \
         exporting program shows them"
    )]
    RawSize {
        /// Bytes of the file after its header.
        bytes: u64,
    },
    /// A RAW file's length is not what its layout asks for.
    #[error(
        "a RAW file of {width} x {height} samples of {bytes_per_sample} bytes has {expected} bytes, but this one has \
         {actual}: correct `RawLayout::size`, `sample` or `header`"
    )]
    RawLength {
        /// Samples in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes of a sample.
        bytes_per_sample: u32,
        /// Bytes that the layout asks for.
        expected: u64,
        /// Bytes that are there.
        actual: u64,
    },
    /// An SRTM file has an unusual length.
    #[error(
        "an HGT file of {bytes} bytes is neither square nor 1801 x 3601 samples of 2 bytes: download it again, or \
         unpack it"
    )]
    HgtLength {
        /// Bytes of the file.
        bytes: u64,
    },
    /// A text is not an Esri ASCII grid.
    #[error("line {line} of the ASCII grid {problem}: export it again as an Esri ASCII grid (.asc)")]
    Ascii {
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with the line.
        problem: String,
    },
    /// Heights cannot be written in a format.
    #[error("heights cannot be written as {format} ({reason}): choose another format, or fewer samples")]
    Encode {
        /// The format.
        format: HeightFormat,
        /// The encoder's own words.
        reason: String,
    },
    /// No sample has a value.
    #[error(
        "none of the {samples} samples has a value: look at the void value and the valid range of `ImportOptions`"
    )]
    AllVoid {
        /// Samples of the file.
        samples: u64,
    },
    /// There are voids, which were to be refused.
    #[error(
        "{count} samples have no value, first ({x}, {z}): fill them, or set `ImportOptions::voids` to `Fill`"
    )]
    Voids {
        /// Number of voids.
        count: u64,
        /// Column of the first one.
        x: u32,
        /// Row of the first one.
        z: u32,
    },
    /// There are outliers, which were to be refused.
    #[error(
        "{count} samples lie far from all around them, first ({x}, {z}) with {value}: correct them, or set \
         `ImportOptions::outliers` to `Fill`"
    )]
    Outliers {
        /// Number of outliers.
        count: u64,
        /// Column of the first one.
        x: u32,
        /// Row of the first one.
        z: u32,
        /// Value of the first one.
        value: f32,
    },
    /// A material map is not a PNG file.
    #[error("this is not a PNG file: export splat maps and id maps as PNG, without loss")]
    MapFormat,
    /// A splat map has a palette.
    #[error(
        "the splat map has a palette, whose entries are not weights: export it with colours, or read it as an id map"
    )]
    MapPalette,
    /// Splat maps have several sizes.
    #[error(
        "splat map {file} is {width} x {height}, but the first is {} x {}: export all of them at one size",
        first.0, first.1
    )]
    MapSize {
        /// The file's place in the list.
        file: usize,
        /// Samples in a row of the file.
        width: u32,
        /// Rows of the file.
        height: u32,
        /// The size of the first one.
        first: (u32, u32),
    },
    /// Layers and channels of splat maps do not fit.
    #[error(
        "{named} channels are named and {layers} of them have a layer, but the splat maps have {channels} channels, and \
         1 to {most} layers are possible: name a material or `None` for each channel"
    )]
    Layers {
        /// Channels that `SplatOptions::layers` names.
        named: usize,
        /// Named channels that have a material.
        layers: usize,
        /// Channels of all files.
        channels: usize,
        /// The maximum number of layers.
        most: usize,
    },
    /// A sample of an id map has no material.
    #[error("{found} at sample ({x}, {z}) has no material: name one in `IdOptions`, or correct the map")]
    UnknownId {
        /// The id or the colour.
        found: String,
        /// Column of the sample.
        x: u32,
        /// Row of the sample.
        z: u32,
    },
    /// A surface has more materials than splat maps have channels.
    #[error(
        "the surface has {found} materials, but splat maps hold {most}: export fewer materials, or an id map"
    )]
    TooManyMaterials {
        /// Materials of the surface.
        found: usize,
        /// The maximum number of layers.
        most: usize,
    },
    /// The distance between samples is not a whole number of voxels.
    #[error(
        "samples that are {spacing} apart do not fit voxels of {voxel_size}: choose a voxel size that goes into the \
         distance 1 to 64 times, and project files in degrees to metres first"
    )]
    Spacing {
        /// Distance between samples in the unit of the file.
        spacing: f64,
        /// The side of a voxel in the same unit.
        voxel_size: f64,
    },
    /// An option is out of its range.
    #[error("the option {name} is {value}: it must be {allowed}")]
    Option {
        /// The option's name.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The allowed values.
        allowed: &'static str,
    },
    /// Tiles do not make a rectangle.
    #[error(
        "the tile at column {column}, row {row} {problem}: tiles must fill a rectangle, each once, rows and columns alike"
    )]
    Tile {
        /// Column of the tile.
        column: i32,
        /// Row of the tile.
        row: i32,
        /// What is wrong with the tile.
        problem: String,
    },
}

impl From<ImageError> for ImportError {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::Empty { .. } => Self::Empty,
            // Only PNG files are decoded with such errors.
            ImageError::Decode { reason } => Self::Damaged { format: HeightFormat::Png, reason },
            ImageError::Truncated { bytes } => {
                Self::Damaged { format: HeightFormat::Png, reason: format!("it ends after {bytes} bytes") }
            }
            error => Self::Limit(error),
        }
    }
}
