//! A height source placed inside a rectangle of another one, with blended edges.

use super::{ColumnGrid, HeightSource};
use crate::ground::material::ColumnMaterial;
use crate::lattice::Column;
use crate::lattice::hash::hash_words;

/// Bits of the share of the inner source.
const SHARE_BITS: u32 = 12;

/// A source inside a rectangle, and another one around it: a surveyed landscape with noise to the horizon.
///
/// Along the rectangle's rim, heights are blended smoothly, in integers, over a margin that lies inside it. The inner
/// source gets columns relative to the rectangle's lowest one.
pub struct InsetSource<Inner, Outer> {
    inner: Inner,
    outer: Outer,
    low: Column,
    size: [i32; 2],
    margin: i32,
}

impl<Inner: HeightSource, Outer: HeightSource> InsetSource<Inner, Outer> {
    /// Uses `inner` for the columns from `low` to `low + size`, both included, and `outer` around them. At the
    /// rectangle's rim heights are those of `outer`; `margin` voxels farther inside they are those of `inner`. With a
    /// margin of 0 the edge is sharp. Negative sizes and margins count as 0.
    pub fn new(inner: Inner, outer: Outer, low: Column, size: [i32; 2], margin: i32) -> Self {
        Self { inner, outer, low, size: size.map(|cells| cells.max(0)), margin: margin.max(0) }
    }

    /// The share of the inner source in a column, in 1/4096; 0 outside the rectangle.
    fn share(&self, column: Column) -> i64 {
        let along = |at: i32, low: i32, size: i32| {
            let at = i64::from(at) - i64::from(low);
            at.min(i64::from(size) - at)
        };
        let [width, depth] = self.size;
        let inside = along(column.x, self.low.x, width).min(along(column.z, self.low.z, depth));
        let (whole, margin) = (1 << SHARE_BITS, i64::from(self.margin));
        if inside < 0 {
            0
        } else if inside >= margin {
            whole
        } else {
            let t = inside * whole / margin;
            (t * t * (3 * whole - 2 * t)) >> (2 * SHARE_BITS)
        }
    }

    /// The part of a grid that lies in the rectangle, as the inner source counts its columns; and where it begins in
    /// the grid.
    fn inside(&self, grid: ColumnGrid) -> Option<(ColumnGrid, [usize; 2])> {
        let range = |count: usize, low: i32, size: i32, from: i32| {
            let (stride, ahead) = (i64::from(grid.stride.max(1)), i64::from(low) - i64::from(from));
            let start =
                (ahead.max(0).unsigned_abs().div_ceil(stride.unsigned_abs()) as i64).min(count as i64);
            let end = ((ahead + i64::from(size)).div_euclid(stride) + 1).clamp(start, count as i64);
            start as usize..end as usize
        };
        let x = range(grid.width, self.low.x, self.size[0], grid.low.x);
        let z = range(grid.depth, self.low.z, self.size[1], grid.low.z);
        let start = [x.start, z.start];
        let part = grid.part(x, z);
        let low = Column::new(part.low.x.saturating_sub(self.low.x), part.low.z.saturating_sub(self.low.z));
        (part.count() > 0).then_some((ColumnGrid { low, ..part }, start))
    }

    /// Fills a grid with the results of `blend`, which gets the values of both sources and the share of the inner one.
    fn fill<T: Copy + Default>(
        &self,
        grid: ColumnGrid,
        own: &mut [T],
        of_inner: impl Fn(ColumnGrid, &mut [T]),
        of_outer: impl Fn(ColumnGrid, &mut [T]),
        blend: impl Fn(T, T, i64) -> T,
    ) {
        let whole = 1 << SHARE_BITS;
        let inside = self.inside(grid);
        let is_whole = |(part, _): &(ColumnGrid, _)| {
            let ends = [(0, 0), (grid.width - 1, grid.depth - 1)].map(|(x, z)| grid.column(x, z));
            part.count() == grid.count() && ends.iter().all(|&end| self.share(end) == whole)
        };
        match inside.filter(is_whole) {
            Some((part, _)) => of_inner(part, own),
            None => of_outer(grid, own),
        }
        let Some((part, [x, z])) = inside.filter(|inside| !is_whole(inside)) else { return };
        let mut inner = vec![T::default(); part.count()];
        of_inner(part, &mut inner);
        for (row, z) in inner.chunks_exact(part.width).zip(z..) {
            let places = own.iter_mut().skip(z * grid.width + x);
            for ((place, &inner), x) in places.zip(row).zip(x..) {
                *place = blend(*place, inner, self.share(grid.column(x, z)));
            }
        }
    }
}

impl<Inner: HeightSource, Outer: HeightSource> HeightSource for InsetSource<Inner, Outer> {
    fn id(&self) -> u64 {
        let numbers = [self.low.x, self.low.z, self.size[0], self.size[1], self.margin];
        let words = numbers.map(|number| u64::from(number.cast_unsigned()));
        hash_words([0x696e_7365, self.inner.id(), self.outer.id()].into_iter().chain(words))
    }

    fn bounds(&self) -> (i32, i32) {
        let (inner, outer) = (self.inner.bounds(), self.outer.bounds());
        (inner.0.min(outer.0), inner.1.max(outer.1))
    }

    fn fill_heights(&self, grid: ColumnGrid, heights: &mut [i32]) {
        let inner = |grid, heights: &mut [i32]| self.inner.fill_heights(grid, heights);
        let outer = |grid, heights: &mut [i32]| self.outer.fill_heights(grid, heights);
        self.fill(grid, heights, inner, outer, |outer, inner, share| {
            let (from, to) = (i64::from(outer), i64::from(inner));
            (from + (((to - from) * share) >> SHARE_BITS)) as i32
        });
    }

    fn has_materials(&self) -> bool {
        self.inner.has_materials() || self.outer.has_materials()
    }

    fn fill_materials(&self, grid: ColumnGrid, materials: &mut [ColumnMaterial]) {
        let inner = |grid, materials: &mut [ColumnMaterial]| self.inner.fill_materials(grid, materials);
        let outer = |grid, materials: &mut [ColumnMaterial]| self.outer.fill_materials(grid, materials);
        let half = 1 << (SHARE_BITS - 1);
        self.fill(
            grid,
            materials,
            inner,
            outer,
            |outer, inner, share| if share >= half { inner } else { outer },
        );
    }

    fn bytes(&self) -> usize {
        self.inner.bytes() + self.outer.bytes()
    }
}
