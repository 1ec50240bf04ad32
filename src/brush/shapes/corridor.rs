//! The space along a path between vertical sides, as roads need it.

use glam::{IVec3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::{larger, smaller};
use super::path::{BrushPath, LONGEST, QuantizedPath};
use super::round_cone::RoundCone;
use super::union::{Bounds, Piece, Union};
use super::{Outline, ShapeGeometry};
use crate::brush::BrushError;
use crate::brush::quantize::{Shift, difference, in_range, measure, voxels};
use crate::lattice::ONE;

/// The maximum number of voxels above and below a path.
const HEIGHT: f32 = 256.0;

/// The space along a path: as wide to either side as the path's radius, from `below` the path to `above` it. Its ends
/// are round, and it is level across.
///
/// [`Brush::road`](crate::brush::Brush::road) builds a road in it. Any other operation works too: dig it for a trench
/// or a tunnel with a flat floor, paint it to give a road its material, reset it to remove a road.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Corridor {
    /// The path along its floor, with half the width at each point as radius.
    #[serde(flatten)]
    pub path: BrushPath,
    /// Height above the path in voxels: 0 to 256.
    pub above: f32,
    /// Depth below the path in voxels: 0 to 256.
    pub below: f32,
}

impl Corridor {
    /// The corridor from `below` voxels below a path to `above` voxels above it.
    pub fn new(path: BrushPath, above: f32, below: f32) -> Self {
        Self { path, above, below }
    }

    pub(super) fn transformed(&self, turn: Quat, shift: Shift, scale: f32) -> Self {
        let path = self.path.transformed(turn, shift, scale);
        Self { path, above: self.above * scale, below: self.below * scale }
    }

    #[cfg(feature = "plugin")]
    pub(super) fn stretched(&self, stretch: &impl Fn(Vec3) -> Vec3) -> Self {
        Self { path: self.path.stretched(stretch), above: self.above, below: self.below }
    }

    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        let (low, high) = self.path.bounds();
        (low - Vec3::Y * self.below.max(0.0), high + Vec3::Y * self.above.max(0.0))
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        self.path.outline(outline);
    }
}

/// A [`Corridor`] in integers.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::brush) struct QuantizedCorridor {
    path: QuantizedPath,
    above: i32,
    below: i32,
}

impl QuantizedCorridor {
    /// Rounds a corridor to integers, halves to even.
    pub fn quantize(corridor: &Corridor) -> Result<Self, BrushError> {
        Ok(Self {
            path: QuantizedPath::quantize(&corridor.path)?,
            above: in_range("above", corridor.above, 0.0, HEIGHT)?,
            below: in_range("below", corridor.below, 0.0, HEIGHT)?,
        })
    }

    /// Returns the corridor as a brush has it.
    pub fn restored(&self) -> Corridor {
        Corridor { path: self.path.restored(), above: voxels(self.above), below: voxels(self.below) }
    }

    /// The road along it.
    pub fn road(&self) -> Road {
        Road { from: self.path.from, above: self.above, below: self.below, pieces: self.distance() }
    }

    /// At least the volume of all that lies within a distance of it.
    pub fn volume_within(&self, grow: i32) -> f64 {
        let (height, grow) = (f64::from(self.above + self.below) + 2.0 * f64::from(grow), f64::from(grow));
        let piece = |[a, b]: [([i32; 3], f32); 2]| {
            let [x, y, z] = difference(b.0, a.0);
            let (flat, width) = (measure([x, 0, z]), 2.0 * (f64::from(a.1.max(b.1)) + grow));
            // A steep piece is as high as it rises.
            width * (flat * height + f64::from(y.unsigned_abs()) * (width + flat.min(width)))
        };
        let ends = 4.0 * (f64::from(self.widest()) + grow).powi(2) * height;
        self.path.segments().into_iter().map(piece).sum::<f64>() + ends
    }

    /// Half its width where it is widest.
    pub fn widest(&self) -> i32 {
        self.path.widest()
    }
}

impl ShapeGeometry for QuantizedCorridor {
    type Distance = Union<Stretch>;

    const LONGEST: i32 = LONGEST * ONE;

    fn origin(&self) -> [i32; 3] {
        self.path.from
    }

    fn check(&self) -> Result<(), BrushError> {
        self.path.check()?;
        in_range("above", voxels(self.above), 0.0, HEIGHT)?;
        in_range("below", voxels(self.below), 0.0, HEIGHT)?;
        Ok(())
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let heights = self.path.nodes().into_iter().map(|(at, _)| self.path.from[1].saturating_add(at[1]));
        let (low, high) = heights.fold((i32::MAX, i32::MIN), |(low, high), y| (low.min(y), high.max(y)));
        let around = self.path.bounds();
        (around.0.with_y(low - self.below), around.1.with_y(high + self.above))
    }

    fn deepest(&self) -> i32 {
        self.widest().min((self.above + self.below) / 2)
    }

    fn volume(&self) -> f64 {
        self.volume_within(0)
    }

    fn distance(&self) -> Union<Stretch> {
        let (above, below) = (self.above as f32, self.below as f32);
        Union::new(self.path.segments().into_iter().map(|ends| Stretch::new(ends, above, below)).collect())
    }
}

/// A straight piece of a corridor.
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    /// Seen from above.
    flat: RoundCone,
    /// The first end, and the way along the ground of length 1.
    from: [f32; 3],
    unit: [f32; 2],
    length: f32,
    /// Rise for each unit along the ground, and the cosine of that slope.
    slope: f32,
    cosine: f32,
    /// The lowest and the highest point of its middle line.
    heights: [f32; 2],
    above: f32,
    below: f32,
}

impl Stretch {
    fn new([(from, from_radius), (to, to_radius)]: [([i32; 3], f32); 2], above: f32, below: f32) -> Self {
        let [x, y, z] = difference(to, from);
        let length = measure([x, 0, z]) as f32;
        let level = |at: [i32; 3]| [at[0], 0, at[2]];
        let rise = y as f32;
        let (slope, unit) = match length > 0.0 {
            true => (rise / length, [x as f32 / length, z as f32 / length]),
            false => (0.0, [0.0; 2]),
        };
        let ends = [from[1] as f32, to[1] as f32];
        Self {
            flat: RoundCone::new((level(from), from_radius), (level(to), to_radius)),
            from: from.map(|v| v as f32),
            unit,
            length,
            slope,
            cosine: 1.0 / (1.0 + slope * slope).sqrt(),
            heights: [smaller(ends[0], ends[1]), larger(ends[0], ends[1])],
            above,
            below,
        }
    }

    /// Distance from its side, seen from above; negative inside.
    #[inline(always)]
    fn beside(&self, x: f32, z: f32) -> f32 {
        self.flat.at(x, 0.0, z)
    }

    /// Height of its middle line nearest to a place.
    #[inline(always)]
    fn height(&self, x: f32, z: f32) -> f32 {
        let along = (x - self.from[0]) * self.unit[0] + (z - self.from[2]) * self.unit[1];
        self.from[1] + smaller(larger(along, 0.0), self.length) * self.slope
    }
}

impl Piece for Stretch {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        let up = y - self.height(x, z);
        // Across the slope. The box around the stretch bounds what a steep slope would let through.
        let across = larger(up - self.above, -up - self.below) * self.cosine;
        let outside = larger(y - self.heights[1] - self.above, self.heights[0] - self.below - y);
        larger(self.beside(x, z), larger(across, outside))
    }

    fn bounds(&self) -> Bounds {
        let mut bounds = self.flat.bounds();
        (bounds.low[1], bounds.high[1]) = (self.heights[0] - self.below, self.heights[1] + self.above);
        bounds
    }
}

/// The surface of a road.
#[derive(Clone, Debug)]
pub(in crate::brush) struct Road {
    from: [i32; 3],
    above: i32,
    below: i32,
    pieces: Union<Stretch>,
}

/// Where a point lies on a road. Lengths in 1/256 voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::brush) struct OnRoad {
    /// Distance outside its sides, seen from above; negative inside.
    pub beside: i32,
    /// Height above its surface, at least `-below` and at most `above`.
    pub up: i32,
}

impl Road {
    /// Where a lattice point lies on the road: on the piece whose middle is nearest, seen from above and compared with
    /// half the width there, among those that have the point between their lower and upper end. `None` where there is
    /// no such piece, or where the point is outside its sides.
    pub fn at(&self, point: IVec3) -> Option<OnRoad> {
        let from = point.as_i64vec3() * i64::from(ONE) - IVec3::from_array(self.from).as_i64vec3();
        let [x, y, z] = from.to_array().map(|v| v as f32);
        let nearest = std::cell::Cell::new((0.0, None));
        self.pieces.visit(
            |bounds| {
                let is_level = bounds.beyond(1, y) <= 1.0;
                is_level && larger(bounds.beyond(0, x), bounds.beyond(2, z)) - 64.0 <= nearest.get().0
            },
            |_, piece| {
                let beside = piece.beside(x, z);
                if beside < nearest.get().0 {
                    let up = (y - piece.height(x, z)).round_ties_even() as i32;
                    if (-self.below..=self.above).contains(&up) {
                        nearest.set((beside, Some(OnRoad { beside: beside.round_ties_even() as i32, up })));
                    }
                }
                true
            },
        );
        nearest.get().1
    }

    /// The density of the ground there when the road is built, from what it was. Above the road there is air, and below
    /// it ground, up to `above` and down to `below`; beyond, everything stays.
    pub fn target(&self, at: OnRoad, own: i32) -> i32 {
        let (ceiling, floor) = (self.above - at.up, at.up + self.below);
        if at.up > ceiling {
            own.max(ceiling)
        } else if -at.up > floor {
            own.min(-floor)
        } else {
            at.up
        }
    }
}
