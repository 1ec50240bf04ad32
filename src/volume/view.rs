//! Reading the world at a lattice point, edited or not.

use std::sync::Arc;

use glam::IVec3;
use rustc_hash::FxHashMap;

use super::{Brick, Sample};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, LatticeBox};

/// Bricks by position; a missing brick is all pristine.
pub type Bricks = FxHashMap<BrickPos, Arc<Brick>>;

/// The samples of a world: its ground, its bricks, and newer bricks that a running transaction lays over them.
#[derive(Clone, Copy)]
pub struct SampleView<'a> {
    ground: &'a Ground,
    bricks: &'a Bricks,
    newer: Option<&'a Bricks>,
}

impl<'a> SampleView<'a> {
    /// A view of committed bricks.
    pub fn new(ground: &'a Ground, bricks: &'a Bricks) -> Self {
        Self { ground, bricks, newer: None }
    }

    /// The same view with newer bricks in place of older ones.
    pub fn over(self, newer: &'a Bricks) -> Self {
        Self { newer: Some(newer), ..self }
    }

    /// The pristine world below the edits.
    pub fn ground(&self) -> &'a Ground {
        self.ground
    }

    /// The newer bricks that are laid over the others.
    pub(super) fn newer(&self) -> Option<&'a Bricks> {
        self.newer
    }

    /// Where bricks are looked up, the older ones first.
    pub(crate) fn tables(&self) -> impl Iterator<Item = &'a Bricks> {
        std::iter::once(self.bricks).chain(self.newer)
    }

    /// A brick, `None` where all samples are pristine.
    pub fn brick(&self, pos: BrickPos) -> Option<&'a Brick> {
        self.newer.and_then(|newer| newer.get(&pos)).or_else(|| self.bricks.get(&pos)).map(Arc::as_ref)
    }

    /// The stored sample.
    pub fn sample(&self, point: IVec3) -> Sample {
        self.brick(BrickPos::of(point)).map_or(Sample::PRISTINE, |brick| brick.sample(point))
    }

    /// Was the sample edited?
    pub fn is_edited(&self, point: IVec3) -> bool {
        self.sample(point) != Sample::PRISTINE
    }

    /// Density in 1/256 voxel: stored where edited, otherwise computed (rule 1).
    pub fn distance(&self, point: IVec3) -> i32 {
        self.sample(point).distance().unwrap_or_else(|| self.ground.distance(point))
    }

    /// Is the lattice point solid? Density 0 is air.
    pub fn is_solid(&self, point: IVec3) -> bool {
        self.distance(point) < 0
    }

    /// The stored material; [`MaterialId::GROUND`] where nobody changed it.
    pub fn stored_material(&self, point: IVec3) -> MaterialId {
        self.brick(BrickPos::of(point)).map_or(MaterialId::GROUND, |brick| brick.material(point))
    }

    /// The material at a lattice point, the ground's own where nobody changed it.
    pub fn material(&self, point: IVec3) -> MaterialId {
        resolve(self.ground, point, self.stored_material(point))
    }

    /// Solid lattice points of a box, counted one by one.
    pub fn solid_count(&self, samples: LatticeBox) -> u64 {
        samples.points().filter(|&point| self.is_solid(point)).count() as u64
    }
}

/// The material that a stored id stands for at a lattice point.
pub(super) fn resolve(ground: &Ground, point: IVec3, stored: MaterialId) -> MaterialId {
    if stored == MaterialId::GROUND { ground.material(point) } else { stored }
}
