//! Input of the stencil-edit kernel.

use bytemuck::{Pod, Zeroable};

use super::{Address, EditParams, NONE};
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::brush::{Rounding, SculptKernel, SculptOp};
use crate::edits::BatchRules;
use crate::ground::GreyImage;
use crate::lattice::LatticeBox;

/// What a stencil edit needs in addition to its [`EditRecord`](super::EditRecord). See `layout.cuh` for the fields.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SculptParams {
    /// 0 plain, 1 smooth, 2 sharpen, 3 flatten, 4 level, 5 shift, 6 stamp, 7 terrace, 8 fill, 9 carve.
    pub operation: u32,
    /// Material of new ground, or [`NONE`] to take it from a fill's grid or from the surroundings.
    pub material: u32,
    pub strength: i32,
    pub falloff: i32,
    pub amounts: [i32; 2],
    pub point: [i32; 3],
    pub half: [i32; 2],
    pub height: i32,
    pub image: u32,
    pub columns: u32,
    pub rows: u32,
    /// The hardness that it can remove; negative if no rule applies.
    pub power: i32,
    pub matrix: [[i64; 3]; 3],
    pub squared: i64,
    pub length: f64,
}

/// Rules that forbid or slow down edits. The [`Protected`] boxes follow directly.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Rules {
    pub hardness: [u8; 256],
    pub unbreakable: [u32; 8],
    pub bedrock: i32,
    /// Number of protected boxes.
    pub boxes: u32,
}

/// Inclusive bounds of samples that no edit changes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Protected {
    pub min: [i32; 3],
    pub max: [i32; 3],
}

/// Parameters of `stencil_edit`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct StencilEditParams {
    /// No job's target may be referred to by another job or by `windows`.
    pub edit: EditParams,
    /// References of bricks. For each job they include all 27 bricks around, and `look` bricks above and below.
    pub windows: Address,
    /// One [`SculptParams`] per edit record.
    pub sculpt_params: Address,
    /// Distances to the surface, as in [`SurfaceStartParams`](super::SurfaceStartParams).
    pub surface: Address,
    /// [`Rules`], or 0.
    pub rules: Address,
    pub look: i32,
    /// The last columns of the world along x and z.
    pub last: [i32; 2],
    pub pad: u32,
}

impl KernelParams for StencilEditParams {
    const KERNEL: Kernel = Kernel::StencilEdit;
}

/// The sculpting parameters of an edit. `image` returns the index of an image's first sample.
pub(crate) fn sculpt<'a>(
    record: &'a crate::edits::PreparedEdit,
    image: impl FnOnce(&'a GreyImage) -> u32,
) -> SculptParams {
    let power = if record.is_ruled { record.power.into() } else { -1 };
    let Some(of) = record.sculptor.as_ref().and_then(SculptKernel::constants) else {
        return SculptParams { power, ..SculptParams::default() };
    };
    let sculpt = |operation| SculptParams {
        power,
        operation,
        material: of.material.map_or(NONE, |material| material.0.into()),
        strength: of.strength,
        falloff: of.falloff,
        ..SculptParams::default()
    };
    match &of.operation {
        SculptOp::Smooth => sculpt(1),
        SculptOp::Sharpen => sculpt(2),
        &SculptOp::Flatten(point, normal, length) => {
            let matrix = [normal.map(i64::from), [0; 3], [0; 3]];
            SculptParams { point, matrix, length, ..sculpt(3) }
        }
        &SculptOp::Level(height) => SculptParams { amounts: [height, 0], ..sculpt(4) },
        &SculptOp::Shift(by) => SculptParams { amounts: [by, 0], ..sculpt(5) },
        SculptOp::Stamp(stamp) => SculptParams {
            point: stamp.center,
            half: stamp.half,
            height: stamp.height,
            image: image(stamp.image),
            columns: stamp.image.width(),
            rows: stamp.image.height(),
            matrix: stamp.rows,
            squared: stamp.squared,
            ..sculpt(6)
        },
        &SculptOp::Terrace(step, base) => SculptParams { amounts: [step, base], ..sculpt(7) },
        &SculptOp::Rounded(Rounding { radius, is_dig }) => {
            SculptParams { amounts: [radius, 0], ..sculpt(if is_dig { 9 } else { 8 }) }
        }
    }
}

/// The rules and the protected boxes.
pub(crate) fn rules(run: &BatchRules) -> (Rules, Vec<Protected>) {
    let boxes = |samples: &LatticeBox| Protected { min: samples.min.to_array(), max: samples.max.to_array() };
    let (of, boxes): (_, Vec<Protected>) = (run.rules, run.protected.iter().map(boxes).collect());
    let mut rules = Rules {
        hardness: [0; 256],
        unbreakable: [0; 8],
        bedrock: of.bedrock.unwrap_or(i32::MIN),
        boxes: boxes.len() as u32,
    };
    of.hardness.iter().for_each(|(material, &hardness)| rules.hardness[usize::from(material.0)] = hardness);
    of.unbreakable
        .iter()
        .for_each(|material| rules.unbreakable[usize::from(material.0 / 32)] |= 1 << (material.0 % 32));
    (rules, boxes)
}
