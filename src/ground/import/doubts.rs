//! Doubts about samples: do they vary as ground does?

use super::decoded::Decoded;
use super::grid::range;
use super::kind::{HeightFormat, SampleKind};
use super::raw::plausible_widths;
use super::repair::is_well_known_void;
use super::report::ImportNote;
use super::roughness::{roughness, row_difference};

/// Pairs of samples that are looked at.
const PROBES: usize = 1 << 16;

/// Notes on what looks wrong with a decoded file.
pub(super) fn doubts(decoded: &Decoded) -> Vec<ImportNote> {
    let mut notes = Vec::new();
    if range(&decoded.samples).is_some_and(|[low, high]| low == high) {
        notes.push(ImportNote::Level);
        return notes;
    }
    if looks_byte_swapped(decoded) {
        notes.push(ImportNote::LooksByteSwapped);
        return notes;
    }
    notes.extend(better_width(decoded).map(|width| ImportNote::LooksTransposed { width }));
    notes
}

/// The number of samples in a row with which rows fit each other far better; `None` if there is none.
fn better_width(decoded: &Decoded) -> Option<u32> {
    let (width, height) = (u64::from(decoded.width), u64::from(decoded.height));
    let candidates = match decoded.format {
        _ if width != height => vec![height],
        // Other formats have their size in the file. Small ones are as good with any width.
        HeightFormat::Raw if width >= 16 => {
            plausible_widths(width * height).filter(|&other| other != width).collect()
        }
        _ => return None,
    };
    let difference = |width: u64| row_difference(&decoded.samples, width as usize);
    let own = difference(width);
    let (best, other) =
        candidates.into_iter().map(|width| (width, difference(width))).min_by(|a, b| a.1.total_cmp(&b.1))?;
    // In a square that is made of rows of half its width, each sample lies above the one that belongs two rows below it.
    // So the right width is only a little better there, but no other smaller one is better at all.
    let least = if width == height && best < width { 1.25 } else { 4.0 };
    (other * least < own).then_some(best as u32)
}

/// Returns `true` if samples vary far less with their bytes exchanged.
fn looks_byte_swapped(decoded: &Decoded) -> bool {
    let (SampleKind::Unsigned(16) | SampleKind::Signed(16)) = decoded.sample else { return false };
    // Low bytes that are all alike look smooth as high ones: this is a picture of 8 bits.
    let low = |value: f32| value as i32 & 0xFF;
    let is_void = |value: f32| Some(f64::from(value)) == decoded.no_data || is_well_known_void(value);
    let mut values = decoded.samples.iter().copied().filter(|&value| !is_void(value));
    let first = values.next().map(low);
    if values.all(|value| Some(low(value)) == first) {
        return false;
    }
    let swapped = |value: f64| -> f64 {
        match decoded.sample {
            SampleKind::Signed(_) => (value as i16).swap_bytes().into(),
            _ => (value as u16).swap_bytes().into(),
        }
    };
    let rows = decoded.samples.chunks_exact(decoded.width as usize);
    let step = (decoded.samples.len() / PROBES).max(1);
    let rough = |exchange: &dyn Fn(f64) -> f64| {
        let values = |row: &[f32]| {
            let values = row.iter().filter(|value| !is_void(**value));
            values.map(|&value| exchange(value.into())).collect::<Vec<_>>()
        };
        roughness(rows.clone().step_by(step).map(|row| values(row).into_iter()), decoded.sample)
    };
    // Byte-swapped ground jumps over the whole range, a quarter of it or so from sample to sample; byte-swapped ground
    // that is gentle jumps by 256 for each unit of a step.
    let (own, swapped) = (rough(&|value| value), rough(&swapped));
    own > 0.05 && swapped * 4.0 < own || own > 0.002 && swapped * 16.0 < own
}
