//! Errors of the experiment.

use std::io;
use std::path::PathBuf;

use bevy_burrow::brush::BrushError;
use bevy_burrow::dense::DenseGridError;
use bevy_burrow::ground::GroundError;
use bevy_burrow::terrain::{StaleCommit, TerrainError};

use crate::backend::NoBackend;

/// Why there are no results.
#[derive(Debug, thiserror::Error)]
pub enum PaperError {
    #[error(transparent)]
    Ground(#[from] GroundError),
    #[error(transparent)]
    Terrain(#[from] TerrainError),
    #[error(transparent)]
    Brush(#[from] BrushError),
    #[error(transparent)]
    Grid(#[from] DenseGridError),
    #[error(transparent)]
    Backend(#[from] NoBackend),
    #[error("{0} stages of a run on the GPU were done by the CPU: it failed, or had no memory left")]
    LeftTheCard(u64),
    #[error(transparent)]
    Stale(#[from] StaleCommit),
    #[error("a terrain had no transaction to begin")]
    Busy,
    #[error("{0}: a repeat gave another result than the one before")]
    Unrepeatable(String),
    #[error(transparent)]
    Threads(#[from] rayon::ThreadPoolBuildError),
    #[error("a plot could not be drawn: {0}")]
    Plot(String),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    #[error("{0}")]
    Faults(String),
    #[error("{}: {reason}", path.display())]
    Write { path: PathBuf, reason: io::Error },
}
