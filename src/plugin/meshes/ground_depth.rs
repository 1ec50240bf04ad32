//! How deep vertices lie below the surface that was there before anyone dug.

use bevy::math::IVec3;

use crate::ground::Ground;
use crate::lattice::{Column, ONE, SNAP};

/// How many voxels a vertex, in 1/4096 voxel of the terrain, lies below the pristine surface; above it less than 0. It
/// depends on the position alone, so both sides of a seam get the same bits.
pub(super) fn depth(place: IVec3, height: impl Fn(Column) -> i32) -> f32 {
    let column = Column::new(place.x.div_euclid(SNAP), place.z.div_euclid(SNAP));
    // A vertex lies on an edge of the lattice, so only one of these is not 0, or on a cell's diagonal, where both are
    // equal.
    let (x, z) = (place.x.rem_euclid(SNAP), place.z.rem_euclid(SNAP));
    let next = column.offset(i32::from(x > 0), i32::from(z > 0));
    let here = i64::from(height(column));
    // Nearly all vertices lie over a column.
    let there = if next == column { here } else { i64::from(height(next)) };
    let height = here * i64::from(SNAP) + (there - here) * i64::from(x.max(z));
    (height - i64::from(place.y) * i64::from(ONE)) as f32 / (SNAP * ONE) as f32
}

/// Where the heights of the pristine surface come from.
pub(super) enum Heights {
    Ground,
    Node(NodeHeights),
}

/// Heights of a node's columns.
pub(super) struct NodeHeights {
    low: Column,
    high: Column,
    stride: i32,
    width: usize,
    heights: Vec<i32>,
}

impl NodeHeights {
    /// Computes the heights of columns from `low` to `high`, both included.
    pub fn new(ground: &Ground, (low, high): (Column, Column), stride: i32) -> Self {
        let count = |low: i32, high: i32| ((high - low).max(0) as usize).div_ceil(stride as usize) + 1;
        let [width, depth] = [count(low.x, high.x), count(low.z, high.z)];
        Self { low, high, stride, width, heights: ground.page_heights(low, stride, [width, depth]) }
    }

    /// The height over any column.
    pub fn height(&self, ground: &Ground, column: Column) -> i32 {
        // The last column may lie nearer, at the rim.
        let place = |at: i32, low: i32, high: i32| {
            let is_drawn = (low..=high).contains(&at) && ((at - low) % self.stride == 0 || at == high);
            is_drawn.then(|| ((at - low) as usize).div_ceil(self.stride as usize))
        };
        let x = place(column.x, self.low.x, self.high.x);
        let known = x.zip(place(column.z, self.low.z, self.high.z));
        let known = known.and_then(|(x, z)| self.heights.get(z * self.width + x));
        known.copied().unwrap_or_else(|| ground.lone_height(column))
    }
}
