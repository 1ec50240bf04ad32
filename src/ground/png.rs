//! Decodes PNG files with the `png` crate: grey images, heights to import, and material maps.

use std::io::{Cursor, ErrorKind};

use ::png::{ColorType, Decoder, DecodingError, Limits, Reader, Transformations};

use super::error::ImageError;
use super::grey_image::{GreyImage, ImageLimits};

/// The first bytes of every PNG.
pub(super) const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A PNG whose samples are still to be read. They are read as the file has them: gamma and colour profiles are ignored.
pub(super) struct Png<'a> {
    reader: Reader<Cursor<&'a [u8]>>,
    /// Bytes of the file.
    bytes: u64,
    /// Samples in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    pub color: ColorType,
    /// Bits of a sample: 1, 2, 4, 8 or 16.
    pub bits: u8,
    pub palette: Vec<[u8; 3]>,
    /// Whether a colour or shade of it is transparent, or it has an alpha channel.
    pub has_alpha: bool,
    pub is_animated: bool,
}

impl<'a> Png<'a> {
    /// Reads everything before the samples. The caller keeps `bytes_per_pixel` bytes for each pixel.
    ///
    /// # Errors
    /// - [`ImageError::Truncated`], [`ImageError::Decode`] for a damaged file, one without samples, or one that is not
    ///   a PNG.
    /// - [`ImageError::Dimensions`], [`ImageError::Memory`] for one over the limits, before memory is allocated for it.
    pub fn open(bytes: &'a [u8], limits: &ImageLimits, bytes_per_pixel: u64) -> Result<Self, ImageError> {
        let failed = |error| failed(error, bytes.len() as u64);
        let max_alloc = usize::try_from(limits.max_alloc_bytes).unwrap_or(usize::MAX);
        let mut decoder = Decoder::new_with_limits(Cursor::new(bytes), Limits { bytes: max_alloc });
        decoder.set_transformations(Transformations::IDENTITY);
        let header = decoder.read_header_info().map_err(failed)?;
        let pixel_bits = header.color_type.samples() as u64 * header.bit_depth as u64;
        // The rows of an interlaced image are only known once all of it is decoded.
        let decoded = if header.interlaced { pixel_bits.div_ceil(8) } else { 0 };
        limits.check_image(header.width, header.height, bytes_per_pixel + decoded)?;
        let reader = decoder.read_info().map_err(failed)?;
        let info = reader.info();
        let (width, height, color, bits) = (info.width, info.height, info.color_type, info.bit_depth as u8);
        let palette = info.palette.as_deref().unwrap_or_default().as_chunks::<3>().0.to_vec();
        let has_alpha = info.trns.is_some() || matches!(color, ColorType::GrayscaleAlpha | ColorType::Rgba);
        let is_animated = info.animation_control.is_some_and(|control| control.num_frames > 1);
        let bytes = bytes.len() as u64;
        Ok(Self { reader, bytes, width, height, color, bits, palette, has_alpha, is_animated })
    }

    /// Calls `each` with the number and the samples of every row: all channels of a pixel, then those of the next one.
    ///
    /// # Errors
    /// - [`ImageError::Truncated`], [`ImageError::Decode`] for a damaged file.
    /// - The error of `each`.
    pub fn read<E: From<ImageError>>(
        mut self,
        mut each: impl FnMut(u32, &[u16]) -> Result<(), E>,
    ) -> Result<(), E> {
        let length = self.width as usize * self.color.samples();
        let row_bytes = (length * usize::from(self.bits)).div_ceil(8);
        let (bits, bytes) = (self.bits, self.bytes);
        let mut samples = Vec::with_capacity(length);
        let mut read = |z: u32, row: &[u8]| -> Result<(), E> {
            let row = row.get(..row_bytes).ok_or_else(|| decode_error("a row is too short"))?;
            samples.clear();
            match bits {
                16 => samples.extend(row.as_chunks::<2>().0.iter().map(|&pair| u16::from_be_bytes(pair))),
                8 => samples.extend(row.iter().map(|&sample| u16::from(sample))),
                _ => samples.extend((0..length).map(|index| {
                    let (bits, at) = (usize::from(bits), index * usize::from(bits));
                    u16::from(row[at / 8] >> (8 - bits - at % 8)) & ((1 << bits) - 1)
                })),
            }
            each(z, &samples)
        };
        if self.reader.info().interlaced {
            let size = self.reader.output_buffer_size().ok_or_else(|| decode_error("it is too large"))?;
            let mut image = Vec::new();
            image.try_reserve_exact(size).map_err(decode_error)?;
            image.resize(size, 0);
            let frame = self.reader.next_frame(&mut image).map_err(|error| failed(error, bytes))?;
            for z in 0..self.height {
                let start = z as usize * frame.line_size;
                read(z, image.get(start..start + frame.line_size).unwrap_or_default())?;
            }
        } else {
            for z in 0..self.height {
                let row = self.reader.next_row().map_err(|error| failed(error, bytes))?;
                let row = row.ok_or(ImageError::Truncated { bytes })?;
                read(z, row.data())?;
            }
        }
        // The chunks after the samples show whether the file is whole.
        Ok(self.reader.finish().map_err(|error| failed(error, bytes))?)
    }
}

impl GreyImage {
    /// Decodes a PNG of plain grey with 8 or 16 bits a sample. Gamma and colour profiles are ignored: samples are
    /// heights, not light.
    ///
    /// # Errors
    /// - [`ImageError::Truncated`], [`ImageError::Decode`] for a damaged file, or one that is not a PNG.
    /// - [`ImageError::ColorType`] for colour, palettes, alpha or fewer than 8 bits.
    /// - [`ImageError::Empty`] for an image without samples.
    /// - [`ImageError::FileSize`], [`ImageError::Dimensions`], [`ImageError::Memory`] for one over the limits, before
    ///   memory is allocated for its samples.
    pub fn decode_png(bytes: &[u8], limits: &ImageLimits) -> Result<Self, ImageError> {
        limits.check_file(bytes)?;
        if let Some(error) = empty(bytes) {
            return Err(error);
        }
        let png = Png::open(bytes, limits, 2)?;
        let (width, height, bits) = (png.width, png.height, png.bits);
        if png.color != ColorType::Grayscale || png.has_alpha || bits < 8 {
            let color = match png.color {
                ColorType::Grayscale if !png.has_alpha => "L",
                ColorType::Grayscale | ColorType::GrayscaleAlpha => "La",
                ColorType::Rgb => "Rgb",
                ColorType::Rgba => "Rgba",
                ColorType::Indexed => "Palette",
            };
            return Err(ImageError::ColorType { found: format!("{color}{bits}") });
        }
        let mut samples = Vec::new();
        samples.try_reserve_exact(width as usize * height as usize).map_err(decode_error)?;
        png.read(|_, row| {
            match bits {
                8 => samples.extend(row.iter().map(|sample| sample * 257)),
                _ => samples.extend_from_slice(row),
            }
            Ok::<_, ImageError>(())
        })?;
        Self::from_samples(width, height, samples)
    }
}

/// The error of an image whose header says that it has no samples, which the decoder takes for damage.
fn empty(bytes: &[u8]) -> Option<ImageError> {
    let (&width, rest) = bytes.get(16..).filter(|_| bytes.starts_with(SIGNATURE))?.split_first_chunk()?;
    let [width, height] = [&width, rest.first_chunk()?].map(|side| u32::from_be_bytes(*side));
    (width == 0 || height == 0).then_some(ImageError::Empty { width, height })
}

/// The decoder's error for a file with this many bytes.
fn failed(error: DecodingError, bytes: u64) -> ImageError {
    match error {
        DecodingError::IoError(error) if error.kind() == ErrorKind::UnexpectedEof => {
            ImageError::Truncated { bytes }
        }
        error => decode_error(error),
    }
}

fn decode_error(reason: impl ToString) -> ImageError {
    ImageError::Decode { reason: reason.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::ExtendedColorType::{self, L8, L16, La8, Rgb8, Rgba16};
    use image::ImageEncoder;
    use image::codecs::png::PngEncoder;
    use proptest::prelude::*;

    fn encode(data: &[u8], width: u32, height: u32, color: ExtendedColorType) -> Vec<u8> {
        let mut file = Vec::new();
        PngEncoder::new(&mut file).write_image(data, width, height, color).unwrap();
        file
    }

    /// A PNG of 5 x 4 samples of 16 bits, noisy enough not to be compressed to nothing.
    fn noisy_png() -> Vec<u8> {
        let samples: Vec<u8> =
            (0..20_u32).flat_map(|i| (i * i * 40_503).to_ne_bytes()[..2].to_vec()).collect();
        encode(&samples, 5, 4, L16)
    }

    fn decode(bytes: &[u8]) -> Result<GreyImage, ImageError> {
        GreyImage::decode_png(bytes, &ImageLimits::default())
    }

    /// A PNG that declares these dimensions, bits and colour type and has no samples.
    fn header(width: u32, height: u32, bits: u8, color_type: u8) -> Vec<u8> {
        let sizes = [width.to_be_bytes(), height.to_be_bytes()].concat();
        let header = chunk(b"IHDR", &[&sizes, &[bits, color_type, 0, 0, 0][..]].concat());
        [SIGNATURE, &header, &chunk(b"IDAT", &[0])].concat()
    }

    /// Where the compressed samples lie in [`noisy_png`]: after signature, header and a chunk's length and name.
    const IDAT: usize = 41;

    /// A chunk with the right length and checksum.
    fn chunk(name: &[u8; 4], data: &[u8]) -> Vec<u8> {
        let checked = [name, data].concat();
        let crc = checked.iter().fold(u32::MAX, |crc, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xEDB8_8320 * (crc & 1)))
        });
        [&(data.len() as u32).to_be_bytes(), &*checked, &(!crc).to_be_bytes()].concat()
    }

    /// Checks that a decoded image has all of its samples, and this size if it is given.
    fn assert_whole(decoded: Result<GreyImage, ImageError>, size: Option<(u32, u32)>) {
        let Ok(image) = decoded else { return };
        let found = (image.width(), image.height());
        assert_eq!(image.samples().len() as u64, u64::from(found.0) * u64::from(found.1));
        assert!(found.0 > 0 && found.1 > 0 && size.is_none_or(|size| size == found), "{found:?}");
    }

    type Damage = Vec<(prop::sample::Index, u8)>;

    fn damage() -> impl Strategy<Value = Damage> {
        prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6)
    }

    fn inflict(damage: &Damage, file: &mut [u8]) {
        for (place, byte) in damage {
            *place.get_mut(file) = *byte;
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_an_image_or_an_error(bytes: Vec<u8>) {
            prop_assert!(bytes.starts_with(SIGNATURE) || decode(&bytes).is_err());
            assert_whole(decode(&[SIGNATURE, bytes.as_slice()].concat()), None);
            assert_whole(decode(&[header(4, 4, 8, 0), bytes].concat()), Some((4, 4)));
        }

        #[test]
        fn a_damaged_png_is_an_image_or_an_error(damage in damage()) {
            let mut file = noisy_png();
            inflict(&damage, &mut file);
            assert_whole(decode(&file), None);
        }

        #[test]
        fn damage_under_a_right_checksum_is_an_image_or_an_error(
            width in 1..9_u8, height in 1..9_u8, sixteen: bool, interlaced: bool, extra: [u8; 26], damage in damage(),
        ) {
            let mut samples = noisy_png().split_off(IDAT);
            inflict(&damage, &mut samples);
            let bits = if sixteen { 16 } else { 8 };
            let header = [0, 0, 0, width, 0, 0, 0, height, bits, 0, 0, 0, u8::from(interlaced)];
            let (header, samples) = (chunk(b"IHDR", &header), chunk(b"IDAT", &samples));
            for (name, length) in [(b"tRNS", 2), (b"gAMA", 4), (b"acTL", 8), (b"fcTL", 26), (b"iCCP", 26)] {
                let (chunk, end) = (chunk(name, &extra[..length]), chunk(b"IEND", &[]));
                let file = [SIGNATURE, &*header, &chunk, &samples, &end].concat();
                assert_whole(decode(&file), Some((width.into(), height.into())));
            }
        }

        #[test]
        fn sixteen_bits_come_back(samples in prop::collection::vec(any::<u16>(), 6)) {
            let data: Vec<u8> = samples.iter().flat_map(|s| s.to_ne_bytes()).collect();
            let image = decode(&encode(&data, 2, 3, L16)).unwrap();
            prop_assert_eq!((image.width(), image.height()), (2, 3));
            prop_assert_eq!(image.samples(), samples);
        }
    }

    #[test]
    fn eight_bits_are_widened_to_full_scale() {
        let data: Vec<u8> = (0..=255).collect();
        let image = decode(&encode(&data, 16, 16, L8)).unwrap();
        for (v, &wide) in (0..).zip(image.samples()) {
            assert_eq!(u32::from(wide) * 255, v * 65_535);
        }
    }

    #[test]
    fn a_png_cut_off_anywhere_is_truncated() {
        let file = noisy_png();
        assert!(decode(&file).is_ok());
        for length in 0..file.len() {
            assert_eq!(decode(&file[..length]), Err(ImageError::Truncated { bytes: length as u64 }));
        }
    }

    #[test]
    fn other_files_are_no_png() {
        for file in ["GIF89a and more", "PNG, but as text", "\u{89}PNG with the wrong line ends"] {
            assert!(matches!(decode(file.as_bytes()), Err(ImageError::Decode { .. })), "{file}");
        }
        assert_eq!(decode(b""), Err(ImageError::Truncated { bytes: 0 }));
    }

    #[test]
    fn other_color_types_are_refused_by_name() {
        let refused = |file: &[u8], name: &str| {
            assert_eq!(decode(file), Err(ImageError::ColorType { found: name.into() }));
        };
        refused(&encode(&[0; 12], 2, 2, Rgb8), "Rgb8");
        refused(&encode(&[0; 8], 2, 2, La8), "La8");
        refused(&encode(&[0; 32], 2, 2, Rgba16), "Rgba16");
        refused(&header(2, 2, 1, 0), "L1");
        let file = noisy_png();
        let transparent_shade = [&file[..33], &chunk(b"tRNS", &[0, 0]), &file[33..]].concat();
        refused(&transparent_shade, "La16");
        assert!(matches!(decode(&header(2, 2, 8, 9)), Err(ImageError::Decode { .. })));
    }

    #[test]
    fn declared_dimensions_are_checked_before_decoding() {
        assert_eq!(decode(&header(0, 9, 8, 0)), Err(ImageError::Empty { width: 0, height: 9 }));
        let (max_width, max_height) = (16_385, 16_385);
        let huge = ImageError::Dimensions { width: 1 << 31, height: 5, max_width, max_height };
        assert_eq!(decode(&header(1 << 31, 5, 16, 0)), Err(huge));
        let limits = ImageLimits { max_alloc_bytes: 1000, ..ImageLimits::default() };
        let memory = ImageError::Memory { bytes: 4000 * 4000 * 2, limit: 1000 };
        assert_eq!(GreyImage::decode_png(&header(4000, 4000, 8, 0), &limits), Err(memory));
        let file = noisy_png();
        let limits = ImageLimits { max_file_bytes: 20, ..ImageLimits::default() };
        let size = ImageError::FileSize { bytes: file.len() as u64, limit: 20 };
        assert_eq!(GreyImage::decode_png(&file, &limits), Err(size));
    }

    #[test]
    fn unlimited_limits_still_refuse_what_no_world_can_use() {
        let limits = ImageLimits {
            max_file_bytes: u64::MAX,
            max_width: u32::MAX,
            max_height: u32::MAX,
            max_alloc_bytes: u64::MAX,
        };
        let refused = GreyImage::decode_png(&header(u32::MAX, u32::MAX, 16, 0), &limits);
        assert!(matches!(refused, Err(ImageError::Dimensions { max_width: 16_385, .. })));
        assert!(GreyImage::decode_png(&noisy_png(), &limits).is_ok());
    }
}
