//! Lines that show a shape: for previews and icons.

use glam::{Quat, Vec3};

/// Points of a circle.
const STEPS: u16 = 48;

/// Where lines go, one by one.
pub struct Outline<'a>(&'a mut dyn FnMut(Vec3, Vec3));

impl<'a> Outline<'a> {
    pub fn new(line: &'a mut dyn FnMut(Vec3, Vec3)) -> Self {
        Self(line)
    }

    pub fn line(&mut self, from: Vec3, to: Vec3) {
        self.0(from, to);
    }

    /// A circle across an axis of any length.
    pub fn circle(&mut self, center: Vec3, axis: Vec3, radius: f32) {
        let turn = across(axis);
        let point = |step: u16| {
            let angle = f32::from(step % STEPS) / f32::from(STEPS) * std::f32::consts::TAU;
            center + turn * Vec3::new(angle.cos(), angle.sin(), 0.0) * radius
        };
        (0..STEPS).for_each(|step| self.line(point(step), point(step + 1)));
    }

    /// Three circles around a ball.
    pub fn ball(&mut self, center: Vec3, radius: f32) {
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            self.circle(center, axis, radius);
        }
    }

    /// Two circles, each with its middle and radius, and four lines between them.
    pub fn tube(&mut self, ends: [(Vec3, f32); 2]) {
        let [(a, from), (b, to)] = ends;
        for (middle, radius) in ends.into_iter().filter(|end| end.1 > 0.0) {
            self.circle(middle, b - a, radius);
        }
        for side in [Vec3::X, Vec3::Y, Vec3::NEG_X, Vec3::NEG_Y].map(|side| across(b - a) * side) {
            self.line(a + side * from, b + side * to);
        }
    }
}

/// Turns z to an axis.
fn across(axis: Vec3) -> Quat {
    Quat::from_rotation_arc(Vec3::Z, axis.try_normalize().unwrap_or(Vec3::Y))
}
