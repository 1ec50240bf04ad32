//! Applies edits to bricks: from queued edits to new bricks, with the effect of each edit.
//!
//! ```text
//! edits --batches--> batches of independent edits --jobs--> PreparedEdits, sorted by brick
//!   --brick_editor, per brick--> EditDelta --drafter--> new bricks, effects, hash
//! ```
//!
//! Edits that read samples around those they change, such as sculpting or those that
//! [rules](crate::volume::DiggingRules) restrict, take the slower path of `stencil_edit`; all others are applied row by
//! row by `plain_edit`. A reset, which takes bricks away, goes none of these ways: see `reset`. Nor does a paste,
//! which looks its samples up: see `paste`.

mod batches;
mod brick_editor;
mod count_replaced;
mod delta;
mod drafter;
mod effect;
mod jobs;
mod padded_brick;
mod paste;
mod plain_edit;
mod prepared;
mod prepared_edit;
mod removal;
mod reset;
mod rule_scope;
mod stencil_edit;
mod surface_distance;

pub(crate) use count_replaced::count_replaced;
pub(crate) use delta::EditDelta;
#[cfg(feature = "cuda")]
pub(crate) use delta::enter_effects;
pub(crate) use drafter::{Draft, Drafter, latest};
pub(crate) use effect::{DraftedBrick, EditEffect, MergedBricks, Overlay};
#[cfg(feature = "cuda")]
pub(crate) use jobs::Job;
pub(crate) use prepared::PreparedEdits;
#[cfg(feature = "net")]
pub(crate) use prepared_edit::max_read_around;
pub(crate) use prepared_edit::{EDIT_WORK, edit_work, max_bricks, reach};
pub(crate) use removal::take_out;
pub(crate) use reset::{ResetBrick, edited_within, reset};
#[cfg(feature = "cuda")]
pub(crate) use {prepared_edit::PreparedEdit, rule_scope::BatchRules};
