//! Options of an import: how heights are read where a file does not say, and how voids are repaired.

use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use crate::ground::{ImageLimits, RawFormat};

/// How a file of heights is read.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImportOptions {
    /// The file's format; `None` detects it by the first bytes.
    pub format: Option<HeightFormat>,
    /// The layout of a RAW file.
    pub raw: RawLayout,
    /// The value of a sample without a value, in addition to the one that the file declares.
    pub no_data: Option<f32>,
    /// The least and greatest value: samples outside are voids.
    pub valid: Option<[f32; 2]>,
    /// How voids are repaired. With [`Repair::Clamp`] they get the lowest value of the file.
    pub voids: Repair,
    /// How outliers are repaired. With [`Repair::Clamp`] they are moved to the highest or lowest of the 8 samples
    /// around them.
    ///
    /// [`Repair::Keep`] unless set: a lone tower is an outlier, too.
    pub outliers: Repair,
    /// How far an outlier lies from the median of the 8 samples around it, in the file's unit, more than 0. `None`:
    /// 64 times the median difference between neighbours, and at least 1/64 of the file's range.
    pub outlier_distance: Option<f32>,
    /// Limits on the size of a file and on memory: by default 2 GiB on disk and 4 GiB of memory, enough for 16385 x
    /// 16385 floats.
    /// Files of more than 16385 samples along a side are refused in any case.
    pub limits: ImageLimits,
}

impl Default for ImportOptions {
    /// Everything by the file itself; voids are filled, outliers are kept and reported.
    fn default() -> Self {
        Self {
            format: None,
            raw: RawLayout::default(),
            no_data: None,
            valid: None,
            voids: Repair::Fill,
            outliers: Repair::Keep,
            outlier_distance: None,
            limits: ImageLimits {
                max_file_bytes: 2 << 30,
                max_alloc_bytes: 4 << 30,
                ..ImageLimits::default()
            },
        }
    }
}

impl ImportOptions {
    /// Checks what no file is needed for.
    pub(super) fn check(&self) -> Result<(), ImportError> {
        let refuse =
            |name, value: f32, allowed| Err(ImportError::Option { name, value: f64::from(value), allowed });
        if let Some(distance) = self.outlier_distance
            && !(distance > 0.0 && distance.is_finite())
        {
            return refuse("outlier_distance", distance, "finite and more than 0");
        }
        match self.valid {
            Some([low, high]) if low.is_nan() || high.is_nan() || low > high => {
                refuse("valid", low, "a pair of numbers, the lower one first")
            }
            _ => Ok(()),
        }
    }
}

/// How samples that are voids or outliers are repaired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Repair {
    /// Such samples are kept and reported; voids stay NaN, from which no ground can be made.
    Keep,
    /// Such samples are interpolated from what surrounds them.
    #[default]
    Fill,
    /// Such samples are moved to the nearest plausible value.
    Clamp,
    /// The file is refused, with the place of the first one.
    Refuse,
}

/// The layout of a RAW file, which has no header. Options that are `None` are guessed from the file's length and
/// samples, and the report says so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RawLayout {
    /// Samples in a row, and rows.
    pub size: Option<(u32, u32)>,
    /// The type of samples: integers of 16 or 32 bits, or floats of 32.
    pub sample: Option<SampleKind>,
    /// The order of a sample's bytes.
    pub byte_order: Option<RawFormat>,
    /// Bytes at the file's beginning that are skipped.
    pub header: u64,
    /// Whether the first row is the bottom one.
    pub is_bottom_up: bool,
}
