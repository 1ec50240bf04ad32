//! Voids and outliers: found, counted, and repaired as the options say.

use rayon::prelude::*;

use super::decoded::Decoded;
use super::error::ImportError;
use super::grid::range;
use super::kind::SampleKind;
use super::options::{ImportOptions, Repair};
use super::report::ImportNote;

/// Values that programs write for samples without one.
const WELL_KNOWN: [f32; 4] = [-32_768.0, -32_767.0, -9_999.0, -99_999.0];

/// Floats this far from zero are not heights but the type's limits, which mean void.
const ENDLESS: f32 = 1e30;

/// Pairs of neighbours of which the usual difference is found.
const PROBES: usize = 1 << 16;

/// Passes over filled samples that even them out.
const SWEEPS: usize = 16;

/// Passes that look for outliers: each finds those next to one of the previous pass.
const PASSES: usize = 4;

/// Numbers for the report.
#[derive(Default)]
pub(super) struct Repaired {
    pub voids: u64,
    pub outliers: u64,
}

/// Finds voids and outliers of a file, and repairs them. Voids that are kept are NaN.
pub(super) fn repair(decoded: &mut Decoded, options: &ImportOptions) -> Result<Repaired, ImportError> {
    mark_voids(decoded, options);
    let width = decoded.width as usize;
    let count = decoded.samples.len() as u64;
    let Some([low, _]) = range(&decoded.samples) else { return Err(ImportError::AllVoid { samples: count }) };
    let place = |index: usize| ((index % width) as u32, (index / width) as u32);
    let samples = &mut decoded.samples;
    let voids = samples.par_iter().filter(|value| value.is_nan()).count() as u64;
    if let Some(first) = samples.iter().position(|value| value.is_nan()) {
        match options.voids {
            Repair::Keep => {}
            Repair::Fill => fill(samples, width),
            Repair::Clamp => samples.iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = low),
            Repair::Refuse => {
                let (x, z) = place(first);
                return Err(ImportError::Voids { count: voids, x, z });
            }
        }
    }
    let outliers = repair_outliers(decoded, options)?;
    Ok(Repaired { voids, outliers })
}

/// Whether programs write this value for samples without one.
pub(super) fn is_well_known_void(value: f32) -> bool {
    WELL_KNOWN.contains(&value)
}

/// Sets samples without a value to NaN.
fn mark_voids(decoded: &mut Decoded, options: &ImportOptions) {
    let declared = [decoded.no_data.map(|value| value as f32), options.no_data];
    let is_integer = decoded.sample.full_scale().is_some();
    let is_void = |value: f32| {
        declared.contains(&Some(value))
            || !is_integer && value.abs() >= ENDLESS
            || options.valid.is_some_and(|[low, high]| value < low || value > high)
    };
    decoded.samples.par_iter_mut().filter(|value| is_void(**value)).for_each(|value| *value = f32::NAN);
    for end in [End::Low, End::High] {
        let Some(lone) = Lone::find(&decoded.samples, end) else { continue };
        let is_known = is_well_known_void(lone.value) && !matches!(decoded.sample, SampleKind::Unsigned(_));
        if is_known && lone.gap >= lone.others {
            decoded.samples.iter_mut().filter(|v| **v == lone.value).for_each(|value| *value = f32::NAN);
            let (value, count) = (lone.value, lone.count);
            decoded.notes.push(ImportNote::NoDataGuessed { value, count });
        } else if lone.gap > lone.others {
            let (value, count) = (lone.value, lone.count);
            decoded.notes.push(ImportNote::LooksLikeNoData { value, count });
        }
    }
}

#[derive(Clone, Copy)]
enum End {
    Low,
    High,
}

/// The least or greatest value of a file, and how it lies to the others.
struct Lone {
    value: f32,
    count: u64,
    /// Distance to the next value.
    gap: f64,
    /// Range of all other values.
    others: f64,
}

impl Lone {
    /// `None` if all samples are alike.
    fn find(samples: &[f32], end: End) -> Option<Self> {
        let [low, high] = range(samples)?;
        let value = match end {
            End::Low => low,
            End::High => high,
        };
        let own = samples.par_iter().filter(|sample| **sample == value).count() as u64;
        let rest = samples.par_iter().filter(|sample| !sample.is_nan() && **sample != value);
        let [low, high] = rest
            .map(|&sample| [sample, sample])
            .reduce_with(|[low, high], [a, b]| [low.min(a), high.max(b)])?;
        let gap = match end {
            End::Low => f64::from(low) - f64::from(value),
            End::High => f64::from(value) - f64::from(high),
        };
        Some(Self { value, count: own, gap, others: f64::from(high) - f64::from(low) })
    }
}

/// The places around a sample that exist.
fn around(index: usize, width: usize, count: usize) -> impl Iterator<Item = usize> {
    let (x, z, depth) = (index % width, index / width, count / width);
    let along = move |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
    along(z, depth)
        .flat_map(move |other_z| along(x, width).map(move |other_x| other_z * width + other_x))
        .filter(move |&other| other != index)
}

/// Fills samples that are NaN from those around them: from the border of each hole inwards, each sample with the mean
/// of the known ones around it, then evened out. So nothing is filled with more or less than its surroundings have.
pub(super) fn fill(samples: &mut [f32], width: usize) {
    let count = samples.len();
    let mut holes = vec![0_u64; count.div_ceil(64)];
    for (index, _) in samples.iter().enumerate().filter(|(_, value)| value.is_nan()) {
        holes[index / 64] |= 1 << (index % 64);
    }
    let has_known =
        |samples: &[f32], index| around(index, width, count).any(|other| !samples[other].is_nan());
    let hole_places = || {
        let words = holes.iter().enumerate().filter(|(_, word)| **word != 0);
        words.flat_map(|(at, &word)| {
            (0..64).filter(move |bit| word >> bit & 1 == 1).map(move |bit| at * 64 + bit)
        })
    };
    let mut border: Vec<u32> =
        hole_places().filter(|&index| has_known(samples, index)).map(|index| index as u32).collect();
    while !border.is_empty() {
        let mean = |index: usize| {
            let known =
                around(index, width, count).map(|other| samples[other]).filter(|value| !value.is_nan());
            let (sum, known) =
                known.fold((0.0, 0.0), |(sum, known), value| (sum + f64::from(value), known + 1.0));
            (sum / known) as f32
        };
        let values: Vec<f32> = border.iter().map(|&index| mean(index as usize)).collect();
        border.iter().zip(&values).for_each(|(&index, &value)| samples[index as usize] = value);
        let inner = border.iter().flat_map(|&index| around(index as usize, width, count));
        let mut next: Vec<u32> =
            inner.filter(|&index| samples[index].is_nan()).map(|index| index as u32).collect();
        next.sort_unstable();
        next.dedup();
        border = next;
    }
    for _ in 0..SWEEPS {
        for index in hole_places() {
            let (x, z) = (index % width, index / width);
            let beside = [
                if x > 0 { index - 1 } else { index },
                if x + 1 < width { index + 1 } else { index },
                if z > 0 { index - width } else { index },
                if (z + 1) * width < count { index + width } else { index },
            ];
            let sum: f64 = beside.iter().map(|&other| f64::from(samples[other])).sum();
            samples[index] = (sum / 4.0) as f32;
        }
    }
}

/// Finds single samples far from all around them, and repairs them. Returns their number.
fn repair_outliers(decoded: &mut Decoded, options: &ImportOptions) -> Result<u64, ImportError> {
    let width = decoded.width as usize;
    let Some(distance) = options.outlier_distance.map(f64::from).or_else(|| usual_distance(decoded)) else {
        return Ok(0);
    };
    let mut total = 0;
    for pass in 0..PASSES {
        let samples = &decoded.samples;
        let found: Vec<u32> = (0..samples.len())
            .into_par_iter()
            .filter(|&index| is_outlier(samples, index, width, distance))
            .map(|index| index as u32)
            .collect();
        let Some(&first) = found.first() else { break };
        total += found.len() as u64;
        let (x, z) = (first % decoded.width, first / decoded.width);
        let value = samples[first as usize];
        match options.outliers {
            Repair::Refuse => return Err(ImportError::Outliers { count: total, x, z, value }),
            Repair::Keep => {
                decoded.notes.push(ImportNote::Outliers { count: total, x, z, value });
                break;
            }
            Repair::Fill => {
                // Voids that are to be kept stay.
                let voids: Vec<u32> = match options.voids {
                    Repair::Keep => {
                        let places = (0..).zip(&decoded.samples);
                        places.filter(|(_, value)| value.is_nan()).map(|(index, _)| index).collect()
                    }
                    _ => Vec::new(),
                };
                found.iter().for_each(|&index| decoded.samples[index as usize] = f32::NAN);
                fill(&mut decoded.samples, width);
                voids.iter().for_each(|&index: &u32| decoded.samples[index as usize] = f32::NAN);
            }
            Repair::Clamp => {
                let clamped: Vec<f32> =
                    found.iter().map(|&index| clamped(samples, index as usize, width)).collect();
                found.iter().zip(clamped).for_each(|(&index, value)| decoded.samples[index as usize] = value);
            }
        }
        if pass == 0 {
            decoded.notes.push(ImportNote::Outliers { count: total, x, z, value });
        }
    }
    if let Some(ImportNote::Outliers { count, .. }) = decoded.notes.last_mut() {
        *count = total;
    }
    Ok(total)
}

/// Returns `true` if a sample lies more than a distance above all samples around it, or below them. Of eight, one may
/// be like it, so that pairs are found; at the rim and next to voids none.
fn is_outlier(samples: &[f32], index: usize, width: usize, distance: f64) -> bool {
    let value = f64::from(samples[index]);
    let (mut above, mut below, mut known) = (0, 0, 0);
    for other in around(index, width, samples.len()) {
        let other = f64::from(samples[other]);
        known += i32::from(!other.is_nan());
        above += i32::from(value - other > distance);
        below += i32::from(other - value > distance);
    }
    known >= 3 && above.max(below) >= known - i32::from(known == 8)
}

/// An outlier's value, moved to the nearest value around it; all but one of which lie on one side of it.
fn clamped(samples: &[f32], index: usize, width: usize) -> f32 {
    let mut others: Vec<f32> = around(index, width, samples.len()).map(|other| samples[other]).collect();
    others.retain(|other| !other.is_nan());
    others.sort_unstable_by(f32::total_cmp);
    let middle = others[others.len() / 2];
    let value = samples[index];
    if value > middle { others[others.len().saturating_sub(2)] } else { others[1.min(others.len() - 1)] }
}

/// How far an outlier lies from the samples around it, unless the options say; `None` for level ground.
fn usual_distance(decoded: &Decoded) -> Option<f64> {
    let [low, high] = range(&decoded.samples)?;
    let pairs = decoded.samples.len().saturating_sub(1);
    let step = (pairs / PROBES).max(1) | 1;
    let difference = |at: usize| f64::from(decoded.samples[at + 1]) - f64::from(decoded.samples[at]);
    let mut differences: Vec<f64> =
        (0..pairs).step_by(step).map(difference).map(f64::abs).filter(|d| !d.is_nan()).collect();
    differences.sort_unstable_by(f64::total_cmp);
    let median = differences.get(differences.len() / 2).copied().unwrap_or_default();
    let distance = (64.0 * median).max((f64::from(high) - f64::from(low)) / 64.0);
    (distance > 0.0).then_some(distance)
}
