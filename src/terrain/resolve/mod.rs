//! Resolves work into changes: edits, steps through history, replaced parts, another ground.

mod draft_group;
mod edits;
mod field_log;
mod parts;
mod reset;
mod resolved;
mod step;

pub(crate) use edits::edits;
pub use field_log::FieldNews;
pub(crate) use parts::{parts, world_of};
pub(crate) use resolved::{Resolved, patch_of};
pub(crate) use step::step;
