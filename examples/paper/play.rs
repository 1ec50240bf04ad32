//! Plays the edits of one run and times each, as in the paper: from the start of an edit until its meshes are ready.
//! Nothing else happens in between.

use std::hint::black_box;

use bevy_burrow::brush::Brush;
use bevy_burrow::terrain::{Applied, Receipt, Terrain};

use crate::backend::Runner;
use crate::clock::{self, Lap};
use crate::error::PaperError;
use crate::full::{DenseField, FullWorld};

/// The result of a run.
#[derive(Clone, Debug, Default)]
pub struct Played {
    /// The time of each edit.
    pub laps: Vec<Lap>,
    /// Voxels that each edit dug or filled; `None` for a dense field.
    pub voxels: Vec<u64>,
    /// Edits that changed no sample.
    pub unchanged: usize,
    /// Edits that changed no mesh.
    pub undrawn: usize,
}

impl Played {
    /// Records what an edit changed.
    fn record(&mut self, receipts: &[Receipt]) {
        let applied = || receipts.iter().filter_map(|receipt| receipt.outcome.as_ref().ok());
        let voxels = |applied: &Applied| applied.removed.total() + applied.added.total();
        self.voxels.push(applied().map(voxels).sum());
        self.unchanged += usize::from(applied().all(|applied| applied.bounds.is_none()));
    }
}

/// Plays edits on a terrain, one transaction each. A timing covers the brush, the commit, and the vertex and index
/// buffers of all changed chunks and tiles.
pub fn hybrid(terrain: &mut Terrain, runner: &Runner, brushes: &[Brush]) -> Result<Played, PaperError> {
    let (mut played, left_before) = (Played::default(), runner.left_over());
    for brush in brushes {
        let (lap, answer) = clock::time(|| -> Result<_, PaperError> {
            terrain.submit(brush);
            let transaction = terrain.begin().ok_or(PaperError::Busy)?;
            let mut commit = runner.run(transaction);
            // The caller owns the meshes now; a game would upload them.
            let meshes = black_box(std::mem::take(&mut commit.meshes));
            Ok((terrain.commit(commit)?, meshes))
        });
        let (receipts, meshes) = answer?;
        played.laps.push(lap);
        played.record(&receipts);
        played.undrawn += usize::from(meshes.chunks.is_empty() && meshes.tiles.is_empty());
    }
    // An edit that changes nothing is not sent to the GPU.
    match runner.left_over() - left_before {
        left if left <= played.undrawn as u64 => Ok(played),
        left => Err(PaperError::LeftTheCard(left)),
    }
}

/// Plays edits on the full field with the hybrid's output: the same transaction, then a rebuild of the whole mesh.
pub fn same(full: &mut FullWorld, brushes: &[Brush]) -> Played {
    let mut played = Played::default();
    for brush in brushes {
        let (lap, receipts) = clock::time(|| full.edit(brush));
        black_box(&mut *full);
        played.laps.push(lap);
        played.record(&receipts);
    }
    played
}

/// Plays edits on the dense field: changes samples, then rebuilds positions and normals of the whole mesh.
pub fn bare(field: &mut DenseField, brushes: &[Brush]) -> Result<Played, PaperError> {
    let mut played = Played::default();
    for brush in brushes {
        let (lap, changed) = clock::time(|| field.edit(brush));
        black_box(&mut *field);
        played.laps.push(lap);
        played.unchanged += usize::from(changed? == 0);
    }
    Ok(played)
}
