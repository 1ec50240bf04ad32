//! The operations of brushes.

#[cfg(feature = "plugin")]
use glam::Mat3A;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::quantize::Shift;
use super::{DEPTH, Paste, Stamp, is_default};
use crate::ground::MaterialId;

/// The operation inside the shape.
///
/// Dig, add, paint, reset and paste look at one sample at a time, all but the last as far as [`BAND`](super::BAND)
/// beyond their shape. All others *sculpt*: they read what lies around and have the brush's [`Blend`](super::Blend), by
/// which most fade. They change nothing outside, except for fill and carve. Beyond the world's rim they assume that
/// everything continues as at the rim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "op", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Operation {
    /// Removes ground.
    Dig,
    /// Fills with ground of one material.
    Add {
        /// The material of the new ground.
        material: MaterialId,
    },
    /// Changes the material of ground that is there, and no density. [`MaterialId::GROUND`] restores the ground's own
    /// material. Ground that still has it is drawn by marching cubes afterwards all the same, without a visible
    /// difference.
    ///
    /// It stores the density of what it paints: exactly within 127 voxels of the surface. On taller cliffs, between
    /// neighbouring columns, painting may move the surface by less than a voxel.
    Paint {
        /// The new material.
        material: MaterialId,
    },
    /// Evens out bumps and edges: each sample goes towards the average of the 26 around it. Slopes stay as they are;
    /// hollows and towers of radius r disappear after about r x r applications, as with any averaging.
    Smooth,
    /// Deepens bumps and edges, by at most a quarter of a voxel each time.
    Sharpen,
    /// Makes the surface a plane: ground on the one side, air on the side that the normal points to.
    Flatten {
        /// A point of the plane, in voxels.
        point: Vec3,
        /// From the ground to the air; any length but 0.
        normal: Vec3,
    },
    /// Makes the surface level.
    Level {
        /// The height of the level surface, in voxels.
        height: f32,
    },
    /// Moves the surface outwards, which is up on pristine ground. Where a dig or an add was, distances are known
    /// to [`DEPTH`] only, and one application moves the surface by about that at most.
    ///
    /// It reverses a [`Lower`](Self::Lower) of the same brush, and vice versa. Each sample returns to its
    /// value, or to 1/256 voxel off for each time that it would have been exactly 4 voxels from the surface.
    /// Samples cut off by a dig or an add return to their side of the surface.
    ///
    /// Densities end 127.996 voxels from the surface, and anything moved beyond is lost: raise and lower leave it
    /// unchanged. So at most about 128 voxels return. Natural ground that was lowered by more, and raised again, is
    /// lower than before, but nowhere higher; ground that was raised by more, and lowered again, is higher, but nowhere
    /// lower. Once the ground is higher than the pristine ground, further raising fills the rest from the sides, by at
    /// most a voxel each time.
    Raise {
        /// Distance in voxels: 0 to 64.
        amount: f32,
    },
    /// Moves the surface inwards: the opposite of [`Raise`](Self::Raise).
    Lower {
        /// Distance in voxels: 0 to 64.
        amount: f32,
    },
    /// Gives the surface the relief of an image.
    Stamp {
        /// The image, and where it lies.
        stamp: Stamp,
    },
    /// Cuts slopes into steps: treads at `base` and every `step` above and below it, with a riser of a quarter of the
    /// step's slope between them. More applications make risers steeper.
    Terrace {
        /// Height of a step in voxels: 1 to 256.
        step: f32,
        /// Height of one of the treads in voxels.
        #[serde(rename = "height", default, skip_serializing_if = "is_default")]
        base: f32,
    },
    /// Returns ground to what it was before any edit: densities and materials, exactly. Where no edits are left,
    /// nothing is stored any more.
    ///
    /// It reaches as far as a dig of the same shape, [`BAND`](super::BAND) beyond it, so a reset with the same shape
    /// undoes a dig. The terrain's rules apply: a sample is reset entirely, or refused. Ground that loses its support
    /// does not fall.
    Reset,
    /// Makes the ground a road along the path of a [`Corridor`](super::Corridor): level across, with air above it and
    /// ground below it, as far as the corridor goes up and down. It fades into the ground at its sides over the
    /// falloff, its shoulders. Ground higher than the corridor stays as the roof of a tunnel, and air below it as a
    /// culvert.
    Road,
    /// Fills with ground like an [`Add`](Self::Add), and rounds the edge between the shape and the ground: a smooth
    /// union. The radius of the rounding is the blend's falloff, at most 16 voxels; with 0 it is a plain union. It
    /// changes ground that far beyond the shape, at least [`BAND`](super::BAND). New ground has the blend's material,
    /// the shape's own where that has [some](super::ShapeGrid::with_materials), or that of the ground below it. Each
    /// application rounds again, by at most 0.42 of the radius.
    Fill,
    /// Removes ground like a [`Dig`](Self::Dig), and rounds the rim of the hole. The radius is the blend's falloff, as
    /// for a [`Fill`](Self::Fill).
    Carve,
    /// Pastes a copy of another place, where it lies inside the shape. It changes nothing outside, not even within
    /// [`BAND`](super::BAND). The terrain's rules apply: a sample is pasted entirely, or refused.
    Paste {
        /// The copy, and where it goes.
        paste: Paste,
    },
}

impl Operation {
    /// The material that an add or a paint brings along.
    pub fn material(&self) -> Option<MaterialId> {
        match self {
            Self::Add { material } | Self::Paint { material } => Some(*material),
            _ => None,
        }
    }

    /// Returns `true` if it sculpts. Only then is the brush's [`Blend`](super::Blend) used.
    pub fn is_sculpting(&self) -> bool {
        !matches!(self, Self::Dig | Self::Add { .. } | Self::Paint { .. } | Self::Reset | Self::Paste { .. })
    }

    /// The names of its fields in a line of JSON, in addition to those of the blend.
    pub(super) fn fields(&self) -> &'static [&'static str] {
        match self {
            Self::Dig | Self::Add { .. } | Self::Paint { .. } => &[],
            Self::Smooth | Self::Sharpen | Self::Reset | Self::Road | Self::Fill | Self::Carve => &[],
            Self::Flatten { .. } => &["point", "normal"],
            Self::Level { .. } => &["height"],
            Self::Raise { .. } | Self::Lower { .. } => &["amount"],
            Self::Stamp { .. } => &["stamp"],
            Self::Paste { .. } => &["paste"],
            Self::Terrace { .. } => &["step", "height"],
        }
    }

    /// The operation after every point p moved to `turn * (p * scale) + shift`. Heights follow along y.
    pub(super) fn transformed(&self, turn: Quat, shift: Shift, scale: f32) -> Self {
        let point = |p: Vec3| shift.point(turn * (p * scale));
        let height = |y: f32| shift.height(y * scale);
        match self {
            Self::Flatten { point: at, normal } => {
                Self::Flatten { point: point(*at), normal: turn * *normal }
            }
            Self::Level { height: at } => Self::Level { height: height(*at) },
            Self::Raise { amount } => Self::Raise { amount: amount * scale },
            Self::Lower { amount } => Self::Lower { amount: amount * scale },
            Self::Terrace { step, base } => Self::Terrace { step: step * scale, base: height(*base) },
            Self::Stamp { stamp } => Self::Stamp {
                stamp: Stamp {
                    center: point(stamp.center),
                    rotation: turn * stamp.rotation,
                    size: stamp.size * scale,
                    height: stamp.height * scale,
                    ..stamp.clone()
                },
            },
            Self::Paste { paste } => Self::Paste {
                paste: Paste {
                    at: point(paste.at),
                    rotation: turn * paste.rotation,
                    scale: paste.scale * scale,
                    ..paste.clone()
                },
            },
            same => same.clone(),
        }
    }

    /// Stretches its points and heights. Amounts are sizes, which have no direction and stay.
    #[cfg(feature = "plugin")]
    pub(super) fn stretch(&mut self, matrix: Mat3A) {
        let stretch = |point: &mut Vec3| *point = matrix * *point;
        let lift = |height: &mut f32| *height *= matrix.y_axis.y;
        match self {
            Self::Flatten { point, normal } => {
                stretch(point);
                *normal = matrix.inverse().transpose() * *normal;
            }
            Self::Level { height } => lift(height),
            Self::Terrace { step, base } => [step, base].into_iter().for_each(lift),
            Self::Stamp { stamp } => stretch(&mut stamp.center),
            Self::Paste { paste } => stretch(&mut paste.at),
            Self::Dig
            | Self::Add { .. }
            | Self::Paint { .. }
            | Self::Smooth
            | Self::Sharpen
            | Self::Raise { .. }
            | Self::Lower { .. }
            | Self::Reset
            | Self::Road
            | Self::Fill
            | Self::Carve => {}
        }
    }
}

/// The kind of an edit's operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Dig,
    Add { material: MaterialId },
    Paint { material: MaterialId },
    Sculpt,
    Reset,
    Paste,
}

impl Kind {
    /// The density of a sample after a dig, an add or a paint, from its density `before` and its signed distance to the
    /// shape, `outside`. All in 1/256 voxel, negative is solid, and inside for the distance. Operations that sculpt
    /// look at more than that, a reset at the ground and a paste at its prefab: for them, it gives
    /// `before`.
    ///
    /// A shape counts as [`DEPTH`] deep at most: beyond, no surface shows the difference, and the middle of a large
    /// cave or hill is all one number. Applying an operation twice is the same as once, and neither a dig ever adds
    /// ground nor an add removes it.
    #[inline]
    pub fn apply(self, before: i32, outside: i32) -> i32 {
        let outside = outside.max(-DEPTH);
        match self {
            Self::Dig => before.max(-outside),
            Self::Add { .. } => before.min(outside),
            Self::Paint { .. } | Self::Sculpt | Self::Reset | Self::Paste => before,
        }
    }

    /// The material that an add or a paint brings along.
    pub fn material(self) -> Option<MaterialId> {
        match self {
            Self::Add { material } | Self::Paint { material } => Some(material),
            _ => None,
        }
    }

    /// Whether an edit of this kind is a transaction of its own, for which no backend has jobs.
    pub fn is_alone(self) -> bool {
        matches!(self, Self::Reset | Self::Paste)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dig_takes_away_add_fills_paint_leaves() {
        let (dig, add, paint) =
            (Kind::Dig, Kind::Add { material: MaterialId(3) }, Kind::Paint { material: MaterialId(3) });
        // (before, outside, dig, add)
        for (before, outside, dug, added) in [
            (-300, -100, 100, -300), // solid, inside
            (-300, 100, -100, -300), // solid, outside but near
            (-50, 100, -50, -50),    // already nearer the surface than the shape is
            (300, -100, 300, -100),  // air, inside
            (300, 100, 300, 100),    // air, near
            (0, i32::MIN, DEPTH, -DEPTH),
            (2 * DEPTH, -3 * DEPTH, 2 * DEPTH, -DEPTH), // deep inside: less than what was there
        ] {
            assert_eq!(dig.apply(before, outside), dug);
            assert_eq!(add.apply(before, outside), added);
            assert_eq!(paint.apply(before, outside), before);
            for operation in [dig, add, paint] {
                let once = operation.apply(before, outside);
                assert_eq!(operation.apply(once, outside), once);
            }
        }
    }
}
