//! Heights from TIFF and BigTIFF files of one channel, GeoTIFF's tags included.

use std::io::Cursor;

use ::tiff::ColorType;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::tags::Tag;

use super::decoded::{Decoded, damaged, reserve};
use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;
use crate::ground::ImageLimits;

const FORMAT: HeightFormat = HeightFormat::Tiff;

/// Decodes the first image of a TIFF.
pub(super) fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Decoded, ImportError> {
    let failed = |error: ::tiff::TiffError| damaged(FORMAT, error);
    let most = usize::try_from(limits.max_alloc_bytes).unwrap_or(usize::MAX);
    let mut decoder_limits = Limits::default();
    decoder_limits.decoding_buffer_size = most;
    decoder_limits.intermediate_buffer_size = most;
    decoder_limits.ifd_value_size = most.min(64 << 20);
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(failed)?.with_limits(decoder_limits);
    let (width, height) = decoder.dimensions().map_err(failed)?;
    let color = decoder.colortype().map_err(failed)?;
    let (channels, bits, alpha) = match color {
        ColorType::Gray(bits) => (1, bits, None),
        ColorType::GrayA(bits) => (2, bits, Some(1)),
        ColorType::RGB(bits) => (3, bits, None),
        ColorType::RGBA(bits) => (4, bits, Some(3)),
        ColorType::Multiband { bit_depth, num_samples: 1 } => (1, bit_depth, None),
        other => return Err(ImportError::Channels { format: FORMAT, found: format!("{other:?}") }),
    };
    limits.check_image(width, height, 4 + channels as u64 * u64::from(bits.div_ceil(8)))?;
    // A crafted header must not reserve memory for much more than its file could hold: no compression of heights is
    // better than this.
    let decoded_bytes = u64::from(width) * u64::from(height) * channels as u64 * u64::from(bits).div_ceil(8);
    if decoded_bytes / 4096 > bytes.len() as u64 {
        return Err(damaged(FORMAT, "it is too short for its size"));
    }
    let mut notes = Vec::new();
    if decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation).ok().flatten() == Some(0) {
        notes.push(ImportNote::WhiteIsZero);
    }
    let no_data = decoder.get_tag_ascii_string(Tag::GdalNodata).ok();
    let no_data = no_data.and_then(|text| text.trim_matches(['\0', ' ']).parse::<f64>().ok());
    let scale = decoder.get_tag_f64_vec(Tag::ModelPixelScaleTag).ok();
    let spacing = match scale.as_deref() {
        Some(&[x, z, ..]) if x > 0.0 && z > 0.0 && x.is_finite() && z.is_finite() => Some([x, z]),
        _ => None,
    };
    let tie = decoder.get_tag_f64_vec(Tag::ModelTiepointTag).ok();
    let origin = match (tie.as_deref(), spacing) {
        (Some(&[i, j, _, east, north, ..]), Some([x, z])) => Some([east - i * x, north + j * z]),
        _ => None,
    };
    let data = decoder.read_image().map_err(failed)?;
    if decoder.more_images() {
        notes.push(ImportNote::FirstOfSeveral);
    }
    let (sample, samples, is_rounded) = to_floats(data, channels, width)?;
    if samples.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(damaged(FORMAT, "it ends too early"));
    }
    if alpha.is_some() {
        notes.push(ImportNote::AlphaIgnored);
    }
    if channels > 2 {
        notes.push(ImportNote::GreyAsColour);
    }
    if is_rounded {
        notes.push(ImportNote::Rounded);
    }
    let decoded = Decoded::new(FORMAT, sample, (width, height), samples);
    Ok(Decoded { no_data, spacing, origin, notes, ..decoded })
}

/// The first of several interleaved channels as floats, and whether any was rounded; colours must be equal.
fn to_floats(
    data: DecodingResult,
    channels: usize,
    width: u32,
) -> Result<(SampleKind, Vec<f32>, bool), ImportError> {
    use SampleKind::{Float, Signed, Unsigned};
    let pixels = Pixels { channels, width };
    Ok(match data {
        DecodingResult::U8(values) => pixels.read(Unsigned(8), &values, f32::from, |_| false)?,
        DecodingResult::I8(values) => pixels.read(Signed(8), &values, f32::from, |_| false)?,
        DecodingResult::U16(values) => pixels.read(Unsigned(16), &values, f32::from, |_| false)?,
        DecodingResult::I16(values) => pixels.read(Signed(16), &values, f32::from, |_| false)?,
        DecodingResult::F16(values) => pixels.read(Float(16), &values, |value| value.to_f32(), |_| false)?,
        DecodingResult::F32(values) if channels == 1 => (Float(32), values, false),
        DecodingResult::F32(values) => pixels.read(Float(32), &values, |value| value, |_| false)?,
        DecodingResult::U32(values) => {
            let is_rounded = |value: u32| f64::from(value as f32) != f64::from(value);
            pixels.read(Unsigned(32), &values, |value| value as f32, is_rounded)?
        }
        DecodingResult::I32(values) => {
            let is_rounded = |value: i32| f64::from(value as f32) != f64::from(value);
            pixels.read(Signed(32), &values, |value| value as f32, is_rounded)?
        }
        DecodingResult::U64(values) => {
            let is_rounded = |value: u64| i128::from(value) != (value as f32) as i128;
            pixels.read(Unsigned(64), &values, |value| value as f32, is_rounded)?
        }
        DecodingResult::I64(values) => {
            let is_rounded = |value: i64| i128::from(value) != (value as f32) as i128;
            pixels.read(Signed(64), &values, |value| value as f32, is_rounded)?
        }
        DecodingResult::F64(values) => {
            let is_rounded = |value: f64| f64::from(value as f32) != value && !value.is_nan();
            pixels.read(Float(64), &values, |value| value as f32, is_rounded)?
        }
    })
}

/// How pixels lie in a decoded image.
#[derive(Clone, Copy)]
struct Pixels {
    channels: usize,
    width: u32,
}

impl Pixels {
    /// The first channel as floats.
    fn read<T: Copy + PartialEq>(
        self,
        kind: SampleKind,
        values: &[T],
        float: impl Fn(T) -> f32,
        is_rounded: impl Fn(T) -> bool,
    ) -> Result<(SampleKind, Vec<f32>, bool), ImportError> {
        let mut samples = reserve((values.len() / self.channels) as u64)?;
        let mut has_rounded = false;
        for (index, pixel) in values.chunks_exact(self.channels).enumerate() {
            if self.channels > 2 && (pixel[1] != pixel[0] || pixel[2] != pixel[0]) {
                let (x, z) = (index as u64 % u64::from(self.width), index as u64 / u64::from(self.width));
                return Err(ImportError::Colour { format: FORMAT, x: x as u32, z: z as u32 });
            }
            samples.push(float(pixel[0]));
            has_rounded |= is_rounded(pixel[0]);
        }
        Ok((kind, samples, has_rounded))
    }
}
