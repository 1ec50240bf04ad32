//! From a brush to the record.

use glam::{Quat, Vec3};

use super::{BrushRecord, OperationName, ShapeName};
use crate::brush::{Brush, FULL_POWER, Operation, Shape};

impl From<&Brush> for BrushRecord {
    fn from(brush: &Brush) -> Self {
        let mut record = Self::empty(ShapeName::Sphere, OperationName::Dig);
        record.write_shape(&brush.shape);
        record.write_operation(&brush.operation);
        if brush.operation.is_sculpting() {
            record.write_blend(brush);
        }
        record.roughness = brush.roughness;
        record.tag = (brush.tag != 0).then_some(brush.tag);
        record.stroke = brush.stroke;
        record.power = (brush.power != FULL_POWER).then_some(brush.power);
        record
    }
}

impl BrushRecord {
    fn empty(shape: ShapeName, op: OperationName) -> Self {
        Self {
            shape,
            center: None,
            half: None,
            rotation: None,
            base: None,
            axis: None,
            from: None,
            to: None,
            radius: None,
            op,
            material: None,
            roughness: None,
            tag: None,
            stroke: None,
            point: None,
            normal: None,
            height: None,
            amount: None,
            step: None,
            stamp: None,
            strength: None,
            falloff: None,
            power: None,
        }
    }

    fn write_shape(&mut self, shape: &Shape) {
        self.shape = match *shape {
            Shape::Sphere { center, radius } => {
                (self.center, self.radius) = (vector(center), Some(radius));
                ShapeName::Sphere
            }
            Shape::Cuboid { center, half, rotation } => {
                (self.center, self.half) = (vector(center), vector(half));
                self.rotation = (rotation != Quat::IDENTITY).then(|| rotation.to_array());
                ShapeName::Box
            }
            Shape::Cylinder { base, axis, radius } => {
                (self.base, self.axis, self.radius) = (vector(base), vector(axis), Some(radius));
                ShapeName::Cylinder
            }
            Shape::Capsule { from, to, radius } => {
                (self.from, self.to, self.radius) = (vector(from), vector(to), Some(radius));
                ShapeName::Capsule
            }
            Shape::Cone { base, axis, radius } => {
                (self.base, self.axis, self.radius) = (vector(base), vector(axis), Some(radius));
                ShapeName::Cone
            }
        };
    }

    fn write_operation(&mut self, operation: &Operation) {
        self.op = match operation {
            Operation::Dig => OperationName::Dig,
            Operation::Add { material } => {
                self.material = Some(*material);
                OperationName::Add
            }
            Operation::Paint { material } => {
                self.material = Some(*material);
                OperationName::Paint
            }
            Operation::Smooth => OperationName::Smooth,
            Operation::Sharpen => OperationName::Sharpen,
            Operation::Flatten { point, normal } => {
                (self.point, self.normal) = (vector(*point), vector(*normal));
                OperationName::Flatten
            }
            Operation::Level { height } => {
                self.height = Some(*height);
                OperationName::Level
            }
            Operation::Raise { amount } => {
                self.amount = Some(*amount);
                OperationName::Raise
            }
            Operation::Lower { amount } => {
                self.amount = Some(*amount);
                OperationName::Lower
            }
            Operation::Stamp(stamp) => {
                self.stamp = Some(stamp.into());
                OperationName::Stamp
            }
            Operation::Terrace { step, base } => {
                (self.step, self.height) = (Some(*step), (*base != 0.0).then_some(*base));
                OperationName::Terrace
            }
        };
    }

    /// What differs from the blend that the brush's operation comes with.
    fn write_blend(&mut self, brush: &Brush) {
        let like = Brush::plain(brush.shape, brush.operation.clone()).blend;
        self.strength = (brush.blend.strength != like.strength).then_some(brush.blend.strength);
        self.falloff = (brush.blend.falloff != like.falloff).then_some(brush.blend.falloff);
        self.material = brush.blend.material;
    }
}

fn vector(v: Vec3) -> Option<[f32; 3]> {
    Some(v.to_array())
}
