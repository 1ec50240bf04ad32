//! Statistics of timings: those of the paper's tables, and medians.

/// The statistics in the paper's tables, and medians, of one run in seconds.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Statistics {
    /// Total of all edits of a run, mean of the repeats.
    pub total: f64,
    /// Average of an edit over all edits and repeats.
    pub average: f64,
    /// The longest single edit of all repeats.
    pub max: f64,
    /// The shortest single edit of all repeats.
    pub min: f64,
    /// The median of all edits.
    pub median: f64,
    /// The 99th percentile of all edits.
    pub p99: f64,
}

impl Statistics {
    /// Computes the statistics of each edit's timings, by repeat; all 0 if there are none.
    pub fn of(repeats: &[Vec<f64>]) -> Self {
        let sorted = sorted(repeats.iter().flatten().copied());
        let sum: f64 = sorted.iter().sum();
        Self {
            total: sum / repeats.len().max(1) as f64,
            average: sum / sorted.len().max(1) as f64,
            max: sorted.last().copied().unwrap_or_default(),
            min: sorted.first().copied().unwrap_or_default(),
            median: middle(&sorted),
            p99: percentile(&sorted, 99),
        }
    }
}

/// The median; 0 if there are no values.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    middle(&sorted(values))
}

/// The value that `percent` of all values do not exceed; for 0, the smallest value.
pub fn percentile_of(values: &[f64], percent: usize) -> f64 {
    percentile(&sorted(values.iter().copied()), percent)
}

/// Each edit's median over the repeats, which suppresses other load on the machine.
pub fn by_edit(repeats: &[Vec<f64>]) -> Vec<f64> {
    let edits = repeats.iter().map(Vec::len).min().unwrap_or(0);
    (0..edits).map(|edit| median(repeats.iter().map(|repeat| repeat[edit]))).collect()
}

fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values
}

fn middle(sorted: &[f64]) -> f64 {
    match sorted.len() {
        0 => 0.0,
        odd if odd % 2 == 1 => sorted[odd / 2],
        even => (sorted[even / 2 - 1] + sorted[even / 2]) / 2.0,
    }
}

/// The value that `percent` of the sorted values do not exceed (nearest rank).
fn percentile(sorted: &[f64], percent: usize) -> f64 {
    let rank = (sorted.len() * percent).div_ceil(100).max(1);
    sorted.get(rank - 1).copied().unwrap_or_default()
}
