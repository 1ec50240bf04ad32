//! Requests to a source for columns in rows and lines, clamped to the rim of the world.

use std::ops::Range;

use super::source::ColumnGrid;
use crate::lattice::Column;

/// Coordinates that a source can be asked for at once: a range from `low` on, or one coordinate that all
/// places share.
#[derive(Debug, PartialEq)]
struct Run {
    low: i32,
    count: usize,
    places: Range<usize>,
}

/// Cuts a list of coordinates into runs: equal ones, and ones that are a stride apart.
fn runs(list: &[i32], stride: i32) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (place, &at) in list.iter().enumerate() {
        if let Some(run) = runs.last_mut() {
            let length = run.places.len();
            let is_next = run.count == length
                && i64::from(at) == i64::from(run.low) + i64::from(stride) * length as i64;
            if is_next || run.count == 1 && at == run.low {
                run.count += usize::from(is_next);
                run.places.end = place + 1;
                continue;
            }
        }
        runs.push(Run { low: at, count: 1, places: place..place + 1 });
    }
    runs
}

/// Fills an array over the columns with these coordinates along x and z, x fastest. Asks for grids of one stride.
pub(super) fn fill_columns<T: Copy + Default>(
    [xs, zs]: [&[i32]; 2],
    stride: i32,
    values: &mut [T],
    ask: impl Fn(ColumnGrid, &mut [T]),
) {
    let (runs_x, runs_z) = (runs(xs, stride), runs(zs, stride));
    let mut part = Vec::new();
    for (along_x, along_z) in runs_z.iter().flat_map(|z| runs_x.iter().map(move |x| (x, z))) {
        let low = Column::new(along_x.low, along_z.low);
        let grid = ColumnGrid { low, stride, width: along_x.count, depth: along_z.count };
        if grid.count() == values.len() {
            return ask(grid, values);
        }
        part.clear();
        part.resize(grid.count(), T::default());
        ask(grid, &mut part);
        for (row, z) in along_z.places.clone().enumerate() {
            let row = row.min(grid.depth - 1) * grid.width;
            let own = &mut values[z * xs.len()..][along_x.places.clone()];
            for (place, x) in own.iter_mut().zip(0..) {
                *place = part[row + x.min(grid.width - 1)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn all_columns_are_asked_for(
            xs in prop::collection::vec(-3..9i32, 1..12), zs in prop::collection::vec(-3..9i32, 1..12), stride in 1..4i32,
        ) {
            let word = |column: Column| column.x * 100 + column.z;
            let mut values = vec![0; xs.len() * zs.len()];
            fill_columns([&xs, &zs], stride, &mut values, |grid, values| {
                values.iter_mut().zip(grid.columns()).for_each(|(value, column)| *value = word(column));
            });
            let expected = zs.iter().flat_map(|&z| xs.iter().map(move |&x| word(Column::new(x, z))));
            prop_assert!(values.iter().copied().eq(expected), "{:?}", values);
        }
    }

    #[test]
    fn coordinates_clamped_to_the_rim_are_few_runs() {
        let run = |low, count, places| Run { low, count, places };
        assert_eq!(
            runs(&[0, 0, 0, 1, 5, 9, 12, 12], 4),
            [run(0, 1, 0..3), run(1, 3, 3..6), run(12, 1, 6..8),]
        );
        assert_eq!(runs(&[], 4), []);
    }
}
