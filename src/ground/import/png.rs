//! Heights from PNG files: every colour type that can mean grey.

use std::io::Cursor;

use ::png::{ColorType, Decoder, Limits, Transformations};

use super::decoded::{Decoded, damaged, reserve};
use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;
use crate::ground::ImageLimits;

const FORMAT: HeightFormat = HeightFormat::Png;

/// The grey of one row's pixels.
struct Rows {
    color: ColorType,
    bits: u8,
    /// Grey of the palette's entries; `None` for those that are not grey.
    palette: Vec<Option<u8>>,
}

/// Decodes a PNG. Gamma and colour profiles are ignored: samples are heights, not light.
pub(super) fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Decoded, ImportError> {
    let most = usize::try_from(limits.max_alloc_bytes).unwrap_or(usize::MAX);
    let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: most });
    decoder.set_transformations(Transformations::IDENTITY);
    let header = decoder.read_header_info().map_err(|error| damaged(FORMAT, error))?;
    limits.check_image(header.width, header.height, 4)?;
    let mut reader = decoder.read_info().map_err(|error| damaged(FORMAT, error))?;
    let info = reader.info();
    let (width, height, is_interlaced) = (info.width, info.height, info.interlaced);
    let is_animated = info.animation_control.is_some_and(|control| control.num_frames > 1);
    let rows =
        Rows { color: info.color_type, bits: info.bit_depth as u8, palette: greys(info.palette.as_deref()) };
    let has_alpha = info.trns.is_some() || matches!(rows.color, ColorType::GrayscaleAlpha | ColorType::Rgba);
    let pixel_bits = u64::from(rows.bits) * rows.channels() as u64;
    if is_interlaced {
        // The whole image is put together before it is read.
        limits.check_image(width, height, 4 + pixel_bits.div_ceil(8))?;
    }
    let mut samples = reserve(u64::from(width) * u64::from(height))?;
    if is_interlaced {
        let size = reader.output_buffer_size().ok_or_else(|| damaged(FORMAT, "it is too large"))?;
        let mut image = Vec::new();
        image.try_reserve_exact(size).map_err(|error| damaged(FORMAT, error))?;
        image.resize(size, 0);
        let line = reader.next_frame(&mut image).map_err(|error| damaged(FORMAT, error))?.line_size;
        for (z, row) in image.chunks(line.max(1)).take(height as usize).enumerate() {
            rows.push(row, width, z as u32, &mut samples)?;
        }
    } else {
        for z in 0..height {
            let row = reader.next_row().map_err(|error| damaged(FORMAT, error))?;
            let row = row.ok_or_else(|| damaged(FORMAT, format!("it ends after {z} of {height} rows")))?;
            rows.push(row.data(), width, z, &mut samples)?;
        }
    }
    // The chunks after the samples show whether the file is whole.
    reader.finish().map_err(|error| damaged(FORMAT, error))?;
    if samples.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(damaged(FORMAT, "it ends too early"));
    }
    let bits = if rows.color == ColorType::Indexed { 8 } else { rows.bits };
    let mut decoded = Decoded::new(FORMAT, SampleKind::Unsigned(bits), (width, height), samples);
    if has_alpha {
        decoded.notes.push(ImportNote::AlphaIgnored);
    }
    if matches!(rows.color, ColorType::Indexed | ColorType::Rgb | ColorType::Rgba) {
        decoded.notes.push(ImportNote::GreyAsColour);
    }
    if is_animated {
        decoded.notes.push(ImportNote::FirstOfSeveral);
    }
    Ok(decoded)
}

/// The grey of a palette's entries.
fn greys(palette: Option<&[u8]>) -> Vec<Option<u8>> {
    let (entries, _) = palette.unwrap_or_default().as_chunks::<3>();
    entries.iter().map(|&[r, g, b]| (r == g && g == b).then_some(r)).collect()
}

impl Rows {
    /// Samples of a pixel.
    fn channels(&self) -> usize {
        match self.color {
            ColorType::Grayscale | ColorType::Indexed => 1,
            ColorType::GrayscaleAlpha => 2,
            ColorType::Rgb => 3,
            ColorType::Rgba => 4,
        }
    }

    /// Appends the grey of a row's pixels.
    fn push(&self, row: &[u8], width: u32, z: u32, samples: &mut Vec<f32>) -> Result<(), ImportError> {
        let (channels, width) = (self.channels(), width as usize);
        if row.len() < (width * channels * usize::from(self.bits)).div_ceil(8) {
            return Err(damaged(FORMAT, "a row is too short"));
        }
        let value = |index: usize| match self.bits {
            16 => u16::from_be_bytes([row[index * 2], row[index * 2 + 1]]),
            8 => row[index].into(),
            bits => {
                let (bits, at) = (usize::from(bits), index * usize::from(bits));
                u16::from(row[at / 8] >> (8 - bits - at % 8)) & ((1 << bits) - 1)
            }
        };
        let has_colours = channels >= 3;
        for x in 0..width {
            let first = value(x * channels);
            let grey = match self.color {
                ColorType::Indexed => match self.palette.get(usize::from(first)) {
                    Some(grey) => grey.map(u16::from),
                    None => return Err(damaged(FORMAT, "a pixel lies outside of the palette")),
                },
                _ if has_colours => {
                    let is_grey = value(x * channels + 1) == first && value(x * channels + 2) == first;
                    is_grey.then_some(first)
                }
                _ => Some(first),
            };
            let grey = grey.ok_or(ImportError::Colour { format: FORMAT, x: x as u32, z })?;
            samples.push(grey.into());
        }
        Ok(())
    }
}
