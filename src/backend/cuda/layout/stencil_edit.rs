//! Parameters of the stencil-edit kernel.

use bytemuck::{Pod, Zeroable};

use super::{Address, EditParams, NONE};
use crate::backend::cuda::device::{Kernel, KernelParams};
use crate::brush::{SculptKernel, Stroke};
use crate::edits::BatchRules;
use crate::ground::GreyImage;
use crate::lattice::LatticeBox;

/// What a stencil edit needs beside its [`EditRecord`]. See `layout.cuh`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct SculptParams {
    /// Plain, smooth, sharpen, flatten, level, shift, stamp, terrace.
    pub stroke: u32,
    /// Of new ground; [`NONE`] where what is around says it.
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
    /// Negative: no rule bears on it.
    pub power: i32,
    pub matrix: [[i64; 3]; 3],
    pub squared: i64,
    pub length: f64,
}

/// What edits may not change, or not at once; [`Protected`] boxes come right behind.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Rules {
    pub hardness: [u8; 256],
    pub unbreakable: [u32; 8],
    pub bedrock: i32,
    /// How many.
    pub boxes: u32,
}

/// Samples that nothing changes, both ends included.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Protected {
    pub min: [i32; 3],
    pub max: [i32; 3],
}

/// The parameter of `stencil_edit`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct StencilEditParams {
    /// No job's target may be what another job, or an entry of `windows`, refers to.
    pub edit: EditParams,
    /// References of bricks. Of each job all 27 around must be there, and above and below as many as `look` says.
    pub windows: Address,
    /// [`SculptParams`] for each edit record.
    pub sculpt_params: Address,
    /// Samples of images, `u16` each.
    pub images: Address,
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

/// The sculpting parameters of an edit; `image` returns where the samples of an image begin.
pub(crate) fn sculpt<'a>(
    record: &'a crate::edits::PreparedEdit,
    image: impl FnOnce(&'a GreyImage) -> u32,
) -> SculptParams {
    let power = if record.is_ruled { record.power.into() } else { -1 };
    let Some(of) = record.sculptor.as_ref().and_then(SculptKernel::constants) else {
        return SculptParams { power, ..SculptParams::default() };
    };
    let sculpt = |stroke| SculptParams {
        power,
        stroke,
        material: of.material.map_or(NONE, |material| material.0.into()),
        strength: of.strength,
        falloff: of.falloff,
        ..SculptParams::default()
    };
    match &of.stroke {
        Stroke::Smooth => sculpt(1),
        Stroke::Sharpen => sculpt(2),
        &Stroke::Flatten(point, normal, length) => {
            let matrix = [normal.map(i64::from), [0; 3], [0; 3]];
            SculptParams { point, matrix, length, ..sculpt(3) }
        }
        &Stroke::Level(height) => SculptParams { amounts: [height, 0], ..sculpt(4) },
        &Stroke::Shift(by) => SculptParams { amounts: [by, 0], ..sculpt(5) },
        Stroke::Stamp(press) => SculptParams {
            point: press.center,
            half: press.half,
            height: press.height,
            image: image(press.image),
            columns: press.image.width(),
            rows: press.image.height(),
            matrix: press.rows,
            squared: press.squared,
            ..sculpt(6)
        },
        &Stroke::Terrace(step, base) => SculptParams { amounts: [step, base], ..sculpt(7) },
    }
}

/// Rules, and what is protected.
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
