//! The tube along a curve, with a radius that varies.

use std::f64::consts::PI;

use glam::{DVec3, IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::round_cone::RoundCone;
use super::sphere::ball;
use super::union::Union;
use super::{Convert, Extent, Kind, Numbers, Outline, Shape, ShapeGeometry, Units, Voxels};
use crate::brush::BrushError;
use crate::brush::quantize::{difference, measure};

/// Straight pieces that stand for the curve.
const PIECES: usize = 32;

/// A tube along a cubic Bézier curve, whose radius changes evenly from one end to the other.
///
/// It is made of 32 round cones: the curve's points at equal steps of its parameter, joined by straight lines, along
/// which the radius changes evenly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Curve<N: Numbers = Voxels> {
    /// Where the curve begins.
    pub from: N::Vector,
    /// The second control point: the curve starts towards it.
    pub from_control: N::Vector,
    /// The third control point: the curve arrives from it.
    pub to_control: N::Vector,
    /// Where the curve ends.
    pub to: N::Vector,
    /// Radius at its beginning.
    pub from_radius: N::Length,
    /// Radius at its end.
    pub to_radius: N::Length,
}

impl Shape {
    /// A tube along the cubic Bézier curve of four points, whose radius goes from the first to the second.
    pub const fn curve(points: [Vec3; 4], [from_radius, to_radius]: [f32; 2]) -> Self {
        let [from, from_control, to_control, to] = points;
        Self::Curve(Curve { from, from_control, to_control, to, from_radius, to_radius })
    }

    /// Tubes along a line through points, each with its radius there: curves through all of them without a kink
    /// (Catmull-Rom), one from each point to the next.
    ///
    /// They are meant for brushes of one [stroke](crate::brush::Brush::with_stroke), which is undone in one step.
    /// Neighbours share a ball at the point between them, so that digging or adding all of them is digging or adding
    /// the whole tube.
    pub fn along_spline(points: &[(Vec3, f32)]) -> impl Iterator<Item = Self> {
        let at = |index: usize| points[index.min(points.len() - 1)].0;
        points.windows(2).enumerate().map(move |(index, pair)| {
            let [(from, from_radius), (to, to_radius)] = [pair[0], pair[1]];
            let (before, after) = (at(index.saturating_sub(1)), at(index + 2));
            let controls = [from + (to - before) / 6.0, to - (after - from) / 6.0];
            Self::curve([from, controls[0], controls[1], to], [from_radius, to_radius])
        })
    }

    /// Tubes along straight lines from point to point, each with its radius there; as [`Self::along_spline`], but with
    /// kinks.
    pub fn along_polyline(points: &[(Vec3, f32)]) -> impl Iterator<Item = Self> {
        points.windows(2).map(|pair| {
            let [(from, from_radius), (to, to_radius)] = [pair[0], pair[1]];
            Self::curve(
                [from, from.lerp(to, 1.0 / 3.0), from.lerp(to, 2.0 / 3.0), to],
                [from_radius, to_radius],
            )
        })
    }
}

convert!(Curve {
    from: point,
    from_control: point,
    to_control: point,
    to: point,
    from_radius: length,
    to_radius: length
});

/// A point of a cubic Bézier curve, `step` of [`PIECES`] along it.
fn point(corners: [DVec3; 4], step: usize) -> DVec3 {
    let t = step as f64 / PIECES as f64;
    let between = |a: DVec3, b: DVec3| a + (b - a) * t;
    let [a, b, c, d] = corners;
    let (ab, bc, cd) = (between(a, b), between(b, c), between(c, d));
    between(between(ab, bc), between(bc, cd))
}

impl Curve {
    /// Points along it, with their radii.
    fn points(&self) -> impl Iterator<Item = (Vec3, f32)> {
        let corners =
            [self.from, self.from_control, self.to_control, self.to].map(|corner| corner.as_dvec3());
        let (from, to) = (self.from_radius, self.to_radius);
        (0..=PIECES).map(move |step| {
            let radius = from + (to - from) * (step as f32 / PIECES as f32);
            (point(corners, step).as_vec3(), radius)
        })
    }

    pub(super) fn extent(&self) -> Extent {
        let controls = [self.from_control, self.to_control];
        let (low, high) = (controls[0].min(controls[1]), controls[0].max(controls[1]));
        let ends = [self.from.min(self.to).min(low), self.from.max(self.to).max(high)];
        Extent { ends, around: Vec3::splat(self.from_radius.max(self.to_radius)) }
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        outline.ball(self.from, self.from_radius);
        outline.ball(self.to, self.to_radius);
        let points: Vec<_> = self.points().step_by(4).collect();
        points.windows(2).for_each(|pair| outline.tube([pair[0], pair[1]]));
    }
}

impl Curve<Units> {
    fn corners(&self) -> [[i32; 3]; 4] {
        [self.from, self.from_control, self.to_control, self.to]
    }

    /// The points of its pieces relative to the first one, with their radii.
    fn steps(&self) -> [([i32; 3], f32); PIECES + 1] {
        let corners =
            self.corners().map(|corner| IVec3::from_array(difference(corner, self.from)).as_dvec3());
        let (from, to) = (f64::from(self.from_radius), f64::from(self.to_radius));
        std::array::from_fn(|step| {
            let at = point(corners, step).round().as_ivec3();
            (at.to_array(), (from + (to - from) * (step as f64 / PIECES as f64)) as f32)
        })
    }
}

impl ShapeGeometry for Curve<Units> {
    type Distance = Union<RoundCone>;

    fn origin(&self) -> [i32; 3] {
        self.from
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let (origin, radius) = (IVec3::from_array(self.from), self.from_radius.max(self.to_radius));
        let mut bounds = (origin - self.from_radius, origin + self.from_radius);
        for (at, own) in self.steps() {
            let (at, own) = (origin + IVec3::from_array(at), (own.ceil() as i32).min(radius));
            bounds = (bounds.0.min(at - own), bounds.1.max(at + own));
        }
        bounds
    }

    fn deepest(&self) -> i32 {
        self.from_radius.max(self.to_radius)
    }

    fn volume(&self) -> f64 {
        let radius = self.deepest();
        let length: f64 = self.steps().windows(2).map(|pair| measure(difference(pair[1].0, pair[0].0))).sum();
        PI * f64::from(radius).powi(2) * length + ball(radius)
    }

    fn distance(&self) -> Union<RoundCone> {
        Union::new(self.steps().windows(2).map(|pair| RoundCone::new(pair[0], pair[1])).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::round_cone::to_balls;
    use super::*;
    use crate::brush::{Brush, Edit};
    use fastrand::Rng;

    /// Random points of a path, with their radii.
    fn path(rng: &mut Rng, count: usize) -> Vec<(Vec3, f32)> {
        let mut at = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 40.0;
        let mut next = || {
            at += (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * 24.0;
            (at, 0.5 + rng.f32() * 5.0)
        };
        (0..count).map(|_| next()).collect()
    }

    /// 1,000 of them with `BURROW_SPLINES`.
    fn spline_count() -> u64 {
        std::env::var("BURROW_SPLINES").ok().and_then(|count| count.parse().ok()).unwrap_or(60)
    }

    #[test]
    fn tubes_along_random_splines_are_where_balls_along_them_are() {
        for seed in 0..spline_count() {
            let mut rng = Rng::with_seed(seed);
            let points = path(&mut rng, 2 + seed as usize % 5);
            let is_smooth = seed % 2 == 0;
            let shapes: Vec<Shape> = match is_smooth {
                true => Shape::along_spline(&points).collect(),
                false => Shape::along_polyline(&points).collect(),
            };
            assert_eq!(shapes.len(), points.len() - 1);
            let edits: Vec<Edit> =
                shapes.iter().map(|shape| Edit::quantize(&Brush::dig(*shape)).expect("valid")).collect();
            let pieces: Vec<_> = shapes
                .iter()
                .flat_map(|shape| {
                    let Shape::Curve(curve) = shape else { panic!("{shape:?}") };
                    let points: Vec<_> =
                        curve.points().map(|(at, radius)| (at.as_dvec3(), f64::from(radius))).collect();
                    points.windows(2).map(|pair| (pair[0], pair[1])).collect::<Vec<_>>()
                })
                .collect();
            for _ in 0..60 {
                let near = points[rng.usize(0..points.len())].0;
                let p = (near + (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * 30.0).round();
                let found = edits.iter().map(|edit| edit.evaluator().distance(p.as_ivec3())).min();
                let exact = pieces
                    .iter()
                    .map(|&(from, to)| to_balls(p.as_dvec3(), from, to))
                    .fold(f64::MAX, f64::min);
                let found = f64::from(found.expect("an edit")) / 256.0;
                assert!((found - exact).abs() < 0.03, "seed {seed} at {p}: {found} in place of {exact}");
            }
        }
    }

    #[test]
    fn splines_pass_through_their_points_without_kinks() {
        let points = path(&mut Rng::with_seed(3), 6);
        let curves: Vec<Curve> = Shape::along_spline(&points)
            .map(|shape| match shape {
                Shape::Curve(curve) => curve,
                other => panic!("{other:?}"),
            })
            .collect();
        for (pair, (at, radius)) in curves.windows(2).zip(&points[1..]) {
            assert_eq!((pair[0].to, pair[1].from), (*at, *at));
            assert_eq!((pair[0].to_radius, pair[1].from_radius), (*radius, *radius));
            let (before, after) = (at - pair[0].to_control, pair[1].from_control - at);
            assert!(before.abs_diff_eq(after, 1e-4), "{before} and {after}");
        }
    }

    #[test]
    fn rows_with_the_nearest_pieces_alone_are_rows() {
        let mut rng = Rng::with_seed(8);
        for _ in 0..40 {
            let points = path(&mut rng, 2);
            let shape = Shape::along_spline(&points).next().expect("a curve");
            let edit = Edit::quantize(&Brush::dig(shape)).expect("valid");
            let evaluator = edit.evaluator();
            for brick in crate::lattice::BrickPos::covering(edit.reach()) {
                let mut rows = [wide::i16x8::ZERO; 64];
                evaluator.rows(brick.origin(), 0..8, 0..8, &mut rows);
                for (number, row) in (0..).zip(rows) {
                    let mut expected = [0; 8];
                    evaluator.row(brick.origin() + IVec3::new(0, number / 8, number % 8), &mut expected);
                    let expected = expected.map(|d| d.clamp(i16::MIN.into(), i16::MAX.into()) as i16);
                    assert_eq!(row.to_array(), expected, "{shape:?}");
                }
            }
        }
    }

    #[test]
    fn a_curve_takes_fewer_than_a_hundred_bytes() {
        let far = Vec3::new(-250_000.0, 32_000.0, 250_000.0);
        let points = [far, far + 50.0, far + 100.0, far + 120.0];
        let brush = Brush::add(Shape::curve(points, [20.0, 3.0]), crate::ground::MaterialId(200));
        let edit = Edit::quantize(&brush.with_tag(u64::MAX).with_stroke(u64::MAX)).expect("valid");
        let bytes = serde_json::to_vec(&edit).expect("valid");
        assert_eq!(serde_json::from_slice::<Edit>(&bytes).expect("the same"), edit);
        #[cfg(feature = "format")]
        assert!(postcard::to_stdvec(&edit).expect("valid").len() < 100);
    }
}
