//! Paths of many points: tubes along them.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, IVec3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::round_cone::RoundCone;
use super::sphere::ball;
use super::union::Union;
use super::{Outline, ShapeGeometry};
use crate::brush::BrushError;
use crate::brush::quantize::{
    self, Shift, check_point, check_size, difference, measure, restored_point, sum, voxels,
};
use crate::lattice::ONE;

/// The minimum and maximum number of points of a path.
pub(super) const POINTS: (usize, usize) = (2, 256);

/// Longest side of the box around a path, in voxels.
pub(super) const LONGEST: i32 = 8192;

/// How far straight pieces may lie from the curve that they stand for, in 1/256 voxel, and the maximum number of them
/// between two points, which is enough for any curve in the longest box.
const TOLERANCE: f64 = ONE as f64 / 32.0;
const PIECES: i32 = 512;

/// A path through points, with a radius at each. As a shape it is the tube around it: a tunnel if it is dug, a wall or
/// a pipe if it is added.
///
/// Radii change evenly from point to point. A path is one edit, however long it is, and costs as much as its tube is
/// long.
///
/// ```
/// use bevy_burrow::prelude::*;
/// use glam::Vec3;
///
/// let mut terrain = Terrain::new(Ground::flat(64, 64, 20.0)?, &TerrainSettings::default())?;
/// let path = BrushPath::spline([
///     (Vec3::new(4.0, 20.0, 4.0), 3.0),
///     (Vec3::new(20.0, 12.0, 30.0), 2.0),
///     (Vec3::new(50.0, 14.0, 40.0), 4.5),
/// ]);
/// let receipts = terrain.apply([Brush::dig(path)]);
/// assert!(receipts[0].outcome.as_ref().is_ok_and(|applied| applied.removed.total() > 500));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BrushPath {
    /// The points in voxels, 2 to 256 of them, each with its radius.
    #[serde(with = "list")]
    pub points: Arc<[(Vec3, f32)]>,
    /// Whether it is a curve without kinks (Catmull-Rom). Otherwise it is made of straight lines.
    #[serde(rename = "smooth", default, skip_serializing_if = "std::ops::Not::not")]
    pub is_smooth: bool,
}

impl BrushPath {
    /// A path of straight lines between points, each with its radius.
    pub fn polyline(points: impl IntoIterator<Item = (Vec3, f32)>) -> Self {
        Self { points: points.into_iter().collect(), is_smooth: false }
    }

    /// A curve without kinks through points, each with its radius.
    pub fn spline(points: impl IntoIterator<Item = (Vec3, f32)>) -> Self {
        Self { points: points.into_iter().collect(), is_smooth: true }
    }

    /// The path with all radii changed by a length.
    #[must_use]
    pub fn widened(&self, by: f32) -> Self {
        self.map(|at| at, |radius| radius + by)
    }

    fn map(&self, at: impl Fn(Vec3) -> Vec3, radius: impl Fn(f32) -> f32) -> Self {
        let points = self.points.iter().map(|&(point, own)| (at(point), radius(own))).collect();
        Self { points, is_smooth: self.is_smooth }
    }

    /// The path after every point p moved to `turn * (p * scale) + shift`.
    pub(super) fn transformed(&self, turn: Quat, shift: Shift, scale: f32) -> Self {
        self.map(|at| shift.point(turn * (at * scale)), |radius| radius * scale)
    }

    /// The path with its points stretched, and its radii as they were.
    #[cfg(feature = "plugin")]
    pub(super) fn stretched(&self, stretch: &impl Fn(Vec3) -> Vec3) -> Self {
        self.map(stretch, |radius| radius)
    }

    /// A box around it. Curves stay within a quarter of a span of their points.
    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        let mut bounds = (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN));
        let mut last = None;
        for &(at, radius) in &*self.points {
            let span = last.map_or(Vec3::ZERO, |last: Vec3| (at - last).abs());
            let around = radius.max(0.0) + if self.is_smooth { span / 2.0 } else { Vec3::ZERO };
            for at in [last.unwrap_or(at), at] {
                bounds = (bounds.0.min(at - around), bounds.1.max(at + around));
            }
            last = Some(at);
        }
        bounds
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        let [first, .., last] = &*self.points else { return };
        [first, last].iter().for_each(|end| outline.ball(end.0, end.1));
        let Ok(path) = QuantizedPath::quantize(self) else { return };
        let points: Vec<(Vec3, f32)> = path
            .nodes()
            .into_iter()
            .map(|(at, radius)| (restored_point(sum(at, path.from)), radius / ONE as f32))
            .collect();
        points.windows(2).for_each(|pair| outline.tube([pair[0], pair[1]]));
    }
}

/// A shared list, as serde writes any.
mod list {
    use super::{Arc, Deserialize, Serialize};

    pub fn serialize<T: Serialize, S: serde::Serializer>(list: &[T], to: S) -> Result<S::Ok, S::Error> {
        list.serialize(to)
    }

    pub fn deserialize<'de, T: Deserialize<'de>, D: serde::Deserializer<'de>>(
        from: D,
    ) -> Result<Arc<[T]>, D::Error> {
        Vec::deserialize(from).map(Arc::from)
    }
}

/// A [`BrushPath`] in integers: its first point, and from each point to the next. Lengths in 1/256 voxel.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::brush) struct QuantizedPath {
    pub from: [i32; 3],
    radius: i32,
    is_smooth: bool,
    /// The way from the point before, and the radius.
    #[serde(with = "list")]
    steps: Arc<[([i32; 3], i32)]>,
}

impl QuantizedPath {
    /// Rounds a path to integers, halves to even.
    pub fn quantize(path: &BrushPath) -> Result<Self, BrushError> {
        check_count(path.points.len())?;
        let point = |&(at, radius): &(Vec3, f32)| {
            Ok::<_, BrushError>((quantize::point("points", at)?, quantize::size("radius", radius)?))
        };
        let points: Vec<([i32; 3], i32)> = path.points.iter().map(point).collect::<Result<_, _>>()?;
        let steps = points.windows(2).map(|pair| (difference(pair[1].0, pair[0].0), pair[1].1)).collect();
        Ok(Self { from: points[0].0, radius: points[0].1, is_smooth: path.is_smooth, steps })
    }

    /// Returns the path as a brush has it.
    pub fn restored(&self) -> BrushPath {
        let points =
            self.corners().map(|(at, radius)| (restored_point(sum(self.from, at)), voxels(radius))).collect();
        BrushPath { points, is_smooth: self.is_smooth }
    }

    /// The points relative to the first one, with their radii.
    fn corners(&self) -> impl Iterator<Item = ([i32; 3], i32)> {
        let mut at = [0; 3];
        let next = move |&(step, radius): &([i32; 3], i32)| {
            at = sum(at, step);
            (at, radius)
        };
        std::iter::once(([0; 3], self.radius)).chain(self.steps.iter().map(next))
    }

    /// The ends of its straight pieces relative to the first point, with their radii.
    pub fn nodes(&self) -> Vec<([i32; 3], f32)> {
        let corners: Vec<(DVec3, i32)> =
            self.corners().map(|(at, radius)| (IVec3::from_array(at).as_dvec3(), radius)).collect();
        let place = |index: usize| corners[index.min(corners.len() - 1)].0;
        let mut nodes = vec![([0; 3], self.radius as f32)];
        for (index, pair) in corners.windows(2).enumerate() {
            let [(from, from_radius), (to, to_radius)] = [pair[0], pair[1]];
            let radii = [f64::from(from_radius), f64::from(to_radius)];
            let before = place(index.saturating_sub(1));
            let [first, second] = [from + (to - before) / 6.0, to - (place(index + 2) - from) / 6.0];
            let count = if self.is_smooth { pieces([from, first, second, to]) } else { 1 };
            nodes.extend((1..=count).map(|step| {
                let t = f64::from(step) / f64::from(count);
                let between = |a: DVec3, b: DVec3| a + (b - a) * t;
                let (ab, bc, cd) = (between(from, first), between(first, second), between(second, to));
                let at = if step == count { to } else { between(between(ab, bc), between(bc, cd)) };
                let radius = radii[0] + (radii[1] - radii[0]) * t;
                (at.round().as_ivec3().to_array(), radius as f32)
            }));
        }
        nodes
    }

    /// The straight pieces: the ends, relative to the first point, and their radii.
    pub fn segments(&self) -> Vec<[([i32; 3], f32); 2]> {
        self.nodes().windows(2).map(|pair| [pair[0], pair[1]]).collect()
    }

    /// Lowest and highest corner of a box around its tube.
    fn around(&self) -> (IVec3, IVec3) {
        let node = |(at, radius): ([i32; 3], f32)| {
            let (at, radius) = (IVec3::from_array(sum(self.from, at)), radius.ceil() as i32);
            (at - radius, at + radius)
        };
        let join = |a: (IVec3, IVec3), b: (IVec3, IVec3)| (a.0.min(b.0), a.1.max(b.1));
        let first = node(([0; 3], self.radius as f32));
        self.nodes().into_iter().map(node).fold(first, join)
    }

    /// At least the volume of all that lies within a distance of its tube.
    pub fn volume_within(&self, grow: i32) -> f64 {
        let piece = |[a, b]: &[([i32; 3], f32); 2]| {
            let radius = f64::from(a.1.max(b.1)) + f64::from(grow);
            PI * radius * radius * measure(difference(b.0, a.0))
        };
        self.segments().iter().map(piece).sum::<f64>() + ball(self.widest().saturating_add(grow))
    }

    /// The largest radius.
    pub fn widest(&self) -> i32 {
        self.steps.iter().map(|&(_, radius)| radius).fold(self.radius, i32::max)
    }
}

/// The number of equal steps in which straight pieces stay within the tolerance of a cubic curve with these control
/// points. In a step of 1/n, a curve leaves its chord by at most 1/8n² of its second derivative, which is largest at an
/// end.
fn pieces([a, b, c, d]: [DVec3; 4]) -> i32 {
    let second = 6.0 * (a - 2.0 * b + c).length().max((b - 2.0 * c + d).length());
    ((second / (8.0 * TOLERANCE)).sqrt().ceil() as i32).clamp(1, PIECES)
}

fn check_count(count: usize) -> Result<(), BrushError> {
    let (least, most) = POINTS;
    if (least..=most).contains(&count) { Ok(()) } else { Err(BrushError::PathPoints { count, least, most }) }
}

impl ShapeGeometry for QuantizedPath {
    type Distance = Union<RoundCone>;

    const LONGEST: i32 = LONGEST * ONE;

    fn origin(&self) -> [i32; 3] {
        self.from
    }

    fn check(&self) -> Result<(), BrushError> {
        check_count(self.steps.len() + 1)?;
        check_point("points", self.from)?;
        check_size("radius", self.radius)?;
        let mut at = self.from;
        for &(step, radius) in &*self.steps {
            at = sum(at, step);
            check_point("points", at)?;
            check_size("radius", radius)?;
        }
        Ok(())
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        self.around()
    }

    fn deepest(&self) -> i32 {
        self.widest()
    }

    fn volume(&self) -> f64 {
        self.volume_within(0)
    }

    fn distance(&self) -> Union<RoundCone> {
        Union::new(self.segments().into_iter().map(|[from, to]| RoundCone::new(from, to)).collect())
    }
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;

    use super::super::round_cone::to_balls;
    use super::*;
    use crate::brush::shapes::CustomShape;
    use crate::brush::shapes::union::Piece;
    use crate::brush::{Brush, Edit};
    use crate::lattice::BrickPos;

    /// 1,000 of them with `BURROW_SPLINES`.
    fn spline_count() -> u64 {
        std::env::var("BURROW_SPLINES").ok().and_then(|count| count.parse().ok()).unwrap_or(60)
    }

    /// A random path through up to 256 points.
    fn random_path(rng: &mut Rng) -> BrushPath {
        let count = if rng.u8(..8) == 0 { rng.usize(100..=256) } else { rng.usize(2..12) };
        let side = [6.0, 24.0, 60.0][rng.usize(..3)];
        let mut at = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 40.0;
        let points: Vec<(Vec3, f32)> = (0..count)
            .map(|_| {
                at += (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * side;
                (at, 0.25 + rng.f32() * 5.0)
            })
            .collect();
        if rng.bool() { BrushPath::spline(points) } else { BrushPath::polyline(points) }
    }

    /// The ends of the pieces of a path by their definition, from the brush's own numbers, in voxels.
    fn plain_nodes(path: &BrushPath) -> Vec<(DVec3, f64)> {
        let points: Vec<(DVec3, f64)> =
            path.points.iter().map(|&(at, radius)| (at.as_dvec3(), f64::from(radius))).collect();
        if !path.is_smooth {
            return points;
        }
        let mut nodes = vec![points[0]];
        for index in 1..points.len() {
            let point = |index: usize| points[index.min(points.len() - 1)].0;
            let [a, b, c, d] =
                [point(index.saturating_sub(2)), point(index - 1), point(index), point(index + 1)];
            let control = [b, b + (c - a) / 6.0, c - (d - b) / 6.0, c];
            let second = control.windows(3).map(|own| (own[0] - 2.0 * own[1] + own[2]).length() * 6.0);
            let most = second.fold(0.0, f64::max);
            let count = ((most * 256.0 / (8.0 * TOLERANCE)).sqrt().ceil() as i32).clamp(1, PIECES);
            nodes.extend((1..=count).map(|step| {
                let t = f64::from(step) / f64::from(count);
                // Hermite with the tangents of Catmull-Rom.
                let (m0, m1) = ((c - a) / 2.0, (d - b) / 2.0);
                let (t2, t3) = (t * t, t * t * t);
                let at = b * (2.0 * t3 - 3.0 * t2 + 1.0)
                    + m0 * (t3 - 2.0 * t2 + t)
                    + c * (-2.0 * t3 + 3.0 * t2)
                    + m1 * (t3 - t2);
                let (from, to) = (points[index - 1].1, points[index].1);
                (at, from + (to - from) * t)
            }));
        }
        nodes
    }

    #[test]
    fn tubes_along_random_paths_are_where_balls_along_them_are() {
        for seed in 0..spline_count() {
            let mut rng = Rng::with_seed(seed);
            let path = random_path(&mut rng);
            let edit = Edit::quantize(&Brush::dig(path.clone())).expect("valid");
            let (evaluator, nodes) = (edit.evaluator(), plain_nodes(&path));
            for _ in 0..40 {
                let near = path.points[rng.usize(0..path.points.len())].0;
                let p = (near + (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * 30.0).round();
                let exact = nodes
                    .windows(2)
                    .map(|pair| to_balls(p.as_dvec3(), pair[0], pair[1]))
                    .fold(f64::MAX, f64::min);
                let found = f64::from(evaluator.distance(p.as_ivec3())) / 256.0;
                // Rounding may give a spline one piece more or less.
                let most = if path.is_smooth { 0.1 } else { 0.03 };
                assert!((found - exact).abs() < most, "seed {seed} at {p}: {found} in place of {exact}");
            }
        }
    }

    #[test]
    fn long_curves_are_as_exact_as_short_ones() {
        for side in [4.0, 30.0, 500.0, 1000.0, 4000.0, 8000.0] {
            let corners = [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)];
            let path = BrushPath::spline(corners.map(|(x, z)| (Vec3::new(x, 20.0, z), 2.0)));
            let own = QuantizedPath::quantize(&path).expect("valid");
            let pieces: Vec<RoundCone> =
                own.segments().into_iter().map(|[from, to]| RoundCone::new(from, to)).collect();
            let corners = corners.map(|(x, z)| DVec3::new(f64::from(x), 0.0, f64::from(z)));
            for span in 0..3_usize {
                let at = |index: usize| corners[index.min(3)];
                let [a, b, c, d] = [at(span.saturating_sub(1)), at(span), at(span + 1), at(span + 2)];
                for step in 0..=3000 {
                    let t = f64::from(step) / 3000.0;
                    let (m0, m1, t2, t3) = ((c - a) / 2.0, (d - b) / 2.0, t * t, t * t * t);
                    let on_curve = b * (2.0 * t3 - 3.0 * t2 + 1.0)
                        + m0 * (t3 - 2.0 * t2 + t)
                        + c * (3.0 * t2 - 2.0 * t3)
                        + m1 * (t3 - t2);
                    let [x, y, z] = (on_curve * f64::from(ONE)).to_array().map(|v| v as f32);
                    let depth = pieces.iter().map(|piece| -piece.at(x, y, z)).fold(f32::MIN, f32::max);
                    // The middle of the tube is its radius deep.
                    let off = 2.0 - depth / ONE as f32;
                    assert!(off.abs() < 0.05, "side {side}, span {span}, step {step}: {off}");
                }
            }
        }
    }

    #[test]
    fn distances_are_to_the_bit_the_least_of_all_pieces() {
        let mut places = 0;
        for seed in 0..spline_count() {
            let mut rng = Rng::with_seed(1000 + seed);
            let path = random_path(&mut rng);
            let edit = Edit::quantize(&Brush::dig(path.clone())).expect("valid");
            let own = QuantizedPath::quantize(&path).expect("valid");
            let pieces: Vec<RoundCone> =
                own.segments().into_iter().map(|[from, to]| RoundCone::new(from, to)).collect();
            let plainly = |p: IVec3| {
                let [x, y, z] = (p * ONE - IVec3::from_array(own.from)).to_array().map(|v| v as f32);
                let nearest = pieces.iter().map(|piece| piece.at(x, y, z)).fold(f32::MAX, f32::min);
                nearest.clamp(-4e6, 4e6).round_ties_even() as i32
            };
            let evaluator = edit.evaluator();
            let grid = crate::lattice::LatticeBox { min: edit.reach().min - 9, max: edit.reach().max + 9 };
            for _ in 0..60 {
                let p = grid.min
                    + (grid.size().as_vec3() * Vec3::new(rng.f32(), rng.f32(), rng.f32())).as_ivec3();
                assert_eq!(evaluator.distance(p), plainly(p), "seed {seed} at {p}");
            }
            // Rows of bricks look at the nearest pieces alone.
            for _ in 0..3 {
                let near = path.points[rng.usize(0..path.points.len())].0.as_ivec3();
                let brick = BrickPos(near >> 3);
                let mut rows = [wide::i16x8::ZERO; 64];
                evaluator.rows(brick.origin(), 0..8, 0..8, &mut rows);
                for (index, p) in
                    (0..512).map(|i| (i, brick.origin() + IVec3::new(i & 7, i >> 6, i >> 3 & 7)))
                {
                    let found = i32::from(rows[index as usize >> 3].to_array()[index as usize & 7]);
                    assert_eq!(found, plainly(p).clamp(-32768, 32767), "seed {seed} at {p}");
                    places += 1;
                }
            }
        }
        assert!(places > 10_000, "{places}");
    }

    #[test]
    fn paths_have_limits_and_say_what_to_do() {
        let path = |count: usize| BrushPath::spline((0..count).map(|i| (Vec3::X * i as f32, 1.0)));
        let error = |path: BrushPath| Edit::quantize(&Brush::dig(path)).expect_err("refused");
        for count in [0, 1, 257] {
            let BrushError::PathPoints { count: said, .. } = error(path(count)) else { panic!("{count}") };
            assert_eq!(said, count);
        }
        assert!(error(path(300)).to_string().contains("divide a longer one into brushes of one stroke"));
        for count in [2, 256] {
            Edit::quantize(&Brush::dig(path(count))).expect("valid").check().expect("valid");
        }
        let line = |to: Vec3, radius| BrushPath::polyline([(Vec3::ZERO, 1.0), (to, radius)]);
        assert!(matches!(error(line(Vec3::X, 0.1)), BrushError::TooSmall { what: "radius", .. }));
        assert!(matches!(error(line(Vec3::X, f32::NAN)), BrushError::NotFinite { what: "radius", .. }));
        assert!(matches!(error(line(Vec3::NAN, 1.0)), BrushError::NotFinite { what: "points", .. }));
        assert!(matches!(error(line(Vec3::X * 9000.0, 1.0)), BrushError::TooLarge { what: "box", .. }));
        assert!(matches!(error(line(Vec3::X * 8000.0, 90.0)), BrushError::TooLarge { what: "volume", .. }));
        assert!(matches!(error(line(Vec3::X * 1e9, 1.0)), BrushError::OutOfRange { what: "points", .. }));
        Edit::quantize(&Brush::dig(line(Vec3::X * 8000.0, 20.0))).expect("valid");
    }

    #[test]
    fn paths_are_written_and_read_in_all_forms() {
        let mut rng = Rng::with_seed(4);
        for _ in 0..50 {
            let path = random_path(&mut rng);
            let brush = Brush::dig(path.clone()).with_tag(9);
            let edit = Edit::quantize(&brush).expect("valid");
            let json = serde_json::to_string(&edit).expect("an edit");
            assert_eq!(serde_json::from_str::<Edit>(&json).expect("an edit"), edit);
            #[cfg(feature = "format")]
            {
                let bytes = postcard::to_stdvec(&edit).expect("an edit");
                assert_eq!(postcard::from_bytes::<Edit>(&bytes).expect("an edit"), edit);
                assert!(bytes.len() < 40 + 12 * path.points.len(), "{} bytes", bytes.len());
            }
            assert_eq!(Edit::quantize(&Brush::from(&edit)).expect("valid"), edit);
            let line = serde_json::to_string(&brush).expect("a brush");
            let again: Brush = serde_json::from_str(&line).expect("a brush");
            assert_eq!(again.custom.as_deref(), Some(&CustomShape::Path(path)));
            assert_eq!(Edit::quantize(&again).expect("valid"), edit);
        }
        let line =
            r#"{"shape":"path","points":[[[0.0,1.0,2.0],1.5],[[9.0,1.0,2.0],2.0]],"smooth":true,"op":"dig"}"#;
        let brush: Brush = serde_json::from_str(line).expect("a brush");
        assert_eq!(serde_json::to_string(&brush).expect("a brush"), line);
        let wrong = line.replace("smooth", "smoth");
        assert!(serde_json::from_str::<Brush>(&wrong).expect_err("unknown").to_string().contains("smoth"));
    }
}
