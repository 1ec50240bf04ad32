//! Asking for the ground's own materials, voxel after voxel.

use std::cell::RefCell;

use glam::IVec3;

use super::{BrickStrata, MaterialFn};
use crate::ground::material::MaterialId;
use crate::ground::world::Ground;
use crate::lattice::{BRICK, BrickPos, ONE};

/// Gives the ground's own material at lattice points, and keeps what it finds out about the bricks around.
pub(crate) struct MaterialLookup<'g> {
    ground: &'g Ground,
    function: Option<&'g MaterialFn>,
    has_strata: bool,
    /// The strata of up to eight bricks, each at the place that the lowest bits of its position say. Empty at first.
    bricks: RefCell<Vec<Option<BrickStrata<'g>>>>,
}

impl<'g> MaterialLookup<'g> {
    pub fn new(ground: &'g Ground) -> Self {
        let has_strata = ground.strata_records().is_some();
        Self { ground, function: ground.material_fn(), has_strata, bricks: RefCell::default() }
    }

    /// The ground's own material at a lattice point.
    pub fn at(&self, point: IVec3) -> MaterialId {
        let found = if self.has_strata { self.in_strata(point) } else { self.by_function(point) };
        found.unwrap_or_else(|| self.ground.material_of_column(point))
    }

    /// The material that a stored id stands for at a lattice point.
    pub fn resolve(&self, point: IVec3, stored: MaterialId) -> MaterialId {
        if stored == MaterialId::GROUND { self.at(point) } else { stored }
    }

    fn in_strata(&self, point: IVec3) -> Option<MaterialId> {
        let mut bricks = self.bricks.borrow_mut();
        if bricks.is_empty() {
            bricks.resize_with(8, || None);
        }
        let point = point.with_y(point.y.clamp(-HIGHEST, HIGHEST));
        let pos = BrickPos::of(point);
        let IVec3 { x, y, z } = pos.0 & 1;
        let place = &mut bricks[(x | y << 1 | z << 2) as usize];
        if place.as_ref().is_none_or(|brick| brick.pos() != pos) {
            *place = self.ground.brick_strata(pos);
        }
        place.as_ref()?.material(point)
    }

    fn by_function(&self, point: IVec3) -> Option<MaterialId> {
        let function = self.function?;
        let column = self.ground.nearest_column(point);
        let y = point.y.clamp(-HIGHEST, HIGHEST);
        let depth = (self.ground.height(column) - y * ONE).max(1);
        function(column.at(y), depth).filter(|&material| material != MaterialId::GROUND)
    }
}

/// Points farther up or down, where no edit reaches, count as if they were here.
const HIGHEST: i32 = 1 << 20;
const _: () = assert!(HIGHEST % BRICK == 0 && HIGHEST > 2 * crate::lattice::LIMIT);
