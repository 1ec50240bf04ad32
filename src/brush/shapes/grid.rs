//! Shapes of any form: a [`ShapeGrid`] that a brush places with any rotation and scale.

use glam::{IVec3, Quat, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::Distance;
use super::shape_grid::{ShapeGrid, ZERO};
use super::{Outline, Shape, ShapeGeometry};
use crate::brush::quantize::{self, Shift, check_point, check_turn, in_range, matrix, voxels};
use crate::brush::{BrushError, is_default};
#[cfg(feature = "cuda")]
use crate::ground::GreyImage;
use crate::ground::MaterialId;
use crate::lattice::ONE;

/// The minimum and maximum number of voxels between two samples.
const SCALE: (f32, f32) = (1.0 / 16.0, 64.0);

/// A [`ShapeGrid`] that a brush places in the terrain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GridShape {
    /// The distances.
    pub grid: ShapeGrid,
    /// Where the middle of the grid lies.
    pub center: Vec3,
    /// From the grid's axes to those of the terrain; of length 1.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rotation: Quat,
    /// Voxels between two samples of the grid: 1/16 to 64.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f32,
}

fn one() -> f32 {
    1.0
}

fn is_one(scale: &f32) -> bool {
    *scale == 1.0
}

impl GridShape {
    /// A grid around a point, with a voxel between two samples.
    pub fn new(grid: ShapeGrid, center: Vec3) -> Self {
        Self { grid, center, rotation: Quat::IDENTITY, scale: 1.0 }
    }

    /// The shape with another rotation.
    #[must_use]
    pub fn with_rotation(self, rotation: Quat) -> Self {
        Self { rotation, ..self }
    }

    /// The shape with another number of voxels between two samples.
    #[must_use]
    pub fn with_scale(self, scale: f32) -> Self {
        Self { scale, ..self }
    }

    pub(super) fn transformed(&self, turn: Quat, shift: Shift, scale: f32) -> Self {
        Self {
            grid: self.grid.clone(),
            center: shift.point(turn * (self.center * scale)),
            rotation: turn * self.rotation,
            scale: self.scale * scale,
        }
    }

    #[cfg(feature = "plugin")]
    pub(super) fn stretched(&self, stretch: &impl Fn(Vec3) -> Vec3) -> Self {
        Self { center: stretch(self.center), ..self.clone() }
    }

    /// Half the sides of the grid.
    fn half(&self) -> Vec3 {
        (self.grid.size().as_vec3() - 1.0) * self.scale / 2.0
    }

    pub(super) fn bounds(&self) -> (Vec3, Vec3) {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let half: Vec3 = axes.iter().map(|&axis| (self.rotation * (axis * self.half())).abs()).sum();
        (self.center - half, self.center + half)
    }

    pub(super) fn outline(&self, outline: &mut Outline) {
        Shape::turned_cuboid(self.center, self.half(), self.rotation).outline(|a, b| outline.line(a, b));
    }
}

/// A [`GridShape`] in integers.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::brush) struct QuantizedGrid {
    center: [i32; 3],
    rotation: [i16; 4],
    /// 1/256 voxel between two samples.
    scale: i32,
    samples: ShapeGrid,
}

impl QuantizedGrid {
    /// Rounds a placed grid to integers, halves to even.
    pub fn quantize(shape: &GridShape) -> Result<Self, BrushError> {
        Ok(Self {
            center: quantize::point("center", shape.center)?,
            rotation: quantize::turn(shape.rotation)?,
            scale: in_range("scale", shape.scale, SCALE.0, SCALE.1)?,
            samples: shape.grid.clone(),
        })
    }

    /// Returns the grid as a brush has it.
    pub fn restored(&self) -> GridShape {
        GridShape {
            grid: self.samples.clone(),
            center: quantize::restored_point(self.center),
            rotation: quantize::restored_turn(self.rotation),
            scale: voxels(self.scale),
        }
    }

    /// The samples.
    pub fn samples(&self) -> &ShapeGrid {
        &self.samples
    }

    /// The samples, to be replaced. The shape has to be checked then.
    pub fn samples_mut(&mut self) -> &mut ShapeGrid {
        &mut self.samples
    }

    /// The materials of the samples, where they are.
    pub fn materials(&self) -> Option<GridMaterials> {
        self.samples.has_materials().then(|| GridMaterials { center: self.center, distance: self.distance() })
    }

    /// Half the sides of the grid.
    fn half(&self) -> [i32; 3] {
        self.samples.size().to_array().map(|side| side.saturating_sub(1) as i32 * self.scale / 2)
    }
}

impl ShapeGeometry for QuantizedGrid {
    type Distance = GridDistance;

    fn origin(&self) -> [i32; 3] {
        self.center
    }

    fn check(&self) -> Result<(), BrushError> {
        check_point("center", self.center)?;
        check_turn(self.rotation)?;
        in_range("scale", voxels(self.scale), SCALE.0, SCALE.1)?;
        // A placeholder stands for a grid that is still to come: the shape is empty.
        if self.samples.is_grid() || self.samples.image().is_placeholder() {
            Ok(())
        } else {
            Err(BrushError::NoGrid)
        }
    }

    fn bounds(&self) -> (IVec3, IVec3) {
        let (rows, squared) = matrix(self.rotation);
        let half = self.half().map(i64::from);
        let side = |row: [i64; 3]| {
            let sum: i64 = row.iter().zip(half).map(|(part, half)| part.abs() * half).sum();
            (sum / squared) as i32 + 1
        };
        let (center, around) = (IVec3::from_array(self.center), IVec3::from_array(rows.map(side)));
        (center - around, center + around)
    }

    fn deepest(&self) -> i32 {
        (self.samples.deepest() * i64::from(self.scale) / i64::from(ONE)) as i32
    }

    fn volume(&self) -> f64 {
        self.half().iter().map(|&half| 2.0 * f64::from(half)).product()
    }

    fn distance(&self) -> GridDistance {
        let (rows, squared) = matrix(self.rotation);
        let grid = self.samples.clone();
        GridDistance {
            rows,
            squared,
            scale: self.scale.into(),
            size: grid.size().to_array().map(i64::from),
            grid,
        }
    }
}

/// The materials of a grid at its place.
#[derive(Clone, Debug)]
pub(in crate::brush) struct GridMaterials {
    center: [i32; 3],
    distance: GridDistance,
}

impl GridMaterials {
    /// The material at a lattice point: that of the nearest sample inside the shape among the eight around it, else of
    /// the nearest at all. `None` if that has none.
    pub fn at(&self, point: IVec3) -> Option<MaterialId> {
        let own = &self.distance;
        let from = point.as_i64vec3() * i64::from(ONE) - IVec3::from_array(self.center).as_i64vec3();
        let (place, _) = own.locate(from.to_array());
        let (cell, part) = own.cell(place);
        let weight = |corner: i64| -> i64 {
            (0..3).map(|axis| if corner >> axis & 1 == 1 { part[axis] } else { 256 - part[axis] }).product()
        };
        let sample = |corner: i64| {
            let at = [0, 1, 2].map(|axis| (cell[axis] + (corner >> axis & 1)) as i32);
            IVec3::from_array(at)
        };
        // Of equally near ones, the first.
        let is_inside = |corner: i64| own.grid.distance(sample(corner)) < 0;
        let nearest =
            (0..8).rev().max_by_key(|&corner| (is_inside(corner) && weight(corner) > 0, weight(corner)))?;
        Some(own.grid.material(sample(nearest))).filter(|material| *material != MaterialId::GROUND)
    }
}

/// Distances between the samples of a grid, in integers.
#[derive(Clone, Debug)]
pub struct GridDistance {
    /// Rows of the rotation's matrix, and what to divide them by.
    rows: [[i64; 3]; 3],
    squared: i64,
    scale: i64,
    size: [i64; 3],
    grid: ShapeGrid,
}

impl GridDistance {
    /// The place in the grid nearest to a point, in 1/256 cell from its corner, and how far from it the point is.
    fn locate(&self, from: [i64; 3]) -> ([i64; 3], f64) {
        let mut beyond = 0.0;
        let place = std::array::from_fn(|axis| {
            let along: i64 = (0..3).map(|i| self.rows[i][axis] * from[i]).sum();
            let local = (along + self.squared / 2).div_euclid(self.squared);
            let last = (self.size[axis] - 1).max(0) * 256;
            let place = (local * 256).div_euclid(self.scale) + last / 2;
            let inside = place.clamp(0, last);
            let excess = (place - inside) as f64 * self.scale as f64 / 256.0;
            beyond += excess * excess;
            inside
        });
        (place, beyond.sqrt())
    }

    /// The cell that a place in the grid lies in, and where in it, in 1/256.
    fn cell(&self, place: [i64; 3]) -> ([i64; 3], [i64; 3]) {
        let cell: [i64; 3] = std::array::from_fn(|axis| (place[axis] >> 8).min(self.size[axis] - 2));
        (cell, std::array::from_fn(|axis| place[axis] - (cell[axis] << 8)))
    }

    /// The distance at a place in the grid, in 1/256 voxel.
    fn inside(&self, place: [i64; 3]) -> i64 {
        let (cell, part) = self.cell(place);
        let (image, size) = (self.grid.image(), self.size);
        let sample = |x: i64, y: i64, z: i64| {
            let row = (cell[2] + z) * size[1] + cell[1] + y + 1;
            i64::from(image.grey((cell[0] + x) as u32, row as u32)) - i64::from(ZERO)
        };
        let along = |y: i64, z: i64| sample(0, y, z) * (256 - part[0]) + sample(1, y, z) * part[0];
        let layer = |z: i64| along(0, z) * (256 - part[1]) + along(1, z) * part[1];
        let sum = layer(0) * (256 - part[2]) + layer(1) * part[2];
        (sum * self.scale + (1 << 31)) >> 32
    }
}

/// A grid's distance function as plain numbers, for the GPU.
#[cfg(feature = "cuda")]
pub(crate) struct GridParams<'a> {
    /// Rows of the rotation's matrix, and what to divide them by.
    pub rows: [[i64; 3]; 3],
    pub squared: i64,
    pub scale: i64,
    /// Zero unless the image holds a grid.
    pub size: [u32; 3],
    /// The distances, after a first row, and the materials.
    pub image: &'a GreyImage,
    pub has_materials: bool,
}

#[cfg(feature = "cuda")]
impl GridDistance {
    /// All parameters of distances and materials.
    pub(super) fn params(&self) -> GridParams<'_> {
        let Self { rows, squared, scale, grid, .. } = self;
        GridParams {
            rows: *rows,
            squared: *squared,
            scale: *scale,
            size: grid.size().to_array(),
            image: grid.image(),
            has_materials: grid.has_materials(),
        }
    }
}

impl Distance for GridDistance {
    #[inline(always)]
    fn at(&self, x: f32, y: f32, z: f32) -> f32 {
        if self.size.iter().any(|&side| side < 2) {
            return f32::MAX;
        }
        let (place, beyond) = self.locate([x, y, z].map(|v| v as i64));
        let inside = self.inside(place) as f32;
        if beyond > 0.0 { inside.max(beyond as f32) } else { inside }
    }

    /// Distances between any samples may change faster than the point moves; the distance to the grid does not.
    fn least(&self, x: f32, y: f32, z: f32) -> f32 {
        self.locate([x, y, z].map(|v| v as i64)).1 as f32
    }

    fn constants(&self) -> Vec<f32> {
        Vec::new()
    }
}
