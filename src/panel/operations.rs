//! The table of the panel's operations.

use bevy::prelude::*;

use super::{BrushTool, ToolOperation, ToolShape, texts};
use crate::brush::{Operation, Stamp};
use crate::ground::MaterialId;
use crate::plugin::TerrainHit;

/// A setting that only some operations use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need {
    Material,
    Strength,
    Falloff,
    Amount,
    Level,
    Step,
    Height,
    Rounding,
}
use Need::{Amount, Falloff, Height, Level, Material, Rounding, Step, Strength};

/// A row of the table: an operation.
pub(super) struct Row {
    pub tool: ToolOperation,
    pub needs: &'static [Need],
    /// The icon: the ground's height before and after, in 0 to 1, from left (0) to right (1).
    pub profile: fn(f32) -> (f32, f32),
    make: fn(&BrushTool, &TerrainHit) -> Operation,
}

impl Row {
    pub fn operation(&self, tool: &BrushTool, hit: &TerrainHit) -> Operation {
        (self.make)(tool, hit)
    }

    pub fn name(&self) -> &'static str {
        texts::OPERATIONS[self.tool as usize].0
    }

    pub fn help(&self) -> &'static str {
        texts::OPERATIONS[self.tool as usize].1
    }

    /// Whether it rounds edges.
    pub fn rounds(&self) -> bool {
        self.needs.contains(&Rounding)
    }

    /// Whether ground that it adds may have a material that is chosen.
    pub fn may_fill(&self) -> bool {
        self.sculpts() || self.tool == ToolOperation::Merge
    }

    /// Whether it is a sculpting operation, which has a strength and a falloff.
    pub fn sculpts(&self) -> bool {
        self.needs.contains(&Strength)
    }
}

/// Every operation, in the panel's order, which is also the order of [`ToolOperation`].
#[rustfmt::skip]
pub(super) const OPERATIONS: &[Row] = &[
    Row { tool: ToolOperation::Dig, needs: &[],
        profile: |x| (0.62, 0.62 - 0.5 * bowl(x)), make: |_, _| Operation::Dig },
    Row { tool: ToolOperation::Add, needs: &[Material],
        profile: |x| (0.3, 0.3 + 0.5 * bowl(x)), make: |tool, _| Operation::Add { material: tool.material_id() } },
    Row { tool: ToolOperation::Paint, needs: &[Material],
        profile: |x| (0.25, 0.5 + 0.12 * (x * 6.0).sin()), make: |tool, _| Operation::Paint { material: tool.material_id() } },
    Row { tool: ToolOperation::Smooth, needs: &[Strength, Falloff],
        profile: |x| (0.5 + 0.3 * triangle_wave(x * 4.0), 0.5 + 0.08 * (x * 12.0).sin()), make: |_, _| Operation::Smooth },
    Row { tool: ToolOperation::Sharpen, needs: &[Strength, Falloff],
        profile: |x| (0.5 + 0.1 * (x * 12.0).sin(), 0.5 + 0.4 * triangle_wave(x * 3.0)), make: |_, _| Operation::Sharpen },
    Row { tool: ToolOperation::Flatten, needs: &[Strength, Falloff],
        profile: |x| (0.2 + 0.6 * x + 0.15 * (x * 14.0).sin(), 0.2 + 0.6 * x),
        make: |_, hit| Operation::Flatten { point: hit.position, normal: hit.normal } },
    Row { tool: ToolOperation::Level, needs: &[Level, Strength, Falloff],
        profile: |x| (0.5 + 0.35 * (x * 8.0).sin(), 0.5), make: |tool, _| Operation::Level { height: tool.level } },
    Row { tool: ToolOperation::Raise, needs: &[Amount, Strength, Falloff],
        profile: |x| (0.25, 0.25 + 0.6 * bell(x)), make: |tool, _| Operation::Raise { amount: tool.amount } },
    Row { tool: ToolOperation::Lower, needs: &[Amount, Strength, Falloff],
        profile: |x| (0.75, 0.75 - 0.6 * bell(x)), make: |tool, _| Operation::Lower { amount: tool.amount } },
    Row { tool: ToolOperation::Stamp, needs: &[Amount, Strength, Falloff],
        profile: |x| (0.2, 0.2 + 0.7 * (1.0 - (x - 0.5).abs() * 2.6).max(0.0)), make: stamp },
    Row { tool: ToolOperation::Terrace, needs: &[Step, Strength, Falloff],
        profile: |x| (0.1 + 0.8 * x, 0.1 + 0.8 * (x * 3.0).round() / 3.0),
        make: |tool, _| Operation::Terrace { step: tool.step, base: 0.0 } },
    Row { tool: ToolOperation::Road, needs: &[Height, Falloff],
        profile: |x| (0.3 + 0.4 * x + 0.12 * (x * 14.0).sin(), 0.3 + 0.4 * (3.0 * x - 1.0).clamp(0.0, 1.0)),
        make: |_, _| Operation::Road },
    Row { tool: ToolOperation::Paste, needs: &[],
        profile: |x| (0.2, if (x - 0.5).abs() < 0.25 { 0.75 } else { 0.2 }),
        make: paste },
    Row { tool: ToolOperation::Reset, needs: &[],
        profile: |x| (0.6 - 0.4 * bowl(x), 0.6), make: |_, _| Operation::Reset },
    Row { tool: ToolOperation::Clear, needs: &[],
        profile: |x| (0.45 + 0.25 * triangle_wave(x * 5.0), 0.2), make: |_, _| Operation::Paint { material: MaterialId::GROUND } },
    Row { tool: ToolOperation::Merge, needs: &[Rounding],
        profile: |x| (0.25, 0.25 + 0.6 * bell(x).max(0.8 * bowl(x))), make: |_, _| Operation::Fill },
    Row { tool: ToolOperation::Carve, needs: &[Rounding],
        profile: |x| (0.75, 0.75 - 0.6 * bell(x).max(0.8 * bowl(x))), make: |_, _| Operation::Carve },
];

/// A half ellipse in the middle.
fn bowl(x: f32) -> f32 {
    (1.0 - ((x - 0.5) / 0.32).powi(2)).max(0.0).sqrt()
}

/// A Gaussian bell curve in the middle.
fn bell(x: f32) -> f32 {
    (-((x - 0.5) / 0.18).powi(2)).exp()
}

/// A triangle wave between -1 and 1, of period 1.
fn triangle_wave(x: f32) -> f32 {
    ((x - x.floor()) * 4.0 - 2.0).abs() - 1.0
}

/// A stamp of the tool's image, as large as the tool and oriented like it.
fn stamp(tool: &BrushTool, hit: &TerrainHit) -> Operation {
    let size = Vec2::splat(2.0 * tool.width());
    match tool.stamp.image() {
        Some(image) => Operation::Stamp {
            stamp: Stamp::new(image, hit.position, size, tool.amount).with_rotation(tool.rotation(hit)),
        },
        None => Operation::Raise { amount: tool.amount },
    }
}

/// The tool's prefab.
fn paste(tool: &BrushTool, hit: &TerrainHit) -> Operation {
    match tool.paste_at(hit) {
        Some(paste) => Operation::Paste { paste },
        None => Operation::Paint { material: tool.material_id() },
    }
}

impl ToolOperation {
    /// All operations, in the panel's order.
    pub fn all() -> impl Iterator<Item = Self> {
        OPERATIONS.iter().map(|row| row.tool)
    }

    /// Its name on the panel.
    pub fn name(self) -> &'static str {
        self.row().name()
    }

    /// Whether a brush of this operation may have a shape. A stamp covers a whole area, so it can't be a ring, a path
    /// or a model; a road is a path; what is pasted has a shape of its own.
    pub fn fits(self, shape: ToolShape) -> bool {
        match self {
            Self::Stamp => !matches!(shape, ToolShape::Torus | ToolShape::Path | ToolShape::Model),
            Self::Road => shape == ToolShape::Path,
            Self::Paste => shape == ToolShape::Box,
            _ => true,
        }
    }

    pub(super) fn row(self) -> &'static Row {
        OPERATIONS.iter().find(|row| row.tool == self).unwrap_or(&OPERATIONS[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_operation_has_one_row_in_the_order_of_the_enum() {
        for (at, row) in OPERATIONS.iter().enumerate() {
            assert_eq!(row.tool as usize, at, "{}", row.name());
            assert_eq!(row.tool.row().name(), row.name());
        }
    }

    #[test]
    fn icons_stay_inside_their_tiles() {
        for row in OPERATIONS {
            for x in (0..=50).map(|x| x as f32 / 50.0) {
                let (before, after) = (row.profile)(x);
                assert!(
                    (0.0..=1.0).contains(&before) && (0.0..=1.0).contains(&after),
                    "{} at {x}",
                    row.name()
                );
            }
        }
    }
}
