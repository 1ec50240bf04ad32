//! The rules of a scatter: species, as a game writes them. All lengths are in voxels.

#[cfg(feature = "plugin")]
use bevy::reflect::std_traits::ReflectDefault;
#[cfg(feature = "plugin")]
use bevy::reflect::{ReflectDeserialize, ReflectSerialize};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::ground::MaterialId;

/// What grows on a ground. It can be read from a file, and be changed at any time: plants follow from it alone.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[cfg_attr(
    feature = "plugin",
    derive(bevy::reflect::Reflect),
    reflect(opaque, Clone, Debug, Default, PartialEq, Serialize, Deserialize)
)]
pub struct ScatterRules {
    /// The seed; another one gives other plants.
    pub seed: u64,
    /// At most 255 species, each with a different name. Earlier ones take precedence where there is not room for all.
    pub species: Vec<Species>,
}

/// A kind of plant or stone.
///
/// Lengths are in voxels. Spots lie in squares with sides of [`spacing`](Self::spacing), one at a random point of each.
/// A plant stands on a spot that passes all rules.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Species {
    /// The name, which seeds where the plants stand. The species' place in the list matters only for
    /// [`room`](Self::room).
    pub name: String,
    /// Sides of the squares that have one spot each, 1/16 to 1024.
    pub spacing: f32,
    /// The share of spots that are used, 0 to 1.
    pub density: f32,
    /// Least distance between two plants of this species, at most 4 times the spacing. Of two that are too near to each
    /// other, one is left out.
    pub distance: f32,
    /// Species that come later in the list keep this distance, at most 64.
    pub room: f32,
    /// Smallest and largest size, 1/16 to 16, as a factor.
    pub size: (f32, f32),
    /// Lowest and highest ground, -32768 to 32768.
    pub height: (f32, f32),
    /// Least and greatest slope of the ground, as rise over run, 0 to 128: 0 is level, 1 is 45 degrees.
    pub slope: (f32, f32),
    /// Materials on which it grows; all of them if there are none.
    pub materials: Vec<MaterialId>,
    /// Groups in which it grows; everywhere if `None`.
    pub clusters: Option<Clusters>,
    /// The space that must stay as it is for the plant to stand.
    pub clearance: Clearance,
    /// The cylinder that bodies and rays meet; `None` if they pass through.
    pub stem: Option<Stem>,
    /// How far the species is drawn.
    pub view: ViewDistances,
}

impl Species {
    /// A species with this name, with one plant per square voxel.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }
}

impl Default for Species {
    fn default() -> Self {
        Self {
            name: String::new(),
            spacing: 1.0,
            density: 1.0,
            distance: 0.0,
            room: 0.0,
            size: (1.0, 1.0),
            height: (-32768.0, 32768.0),
            slope: (0.0, 128.0),
            materials: Vec::new(),
            clusters: None,
            clearance: Clearance::default(),
            stem: None,
            view: ViewDistances::default(),
        }
    }
}

/// Groups of plants: round, thinner towards their edges.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Clusters {
    /// Sides of the squares that have one group each, 1 to 1024.
    pub size: f32,
    /// The share of a square that its group covers, 0 to 1.
    pub cover: f32,
}

/// A cylinder around a plant, times the plant's size, in which its ground must stay and nothing may be built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Clearance {
    /// Columns within this distance belong to it, at most 16. With 0, the four columns of the plant's cell.
    pub radius: f32,
    /// How far it reaches above the plant's foot, at most 256.
    pub height: f32,
}

/// An upright cylinder, times the plant's size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stem {
    /// The stem's radius, 1/256 to 16.
    pub radius: f32,
    /// The stem's height above the plant's foot, 1/256 to 256.
    pub height: f32,
}

/// How far a species is drawn, in voxels, each 0 to 65536. Where plants stand does not depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewDistances {
    /// Plants farther away are drawn with their simple mesh, if they have one.
    pub detail: f32,
    /// Plants farther away are not drawn.
    pub end: f32,
    /// Plants farther away cast no shadows.
    pub shadows: f32,
}

impl Default for ViewDistances {
    fn default() -> Self {
        Self { detail: 60.0, end: 120.0, shadows: 40.0 }
    }
}

/// Rules that cannot be used.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum ScatterError {
    /// A number is not within its range.
    #[error("`{what}` of the species `{species}` is {value}, but it must be {allowed}")]
    Parameter {
        /// The name of the species.
        species: String,
        /// The field.
        what: &'static str,
        /// The value of the field.
        value: f32,
        /// The range.
        allowed: &'static str,
    },
    /// Two species have the same name: their plants would stand on the same spots.
    #[error("two species are called `{0}`: give each a name of its own")]
    SameName(String),
    /// There are more species than numbers for them.
    #[error("there are {0} species, but the maximum is 255")]
    TooMany(usize),
}
