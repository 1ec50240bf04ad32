//! The brush: what a game asks for.

use glam::{Quat, Vec3};

use super::{Operation, Roughness, Shape};
use crate::ground::MaterialId;

/// A wish to change the ground, in voxels of terrain space.
///
/// Nothing is checked here: [`Edit::quantize`](super::Edit::quantize) does, and says what is wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct Brush {
    /// Where.
    pub shape: Shape,
    /// What to do there.
    pub operation: Operation,
    /// Bumps on the shape's surface; `None` for a smooth one.
    pub roughness: Option<Roughness>,
    /// Any number of the game's own; the receipt carries it back.
    pub tag: u64,
}

impl Brush {
    fn new(shape: Shape, operation: Operation) -> Self {
        Self { shape, operation, roughness: None, tag: 0 }
    }

    /// A brush that takes ground away.
    pub fn dig(shape: Shape) -> Self {
        Self::new(shape, Operation::Dig)
    }

    /// A brush that fills its shape with ground.
    pub fn add(shape: Shape, material: MaterialId) -> Self {
        Self::new(shape, Operation::Add { material })
    }

    /// A brush that changes the material of the ground in its shape.
    pub fn paint(shape: Shape, material: MaterialId) -> Self {
        Self::new(shape, Operation::Paint { material })
    }

    /// The brush with bumps on its surface.
    pub fn with_roughness(self, roughness: Roughness) -> Self {
        Self { roughness: Some(roughness), ..self }
    }

    /// The brush with a number of the game's own, which the receipt carries back.
    pub fn with_tag(self, tag: u64) -> Self {
        Self { tag, ..self }
    }

    /// The brush after every point p moved to `rotation * (p * scale) + translation`: from world space to terrain
    /// space, say. Sizes and roughness grow with `scale`, which should be positive; the roughness pattern itself stays
    /// tied to the lattice.
    ///
    /// `rotation` should have length 1. Other numbers give a brush that [`Edit::quantize`](super::Edit::quantize)
    /// refuses or that is deformed.
    pub fn transformed(&self, rotation: Quat, translation: Vec3, scale: f32) -> Self {
        Self {
            shape: self.shape.transformed(rotation, translation, scale),
            operation: self.operation,
            roughness: self.roughness.map(|roughness| Roughness {
                amplitude: roughness.amplitude * scale,
                scale: roughness.scale * scale,
                ..roughness
            }),
            tag: self.tag,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_brush_can_be_a_message() {
        fn is_message<T: Clone + Send + Sync + 'static>() {}
        is_message::<Brush>();
    }

    #[test]
    fn transforming_moves_points_turns_axes_and_scales_sizes() {
        let turn = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let brush = Brush::dig(Shape::cone(Vec3::X, Vec3::X, 3.0))
            .with_tag(7)
            .with_roughness(Roughness::new(1.0, 4.0, 9));
        let moved = brush.transformed(turn, Vec3::splat(10.0), 2.0);
        let Shape::Cone { base, axis, radius } = moved.shape else { panic!("still a cone") };
        assert!(base.abs_diff_eq(Vec3::new(10.0, 12.0, 10.0), 1e-5), "{base}");
        assert!(axis.abs_diff_eq(Vec3::new(0.0, 2.0, 0.0), 1e-5), "{axis}");
        assert_eq!((radius, moved.tag), (6.0, 7));
        assert_eq!(moved.roughness, Some(Roughness::new(2.0, 8.0, 9)));
    }
}
