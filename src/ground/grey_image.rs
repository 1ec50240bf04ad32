//! Grey images, the form in which artists and surveys deliver heights and masks.

use std::fmt;
use std::sync::OnceLock;

use super::MAX_SIZE;
use super::error::ImageError;

/// The maximum number of samples along one side of an image, whatever the limits say: one more than the largest world
/// has cells.
const MAX_SIDE: u32 = MAX_SIZE + 1;

/// Byte order of a headerless file of unsigned 16-bit samples, as terrain editors export it ("RAW16", `.r16`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum RawFormat {
    /// Low byte first, as on Windows.
    #[default]
    LittleEndian,
    /// High byte first.
    BigEndian,
}

/// Limits of an image's size, checked against the file's header before memory is allocated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ImageLimits {
    /// The maximum size in bytes of the file.
    pub max_file_bytes: u64,
    /// The maximum number of samples in a row; never more than 16385 are accepted.
    pub max_width: u32,
    /// The maximum number of rows; never more than 16385 are accepted.
    pub max_height: u32,
    /// The maximum number of bytes of memory that decoding may take, the finished image included.
    pub max_alloc_bytes: u64,
}

impl Default for ImageLimits {
    /// Files to 576 MiB, 16385 x 16385 samples, 1 GiB of memory: all that the largest world can use.
    fn default() -> Self {
        Self {
            max_file_bytes: 576 << 20,
            max_width: MAX_SIDE,
            max_height: MAX_SIDE,
            max_alloc_bytes: 1 << 30,
        }
    }
}

impl ImageLimits {
    /// Checks the size of a file.
    pub(super) fn check_file(&self, bytes: &[u8]) -> Result<(), ImageError> {
        let (bytes, limit) = (bytes.len() as u64, self.max_file_bytes);
        if bytes > limit { Err(ImageError::FileSize { bytes, limit }) } else { Ok(()) }
    }

    /// Checks that the sides of an image in memory are within what any world can use.
    pub(crate) fn check_sides(width: u32, height: u32) -> Result<(), ImageError> {
        Self { max_alloc_bytes: u64::MAX, ..Self::default() }.check_image(width, height, 1)
    }

    /// Checks the dimensions that a file declares, and the memory for them at `bytes_per_sample`.
    pub(super) fn check_image(
        &self,
        width: u32,
        height: u32,
        bytes_per_sample: u64,
    ) -> Result<(), ImageError> {
        let (max_width, max_height) = (self.max_width.min(MAX_SIDE), self.max_height.min(MAX_SIDE));
        if width == 0 || height == 0 {
            return Err(ImageError::Empty { width, height });
        }
        if width > max_width || height > max_height {
            return Err(ImageError::Dimensions { width, height, max_width, max_height });
        }
        let (bytes, limit) = (u64::from(width) * u64::from(height) * bytes_per_sample, self.max_alloc_bytes);
        if bytes > limit { Err(ImageError::Memory { bytes, limit }) } else { Ok(()) }
    }
}

/// A grey image: at least one sample, row by row from the top, each 0 (black) to 65535 (white).
///
/// Samples of 8 bits are widened by 257, so v becomes exactly v/255 of full scale.
#[derive(Clone)]
pub struct GreyImage {
    width: u32,
    height: u32,
    samples: Vec<u16>,
    /// A hash of its content, computed when it is first needed.
    #[cfg_attr(not(feature = "format"), allow(dead_code, reason = "for names of content"))]
    hash: OnceLock<u64>,
}

impl PartialEq for GreyImage {
    fn eq(&self, other: &Self) -> bool {
        (self.width, self.height) == (other.width, other.height) && self.samples == other.samples
    }
}

impl Eq for GreyImage {}

impl GreyImage {
    /// An image of `width` x `height` samples, row by row, each 0 to 65535.
    ///
    /// # Errors
    /// [`ImageError::Empty`], [`ImageError::Dimensions`] (a side over 16385) or [`ImageError::Length`] if there are
    /// not `width * height` samples.
    pub fn from_samples(width: u32, height: u32, samples: Vec<u16>) -> Result<Self, ImageError> {
        ImageLimits::check_sides(width, height)?;
        Self::from_long_samples(width, height, samples)
    }

    /// An image that may have twice as many rows as one of heights, as the largest grids of shapes need with materials.
    pub(crate) fn from_long_samples(width: u32, height: u32, samples: Vec<u16>) -> Result<Self, ImageError> {
        ImageLimits::check_sides(width, height.div_ceil(2))?;
        let (expected, actual) = (u64::from(width) * u64::from(height), samples.len() as u64);
        if actual != expected {
            return Err(ImageError::Length { width, height, unit: "samples", expected, actual });
        }
        Ok(Self { width, height, samples, hash: OnceLock::new() })
    }

    /// Reads headerless 16-bit samples, row by row from the top.
    ///
    /// # Errors
    /// [`ImageError::FileSize`], [`ImageError::Empty`], [`ImageError::Dimensions`], [`ImageError::Memory`], or
    /// [`ImageError::Length`] if there are not `width * height * 2` bytes.
    pub fn decode_raw(
        bytes: &[u8],
        width: u32,
        height: u32,
        format: &RawFormat,
        limits: &ImageLimits,
    ) -> Result<Self, ImageError> {
        limits.check_file(bytes)?;
        limits.check_image(width, height, 2)?;
        let (pairs, rest) = bytes.as_chunks::<2>();
        let (expected, actual) = (u64::from(width) * u64::from(height) * 2, bytes.len() as u64);
        if !rest.is_empty() || actual != expected {
            return Err(ImageError::Length { width, height, unit: "bytes", expected, actual });
        }
        let sample = match format {
            RawFormat::LittleEndian => u16::from_le_bytes,
            RawFormat::BigEndian => u16::from_be_bytes,
        };
        Self::from_samples(width, height, pairs.iter().map(|&pair| sample(pair)).collect())
    }

    /// An image of 2 x 2 black samples, which stands for one that is named.
    pub(crate) fn placeholder() -> Self {
        Self { width: 2, height: 2, samples: vec![0; 4], hash: OnceLock::new() }
    }

    /// Whether it equals the [placeholder](Self::placeholder).
    pub(crate) fn is_placeholder(&self) -> bool {
        (self.width, self.height) == (2, 2) && self.samples == [0; 4]
    }

    /// A hash of its content, which `hash` computes when it is first needed.
    #[cfg(feature = "format")]
    pub(crate) fn hash_with(&self, hash: impl FnOnce(&Self) -> u64) -> u64 {
        *self.hash.get_or_init(|| hash(self))
    }

    /// Samples in a row, at least 1.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows, at least 1.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// All samples, row by row from the top, 0 to 65535.
    pub fn samples(&self) -> &[u16] {
        &self.samples
    }

    /// The sample in column `x` of row `z`, 0 to 65535; beyond the border, the nearest one.
    pub fn grey(&self, x: u32, z: u32) -> u16 {
        let (x, z) = (x.min(self.width - 1), z.min(self.height - 1));
        self.samples[z as usize * self.width as usize + x as usize]
    }
}

impl fmt::Debug for GreyImage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GreyImage")
            .field("width", &self.width)
            .field("height", &self.height)
            .finish_non_exhaustive()
    }
}

/// A position on a line of samples: a fraction of the way from one sample to the next.
#[derive(Clone, Copy)]
pub(super) struct LinePosition {
    pub sample: u32,
    /// 0 at the sample, 1 at the next.
    pub fraction: f64,
}

impl LinePosition {
    /// `parts` of which `parts_per_sample` lie from one sample to the next.
    pub fn new(parts: u32, parts_per_sample: u32) -> Self {
        let fraction = f64::from(parts % parts_per_sample) / f64::from(parts_per_sample);
        Self { sample: parts / parts_per_sample, fraction }
    }

    /// A position by a large number of parts, as long as the sample's number fits.
    pub fn of_long(parts: u64, parts_per_sample: u32) -> Self {
        let per_sample = u64::from(parts_per_sample);
        let fraction = f64::from((parts % per_sample) as u32) / f64::from(parts_per_sample);
        Self { sample: (parts / per_sample) as u32, fraction }
    }

    /// The nearest sample; in the middle between two, the later one.
    pub fn nearest(self) -> u32 {
        self.sample + u32::from(self.fraction >= 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn decode(bytes: &[u8], width: u32, height: u32) -> Result<GreyImage, ImageError> {
        GreyImage::decode_raw(bytes, width, height, &RawFormat::LittleEndian, &ImageLimits::default())
    }

    proptest! {
        #[test]
        fn raw_samples_come_back(samples in prop::collection::vec(any::<u16>(), 6)) {
            for format in [RawFormat::LittleEndian, RawFormat::BigEndian] {
                let bytes: Vec<u8> = samples.iter().flat_map(|s| match format {
                    RawFormat::LittleEndian => s.to_le_bytes(),
                    RawFormat::BigEndian => s.to_be_bytes(),
                }).collect();
                let image = GreyImage::decode_raw(&bytes, 3, 2, &format, &ImageLimits::default()).unwrap();
                prop_assert_eq!(image.samples(), &samples);
                prop_assert_eq!((image.grey(2, 0), image.grey(0, 1)), (samples[2], samples[3]));
                prop_assert_eq!(image.grey(u32::MAX, u32::MAX), samples[5]);
            }
        }

        #[test]
        fn raw_of_any_bytes_and_size_is_an_image_or_an_error(
            bytes: Vec<u8>, width: u32, height: u32, small in (0..9_u32, 0..9_u32),
        ) {
            let _ = decode(&bytes, width, height);
            let whole = bytes.len() == (small.0 * small.1 * 2) as usize && small.0 * small.1 > 0;
            prop_assert_eq!(decode(&bytes, small.0, small.1).is_ok(), whole);
        }
    }

    #[test]
    fn raw_errors_name_the_numbers() {
        let length = |actual| ImageError::Length { width: 2, height: 2, unit: "bytes", expected: 8, actual };
        assert_eq!(decode(&[0; 7], 2, 2), Err(length(7)));
        assert_eq!(decode(&[0; 10], 2, 2), Err(length(10)));
        assert_eq!(decode(&[], 0, 2), Err(ImageError::Empty { width: 0, height: 2 }));
        let message = decode(&[0; 7], 2, 2).unwrap_err().to_string();
        assert_eq!(message, "an image of 2 x 2 samples takes 8 bytes, but 7 were given");
        assert!(matches!(decode(&[], u32::MAX, u32::MAX), Err(ImageError::Dimensions { .. })));
    }

    #[test]
    fn limits_are_kept() {
        let decode = |limits| GreyImage::decode_raw(&[0; 8], 2, 2, &RawFormat::default(), &limits);
        let limits = ImageLimits { max_file_bytes: 8, max_width: 2, max_height: 2, max_alloc_bytes: 8 };
        assert!(decode(limits).is_ok());
        let file = ImageError::FileSize { bytes: 8, limit: 7 };
        assert_eq!(decode(ImageLimits { max_file_bytes: 7, ..limits }), Err(file));
        let dimensions = ImageError::Dimensions { width: 2, height: 2, max_width: 1, max_height: 2 };
        assert_eq!(decode(ImageLimits { max_width: 1, ..limits }), Err(dimensions));
        let memory = ImageError::Memory { bytes: 8, limit: 7 };
        assert_eq!(decode(ImageLimits { max_alloc_bytes: 7, ..limits }), Err(memory));
    }

    #[test]
    fn limits_let_in_what_the_largest_world_can_use() {
        let (limits, samples) = (ImageLimits::default(), u64::from(MAX_SIDE).pow(2));
        assert!(samples * 2 <= limits.max_file_bytes);
        assert_eq!(limits.check_image(MAX_SIDE, MAX_SIDE, 2), Ok(()));
    }

    #[test]
    fn samples_must_be_as_many_as_the_dimensions_say() {
        assert!(GreyImage::from_samples(2, 3, vec![0; 6]).is_ok());
        assert!(matches!(GreyImage::from_samples(2, 3, vec![0; 5]), Err(ImageError::Length { .. })));
        assert!(matches!(GreyImage::from_samples(0, 0, vec![]), Err(ImageError::Empty { .. })));
    }
}
