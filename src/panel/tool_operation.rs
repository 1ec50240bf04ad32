//! The operations of the panel.

use bevy::prelude::*;

/// The operation of a [`BrushTool`](super::BrushTool).
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Default)]
pub enum ToolOperation {
    /// Removes ground.
    #[default]
    Dig,
    /// Fills its shape with ground.
    Add,
    /// Changes the material of the ground.
    Paint,
    /// Smooths bumps and edges.
    Smooth,
    /// Accentuates bumps and edges.
    Sharpen,
    /// Flattens the ground to a plane that is tangent to the surface at the brush.
    Flatten,
    /// Levels the ground at height [`BrushTool::level`](super::BrushTool::level).
    Level,
    /// Moves the surface outwards by [`BrushTool::amount`](super::BrushTool::amount).
    Raise,
    /// Moves the surface inwards by [`BrushTool::amount`](super::BrushTool::amount).
    Lower,
    /// Presses the image [`BrushTool::stamp`](super::BrushTool::stamp) onto the ground, with a height of
    /// [`BrushTool::amount`](super::BrushTool::amount).
    Stamp,
    /// Cuts slopes into terraces of height [`BrushTool::step`](super::BrushTool::step).
    Terrace,
    /// Levels the ground along a path, up and down by [`BrushTool::length`](super::BrushTool::length), with shoulders
    /// as wide as the falloff.
    Road,
    /// Puts down [`BrushTool::prefab`](super::BrushTool::prefab).
    Paste,
    /// Returns ground to what it was before any edit.
    Reset,
    /// Removes plants, and returns painted ground to its own material.
    Clear,
    /// Fills its shape with ground, and rounds the foot by [`BrushTool::rounding`](super::BrushTool::rounding).
    Merge,
    /// Removes ground, and rounds the rim by [`BrushTool::rounding`](super::BrushTool::rounding).
    Carve,
}
