//! The ground itself: heights and materials of every column of the pristine world.

use std::fmt;

use glam::{IVec3, Vec3};
use rayon::prelude::*;

use super::extent::Extent;
use super::material::{ColumnMaterial, MaterialId};
use super::pages::Pages;
use super::rise::{Rise, normal_of, slope_of, squared_slope_of};
use super::source::HeightSource;
use super::stored_materials::Materials;
use super::strata::Below;
use crate::lattice::hash::hash_words;
use crate::lattice::{Column, ONE};

/// The pristine world: a height and materials for each column (x, z) with x in `0..=width` and z in `0..=depth`.
///
/// Immutable. Heights are in 1/256 voxel ([`ONE`] per voxel) and at most [`LIMIT`](crate::lattice::LIMIT) voxels from
/// zero. A column beyond the rim is like the nearest one on the rim, so every query has a result.
pub struct Ground {
    extent: Extent,
    /// One height for each column, row-major; empty for a ground with a source.
    heights: Vec<i32>,
    materials: Materials,
    below: Option<Below>,
    height_range: (i32, i32),
    hash: u64,
    /// The source of heights, and its computed pages.
    pages: Option<Box<Pages>>,
}

/// Compares sources only by their ids.
impl PartialEq for Ground {
    fn eq(&self, other: &Self) -> bool {
        let source = |ground: &Self| ground.source().map(HeightSource::id);
        self.extent == other.extent
            && source(self) == source(other)
            && self.heights == other.heights
            && self.materials == other.materials
            && self.below == other.below
    }
}

/// The buffer of [`Ground::row`], kept by the caller so that it is allocated once for many rows.
#[derive(Default)]
pub(crate) struct RowBuffer {
    pub(super) normals: Vec<Vec3>,
    /// Heights, for grounds with a source.
    pub(super) heights: Vec<i32>,
    /// Materials, for grounds with a source, unless all columns are alike.
    pub(super) materials: Vec<ColumnMaterial>,
}

impl Ground {
    /// The maximum number of cells along one side of a world whose heights are kept in memory.
    pub const MAX_SIZE: u32 = super::MAX_SIZE;

    /// The maximum number of cells along one side of a world with a [`HeightSource`]: the same as brushes
    /// [reach](crate::lattice::REACH).
    ///
    /// Positions in 1/4096 voxel, counted from the world's origin, would fit 32 bits up to 524,287 voxels. But a
    /// [`Brush`](crate::brush::Brush) says where it is in `f32`, which holds places to 1/256 voxel up to 65,536
    /// voxels from the origin, and to 1/64 voxel at the far end of such a world. Meshes are stored relative to
    /// their own origins and lose nothing; a camera that goes that far needs an origin that follows it, as in any
    /// game with `f32` transforms.
    pub const MAX_SOURCE_SIZE: u32 = super::MAX_SOURCE_SIZE;

    /// The ground with these heights, one for each column of the extent, each within the lattice's limit.
    pub(super) fn new(extent: Extent, heights: Vec<i32>) -> Self {
        let range = |a: (i32, i32), b: (i32, i32)| (a.0.min(b.0), a.1.max(b.1));
        let height_range = heights.par_iter().map(|&h| (h, h)).reduce_with(range).unwrap_or((0, 0));
        Self {
            extent,
            heights,
            materials: Materials::Uniform(ColumnMaterial::default()),
            below: None,
            height_range,
            hash: 0,
            pages: None,
        }
        .hashed()
    }

    /// The ground whose heights a source gives.
    pub(super) fn of_pages(extent: Extent, pages: Pages) -> Self {
        let materials = match pages.source.has_materials() {
            true => Materials::OnDemand(None),
            false => Materials::Uniform(ColumnMaterial::default()),
        };
        Self {
            extent,
            heights: Vec::new(),
            materials,
            below: None,
            height_range: pages.bounds,
            hash: 0,
            pages: Some(Box::new(pages)),
        }
        .hashed()
    }

    /// The source, if its heights are computed on demand.
    pub(super) fn source(&self) -> Option<&dyn HeightSource> {
        self.pages().map(|pages| &*pages.source)
    }

    /// The computed pages of the source.
    pub(super) fn pages(&self) -> Option<&Pages> {
        self.pages.as_deref()
    }

    /// This ground without computed pages, and with another budget for them.
    pub(super) fn with_empty_pages(mut self, budget: Option<usize>) -> Self {
        let column_bytes = self.on_demand_column_bytes();
        self.pages = self.pages.map(|pages| {
            let budget = budget.unwrap_or(pages.budget());
            Box::new(pages.emptied(column_bytes, budget))
        });
        self
    }

    pub(super) fn materials(&self) -> &Materials {
        &self.materials
    }

    /// This ground with other materials; `Columns` hold one for each column.
    pub(super) fn replace_materials(self, materials: Materials) -> Self {
        Self { materials, ..self }.hashed()
    }

    /// This ground with something else below its surface.
    pub(super) fn replace_below(self, below: Below) -> Self {
        Self { below: Some(below), ..self }.hashed()
    }

    /// This ground with another representation of what is below its surface.
    pub(super) fn map_below(mut self, map: impl FnOnce(Below) -> Below) -> Self {
        self.below = self.below.map(map);
        self
    }

    /// The material below its surface, unless it follows from the columns.
    pub(super) fn below(&self) -> Option<&Below> {
        self.below.as_ref()
    }

    /// The ground with its hash up to date. Rows are hashed in parallel, then their hashes in order.
    fn hashed(mut self) -> Self {
        if self.pages.is_some() {
            self.hash = self.hash_on_demand();
            return self.with_empty_pages(None);
        }
        let row_len = self.extent.row_len();
        let rows: Vec<u64> = self
            .heights
            .par_chunks_exact(row_len)
            .enumerate()
            .map(|(z, row)| {
                let word = |(x, &height): (usize, &i32)| {
                    u64::from(height.cast_unsigned()) | self.materials.get(z * row_len + x).word() << 32
                };
                hash_words(row.iter().enumerate().map(word))
            })
            .collect();
        let dims = [self.width() as u64, self.depth() as u64];
        self.hash = hash_words(dims.into_iter().chain(rows).chain(self.below_hash()));
        self
    }

    /// The world's rectangle.
    pub(super) fn extent(&self) -> Extent {
        self.extent
    }

    /// Cells along x; columns run from 0 to `width`, both included.
    pub fn width(&self) -> i32 {
        self.extent.width()
    }

    /// Cells along z; columns run from 0 to `depth`, both included.
    pub fn depth(&self) -> i32 {
        self.extent.depth()
    }

    /// Height of a column in 1/256 voxel; beyond the rim, that of the nearest rim column.
    pub fn height(&self, column: Column) -> i32 {
        match self.heights.get(self.extent.index(column)) {
            Some(&height) => height,
            None => self.height_on_demand(column),
        }
    }

    /// The place of a column of the world in arrays over it, and its height; of a column beyond the rim, those of some
    /// other.
    pub(super) fn inner_height(&self, column: Column) -> (usize, i32) {
        let index = self.extent.inner_index(column);
        match self.heights.get(index) {
            Some(&height) => (index, height),
            None => (index, self.height_on_demand(column)),
        }
    }

    /// Heights of `N` x `N` columns from `low` on, rows along x: what [`Self::height`] gives for each.
    pub(crate) fn heights<const N: usize>(&self, low: Column) -> [[i32; N]; N] {
        if self.heights.is_empty() {
            return self.heights_on_demand(low);
        }
        let last = low.offset(N as i32 - 1, N as i32 - 1);
        if self.extent.clamp(low) != low || self.extent.clamp(last) != last {
            let height = |x: usize, z: usize| self.height(low.offset(x as i32, z as i32));
            return std::array::from_fn(|z| std::array::from_fn(|x| height(x, z)));
        }
        let start = self.extent.index(low);
        let row = |z| self.heights[start + z * self.extent.row_len()..].first_chunk().copied();
        std::array::from_fn(|z| row(z).unwrap_or([0; N]))
    }

    /// Fills in the heights of rows of `width` columns, from `low` on: what [`Self::height`] gives for each.
    pub(crate) fn fill_heights(&self, low: Column, width: usize, heights: &mut [i32]) {
        if self.heights.is_empty() {
            return self.fill_heights_on_demand(low, width, heights);
        }
        for (z, row) in (low.z..).zip(heights.chunks_mut(width.max(1))) {
            // Beyond the rim, columns are those on it.
            let inside = |x: i64| x.clamp(0, row.len() as i64) as usize;
            let start = inside(-i64::from(low.x));
            let end = inside(i64::from(self.width()) + 1 - i64::from(low.x)).max(start);
            let [first, last] = [low.x, self.width()].map(|x| self.extent.index(Column::new(x, z)));
            row[..start].fill(self.heights[first]);
            row[end..].fill(self.heights[last]);
            row[start..end].copy_from_slice(&self.heights[first..first + end - start]);
        }
    }

    /// Pristine density of a lattice point: how far it lies above the surface of its column, in 1/256 voxel, negative
    /// below. Exact wherever it fits an `i32`, which is everywhere within the lattice's limit; saturated beyond.
    pub fn distance(&self, point: IVec3) -> i32 {
        let height = self.height(Column::of(point));
        let distance = i64::from(point.y) * i64::from(ONE) - i64::from(height);
        distance.clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32
    }

    /// Unit normal of the surface over a column: central differences of the height, one-sided at the rim; beyond the
    /// rim, that of the nearest rim column. Same bits on every machine.
    pub fn normal(&self, column: Column) -> Vec3 {
        normal_of(self.rises(column))
    }

    /// Like [`Self::normal`], from the heights of the columns before and after along x and z; `None` at the
    /// rim.
    pub(crate) fn inner_normal(&self, column: Column, x: [i32; 2], z: [i32; 2]) -> Option<Vec3> {
        let is_inner = (1..self.width()).contains(&column.x) && (1..self.depth()).contains(&column.z);
        let rise = |[before, after]: [i32; 2]| Rise { rise: after - before, run: 2 };
        is_inner.then(|| normal_of([rise(x), rise(z)]))
    }

    /// Columns of a row that all lie in the world, from one on: their heights, normals and materials, equal
    /// to [`Self::height`], [`Self::normal`] and [`Self::surface_material`] of each. Computed values go into
    /// the caller's buffer. Of columns beyond the rim, none.
    pub(crate) fn row<'a>(
        &'a self,
        low: Column,
        count: usize,
        buffer: &'a mut RowBuffer,
    ) -> impl Iterator<Item = (i32, Vec3, ColumnMaterial)> {
        let is_inside = self.extent.clamp(low) == low && count <= (self.width() - low.x) as usize + 1;
        let count = if is_inside { count } else { 0 };
        let RowBuffer { normals, heights, materials } = buffer;
        normals.clear();
        heights.clear();
        materials.clear();
        let row = |z: i32| {
            let start = self.extent.index(Column::new(low.x, z));
            start..start + count
        };
        let z = self.extent.clamp(low).z;
        let own = if self.pages.is_some() {
            self.fill_row(low, count, normals, heights, materials);
            heights
        } else {
            let (north, south) = ((z - 1).max(0), (z + 1).min(self.depth()));
            let [own, before, after] = [z, north, south].map(|z| &self.heights[row(z)]);
            // All but those at the rim have a neighbour on either side.
            let ends_at_rim = count > 0 && low.x + count as i32 > self.width();
            let inner = usize::from(low.x == 0)..count.saturating_sub(ends_at_rim.into());
            let rim = |at: usize| self.normal(low.offset(at as i32, 0));
            normals.extend((0..inner.start.min(count)).map(rim));
            if inner.start < inner.end {
                let start = self.extent.index(low) + inner.start;
                let (west, east) = (&self.heights[start - 1..], &self.heights[start + 1..]);
                let along_x = west.iter().zip(east).map(|(west, east)| Rise { rise: east - west, run: 2 });
                let along_z = before[inner.clone()].iter().zip(&after[inner.clone()]);
                let along_z =
                    along_z.map(|(before, after)| Rise { rise: after - before, run: south - north });
                normals.extend(along_x.zip(along_z).map(|(x, z)| normal_of([x, z])));
            }
            normals.extend((normals.len()..count).map(rim));
            own
        };
        let tops = self.tops_of(row(z)).unwrap_or_default();
        let of_columns = if tops.is_empty() { row(z) } else { 0..0 };
        let tops = tops.iter().map(|&top| ColumnMaterial::solid(top));
        own.iter()
            .zip(normals.iter())
            .zip(tops.chain(self.materials.of(of_columns, materials)))
            .map(|((&height, &normal), material)| (height, normal, material))
    }

    /// Steepness of the surface over a column as rise over run, from the same differences as [`Self::normal`]: 0 is
    /// level, 1 is 45 degrees.
    pub fn slope(&self, column: Column) -> f64 {
        slope_of(self.rises(column))
    }

    /// Change of height around a column along x and along z.
    #[inline]
    fn rises(&self, column: Column) -> [Rise; 2] {
        if let Some(pages) = &self.pages {
            return self.rises_on_demand(pages, column);
        }
        let Column { x, z } = self.extent.clamp(column);
        if (1..self.width()).contains(&x) && (1..self.depth()).contains(&z) {
            let (at, row) = (self.extent.inner_index(Column::new(x, z)), self.extent.row_len());
            let rise = |step: usize| Rise { rise: self.heights[at + step] - self.heights[at - step], run: 2 };
            return [rise(1), rise(row)];
        }
        let (west, east) = ((x - 1).max(0), (x + 1).min(self.width()));
        let (north, south) = ((z - 1).max(0), (z + 1).min(self.depth()));
        [
            Rise {
                rise: self.height(Column::new(east, z)) - self.height(Column::new(west, z)),
                run: east - west,
            },
            Rise {
                rise: self.height(Column::new(x, south)) - self.height(Column::new(x, north)),
                run: south - north,
            },
        ]
    }

    /// Materials of a column; beyond the rim, those of the nearest rim column.
    pub fn column_material(&self, column: Column) -> ColumnMaterial {
        match &self.materials {
            Materials::OnDemand(control) => self.material_on_demand(control.as_deref(), column),
            resident => resident.get(self.extent.index(column)),
        }
    }

    /// The material of all ground, if it is the same everywhere.
    pub(crate) fn single_material(&self) -> Option<MaterialId> {
        match self.materials {
            Materials::Uniform(all)
                if self.below.is_none() && (all.blend == 0 || all.base == all.overlay) =>
            {
                Some(all.base)
            }
            _ => None,
        }
    }

    /// The material of a voxel from its column.
    pub(super) fn material_of_column(&self, point: IVec3) -> MaterialId {
        self.column_material(Column::of(point)).at_distance(self.distance(point))
    }

    /// The world's column nearest to a point's.
    pub(crate) fn nearest_column(&self, point: IVec3) -> Column {
        self.extent.clamp(Column::of(point))
    }

    /// Square of the surface's steepness over a column of the world, in 1/256 voxel of rise over two voxels of run.
    #[inline]
    pub(crate) fn squared_slope(&self, column: Column) -> u64 {
        squared_slope_of(self.rises(column))
    }

    /// Lowest and highest height of the world, in 1/256 voxel; with a source, the bounds that it promised.
    pub fn height_range(&self) -> (i32, i32) {
        self.height_range
    }

    /// Hash of the dimensions, heights and materials: equal for equal worlds, on every machine. The heights and
    /// materials of a [source](Self::from_source) are hashed by its [id](HeightSource::id), so it differs from the hash
    /// of the same heights in memory.
    pub fn hash(&self) -> u64 {
        self.hash
    }

    /// Bytes of memory that the ground takes; with a source, those of the pages that it keeps now, and of the source.
    pub fn bytes(&self) -> usize {
        let materials = match &self.materials {
            Materials::Uniform(_) => 0,
            Materials::Columns(materials) => size_of_val(materials.as_slice()),
            Materials::OnDemand(control) => control.as_ref().map_or(0, |control| control.bytes()),
        };
        let pages = self.pages.as_ref().map_or(0, |pages| size_of::<Pages>() + pages.bytes());
        let below = self.below.as_ref().map_or(0, Below::bytes);
        size_of::<Self>() + size_of_val(self.heights.as_slice()) + materials + below + pages
    }
}

impl fmt::Debug for Ground {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Ground")
            .field("width", &self.width())
            .field("depth", &self.depth())
            .field("height_range", &self.height_range)
            .field("hash", &format_args!("{:#018x}", self.hash))
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A small world of bumps, no two rim columns alike.
    fn bumps() -> Ground {
        Ground::from_heights(4, 3, (0..20).map(|i| i * i * 37 % 1901 - 700).collect()).unwrap()
    }

    proptest! {
        #[test]
        fn beyond_the_rim_all_is_as_on_it(x: i32, y: i32, z: i32) {
            let ground = bumps();
            let (outside, rim) = (Column::new(x, z), Column::new(x.clamp(0, 4), z.clamp(0, 3)));
            prop_assert_eq!(ground.height(outside), ground.height(rim));
            prop_assert_eq!(ground.normal(outside), ground.normal(rim));
            prop_assert_eq!(ground.column_material(outside), ground.column_material(rim));
            prop_assert_eq!(ground.distance(outside.at(y)), ground.distance(rim.at(y)));
            prop_assert_eq!(ground.material(outside.at(y)), ground.material(rim.at(y)));
        }

        #[test]
        fn normals_are_unit_vectors_that_point_up(heights in prop::collection::vec(-(1 << 23)..=1 << 23, 12)) {
            let ground = Ground::from_heights(3, 2, heights).unwrap();
            for (x, z) in (0..=2).flat_map(|z| (0..=3).map(move |x| (x, z))) {
                let normal = ground.normal(Column::new(x, z));
                prop_assert!((normal.length() - 1.0).abs() < 1e-5 && normal.y > 0.0, "{normal}");
            }
        }
    }

    #[test]
    fn rows_of_columns_are_the_columns() {
        let materials = |i: u8| ColumnMaterial { base: MaterialId(i), overlay: MaterialId(i / 3), blend: i };
        let columns: Vec<_> = (0..80).map(materials).collect();
        let mixed = Ground::from_heights(9, 7, (0..80).map(|i| i * i * 37 % 1901 - 700).collect()).unwrap();
        let mixed = Ground { materials: Materials::from_columns(columns), ..mixed };
        let narrow = |width, depth, count| Ground::from_heights(width, depth, (0..count).collect()).unwrap();
        for ground in [mixed, bumps(), narrow(1, 1, 4), narrow(1, 3, 8), narrow(5, 1, 12)] {
            for (x, z) in (-2..12).flat_map(|z| (-2..12).map(move |x| (x, z))) {
                for count in 0..12 {
                    let (low, last) = (Column::new(x, z), Column::new(x + count as i32 - 1, z));
                    let is_inside =
                        ground.extent.clamp(low) == low && (count == 0 || ground.extent.clamp(last) == last);
                    let expected = (0..if is_inside { count as i32 } else { 0 }).map(|at| {
                        let column = low.offset(at, 0);
                        let normal = ground.normal(column).to_array().map(f32::to_bits);
                        (ground.height(column), normal, ground.column_material(column))
                    });
                    let mut normals = RowBuffer { normals: vec![Vec3::ONE; 3], ..RowBuffer::default() };
                    let found = ground.row(low, count, &mut normals);
                    let found = found.map(|(height, normal, material)| {
                        (height, normal.to_array().map(f32::to_bits), material)
                    });
                    assert!(found.eq(expected), "{count} from ({x}, {z}) of {ground:?}");
                }
            }
        }
    }

    #[test]
    fn windows_of_heights_are_the_heights() {
        let ground = Ground::from_heights(9, 7, (0..80).collect()).unwrap();
        for (x, z) in (-6..12).flat_map(|z| (-6..12).map(move |x| (x, z))) {
            let low = Column::new(x, z);
            let expected: [[i32; 5]; 5] = std::array::from_fn(|dz| {
                std::array::from_fn(|dx| ground.height(low.offset(dx as i32, dz as i32)))
            });
            assert_eq!(ground.heights::<5>(low), expected, "from ({x}, {z})");
        }
    }

    #[test]
    fn the_ends_of_the_integers_are_beyond_the_rim() {
        let ground = bumps();
        for end in [i32::MIN, i32::MAX] {
            let corner = Column::new(end, end);
            assert_eq!(ground.height(corner), ground.height(Column::new(end.clamp(0, 4), end.clamp(0, 3))));
            assert_eq!(ground.distance(corner.at(end)), end);
        }
    }

    #[test]
    fn distance_is_exact_on_the_lattice() {
        let ground = Ground::flat(2, 2, 1.5).unwrap();
        assert_eq!(
            [0, 1, 2, -32_768].map(|y| ground.distance(IVec3::new(1, y, 1))),
            [-384, -128, 128, -8_388_992]
        );
    }

    #[test]
    fn a_plane_has_one_normal_the_rim_included() {
        let ground = Ground::from_fn(5, 4, |x, z| 0.5 * f64::from(x) - 2.0 * f64::from(z)).unwrap();
        let expected = Vec3::new(-0.5, 1.0, 2.0).normalize();
        for (x, z) in (-1..=5).flat_map(|z| (-1..=6).map(move |x| (x, z))) {
            assert!(ground.normal(Column::new(x, z)).abs_diff_eq(expected, 1e-6), "at ({x}, {z})");
            assert!((ground.slope(Column::new(x, z)) - 4.25_f64.sqrt()).abs() < 1e-12);
        }
    }

    #[test]
    fn the_hash_distinguishes_worlds() {
        let heights = || (0..12).collect::<Vec<i32>>();
        let hash = |width, depth, heights| Ground::from_heights(width, depth, heights).unwrap().hash();
        let mut other = heights();
        other.swap(3, 4);
        assert_eq!(hash(3, 2, heights()), hash(3, 2, heights()));
        assert_ne!(hash(3, 2, heights()), hash(2, 3, heights()));
        assert_ne!(hash(3, 2, heights()), hash(3, 2, other));
    }

    #[test]
    fn the_hash_is_the_same_on_every_machine() {
        // If this fails, worlds saved with the old hashes are no longer recognised: say so in the changelog.
        assert_eq!(bumps().hash(), 0xD52B_8BB1_2AC5_464F);
    }

    #[test]
    fn height_range_and_bytes_describe_the_world() {
        let ground = Ground::from_heights(1, 1, vec![5, -7, 0, 9]).unwrap();
        assert_eq!(ground.height_range(), (-7, 9));
        assert_eq!(ground.bytes(), size_of::<Ground>() + 16);
        assert!(format!("{ground:?}").len() < 120);
    }
}
