//! Which edits of a transaction may be applied brick by brick.

use std::ops::Range;

use super::careful::reads;
use super::work::reach;
use crate::brush::Edit;
use crate::lattice::{ChunkGrid, LatticeBox};

/// Most edits of a run that has one which sculpts, so that comparing each with all others stays cheap.
const LONGEST: usize = 1 << 12;

/// Cuts edits into runs, in order. In each, all that an edit reads but the samples it changes itself is as it was before
/// the run: digs, adds and paint look at nothing else, and one that sculpts begins a new run where it would read what an
/// earlier edit of the run may change. So does every edit that rules bear on: those are `bound`.
pub(super) fn runs(grid: ChunkGrid, edits: &[&Edit], bound: &[bool]) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut first = 0;
    let mut reaches: Vec<LatticeBox> = Vec::new();
    // Nothing is looked up while nothing sculpts.
    let mut is_known = 0;
    for (number, (edit, &is_bound)) in edits.iter().zip(bound).enumerate() {
        let sculptor = edit.sculptor();
        if sculptor.is_none() && !is_bound {
            continue;
        }
        let around = reach(grid, edit).and_then(|own| reads(sculptor.as_ref(), is_bound, own));
        let Some(around) = around else { continue };
        reaches.extend(edits[is_known.max(first)..number].iter().filter_map(|edit| reach(grid, edit)));
        is_known = number;
        let is_disturbed = || reaches.iter().any(|earlier| earlier.intersection(around).is_some());
        if number > first && (number - first >= LONGEST || is_disturbed()) {
            runs.push(first..number);
            first = number;
            reaches.clear();
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
    use crate::ground::MaterialId;

    #[test]
    fn an_edit_that_sculpts_follows_all_that_it_reads() {
        let grid = ChunkGrid::new(32, 400, 400);
        let at = |x: f32| Shape::sphere(Vec3::new(x, 0.0, 50.0), 4.0);
        let of = |brushes: &[Brush]| {
            let edits: Vec<Edit> = brushes.iter().map(|brush| Edit::quantize(brush).unwrap()).collect();
            let runs = runs(grid, &edits.iter().collect::<Vec<_>>(), &vec![false; edits.len()]);
            // Each ends where the next one begins.
            assert!(runs.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert_eq!(runs.last().map_or(0, |run| run.end), edits.len());
            runs.into_iter().map(|run| run.start).collect::<Vec<_>>()
        };
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
}
