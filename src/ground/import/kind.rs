//! Formats of files, and types of their samples.

use std::fmt;

/// The format of a file of heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum HeightFormat {
    /// PNG.
    Png,
    /// Samples without a header.
    Raw,
    /// TIFF and BigTIFF, GeoTIFF included.
    Tiff,
    /// OpenEXR.
    Exr,
    /// SRTM tiles, `.hgt`.
    Hgt,
    /// Esri ASCII grids, `.asc`.
    Ascii,
}

impl HeightFormat {
    /// The format of files that are recognised by their name alone, because they have no header: `.hgt`.
    pub(crate) fn of_name(name: &str) -> Option<Self> {
        name.to_ascii_lowercase().ends_with(".hgt").then_some(Self::Hgt)
    }
}

impl fmt::Display for HeightFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Png => "PNG",
            Self::Raw => "RAW",
            Self::Tiff => "TIFF",
            Self::Exr => "EXR",
            Self::Hgt => "HGT",
            Self::Ascii => "ASCII grid",
        })
    }
}

/// The type of a file's samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum SampleKind {
    /// Unsigned integers of this many bits.
    Unsigned(u8),
    /// Signed integers of this many bits.
    Signed(u8),
    /// Floating-point numbers of this many bits.
    Float(u8),
    /// Numbers written as text.
    Text,
}

impl SampleKind {
    /// The least and greatest value of an integer; `None` for all others.
    pub fn full_scale(self) -> Option<[f64; 2]> {
        match self {
            Self::Unsigned(bits) => Some([0.0, (u128::MAX >> (128 - u32::from(bits).clamp(1, 64))) as f64]),
            Self::Signed(bits) => {
                let half = 2_f64.powi(i32::from(bits.clamp(1, 64)) - 1);
                Some([-half, half - 1.0])
            }
            Self::Float(_) | Self::Text => None,
        }
    }
}

impl fmt::Display for SampleKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unsigned(bits) => write!(f, "unsigned integers of {bits} bits"),
            Self::Signed(bits) => write!(f, "signed integers of {bits} bits"),
            Self::Float(bits) => write!(f, "floats of {bits} bits"),
            Self::Text => f.write_str("numbers as text"),
        }
    }
}
