//! How much samples differ from their neighbours, for telling ways to read a file apart.

use super::kind::SampleKind;

/// Pairs of samples that are looked at.
const PROBES: usize = 1 << 16;

/// How wildly samples vary, for comparing ways to read the same bytes: the mean difference of neighbours as a share of
/// what the type can hold, 0 to 1. Floats that are not plausible heights count as wild.
pub(super) fn roughness(runs: impl Iterator<Item = impl Iterator<Item = f64>>, sample: SampleKind) -> f64 {
    let (mut sum, mut pairs) = (0.0, 0_u32);
    for run in runs {
        let mut before = None;
        for value in run {
            if let Some(before) = before {
                pairs += 1;
                sum += match sample.full_scale() {
                    Some([low, high]) => f64::abs(value - before) / (high - low),
                    None => float_roughness(before, value),
                };
            }
            before = Some(value);
        }
    }
    if pairs == 0 { 0.0 } else { sum / f64::from(pairs) }
}

/// The difference of two floats, 0 to 1; floats beyond what ground can be count as 1.
fn float_roughness(a: f64, b: f64) -> f64 {
    // Voids say nothing.
    if a.is_nan() || b.is_nan() || a.abs() > 1e30 || b.abs() > 1e30 {
        return 0.01;
    }
    let is_height = |value: f64| value == 0.0 || (1e-12..1e8).contains(&value.abs());
    if !is_height(a) || !is_height(b) {
        return 1.0;
    }
    let size = a.abs().max(b.abs());
    if size == 0.0 { 0.0 } else { (a - b).abs() / (2.0 * size) * 1e-3 }
}

/// Mean difference between a sample and the one below it, if rows have this many.
pub(super) fn row_difference(samples: &[f32], width: usize) -> f64 {
    if width == 0 || samples.len() <= width {
        return f64::INFINITY;
    }
    // An odd step meets all columns.
    let pairs = samples.len() - width;
    let step = (pairs / PROBES).max(1) | 1;
    let (mut sum, mut count) = (0.0, 0.0);
    for at in (0..pairs).step_by(step) {
        let difference = f64::from(samples[at]) - f64::from(samples[at + width]);
        if !difference.is_nan() {
            sum += difference.abs();
            count += 1.0;
        }
    }
    if count == 0.0 { f64::INFINITY } else { sum / count }
}
