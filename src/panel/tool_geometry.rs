//! Where the current brush is, and which shape and size it has.

use std::ops::RangeInclusive;

use bevy::prelude::*;

use super::lengths::RADIUS;
use super::tool::{BrushTool, PATH_POINTS, ToolAlign, ToolShape};
use super::tool_operation::ToolOperation;
use crate::brush::{BrushPath, Shape};
use crate::plugin::TerrainHit;

impl BrushTool {
    /// The middle of the brush at a position.
    pub(super) fn middle(&self, hit: &TerrainHit) -> Vec3 {
        hit.position - self.axis(hit) * self.sink * self.reach()
    }

    /// The path through its points to a last one. A single point makes a short one.
    pub(super) fn path_to(&self, end: Vec3) -> BrushPath {
        let mut points: Vec<Vec3> = self.points.iter().copied().take(PATH_POINTS).collect();
        if points.is_empty() {
            points.push(end - Vec3::X * 0.1 * self.radius);
        }
        points.push(end);
        let points = points.into_iter().map(|point| (point, self.radius));
        if self.is_smooth { BrushPath::spline(points) } else { BrushPath::polyline(points) }
    }

    /// The shape of [`brush_at`](Self::brush_at), for a preview.
    ///
    /// For a path, a ball at its end; for a model, the box around it.
    pub fn shape_at(&self, hit: &TerrainHit) -> Shape {
        let paste = self.paste_at(hit).filter(|_| self.operation == ToolOperation::Paste);
        paste.map_or_else(|| self.shape_around(self.middle(hit), self.axis(hit)), |paste| paste.shape())
    }

    /// The shape that its operation has: the chosen one if it [fits](ToolOperation::fits), else the first that does.
    pub fn fitting_shape(&self) -> ToolShape {
        let fits = |shape: &ToolShape| self.operation.fits(*shape);
        let first = ToolShape::ALL.into_iter().find(fits).unwrap_or_default();
        if fits(&self.shape) { self.shape } else { first }
    }

    /// The height of a stamp above the ground at a place in its square, for a preview: `u` and `v` go from -1 to 1.
    /// `None` for other operations.
    pub fn stamp_height(&self, u: f32, v: f32) -> Option<f32> {
        let image = self.stamp.image().filter(|_| self.operation == ToolOperation::Stamp)?;
        let at = |part: f32, samples: u32| {
            ((0.5 + 0.5 * part.clamp(-1.0, 1.0)) * (samples - 1) as f32).round() as usize
        };
        let sample = at(v, image.height()) * image.width() as usize + at(u, image.width());
        Some(f32::from(*image.samples().get(sample)?) / f32::from(u16::MAX) * self.amount)
    }

    /// The shape around its centre.
    pub(super) fn shape_around(&self, middle: Vec3, axis: Vec3) -> Shape {
        let end = middle - axis * self.length / 2.0;
        match self.fitting_shape() {
            ToolShape::Sphere | ToolShape::Path => Shape::sphere(middle, self.radius),
            ToolShape::Box => Shape::turned_cuboid(middle, self.half, self.turned(axis)),
            ToolShape::Model => Shape::turned_cuboid(middle, self.model.half(self.radius), self.turned(axis)),
            ToolShape::Cylinder => Shape::cylinder(end, axis * self.length, self.radius),
            ToolShape::Capsule => Shape::capsule(end, end + axis * self.length, self.radius),
            ToolShape::Cone => Shape::cone(end, axis * self.length, self.radius),
            ToolShape::Torus => Shape::torus(middle, axis, self.radius, self.tube.min(self.radius)),
        }
    }

    /// How the brush is turned at a position: from upright to its axis, and about it.
    pub fn rotation(&self, hit: &TerrainHit) -> Quat {
        self.turned(self.axis(hit))
    }

    fn turned(&self, axis: Vec3) -> Quat {
        Quat::from_rotation_arc(Vec3::Y, axis) * Quat::from_rotation_y(self.turn.to_radians())
    }

    /// The direction of its axis at this position.
    pub(super) fn axis(&self, hit: &TerrainHit) -> Vec3 {
        match self.align {
            ToolAlign::Upright => Vec3::Y,
            ToolAlign::Surface => hit.normal.try_normalize().unwrap_or(Vec3::Y),
        }
    }

    /// Half of its largest horizontal extent.
    pub fn width(&self) -> f32 {
        let half = match self.fitting_shape() {
            _ if self.operation == ToolOperation::Paste => self.prefab.half(),
            ToolShape::Box => self.half,
            ToolShape::Model => self.model.half(self.radius),
            ToolShape::Torus => Vec3::splat(self.radius + self.tube.min(self.radius)),
            _ => Vec3::splat(self.radius),
        };
        half.x.max(half.z)
    }

    /// Half extent along its axis.
    fn reach(&self) -> f32 {
        match self.fitting_shape() {
            ToolShape::Sphere | ToolShape::Path => self.radius,
            ToolShape::Box => self.half.y,
            ToolShape::Model => self.model.half(self.radius).y,
            ToolShape::Cylinder | ToolShape::Cone => self.length / 2.0,
            ToolShape::Capsule => self.length / 2.0 + self.radius,
            ToolShape::Torus => self.tube.min(self.radius),
        }
    }

    /// The radii that its shape may have.
    pub(super) fn radii(&self, voxel_size: f32) -> RangeInclusive<f32> {
        let range = RADIUS.range(voxel_size);
        let is_model = self.fitting_shape() == ToolShape::Model;
        let least = if is_model { self.model.least_radius() * voxel_size } else { 0.0 };
        range.start().max(least)..=range.end().max(least)
    }

    /// Scales its radius, or the size of a box, within the range of the panel's sliders for this voxel size. Useful
    /// for a mouse wheel.
    pub fn grow(&mut self, factor: f32, voxel_size: f32) {
        let range = self.radii(voxel_size);
        let grow = |size: f32| (size * factor).clamp(*range.start(), *range.end());
        match self.fitting_shape() {
            ToolShape::Box => self.half = self.half.map(grow),
            _ => self.radius = grow(self.radius),
        }
    }
}
