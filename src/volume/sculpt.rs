//! Edits that sculpt, sample by sample.

use glam::IVec3;
use wide::i16x8;

use super::ledger::Counts;
use super::surroundings::Surroundings;
use super::workpiece::{Changed, Workpiece, ones};
use super::{Layers, Sample, SampleView};
use crate::brush::Sculptor;
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;

/// How far below and above itself new ground looks for what it is to be made of, in voxels.
const LOOK: i32 = 64;

impl Workpiece<'_> {
    /// Applies an edit that sculpts to some samples; returns those that changed.
    pub(super) fn sculpt(
        &mut self,
        sculptor: &Sculptor,
        samples: LatticeBox,
        distances: &[i16x8; 64],
        around: &Surroundings,
        counts: &mut Counts<'_>,
    ) -> Layers {
        let low = self.pos.origin();
        let (from, to) = ((samples.min - low).as_usizevec3(), (samples.max - low).as_usizevec3());
        let (mut layers, mut below) = ([0; 8], Below::default());
        for y in from.y..=to.y {
            let mut changed = Changed::default();
            for z in from.z..=to.z {
                let (at, outside) = (y * 64 + z * 8, distances[y * 8 + z].to_array());
                for x in from.x..=to.x {
                    let local = [x, y, z];
                    let point = low + IVec3::new(x as i32, y as i32, z as i32);
                    let after = sculptor.density(point, outside[x].into(), || around.around(local));
                    let before = around.density(local);
                    let Some(after) = after.map(Sample::edited) else { continue };
                    if after == Sample::edited(before) {
                        continue;
                    }
                    let bit = 1 << (z * 8 + x);
                    self.brick().set_sample(at + x, after);
                    changed.all |= bit;
                    changed.was |= if before < 0 { bit } else { 0 };
                    changed.is |= if after.bits() < 0 { bit } else { 0 };
                }
            }
            if changed.all != 0 {
                self.brick().set_bits(y, changed.all, changed.is);
                for bit in ones(changed.is & !changed.was) {
                    let point = low + IVec3::new((bit & 7) as i32, y as i32, (bit >> 3) as i32);
                    let material = sculptor.material().unwrap_or_else(|| below.material(&self.view, point));
                    self.brick().set_material(y * 64 + bit, material);
                }
                self.count(y, changed, None, counts);
            }
            layers[y] = changed.all;
        }
        layers
    }
}

/// What lies below the columns of a brick, for edits that build without a material of their own. Asked from below.
struct Below([Option<Seen>; 64]);

impl Default for Below {
    fn default() -> Self {
        Self([None; 64])
    }
}

/// What was seen below a point.
#[derive(Clone, Copy)]
struct Seen {
    from: i32,
    solid: Option<(i32, MaterialId)>,
}

impl Below {
    /// What a point is made of that becomes solid: what lies straight below, else straight above, else beside it.
    fn material(&mut self, view: &SampleView, point: IVec3) -> MaterialId {
        let known = &mut self.0[((point.z & 7) * 8 + (point.x & 7)) as usize];
        let end = known.map_or(point.y - LOOK, |seen| seen.from);
        let fresh = (end..point.y).rev().map(|y| point.with_y(y)).find(|&at| view.is_solid(at));
        let solid = match fresh {
            Some(at) => Some((at.y, view.stored_material(at))),
            None => known.and_then(|seen| seen.solid),
        };
        *known = Some(Seen { from: point.y, solid });
        if let Some((_, material)) = solid.filter(|(y, _)| point.y - y <= LOOK) {
            return material;
        }
        let above = (1..=LOOK).map(|up| point + IVec3::Y * up);
        let beside = [IVec3::NEG_X, IVec3::X, IVec3::NEG_Z, IVec3::Z].map(|step| point + step);
        let other = above.chain(beside).find(|&at| view.is_solid(at));
        other.map_or(MaterialId::GROUND, |at| view.stored_material(at))
    }
}

/// The samples that an edit reads which sculpts and reaches these.
pub(super) fn reads(sculptor: &Sculptor, reach: LatticeBox) -> LatticeBox {
    let all = reach.grown(1);
    let look = IVec3::Y * if sculptor.material().is_none() { LOOK } else { 0 };
    LatticeBox { min: all.min - look, max: all.max + look }
}
