//! Which edits of a transaction may be applied brick by brick.

use std::ops::Range;

use super::jobs::bricks_around;
use super::stencil_edit::reads;
use crate::brush::Edit;
use crate::lattice::LatticeBox;

/// Most edits of a run that has one which sculpts, so that comparing each with all others stays cheap.
const LONGEST: usize = 1 << 12;

/// Most bricks around all edits of a run, unless it is a single one: so many jobs take 16 MiB.
pub(super) const MOST_BRICKS: u64 = 1 << 20;

/// Where an edit changes samples.
pub(super) struct EditScope {
    /// The part of its reach that lies in the world.
    pub reach: Option<LatticeBox>,
    /// May some rule be against it?
    pub is_bound: bool,
}

/// Cuts edits of these scopes into runs, in order. In each, all that an edit reads but the samples it changes itself is as
/// it was before the run: digs, adds and paint look at nothing else, and one that sculpts begins a new run where it would
/// read what an earlier edit of the run may change. So does every edit that rules bear on: those are bound. One with which
/// there would be more than `most` bricks around the edits of a run begins a new one too.
pub(super) fn runs(edits: &[&Edit], scopes: &[EditScope], most: u64) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let (mut first, mut bricks) = (0, 0);
    for (number, (edit, scope)) in edits.iter().zip(scopes).enumerate() {
        let Some(own) = scope.reach else { continue };
        let own_bricks = bricks_around(own).volume();
        bricks += own_bricks;
        let is_disturbed = || {
            let around = reads(edit.sculptor().as_ref(), scope.is_bound, own);
            let mut earlier = scopes[first..number].iter().filter_map(|scope| scope.reach);
            around.is_some_and(|around| {
                number - first >= LONGEST || earlier.any(|earlier| earlier.intersection(around).is_some())
            })
        };
        if number > first && (bricks > most || is_disturbed()) {
            runs.push(first..number);
            (first, bricks) = (number, own_bricks);
        }
    }
    if first < edits.len() {
        runs.push(first..edits.len());
    }
    runs
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::edits::reach;
    use crate::ground::MaterialId;
    use crate::lattice::ChunkGrid;

    /// Where runs begin of edits that no rule bears on.
    fn begins(brushes: &[Brush], most: u64) -> Vec<usize> {
        let grid = ChunkGrid::new(32, 400, 400);
        let edits: Vec<Edit> = brushes.iter().map(|brush| Edit::quantize(brush).unwrap()).collect();
        let scope = |edit| EditScope { reach: reach(grid, edit), is_bound: false };
        let scopes: Vec<EditScope> = edits.iter().map(scope).collect();
        let runs = runs(&edits.iter().collect::<Vec<_>>(), &scopes, most);
        // Each ends where the next one begins.
        assert!(runs.windows(2).all(|pair| pair[0].end == pair[1].start));
        assert_eq!(runs.last().map_or(0, |run| run.end), edits.len());
        runs.into_iter().map(|run| run.start).collect()
    }

    #[test]
    fn an_edit_that_sculpts_follows_all_that_it_reads() {
        let at = |x: f32| Shape::sphere(Vec3::new(x, 0.0, 50.0), 4.0);
        let of = |brushes: &[Brush]| begins(brushes, MOST_BRICKS);
        let (dig, smooth) = (|x| Brush::dig(at(x)), |x| Brush::smooth(at(x), 1.0));
        assert!(of(&[]).is_empty());
        assert_eq!(of(&vec![dig(50.0); 9000]), [0]);
        // Side by side: none reads what another one changes.
        assert_eq!(of(&[smooth(20.0), dig(60.0), smooth(100.0), dig(20.0), dig(100.0)]), [0]);
        assert_eq!(of(&[dig(20.0), smooth(25.0), dig(25.0), smooth(90.0), smooth(20.0)]), [0, 1, 4]);
        assert_eq!(of(&[smooth(20.0), smooth(20.0), smooth(20.0)]), [0, 1, 2]);
        // New ground looks for its material 64 voxels down and up, unless it is told one.
        let above = Shape::sphere(Vec3::new(20.0, 60.0, 50.0), 4.0);
        assert_eq!(of(&[dig(20.0), Brush::raise(above, 1.0)]), [0, 1]);
        assert_eq!(of(&[dig(20.0), Brush::raise(above, 1.0).with_material(MaterialId(1))]), [0]);
        // Outside the world nothing is changed.
        assert_eq!(of(&[smooth(-90.0), dig(-90.0), smooth(-90.0), smooth(3.0)]), [0]);
    }

    #[test]
    fn a_run_ends_where_too_many_bricks_lie_around_its_edits() {
        // Six voxels around a point whose numbers are multiples of 8: two bricks along each side.
        let dig = |x: f32| Brush::dig(Shape::sphere(Vec3::new(x, 0.0, 48.0), 4.0));
        let eight = [16.0, 16.0, 48.0, 80.0, -90.0, 16.0, 16.0, 16.0].map(dig);
        assert_eq!(begins(&eight, 7 * 8), [0]);
        assert_eq!(begins(&eight, 3 * 8), [0, 3, 7]);
        assert_eq!(begins(&eight, 3 * 8 - 1), [0, 2, 5, 7]);
        // One that is too large by itself.
        assert_eq!(begins(&eight, 0), [0, 1, 2, 3, 5, 6, 7]);
        assert_eq!(begins(&[dig(-90.0), dig(16.0), dig(16.0)], 8), [0, 2]);
        // Large balls, some at a time.
        let ball = Brush::dig(Shape::sphere(Vec3::splat(200.0), 190.0));
        assert_eq!(begins(&vec![ball; 30], MOST_BRICKS), [0, 8, 16, 24]);
    }
}
