//! Reading grey images from PNG files, which the `image` crate decodes.

use std::io::{Cursor, ErrorKind};

use image::codecs::png::PngDecoder;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, Limits};

use super::error::ImageError;
use super::grey_image::{GreyImage, ImageLimits};

impl GreyImage {
    /// Decodes a PNG of plain grey with 8 or 16 bits a sample. Gamma and colour profiles are ignored: samples are
    /// heights, not light.
    ///
    /// # Errors
    /// - [`ImageError::Truncated`], [`ImageError::Decode`] for a damaged file, or one that is no PNG.
    /// - [`ImageError::ColorType`] for colour, palettes, alpha or fewer than 8 bits.
    /// - [`ImageError::Empty`] for an image without samples.
    /// - [`ImageError::FileSize`], [`ImageError::Dimensions`], [`ImageError::Memory`] for one over the limits, before
    ///   memory is allocated for its samples.
    pub fn decode_png(bytes: &[u8], limits: &ImageLimits) -> Result<Self, ImageError> {
        limits.check_file(bytes)?;
        let (width, height, bits) = declared(bytes).unwrap_or((1, 1, 8));
        // The finished samples take 2 bytes each; those of 8 bits are held as they were while they are widened.
        limits.check_image(width, height, if bits == 8 { 3 } else { 2 })?;
        let mut decoder_limits = Limits::no_limits();
        decoder_limits.max_alloc = Some(limits.max_alloc_bytes);
        let failed = |error| decode_error(error, bytes.len() as u64);
        let decoder = PngDecoder::with_limits(Cursor::new(bytes), decoder_limits).map_err(failed)?;
        match decoder.color_type() {
            // The decoder widens fewer bits to 8.
            ColorType::L8 if bits < 8 => return Err(ImageError::ColorType { found: format!("L{bits}") }),
            ColorType::L8 | ColorType::L16 => (),
            // A transparent shade of grey becomes an alpha channel.
            other => return Err(ImageError::ColorType { found: format!("{other:?}") }),
        }
        let samples = match DynamicImage::from_decoder(decoder).map_err(failed)? {
            DynamicImage::ImageLuma8(grey) => {
                grey.into_raw().into_iter().map(|v| u16::from(v) * 257).collect()
            }
            other => other.into_luma16().into_raw(),
        };
        Self::from_samples(width, height, samples)
    }
}

/// Width, height and bits per channel that a PNG declares in its header; `None` where there is none, which the decoder
/// then reports. They are read here because the decoder reserves memory for them at once.
fn declared(bytes: &[u8]) -> Option<(u32, u32, u8)> {
    let is_png = image::guess_format(bytes).is_ok_and(|format| format == ImageFormat::Png);
    let (&width, rest) = bytes.get(16..).filter(|_| is_png)?.split_first_chunk()?;
    let (&height, rest) = rest.split_first_chunk()?;
    Some((u32::from_be_bytes(width), u32::from_be_bytes(height), *rest.first()?))
}

/// Our own error for the decoder's.
fn decode_error(error: image::ImageError, bytes: u64) -> ImageError {
    match error {
        image::ImageError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => {
            ImageError::Truncated { bytes }
        }
        error => ImageError::Decode { reason: error.to_string() },
    }
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

    /// First bytes of every PNG.
    const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

    /// A PNG that declares these dimensions, bits and colour type and has no samples.
    fn header(width: u32, height: u32, bits: u8, color_type: u8) -> Vec<u8> {
        let sizes = [width.to_be_bytes(), height.to_be_bytes()].concat();
        let header = chunk(b"IHDR", &[&sizes, &[bits, color_type, 0, 0, 0][..]].concat());
        [&SIGNATURE[..], &header, &chunk(b"IDAT", &[0])].concat()
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
            prop_assert!(bytes.starts_with(&SIGNATURE) || decode(&bytes).is_err());
            assert_whole(decode(&[&SIGNATURE, bytes.as_slice()].concat()), None);
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
                let file = [&SIGNATURE, &*header, &chunk(name, &extra[..length]), &samples].concat();
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
        // The last 16 bytes, a checksum and the end chunk, do not affect the samples.
        for length in 1..file.len() - 16 {
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
        let memory = ImageError::Memory { bytes: 4000 * 4000 * 3, limit: 1000 };
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
