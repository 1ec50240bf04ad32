//! One state of a brick in place of another, as undo and redo put them.

use glam::IVec3;

use super::brick_editor::{bounds, offset, ones};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, LatticeBox};
use crate::volume::{Brick, Layers, MaterialCounts, PRISTINE, pristine_layers, resolve};

/// What becomes of voxels when bricks are replaced.
#[derive(Clone, Debug, Default)]
pub(crate) struct Replaced {
    /// Voxels that were solid and are air now, by the material they had.
    pub removed: MaterialCounts,
    /// Voxels that were air and are solid now, by the material they have.
    pub added: MaterialCounts,
    /// Solid voxels that changed their material, by the material they have now.
    pub painted: MaterialCounts,
}

impl Replaced {
    /// Counts what a brick in place of another changes; `None` stands for one that nobody edited. Returns the box around
    /// samples that differ.
    pub fn count(
        &mut self,
        ground: &Ground,
        pos: BrickPos,
        before: Option<&Brick>,
        after: Option<&Brick>,
    ) -> Option<LatticeBox> {
        let material =
            |brick: Option<&Brick>, index| brick.map_or(MaterialId::GROUND, |b| b.material_at(index));
        let [old, new] = [before, after].map(|brick| brick.map_or(&PRISTINE, Brick::samples));
        let mut differ: Layers = [0; 8];
        let has_materials = [before, after].iter().flatten().any(|brick| brick.material_bytes() > 0);
        for (index, (a, b)) in old.iter().zip(new).enumerate() {
            let is_same = a == b && (!has_materials || material(before, index) == material(after, index));
            differ[index >> 6] |= u64::from(!is_same) << (index & 63);
        }
        let changed = bounds(&differ, pos.origin())?;
        let solid =
            |brick: Option<&Brick>| brick.map_or_else(|| pristine_layers(ground, pos), |b| *b.solid());
        let (was, is) = (solid(before), solid(after));
        let kinds: [(&mut MaterialCounts, Option<&Brick>, fn(u64, u64) -> u64); 3] = [
            (&mut self.removed, before, |was, is| was & !is),
            (&mut self.added, after, |was, is| is & !was),
            (&mut self.painted, after, |was, is| was & is),
        ];
        for (kind, (tally, brick, of)) in kinds.into_iter().enumerate() {
            let (mut last, mut count) = (None, 0);
            for (y, &differ) in differ.iter().enumerate() {
                for bit in ones(differ & of(was[y], is[y])) {
                    let index = y * 64 + bit;
                    let point: IVec3 = pos.origin() + offset(index);
                    let now = resolve(ground, point, material(brick, index));
                    if kind == 2 && now == resolve(ground, point, material(before, index)) {
                        continue;
                    }
                    if last != Some(now) {
                        last.into_iter().for_each(|last| tally.count_many(last, count));
                        (last, count) = (Some(now), 0);
                    }
                    count += 1;
                }
            }
            last.into_iter().for_each(|last| tally.count_many(last, count));
        }
        Some(changed)
    }
}
