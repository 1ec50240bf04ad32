//! Plays the edits of one run and takes the time of each, as the paper did: from the start of an edit until its meshes
//! are ready. Nothing else happens in between.

use std::hint::black_box;
use std::time::Instant;

use bevy_burrow::brush::Brush;
use bevy_burrow::terrain::{Terrain, TerrainSettings};

use crate::PaperError;
use crate::backend::Runner;
use crate::edits::Scene;
use crate::full::FullField;

/// What came of a run.
#[derive(Clone, Debug, Default)]
pub struct Played {
    /// Seconds that each edit took.
    pub seconds: Vec<f64>,
    /// Edits that changed no sample.
    pub unchanged: usize,
    /// Edits that changed no mesh.
    pub undrawn: usize,
}

/// A terrain that nobody has edited.
pub fn terrain(scene: &Scene, chunk_size: u32) -> Result<Terrain, PaperError> {
    let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
    Ok(Terrain::new(scene.ground.clone(), &settings)?)
}

/// Plays edits on a terrain, one transaction each: brush in, world committed, vertex and index buffers of all changed
/// chunks and tiles in hand.
pub fn hybrid(terrain: &mut Terrain, runner: &mut Runner, brushes: &[Brush]) -> Result<Played, PaperError> {
    let mut played = Played::default();
    for brush in brushes {
        let start = Instant::now();
        terrain.submit(brush);
        let transaction = terrain.begin().ok_or(PaperError::Busy)?;
        let mut commit = runner(transaction);
        // The caller's now; a game uploads them.
        let meshes = black_box(std::mem::take(&mut commit.meshes));
        let receipts = terrain.commit(commit)?;
        played.seconds.push(start.elapsed().as_secs_f64());

        let changed = |outcome: &Result<_, _>| {
            outcome.as_ref().is_ok_and(|applied: &bevy_burrow::terrain::Applied| applied.bounds.is_some())
        };
        played.unchanged += usize::from(!receipts.iter().any(|receipt| changed(&receipt.outcome)));
        played.undrawn += usize::from(meshes.chunks.is_empty() && meshes.tiles.is_empty());
    }
    Ok(played)
}

/// Plays edits on the full field: samples changed, the whole mesh made again.
pub fn full(field: &mut FullField, brushes: &[Brush]) -> Result<Played, PaperError> {
    let mut played = Played::default();
    for brush in brushes {
        let start = Instant::now();
        let changed = field.edit(brush)?;
        black_box(&mut *field);
        played.seconds.push(start.elapsed().as_secs_f64());
        played.unchanged += usize::from(changed == 0);
    }
    Ok(played)
}
