//! Signed distances on a grid, made once and shared by all brushes that use them.

use std::hash::{Hash, Hasher};
use std::sync::Arc;

use glam::{IVec3, UVec3};
use serde::{Deserialize, Serialize};

use crate::brush::BrushError;
use crate::brush::stamp::ImageSamples;
use crate::ground::{GreyImage, MaterialId};
use crate::lattice::ONE;

/// The minimum and maximum number of samples along a side of a grid.
pub(super) const SIDES: (u32, u32) = (3, 128);

/// What a distance of 0 is stored as.
pub(crate) const ZERO: i32 = 1 << 15;

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
        match GreyImage::from_long_samples(size.x, height, samples) {
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
    pub(super) fn deepest(&self) -> i64 {
        if self.is_grid() { (i64::from(ZERO) - i64::from(self.0.least)).max(0) } else { 0 }
    }

    /// Distance outside the shape at a sample, in 1/256 cell. Samples beyond the grid are those at its rim; without
    /// any, as when it was read from an image that holds none, everything is outside.
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
pub(super) fn rows(size: UVec3) -> u32 {
    size.y * size.z + 1
}

/// Rows of an image that hold materials, if it does.
pub(super) fn material_rows(size: UVec3) -> u32 {
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
