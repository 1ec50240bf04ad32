//! Heights from Esri ASCII grids.

use super::decoded::{Decoded, reserve};
use super::error::ImportError;
use super::kind::{HeightFormat, SampleKind};
use super::report::ImportNote;
use crate::ground::ImageLimits;

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

/// Decodes an ASCII grid.
pub(super) fn decode(bytes: &[u8], limits: &ImageLimits) -> Result<Decoded, ImportError> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = bytes[..error.valid_up_to()].iter().filter(|&&byte| byte == b'\n').count() + 1;
        wrong(line, "is not text")
    })?;
    let mut lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()).peekable();
    let mut header = Header::default();
    let mut last = 1;
    while let Some(&(number, line)) = lines.peek() {
        let is_name = line.trim_start().starts_with(|first: char| first.is_ascii_alphabetic());
        let is_nan = line.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("nan"));
        if !is_name || is_nan {
            break;
        }
        header.read(number, line)?;
        last = number;
        lines.next();
    }
    let missing = |name| wrong(last, format!("ends a header without {name}"));
    let width = header.columns.ok_or_else(|| missing("ncols"))?;
    let height = header.rows.ok_or_else(|| missing("nrows"))?;
    limits.check_image(width, height, 4)?;
    let expected = u64::from(width) * u64::from(height);
    // A number takes two bytes at least: a header cannot ask for more memory than its file could fill.
    let mut samples = reserve(expected.min(bytes.len() as u64))?;
    let mut is_rounded = false;
    for (number, line) in lines {
        last = number;
        for word in line.split_whitespace() {
            let value: f64 = word.parse().map_err(|_| match word.replace(',', ".").parse::<f64>() {
                Ok(_) => wrong(number, format!("has the number {word} with a decimal comma")),
                Err(_) => wrong(number, format!("has {:?} in place of a number", short(word))),
            })?;
            if samples.len() as u64 == expected {
                return Err(wrong(number, format!("continues after {expected} samples")));
            }
            samples.push(value as f32);
            // Text has decimal digits: what counts is whether the nearest f32 loses those that matter.
            is_rounded |= (f64::from(value as f32) - value).abs() > 1e-6 * value.abs();
        }
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

/// The beginning of a word.
fn short(word: &str) -> String {
    word.chars().take(20).collect()
}

impl Header {
    /// Reads one line, such as `ncols 1201`.
    fn read(&mut self, number: usize, line: &str) -> Result<(), ImportError> {
        let mut words = line.split_whitespace();
        let (name, value) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        if words.next().is_some() {
            return Err(wrong(number, format!("has more than one value for {}", short(name))));
        }
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
