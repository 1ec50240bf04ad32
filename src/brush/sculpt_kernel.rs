//! The new density of a sample under an operation that sculpts, in integers throughout.
//!
//! Raise and lower have to reverse each other, and they change neighbours by different amounts where they
//! fade. Any guess may leave crumbs and holes there, so they have further conditions:
//!
//! - A sample cut off at `DEPTH` is left alone if its neighbours lie deeper. They were moved away, and it was
//!   not.
//! - Samples at `FARTHEST`, and pristine ones beyond it, are left alone even next to the surface, unless that
//!   surface is known to be artificial: of ground that was built or raised, for a raise; of air
//!   that was dug or lowered, for a lower. So natural ground that was lowered and raised again is never
//!   higher than before, however often; and raising on fills the pit that is left of it.
//! - Neither makes a sample `DEPTH` that was not cut off.

use std::sync::Arc;

use glam::IVec3;

use super::Rounding;
use super::blend::QuantizedBlend;
use super::quantized_operation::{QuantizedOperation, above_plane};
use super::shapes::{GridMaterials, QuantizedShape, Road};
use super::stencil::Stencil;
#[cfg(feature = "cuda")]
use super::{quantize::measure, stamp::StampParams};
use crate::ground::MaterialId;
use crate::lattice::ONE;

/// The most that sharpening changes a sample, in 1/256 voxel.
const SHARPER: i32 = ONE / 4;

/// An edit that sculpts, ready to be applied.
#[derive(Clone, Debug)]
pub(crate) struct SculptKernel {
    operation: QuantizedOperation,
    blend: QuantizedBlend,
    /// Depth of the shape's middle.
    deep: i32,
    /// The road, if that is built.
    road: Option<Arc<Road>>,
    /// How edges are rounded, if they are.
    rounding: Option<Rounding>,
    /// The shape's own materials, if new ground has them.
    materials: Option<GridMaterials>,
}

impl SculptKernel {
    /// The kernel of a checked operation.
    pub(super) fn new(operation: &QuantizedOperation, blend: QuantizedBlend, shape: &QuantizedShape) -> Self {
        let road = shape.road().filter(|_| *operation == QuantizedOperation::Road);
        let deep = match (operation, &road) {
            (QuantizedOperation::Stamp { stamp }, _) => shape.deepest().min(stamp.deep()),
            (_, Some((_, half_width))) => *half_width,
            _ => shape.deepest(),
        };
        let rounding = operation.rounding(blend.falloff);
        let builds = *operation == QuantizedOperation::Fill && blend.material.is_none();
        Self {
            operation: operation.clone(),
            blend,
            deep,
            road: road.map(|(road, _)| Arc::new(road)),
            rounding,
            materials: if builds { shape.materials() } else { None },
        }
    }

    /// The material of new ground, if the operation has one that is the same everywhere.
    pub fn material(&self) -> Option<MaterialId> {
        self.blend.material
    }

    /// The material of new ground at a lattice point; `None` for that of the ground near it.
    pub fn material_at(&self, at: IVec3) -> Option<MaterialId> {
        self.blend.material.or_else(|| self.materials.as_ref()?.at(at))
    }

    /// How it rounds edges, if it does. [`density`](Self::density) is for all others.
    pub fn rounding(&self) -> Option<Rounding> {
        self.rounding
    }

    /// The density of a sample after a rounded union or subtraction, from its distances to the shape and to the surface
    /// of the ground; `None` for operations that do not round.
    pub fn rounded(&self, before: i32, outside: i32, surface: i32) -> Option<i32> {
        let after = self.rounding?.density(before, outside, surface);
        Some(before + part(i64::from(after) - i64::from(before), self.blend.strength))
    }

    /// Whether only the CPU computes its densities.
    #[cfg(feature = "cuda")]
    pub fn is_for_cpu(&self) -> bool {
        self.road.is_some()
    }

    /// The density at a lattice point after the operation, from its distance to the shape and from what is around;
    /// `None` where it stays as it is.
    pub fn density(&self, at: IVec3, outside: i32, around: impl FnOnce() -> Stencil) -> Option<i32> {
        if outside > 0 {
            return None;
        }
        if let Some(road) = &self.road {
            let place = road.at(at)?;
            let weight = self.blend.weight(place.beside, self.deep);
            if weight == 0 {
                return None;
            }
            let own = around().own();
            return Some(own + part(i64::from(road.target(place, own)) - i64::from(own), weight));
        }
        let mut outside = outside;
        let target = match &self.operation {
            QuantizedOperation::Flatten { point, normal } => Some(above_plane(at, *point, *normal)),
            QuantizedOperation::Level { height } => Some(at.y * ONE - height),
            QuantizedOperation::Stamp { stamp } => {
                let (beside, above) = stamp.at(at);
                outside = outside.max(beside);
                Some(above)
            }
            _ => None,
        };
        let weight = self.blend.weight(outside, self.deep);
        if weight == 0 {
            return None;
        }
        let around = around();
        let own = around.densities[Stencil::MIDDLE];
        if let Some(target) = target {
            return Some(own + part(i64::from(target) - i64::from(own), weight));
        }
        match &self.operation {
            QuantizedOperation::Raise { amount } => return around.shifted(-amount, weight),
            QuantizedOperation::Lower { amount } => return around.shifted(*amount, weight),
            _ => {}
        }
        let middle = around.middle()?;
        match &self.operation {
            QuantizedOperation::Smooth => {
                let by = around.way_to_average(middle) * weight / (64 * ONE);
                (by != 0).then(|| around.attached(middle + by))
            }
            QuantizedOperation::Sharpen => {
                let by = (around.way_to_average(middle) * weight / (64 * ONE)).clamp(-SHARPER, SHARPER);
                let all = &around.densities;
                let (low, high) = all.iter().fold((own, own), |(low, high), &d| (low.min(d), high.max(d)));
                (by != 0).then(|| around.attached((middle - by).clamp(low, high)))
            }
            QuantizedOperation::Terrace { step, base } => {
                let surface = at.y * ONE - middle;
                let by = part(i64::from(surface) - i64::from(terraced(surface - base, *step) + base), weight);
                (by != 0).then_some(middle + by)
            }
            _ => None,
        }
    }
}

/// A sculpting operation as plain numbers, for the GPU.
#[cfg(feature = "cuda")]
pub(crate) struct SculptParams<'a> {
    pub strength: i32,
    /// Not wider than the shape is deep.
    pub falloff: i32,
    pub material: Option<MaterialId>,
    pub operation: SculptOp<'a>,
}

/// A sculpting operation with its parameters.
#[cfg(feature = "cuda")]
pub(crate) enum SculptOp<'a> {
    Smooth,
    Sharpen,
    /// A point of the plane, its normal, and what that measures.
    Flatten([i32; 3], [i16; 3], f64),
    Level(i32),
    /// The change of densities.
    Shift(i32),
    Stamp(StampParams<'a>),
    /// Step and base.
    Terrace(i32, i32),
    /// A union or a subtraction with a rounded edge.
    Rounded(Rounding),
}

#[cfg(feature = "cuda")]
impl SculptKernel {
    /// All parameters of densities; `None` unless the operation sculpts.
    pub(crate) fn constants(&self) -> Option<SculptParams<'_>> {
        let operation = match &self.operation {
            QuantizedOperation::Smooth => SculptOp::Smooth,
            QuantizedOperation::Sharpen => SculptOp::Sharpen,
            QuantizedOperation::Flatten { point, normal } => {
                SculptOp::Flatten(*point, *normal, measure(normal.map(i32::from)))
            }
            QuantizedOperation::Level { height } => SculptOp::Level(*height),
            QuantizedOperation::Raise { amount } => SculptOp::Shift(-amount),
            QuantizedOperation::Lower { amount } => SculptOp::Shift(*amount),
            QuantizedOperation::Stamp { stamp } => SculptOp::Stamp(stamp.constants()),
            QuantizedOperation::Terrace { step, base } => SculptOp::Terrace(*step, *base),
            QuantizedOperation::Fill | QuantizedOperation::Carve => SculptOp::Rounded(self.rounding?),
            QuantizedOperation::Dig
            | QuantizedOperation::Add { .. }
            | QuantizedOperation::Paint { .. }
            | QuantizedOperation::Reset
            | QuantizedOperation::Road
            | QuantizedOperation::Paste { .. } => {
                return None;
            }
        };
        let QuantizedBlend { strength, falloff, material } = self.blend;
        Some(SculptParams { strength, falloff: falloff.min(self.deep), material, operation })
    }
}

/// A part of `whole`, in 1/256, rounded away from zero, so that repeated strokes reach the whole.
fn part(whole: i64, weight: i32) -> i32 {
    let part = (whole.abs() * i64::from(weight) + i64::from(ONE) - 1) >> 8;
    (part * whole.signum()) as i32
}

/// A height in steps, with a riser over the middle quarter of each.
fn terraced(height: i32, step: i32) -> i32 {
    let tread = height.div_euclid(step) * step;
    let along = height - tread;
    tread + ((along - step * 3 / 8) * 4).clamp(0, step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_part_again_and_again_is_all(whole in -1_000_000..1_000_000i64, weight in 1..=256) {
            let mut rest = whole;
            for _ in 0..10_000 {
                rest -= i64::from(part(rest, weight));
            }
            prop_assert_eq!(rest, 0);
        }

        #[test]
        fn terraces_rise_and_never_fall(height in -100_000..100_000i32, step in 256..65_536i32) {
            let (low, high) = (terraced(height, step), terraced(height + 1, step));
            prop_assert!(low <= high && (low - height).abs() <= step * 3 / 8 + 1);
            let tread = height.div_euclid(step) * step;
            prop_assert_eq!(terraced(tread, step), tread);
        }
    }
}
