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

mod commit;
mod commit_light;
mod draft;
mod edit_settings;
#[cfg(feature = "net")]
mod for_net;
#[cfg(feature = "plugin")]
mod for_plugin;
mod history;
mod keep_log;
#[cfg(test)]
mod lod_laws;
mod log;
mod model;
mod order;
#[cfg(test)]
mod order_laws;
mod parts_error;
#[cfg(feature = "plugin")]
mod pending_display;
mod queue;
mod receipt;
mod record;
mod replay;
mod resolve;
mod run;
mod steps;
mod submit;
mod transaction;
mod work;

pub use crate::loose::{LoosePiece, LooseSettings, PieceFate, PieceId, ReturnedPiece, Run};
#[cfg(feature = "plugin")]
pub(crate) use crate::redraw::SurfaceDraft;
#[doc(hidden)]
pub use crate::redraw::{
    ChooseCut, DrawnCut, GroundFacts, KnownNodes, MeshUpdates, NodeUpdate, Stages, TileUpdate,
};
#[doc(hidden)]
pub use crate::surface::ChunkSurface;
#[cfg(feature = "store")]
pub(crate) use crate::world::brick_over;
#[cfg(any(feature = "plugin", test))]
pub(crate) use crate::world::unique;
pub use crate::world::{
    GlbError, Memory, Meshing, Patch, RayHit, Span, SplatMaps, TerrainError, TerrainSettings, World,
};
#[doc(hidden)]
pub use crate::world::{MeshKey, Version};
pub use commit::Commit;
#[doc(hidden)]
pub use draft::Draft;
#[doc(hidden)]
pub use edit_settings::EditSettings;
pub use history::History;
pub use model::{StaleCommit, Terrain};
pub use order::{Order, Request};
pub use parts_error::PartsError;
#[cfg(feature = "plugin")]
pub(crate) use pending_display::PendingDisplay;
#[cfg(feature = "plugin")]
pub(crate) use queue::Together;
pub use queue::WorkLimits;
pub use receipt::{Applied, ChunkScenario, OrderKind, Receipt, Rejection, ScenarioCounts};
pub use record::CommitRecord;
#[doc(hidden)]
pub use record::WorldParts;
pub use replay::{ReplayError, RestoreError};
#[doc(hidden)]
pub use resolve::FieldChange;
pub use transaction::Transaction;
