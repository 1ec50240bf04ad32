//! Medians, percentiles, and lines of a table.

/// Measured values of one kind, in seconds or as ratios.
#[derive(Clone, Debug, Default)]
pub struct Sample(Vec<f64>);

impl Sample {
    pub fn push(&mut self, value: f64) {
        self.0.push(value);
    }

    /// The value below which this share of all values lies.
    pub fn percentile(&self, share: f64) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted.get(((sorted.len().max(1) - 1) as f64 * share).round() as usize).copied().unwrap_or(f64::NAN)
    }

    pub fn median(&self) -> f64 {
        self.percentile(0.5)
    }

    pub fn mean(&self) -> f64 {
        self.0.iter().sum::<f64>() / self.0.len() as f64
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }
}

impl FromIterator<f64> for Sample {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

/// Prints the header for the lines of [`row`].
pub fn header(what: &str, each: &str) {
    println!("  {what:<44} {:>10} {:>10} {:>10}   us {each}", "median", "p99", "runs");
}

/// Prints one line in microseconds.
pub fn row(what: &str, sample: &Sample) {
    let [median, high] = [0.5, 0.99].map(|share| sample.percentile(share) * 1e6);
    println!("  {what:<44} {median:>10.2} {high:>10.2} {:>10}", sample.len());
}
