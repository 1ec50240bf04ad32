//! The materials of all columns as a ground stores them.

use std::ops::Range;

use super::control::MaterialControl;
use super::material::ColumnMaterial;

/// The materials of all columns: one for all, or one for each where they differ.
#[derive(PartialEq)]
pub enum Materials {
    Uniform(ColumnMaterial),
    Columns(Vec<ColumnMaterial>),
    /// Materials of a ground with a source, computed when they are needed. Without a control they are the source's.
    OnDemand(Option<Box<MaterialControl>>),
}

impl Materials {
    /// The materials of each column, row-major; as one where all are alike, so that equal worlds are stored alike.
    pub fn from_columns(columns: Vec<ColumnMaterial>) -> Self {
        match columns.first() {
            Some(&first) if columns.iter().all(|&material| material == first) => Self::Uniform(first),
            _ => Self::Columns(columns),
        }
    }

    pub fn get(&self, index: usize) -> ColumnMaterial {
        match self {
            Self::Uniform(material) => *material,
            Self::Columns(materials) => materials[index],
            Self::OnDemand(_) => ColumnMaterial::default(),
        }
    }

    /// The materials of some columns, one after the other: from `on_demand` where they are computed on demand.
    pub fn of<'a>(
        &'a self,
        indices: Range<usize>,
        on_demand: &'a [ColumnMaterial],
    ) -> impl Iterator<Item = ColumnMaterial> {
        let none = std::iter::repeat_n(ColumnMaterial::default(), 0);
        let (all, columns): (_, &[ColumnMaterial]) = match self {
            _ if !on_demand.is_empty() => (none, on_demand),
            Self::Uniform(material) => (std::iter::repeat_n(*material, indices.len()), &[]),
            Self::Columns(columns) => (none, &columns[indices]),
            Self::OnDemand(_) => (none, &[]),
        };
        all.chain(columns.iter().copied())
    }
}
