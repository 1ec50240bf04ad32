//! Shapes of any form: signed distances on a grid, which a brush places with any rotation and scale.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use glam::{IVec3, Quat, UVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::distance::Distance;
use super::{Outline, Shape, ShapeGeometry};
use crate::brush::quantize::{self, Shift, check_point, check_turn, in_range, matrix, voxels};
use crate::brush::stamp::ImageSamples;
use crate::brush::{BrushError, is_default};
use crate::ground::{GreyImage, MaterialId};
use crate::lattice::ONE;

/// The minimum and maximum number of samples along a side of a grid.
pub(super) const SIDES: (u32, u32) = (3, 128);

/// The minimum and maximum number of voxels between two samples.
const SCALE: (f32, f32) = (1.0 / 16.0, 64.0);

/// What a distance of 0 is stored as.
const ZERO: i32 = 1 << 15;

/// Signed distances on a grid, in 1/256 of its cells: negative inside. The outermost samples are outside. It may have
/// [materials](Self::with_materials), which a [fill](crate::brush::Operation::Fill) builds with.
///
/// A grid is made once, from a function or from a [closed mesh](Self::from_mesh), and shared by all brushes that use
/// it. Its samples are kept as a [`GreyImage`], so that everything that names the images of stamps by their content,
/// such as [`ContentTable`](crate::net::ContentTable) of networks, names grids too.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "ImageSamples", into = "ImageSamples")]
pub struct ShapeGrid(Arc<Samples>);

/// The image of a grid, and facts derived from all of its samples. Edits share it, so they are derived only once.
#[derive(Debug)]
struct Samples {
    image: Arc<GreyImage>,
    /// Zero unless the image holds a grid.
    size: UVec3,
    /// The least sample.
    least: u16,
    /// Whether materials follow the distances.
    has_materials: bool,
}

impl PartialEq for ShapeGrid {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
            || Arc::ptr_eq(self.image(), other.image())
            || *self.0.image == *other.0.image
    }
}

impl Eq for ShapeGrid {}

impl Hash for ShapeGrid {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.0.size, self.0.least).hash(state);
    }
}

impl From<ImageSamples> for ShapeGrid {
    fn from(samples: ImageSamples) -> Self {
        Self::in_image(samples.0)
    }
}

impl From<ShapeGrid> for ImageSamples {
    fn from(grid: ShapeGrid) -> Self {
        Self(Arc::clone(grid.image()))
    }
}

impl ShapeGrid {
    /// A grid of as many samples as `size` says, 3 to 128 along each side. `distance` gets the position of a sample,
    /// counted in cells from the corner, and returns how many cells it is outside the shape; negative inside.
    ///
    /// Surfaces are best where these are real distances, at least within four voxels of the surface. The outermost
    /// samples count as outside.
    ///
    /// ```
    /// use bevy_burrow::prelude::*;
    /// use glam::{IVec3, UVec3, Vec3};
    ///
    /// let mut terrain = Terrain::new(Ground::flat(64, 64, 20.0)?, &TerrainSettings::default())?;
    /// let mound = Brush::add(Shape::sphere(Vec3::new(12.0, 20.0, 12.0), 5.0), MaterialId(0));
    /// assert!(terrain.apply_one(mound).outcome.is_ok());
    /// // What was built there, as a shape.
    /// let samples = terrain.world().samples();
    /// let corner = IVec3::new(4, 16, 4);
    /// let grid = ShapeGrid::from_fn(UVec3::splat(17), |at| samples.distance(corner + at) as f32 / 256.0)?;
    /// // The same again elsewhere, larger and turned.
    /// let copy = GridShape::new(grid, Vec3::new(40.0, 22.0, 40.0)).with_scale(1.5);
    /// let receipt = terrain.apply_one(Brush::add(copy, MaterialId(3)));
    /// assert!(receipt.outcome.is_ok_and(|applied| applied.added.total() > 100));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`BrushError::GridSize`], or [`BrushError::NotFinite`] for a distance that is not a number.
    pub fn from_fn(size: UVec3, mut distance: impl FnMut(IVec3) -> f32) -> Result<Self, BrushError> {
        check_size(size)?;
        let mut cells = Vec::with_capacity(size.element_product() as usize);
        for at in points(size) {
            let value = distance(at);
            if value.is_nan() {
                return Err(BrushError::NotFinite { what: "distance", value });
            }
            cells.push((value * ONE as f32).round_ties_even() as i32);
        }
        Self::of(size, &cells)
    }

    /// The grid of distances in 1/256 cell: x fastest, then y, then z.
    pub(super) fn of(size: UVec3, distances: &[i32]) -> Result<Self, BrushError> {
        check_size(size)?;
        // A first row says how many rows a layer has, and how many layers there are. Layers follow, and after them
        // perhaps materials: two in a sample, in the order of distances.
        let mut samples = vec![0; size.x as usize];
        (samples[0], samples[1]) = (size.y as u16, size.z as u16);
        samples.extend(points(size).zip(distances).map(|(at, &distance)| {
            let is_rim = at.cmpeq(IVec3::ZERO).any() || at.cmpeq(size.as_ivec3() - 1).any();
            let distance = if is_rim { distance.max(1) } else { distance };
            (distance.clamp(1 - ZERO, ZERO - 1) + ZERO) as u16
        }));
        let image = GreyImage::from_samples(size.x, size.y * size.z + 1, samples);
        image.map(|image| Self::in_image(Arc::new(image))).map_err(|_| wrong_size(size))
    }

    /// The grid in an image, which may hold [none](Self::is_grid).
    pub(crate) fn in_image(image: Arc<GreyImage>) -> Self {
        let size = match image.samples() {
            [layer, layers, ..] if image.width() > 1 => {
                UVec3::new(image.width(), (*layer).into(), (*layers).into())
            }
            _ => UVec3::ZERO,
        };
        let has_materials = check_size(size).is_ok() && image.height() == rows(size) + material_rows(size);
        let fits = check_size(size).is_ok() && (image.height() == rows(size) || has_materials);
        if !fits {
            return Self(Arc::new(Samples { image, size: UVec3::ZERO, least: 0, has_materials: false }));
        }
        let is_rim = |at: IVec3| at.cmpeq(IVec3::ZERO).any() || at.cmpeq(size.as_ivec3() - 1).any();
        let (mut least, mut has_rim_outside) = (u16::MAX, true);
        for (at, &sample) in points(size).zip(image.samples().iter().skip(size.x as usize)) {
            least = least.min(sample);
            has_rim_outside &= i32::from(sample) > ZERO || !is_rim(at);
        }
        let size = if has_rim_outside { size } else { UVec3::ZERO };
        Self(Arc::new(Samples { image, size, least, has_materials }))
    }

    /// The grid with materials, which a [fill](crate::brush::Brush::fill) builds with that has none of its own.
    /// `material` gets the position of a sample, as in [`from_fn`](Self::from_fn). Where it returns
    /// [`MaterialId::GROUND`], new ground has the material of the ground near it. New ground takes the material of the
    /// nearest sample inside the shape; those of others do not matter.
    ///
    /// ```
    /// use bevy_burrow::prelude::*;
    /// use glam::{IVec3, UVec3, Vec3};
    ///
    /// let ball = ShapeGrid::from_fn(UVec3::splat(17), |at| (at - 8).as_vec3().length() - 6.0)?
    ///     .with_materials(|at| MaterialId(if at.y > 8 { 1 } else { 2 }));
    /// let mut terrain = Terrain::new(Ground::flat(64, 64, 20.0)?, &TerrainSettings::default())?;
    /// let receipt = terrain.apply_one(Brush::fill(GridShape::new(ball, Vec3::new(30.0, 26.0, 30.0)), 0.0));
    /// assert!(receipt.outcome.is_ok_and(|applied| applied.added.total() > 800));
    /// assert_eq!(terrain.world().samples().material(IVec3::new(30, 30, 30)), MaterialId(1));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn with_materials(self, mut material: impl FnMut(IVec3) -> MaterialId) -> Self {
        let size = self.size();
        if !self.is_grid() {
            return self;
        }
        let mut samples = self.image().samples()[..(size.x * rows(size)) as usize].to_vec();
        let materials: Vec<u8> = points(size).map(|at| material(at).0).collect();
        let pairs = materials.chunks(2).map(|pair| u16::from_le_bytes([pair[0], *pair.get(1).unwrap_or(&0)]));
        samples.extend(pairs);
        let height = rows(size) + material_rows(size);
        samples.resize((size.x * height) as usize, 0);
        match GreyImage::from_samples(size.x, height, samples) {
            Ok(image) => Self::in_image(Arc::new(image)),
            Err(_) => self,
        }
    }

    /// The material at a sample; [`MaterialId::GROUND`] if it has none. Samples beyond the grid are those at its rim.
    pub fn material(&self, at: IVec3) -> MaterialId {
        let size = self.size();
        if !self.0.has_materials || !self.is_grid() {
            return MaterialId::GROUND;
        }
        let at = at.clamp(IVec3::ZERO, size.as_ivec3() - 1).as_uvec3();
        let index = (at.z * size.y + at.y) * size.x + at.x;
        let (row, column) = (index / 2 / size.x, index / 2 % size.x);
        let pair = self.image().grey(column, rows(size) + row).to_le_bytes();
        MaterialId(pair[index as usize % 2])
    }

    /// Whether it has materials.
    pub fn has_materials(&self) -> bool {
        self.0.has_materials && self.is_grid()
    }

    /// Whether its image holds a grid.
    pub(crate) fn is_grid(&self) -> bool {
        self.0.size != UVec3::ZERO
    }

    /// Samples along each side.
    pub fn size(&self) -> UVec3 {
        self.0.size
    }

    /// The image that holds its samples: the name under which networks and journals keep it.
    pub fn image(&self) -> &Arc<GreyImage> {
        &self.0.image
    }

    /// Depth of the sample that lies deepest inside, in 1/256 cell.
    fn deepest(&self) -> i64 {
        if self.is_grid() { (i64::from(ZERO) - i64::from(self.0.least)).max(0) } else { 0 }
    }

    /// Distance outside the shape at a sample, in 1/256 cell. Samples beyond the grid are those at its rim; without any,
    /// as when it was read from an image that holds none, everything is outside.
    pub fn distance(&self, at: IVec3) -> i32 {
        if !self.is_grid() {
            return ZERO - 1;
        }
        let size = self.size().as_ivec3();
        let at = at.clamp(IVec3::ZERO, size - 1);
        i32::from(self.image().grey(at.x as u32, (at.z * size.y + at.y + 1) as u32)) - ZERO
    }
}

/// Rows of an image that hold distances and their size.
fn rows(size: UVec3) -> u32 {
    size.y * size.z + 1
}

/// Rows of an image that hold materials, if it does.
fn material_rows(size: UVec3) -> u32 {
    size.element_product().div_ceil(2).div_ceil(size.x)
}

/// The samples of a grid, in the order in which they are stored.
pub(super) fn points(size: UVec3) -> impl Iterator<Item = IVec3> {
    let size = size.as_ivec3();
    let rows = (0..size.z).flat_map(move |z| (0..size.y).map(move |y| (y, z)));
    rows.flat_map(move |(y, z)| (0..size.x).map(move |x| IVec3::new(x, y, z)))
}

fn wrong_size(size: UVec3) -> BrushError {
    BrushError::GridSize { size: size.to_array(), least: SIDES.0, most: SIDES.1 }
}

pub(super) fn check_size(size: UVec3) -> Result<(), BrushError> {
    let is_fine = size.to_array().iter().all(|side| (SIDES.0..=SIDES.1).contains(side));
    if is_fine { Ok(()) } else { Err(wrong_size(size)) }
}

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

    /// As a brush has it.
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
    /// The material at a lattice point: that of the nearest sample inside the shape among the eight around it, else of the
    /// nearest at all. `None` if that has none.
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

/// Distances between the samples of a grid, in integers. Only the CPU computes them.
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
