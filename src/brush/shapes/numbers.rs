//! The numbers that shapes are told in, and how one kind becomes another.

use std::fmt::Debug;

use glam::{Quat, Vec3};

use crate::brush::BrushError;
use crate::brush::quantize::{self, voxels};

/// What the fields of a shape hold: [`Voxels`] in a brush, integers in an edit.
pub trait Numbers: Copy + Debug + PartialEq {
    /// A place.
    type Point: Copy + Debug + PartialEq;
    /// The way from one place to another.
    type Arrow: Copy + Debug + PartialEq;
    /// A direction of any length but zero.
    type Direction: Copy + Debug + PartialEq;
    /// A radius.
    type Length: Copy + Debug + PartialEq;
    /// Half the sides of a box.
    type Sides: Copy + Debug + PartialEq;
    /// A rotation.
    type Turn: Copy + Debug + PartialEq;

    /// The rotation that turns nothing.
    fn unturned() -> Self::Turn;

    /// May a rotation be left out where shapes are written?
    fn may_leave_out(_: &Self::Turn) -> bool {
        false
    }
}

/// Floats, in voxels of terrain space; in a message to the plugin, in units of world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voxels;

impl Numbers for Voxels {
    type Point = Vec3;
    type Arrow = Vec3;
    type Direction = Vec3;
    type Length = f32;
    type Sides = Vec3;
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
    type Point = [i32; 3];
    type Arrow = [i32; 3];
    type Direction = [i16; 3];
    type Length = i32;
    type Sides = [i32; 3];
    type Turn = [i16; 4];

    fn unturned() -> [i16; 4] {
        [0, 0, 0, i16::MAX]
    }
}

/// Makes other numbers of those of a shape, which hands over one after the other with the name of its field. So what
/// happens to all points, say, is written once, and not once for each shape.
pub trait Convert {
    /// What the fields hold.
    type From: Numbers;
    /// What they shall hold.
    type To: Numbers;

    /// Converts a place.
    fn point(&mut self, field: &'static str, value: Point<Self::From>)
    -> Result<Point<Self::To>, BrushError>;
    /// Converts the way from one place to another.
    fn arrow(&mut self, field: &'static str, value: Arrow<Self::From>)
    -> Result<Arrow<Self::To>, BrushError>;
    /// Converts a direction.
    fn direction(
        &mut self,
        field: &'static str,
        value: Direction<Self::From>,
    ) -> Result<Direction<Self::To>, BrushError>;
    /// Converts a radius.
    fn length(
        &mut self,
        field: &'static str,
        value: Length<Self::From>,
    ) -> Result<Length<Self::To>, BrushError>;
    /// Converts half the sides of a box.
    fn sides(&mut self, field: &'static str, value: Sides<Self::From>)
    -> Result<Sides<Self::To>, BrushError>;
    /// Converts a rotation.
    fn turn(&mut self, field: &'static str, value: Turn<Self::From>) -> Result<Turn<Self::To>, BrushError>;
}

type Point<N> = <N as Numbers>::Point;
type Arrow<N> = <N as Numbers>::Arrow;
type Direction<N> = <N as Numbers>::Direction;
type Length<N> = <N as Numbers>::Length;
type Sides<N> = <N as Numbers>::Sides;
type Turn<N> = <N as Numbers>::Turn;

/// Rounds a brush's numbers to integers, halves to even.
pub(super) struct Quantize;

impl Convert for Quantize {
    type From = Voxels;
    type To = Units;

    fn point(&mut self, field: &'static str, value: Vec3) -> Result<[i32; 3], BrushError> {
        quantize::point(field, value)
    }

    fn arrow(&mut self, field: &'static str, value: Vec3) -> Result<[i32; 3], BrushError> {
        quantize::arrow(field, value)
    }

    fn direction(&mut self, field: &'static str, value: Vec3) -> Result<[i16; 3], BrushError> {
        quantize::direction(field, value)
    }

    fn length(&mut self, field: &'static str, value: f32) -> Result<i32, BrushError> {
        quantize::size(field, value)
    }

    fn sides(&mut self, field: &'static str, value: Vec3) -> Result<[i32; 3], BrushError> {
        let [x, y, z] = value.to_array().map(|side| quantize::size(field, side));
        Ok([x?, y?, z?])
    }

    fn turn(&mut self, _: &'static str, value: Quat) -> Result<[i16; 4], BrushError> {
        quantize::turn(value)
    }
}

/// Checks integers that may come from anywhere against the same limits.
pub(super) struct Check;

impl Convert for Check {
    type From = Units;
    type To = Units;

    fn point(&mut self, field: &'static str, value: [i32; 3]) -> Result<[i32; 3], BrushError> {
        quantize::check_point(field, value).map(|()| value)
    }

    fn arrow(&mut self, field: &'static str, value: [i32; 3]) -> Result<[i32; 3], BrushError> {
        quantize::check_arrow(field, value).map(|()| value)
    }

    fn direction(&mut self, field: &'static str, value: [i16; 3]) -> Result<[i16; 3], BrushError> {
        quantize::check_direction(field, value).map(|()| value)
    }

    fn length(&mut self, field: &'static str, value: i32) -> Result<i32, BrushError> {
        quantize::check_size(field, value).map(|()| value)
    }

    fn sides(&mut self, field: &'static str, value: [i32; 3]) -> Result<[i32; 3], BrushError> {
        value.into_iter().try_for_each(|side| quantize::check_size(field, side)).map(|()| value)
    }

    fn turn(&mut self, _: &'static str, value: [i16; 4]) -> Result<[i16; 4], BrushError> {
        quantize::check_turn(value).map(|()| value)
    }
}

/// Gives a brush's own numbers back.
pub(super) struct Restore;

impl Convert for Restore {
    type From = Units;
    type To = Voxels;

    fn point(&mut self, _: &'static str, value: [i32; 3]) -> Result<Vec3, BrushError> {
        Ok(quantize::restored_point(value))
    }

    fn arrow(&mut self, field: &'static str, value: [i32; 3]) -> Result<Vec3, BrushError> {
        self.point(field, value)
    }

    fn direction(&mut self, _: &'static str, value: [i16; 3]) -> Result<Vec3, BrushError> {
        Ok(quantize::restored_direction(value))
    }

    fn length(&mut self, _: &'static str, value: i32) -> Result<f32, BrushError> {
        Ok(voxels(value))
    }

    fn sides(&mut self, field: &'static str, value: [i32; 3]) -> Result<Vec3, BrushError> {
        self.point(field, value)
    }

    fn turn(&mut self, _: &'static str, value: [i16; 4]) -> Result<Quat, BrushError> {
        Ok(quantize::restored_turn(value))
    }
}

/// Moves a shape.
pub(super) struct Transform<'a> {
    /// What becomes of arrows; points are moved by `shift` after that.
    pub arrow: &'a dyn Fn(Vec3) -> Vec3,
    pub shift: Vec3,
    /// What becomes of rotations.
    pub turn: Quat,
    /// What becomes of sizes.
    pub scale: f32,
}

impl Convert for Transform<'_> {
    type From = Voxels;
    type To = Voxels;

    fn point(&mut self, _: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        Ok((self.arrow)(value) + self.shift)
    }

    fn arrow(&mut self, _: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        Ok((self.arrow)(value))
    }

    fn direction(&mut self, _: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        Ok((self.arrow)(value))
    }

    fn length(&mut self, _: &'static str, value: f32) -> Result<f32, BrushError> {
        Ok(value * self.scale)
    }

    fn sides(&mut self, _: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        Ok(value * self.scale)
    }

    fn turn(&mut self, _: &'static str, value: Quat) -> Result<Quat, BrushError> {
        Ok(self.turn * value)
    }
}

/// Takes down the names of a shape's fields.
#[derive(Default)]
pub(super) struct Names(pub Vec<&'static str>);

impl Names {
    fn name<T>(&mut self, field: &'static str, value: T) -> Result<T, BrushError> {
        self.0.push(field);
        Ok(value)
    }
}

impl Convert for Names {
    type From = Voxels;
    type To = Voxels;

    fn point(&mut self, field: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        self.name(field, value)
    }

    fn arrow(&mut self, field: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        self.name(field, value)
    }

    fn direction(&mut self, field: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        self.name(field, value)
    }

    fn length(&mut self, field: &'static str, value: f32) -> Result<f32, BrushError> {
        self.name(field, value)
    }

    fn sides(&mut self, field: &'static str, value: Vec3) -> Result<Vec3, BrushError> {
        self.name(field, value)
    }

    fn turn(&mut self, field: &'static str, value: Quat) -> Result<Quat, BrushError> {
        self.name(field, value)
    }
}
