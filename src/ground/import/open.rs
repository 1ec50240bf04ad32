//! Reading a file: its format, its samples, what is wrong with them.

use std::fs;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;

use super::decoded::Decoded;
use super::doubts::doubts;
use super::error::ImportError;
use super::grid::{ElevationGrid, range};
use super::kind::{HeightFormat, SampleKind};
use super::options::ImportOptions;
use super::repair::repair;
use super::report::ImportReport;
use super::{ascii, png, raw};
use crate::ground::{ImageError, ImageLimits};

/// Bytes of a file's beginning by which its format is detected.
const HEAD: usize = 4096;

/// A file that cannot be read from the disk.
fn failed(path: &Path, error: &io::Error) -> ImportError {
    ImportError::File { path: path.display().to_string(), reason: error.to_string() }
}

/// Checks that a file is not larger than the limits allow. Returns its length.
fn check_length(path: &Path, limits: &ImageLimits) -> Result<u64, ImportError> {
    let (bytes, limit) =
        (fs::metadata(path).map_err(|error| failed(path, &error))?.len(), limits.max_file_bytes);
    if bytes > limit { Err(ImageError::FileSize { bytes, limit }.into()) } else { Ok(bytes) }
}

/// The bytes of a file, if it is not larger than the limits allow.
pub(super) fn read_file(path: &Path, limits: &ImageLimits) -> Result<Vec<u8>, ImportError> {
    check_length(path, limits)?;
    fs::read(path).map_err(|error| failed(path, &error))
}

impl ElevationGrid {
    /// Reads a file. Its name matters only for `.hgt`, which has no header.
    ///
    /// # Errors
    /// [`ImportError`]; nothing is read from a file larger than the limits allow.
    pub fn open(
        path: impl AsRef<Path>,
        options: &ImportOptions,
    ) -> Result<(Self, ImportReport), ImportError> {
        let path = path.as_ref();
        let length = check_length(path, &options.limits)?;
        let failed = |error| failed(path, &error);
        let mut file = fs::File::open(path).map_err(failed)?;
        let mut head = Vec::new();
        (&mut file).take(HEAD as u64).read_to_end(&mut head).map_err(failed)?;
        if head.is_empty() {
            return Err(ImportError::Empty);
        }
        let format = match options.format.or_else(|| HeightFormat::of_name(&path.to_string_lossy())) {
            Some(format) => format,
            None => format_of(&head)?,
        };
        file.rewind().map_err(failed)?;
        // Files of these formats may have many more bytes than samples: they are decoded while they are read.
        let decoded = match format {
            HeightFormat::Ascii => {
                options.check()?;
                ascii::decode(BufReader::new(file), length, &options.limits)?
            }
            #[cfg(feature = "import")]
            HeightFormat::Tiff => {
                options.check()?;
                super::tiff::decode(BufReader::new(file), length, &options.limits)?
            }
            _ => {
                drop(file);
                let bytes = read_file(path, &options.limits)?;
                return Self::decode(&bytes, &ImportOptions { format: Some(format), ..options.clone() });
            }
        };
        Self::checked(decoded, options)
    }

    /// Decodes the bytes of a file.
    ///
    /// # Errors
    /// [`ImportError`]
    pub fn decode(bytes: &[u8], options: &ImportOptions) -> Result<(Self, ImportReport), ImportError> {
        options.check()?;
        options.limits.check_file(bytes)?;
        if bytes.is_empty() {
            return Err(ImportError::Empty);
        }
        let format = match options.format {
            Some(format) => format,
            None => format_of(bytes)?,
        };
        let length = bytes.len() as u64;
        let decoded = match format {
            HeightFormat::Png => png::decode(bytes, &options.limits),
            HeightFormat::Raw => raw::decode(bytes, &options.raw, &options.limits),
            HeightFormat::Hgt => decode_hgt(bytes, options),
            HeightFormat::Ascii => ascii::decode(bytes, length, &options.limits),
            #[cfg(feature = "import")]
            HeightFormat::Tiff => super::tiff::decode(io::Cursor::new(bytes), length, &options.limits),
            #[cfg(feature = "import")]
            HeightFormat::Exr => super::exr::decode(bytes, &options.limits),
            #[cfg(not(feature = "import"))]
            HeightFormat::Tiff | HeightFormat::Exr => Err(ImportError::Feature { format }),
        }?;
        Self::checked(decoded, options)
    }

    /// The grid of a decoded file after repairs, and its report.
    fn checked(mut decoded: Decoded, options: &ImportOptions) -> Result<(Self, ImportReport), ImportError> {
        let doubts = doubts(&decoded);
        decoded.notes.extend(doubts);
        let repaired = repair(&mut decoded, options)?;
        let Decoded { format, sample, width, height, samples, spacing, origin, value_scale, notes, .. } =
            decoded;
        let report = ImportReport {
            format,
            sample,
            width,
            height,
            range: range(&samples).unwrap_or_default(),
            voids: repaired.voids,
            outliers: repaired.outliers,
            spacing,
            origin,
            value_scale,
            notes,
        };
        Ok((Self::with_kind(sample, width, height, samples)?, report))
    }
}

/// The format of a file, detected by its first bytes; RAW if they match no other format.
fn format_of(bytes: &[u8]) -> Result<HeightFormat, ImportError> {
    const HEIGHTS: [(&[u8], HeightFormat); 6] = [
        (b"\x89PNG", HeightFormat::Png),
        (b"II*\0", HeightFormat::Tiff),
        (b"MM\0*", HeightFormat::Tiff),
        (b"II+\0", HeightFormat::Tiff),
        (b"MM\0+", HeightFormat::Tiff),
        (b"\x76\x2f\x31\x01", HeightFormat::Exr),
    ];
    const OTHERS: [(&[u8], &str); 15] = [
        (b"\xFF\xD8\xFF", "a JPEG, which loses the heights' detail"),
        (b"GIF8", "a GIF"),
        (b"PK\x03\x04", "a ZIP archive, to be unpacked first"),
        (b"\x1F\x8B", "a gzip archive, to be unpacked first"),
        (b"7z\xBC\xAF", "a 7z archive, to be unpacked first"),
        (b"Rar!", "a RAR archive, to be unpacked first"),
        (b"RIFF", "a WebP image or another RIFF file"),
        (b"\x89HDF", "an HDF file"),
        (b"CDF\x01", "a NetCDF file"),
        (b"8BPS", "a Photoshop file"),
        (b"DDS ", "a DDS texture"),
        (b"#?RADIANCE", "a Radiance HDR image"),
        (b"\xABKTX", "a KTX texture"),
        (b"<", "a text in HTML or XML, perhaps an error page of a download"),
        (b"version https://git-lfs", "a pointer of Git LFS, whose file was not fetched"),
    ];
    if let Some((_, format)) = HEIGHTS.iter().find(|(first, _)| bytes.starts_with(first)) {
        return Ok(*format);
    }
    let text = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes).trim_ascii_start();
    let starts_with = |word: &[u8]| text.get(..word.len()).is_some_and(|own| own.eq_ignore_ascii_case(word));
    if starts_with(b"ncols") || starts_with(b"nrows") {
        return Ok(HeightFormat::Ascii);
    }
    // Heights may begin with any bytes. So a signature counts only where it is long, or all of the file's beginning is
    // text.
    let is_text = bytes.iter().take(256).all(|&byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace());
    let found = OTHERS.iter().find(|(first, _)| {
        bytes.starts_with(first)
            && (first.len() > 2 || is_text || first == b"\x1F\x8B" && bytes.get(2) == Some(&8))
    });
    match found {
        Some(&(_, found)) => Err(ImportError::Format { found }),
        None if is_text => Err(ImportError::Format { found: "a text that is not an Esri ASCII grid" }),
        None => Ok(HeightFormat::Raw),
    }
}

/// Decodes an SRTM tile: signed 16 bits, high byte first.
fn decode_hgt(bytes: &[u8], options: &ImportOptions) -> Result<Decoded, ImportError> {
    let length = bytes.len() as u64;
    let count = length / 2;
    let side = count.isqrt();
    let (width, height) = match count {
        _ if !length.is_multiple_of(2) || side < 2 => return Err(ImportError::HgtLength { bytes: length }),
        _ if side * side == count => (side, side),
        6_485_401 => (1801, 3601),
        _ => return Err(ImportError::HgtLength { bytes: length }),
    };
    let (width, height) = (width as u32, height as u32);
    options.limits.check_image(width, height, 4)?;
    let sample = SampleKind::Signed(16);
    let (samples, _) = raw::read(bytes, count, raw::SampleEncoding { sample, is_big_endian: true })?;
    let decoded = Decoded::new(HeightFormat::Hgt, sample, (width, height), samples);
    // A tile covers one degree, and shares its edges with its neighbours.
    let spacing = [width, height].map(|side| 1.0 / f64::from(side - 1));
    Ok(Decoded { no_data: Some(-32_768.0), spacing: Some(spacing), ..decoded })
}
