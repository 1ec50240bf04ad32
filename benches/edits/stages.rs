//! Transactions of one brush each, split into stages.

use std::time::{Duration, Instant};

use bevy_burrow::prelude::*;
use bevy_burrow::terrain::Stages;

use crate::statistics::Sample;

/// Times of many transactions.
#[derive(Default)]
pub struct Played {
    pub stages: Vec<Stages>,
    pub commits: Sample,
}

impl Played {
    /// Plays one more brush; returns what it changed.
    pub fn play(&mut self, terrain: &mut Terrain, brush: &Brush) -> Applied {
        terrain.submit(brush);
        let commit = terrain.begin().expect("a queued brush").run();
        self.stages.push(commit.stages);
        let start = Instant::now();
        let mut receipts = terrain.commit(commit).expect("no other commit");
        self.commits.push(start.elapsed().as_secs_f64());
        receipts.pop().expect("each brush has a receipt").outcome.expect("a valid brush in the world")
    }

    /// One stage of every transaction, in seconds.
    pub fn stage(&self, stage: fn(&Stages) -> Duration) -> Sample {
        self.stages.iter().map(|stages| stage(stages).as_secs_f64()).collect()
    }
}

/// Runs a transaction and returns its time in seconds.
pub fn run(terrain: &mut Terrain) -> f64 {
    let transaction = terrain.begin().expect("queued brushes");
    let start = Instant::now();
    let commit = transaction.run();
    let took = start.elapsed().as_secs_f64();
    assert!(!commit.meshes.chunks.is_empty());
    took
}

/// Prints the header of the lines that [`row`] prints.
pub fn header(what: &str) {
    let names = ["whole", "p99", "edit", "meshing", "assembly", "ring", "commit", "a second"];
    let names: String = names.iter().map(|name| format!("{name:>9}")).collect();
    println!("  {what:<64}{names}   us, medians but for p99; edits one after the other");
}

/// One line: the whole transaction, its stages, the commit, and how many are done in a second.
pub fn row(what: &str, played: &Played) {
    let whole = played.stage(|stages| stages.whole);
    let stages: [fn(&Stages) -> Duration; 4] =
        [|stages| stages.edit, |stages| stages.meshing, |stages| stages.assembly, |stages| stages.ring];
    let figures = [whole.median(), whole.percentile(0.99)]
        .into_iter()
        .chain(stages.map(|stage| played.stage(stage).median()))
        .chain([played.commits.median()]);
    let figures: String = figures.map(|seconds| format!("{:>9.1}", seconds * 1e6)).collect();
    let a_second = 1.0 / (whole.mean() + played.commits.mean());
    println!("  {what:<64}{figures}{a_second:>9.0}");
}
