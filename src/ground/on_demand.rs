//! Grounds with a source: the queries of [`Ground`], answered from pages instead of memory.

use glam::Vec3;

use super::control::MaterialControl;
use super::error::GroundError;
use super::extent::Extent;
use super::material::{ColumnMaterial, MaterialId};
use super::pages::{Page, Pages};
use super::rise::Rise;
use super::source::HeightSource;
use super::stored_materials::Materials;
use super::strata::steep_word;
use super::world::Ground;
use crate::lattice::Column;
use crate::lattice::hash::hash_words;

impl Ground {
    /// Ground of `width` x `depth` cells whose heights, and materials if any, come from a source on demand.
    ///
    /// Memory depends on the columns in use: pages of 64 x 64 columns are computed, with about 18 kB for
    /// their heights and up to 4 bytes a column for materials and strata, and kept [within a
    /// budget](Self::with_page_budget). Everything else works as with equal heights in memory, except for
    /// [`Self::hash`] and [`Self::height_range`], which depend on the source's promises.
    ///
    /// # Errors
    /// [`GroundError::SourceSize`] unless width and depth are 1 to [`Ground::MAX_SOURCE_SIZE`].
    pub fn from_source(width: u32, depth: u32, source: impl HeightSource) -> Result<Self, GroundError> {
        let extent = Extent::of_source(width, depth)?;
        Ok(Self::of_pages(extent, Pages::new(Box::new(source), extent)))
    }

    /// This ground with another budget for computed pages, in bytes; 32 MiB by default. Each thread keeps up
    /// to four pages beyond that. A small budget costs time, and changes nothing else. Does nothing without a
    /// [source](Self::from_source).
    pub fn with_page_budget(self, bytes: usize) -> Self {
        self.with_empty_pages(Some(bytes))
    }

    /// Bytes that a page has for each column, in addition to its height.
    pub(super) fn on_demand_column_bytes(&self) -> usize {
        let has_materials = matches!(self.materials(), Materials::OnDemand(_));
        // Tops, and a bit for a steep cell.
        let of_below = usize::from(self.below().is_some()) * 2;
        usize::from(has_materials) * size_of::<ColumnMaterial>() + of_below
    }

    /// Hash of a ground with a source.
    pub(super) fn hash_on_demand(&self) -> u64 {
        let id = self.source().map_or(0, HeightSource::id);
        let materials = match self.materials() {
            Materials::Uniform(material) => hash_words([1, material.word()]),
            Materials::OnDemand(Some(control)) => control.hash(),
            Materials::OnDemand(None) | Materials::Columns(_) => 0,
        };
        let size = [self.width(), self.depth()].map(|cells| u64::from(cells.cast_unsigned()));
        // The first word distinguishes such grounds from those in memory, which begin with a size.
        hash_words([u64::MAX, size[0], size[1], id, materials].into_iter().chain(self.below_hash()))
    }

    /// Reads the page of the world's column nearest to another; without a source there is none.
    fn read_page<R>(&self, column: Column, read: impl Fn(&Page, Column) -> R) -> Option<R> {
        let column = self.extent().clamp(column);
        Some(self.pages()?.read(Pages::place(column), |page| read(page, column)))
    }

    /// Height of the world's column nearest to another.
    #[inline(never)]
    pub(super) fn height_on_demand(&self, column: Column) -> i32 {
        self.read_page(column, Page::height).unwrap_or_default()
    }

    /// [Height](Self::height) of a single column: no page is made for it.
    pub(crate) fn lone_height(&self, column: Column) -> i32 {
        let Column { x, z } = self.extent().clamp(column);
        let point = self.pages().and_then(|pages| pages.points([&[x], &[z]], 1).first().copied());
        point.unwrap_or_else(|| self.height(column))
    }

    /// Heights of `N` x `N` columns from `low` on.
    pub(super) fn heights_on_demand<const N: usize>(&self, low: Column) -> [[i32; N]; N] {
        let height = |x: usize, z: usize| self.height(low.offset(x as i32, z as i32));
        let window = self.pages().and_then(|pages| pages.window(low));
        window.unwrap_or_else(|| std::array::from_fn(|z| std::array::from_fn(|x| height(x, z))))
    }

    /// Fills in the heights of rows of `width` columns, from `low` on, 8x8 columns of a page at once.
    pub(super) fn fill_heights_on_demand(&self, low: Column, width: usize, heights: &mut [i32]) {
        let depth = heights.len() / width.max(1);
        let blocks = |low: i32, count: usize| low >> 3..=(low + count as i32 - 1) >> 3;
        for (z, x) in blocks(low.z, depth).flat_map(|z| blocks(low.x, width).map(move |x| (z, x))) {
            let block = self.heights_on_demand::<8>(Column::new(x * 8, z * 8));
            let (from, to) = ((low.x - x * 8).max(0), (low.x + width as i32 - x * 8).min(8));
            for (z, block) in (z * 8..).zip(&block) {
                let row =
                    usize::try_from(z - low.z).ok().and_then(|z| heights.chunks_exact_mut(width).nth(z));
                if let Some(row) = row {
                    let start = (x * 8 + from - low.x) as usize;
                    row[start..][..(to - from) as usize].copy_from_slice(&block[from as usize..to as usize]);
                }
            }
        }
    }

    /// Change of height around the world's column nearest to another.
    pub(super) fn rises_on_demand(&self, pages: &Pages, column: Column) -> [Rise; 2] {
        let column = self.extent().clamp(column);
        let [x, z] = pages.read(Pages::place(column), |page| page.around(column));
        // Pages repeat the rim's heights beyond it, so only columns inside are compared.
        let run = |at: i32, last: i32| if at == 0 || at == last { 1 } else { 2 };
        let rise = |[before, after]: [i32; 2], run| Rise { rise: after - before, run };
        [rise(x, run(column.x, self.width())), rise(z, run(column.z, self.depth()))]
    }

    /// The materials of the world's column nearest to another.
    #[inline(never)]
    pub(super) fn material_on_demand(
        &self,
        control: Option<&MaterialControl>,
        column: Column,
    ) -> ColumnMaterial {
        let column = self.extent().clamp(column);
        let read = |page: &Page| page.materials.get()?.get(Page::index(column)).copied();
        let found = self.pages().and_then(|pages| {
            pages.read_or_make(Pages::place(column), read, |page| {
                let materials = match control {
                    None => pages.source_materials(page),
                    Some(control) => {
                        let columns = page.columns().columns().map(|column| self.extent().clamp(column));
                        columns.map(|column| control.at(self, column)).collect()
                    }
                };
                // Another thread may have been faster, with the same.
                let _ = page.materials.set(materials.into_boxed_slice());
            })
        });
        found.unwrap_or_default()
    }

    /// The material of the highest solid voxel of the world's column nearest to another.
    #[inline(never)]
    pub(super) fn top_on_demand(&self, column: Column) -> MaterialId {
        let column = self.extent().clamp(column);
        let read = |page: &Page| page.tops.get()?.get(Page::index(column)).copied();
        let found = self.pages().and_then(|pages| {
            pages.read_or_make(Pages::place(column), read, |page| {
                let _ = page.tops.set(self.tops_of_page(page));
            })
        });
        found.unwrap_or_default()
    }

    /// Brick by brick, so that strata are prepared once for each.
    fn tops_of_page(&self, page: &Page) -> Box<[MaterialId]> {
        let mut tops = vec![MaterialId::default(); page.columns().count()];
        for low in page.words().columns() {
            for column in (0..64).map(|at| low.offset(at & 7, at >> 3)) {
                if self.extent().clamp(column) == column {
                    tops[Page::index(column)] = self.computed_top(column);
                }
            }
        }
        tops.into_boxed_slice()
    }

    /// The steep ones of the 8x8 cells from `low` on; there are none beyond the rim.
    #[inline(never)]
    pub(super) fn steep_word_on_demand(&self, low: Column) -> u64 {
        if !(0..self.width()).contains(&low.x) || !(0..self.depth()).contains(&low.z) {
            return 0;
        }
        let read = |page: &Page| page.steep.get()?.get(Page::word_index(low)).copied();
        let found = self.pages().and_then(|pages| {
            pages.read_or_make(Pages::place(low), read, |page| {
                let words = page.words().columns().map(|low| steep_word(self, low)).collect();
                let _ = page.steep.set(words);
            })
        });
        found.unwrap_or_default()
    }

    /// Fills a row of columns of the world with normals, heights and, unless all columns are alike, surface materials.
    pub(super) fn fill_row(
        &self,
        low: Column,
        count: usize,
        normals: &mut Vec<Vec3>,
        heights: &mut Vec<i32>,
        materials: &mut Vec<ColumnMaterial>,
    ) {
        let columns = || (0..count as i32).map(|x| low.offset(x, 0));
        normals.extend(columns().map(|column| self.normal(column)));
        heights.extend(columns().map(|column| self.height(column)));
        if self.on_demand_column_bytes() > 0 {
            materials.extend(columns().map(|column| self.surface_material(column)));
        }
    }
}
