//! Timing: every contender once per round, in rotating order, and paired statistics.

use std::hint::black_box;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::contender::{Class, Contender, Part};
use crate::fields::{Field, Grid};

/// One contender's times, in the order of the rounds.
pub struct Times {
    /// The contender.
    pub name: &'static str,
    /// The content of its meshes.
    pub class: Class,
    /// Triangles of all meshes that were timed together.
    pub triangles: usize,
    /// Nanoseconds, one per round.
    pub rounds: Vec<f64>,
}

/// Median and quartiles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The lower quartile.
    pub low: f64,
    /// The median.
    pub median: f64,
    /// The upper quartile.
    pub high: f64,
}

impl Spread {
    /// The spread of some numbers.
    pub fn of(numbers: impl IntoIterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = numbers.into_iter().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
        Self { low: at(0.25), median: at(0.5), high: at(0.75) }
    }
}

impl Times {
    fn new(contender: &dyn Contender) -> Self {
        Self { name: contender.name(), class: contender.class(), triangles: 0, rounds: Vec::new() }
    }

    /// Times per cell.
    pub fn per_cell(&self, cells: usize) -> Spread {
        Spread::of(self.rounds.iter().map(|time| time / cells as f64))
    }

    /// Ratios to another contender's times, round by round.
    pub fn over(&self, other: &Self) -> Spread {
        Spread::of(self.rounds.iter().zip(&other.rounds).map(|(own, other)| own / other))
    }
}

/// How long a grid is timed.
#[derive(Clone, Copy)]
pub struct RoundLimits {
    /// Minimum number of rounds.
    pub least: usize,
    /// Maximum number of rounds.
    pub most: usize,
    /// Once there are enough rounds, no further one begins after this time.
    pub budget: Duration,
}

/// The time of one mesh in nanoseconds.
pub fn once(contender: &mut dyn Contender, grid: &Grid, part: Part) -> f64 {
    let start = Instant::now();
    contender.mesh(black_box(grid), part);
    start.elapsed().as_nanos() as f64
}

/// The order of a round: each contender takes one turn. Every round begins with another contender, and every other
/// round is reversed, so that no contender always follows the same one.
fn turns(contenders: usize, round: usize) -> impl Iterator<Item = usize> {
    (0..contenders).map(move |turn| {
        let turn = if round.is_multiple_of(2) { turn } else { contenders - 1 - turn };
        (turn + round / 2) % contenders
    })
}

/// Times one grid repeatedly. Each call is made twice and the second one is timed, so that no contender pays for
/// caches that another has filled.
pub fn one_grid(contenders: &mut [Box<dyn Contender>], grid: &Grid, limits: RoundLimits) -> Vec<Times> {
    let mut times: Vec<Times> = contenders.iter().map(|contender| Times::new(&**contender)).collect();
    for contender in contenders.iter_mut() {
        contender.load(grid);
    }
    let start = Instant::now();
    for round in 0..limits.most {
        if round >= limits.least && start.elapsed() > limits.budget {
            break;
        }
        for turn in turns(contenders.len(), round) {
            let contender = &mut *contenders[turn];
            contender.mesh(black_box(grid), Part::Whole);
            times[turn].rounds.push(once(contender, grid, Part::Whole));
            times[turn].triangles = contender.triangles();
        }
    }
    times
}

/// Times many chunks, each meshed once by every contender; times are in the order of chunks. Within a round each
/// contender gets another chunk, so that none profits from branch prediction trained by another. A chunk's samples
/// are read before every call, as if a game had just written them, so that none pays for fetching the memory.
pub fn stream(contenders: &mut [Box<dyn Contender>], chunks: &[Grid]) -> Vec<Times> {
    let mut times: Vec<Times> = contenders.iter().map(|contender| Times::new(&**contender)).collect();
    // Buffers grow and tables are initialised before timing.
    for contender in contenders.iter_mut() {
        for chunk in chunks.iter().take(8) {
            contender.load(chunk);
            contender.mesh(chunk, Part::WithinApron);
        }
    }
    let (count, apart) = (chunks.len(), chunks.len() / contenders.len());
    times.iter_mut().for_each(|times| times.rounds.resize(count, 0.0));
    for round in 0..count {
        for turn in turns(contenders.len(), round) {
            let (contender, number) = (&mut *contenders[turn], (round + turn * apart) % count);
            let chunk = &chunks[number];
            contender.load(chunk);
            black_box(chunk.samples.iter().sum::<f32>());
            black_box(chunk.fixed.iter().map(|&sample| i64::from(sample)).sum::<i64>());
            times[turn].rounds[number] = once(contender, chunk, Part::WithinApron);
            times[turn].triangles += contender.triangles();
        }
    }
    times
}

/// Cells along the side of a chunk of the stream.
pub const CHUNK_CELLS: usize = 32;

/// Chunks of a stream: one more sample than cells along each side, and an apron of one on each side.
pub fn chunks(field: Field, count: usize) -> Vec<Grid> {
    (0..count).map(|number| field.chunk(number, CHUNK_CELLS + 3)).collect()
}
