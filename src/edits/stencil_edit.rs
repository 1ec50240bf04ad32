//! Edits that read a stencil of samples around each one: edits that sculpt, and edits that rules restrict.

use glam::IVec3;
use wide::i16x8;

use super::brick_editor::{BrickEditor, Changed};
use super::delta::Counts;
use super::padded_brick::PaddedBrick;
use super::prepared_edit::{LOOK, PreparedEdit};
use super::rule_scope::BrickRules;
use crate::brush::{BAND, Kind, Stencil};
use crate::ground::MaterialId;
use crate::lattice::LatticeBox;
use crate::volume::{Layers, Sample, SampleView, VoxelOutcome, resolve};

impl BrickEditor<'_> {
    /// Applies an edit that sculpts, or one that rules restrict, to some samples; returns those that changed.
    pub fn apply_stencil(
        &mut self,
        edit: &PreparedEdit,
        rules: Option<&BrickRules>,
        samples: LatticeBox,
        distances: &[i16x8; 64],
        around: &PaddedBrick,
        counts: &mut Counts<'_>,
    ) -> Layers {
        let low = self.pos.origin();
        let (from, to) = ((samples.min - low).as_usizevec3(), (samples.max - low).as_usizevec3());
        let (mut layers, mut nearest) = ([0; 8], NearestGround::default());
        for y in from.y..=to.y {
            let mut changed = Changed::default();
            for (z, x) in (from.z..=to.z).flat_map(|z| (from.x..=to.x).map(move |x| (z, x))) {
                let (index, local, bit) = (y * 64 + z * 8 + x, [x, y, z], 1 << (z * 8 + x));
                let outside = distances[y * 8 + z].as_array()[x].into();
                let point = low + IVec3::new(x as i32, y as i32, z as i32);
                if let Kind::Paint { material } = edit.operation {
                    let is_painted = outside <= 0 && around.density(local) < 0;
                    if is_painted && self.paint_sample(point, index, material, rules, around, counts) {
                        self.brick().set_bits(y, bit, bit);
                        layers[y] |= bit;
                    }
                    continue;
                }
                let before = around.density(local);
                let proposed = match (&edit.sculptor, &around.surface) {
                    (Some(sculptor), Some(surface)) => sculptor.rounded(before, outside, surface.at(index)),
                    (Some(sculptor), None) => sculptor.density(point, outside, || around.around(local)),
                    (None, _) => (outside <= BAND).then(|| edit.operation.apply(before, outside)),
                };
                let Some(proposed) =
                    proposed.filter(|&after| Sample::edited(after) != Sample::edited(before))
                else {
                    continue;
                };
                let mut new = || match &edit.sculptor {
                    Some(sculptor) => sculptor
                        .material_at(point)
                        .unwrap_or_else(|| nearest.material(&self.view, point, &around.around(local))),
                    None => edit.operation.material().unwrap_or(MaterialId::GROUND),
                };
                let mut after = Sample::edited(proposed);
                if let Some(rules) = rules {
                    let (allowed, outcome) =
                        rules.judge(&self.view, point, edit.power, &around.around(local), proposed);
                    let is_refused = (proposed < 0) != (before < 0) && (allowed < 0) == (before < 0);
                    if let Some(outcome) = outcome.filter(|_| is_refused) {
                        let own = if before < 0 { self.view.stored_material(point) } else { new() };
                        counts.add(outcome, resolve(self.view.ground(), point, own), 1);
                    }
                    after = Sample::edited(allowed);
                    if after == Sample::edited(before) {
                        continue;
                    }
                }
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

    /// Paints a solid sample unless a rule forbids it; returns whether it changed.
    fn paint_sample(
        &mut self,
        point: IVec3,
        index: usize,
        material: MaterialId,
        rules: Option<&BrickRules>,
        around: &PaddedBrick,
        counts: &mut Counts<'_>,
    ) -> bool {
        let (ground, old) = (self.view.ground(), self.view.stored_material(point));
        let is_pristine = !self.view.is_edited(point);
        if !is_pristine && material == old {
            return false;
        }
        let (own, new) = (resolve(ground, point, old), resolve(ground, point, material));
        let outcome = rules.and_then(|own_rules| {
            match (own_rules.is_protected(point), own_rules.rules.is_unbreakable(own)) {
                (true, _) => Some(VoxelOutcome::Protected),
                (_, true) => Some(VoxelOutcome::Unbreakable),
                _ => None,
            }
        });
        if let Some(outcome) = outcome {
            if own != new {
                counts.add(outcome, own, 1);
            }
            return false;
        }
        if own != new {
            counts.add(VoxelOutcome::Painted, new, 1);
        }
        let local = [index & 7, index >> 6, index >> 3 & 7];
        self.brick().set_material(index, material);
        self.brick().set_sample(index, Sample::edited(around.density(local)));
        true
    }
}

/// The nearest ground straight below and above the samples of a brick, for edits that build without a given material.
/// Each column must be asked from below upwards, so that every sample of it is looked at once.
struct NearestGround {
    below: [Option<Below>; 64],
    /// The y up to which there is only air above the last sample that looked up.
    clear: [i32; 64],
}

impl Default for NearestGround {
    fn default() -> Self {
        Self { below: [None; 64], clear: [i32::MIN; 64] }
    }
}

/// The first solid sample below a y.
#[derive(Clone, Copy)]
struct Below {
    y: i32,
    solid: Option<(i32, MaterialId)>,
}

impl NearestGround {
    /// The material for a point that becomes solid: of the ground straight below, else straight above, else
    /// next to it.
    fn material(&mut self, view: &SampleView, point: IVec3, around: &Stencil) -> MaterialId {
        let column = ((point.z & 7) * 8 + (point.x & 7)) as usize;
        let known = &mut self.below[column];
        let end = known.map_or(point.y - LOOK, |known| known.y);
        let fresh = (end..point.y).rev().map(|y| point.with_y(y)).find(|&at| view.is_solid(at));
        let solid = match fresh {
            Some(at) => Some((at.y, view.stored_material(at))),
            None => known.and_then(|known| known.solid),
        };
        *known = Some(Below { y: point.y, solid });
        if let Some((_, material)) = solid.filter(|(y, _)| point.y - y <= LOOK) {
            return material;
        }
        let (clear, end) = (&mut self.clear[column], point.y + LOOK);
        let above = ((*clear).max(point.y) + 1..=end).map(|y| point.with_y(y)).find(|&at| view.is_solid(at));
        *clear = above.map_or(end, |at| at.y - 1);
        let beside = || {
            let ways = [IVec3::NEG_X, IVec3::X, IVec3::NEG_Z, IVec3::Z].into_iter();
            ways.filter(|way| around.density(*way) < 0).map(|way| point + way).next()
        };
        above.or_else(beside).map_or(MaterialId::GROUND, |at| view.stored_material(at))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use fastrand::Rng;

    use super::*;
    use crate::ground::Ground;
    use crate::lattice::BrickPos;
    use crate::volume::{Brick, Bricks};

    /// The material of new ground by its definition.
    fn plainly(view: &SampleView, point: IVec3) -> MaterialId {
        let along = |way: IVec3| (1..=LOOK).map(move |step| point + way * step);
        let beside = [IVec3::NEG_X, IVec3::X, IVec3::NEG_Z, IVec3::Z].map(|way| point + way);
        let mut places = along(IVec3::NEG_Y).chain(along(IVec3::Y)).chain(beside);
        places.find(|&at| view.is_solid(at)).map_or(MaterialId::GROUND, |at| view.stored_material(at))
    }

    /// A brick of air with a few solid samples in it.
    fn crumbs(rng: &mut Rng, share: f32) -> Brick {
        let is_solid: [bool; 512] = std::array::from_fn(|_| rng.f32() < share);
        let mut brick = Brick::of_edited(&is_solid.map(|solid| if solid { -90 } else { 300 }));
        (0..512).for_each(|at| brick.set_material(at, MaterialId(rng.u8(..9))));
        brick
    }

    #[test]
    fn new_ground_in_mid_air_has_the_nearest_material_below_above_or_next_to_it() {
        let ground = Ground::flat(24, 24, -300.0).unwrap();
        let pos = BrickPos(IVec3::new(1, 0, 1));
        let mut found = [0; 2];
        for seed in 0..24 {
            let mut rng = Rng::with_seed(seed);
            let share = [0.003, 0.01, 0.1][seed as usize % 3];
            let mut bricks = Bricks::default();
            for at in (LatticeBox { min: IVec3::new(0, -9, 0), max: IVec3::new(2, 9, 2) }).points() {
                bricks.insert(BrickPos(at), Arc::new(crumbs(&mut rng, share)));
            }
            let view = SampleView::new(&ground, &bricks);
            let (around, mut nearest) = (PaddedBrick::new(&view, pos), NearestGround::default());
            for point in pos.samples().points().filter(|_| rng.u32(..3) > 0) {
                let local = (point - pos.origin()).as_usizevec3().to_array();
                let material = nearest.material(&view, point, &around.around(local));
                assert_eq!(material, plainly(&view, point), "world {seed} at {point}");
                found[usize::from(material == MaterialId::GROUND)] += 1;
            }
        }
        assert!(found[0] > 1000 && found[1] > 100, "{found:?}");
    }
}
