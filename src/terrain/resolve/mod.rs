//! Resolves orders into changes: edits, steps through history, replaced parts, another ground.

use web_time::Instant;

use crate::brush::Kind;
use crate::redraw::Scene;
use crate::terrain::history::UndoDelta;
use crate::terrain::order::Order;
use crate::terrain::queue::Submission;

mod draft_group;
mod edits;
mod field_log;
mod parts;
mod replacement;
mod reset;
mod resolved;
mod step;

pub use field_log::FieldChange;
pub(crate) use parts::world_of;
pub(crate) use resolved::{Outcome, Resolved};

/// Resolves the orders of a transaction: edits, or one order of another kind; `target` is the content that a step
/// through history restores.
pub(super) fn orders(scene: Scene, submissions: &[Submission], target: Option<&UndoDelta>) -> Resolved {
    let start = Instant::now();
    let single = match submissions {
        [own] => own.order.as_ref().ok().map(|order| (own, order)),
        _ => None,
    };
    let mut resolved = match (single, target) {
        (Some((_, Order::Parts { change, hash })), _) => parts::parts(scene, change, *hash),
        (Some((_, Order::Ground(ground))), _) => parts::ground(scene, ground),
        (Some((own, Order::Edit(edit))), _) if edit.kind() == Kind::Reset => reset::reset(scene, own, edit),
        (Some((_, step)), Some(target)) => step::step(scene, step.kind(), target),
        _ => edits::edits(scene, submissions),
    };
    resolved.stages.whole = start.elapsed();
    resolved
}
