//! Heights from Esri ASCII grids.

use std::io::{BufRead, ErrorKind};

use super::decoded::{Decoded, reserve};
use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;
use crate::ground::ImageLimits;

/// No number is longer, in bytes.
const LONGEST_WORD: usize = 4096;

/// The numbers of a grid's header.
#[derive(Default)]
struct Header {
    columns: Option<u32>,
    rows: Option<u32>,
    low: [Option<f64>; 2],
    /// Whether `low` is the middle of the lower left sample, not its corner.
    is_middle: bool,
    step: [Option<f64>; 2],
    no_data: Option<f64>,
}

fn wrong(line: usize, problem: impl Into<String>) -> ImportError {
    ImportError::Ascii { line, problem: problem.into() }
}

/// Decodes an ASCII grid of `length` bytes.
pub(super) fn decode(file: impl BufRead, length: u64, limits: &ImageLimits) -> Result<Decoded, ImportError> {
    let mut words = Words::new(file);
    let mut header = Header::default();
    let (mut line, mut last) = (words.advance()?, 1);
    while let Some(number) = line {
        let name = words.text()?.to_owned();
        let is_name = name.starts_with(|first: char| first.is_ascii_alphabetic());
        if !is_name || name.eq_ignore_ascii_case("nan") {
            break;
        }
        last = number;
        line = words.advance()?;
        let mut value = String::new();
        if line == Some(number) {
            value = words.text()?.to_owned();
            line = words.advance()?;
        }
        if line == Some(number) {
            return Err(wrong(number, format!("has more than one value for {}", short(&name))));
        }
        header.read(number, &name, &value)?;
    }
    let missing = |name| wrong(last, format!("ends a header without {name}"));
    let width = header.columns.ok_or_else(|| missing("ncols"))?;
    let height = header.rows.ok_or_else(|| missing("nrows"))?;
    limits.check_image(width, height, 4)?;
    let expected = u64::from(width) * u64::from(height);
    // A number takes two bytes at least: a header cannot ask for more memory than its file could fill.
    let mut samples = reserve(expected.min(length))?;
    let mut is_rounded = false;
    while let Some(number) = line {
        last = number;
        let text = words.text()?;
        let value: f64 = text.parse().map_err(|_| match text.replace(',', ".").parse::<f64>() {
            Ok(_) => wrong(number, format!("has the number {text} with a decimal comma")),
            Err(_) => wrong(number, format!("has {:?} in place of a number", short(text))),
        })?;
        if samples.len() as u64 == expected {
            return Err(wrong(number, format!("continues after {expected} samples")));
        }
        samples.push(value as f32);
        // Text has decimal digits: what counts is whether the nearest f32 loses those that matter.
        is_rounded |= (f64::from(value as f32) - value).abs() > 1e-6 * value.abs();
        line = words.advance()?;
    }
    if (samples.len() as u64) < expected {
        return Err(wrong(last, format!("ends after {} of {expected} samples", samples.len())));
    }
    let mut decoded = Decoded::new(HeightFormat::Ascii, SampleKind::Text, (width, height), samples);
    decoded.no_data = header.no_data.or(Some(-9999.0));
    decoded.spacing = match header.step {
        [Some(x), Some(z)] => Some([x, z]),
        _ => None,
    };
    if let ([Some(east), Some(north)], Some([x, z])) = (header.low, decoded.spacing) {
        let half = if header.is_middle { 0.0 } else { 0.5 };
        decoded.origin = Some([east + half * x, north + (f64::from(height) - 1.0 + half) * z]);
    }
    if is_rounded {
        decoded.notes.push(ImportNote::Rounded);
    }
    Ok(decoded)
}

/// The words of a text, which is never in memory as a whole.
struct Words<R> {
    file: R,
    line: usize,
    /// The word that was read last.
    word: Vec<u8>,
}

impl<R: BufRead> Words<R> {
    fn new(mut file: R) -> Self {
        // An error is met again by the first word.
        if file.fill_buf().is_ok_and(|bytes| bytes.starts_with(b"\xEF\xBB\xBF")) {
            file.consume(3);
        }
        Self { file, line: 1, word: Vec::new() }
    }

    /// Reads the next word. Returns the number of its line, or `None` at the end of the text.
    fn advance(&mut self) -> Result<Option<usize>, ImportError> {
        let is_space = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'\x0B';
        self.word.clear();
        loop {
            let bytes = match self.file.fill_buf() {
                Ok(bytes) => bytes,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return Err(wrong(self.line, format!("cannot be read ({error})"))),
            };
            if bytes.is_empty() {
                break;
            }
            let skipped = if self.word.is_empty() {
                bytes.iter().position(|byte| !is_space(byte)).unwrap_or(bytes.len())
            } else {
                0
            };
            self.line += bytes[..skipped].iter().filter(|&&byte| byte == b'\n').count();
            let rest = &bytes[skipped..];
            let end = rest.iter().position(is_space);
            self.word.extend_from_slice(&rest[..end.unwrap_or(rest.len())]);
            let read = skipped + end.unwrap_or(rest.len());
            self.file.consume(read);
            if end.is_some() {
                break;
            }
            if self.word.len() > LONGEST_WORD {
                return Err(wrong(self.line, format!("has a word of more than {LONGEST_WORD} bytes")));
            }
        }
        Ok((!self.word.is_empty()).then_some(self.line))
    }

    /// The word that was read last.
    fn text(&self) -> Result<&str, ImportError> {
        std::str::from_utf8(&self.word).map_err(|_| wrong(self.line, "is not text"))
    }
}

/// The beginning of a word.
fn short(word: &str) -> String {
    word.chars().take(20).collect()
}

impl Header {
    /// Reads one line, such as `ncols 1201`.
    fn read(&mut self, number: usize, name: &str, value: &str) -> Result<(), ImportError> {
        let refused = || wrong(number, format!("has {:?} as {}", short(value), short(name)));
        let count = || value.parse::<u32>().map_err(|_| refused());
        let real = || match value.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(refused()),
        };
        match name.to_ascii_lowercase().as_str() {
            "ncols" => self.columns = Some(count()?),
            "nrows" => self.rows = Some(count()?),
            "xllcorner" => self.low[0] = Some(real()?),
            "yllcorner" => self.low[1] = Some(real()?),
            "xllcenter" => (self.low[0], self.is_middle) = (Some(real()?), true),
            "yllcenter" => (self.low[1], self.is_middle) = (Some(real()?), true),
            "cellsize" => self.step = [Some(real()?); 2],
            "dx" => self.step[0] = Some(real()?),
            "dy" => self.step[1] = Some(real()?),
            "nodata_value" => self.no_data = Some(value.parse().map_err(|_| refused())?),
            _ => return Err(wrong(number, format!("has the unknown name {:?}", short(name)))),
        }
        Ok(())
    }
}
