//! Gives a ground strata or a material function, and queries the materials below its surface.

use std::sync::Arc;

use glam::IVec3;
use rayon::prelude::*;

use super::conditions::LoneVoxel;
use super::in_brick::{self, ones};
use super::steep::Steep;
use super::{Below, OwnMaterials, SteepCells, Strata, StrataRecords};
use crate::ground::material::MaterialId;
use crate::ground::world::Ground;
use crate::ground::{ColumnMaterial, GroundError};
use crate::lattice::hash::hash_words;
use crate::lattice::{BrickPos, Column, LIMIT, ONE, ceil};

impl Ground {
    /// This ground with strata. Voxels outside every stratum keep their material from
    /// [`Self::with_materials`], whether that is called before or after.
    ///
    /// Nothing is stored for a voxel, one byte for a column, and one bit for a cell if any is steep; with a
    /// [source](Self::from_source), only for columns and cells of the pages it keeps. Strata are included in
    /// [`Self::hash`].
    ///
    /// # Errors
    /// [`GroundError::Parameter`] names the stratum by its number, and the value; [`GroundError::Memory`] if the
    /// machine has too little.
    pub fn with_strata(self, strata: &Strata) -> Result<Self, GroundError> {
        strata.check()?;
        let records = Arc::new(StrataRecords::new(strata));
        self.with_below(OwnMaterials::Strata { given: Arc::new(strata.clone()), records })
    }

    /// This ground with a material function in place of [`Strata`]: given a lattice point and its depth in 1/256 voxel,
    /// as [`Stratum::depth`](super::Stratum::depth) counts it, it returns the material there, or `None` (or
    /// [`MaterialId::GROUND`]) for what the column has. For a point beyond the rim it is asked at the nearest column.
    ///
    /// It must always return the same material for a point, or worlds would depend on timing. `id` represents
    /// it in [`Self::hash`]: use a different one for every function. The GPU can't run it, so such worlds are
    /// edited and meshed on the CPU.
    ///
    /// # Errors
    /// [`GroundError::Memory`] if the machine has too little.
    pub fn with_material_fn(
        self,
        id: u64,
        function: impl Fn(IVec3, i32) -> Option<MaterialId> + Send + Sync + 'static,
    ) -> Result<Self, GroundError> {
        self.with_below(OwnMaterials::Function { id, function: Arc::new(function) })
    }

    /// The strata that it was given.
    pub fn strata(&self) -> Option<&Strata> {
        match &self.below()?.own {
            OwnMaterials::Strata { given, .. } => Some(given),
            OwnMaterials::Function { .. } => None,
        }
    }

    /// The strata as numbers.
    #[cfg(any(test, feature = "cuda"))]
    pub(crate) fn strata_records(&self) -> Option<&StrataRecords> {
        match &self.below()?.own {
            OwnMaterials::Strata { records, .. } => Some(records),
            OwnMaterials::Function { .. } => None,
        }
    }

    /// Returns `true` if materials differ from voxel to voxel, because of strata or a function.
    pub(crate) fn has_own_materials(&self) -> bool {
        self.below().is_some()
    }

    /// Returns `true` if its material is a function that only the CPU can call.
    pub fn has_material_fn(&self) -> bool {
        self.below().is_some_and(|below| matches!(below.own, OwnMaterials::Function { .. }))
    }

    fn with_below(self, own: OwnMaterials) -> Result<Self, GroundError> {
        self.replace_below(Below { own, tops: Box::default(), steep: None }).with_new_tops()
    }

    /// This ground with its surface materials updated to its present materials.
    pub(in crate::ground) fn with_new_tops(self) -> Result<Self, GroundError> {
        if self.below().is_none() {
            return Ok(self);
        }
        let bare = self.map_below(|below| Below { tops: Box::default(), steep: None, ..below });
        if bare.pages().is_some() {
            return Ok(bare);
        }
        let tops = bare.tops()?.into_boxed_slice();
        let ground = bare.map_below(|below| Below { tops, ..below });
        let steep = SteepCells::new(&ground)?.map(Box::new);
        Ok(ground.map_below(|below| Below { steep, ..below }))
    }

    /// The material of the highest solid voxel of each column.
    fn tops(&self) -> Result<Vec<MaterialId>, GroundError> {
        let extent = self.extent();
        let mut tops: Vec<MaterialId> = extent.fill_rows(|_, _| Ok(()))?;
        tops.par_chunks_mut(extent.row_len() * 8).enumerate().for_each(|(band, rows)| {
            for low in (0..extent.row_len()).step_by(8) {
                for (z, row) in rows.chunks_mut(extent.row_len()).enumerate() {
                    for (x, top) in row.iter_mut().enumerate().skip(low).take(8) {
                        let column = Column::new(x as i32, (band * 8 + z) as i32);
                        *top = self.computed_top(column);
                    }
                }
            }
        });
        Ok(tops)
    }

    /// Material of a pristine voxel: of the first stratum that holds it; else, down to
    /// [`OVERLAY_DEPTH`](crate::ground::OVERLAY_DEPTH) below the surface, the column's overlay if it covers at least
    /// half (`blend >= 128`); else the column's base.
    pub fn material(&self, point: IVec3) -> MaterialId {
        let Some(below) = self.below() else { return self.material_of_column(point) };
        let (column, y) = (self.nearest_column(point), point.y.clamp(-HIGHEST, HIGHEST));
        let (index, height) = self.inner_height(column);
        let depth = height - y * ONE - 1;
        if (0..ONE).contains(&depth)
            && let Some(&top) = below.tops.get(index)
        {
            return top;
        }
        let found = match &below.own {
            OwnMaterials::Strata { records, .. } => {
                let (pos, voxel) = (BrickPos::of(column.at(y)), 1 << ((column.z & 7) << 3 | column.x & 7));
                in_brick::with_brick(self, records, pos, |brick| {
                    let mut found = MaterialId::GROUND;
                    brick.for_materials(self, records, y, voxel, |material, _| found = material);
                    found
                })
            }
            OwnMaterials::Function { function, .. } => function(column.at(y), depth.max(0)),
        };
        found.filter(|&own| own != MaterialId::GROUND).unwrap_or_else(|| self.material_of_column(point))
    }

    /// Calls `each` with the materials of pristine voxels, and which are of each, in one call or several. Voxels are
    /// bits `z * 8 + x` of layer `y` of a brick.
    pub(crate) fn for_materials(
        &self,
        pos: BrickPos,
        y: usize,
        voxels: u64,
        mut each: impl FnMut(MaterialId, u64),
    ) {
        let low = pos.origin() + IVec3::Y * y as i32;
        // Those asked one by one: what no stratum holds, and all beyond the rim.
        let mut rest = voxels;
        if let Some(Below { own: OwnMaterials::Strata { records, .. }, tops, .. }) = self.below()
            && [low, low + IVec3::new(7, 0, 7)].iter().all(|&corner| self.is_inside(corner))
        {
            let first = self.extent().inner_index(Column::of(low));
            in_brick::with_brick(self, records, pos, |brick| {
                // A ground with a source stores no tops: they are asked as all others are.
                let shown = if tops.is_empty() { 0 } else { brick.tops(low.y, voxels) };
                let top = |bit: usize| tops.get(first + (bit >> 3) * self.extent().row_len() + (bit & 7));
                for_runs(shown, |bit| top(bit).copied().unwrap_or_default(), &mut each);
                rest = 0;
                brick.for_materials(self, records, low.y, voxels & !shown, |material, held| match material {
                    MaterialId::GROUND => rest |= held,
                    _ => each(material, held),
                });
            });
        }
        let point = |bit: usize| low + IVec3::new((bit & 7) as i32, 0, (bit >> 3) as i32);
        for_runs(rest, |bit| self.material(point(bit)), each);
    }

    /// Returns `true` if a point lies in a column of the world, within the vertical range of queries.
    fn is_inside(&self, point: IVec3) -> bool {
        self.nearest_column(point) == Column::of(point) && point.y.unsigned_abs() <= HIGHEST.unsigned_abs()
    }

    /// The material that the undug surface shows over a column: the material of its highest solid voxel where the
    /// ground has strata, otherwise the column's own, base and overlay blended.
    pub fn surface_material(&self, column: Column) -> ColumnMaterial {
        match self.below() {
            Some(below) => match below.tops.get(self.extent().index(column)) {
                Some(&top) => ColumnMaterial::solid(top),
                None => ColumnMaterial::solid(self.top_on_demand(column)),
            },
            None => self.column_material(column),
        }
    }

    /// The tops of some columns, one after the other, if there are strata.
    pub(in crate::ground) fn tops_of(&self, columns: std::ops::Range<usize>) -> Option<&[MaterialId]> {
        self.below().filter(|below| !below.tops.is_empty()).map(|below| &below.tops[columns])
    }

    /// Computes the material of the highest solid voxel of a column of the world.
    pub(in crate::ground) fn computed_top(&self, column: Column) -> MaterialId {
        self.material(column.at(ceil(self.height(column)) - 1))
    }

    /// The surface material of a column with known height and slope, without reading any other column.
    pub(in crate::ground) fn lone_top(
        &self,
        (column, height, squared_slope): (Column, i32, u64),
        of_column: ColumnMaterial,
    ) -> MaterialId {
        let y = ceil(height) - 1;
        let depth = height - y * ONE - 1;
        let found = self.below().and_then(|below| match &below.own {
            OwnMaterials::Strata { records, .. } => {
                let lone = LoneVoxel { column, y, depth, squared_slope };
                records
                    .strata
                    .iter()
                    .find(|record| records.holds(record, self, lone))
                    .map(|record| MaterialId(record.material as u8))
            }
            OwnMaterials::Function { function, .. } => function(column.at(y), depth),
        });
        found.filter(|&own| own != MaterialId::GROUND).unwrap_or_else(|| of_column.at_distance(-depth - 1))
    }

    /// The cells whose tops do not show all materials of their face; `None` if there are none, as on any ground whose
    /// materials are those of its columns.
    pub(crate) fn steep_cells(&self) -> Option<Steep<'_>> {
        match &self.below()?.steep {
            Some(cells) => Some(Steep::Resident(cells)),
            None => self.pages().map(|_| Steep::OnDemand(self)),
        }
    }

    /// The word for strata in the hash.
    pub(in crate::ground) fn below_hash(&self) -> Option<u64> {
        Some(match &self.below()?.own {
            OwnMaterials::Strata { records, .. } => hash_words([1, records.hash]),
            OwnMaterials::Function { id, .. } => hash_words([2, *id]),
        })
    }
}

/// Points farther up or down, where no edit reaches, count as if they were here.
const HIGHEST: i32 = 4 * LIMIT;

/// Calls `each` with runs of voxels that have the same material.
#[inline]
fn for_runs(voxels: u64, material: impl Fn(usize) -> MaterialId, mut each: impl FnMut(MaterialId, u64)) {
    let (mut last, mut run) = (MaterialId::GROUND, 0);
    for bit in ones(voxels) {
        let material = material(bit);
        if material != last && run != 0 {
            each(last, run);
            run = 0;
        }
        (last, run) = (material, run | 1 << bit);
    }
    if run != 0 {
        each(last, run);
    }
}
