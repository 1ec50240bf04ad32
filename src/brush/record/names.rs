//! Names of shapes and operations in a record, and which fields each may have.

use serde::{Deserialize, Serialize};

#[cfg(doc)]
use crate::brush::{Operation, Shape};

/// Name of a [`Shape`] in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ShapeName {
    /// [`Shape::Sphere`].
    Sphere,
    /// [`Shape::Cuboid`].
    Box,
    /// [`Shape::Cylinder`].
    Cylinder,
    /// [`Shape::Capsule`].
    Capsule,
    /// [`Shape::Cone`].
    Cone,
}

impl ShapeName {
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Box => "box",
            Self::Cylinder => "cylinder",
            Self::Capsule => "capsule",
            Self::Cone => "cone",
        }
    }

    /// The fields that the shape may have.
    pub(super) fn fields(self) -> &'static [&'static str] {
        match self {
            Self::Sphere => &["center", "radius"],
            Self::Box => &["center", "half", "rotation"],
            Self::Cylinder | Self::Cone => &["base", "axis", "radius"],
            Self::Capsule => &["from", "to", "radius"],
        }
    }
}

/// Name of an [`Operation`] in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperationName {
    /// [`Operation::Dig`].
    Dig,
    /// [`Operation::Add`].
    Add,
    /// [`Operation::Paint`].
    Paint,
    /// [`Operation::Smooth`].
    Smooth,
    /// [`Operation::Sharpen`].
    Sharpen,
    /// [`Operation::Flatten`].
    Flatten,
    /// [`Operation::Level`].
    Level,
    /// [`Operation::Raise`].
    Raise,
    /// [`Operation::Lower`].
    Lower,
    /// [`Operation::Stamp`].
    Stamp,
    /// [`Operation::Terrace`].
    Terrace,
}

impl OperationName {
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Dig => "dig",
            Self::Add => "add",
            Self::Paint => "paint",
            Self::Smooth => "smooth",
            Self::Sharpen => "sharpen",
            Self::Flatten => "flatten",
            Self::Level => "level",
            Self::Raise => "raise",
            Self::Lower => "lower",
            Self::Stamp => "stamp",
            Self::Terrace => "terrace",
        }
    }

    /// The fields that the operation may have, beside those that all may have which sculpt.
    pub(super) fn fields(self) -> &'static [&'static str] {
        match self {
            Self::Dig | Self::Smooth | Self::Sharpen => &[],
            Self::Add | Self::Paint => &["material"],
            Self::Flatten => &["point", "normal"],
            Self::Level => &["height"],
            Self::Raise | Self::Lower => &["amount"],
            Self::Stamp => &["stamp"],
            Self::Terrace => &["step", "height"],
        }
    }

    pub(super) fn is_sculpting(self) -> bool {
        !matches!(self, Self::Dig | Self::Add | Self::Paint)
    }
}
