//! Plays edits, transaction by transaction, and times each of them.

use std::time::{Duration, Instant};

use bevy_burrow::terrain::{Receipt, Terrain, WorkLimits};
use indicatif::{ProgressBar, ProgressStyle};

use crate::script::ScriptedEdit;

/// The result of a script.
pub struct Played {
    /// The receipt of each edit with its line number, in order.
    pub receipts: Vec<(usize, Receipt)>,
    /// How long each transaction took, from the first edit queued to the commit.
    pub transactions: Vec<Duration>,
    /// Largest number of edits in a transaction.
    pub batch: usize,
}

/// Plays `edits` in transactions of `batch` edits. Shows a progress bar where stderr is a terminal.
pub fn play(terrain: &mut Terrain, edits: &[ScriptedEdit], batch: usize) -> Played {
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} edits, {elapsed}, {eta} left");
    let bar = ProgressBar::new(edits.len() as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let mut played = Played { receipts: Vec::with_capacity(edits.len()), transactions: Vec::new(), batch };
    // Whatever its size, a batch has to be a single transaction.
    terrain.set_work_limits(WorkLimits::UNBOUNDED);
    for edits in edits.chunks(batch) {
        let start = Instant::now();
        let receipts = transact(terrain, edits);
        played.transactions.push(start.elapsed());
        played.receipts.extend(edits.iter().map(|edit| edit.line).zip(receipts));
        bar.inc(edits.len() as u64);
    }
    bar.finish_and_clear();
    played
}

/// Runs one transaction. Nothing else changes this terrain, so the commit is never stale.
fn transact(terrain: &mut Terrain, edits: &[ScriptedEdit]) -> Vec<Receipt> {
    terrain.submit_all(edits.iter().map(|scripted| &scripted.edit));
    let commit = terrain.begin().map(|transaction| transaction.run());
    commit.and_then(|commit| terrain.commit(commit).ok()).unwrap_or_default()
}
