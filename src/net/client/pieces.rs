//! Loose pieces that are not part of the shown ground, so that each piece is either ground or debris of the game.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use glam::IVec3;
use rustc_hash::FxHashSet;

use super::{Client, ClientEvent};
use crate::lattice::LatticeBox;
use crate::terrain::{LoosePiece, PieceFate, Receipt, ReturnedPiece, Run};

/// The maximum number of pieces that are remembered.
const MAX_PIECES: usize = 1 << 13;

/// A piece that is out of the ground.
struct Gone {
    piece: ReturnedPiece,
    bounds: LatticeBox,
    runs: Arc<[Run]>,
}

/// Pieces that were reported to the game.
#[derive(Default)]
pub(super) struct Pieces {
    /// Pieces of pending edits, by the numbers of these edits.
    predicted: BTreeMap<u64, Vec<Gone>>,
    /// All other pieces, in the order in which they were cut off.
    gone: VecDeque<Gone>,
}

impl Gone {
    fn of(tag: u64, piece: &LoosePiece) -> Option<Self> {
        let LoosePiece { id, fate, ref materials, bounds, ref runs, .. } = *piece;
        let piece = ReturnedPiece { id, tag, fate, materials: materials.clone() };
        (fate != PieceFate::Left).then(|| Self { piece, bounds, runs: Arc::clone(runs) })
    }

    fn samples(&self) -> impl Iterator<Item = IVec3> {
        self.runs.iter().flat_map(|run| (0..run.len as i32).map(move |x| run.start + IVec3::X * x))
    }

    /// Whether all of its samples are ground.
    fn is_ground(&self, is_solid: impl Fn(IVec3) -> bool) -> bool {
        self.samples().all(is_solid)
    }
}

fn all(receipt: &Receipt) -> impl Iterator<Item = &LoosePiece> {
    receipt.outcome.iter().flat_map(|applied| &applied.loose)
}

impl Pieces {
    fn add(&mut self, gone: impl IntoIterator<Item = Gone>) {
        self.gone.extend(gone);
        let excess = self.gone.len().saturating_sub(MAX_PIECES);
        self.gone.drain(..excess);
    }

    /// Renumbers edits: pairs of old and new sequence numbers.
    pub fn renumber(&mut self, numbers: impl Iterator<Item = (u64, u64)>) {
        let mut before = std::mem::take(&mut self.predicted);
        let renumbered = numbers.filter_map(|(old, new)| Some((new, before.remove(&old)?)));
        self.predicted = renumbered.collect();
    }

    /// The indices of pieces within a box, or of all pieces, whose samples are ground.
    fn ground(&self, within: Option<LatticeBox>, is_solid: impl Fn(IVec3) -> bool) -> BTreeSet<usize> {
        let is_near = |gone: &Gone| within.is_none_or(|within| within.intersection(gone.bounds).is_some());
        let there = |(_, gone): &(usize, &Gone)| is_near(gone) && gone.is_ground(&is_solid);
        self.gone.iter().enumerate().filter(there).map(|(at, _)| at).collect()
    }

    /// Removes pieces that have become ground again. Among pieces with common samples, the one that was cut off last
    /// has returned.
    fn take_ground(&mut self, now: &BTreeSet<usize>, before: &BTreeSet<usize>) -> Vec<ReturnedPiece> {
        let (mut returned, mut taken) = (Vec::new(), FxHashSet::default());
        for &at in now.iter().rev().filter(|at| !before.contains(at)) {
            let Some(gone) = self.gone.get(at) else { continue };
            if gone.samples().all(|sample| !taken.contains(&sample)) {
                taken.extend(gone.samples());
                returned.extend(self.gone.remove(at).map(|gone| gone.piece));
            }
        }
        returned
    }
}

impl Client {
    /// Records the pieces of a predicted edit.
    pub(super) fn predict_pieces(&mut self, sequence: u64, receipt: &Receipt) {
        let gone: Vec<Gone> = all(receipt).filter_map(|piece| Gone::of(receipt.tag, piece)).collect();
        if !gone.is_empty() {
            self.pieces.predicted.insert(sequence, gone);
        }
        self.report_pieces(receipt.tag, all(receipt).cloned().collect(), Vec::new());
    }

    /// The server has ordered an edit; `sequence` is its number if it is one of this client's. Corrects wrong
    /// predictions.
    pub(super) fn confirm_pieces(&mut self, sequence: Option<u64>, receipt: &Receipt) {
        let mut predicted =
            sequence.and_then(|sequence| self.pieces.predicted.remove(&sequence)).unwrap_or_default();
        let mut found = Vec::new();
        for piece in all(receipt) {
            match predicted.iter().position(|gone| gone.piece.id == piece.id && gone.piece.fate == piece.fate)
            {
                Some(at) => drop(predicted.remove(at)),
                None => found.push(piece.clone()),
            }
        }
        let tag = receipt.tag;
        self.pieces.add(all(receipt).filter_map(|piece| Gone::of(tag, piece)));
        self.report_pieces(tag, found, predicted.into_iter().map(|gone| gone.piece).collect());
    }

    /// Returns the pieces of a refused edit.
    pub(super) fn refuse_pieces(&mut self, sequence: u64) {
        let predicted = self.pieces.predicted.remove(&sequence).unwrap_or_default();
        self.report_pieces(0, Vec::new(), predicted.into_iter().map(|gone| gone.piece).collect());
    }

    /// Handles an edit that was answered while the client was disconnected. [`Self::check_pieces`] determines the
    /// result.
    pub(super) fn settle_pieces(&mut self, sequence: u64) {
        let predicted = self.pieces.predicted.remove(&sequence).unwrap_or_default();
        self.pieces.add(predicted);
    }

    /// The pieces within a box, or of all pieces, that are ground before parts are replaced, because a player has built
    /// there.
    pub(super) fn ground_pieces(&self, within: Option<LatticeBox>) -> BTreeSet<usize> {
        if self.pieces.gone.is_empty() {
            return BTreeSet::new();
        }
        let view = self.replica.world().samples();
        self.pieces.ground(within, |sample| view.is_solid(sample))
    }

    /// Checks pieces after parts of the world were replaced, within a box or anywhere. Returns those that are ground
    /// again, except those that were ground [before](Self::ground_pieces).
    pub(super) fn check_pieces(
        &mut self,
        within: Option<LatticeBox>,
        before: &BTreeSet<usize>,
    ) -> Vec<ReturnedPiece> {
        let returned = self.pieces.take_ground(&self.ground_pieces(within), before);
        self.report_pieces(0, Vec::new(), returned.clone());
        returned
    }

    fn report_pieces(&mut self, tag: u64, found: Vec<LoosePiece>, returned: Vec<ReturnedPiece>) {
        if !found.is_empty() || !returned.is_empty() {
            self.events.push(ClientEvent::PiecesChanged { tag, found, returned });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::PieceId;

    fn gone(id: u64, x: i32, len: u32) -> Gone {
        let (fate, start) = (PieceFate::Removed, IVec3::X * x);
        let piece = ReturnedPiece { id: PieceId(id), tag: 0, fate, materials: Default::default() };
        let bounds = LatticeBox { min: start, max: start + IVec3::X * (len as i32 - 1) };
        Gone { piece, bounds, runs: [Run { start, len }].into() }
    }

    fn ids(returned: &[ReturnedPiece]) -> Vec<u64> {
        returned.iter().map(|piece| piece.id.0).collect()
    }

    #[test]
    fn what_comes_back_is_what_was_cut_off_last_and_is_not_built_already() {
        let mut pieces = Pieces::default();
        pieces.add([gone(1, 0, 4), gone(2, 20, 3), gone(3, 2, 4), gone(4, 40, 2)]);
        // Somebody has built where the second was.
        let before = pieces.ground(None, |sample| (20..23).contains(&sample.x));
        let now = pieces.ground(None, |sample| sample.x < 30);
        assert_eq!((before.len(), now.len()), (1, 3));
        assert_eq!(ids(&pieces.take_ground(&now, &before)), [3]);
        let within = LatticeBox { min: IVec3::splat(-1), max: IVec3::splat(1) };
        let now = pieces.ground(Some(within), |_| true);
        assert_eq!(ids(&pieces.take_ground(&now, &BTreeSet::new())), [1]);
        let now = pieces.ground(None, |_| true);
        assert_eq!(ids(&pieces.take_ground(&now, &BTreeSet::new())), [4, 2]);
        assert!(pieces.gone.is_empty());
    }
}
