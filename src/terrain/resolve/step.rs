//! A step through history: puts back the bricks, fields and mask of another time.

use super::replacement::Replacement;
use super::resolved::Resolved;
use crate::loose::ReturnedPiece;
use crate::redraw::{Scene, Stages};
use crate::terrain::history::{Step, UndoDelta};
use crate::terrain::receipt::{Applied, OrderKind, Receipt};

/// Resolves a step through history.
pub(super) fn step(scene: Scene, kind: OrderKind, target: &UndoDelta) -> Resolved {
    let mut change = target.change.clone();
    // A stroke's parts are in the order of its commits.
    change.sort();
    let (tags, pieces) = (target.tags.clone(), target.pieces.clone());
    let replacement = Replacement::new(scene, change, true, Stages::default());
    let (resolved, applied) = replacement.resolve(target.group, (tags.clone(), pieces.clone()));
    let (returned, cut_again) = match Step::of(kind) {
        Some(Step::Undo) => {
            (pieces.iter().map(|(tag, piece)| ReturnedPiece::new(*tag, piece)).collect(), Vec::new())
        }
        _ => (Vec::new(), pieces),
    };
    let applied = Applied { tags, returned, cut_again, ..applied };
    resolved.with_receipt(Receipt::of(kind, Ok(applied)))
}
