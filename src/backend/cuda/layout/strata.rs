//! Strata as the kernels read them.

use bytemuck::{Pod, Zeroable};

use crate::ground::{BeddingRecord, ColumnMaterial, Ground, MAX_STRATA, StratumRecord};
use crate::lattice::Column;

/// The strata of a ground.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct StrataTable {
    pub bedding: BeddingRecord,
    /// The last columns of the world along x and z.
    pub last: [i32; 2],
    /// Number of strata.
    pub count: u32,
    pub strata: [StratumRecord; MAX_STRATA],
}

/// The table of a ground with strata.
pub(crate) fn strata_table(ground: &Ground) -> Option<StrataTable> {
    let records = ground.strata_records()?;
    let mut table = StrataTable {
        bedding: records.bedding,
        last: [ground.width(), ground.depth()],
        count: records.strata.len() as u32,
        ..StrataTable::zeroed()
    };
    table.strata.iter_mut().zip(&records.strata).for_each(|(place, record)| *place = *record);
    Some(table)
}

/// The word of a column in a [`StackRecord`](super::StackRecord): `base | overlay << 8 | blend << 16`; with strata
/// `base | skin << 8 | conditions << 16`.
pub(super) fn column_word(ground: &Ground, column: Column) -> u32 {
    let material: ColumnMaterial = ground.column_material(column);
    let [base, overlay, skin] = [material.base, material.overlay, material.skin()].map(|id| u32::from(id.0));
    match ground.strata_records() {
        Some(records) => {
            base | skin << 8 | records.conditions_of(ground, ground.nearest_column(column.at(0))) << 16
        }
        None => base | overlay << 8 | u32::from(material.blend) << 16,
    }
}
