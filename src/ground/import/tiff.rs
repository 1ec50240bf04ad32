//! Heights from TIFF and BigTIFF files of one channel.

use std::io::{Read, Seek};

use ::tiff::ColorType;
use ::tiff::decoder::{Decoder, DecodingResult, Limits};
use ::tiff::tags::{ExtraSamples, PlanarConfiguration, Tag};

use super::decoded::{Decoded, damaged, reserve};
use super::error::ImportError;
use super::geotiff::Georeference;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;
use super::white_is_zero::BlackIsZero;
use crate::ground::ImageLimits;

const FORMAT: HeightFormat = HeightFormat::Tiff;

/// Decodes the first image of a TIFF of `length` bytes.
pub(super) fn decode(
    file: impl Read + Seek,
    length: u64,
    limits: &ImageLimits,
) -> Result<Decoded, ImportError> {
    let failed = |error: ::tiff::TiffError| damaged(FORMAT, error);
    let most = usize::try_from(limits.max_alloc_bytes).unwrap_or(usize::MAX);
    let mut decoder_limits = Limits::default();
    decoder_limits.decoding_buffer_size = most;
    decoder_limits.intermediate_buffer_size = most;
    decoder_limits.ifd_value_size = most.min(64 << 20);
    let file = BlackIsZero::new(file).map_err(|error| damaged(FORMAT, error))?;
    let is_white_zero = file.is_white_zero();
    let mut decoder = Decoder::new(file).map_err(failed)?.with_limits(decoder_limits);
    let (width, height) = decoder.dimensions().map_err(failed)?;
    let color = decoder.colortype().map_err(failed)?;
    let (channels, bits, has_alpha) = match color {
        ColorType::Gray(bits) | ColorType::Multiband { bit_depth: bits, num_samples: 1 } => (1, bits, false),
        ColorType::GrayA(bits) => (2, bits, true),
        ColorType::Multiband { bit_depth: bits, num_samples: 2 } if is_second_alpha(&mut decoder) => {
            (2, bits, true)
        }
        ColorType::RGB(bits) => (3, bits, false),
        ColorType::RGBA(bits) => (4, bits, true),
        other => return Err(ImportError::Channels { format: FORMAT, found: format!("{other:?}") }),
    };
    limits.check_image(width, height, 4 + channels as u64 * u64::from(bits.div_ceil(8)))?;
    // A crafted header must not reserve memory for much more than its file could hold: no compression of heights is
    // better than this.
    let decoded_bytes = u64::from(width) * u64::from(height) * channels as u64 * u64::from(bits).div_ceil(8);
    if decoded_bytes / 4096 > length {
        return Err(damaged(FORMAT, "it is too short for its size"));
    }
    let mut notes = Vec::new();
    if is_white_zero {
        notes.push(ImportNote::WhiteIsZero);
    }
    if let Ok(Some(orientation @ 2..=8)) = decoder.find_tag_unsigned::<u16>(Tag::Orientation) {
        notes.push(ImportNote::OrientationIgnored { orientation });
    }
    let Georeference { no_data, spacing, origin, value_scale, note } = Georeference::read(&mut decoder);
    notes.extend(note);
    let planes = decoder.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(failed)?;
    let is_planar = channels > 1 && planes == Some(PlanarConfiguration::Planar.to_u16());
    let mut data = DecodingResult::U8(Vec::new());
    decoder.read_image_to_buffer(&mut data).map_err(failed)?;
    if decoder.more_images() {
        notes.push(ImportNote::FirstOfSeveral);
    }
    let (sample, samples, is_rounded) = to_floats(data, bits, Pixels { width, height, channels, is_planar })?;
    if has_alpha {
        notes.push(ImportNote::AlphaIgnored);
    }
    if channels > 2 {
        notes.push(ImportNote::GreyAsColour);
    }
    if is_rounded {
        notes.push(ImportNote::Rounded);
    }
    let decoded = Decoded::new(FORMAT, sample, (width, height), samples);
    Ok(Decoded { no_data, spacing, origin, value_scale, notes, ..decoded })
}

/// Whether the second of two channels is an alpha channel. The decoder does not distinguish it from other channels.
fn is_second_alpha<R: Read + Seek>(decoder: &mut Decoder<R>) -> bool {
    const ALPHA: [u16; 2] =
        [ExtraSamples::AssociatedAlpha.to_u16(), ExtraSamples::UnassociatedAlpha.to_u16()];
    let extra = decoder.find_tag_unsigned_vec::<u16>(Tag::ExtraSamples).ok().flatten();
    matches!(extra.as_deref(), Some([extra]) if ALPHA.contains(extra))
}

/// The first of several channels as floats, and whether any sample was rounded; colours must be equal.
fn to_floats(
    data: DecodingResult,
    bits: u8,
    pixels: Pixels,
) -> Result<(SampleKind, Vec<f32>, bool), ImportError> {
    use SampleKind::{Float, Signed, Unsigned};
    Ok(match data {
        DecodingResult::U8(packed) if bits < 8 => {
            pixels.read(Unsigned(bits), &pixels.unpack(&packed, bits)?, f32::from, |_| false)?
        }
        DecodingResult::I8(_) if bits < 8 => {
            return Err(damaged(FORMAT, format!("it has signed samples of {bits} bits")));
        }
        DecodingResult::U8(values) => pixels.read(Unsigned(8), &values, f32::from, |_| false)?,
        DecodingResult::I8(values) => pixels.read(Signed(8), &values, f32::from, |_| false)?,
        DecodingResult::U16(values) => pixels.read(Unsigned(16), &values, f32::from, |_| false)?,
        DecodingResult::I16(values) => pixels.read(Signed(16), &values, f32::from, |_| false)?,
        DecodingResult::F16(values) => pixels.read(Float(16), &values, |value| value.to_f32(), |_| false)?,
        DecodingResult::F32(values) if pixels.channels == 1 && values.len() == pixels.count() => {
            (Float(32), values, false)
        }
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
    width: u32,
    height: u32,
    channels: usize,
    /// Whether all samples of a channel are followed by those of the next one; otherwise the channels of a pixel lie side
    /// by side.
    is_planar: bool,
}

impl Pixels {
    /// Samples of a channel.
    fn count(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Samples of less than 8 bits, of which each row begins with a new byte.
    fn unpack(self, packed: &[u8], bits: u8) -> Result<Vec<u8>, ImportError> {
        let row = self.width as usize * if self.is_planar { 1 } else { self.channels };
        let bits = usize::from(bits);
        let mut samples = Vec::new();
        let bytes = self.count() * self.channels;
        let refused = |_| ImportError::Memory { bytes: bytes as u64 };
        samples.try_reserve_exact(bytes).map_err(refused)?;
        for packed in packed.chunks_exact((row * bits).div_ceil(8)) {
            let bit = |at: usize| packed[at / 8] >> (7 - at % 8) & 1;
            let sample = |index: usize| (0..bits).fold(0, |sample, at| sample << 1 | bit(index * bits + at));
            samples.extend((0..row).map(sample));
        }
        Ok(samples)
    }

    /// The first channel as floats.
    fn read<T: Copy + PartialEq>(
        self,
        kind: SampleKind,
        values: &[T],
        float: impl Fn(T) -> f32,
        is_rounded: impl Fn(T) -> bool,
    ) -> Result<(SampleKind, Vec<f32>, bool), ImportError> {
        let count = self.count();
        if values.len() != count * self.channels {
            return Err(damaged(FORMAT, "it ends too early"));
        }
        let (pixel, channel) = if self.is_planar { (1, count) } else { (self.channels, 1) };
        let mut samples = reserve(count as u64)?;
        let mut has_rounded = false;
        for index in 0..count {
            let value = |of: usize| values[index * pixel + of * channel];
            if self.channels > 2 && (value(1) != value(0) || value(2) != value(0)) {
                let (x, z) = (index as u64 % u64::from(self.width), index as u64 / u64::from(self.width));
                return Err(ImportError::Colour { format: FORMAT, x: x as u32, z: z as u32 });
            }
            samples.push(float(value(0)));
            has_rounded |= is_rounded(value(0));
        }
        Ok((kind, samples, has_rounded))
    }
}
