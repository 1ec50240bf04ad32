//! Where the look meets the ground, and the form of what is built there.

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use serde::{Deserialize, Serialize};

/// The form of what is built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    #[default]
    Sphere,
    Cube,
    /// From where the player looks further along the look.
    Capsule,
}

impl Form {
    pub const fn next(self) -> Self {
        match self {
            Self::Sphere => Self::Cube,
            Self::Cube => Self::Capsule,
            Self::Capsule => Self::Sphere,
        }
    }

    pub const fn label(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Cube => "cube",
            Self::Capsule => "beam",
        }
    }

    /// The shape of this form for a look that met the ground.
    pub fn shape(self, aim: &Aim, radius: f32) -> Shape {
        match self {
            Self::Sphere => Shape::sphere(aim.place, radius),
            Self::Cube => Shape::cuboid(aim.place, Vec3::splat(radius)),
            Self::Capsule => Shape::capsule(aim.place, aim.place + aim.along * 3.0 * radius, radius),
        }
    }
}

/// Where the look meets the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    pub place: Vec3,
    /// The way of the look.
    pub along: Vec3,
    /// Out of the ground.
    pub normal: Vec3,
}
