//! The model: a world that is edited by ordered transactions. It knows nothing of Bevy's ECS and runs in tests, servers
//! and tools alike.
//!
//! ```
//! use bevy_burrow::prelude::*;
//! use glam::Vec3;
//!
//! let ground = Ground::flat(64, 64, 10.0)?;
//! let mut terrain = Terrain::new(ground, &TerrainSettings::default())?;
//! let receipts = terrain.apply([Brush::dig(Shape::sphere(Vec3::new(32.0, 10.0, 32.0), 4.0))]);
//! assert!(receipts[0].outcome.as_ref().is_ok_and(|applied| applied.removed.total() > 100));
//! assert!(terrain.world().check_seams().is_flawless());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod by_brick;
mod change;
mod commit;
mod dirty;
mod draft;
mod draft_group;
mod drawn_cut;
mod field_log;
#[cfg(feature = "plugin")]
mod for_plugin;
mod ground;
mod groups;
mod heights;
mod history;
mod inspect;
mod known_nodes;
#[cfg(test)]
mod lod_laws;
mod log;
mod loose;
mod model;
mod node_facts;
mod nodes;
#[cfg(test)]
mod order;
mod put;
mod query;
mod queue;
mod ray;
mod receipt;
mod record;
mod redraw;
mod regions;
mod replay;
mod reset;
mod restore;
mod run;
mod settings;
mod stages;
mod steps;
mod submit;
mod surface;
mod surface_draft;
mod tiles;
mod transaction;
mod triangles;
mod unmeshed;
#[cfg(feature = "plugin")]
mod unseen;
mod world;

pub use commit::Commit;
pub use draft::Draft;
pub use drawn_cut::{ChooseCut, DrawnCut, NodeUpdate};
pub use field_log::FieldNews;
#[cfg(feature = "store")]
pub(crate) use ground::brick_over;
pub use history::{History, HistoryReceipt, HistoryRejection, HistoryStep, Restored};
pub use known_nodes::KnownNodes;
pub use loose::{LoosePiece, LooseSettings, PieceFate, PieceId, ReturnedPiece, Run};
pub use model::{StaleCommit, Terrain};
pub use node_facts::GroundFacts;
pub use put::ChangeError;
pub use query::{RayHit, Span};
#[cfg(feature = "plugin")]
pub(crate) use queue::Together;
pub use queue::WorkLimits;
pub use receipt::{Applied, ChunkScenario, Receipt, Rejection, ScenarioCounts};
pub use record::{CommitRecord, LogEntry, SIMULATION, WorldChange, WorldParts};
pub use redraw::MeshUpdates;
pub use replay::{ReplayError, RestoreError};
pub use settings::{TerrainError, TerrainSettings};
pub use stages::Stages;
pub use surface::ChunkSurface;
#[cfg(feature = "plugin")]
pub(crate) use surface_draft::SurfaceDraft;
pub use surface_draft::TileUpdate;
pub use transaction::Transaction;
pub use unmeshed::Meshing;
#[cfg(feature = "plugin")]
pub(crate) use unseen::Unseen;
#[cfg(any(feature = "plugin", test))]
pub(crate) use world::unique;
pub use world::{Drawn, Memory, Version, World};
