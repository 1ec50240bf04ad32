//! The report of an import: format, range, voids and outliers, guesses and doubts.

use std::fmt;

use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::onto_ground::{ElevationScale, HeightScale};
use crate::ground::MAX_VOXELS_PER_SAMPLE;

/// What was read from a file. [`Display`](fmt::Display) gives it as text, a line for each note.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ImportReport {
    /// The format of the file.
    pub format: HeightFormat,
    /// The type of its samples.
    pub sample: SampleKind,
    /// Samples in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The least and greatest value, after repairs.
    pub range: [f32; 2],
    /// Samples without a value, before repairs.
    pub voids: u64,
    /// Samples far from all around them, before repairs.
    pub outliers: u64,
    /// Distance between samples along x and z, where the file says it, in its own unit (metres or degrees).
    pub spacing: Option<[f64; 2]>,
    /// Place of the middle of the first sample of the top row, where the file says it: east and north, in its own unit.
    pub origin: Option<[f64; 2]>,
    /// The scale and the offset that GDAL gives a file's values: heights are `value * scale + offset`. Samples are as the
    /// file has them; [`Self::scale`] applies both.
    pub value_scale: Option<[f64; 2]>,
    /// What was guessed, ignored or looks wrong.
    pub notes: Vec<ImportNote>,
}

/// Something that was guessed, ignored or looks wrong.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ImportNote {
    /// An alpha channel was ignored.
    AlphaIgnored,
    /// Colours or a palette hold grey alone, and were read as such.
    GreyAsColour,
    /// Only the first image of several was read.
    FirstOfSeveral,
    /// Other channels than that of the heights were ignored.
    ChannelsIgnored {
        /// Their names.
        names: String,
        /// The name of the channel that was read.
        read: String,
    },
    /// Black and white are exchanged in this file (`WhiteIsZero`): values are as they are stored, so that white is 0.
    WhiteIsZero,
    /// A file says that its picture is to be turned or mirrored for display: rows are as they are stored.
    OrientationIgnored {
        /// TIFF's number of the orientation, 2 to 8.
        orientation: u16,
    },
    /// Rows do not run east, or not from north to south: the ground lies turned or mirrored on its map.
    NotNorthUp,
    /// A file says where it lies in a way that is not read, such as by control points.
    PlaceIgnored,
    /// Values were rounded to `f32`, which has 24 bits.
    Rounded,
    /// The size of a RAW file was guessed.
    SizeGuessed,
    /// The type of a RAW file's samples was guessed.
    SampleGuessed,
    /// The byte order of a RAW file was guessed.
    ByteOrderGuessed {
        /// Whether the high byte comes first.
        is_big_endian: bool,
    },
    /// With the bytes of each sample exchanged the ground would be much smoother.
    LooksByteSwapped,
    /// With another number of samples in a row the ground would be much smoother.
    LooksTransposed {
        /// The number of samples in a row that fits better.
        width: u32,
    },
    /// A value far outside of all others was taken for the value of voids.
    NoDataGuessed {
        /// The value.
        value: f32,
        /// Samples with this value.
        count: u64,
    },
    /// A value far outside of all others may be the value of voids; it was kept.
    LooksLikeNoData {
        /// The value.
        value: f32,
        /// Samples with this value.
        count: u64,
    },
    /// Samples far from all around them were found.
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
    /// All samples have the same value.
    Level,
    /// Tiles share their edges, or do not; this was guessed from their samples.
    EdgesGuessed {
        /// Whether the last column of a tile is the first one of the next.
        are_shared: bool,
    },
    /// Tiles that should share their edges differ there; the tile to the left, or above, was used.
    EdgesDiffer {
        /// Samples that differ.
        count: u64,
        /// The largest difference.
        largest: f32,
    },
}

impl fmt::Display for ImportNote {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AlphaIgnored => f.write_str("the alpha channel was ignored"),
            Self::GreyAsColour => f.write_str("the file holds grey as colours; plain grey would be smaller"),
            Self::FirstOfSeveral => f.write_str("the file holds several images, of which the first was read"),
            Self::ChannelsIgnored { names, read } => {
                write!(f, "the heights are the channel {read}; the channels {names} were ignored")
            }
            Self::WhiteIsZero => {
                f.write_str("the file stores white as 0; exchange low and high if it looks upside down")
            }
            Self::OrientationIgnored { orientation } => write!(
                f,
                "rows were read as they are stored, not turned or mirrored by the orientation {orientation} of the file"
            ),
            Self::NotNorthUp => f.write_str(
                "rows do not run east, or not from north to south: the ground lies turned or mirrored on its map",
            ),
            Self::PlaceIgnored => f.write_str(
                "the distance between samples and their place were not read, as the file has no plain ones: set the scale",
            ),
            Self::Rounded => f.write_str("values were rounded to 24 bits"),
            Self::SizeGuessed => f.write_str("the size was guessed; set `RawLayout::size` if it is wrong"),
            Self::SampleGuessed => {
                f.write_str("the sample type was guessed; set `RawLayout::sample` if it is wrong")
            }
            Self::ByteOrderGuessed { is_big_endian } => {
                let order = if *is_big_endian { "high byte first" } else { "low byte first" };
                write!(f, "the byte order was guessed: {order}; set `RawLayout::byte_order` if it is wrong")
            }
            Self::LooksByteSwapped => f.write_str(
                "neighbours differ wildly, and less with the bytes exchanged: use the other byte order",
            ),
            Self::LooksTransposed { width } => {
                write!(
                    f,
                    "rows do not fit each other; with {width} samples in a row they would: correct the size"
                )
            }
            Self::NoDataGuessed { value, count } => {
                write!(f, "{count} samples of {value}, far outside of all others, were taken for voids")
            }
            Self::LooksLikeNoData { value, count } => write!(
                f,
                "{count} samples of {value} lie far outside of all others: if they are voids, set \
                 `ImportOptions::no_data`"
            ),
            Self::Outliers { count, x, z, value } => write!(
                f,
                "{count} samples lie far from all around them, first ({x}, {z}) with {value}: \
                 `ImportOptions::outliers` can repair them"
            ),
            Self::Level => f.write_str("all samples have the same value"),
            Self::EdgesGuessed { are_shared: true } => {
                f.write_str("tiles share their edges, by their samples")
            }
            Self::EdgesGuessed { are_shared: false } => f.write_str("tiles share no edges, by their samples"),
            Self::EdgesDiffer { count, largest } => {
                write!(f, "{count} samples differ between tiles that share an edge, by up to {largest}")
            }
        }
    }
}

impl ImportReport {
    /// The scale of a file in metres for voxels of `voxel_size` metres: samples as far apart as the file says, heights
    /// in metres. Where the file says nothing, its samples are a voxel apart.
    ///
    /// # Errors
    /// [`ImportError::Spacing`] if the samples are not 1 to 64 whole voxels apart, as those of files in degrees are
    /// not.
    pub fn scale(&self, voxel_size: f64) -> Result<ElevationScale, ImportError> {
        let [factor, offset] = self.value_scale.unwrap_or([1.0, 0.0]);
        let heights = HeightScale::Units { voxels_per_unit: factor / voxel_size, base: offset / voxel_size };
        let [x, z] = self.spacing.unwrap_or([voxel_size; 2]);
        let voxels = (x / voxel_size).round();
        let fits = |spacing: f64| (spacing / voxel_size - voxels).abs() <= voxels / 100.0;
        let is_possible = (1.0..=f64::from(MAX_VOXELS_PER_SAMPLE)).contains(&voxels);
        if !is_possible || voxel_size <= 0.0 || !fits(x) || !fits(z) {
            return Err(ImportError::Spacing { spacing: if fits(x) { z } else { x }, voxel_size });
        }
        Ok(ElevationScale { voxels_per_sample: voxels as u32, heights, detail: None })
    }
}

impl fmt::Display for ImportReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { format, sample, width, height, range: [low, high], voids, outliers, .. } = self;
        write!(f, "{format}, {width} x {height} samples, {sample}, {low} to {high}")?;
        write!(f, "; {voids} voids, {outliers} outliers")?;
        if let Some([x, z]) = self.spacing {
            write!(f, "; samples are {x} x {z} apart")?;
        }
        if let Some([factor, offset]) = self.value_scale {
            write!(f, "; heights are value * {factor} + {offset}")?;
        }
        self.notes.iter().try_for_each(|note| write!(f, "\n- {note}"))
    }
}
