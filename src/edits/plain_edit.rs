//! Digs, adds and paint that look at no other samples: row by row.

use wide::{i16x8, i32x8};

use super::brick_editor::{BrickEditor, Changed};
use super::delta::Counts;
use crate::brush::{BAND, DEPTH, Kind};
use crate::ground::MaterialId;
use crate::lattice::{LatticeBox, ONE};
use crate::volume::layers::{Layers, of_row, offset, ones};
use crate::volume::{Sample, VoxelOutcome, resolve, row};

impl BrickEditor<'_> {
    /// Applies an operation to some samples; returns those that changed.
    pub fn apply_plain(
        &mut self,
        operation: Kind,
        samples: LatticeBox,
        distances: &[i16x8; 64],
        counts: &mut Counts<'_>,
    ) -> Layers {
        let low = self.pos.origin();
        let (from, to) = ((samples.min - low).as_usizevec3(), (samples.max - low).as_usizevec3());
        let lanes = i16x8::new(std::array::from_fn(|x| -i16::from((from.x..=to.x).contains(&x))));
        let mut changed = [0; 8];
        for (y, layer) in (from.y..=to.y).zip(&mut changed[from.y..]) {
            let rows = (from.z..=to.z).zip(&distances[y * 8 + from.z..]);
            *layer = match operation {
                Kind::Paint { material } => rows.fold(0, |layer, (z, &outside)| {
                    let row = self.paint((y, z), outside, lanes, material, counts);
                    layer | of_row(row, z)
                }),
                // These have no jobs of their own: see `edits::reset` and `edits::paste`.
                Kind::Reset | Kind::Paste => 0,
                _ => self.carve(y, rows, lanes, operation, counts),
            };
        }
        changed
    }

    /// Digs or adds in rows of a layer; returns the samples that changed.
    ///
    /// Densities saturate at 16 bits. That changes no sample: the operation compares them with depths of a few voxels
    /// only.
    fn carve<'d>(
        &mut self,
        y: usize,
        rows: impl Iterator<Item = (usize, &'d i16x8)>,
        lanes: i16x8,
        operation: Kind,
        counts: &mut Counts<'_>,
    ) -> u64 {
        let mut changed = Changed::default();
        let height = i32x8::splat((self.pos.origin().y + y as i32) * ONE);
        for (z, &outside) in rows {
            let in_reach = lanes & !outside.simd_gt(i16x8::splat(BAND as i16));
            if in_reach.to_bitmask() == 0 {
                continue;
            }
            let at = y * 64 + z * 8;
            let raw = i16x8::new(row(self.samples(), at));
            let pristine = i16x8::from_i32x8_saturate(height - i32x8::new(self.heights[z]));
            let before = raw.simd_eq(i16x8::splat(i16::MIN)).select(pristine, raw);
            let depth = outside.max(i16x8::splat(-DEPTH as i16));
            let after = if operation == Kind::Dig { before.max(-depth) } else { before.min(depth) };
            let changes = in_reach & !after.simd_eq(before);
            let lanes = bits(changes);
            if lanes != 0 {
                self.brick().set_row(at, changes.select(after, raw).to_array());
                changed.all |= of_row(lanes, z);
                changed.was |= of_row(lanes & bits(before), z);
                changed.is |= of_row(lanes & bits(after), z);
            }
        }
        if changed.all != 0 {
            self.brick().set_bits(y, changed.all, changed.is);
            let material = operation.material().unwrap_or(MaterialId::GROUND);
            self.count(y, changed, Some(material), counts);
        }
        changed.all
    }

    /// Paints the solid samples of a row inside the shape; returns the lanes that changed.
    fn paint(
        &mut self,
        (y, z): (usize, usize),
        outside: i16x8,
        lanes: i16x8,
        material: MaterialId,
        counts: &mut Counts<'_>,
    ) -> u8 {
        let (at, low) = (y * 64 + z * 8, self.pos.origin());
        let mut samples = row(self.samples(), at);
        let inside = bits(lanes & !outside.simd_gt(i16x8::ZERO));
        let mut changed = 0;
        for x in ones(inside.into()) {
            let (index, is_pristine) = (at + x, samples[x] == i16::MIN);
            let old = self.current().map_or(MaterialId::GROUND, |brick| brick.material_at(index));
            let pristine = (low.y + y as i32) * ONE - self.heights[z][x];
            let before = if is_pristine { pristine } else { samples[x].into() };
            if before >= 0 || !is_pristine && material == old {
                continue;
            }
            let (point, ground) = (low + offset(index), self.view.ground());
            if resolve(ground, point, material) != resolve(ground, point, old) {
                counts.add(VoxelOutcome::Painted, resolve(ground, point, material), 1);
            }
            if is_pristine {
                samples[x] = Sample::edited(before).distance().unwrap_or_default() as i16;
            }
            self.brick().set_material(index, material);
            changed |= 1 << x;
        }
        if changed != 0 {
            let layer = of_row(changed, z);
            self.brick().set_row(at, samples);
            self.brick().set_bits(y, layer, layer);
        }
        changed
    }
}

/// The lanes that are negative, as the lanes of a mask are where it is set.
#[inline(always)]
fn bits(lanes: i16x8) -> u8 {
    lanes.to_bitmask() as u8
}
