//! Edits that look around: those that sculpt, and all that rules bear on. Sample by sample.

use glam::IVec3;
use wide::i16x8;

use super::bearing::BrickRules;
use super::ledger::{Counts, Fate};
use super::surroundings::Surroundings;
use super::view::resolve;
use super::work::Tool;
use super::workpiece::{Changed, Workpiece};
use super::{Layers, Sample, SampleView};
use crate::brush::{Around, BAND, Kind, Sculptor};
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;

/// How far below and above itself new ground looks for what it is to be made of, in voxels.
const LOOK: i32 = 64;

impl Workpiece<'_> {
    /// Applies an edit that sculpts, or one that rules bear on, to some samples; returns those that changed.
    pub(super) fn carefully(
        &mut self,
        tool: &Tool,
        rules: Option<&BrickRules>,
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
            for (z, x) in (from.z..=to.z).flat_map(|z| (from.x..=to.x).map(move |x| (z, x))) {
                let (index, local) = (y * 64 + z * 8 + x, [x, y, z]);
                let outside = distances[y * 8 + z].as_array()[x].into();
                let point = low + IVec3::new(x as i32, y as i32, z as i32);
                if let Kind::Paint { material } = tool.operation {
                    let is_painted = outside <= 0 && around.density(local) < 0;
                    if is_painted && self.paint_carefully(point, index, material, rules, around, counts) {
                        self.brick().set_bits(y, 1 << (index & 63), 1 << (index & 63));
                        layers[y] |= 1 << (index & 63);
                    }
                    continue;
                }
                let before = around.density(local);
                let proposed = match &tool.sculptor {
                    Some(sculptor) => sculptor.density(point, outside, || around.around(local)),
                    None => (outside <= BAND).then(|| tool.operation.apply(before, outside)),
                };
                let Some(proposed) =
                    proposed.filter(|&after| Sample::edited(after) != Sample::edited(before))
                else {
                    continue;
                };
                let mut new = || match &tool.sculptor {
                    Some(sculptor) => sculptor
                        .material()
                        .unwrap_or_else(|| below.material(&self.view, point, &around.around(local))),
                    None => tool.operation.material().unwrap_or(MaterialId::GROUND),
                };
                let mut after = Sample::edited(proposed);
                if let Some(rules) = rules {
                    let (allowed, fate) =
                        rules.judge(&self.view, point, tool.power, &around.around(local), proposed);
                    let is_refused = (proposed < 0) != (before < 0) && (allowed < 0) == (before < 0);
                    if let Some(fate) = fate.filter(|_| is_refused) {
                        let own = if before < 0 { self.view.stored_material(point) } else { new() };
                        counts.add(fate, resolve(self.view.ground(), point, own), 1);
                    }
                    after = Sample::edited(allowed);
                    if after == Sample::edited(before) {
                        continue;
                    }
                }
                let bit = 1 << (index & 63);
                changed.all |= bit;
                changed.was |= if before < 0 { bit } else { 0 };
                if after.bits() < 0 {
                    changed.is |= bit;
                    if before >= 0 {
                        let material = new();
                        self.brick().set_material(index, material);
                    }
                }
                self.brick().set_sample(index, after);
            }
            if changed.all != 0 {
                self.brick().set_bits(y, changed.all, changed.is);
                self.count(y, changed, None, counts);
                layers[y] = changed.all;
            }
        }
        layers
    }

    /// Paints a solid sample unless a rule is against it; says whether it changed.
    fn paint_carefully(
        &mut self,
        point: IVec3,
        index: usize,
        material: MaterialId,
        rules: Option<&BrickRules>,
        around: &Surroundings,
        counts: &mut Counts<'_>,
    ) -> bool {
        let (ground, old) = (self.view.ground(), self.view.stored_material(point));
        let is_pristine = !self.view.is_edited(point);
        if !is_pristine && material == old {
            return false;
        }
        let (own, new) = (resolve(ground, point, old), resolve(ground, point, material));
        let fate = rules.and_then(|own_rules| {
            match (own_rules.is_protected(point), own_rules.rules.is_unbreakable(own)) {
                (true, _) => Some(Fate::Protected),
                (_, true) => Some(Fate::Unbreakable),
                _ => None,
            }
        });
        if let Some(fate) = fate {
            if own != new {
                counts.add(fate, own, 1);
            }
            return false;
        }
        if own != new {
            counts.add(Fate::Painted, new, 1);
        }
        let local = [index & 7, index >> 6, index >> 3 & 7];
        self.brick().set_material(index, material);
        self.brick().set_sample(index, Sample::edited(around.density(local)));
        true
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
    fn material(&mut self, view: &SampleView, point: IVec3, around: &Around) -> MaterialId {
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
        let above = (1..=LOOK).map(|up| point + IVec3::Y * up).find(|&at| view.is_solid(at));
        let beside = || {
            let ways = [IVec3::NEG_X, IVec3::X, IVec3::NEG_Z, IVec3::Z].into_iter();
            ways.filter(|way| around.density(*way) < 0).map(|way| point + way).next()
        };
        above.or_else(beside).map_or(MaterialId::GROUND, |at| view.stored_material(at))
    }
}

/// The samples that an edit reads which reaches these; `None` where it looks at none but those it changes.
pub(super) fn reads(sculptor: Option<&Sculptor>, is_bound: bool, reach: LatticeBox) -> Option<LatticeBox> {
    let look = IVec3::Y * if sculptor.is_some_and(|own| own.material().is_none()) { LOOK } else { 0 };
    let all = reach.grown(1);
    (is_bound || sculptor.is_some()).then_some(LatticeBox { min: all.min - look, max: all.max + look })
}
