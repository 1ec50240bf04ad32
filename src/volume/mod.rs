//! What edits made of the world: samples in bricks, fields in chunks.
//!
//! Only edited samples are stored (rule 1); the rest of the world is computed from the [`Ground`](crate::ground::Ground)
//! whenever it is asked for. Bricks lie on the world's own grid and hold each sample once, so chunks that share a face
//! read the same numbers there, and the samples of a world do not depend on its chunk size.

mod bearing;
mod brick;
mod careful;
mod draft;
mod field;
mod jobs;
mod ledger;
mod removal;
mod restore;
mod rules;
mod runs;
mod surroundings;
mod tally;
mod view;
mod work;
mod workpiece;

#[cfg(feature = "cuda")]
pub(crate) use bearing::RunRules;
pub use brick::{Brick, Layers, Sample, UniformBricks};
pub(crate) use brick::{PRISTINE, row};
#[cfg(feature = "cuda")]
pub(crate) use draft::enter_effects;
pub(crate) use draft::latest;
pub use draft::{ChunkEffect, Draft, DraftedBrick, EditEffect};
pub use field::{Absorbed, Field, FieldId, Fields, Scenario};
#[cfg(feature = "cuda")]
pub(crate) use ledger::Fate;
pub(crate) use ledger::Ledger;
pub(crate) use removal::{TakenOut, pristine_layers, take_out};
pub(crate) use restore::{Replaced, pristine_brick};
pub use rules::{DiggingRules, Refused, RulesError};
pub use tally::Tally;
pub use view::{Bricks, SampleView};
pub use work::{EditWork, reach};
#[cfg(feature = "cuda")]
pub(crate) use {jobs::Job, work::Tool};
