//! The input for the meshes of a cut.

use std::ops::Range;

use glam::IVec3;

use super::near_bricks::Stacks;
use crate::ground::Ground;
use crate::lattice::{Column, ONE};
use crate::lod::Cut;
use crate::surface::vertex::WorldView;

/// A world, and the cut by which it is drawn.
#[derive(Clone, Copy)]
pub struct LodView<'a> {
    /// Samples, mask and rim.
    pub world: WorldView<'a>,
    /// The nodes.
    pub cut: &'a Cut,
    /// Where bricks are.
    pub stacks: Stacks<'a>,
    /// A rule that is broken.
    #[cfg(test)]
    pub(crate) fault: Option<super::Fault>,
}

impl<'a> LodView<'a> {
    /// A world drawn by a cut.
    pub fn new(world: WorldView<'a>, cut: &'a Cut, stacks: Stacks<'a>) -> Self {
        Self {
            world,
            cut,
            stacks,
            #[cfg(test)]
            fault: None,
        }
    }

    pub(super) fn ground(&self) -> &'a Ground {
        self.world.samples.ground()
    }

    /// The world's last column.
    pub(super) fn last(&self) -> Column {
        Column::new(self.world.grid.width(), self.world.grid.depth())
    }

    /// Rule 9: a lattice point is drawn at the rim at most.
    pub(super) fn drawn(&self, point: IVec3) -> IVec3 {
        let last = self.last();
        IVec3::new(point.x.min(last.x), point.y, point.z.min(last.z))
    }

    /// Returns `true` if a sample was edited. Beyond the rim, that of the rim's column.
    pub(super) fn is_edited(&self, point: IVec3) -> bool {
        self.world.samples.is_edited(self.drawn(point))
    }

    /// Returns `true` if a sample is solid. Beyond the rim, that of the rim's column.
    pub(super) fn is_solid(&self, point: IVec3) -> bool {
        self.world.samples.is_solid(self.drawn(point))
    }

    /// Whether a sample was edited, and whether it is solid.
    pub(super) fn state(&self, point: IVec3) -> (bool, bool) {
        let drawn = self.drawn(point);
        match self.world.samples.sample(drawn).distance() {
            Some(distance) => (true, distance < 0),
            None => (false, self.ground().distance(drawn) < 0),
        }
    }

    /// The level of the node that draws a cell; `None` outside the world.
    pub(super) fn level_at(&self, cell: Column) -> Option<u8> {
        let grid = self.world.grid;
        grid.has_cell(cell)
            .then(|| self.cut.node_at(grid.tile_of_cell(cell)))
            .flatten()
            .map(|node| node.level)
    }

    /// Lattice y of the lowest points of the cubes of this stride that the pristine surface crosses over some columns;
    /// they end at the end of the range. A height on a lattice point counts below it.
    pub(super) fn sheet(&self, columns: &[Column], stride: i32) -> Range<i32> {
        let heights = columns.iter().map(|&column| self.ground().height(column));
        let (low, high) = heights.fold((i32::MAX, i32::MIN), |(low, high), h| (low.min(h), high.max(h)));
        let ceil = |height: i32| -(-height).div_euclid(ONE * stride);
        (ceil(low) - 1) * stride..ceil(high) * stride
    }

    /// Returns `true` if nodes of different levels lie on both sides of the lattice edge from `p` along
    /// `axis`, or around it if it is upright.
    pub(super) fn is_between_levels(&self, p: IVec3, axis: usize) -> bool {
        let at = |dx: i32, dz: i32| self.level_at(Column::new(p.x + dx, p.z + dz));
        let levels = match axis {
            0 => [at(0, -1), at(0, 0), None, None],
            1 => [at(-1, -1), at(0, -1), at(-1, 0), at(0, 0)],
            _ => [at(-1, 0), at(0, 0), None, None],
        };
        let mut levels = levels.into_iter().flatten();
        let first = levels.next();
        levels.any(|level| Some(level) != first)
    }

    /// Returns `true` if this rule is broken on purpose.
    #[cfg(test)]
    pub(super) fn has(&self, fault: super::Fault) -> bool {
        self.fault == Some(fault)
    }

    /// Rules are broken only in tests.
    #[cfg(not(test))]
    #[inline]
    pub(super) const fn has(&self, _: super::Fault) -> bool {
        false
    }
}
