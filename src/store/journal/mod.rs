//! The journal: frames of commits in segments, the content that they name, and the marker of unsaved ones.

mod contents;
pub(super) mod segment;
pub(super) mod unsaved;
mod write;

pub(super) use contents::FoundContents;
pub(super) use write::{Journal, Segment};
