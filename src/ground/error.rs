//! Errors of grounds and images.

use std::borrow::Cow;

use thiserror::Error;

use super::{MAX_SIZE, MAX_SOURCE_SIZE};
use crate::lattice::LIMIT;

/// An error of making ground.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GroundError {
    /// The world would be empty or too large.
    #[error("a world of {width} x {depth} cells cannot be made: each side must be 1 to {MAX_SIZE} cells")]
    Size {
        /// Cells along x.
        width: u32,
        /// Cells along z.
        depth: u32,
    },
    /// A world with a source would be empty or too large.
    #[error(
        "a world of {width} x {depth} cells with a source cannot be made: each side must be 1 to {MAX_SOURCE_SIZE} cells"
    )]
    SourceSize {
        /// Cells along x.
        width: u32,
        /// Cells along z.
        depth: u32,
    },
    /// A height is not a number, or too far from zero for the lattice.
    #[error("the height at column ({x}, {z}) is {value} voxels: it must lie within -{LIMIT} to {LIMIT}")]
    Height {
        /// Column along x.
        x: i32,
        /// Column along z.
        z: i32,
        /// The height in voxels.
        value: f64,
    },
    /// A list of heights is too short or too long for its world.
    #[error("a world of {width} x {depth} cells has {expected} columns, but {actual} heights were given")]
    Count {
        /// Cells along x.
        width: u32,
        /// Cells along z.
        depth: u32,
        /// Columns of the world: (width + 1) (depth + 1).
        expected: usize,
        /// Heights given.
        actual: usize,
    },
    /// An image has too few samples to span a cell.
    #[error("an image of {width} x {height} samples spans no cell: ground needs at least 2 x 2")]
    ImageTooSmall {
        /// Samples in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// A parameter is out of its range.
    #[error("{name} is {value}: it must be {allowed}")]
    Parameter {
        /// The parameter's name; for a parameter of a material rule, with the rule's position in its list, from 0.
        name: Cow<'static, str>,
        /// The value given.
        value: f64,
        /// The allowed values.
        allowed: &'static str,
    },
    /// The machine has too little memory for the world.
    #[error("the machine cannot allocate {bytes} bytes of memory for the world")]
    Memory {
        /// Bytes asked for; `usize::MAX` where their number does not fit.
        bytes: usize,
    },
    /// The image could not be read.
    #[error(transparent)]
    Image(#[from] ImageError),
}

/// An error of reading a [`GreyImage`](super::GreyImage).
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file is larger than the limits allow.
    #[error("the image file has {bytes} bytes: the limit is {limit}")]
    FileSize {
        /// Bytes of the file.
        bytes: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The file ends too early.
    #[error("the PNG is truncated: it ends after {bytes} bytes")]
    Truncated {
        /// Bytes that are there.
        bytes: u64,
    },
    /// The image has no samples.
    #[error("the image has no samples: it is {width} x {height}")]
    Empty {
        /// Samples in a row.
        width: u32,
        /// Rows.
        height: u32,
    },
    /// The image has more columns or rows than the limits allow.
    #[error("the image is {width} x {height} samples: the limit is {max_width} x {max_height}")]
    Dimensions {
        /// Samples in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Samples allowed in a row.
        max_width: u32,
        /// Rows allowed.
        max_height: u32,
    },
    /// Decoding would take more memory than the limits allow.
    #[error("decoding the image takes {bytes} bytes of memory: the limit is {limit}")]
    Memory {
        /// Bytes that decoding would take.
        bytes: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The image is not plain grey of 8 or 16 bits.
    #[error("the image has the colour type {found}: heights need plain grey with 8 or 16 bits")]
    ColorType {
        /// The colour type found with its bits: `Rgb8`, `Palette8`, or `La16` for grey with alpha.
        found: String,
    },
    /// The data does not have as many bytes or samples as its dimensions say.
    #[error("an image of {width} x {height} samples takes {expected} {unit}, but {actual} were given")]
    Length {
        /// Samples in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// The unit that is counted: `"bytes"` or `"samples"`.
        unit: &'static str,
        /// How many the dimensions ask for.
        expected: u64,
        /// The number of bytes or samples that were given.
        actual: u64,
    },
    /// The file is not a PNG, is damaged, or uses something that the decoder does not know.
    #[error("the image cannot be decoded: {reason}")]
    Decode {
        /// The decoder's own words.
        reason: String,
    },
}
