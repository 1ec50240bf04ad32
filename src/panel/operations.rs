//! The operations of the panel: one table, a row for each.

use bevy::prelude::*;

use super::BrushTool;
use crate::brush::Operation;
use crate::plugin::TerrainHit;

/// What a [`BrushTool`] does.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub enum ToolOperation {
    /// Takes ground away.
    #[default]
    Dig,
    /// Fills its shape with ground.
    Add,
    /// Changes the material.
    Paint,
}

/// Which settings an operation has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Needs {
    pub material: bool,
    pub strength: bool,
    pub hardness: bool,
    /// What [`BrushTool::height`] means, if anything.
    pub height: Option<&'static str>,
}

const NOTHING: Needs = Needs { material: false, strength: false, hardness: false, height: None };

/// A row of the table.
pub(super) struct Row {
    pub tool: ToolOperation,
    pub name: &'static str,
    pub help: &'static str,
    pub needs: Needs,
    /// The ground's height before and after, from left (0) to right (1): its icon.
    pub profile: fn(f32) -> (f32, f32),
    make: fn(&BrushTool, &TerrainHit) -> Operation,
}

impl Row {
    pub fn operation(&self, tool: &BrushTool, hit: &TerrainHit) -> Operation {
        (self.make)(tool, hit)
    }
}

/// Every operation, in the panel's order. That of [`ToolOperation`] itself is the same.
pub(super) const OPERATIONS: &[Row] = &[
    Row {
        tool: ToolOperation::Dig,
        name: "Dig",
        help: "Takes ground away",
        needs: NOTHING,
        profile: |x| (0.62, 0.62 - 0.5 * bowl(x)),
        make: |_, _| Operation::Dig,
    },
    Row {
        tool: ToolOperation::Add,
        name: "Build",
        help: "Fills the shape with ground",
        needs: Needs { material: true, ..NOTHING },
        profile: |x| (0.3, 0.3 + 0.5 * bowl(x)),
        make: |tool, _| Operation::Add { material: tool.material_id() },
    },
    Row {
        tool: ToolOperation::Paint,
        name: "Paint",
        help: "Changes the material of ground that is there",
        needs: Needs { material: true, ..NOTHING },
        profile: |x| (0.3, 0.45 + 0.18 * (x * 5.5).sin()),
        make: |tool, _| Operation::Paint { material: tool.material_id() },
    },
];

/// Half an ellipse in the middle.
fn bowl(x: f32) -> f32 {
    (1.0 - ((x - 0.5) / 0.32).powi(2)).max(0.0).sqrt()
}

impl ToolOperation {
    /// All of them, in the panel's order.
    pub fn all() -> impl Iterator<Item = Self> {
        OPERATIONS.iter().map(|row| row.tool)
    }

    /// Its name on the panel.
    pub fn name(self) -> &'static str {
        self.row().name
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
            assert_eq!(row.tool as usize, at, "{}", row.name);
            assert_eq!(row.tool.row().name, row.name);
        }
    }

    #[test]
    fn icons_stay_inside_their_tiles() {
        for row in OPERATIONS {
            for x in (0..=50).map(|x| x as f32 / 50.0) {
                let (before, after) = (row.profile)(x);
                assert!((0.0..=1.0).contains(&before) && (0.0..=1.0).contains(&after), "{} at {x}", row.name);
            }
        }
    }
}
