//! From what was asked to what changes: edits, steps through history, replaced parts, another ground.

mod draft_group;
mod edits;
mod field_log;
mod ground;
mod parts;
mod reset;
mod step;

pub(crate) use edits::edit;
pub use field_log::FieldNews;
pub use parts::ChangeError;
pub(crate) use parts::{Put, check_number, put};
pub(crate) use reset::commit as reset;
pub(crate) use step::step;
