//! Materials of coarse vertices: the shares of those that they stand for.
//!
//! A vertex of stride s stands for s x s columns. Where its material and those of its neighbours at that stride are all
//! one, it is that; otherwise it has the shares of five of its columns. Single samples of a border between two
//! materials would be a row of teeth, and single samples of what is speckled would be specks of the size of a cell.
//!
//! Where nodes of different levels meet, a column has the shares of the finest of them: so both show the same there,
//! and what a node shows does not depend on coarser ones. Full detail stays as it is.

use rustc_hash::FxHashMap;

use super::sides::SIDES;
use super::view::LodView;
use crate::ground::{ColumnMaterial, Ground, GroundPage};
use crate::lattice::Column;
use crate::surface::MaterialMix;

/// The columns of a grid: what each shows alone, and the shares of what it stands for.
pub(super) struct Shares {
    pub alone: Vec<ColumnMaterial>,
    pub mixes: Vec<MaterialMix>,
}

/// The shares of a grid of columns a stride apart, from the page of these columns and of those next to them on all
/// sides.
pub(super) fn shares_in(
    ground: &Ground,
    page: &GroundPage,
    low: Column,
    stride: i32,
    [width, depth]: [usize; 2],
) -> Shares {
    let row = width + 2;
    let at = |x: usize, z: usize| page.materials[(z + 1) * row + x + 1];
    let places = || (0..depth).flat_map(|z| (0..width).map(move |x| (x, z)));
    let alone: Vec<ColumnMaterial> = places().map(|(x, z)| at(x, z)).collect();
    let mut mixes: Vec<MaterialMix> = alone.iter().copied().map(MaterialMix::column).collect();
    let is_mixed = |(x, z): (usize, usize)| {
        let own = at(x, z);
        (z..z + 3).any(|z| page.materials[z * row + x..][..3].iter().any(|&other| other != own))
    };
    let mixed: Vec<bool> = places().map(is_mixed).collect();
    if stride < 2 || !mixed.contains(&true) {
        return Shares { alone, mixes };
    }
    let by = (stride / 4).max(1);
    let far = if stride < 4 { 0 } else { -by };
    let parts: Vec<Vec<ColumnMaterial>> = [(far, far), (by, far), (far, by), (by, by)]
        .map(|(dx, dz)| ground.page(low.offset(dx, dz), stride, [width, depth]).materials)
        .into();
    for (number, mix) in mixes.iter_mut().enumerate().filter(|(number, _)| mixed[*number]) {
        let parts = parts.iter().map(|part| part[number]);
        *mix = MaterialMix::of_columns(parts.chain([alone[number]]));
    }
    Shares { alone, mixes }
}

/// The shares of a grid of columns.
pub(super) fn shares_of(ground: &Ground, low: Column, stride: i32, counts: [usize; 2]) -> Shares {
    let [width, depth] = counts;
    let page = ground.page(low.offset(-stride, -stride), stride, [width + 2, depth + 2]);
    shares_in(ground, &page, low, stride, counts)
}

/// What columns at the sides of a node show, where finer nodes are adjacent.
#[derive(Default)]
pub(super) struct FinerShares {
    columns: FxHashMap<Column, (i32, ColumnMaterial, MaterialMix)>,
}

impl FinerShares {
    /// Computes the shares of a node from `low` to `high`, with the strides of the nodes across its sides.
    pub fn new(
        view: &LodView,
        low: Column,
        high: Column,
        stride: i32,
        beside: [Option<i32>; 4],
        [across, down]: [usize; 2],
    ) -> Self {
        let mut found = Self::default();
        for (&(dx, dz), finer) in SIDES.iter().zip(beside) {
            let Some(finer) = finer.filter(|&other| other < stride) else { continue };
            let first = Column::new(if dx > 0 { high.x } else { low.x }, if dz > 0 { high.z } else { low.z });
            let fine = |columns: usize| (columns - 1) * (stride / finer) as usize + 1;
            let counts = if dx != 0 { [1, fine(down)] } else { [fine(across), 1] };
            found.add(view, first, finer, counts);
        }
        for (x, z) in [(low.x, low.z), (high.x, low.z), (low.x, high.z), (high.x, high.z)] {
            let around = [(-1, -1), (0, -1), (-1, 0), (0, 0)];
            let levels = around.iter().filter_map(|(dx, dz)| view.level_at(Column::new(x + dx, z + dz)));
            let finest = levels.min().map_or(stride, |level| 1 << level);
            let known = found.columns.get(&Column::new(x, z)).map_or(stride, |known| known.0);
            if finest < known {
                found.add(view, Column::new(x, z), finest, [1, 1]);
            }
        }
        found
    }

    fn add(&mut self, view: &LodView, first: Column, stride: i32, counts: [usize; 2]) {
        let Shares { alone, mixes } = shares_of(view.ground(), first, stride, counts);
        let places = (0..counts[1] as i32).flat_map(|z| (0..counts[0] as i32).map(move |x| (x, z)));
        for ((x, z), (alone, mix)) in places.zip(alone.into_iter().zip(mixes)) {
            let column = Column::of(view.drawn(first.offset(x * stride, z * stride).at(0)));
            let own = self.columns.entry(column).or_insert((stride, alone, mix));
            if stride < own.0 {
                *own = (stride, alone, mix);
            }
        }
    }

    /// What a column shows alone, and the shares that it has here.
    pub fn get(&self, column: Column) -> Option<(ColumnMaterial, MaterialMix)> {
        self.columns.get(&column).map(|&(_, alone, mix)| (alone, mix))
    }
}
