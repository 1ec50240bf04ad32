//! How edits change bricks: from edits in a queue to an [`EditDelta`].
//!
//! ```text
//! edits --batches--> independent batches --prepared--> PreparedEdits, sorted by brick
//!   --brick_editor, per brick--> EditDelta --draft--> newer bricks, effects, hash
//! ```
//!
//! Edits that read samples around those they change, such as sculpting or those that [rules](crate::volume::DiggingRules) bear
//! on, take the slower path of `stencil_edit`.

mod batches;
mod brick_editor;
mod delta;
mod draft;
mod jobs;
mod padded_brick;
mod prepared;
mod removal;
mod restore;
mod rule_scope;
mod stencil_edit;

pub(crate) use delta::EditDelta;
#[cfg(feature = "cuda")]
pub(crate) use draft::enter_effects;
pub(crate) use draft::latest;
pub use draft::{ChunkEffect, Draft, DraftedBrick, EditEffect};
pub use prepared::{PreparedEdits, reach};
pub(crate) use removal::{TakenOut, take_out};
pub(crate) use restore::Replaced;
#[cfg(feature = "cuda")]
pub(crate) use rule_scope::RunRules;
#[cfg(feature = "cuda")]
pub(crate) use {jobs::Job, prepared::PreparedEdit};
