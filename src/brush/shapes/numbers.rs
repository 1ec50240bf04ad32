//! The number types in which shapes are written, and conversions between them.

use std::fmt::Debug;

use glam::{Quat, Vec3};

use crate::brush::BrushError;
use crate::brush::quantize::{self, Shift, voxels};

/// The type of numbers in a shape: [`Voxels`] in a brush, [`Units`] in an edit.
pub trait Numbers: Copy + Debug + PartialEq {
    /// A place, the way to another place, or half the sides of a box.
    type Vector: Copy + Debug + PartialEq;
    /// A direction of any length but zero.
    type Direction: Copy + Debug + PartialEq;
    /// A radius.
    type Length: Copy + Debug + PartialEq;
    /// A rotation.
    type Turn: Copy + Debug + PartialEq;

    /// The rotation that turns nothing.
    fn unturned() -> Self::Turn;

    /// Returns `true` if a rotation may be left out when a shape is written.
    fn may_leave_out(_: &Self::Turn) -> bool {
        false
    }
}

/// Floats, in voxels of terrain space; in a message to the plugin, in units of world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voxels;

impl Numbers for Voxels {
    type Vector = Vec3;
    type Direction = Vec3;
    type Length = f32;
    type Turn = Quat;

    fn unturned() -> Quat {
        Quat::IDENTITY
    }

    fn may_leave_out(turn: &Quat) -> bool {
        *turn == Quat::IDENTITY
    }
}

/// Integers: lengths in 1/256 voxel, directions and rotations in 1/32767.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Units;

impl Numbers for Units {
    type Vector = [i32; 3];
    type Direction = [i16; 3];
    type Length = i32;
    type Turn = [i16; 4];

    fn unturned() -> [i16; 4] {
        [0, 0, 0, i16::MAX]
    }
}

/// What a vector is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A place.
    Point,
    /// The way from one place to another.
    Arrow,
    /// Half the sides of a box.
    Sides,
}

/// Converts the numbers of a shape, one after the other, each with the name of its field. A conversion of all
/// points, for example, is then written once and not once for each shape.
pub trait Convert {
    /// The number type before conversion.
    type From: Numbers;
    /// The number type after conversion.
    type To: Numbers;

    fn vector(
        &mut self,
        field: &'static str,
        kind: Kind,
        value: Vector<Self::From>,
    ) -> Made<Vector<Self::To>>;
    fn direction(&mut self, field: &'static str, value: Direction<Self::From>) -> Made<Direction<Self::To>>;
    fn length(&mut self, field: &'static str, value: Length<Self::From>) -> Made<Length<Self::To>>;
    fn turn(&mut self, field: &'static str, value: Turn<Self::From>) -> Made<Turn<Self::To>>;
}

type Made<T> = Result<T, BrushError>;
type Vector<N> = <N as Numbers>::Vector;
type Direction<N> = <N as Numbers>::Direction;
type Length<N> = <N as Numbers>::Length;
type Turn<N> = <N as Numbers>::Turn;

/// Rounds a brush's numbers to integers, halves to even.
pub(super) struct Quantize;

impl Convert for Quantize {
    type From = Voxels;
    type To = Units;

    fn vector(&mut self, field: &'static str, kind: Kind, value: Vec3) -> Made<[i32; 3]> {
        match kind {
            Kind::Point => quantize::point(field, value),
            Kind::Arrow => quantize::arrow(field, value),
            Kind::Sides => {
                let [x, y, z] = value.to_array().map(|side| quantize::size(field, side));
                Ok([x?, y?, z?])
            }
        }
    }

    fn direction(&mut self, field: &'static str, value: Vec3) -> Made<[i16; 3]> {
        quantize::direction(field, value)
    }

    fn length(&mut self, field: &'static str, value: f32) -> Made<i32> {
        quantize::size(field, value)
    }

    fn turn(&mut self, _: &'static str, value: Quat) -> Made<[i16; 4]> {
        quantize::turn(value)
    }
}

/// Checks integers that may come from anywhere against the same limits.
pub(super) struct Check;

impl Convert for Check {
    type From = Units;
    type To = Units;

    fn vector(&mut self, field: &'static str, kind: Kind, value: [i32; 3]) -> Made<[i32; 3]> {
        match kind {
            Kind::Point => quantize::check_point(field, value)?,
            Kind::Arrow => quantize::check_arrow(field, value)?,
            Kind::Sides => value.into_iter().try_for_each(|side| quantize::check_size(field, side))?,
        }
        Ok(value)
    }

    fn direction(&mut self, field: &'static str, value: [i16; 3]) -> Made<[i16; 3]> {
        quantize::check_direction(field, value).map(|()| value)
    }

    fn length(&mut self, field: &'static str, value: i32) -> Made<i32> {
        quantize::check_size(field, value).map(|()| value)
    }

    fn turn(&mut self, _: &'static str, value: [i16; 4]) -> Made<[i16; 4]> {
        quantize::check_turn(value).map(|()| value)
    }
}

/// Gives a brush's own numbers back.
pub(super) struct Restore;

impl Convert for Restore {
    type From = Units;
    type To = Voxels;

    fn vector(&mut self, _: &'static str, _: Kind, value: [i32; 3]) -> Made<Vec3> {
        Ok(quantize::restored_point(value))
    }

    fn direction(&mut self, _: &'static str, value: [i16; 3]) -> Made<Vec3> {
        Ok(quantize::restored_direction(value))
    }

    fn length(&mut self, _: &'static str, value: i32) -> Made<f32> {
        Ok(voxels(value))
    }

    fn turn(&mut self, _: &'static str, value: [i16; 4]) -> Made<Quat> {
        Ok(quantize::restored_turn(value))
    }
}

/// Moves a shape.
pub(super) struct Transform<'a> {
    /// What becomes of arrows; points are moved by `shift` after that.
    pub arrow: &'a dyn Fn(Vec3) -> Vec3,
    pub shift: Shift,
    /// What becomes of rotations.
    pub turn: Quat,
    /// What becomes of sizes.
    pub scale: f32,
    /// The names of the fields.
    pub fields: Vec<&'static str>,
}

impl Convert for Transform<'_> {
    type From = Voxels;
    type To = Voxels;

    fn vector(&mut self, field: &'static str, kind: Kind, value: Vec3) -> Made<Vec3> {
        self.fields.push(field);
        Ok(match kind {
            Kind::Point => self.shift.point((self.arrow)(value)),
            Kind::Arrow => (self.arrow)(value),
            Kind::Sides => value * self.scale,
        })
    }

    fn direction(&mut self, field: &'static str, value: Vec3) -> Made<Vec3> {
        self.fields.push(field);
        Ok((self.arrow)(value))
    }

    fn length(&mut self, field: &'static str, value: f32) -> Made<f32> {
        self.fields.push(field);
        Ok(value * self.scale)
    }

    fn turn(&mut self, field: &'static str, value: Quat) -> Made<Quat> {
        self.fields.push(field);
        Ok(self.turn * value)
    }
}
