//! Heights from PNG files: every colour type that can mean grey.

use ::png::ColorType;

use super::decoded::{Decoded, damaged, reserve};
use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;
use crate::ground::ImageLimits;
use crate::ground::png::Png;

const FORMAT: HeightFormat = HeightFormat::Png;

/// Decodes a PNG. Gamma and colour profiles are ignored: samples are heights, not light.
pub(super) fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Decoded, ImportError> {
    let png = Png::open(bytes, limits, 4)?;
    let (width, height, color) = (png.width, png.height, png.color);
    let mut samples = reserve(u64::from(width) * u64::from(height))?;
    let bits = if color == ColorType::Indexed { 8 } else { png.bits };
    let mut notes = Vec::new();
    if png.has_alpha {
        notes.push(ImportNote::AlphaIgnored);
    }
    if matches!(color, ColorType::Indexed | ColorType::Rgb | ColorType::Rgba) {
        notes.push(ImportNote::GreyAsColour);
    }
    if png.is_animated {
        notes.push(ImportNote::FirstOfSeveral);
    }
    // `None` for entries that are not grey.
    let grey = |&[r, g, b]: &[u8; 3]| (r == g && g == b).then_some(u16::from(r));
    let palette: Vec<Option<u16>> = png.palette.iter().map(grey).collect();
    png.read(|z, row| {
        for (x, pixel) in row.chunks_exact(color.samples()).enumerate() {
            let grey = match *pixel {
                [entry] if color == ColorType::Indexed => {
                    let grey = palette.get(usize::from(entry)).copied();
                    grey.ok_or_else(|| damaged(FORMAT, "a pixel lies outside of the palette"))?
                }
                [r, g, b, ..] => (r == g && g == b).then_some(r),
                [grey, ..] => Some(grey),
                [] => None,
            };
            let grey = grey.ok_or(ImportError::Colour { format: FORMAT, x: x as u32, z })?;
            samples.push(grey.into());
        }
        Ok::<_, ImportError>(())
    })?;
    Ok(Decoded { notes, ..Decoded::new(FORMAT, SampleKind::Unsigned(bits), (width, height), samples) })
}
