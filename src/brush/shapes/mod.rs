//! The shapes that a brush can have: a file for each, and here what they have in common.
//!
//! Most shapes are structs over [`Numbers`]: floats in a [`Brush`](super::Brush), integers in an [`Edit`](super::Edit).
//! Paths, corridors and grids hold more than numbers, and are two structs each. How to add one: see *Add a shape* in
//! `CONTRIBUTING.md`.

/// Converts a shape field by field, as in `convert!(Sphere { center: point, radius: length })`.
macro_rules! convert {
    ($shape:ident { $($field:ident: $kind:ident),* }) => {
        impl<N: Numbers> $shape<N> {
            pub(super) fn convert<C: Convert<From = N>>(&self, to: &mut C) -> Result<$shape<C::To>, BrushError> {
                Ok($shape { $($field: convert!(@$kind to, stringify!($field), self.$field)?),* })
            }
        }
    };
    (@point $to:ident, $name:expr, $value:expr) => { $to.vector($name, Kind::Point, $value) };
    (@arrow $to:ident, $name:expr, $value:expr) => { $to.vector($name, Kind::Arrow, $value) };
    (@sides $to:ident, $name:expr, $value:expr) => { $to.vector($name, Kind::Sides, $value) };
    (@turn $to:ident, $name:expr, $value:expr) => { $to.turn($name, $value) };
    (@direction $to:ident, $name:expr, $value:expr) => { $to.direction($name, $value) };
    (@length $to:ident, $name:expr, $value:expr) => { $to.length($name, $value) };
}

mod capsule;
mod cone;
mod corridor;
mod cuboid;
mod curve;
mod cylinder;
mod distance;
mod grid;
mod mesh_grid;
mod numbers;
mod outline;
mod path;
mod round_cone;
mod shape_grid;
mod sphere;
mod torus;
mod union;

use std::sync::Arc;

use glam::{IVec3, Quat, Vec3};
use serde::{Deserialize, Serialize};

pub use capsule::Capsule;
pub use cone::Cone;
pub use corridor::Corridor;
pub use cuboid::Cuboid;
pub use curve::Curve;
pub use cylinder::Cylinder;
pub use grid::GridShape;
pub use mesh_grid::MeshGrid;
pub use numbers::{Numbers, Units, Voxels};
pub use path::BrushPath;
pub use shape_grid::ShapeGrid;
#[cfg(all(test, feature = "cuda"))]
pub(crate) use shape_grid::ZERO as GRID_ZERO;
pub use sphere::Sphere;
pub use torus::Torus;

use corridor::QuantizedCorridor;
pub(super) use corridor::Road;
use distance::Distance;
pub(super) use distance::{larger, smaller};
pub(super) use grid::GridMaterials;
#[cfg(feature = "cuda")]
pub(crate) use grid::GridParams;
use grid::QuantizedGrid;
use numbers::{Check, Convert, Kind, Quantize, Restore, Transform};
use outline::Outline;
use path::QuantizedPath;

use super::BrushError;
use super::quantize::{self, Shift, check_extent};
use crate::lattice::ONE;

/// The integer geometry of a shape. All methods except `check` may rely on checked numbers.
pub(super) trait ShapeGeometry {
    /// The type of the shape's distance function.
    type Distance: Distance;

    /// Longest side of the box around it.
    const LONGEST: i32 = quantize::LONGEST;

    /// The point that distances are computed relative to.
    fn origin(&self) -> [i32; 3];

    /// Checks limits that concern several numbers together.
    fn check(&self) -> Result<(), BrushError> {
        Ok(())
    }

    /// Lowest and highest corner of a box around it, at most 1 too wide on each side.
    fn bounds(&self) -> (IVec3, IVec3);

    /// Depth of the shape's middle, rounded down.
    fn deepest(&self) -> i32;

    /// Volume in cubes of 1/256 voxel.
    fn volume(&self) -> f64;

    /// The shape's distance function.
    fn distance(&self) -> Self::Distance;
}

/// Approximate bounds of a shape: a segment between two points, and a radius around it.
#[cfg_attr(not(feature = "plugin"), expect(dead_code))]
pub(crate) struct Extent {
    pub ends: [Vec3; 2],
    pub around: Vec3,
}

macro_rules! shapes {
    ($($(#[$attribute:meta])* $name:ident,)*; $($custom:ident($public:ident, $quantized:ident) = $fields:expr,)*) => {
        /// The shape of a brush, in voxels of terrain space; in a [`Brush`](super::Brush) that is a message of the
        /// plugin's, in units of world space.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "shape", rename_all = "snake_case")]
        #[non_exhaustive]
        #[allow(missing_docs, reason = "each variant is the struct of its name")]
        pub enum Shape {
            $($(#[$attribute])* $name($name),)*
        }

        /// A shape of variable size, which does not fit into a [`Shape`].
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        #[allow(missing_docs, reason = "each variant is the struct of its name")]
        pub enum CustomShape {
            $($custom($public),)*
        }

        /// Any shape: what brushes are made with.
        #[doc(hidden)]
        #[derive(Clone, Debug, Serialize, Deserialize)]
        #[serde(tag = "shape", rename_all = "snake_case")]
        pub enum AnyShape {
            $($(#[$attribute])* $name($name),)*
            $($custom($public),)*
        }

        impl AnyShape {
            /// The parts that a brush holds: for a custom shape, with a box around it.
            pub(super) fn parts(self) -> (Shape, Option<Arc<CustomShape>>) {
                match self {
                    $(Self::$name(shape) => (Shape::$name(shape), None),)*
                    $(Self::$custom(shape) => {
                        let custom = CustomShape::$custom(shape);
                        (custom.around(), Some(Arc::new(custom)))
                    })*
                }
            }

            /// The names of its fields.
            pub(super) fn fields(&self) -> Vec<&'static str> {
                match self {
                    $(Self::$name(shape) => Shape::$name(*shape).fields(),)*
                    $(Self::$custom(_) => $fields.to_vec(),)*
                }
            }
        }

        impl From<Shape> for AnyShape {
            fn from(shape: Shape) -> Self {
                match shape {
                    $(Shape::$name(shape) => Self::$name(shape),)*
                }
            }
        }

        impl From<CustomShape> for AnyShape {
            fn from(shape: CustomShape) -> Self {
                match shape {
                    $(CustomShape::$custom(shape) => Self::$custom(shape),)*
                }
            }
        }

        $(impl From<$public> for AnyShape {
            fn from(shape: $public) -> Self {
                Self::$custom(shape)
            }
        })*

        impl CustomShape {
            /// Hands out the ends of lines that show the shape.
            pub fn outline(&self, mut line: impl FnMut(Vec3, Vec3)) {
                let mut outline = Outline::new(&mut line);
                match self {
                    $(Self::$custom(shape) => shape.outline(&mut outline),)*
                }
            }

            /// The box around it.
            pub(super) fn around(&self) -> Shape {
                let (low, high) = match self {
                    $(Self::$custom(shape) => shape.bounds(),)*
                };
                Shape::cuboid((low + high) / 2.0, (high - low) / 2.0)
            }

            /// The shape after every point p moved to `turn * (p * scale) + shift`.
            pub(super) fn transformed(&self, turn: Quat, shift: Shift, scale: f32) -> Self {
                match self {
                    $(Self::$custom(shape) => Self::$custom(shape.transformed(turn, shift, scale)),)*
                }
            }

            /// The shape with its points stretched, and its sizes as they were.
            #[cfg(feature = "plugin")]
            pub(super) fn stretched(&self, stretch: impl Fn(Vec3) -> Vec3) -> Self {
                match self {
                    $(Self::$custom(shape) => Self::$custom(shape.stretched(&stretch)),)*
                }
            }
        }

        /// A [`Shape`] in integers.
        #[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub(super) enum QuantizedShape {
            $($name($name<Units>),)*
            $($custom($quantized),)*
        }

        /// A shape's distance function.
        #[derive(Clone, Debug)]
        pub(super) enum ShapeSdf {
            $($name(<$name<Units> as ShapeGeometry>::Distance),)*
            $($custom(<$quantized as ShapeGeometry>::Distance),)*
        }

        /// The shapes' numbers, by which `kernels/shapes.cuh` knows them.
        #[cfg(feature = "cuda")]
        enum Number {
            $($name,)*
            $($custom,)*
        }

        /// The names of all shapes, in the order of their numbers.
        #[cfg(all(test, feature = "cuda"))]
        pub(crate) const NAMES: &[&str] = &[$(stringify!($name),)* $(stringify!($custom)),*];

        impl Shape {
            fn quantize(&self) -> Result<QuantizedShape, BrushError> {
                Ok(match self {
                    $(Self::$name(shape) => QuantizedShape::$name(shape.convert(&mut Quantize)?),)*
                })
            }

            fn convert(&self, to: &mut impl Convert<From = Voxels, To = Voxels>) -> Result<Self, BrushError> {
                Ok(match self {
                    $(Self::$name(shape) => Self::$name(shape.convert(to)?),)*
                })
            }

            /// Where the shape lies, for shapes that may be invalid too.
            #[cfg_attr(not(feature = "plugin"), expect(dead_code))]
            pub(crate) fn extent(&self) -> Extent {
                match self {
                    $(Self::$name(shape) => shape.extent(),)*
                }
            }

            /// Hands out the ends of lines that show the shape.
            pub fn outline(&self, mut line: impl FnMut(Vec3, Vec3)) {
                let mut outline = Outline::new(&mut line);
                match self {
                    $(Self::$name(shape) => shape.outline(&mut outline),)*
                }
            }
        }

        impl QuantizedShape {
            fn restore(&self) -> Result<AnyShape, BrushError> {
                Ok(match self {
                    $(Self::$name(shape) => AnyShape::$name(shape.convert(&mut Restore)?),)*
                    $(Self::$custom(shape) => AnyShape::$custom(shape.restored()),)*
                })
            }

            /// Rounds a custom shape to integers, halves to even, and checks it.
            pub(super) fn quantize_custom(shape: &CustomShape) -> Result<Self, BrushError> {
                let quantized = match shape {
                    $(CustomShape::$custom(shape) => Self::$custom($quantized::quantize(shape)?),)*
                };
                quantized.check()?;
                Ok(quantized)
            }

            /// Checks that the shape is within every limit. Accepts any integers; all other functions rely on this
            /// check.
            pub(super) fn check(&self) -> Result<(), BrushError> {
                match self {
                    $(Self::$name(shape) => {
                        shape.convert(&mut Check)?;
                        shape.check()?;
                    })*
                    $(Self::$custom(shape) => shape.check()?,)*
                }
                check_extent(self.bounds(), self.volume(), self.longest())
            }

            /// Longest side of the box around such a shape.
            fn longest(&self) -> i32 {
                match self {
                    $(Self::$name(_) => <$name<Units> as ShapeGeometry>::LONGEST,)*
                    $(Self::$custom(_) => <$quantized as ShapeGeometry>::LONGEST,)*
                }
            }

            /// The point that distances are computed relative to.
            pub(super) fn origin(&self) -> IVec3 {
                IVec3::from_array(match self {
                    $(Self::$name(shape) => shape.origin(),)*
                    $(Self::$custom(shape) => shape.origin(),)*
                })
            }

            /// Lowest and highest corner of a box around the shape, at most 1 too wide on each side.
            pub(super) fn bounds(&self) -> (IVec3, IVec3) {
                match self {
                    $(Self::$name(shape) => shape.bounds(),)*
                    $(Self::$custom(shape) => shape.bounds(),)*
                }
            }

            /// Depth of the shape's middle, rounded down: at least 1.
            pub(super) fn deepest(&self) -> i32 {
                let deepest = match self {
                    $(Self::$name(shape) => shape.deepest(),)*
                    $(Self::$custom(shape) => shape.deepest(),)*
                };
                deepest.max(1)
            }

            /// Volume in cubic voxels.
            fn volume(&self) -> f64 {
                let volume = match self {
                    $(Self::$name(shape) => shape.volume(),)*
                    $(Self::$custom(shape) => shape.volume(),)*
                };
                volume / f64::from(ONE * ONE * ONE)
            }

            /// The shape's distance function.
            pub(super) fn form(&self) -> ShapeSdf {
                match self {
                    $(Self::$name(shape) => ShapeSdf::$name(shape.distance()),)*
                    $(Self::$custom(shape) => ShapeSdf::$custom(shape.distance()),)*
                }
            }
        }

        impl ShapeSdf {
            /// Distances of a run of points along x.
            pub(super) fn run(&self, xs: &[f32], y: f32, z: f32, out: &mut [f32]) {
                match self {
                    $(Self::$name(form) => form.run(xs, y, z, out),)*
                    $(Self::$custom(form) => form.run(xs, y, z, out),)*
                }
            }

            /// At most the distance of a point, changing no faster than the point moves.
            pub(super) fn least(&self, x: f32, y: f32, z: f32) -> f32 {
                match self {
                    $(Self::$name(form) => form.least(x, y, z),)*
                    $(Self::$custom(form) => form.least(x, y, z),)*
                }
            }

            /// Hands out the rows of eight points along x at these y and z.
            pub(super) fn rows(
                &self,
                points: &[[f32; 8]; 3],
                y: std::ops::Range<usize>,
                z: std::ops::Range<usize>,
                each: impl FnMut(usize, usize, [f32; 8]),
            ) {
                match self {
                    $(Self::$name(form) => form.rows(points, y, z, each),)*
                    $(Self::$custom(form) => form.rows(points, y, z, each),)*
                }
            }

            /// Which shape it is, and the numbers that its distance is computed from.
            #[cfg(feature = "cuda")]
            pub(super) fn constants(&self) -> (u32, [f32; 12]) {
                let (kind, own) = match self {
                    $(Self::$name(form) => (Number::$name, form.constants()),)*
                    $(Self::$custom(form) => (Number::$custom, form.constants()),)*
                };
                let mut all = [0.0; 12];
                all.iter_mut().zip(own).for_each(|(place, value)| *place = value);
                (kind as u32, all)
            }
        }
    };
}

// In the order in which `kernels/shapes.cuh` has them.
shapes! {
    Sphere,
    #[serde(rename = "box")]
    Cuboid,
    Cylinder,
    Capsule,
    Cone,
    Torus,
    Curve,
    ;
    Path(BrushPath, QuantizedPath) = ["points", "smooth"],
    Corridor(Corridor, QuantizedCorridor) = ["points", "smooth", "above", "below"],
    Grid(GridShape, QuantizedGrid) = ["grid", "center", "rotation", "scale"],
}

impl Shape {
    /// The shape after every point p moved to `turn * (p * scale) + shift`.
    pub(super) fn transformed(&self, turn: Quat, shift: Shift, scale: f32) -> Self {
        self.moved(Transform { arrow: &|v| turn * (v * scale), shift, turn, scale, fields: Vec::new() }).0
    }

    /// The shape with its points and arrows stretched, and its sizes as they were.
    #[cfg_attr(not(feature = "plugin"), expect(dead_code))]
    pub(crate) fn stretched(&self, stretch: impl Fn(Vec3) -> Vec3) -> Self {
        let (shift, turn) = (Shift::by(Vec3::ZERO), Quat::IDENTITY);
        self.moved(Transform { arrow: &stretch, shift, turn, scale: 1.0, fields: Vec::new() }).0
    }

    /// The names of its fields.
    pub(super) fn fields(&self) -> Vec<&'static str> {
        let (shift, turn) = (Shift::by(Vec3::ZERO), Quat::IDENTITY);
        self.moved(Transform { arrow: &|v| v, shift, turn, scale: 1.0, fields: Vec::new() }).1
    }

    /// The shape moved, and the names of its fields.
    fn moved(&self, mut to: Transform) -> (Self, Vec<&'static str>) {
        // Moving fails for no number.
        let moved = self.convert(&mut to).unwrap_or(*self);
        (moved, to.fields)
    }
}

#[cfg(feature = "cuda")]
impl ShapeSdf {
    /// Whether only the CPU computes distances of the shape.
    pub(super) fn is_for_cpu(&self) -> bool {
        matches!(self, Self::Curve(_) | Self::Path(_) | Self::Corridor(_))
    }

    /// The parameters of a grid, if it is one.
    pub(super) fn grid(&self) -> Option<GridParams<'_>> {
        if let Self::Grid(grid) = self { Some(grid.params()) } else { None }
    }
}

impl QuantizedShape {
    /// Rounds a shape to integers, halves to even, and checks it.
    pub(super) fn quantize(shape: &Shape) -> Result<Self, BrushError> {
        let quantized = shape.quantize()?;
        quantized.check()?;
        Ok(quantized)
    }

    /// The shape as a brush has it.
    pub(super) fn shape(&self) -> AnyShape {
        // Restoring fails for no number.
        self.restore().unwrap_or(Shape::sphere(Vec3::ZERO, 0.0).into())
    }

    /// At least the volume of all that lies within a distance of the shape, in cubes of 1/256 voxel, where that is
    /// known to be much less than the volume of a box around it.
    pub(super) fn volume_within(&self, grow: i32) -> Option<f64> {
        match self {
            Self::Path(path) => Some(path.volume_within(grow)),
            Self::Corridor(corridor) => Some(corridor.volume_within(grow)),
            _ => None,
        }
    }

    /// The shape's samples, if it is a grid.
    pub(super) fn grid(&self) -> Option<&ShapeGrid> {
        if let Self::Grid(grid) = self { Some(grid.samples()) } else { None }
    }

    /// The shape's own materials, if it is a grid that has some.
    pub(super) fn materials(&self) -> Option<GridMaterials> {
        if let Self::Grid(grid) = self { grid.materials() } else { None }
    }

    /// The shape's samples, if it is a grid, to be replaced. The shape has to be [checked](Self::check) then.
    pub(super) fn grid_mut(&mut self) -> Option<&mut ShapeGrid> {
        if let Self::Grid(grid) = self { Some(grid.samples_mut()) } else { None }
    }

    /// The road along the shape, and half its width where it is widest; only a corridor has one.
    pub(super) fn road(&self) -> Option<(Road, i32)> {
        match self {
            Self::Corridor(corridor) => Some((corridor.road(), corridor.widest())),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn depth(form: &ShapeSdf, at: Vec3) -> f32 {
        let mut distance = [0.0];
        form.run(&[at.x], at.y, at.z, &mut distance);
        -distance[0]
    }

    /// The greatest depth, by trying places in a box that closes in on the best of them.
    fn deepest_by_trying(shape: &QuantizedShape) -> f32 {
        let (form, origin, (low, high)) = (shape.form(), shape.origin(), shape.bounds());
        let mut middle = (low + high).as_vec3() / 2.0 - origin.as_vec3();
        let (mut half, mut best) = ((high - low).as_vec3() / 2.0, f32::MIN);
        for _ in 0..60 {
            let around = middle;
            for i in 0..11 * 11 * 11 {
                let step = IVec3::new(i % 11, i / 11 % 11, i / 121).as_vec3() / 5.0 - 1.0;
                let at = around + step * half;
                if depth(&form, at) > best {
                    (middle, best) = (at, depth(&form, at));
                }
            }
            half *= 0.8;
        }
        best
    }

    #[cfg(feature = "cuda")]
    #[test]
    fn shapes_along_lines_are_for_the_cpu() {
        let path = BrushPath::polyline([(Vec3::ZERO, 1.0), (Vec3::X * 9.0, 2.0)]);
        let curve = Shape::curve([Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|at| at * 9.0), [1.0, 2.0]);
        let grid = ShapeGrid::from_fn(glam::UVec3::splat(5), |at| at.as_vec3().length() - 3.0).unwrap();
        let shapes: [(AnyShape, bool); 5] = [
            (curve.into(), true),
            (path.clone().into(), true),
            (Corridor::new(path, 1.0, 1.0).into(), true),
            (GridShape::new(grid, Vec3::ONE).into(), false),
            (Shape::sphere(Vec3::ONE, 2.0).into(), false),
        ];
        for (shape, is_for_cpu) in shapes {
            let brush = crate::brush::Brush::dig(shape);
            let evaluator = crate::brush::Edit::quantize(&brush).unwrap().evaluator();
            assert_eq!(evaluator.is_for_cpu(), is_for_cpu, "{brush:?}");
        }
    }

    #[test]
    fn the_middle_is_as_deep_as_it_is_said_to_be() {
        let base = Vec3::new(-3.3, 100.7, 8.05);
        for shape in [
            Shape::sphere(base, 7.77),
            Shape::turned_cuboid(base, Vec3::new(5.0, 9.1, 3.6), Quat::from_xyzw(0.36, -0.48, 0.64, 0.48)),
            Shape::capsule(base, base + Vec3::new(9.0, 2.0, -3.0), 3.9),
            // A pole and a disc.
            Shape::cylinder(base, Vec3::new(5.5, -9.25, 17.125), 4.4),
            Shape::cylinder(base, Vec3::new(1.0, 2.5, -0.5), 9.0),
            // A needle, a tent and a lid.
            Shape::cone(base, Vec3::new(1.0, 21.0, -3.0), 2.5),
            Shape::cone(base, Vec3::new(5.0, -9.0, 7.0), 11.5),
            Shape::cone(base, Vec3::new(0.5, 2.0, 0.0), 12.0),
            Shape::torus(base, Vec3::new(0.5, 2.0, 0.3), 12.0, 4.4),
        ] {
            let quantized = QuantizedShape::quantize(&shape).unwrap();
            let (said, found) = (quantized.deepest() as f32, deepest_by_trying(&quantized));
            // Rounded down.
            assert!((-0.2..1.2).contains(&(found - said)), "{shape:?}: {said} said, {found} found");
        }
    }
}
