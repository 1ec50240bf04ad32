//! Heights from RAW files, which have no header: options that are not given are guessed.

use super::decoded::{Decoded, reserve};
use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::options::RawLayout;
use super::report::ImportNote;
use super::roughness::{roughness, row_difference};
use crate::ground::{ImageLimits, RawFormat};

/// Longest side of a guessed size, in units of the shorter one.
const MAX_ASPECT: u64 = 64;

/// Samples that are looked at for a guess.
const PROBES: usize = 1 << 16;

/// How the bytes of a sample are read.
#[derive(Clone, Copy)]
pub(super) struct SampleEncoding {
    pub sample: SampleKind,
    pub is_big_endian: bool,
}

impl SampleEncoding {
    /// Bytes of a sample; `None` for types that RAW files do not have.
    fn bytes(self) -> Option<usize> {
        match self.sample {
            SampleKind::Unsigned(bits @ (16 | 32)) | SampleKind::Signed(bits @ (16 | 32)) => {
                Some(usize::from(bits / 8))
            }
            SampleKind::Float(32) => Some(4),
            _ => None,
        }
    }

    /// The value of a sample.
    fn value(self, bytes: &[u8]) -> f64 {
        let order = |mut bytes: [u8; 4], count: usize| {
            if self.is_big_endian {
                bytes[..count].reverse();
            }
            bytes
        };
        match *bytes {
            [a, b] => {
                let [a, b, ..] = order([a, b, 0, 0], 2);
                match self.sample {
                    SampleKind::Signed(_) => i16::from_le_bytes([a, b]).into(),
                    _ => u16::from_le_bytes([a, b]).into(),
                }
            }
            [a, b, c, d] => {
                let bytes = order([a, b, c, d], 4);
                match self.sample {
                    SampleKind::Signed(_) => i32::from_le_bytes(bytes).into(),
                    SampleKind::Unsigned(_) => u32::from_le_bytes(bytes).into(),
                    _ => f32::from_le_bytes(bytes).into(),
                }
            }
            _ => f64::NAN,
        }
    }
}

/// Reads samples one after the other, top row first; says whether any was rounded.
pub(super) fn read(
    bytes: &[u8],
    count: u64,
    reading: SampleEncoding,
) -> Result<(Vec<f32>, bool), ImportError> {
    let mut samples = reserve(count)?;
    let mut is_rounded = false;
    for sample in bytes.chunks_exact(reading.bytes().unwrap_or(1)).take(count as usize) {
        let value = reading.value(sample);
        samples.push(value as f32);
        is_rounded |= f64::from(value as f32) != value && !value.is_nan();
    }
    Ok((samples, is_rounded))
}

/// Decodes a RAW file.
pub(super) fn decode(bytes: &[u8], layout: &RawLayout, limits: &ImageLimits) -> Result<Decoded, ImportError> {
    let skipped = usize::try_from(layout.header).unwrap_or(usize::MAX).min(bytes.len());
    let bytes = &bytes[skipped..];
    let length = bytes.len() as u64;
    if bytes.is_empty() {
        return Err(ImportError::Empty);
    }
    let mut notes = Vec::new();
    let given = layout.sample.map(|sample| SampleEncoding { sample, is_big_endian: false }.bytes());
    let per_sample = match (given, layout.size) {
        (Some(None), _) => {
            let allowed = "16 or 32 bits, or floats of 32";
            let value = match layout.sample {
                Some(SampleKind::Unsigned(bits) | SampleKind::Signed(bits) | SampleKind::Float(bits)) => bits,
                _ => 0,
            };
            return Err(ImportError::Option { name: "raw.sample", value: value.into(), allowed });
        }
        (Some(Some(bytes)), _) => bytes as u64,
        (None, Some((width, height))) => {
            let count = u64::from(width) * u64::from(height);
            if Some(length) == count.checked_mul(4) { 4 } else { 2 }
        }
        (None, None) => guess_bytes(bytes),
    };
    if layout.sample.is_none() {
        notes.push(ImportNote::SampleGuessed);
    }
    if let Some((width, height)) = layout.size {
        limits.check_image(width, height, 4)?;
        let expected = u64::from(width) * u64::from(height) * per_sample;
        if expected != length {
            let bytes_per_sample = per_sample as u32;
            return Err(ImportError::RawLength { width, height, bytes_per_sample, expected, actual: length });
        }
    } else if !length.is_multiple_of(per_sample) {
        return Err(ImportError::RawSize { bytes: length });
    }
    let reading = guess_reading(bytes, per_sample as usize, layout);
    if layout.byte_order.is_none() {
        notes.push(ImportNote::ByteOrderGuessed { is_big_endian: reading.is_big_endian });
    }
    let count = length / per_sample;
    if layout.size.is_none() {
        notes.push(ImportNote::SizeGuessed);
    }
    let candidates = match layout.size {
        Some((width, _)) => vec![u64::from(width)],
        None => widths(count, limits),
    };
    if candidates.is_empty() {
        return Err(ImportError::RawSize { bytes: length });
    }
    limits.check_image(candidates[0] as u32, (count / candidates[0]) as u32, 4)?;
    let (mut samples, is_rounded) = read(bytes, count, reading)?;
    let score = |width: &u64| row_difference(&samples, *width as usize);
    let width = candidates.iter().copied().min_by(|a, b| score(a).total_cmp(&score(b))).unwrap_or(count);
    let (width, height) = (width as u32, (count / width) as u32);
    if layout.is_bottom_up {
        flip(&mut samples, width as usize);
    }
    let mut decoded = Decoded::new(HeightFormat::Raw, reading.sample, (width, height), samples);
    decoded.notes = notes;
    if is_rounded {
        decoded.notes.push(ImportNote::Rounded);
    }
    Ok(decoded)
}

/// Reverses the order of rows.
fn flip(samples: &mut [f32], width: usize) {
    let mut rest = samples;
    while rest.len() >= 2 * width {
        let (first, others) = rest.split_at_mut(width);
        let (between, last) = others.split_at_mut(others.len() - width);
        first.swap_with_slice(last);
        rest = between;
    }
}

fn is_square(count: u64) -> bool {
    count.isqrt().pow(2) == count
}

/// Widths from which the size of an image with `count` samples is guessed: only that of a square, if it can be one.
fn widths(count: u64, limits: &ImageLimits) -> Vec<u64> {
    let is_allowed =
        |&width: &u64| width <= u64::from(limits.max_width) && count / width <= u64::from(limits.max_height);
    let root = count.isqrt();
    if is_square(count) {
        return [root].into_iter().filter(is_allowed).collect();
    }
    plausible_widths(count).filter(is_allowed).collect()
}

/// Widths of an image with `count` samples whose sides do not differ beyond reason.
pub(super) fn plausible_widths(count: u64) -> impl Iterator<Item = u64> {
    let divisors = (2..=count.isqrt()).filter(move |&width| count.is_multiple_of(width));
    let sides = divisors.map(move |width| [width, count / width]);
    sides.filter(|[short, long]| *long <= short * MAX_ASPECT).flatten()
}

/// The bytes of a sample, 2 or 4, if neither the type nor the size is known.
fn guess_bytes(bytes: &[u8]) -> u64 {
    let length = bytes.len() as u64;
    if !length.is_multiple_of(4) {
        return 2;
    }
    let orders = [false, true].map(|is_big_endian| Words::of(bytes, is_big_endian));
    let (halves, smooth) = (orders.iter().any(Words::are_halves), orders.iter().any(Words::are_smooth));
    let is_gentle = orders.iter().any(|words| words.are_smooth() && words.wild == 0);
    match (halves, smooth, is_gentle) {
        (true, _, false) => 4,
        (false, true, _) => 2,
        // The samples do not say, so their number must.
        _ if is_square(length / 4) && !is_square(length / 2) => 4,
        _ => 2,
    }
}

/// How the words of 16 bits of a file vary.
#[derive(Default)]
struct Words {
    /// Pairs of neighbours.
    pairs: u32,
    /// Pairs that differ.
    varied: u32,
    /// Pairs that differ by more than a sixteenth of the range.
    wild: u32,
    /// Sum of the differences of neighbours.
    next: f64,
    /// Sums of the differences of words two places apart, at even and at odd places.
    second_next: [f64; 2],
}

impl Words {
    fn of(bytes: &[u8], is_big_endian: bool) -> Self {
        let reading = SampleEncoding { sample: SampleKind::Unsigned(16), is_big_endian };
        let mut found = Self::default();
        for run in runs(bytes, 4) {
            let words: Vec<f64> = run.chunks_exact(2).map(|word| reading.value(word)).collect();
            for (at, word) in words.windows(3).enumerate() {
                let difference = (word[1] - word[0]).abs();
                found.pairs += 1;
                found.varied += u32::from(difference > 0.0);
                found.wild += u32::from(difference > 4096.0);
                found.next += difference;
                found.second_next[at % 2] += (word[2] - word[0]).abs();
            }
        }
        found
    }

    /// Whether words are halves of longer samples: the high halves are like each other and unlike the low ones.
    fn are_halves(&self) -> bool {
        let [even, odd] = self.second_next;
        self.wild >= 16 && even.min(odd) * 16.0 < self.next
    }

    /// Whether neighbours are like each other, as samples of 16 bits are.
    fn are_smooth(&self) -> bool {
        self.varied * 16 >= self.pairs && self.next < 2048.0 * f64::from(self.pairs)
    }
}

/// Runs of neighbours, spread over a file whose samples have `per_sample` bytes.
fn runs(bytes: &[u8], per_sample: usize) -> impl Iterator<Item = &[u8]> {
    let count = bytes.len() / per_sample;
    let runs = count.div_ceil(64).clamp(1, PROBES / 64);
    // Not at the same column of each row, where rows are as long as the distance between runs.
    let offsets = (count / runs).saturating_sub(63).max(1);
    (0..runs).map(move |number| {
        let start = (count * number / runs + number * 101 % offsets) * per_sample;
        &bytes[start..(start + 64 * per_sample).min(bytes.len())]
    })
}

/// The sample type and byte order under which the samples vary least, of those that the layout leaves open.
fn guess_reading<'a>(bytes: &'a [u8], per_sample: usize, layout: &RawLayout) -> SampleEncoding {
    let kinds = match (layout.sample, per_sample) {
        (Some(sample), _) => vec![sample],
        (None, 4) => vec![SampleKind::Float(32), SampleKind::Unsigned(32), SampleKind::Signed(32)],
        (None, _) => vec![SampleKind::Unsigned(16), SampleKind::Signed(16)],
    };
    let orders = match layout.byte_order {
        Some(format) => vec![format == RawFormat::BigEndian],
        None => vec![false, true],
    };
    let readings = orders
        .iter()
        .flat_map(|&is_big_endian| kinds.iter().map(move |&sample| SampleEncoding { sample, is_big_endian }));
    let probe = |reading: SampleEncoding| {
        let values = |run: &'a [u8]| run.chunks_exact(per_sample).map(move |sample| reading.value(sample));
        roughness(runs(bytes, per_sample).map(values), reading.sample)
    };
    let rated = readings.map(|reading| (probe(reading), reading));
    // Of equals the first: low byte first, floats, unsigned.
    let best = rated.reduce(|best, next| if next.0 < best.0 { next } else { best });
    best.map_or(SampleEncoding { sample: kinds[0], is_big_endian: orders[0] }, |(_, reading)| reading)
}
