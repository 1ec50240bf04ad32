//! Batches: edits of a transaction that may be applied brick by brick.

use std::ops::Range;

use super::prepared_edit::PreparedEdit;

/// The maximum number of edits of a batch in which some edit reads its surroundings, so that comparing each with all
/// others stays cheap.
const LONGEST: usize = 1 << 12;

/// The maximum number of bricks around all edits of a batch, unless it is a single edit: their jobs take 16 MiB.
pub(super) const MAX_BRICKS: u64 = 1 << 20;

/// Splits edits into batches, in order, in which no edit reads what an earlier edit of the batch may write, except for
/// the samples that it changes itself. Digs, adds and paint read nothing else; edits that sculpt, and edits that rules
/// restrict, read what is [around](PreparedEdit::reads) them. A batch also ends before there would be more than `most`
/// bricks around its edits.
pub(super) fn batches(edits: &[PreparedEdit], most: u64) -> Vec<Range<usize>> {
    let mut batches = Vec::new();
    let (mut first, mut bricks) = (0, 0);
    for (number, edit) in edits.iter().enumerate() {
        if edit.reach.is_none() {
            continue;
        }
        let own_bricks = edit.max_bricks;
        bricks += own_bricks;
        let reads_changes = || {
            edit.reads().is_some_and(|around| {
                number - first >= LONGEST
                    || edits[first..number].iter().any(|earlier| earlier.reaches(around))
            })
        };
        if number > first && (bricks > most || reads_changes()) {
            batches.push(first..number);
            (first, bricks) = (number, own_bricks);
        }
    }
    if first < edits.len() {
        batches.push(first..edits.len());
    }
    batches
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Edit, Shape};
    use crate::ground::MaterialId;
    use crate::lattice::ChunkGrid;

    /// Where batches begin of edits that no rule restricts.
    fn begins(brushes: &[Brush], most: u64) -> Vec<usize> {
        let grid = ChunkGrid::new(32, 400, 400);
        let prepared = |brush| PreparedEdit::new(grid, &Edit::quantize(brush).unwrap(), None);
        let edits: Vec<PreparedEdit> = brushes.iter().map(prepared).collect();
        let batches = batches(&edits, most);
        // Each ends where the next one begins.
        assert!(batches.windows(2).all(|pair| pair[0].end == pair[1].start));
        assert_eq!(batches.last().map_or(0, |batch| batch.end), edits.len());
        batches.into_iter().map(|batch| batch.start).collect()
    }

    #[test]
    fn an_edit_that_sculpts_follows_all_that_it_reads() {
        let at = |x: f32| Shape::sphere(Vec3::new(x, 0.0, 50.0), 4.0);
        let of = |brushes: &[Brush]| begins(brushes, MAX_BRICKS);
        let (dig, smooth) = (|x| Brush::dig(at(x)), |x| Brush::smooth(at(x), 1.0));
        assert!(of(&[]).is_empty());
        assert_eq!(of(&vec![dig(50.0); 9000]), [0]);
        // Side by side: none reads what another one changes.
        assert_eq!(of(&[smooth(20.0), dig(60.0), smooth(100.0), dig(20.0), dig(100.0)]), [0]);
        assert_eq!(of(&[dig(20.0), smooth(25.0), dig(25.0), smooth(90.0), smooth(20.0)]), [0, 1, 4]);
        assert_eq!(of(&[smooth(20.0), smooth(20.0), smooth(20.0)]), [0, 1, 2]);
        // Without a material, new ground searches 64 voxels down and up for one.
        let above = Shape::sphere(Vec3::new(20.0, 60.0, 50.0), 4.0);
        assert_eq!(of(&[dig(20.0), Brush::raise(above, 1.0)]), [0, 1]);
        assert_eq!(of(&[dig(20.0), Brush::raise(above, 1.0).with_material(MaterialId(1))]), [0]);
        // Outside the world nothing is changed.
        assert_eq!(of(&[smooth(-90.0), dig(-90.0), smooth(-90.0), smooth(3.0)]), [0]);
    }

    #[test]
    fn a_batch_ends_where_too_many_bricks_lie_around_its_edits() {
        // Six voxels around a point whose numbers are multiples of 8: two bricks along each side.
        let dig = |x: f32| Brush::dig(Shape::sphere(Vec3::new(x, 0.0, 48.0), 4.0));
        let eight = [16.0, 16.0, 48.0, 80.0, -90.0, 16.0, 16.0, 16.0].map(dig);
        assert_eq!(begins(&eight, 7 * 8), [0]);
        assert_eq!(begins(&eight, 3 * 8), [0, 3, 7]);
        assert_eq!(begins(&eight, 3 * 8 - 1), [0, 2, 5, 7]);
        // A single edit that exceeds the limit.
        assert_eq!(begins(&eight, 0), [0, 1, 2, 3, 5, 6, 7]);
        assert_eq!(begins(&[dig(-90.0), dig(16.0), dig(16.0)], 8), [0, 2]);
        // Large balls, some at a time.
        let ball = Brush::dig(Shape::sphere(Vec3::splat(200.0), 190.0));
        assert_eq!(begins(&vec![ball; 30], MAX_BRICKS), [0, 8, 16, 24]);
    }
}
