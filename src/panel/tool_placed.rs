//! A placed brush: which handles it has, and what dragging one of them changes.

use std::ops::RangeInclusive;

use bevy::prelude::*;

use super::handle_geometry::{Axis, Handle};
use super::lengths::{LENGTH, TUBE};
use super::tool::{BrushTool, ToolAlign, ToolShape};
use super::tool_operation::ToolOperation;
use crate::plugin::TerrainHit;

/// Turning snaps to multiples of this many degrees, so that pastes turned by quarter turns are exact.
const STEP: f32 = 5.0;

/// Greatest scale of a prefab, and the inverse of the least.
const SCALE: f32 = 8.0;

impl BrushTool {
    /// Whether it can be placed. A path has points instead.
    pub(super) fn can_be_placed(&self) -> bool {
        self.fitting_shape() != ToolShape::Path
    }

    /// Its handles at a position.
    pub(super) fn handles(&self, hit: &TerrainHit) -> impl Iterator<Item = Handle> {
        let (axis, mut tool) = (self.rotation(hit) * Vec3::Y, self.clone());
        Handle::all().filter(move |handle| match handle {
            Handle::Ground | Handle::Move(_) => true,
            Handle::Turn(about) => tool.turns_about(about.unit(), axis),
            Handle::Scale(along) => tool.size(*along, 1.0).is_some(),
        })
    }

    /// Whether it looks different when it is turned about an axis.
    fn turns_about(&self, about: Vec3, axis: Vec3) -> bool {
        match self.fitting_shape() {
            _ if matches!(self.operation, ToolOperation::Stamp | ToolOperation::Paste) => true,
            ToolShape::Box | ToolShape::Model => true,
            ToolShape::Sphere | ToolShape::Path => false,
            ToolShape::Cylinder | ToolShape::Capsule | ToolShape::Cone | ToolShape::Torus => {
                about.dot(axis).abs() < 0.999
            }
        }
    }

    /// The size along one of its own axes, and its range.
    fn size(&mut self, along: Axis, voxel: f32) -> Option<(&mut f32, RangeInclusive<f32>)> {
        let radii = self.radii(voxel);
        match (self.fitting_shape(), along) {
            (_, Axis::Y) if self.operation == ToolOperation::Paste => {
                Some((&mut self.prefab.voxel_size, voxel / SCALE..=voxel * SCALE))
            }
            _ if self.operation == ToolOperation::Paste => None,
            (ToolShape::Path, _) => None,
            (ToolShape::Box, Axis::X) => Some((&mut self.half.x, radii)),
            (ToolShape::Box, Axis::Y) => Some((&mut self.half.y, radii)),
            (ToolShape::Box, Axis::Z) => Some((&mut self.half.z, radii)),
            (ToolShape::Torus, Axis::Y) => Some((&mut self.tube, TUBE.range(voxel))),
            (shape, Axis::Y) if shape.is_long() => Some((&mut self.length, LENGTH.range(voxel))),
            (_, Axis::X) => Some((&mut self.radius, radii)),
            _ => None,
        }
    }

    /// The tool after one of its handles was dragged from one [value](super::handle_geometry::Frame::value) to another.
    pub(super) fn dragged(&self, handle: Handle, from: f32, to: f32, voxel: f32) -> Self {
        let mut tool = self.clone();
        let Some(hit) = &mut tool.placed else { return tool };
        match handle {
            Handle::Ground => {}
            Handle::Move(axis) => hit.position += axis.unit() * (to - from),
            Handle::Turn(axis) => tool.turn_by(axis, ((to - from).to_degrees() / STEP).round() * STEP),
            Handle::Scale(axis) => {
                if let Some((size, range)) = tool.size(axis, voxel) {
                    *size = (*size * to / from).clamp(*range.start(), *range.end());
                }
                if tool.operation == ToolOperation::Paste {
                    // Back at its own size, a copy is exact again.
                    let steps = (tool.prefab.voxel_size / voxel * SCALE).round();
                    tool.prefab.voxel_size = steps.max(1.0) * voxel / SCALE;
                }
            }
        }
        tool
    }

    /// Turns the placed brush about an axis of the world.
    fn turn_by(&mut self, axis: Axis, degrees: f32) {
        let Some(mut hit) = self.placed else { return };
        if axis == Axis::Y && self.align == ToolAlign::Upright {
            self.turn += degrees;
        } else {
            let rotation = Quat::from_axis_angle(axis.unit(), degrees.to_radians()) * self.rotation(&hit);
            hit.normal = (rotation * Vec3::Y).normalize_or(Vec3::Y);
            (self.align, self.placed) = (ToolAlign::Surface, Some(hit));
            // The rest of the rotation is about the axis, after the axis itself has its direction.
            let about = Quat::from_rotation_arc(Vec3::Y, hit.normal).inverse() * rotation;
            self.turn = 2.0 * about.y.atan2(about.w).to_degrees();
        }
        self.turn = (self.turn + 180.0).rem_euclid(360.0) - 180.0;
    }
}
