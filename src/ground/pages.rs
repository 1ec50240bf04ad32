//! Pages: squares of columns of a ground with a source, computed when they are asked for and kept within a budget.

use std::cell::RefCell;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use rustc_hash::FxHashMap;

use super::columns::fill_columns;
use super::extent::Extent;
use super::material::{ColumnMaterial, MaterialId};
use super::source::{ColumnGrid, HeightSource, checked_bounds};
use crate::lattice::Column;
use crate::lattice::hash::mix;

/// Columns along a page's side.
const PAGE: i32 = 64;
/// Columns before and after these whose heights a page holds too, so that windows over a brick lie in one page.
const BEFORE: i32 = 1;
const AFTER: i32 = 2;
/// Heights along a page's side.
const SIDE: usize = (BEFORE + PAGE + AFTER) as usize;

/// Bytes of pages that a ground keeps by default.
pub(super) const DEFAULT_BUDGET: usize = 32 << 20;

/// The maximum number of parts of the cache that are locked on their own.
const MAX_SHARDS: usize = 16;

/// Which page: its column of pages along x, and along z.
pub(super) type Place = (i32, i32);

/// What is known of some columns.
pub(super) struct Page {
    place: Place,
    /// Row by row, from `BEFORE` columns before the page's first one on. Columns beyond the rim are like those on it.
    heights: Box<[i32]>,
    /// Materials of the page's own columns, the material of the highest solid voxel, where these
    /// differ from column to column; and which cells are steep, a word for 8x8 of them. Each is computed when it is
    /// first needed.
    pub materials: OnceLock<Box<[ColumnMaterial]>>,
    pub tops: OnceLock<Box<[MaterialId]>>,
    pub steep: OnceLock<Box<[u64]>>,
}

impl Page {
    /// The place in arrays over the page's own columns.
    pub fn index(column: Column) -> usize {
        ((column.z & (PAGE - 1)) * PAGE + (column.x & (PAGE - 1))) as usize
    }

    /// The place of the word for the cell of this column.
    pub fn word_index(cell: Column) -> usize {
        ((cell.z & (PAGE - 1)) / 8 * (PAGE / 8) + (cell.x & (PAGE - 1)) / 8) as usize
    }

    /// The page's own columns, row by row.
    pub fn columns(&self) -> ColumnGrid {
        ColumnGrid { low: self.low(), stride: 1, width: PAGE as usize, depth: PAGE as usize }
    }

    /// The lowest cell of each 8x8.
    pub fn words(&self) -> ColumnGrid {
        let side = (PAGE / 8) as usize;
        ColumnGrid { low: self.low(), stride: 8, width: side, depth: side }
    }

    fn low(&self) -> Column {
        Column::new(self.place.0 * PAGE, self.place.1 * PAGE)
    }

    /// The place of the height of a column, `BEFORE` before the page's first one or after it.
    fn height_index(column: Column, place: Place) -> usize {
        let (x, z) = (column.x - place.0 * PAGE + BEFORE, column.z - place.1 * PAGE + BEFORE);
        z as usize * SIDE + x as usize
    }

    /// Height of a column of the page.
    pub fn height(&self, column: Column) -> i32 {
        self.heights[Self::height_index(column, self.place)]
    }

    /// Heights before and after a column of the page, along x and along z.
    pub fn around(&self, column: Column) -> [[i32; 2]; 2] {
        let index = Self::height_index(column, self.place);
        [1, SIDE].map(|step| [self.heights[index - step], self.heights[index + step]])
    }
}

/// A page that a thread asked for last, of the cache with this number.
struct Recent {
    cache: u64,
    page: Arc<Page>,
}

thread_local! {
    /// Four, so that a window over the corner of pages finds all of them. Threads keep them beyond the budget.
    static RECENT: RefCell<[Option<Recent>; 4]> = const { RefCell::new([const { None }; 4]) };
}

/// A part of the cache.
#[derive(Default)]
struct Shard {
    pages: FxHashMap<Place, Kept>,
    /// How often it was asked.
    asked: u64,
}

struct Kept {
    page: Arc<Page>,
    /// When it was asked for last.
    asked: u64,
}

/// A source, and the pages that were computed of it.
pub(super) struct Pages {
    pub source: Box<dyn HeightSource>,
    pub bounds: (i32, i32),
    extent: Extent,
    /// A number that no other cache of the program has.
    number: u64,
    budget: usize,
    page_bytes: usize,
    /// The maximum number of pages of a shard.
    most: usize,
    shards: Box<[Mutex<Shard>]>,
}

impl Pages {
    /// No pages yet.
    pub fn new(source: Box<dyn HeightSource>, extent: Extent) -> Self {
        let bounds = checked_bounds(&*source);
        let empty = Self {
            source,
            bounds,
            extent,
            number: 0,
            budget: DEFAULT_BUDGET,
            page_bytes: 0,
            most: 0,
            shards: Box::default(),
        };
        empty.emptied(0, DEFAULT_BUDGET)
    }

    /// This cache without its pages, which from now on have `column_bytes` bytes for each column in addition
    /// to its height.
    pub fn emptied(self, column_bytes: usize, budget: usize) -> Self {
        static LAST: AtomicU64 = AtomicU64::new(0);
        let number = LAST.fetch_add(1, Ordering::Relaxed) + 1;
        let own = size_of::<Page>() + size_of::<(Place, Kept)>() + SIDE * SIDE * size_of::<i32>();
        let page_bytes = own + column_bytes * (PAGE * PAGE) as usize;
        let count = budget / page_bytes;
        // Few large shards are emptied more evenly than many small ones.
        let shards = (count / 8).clamp(1, MAX_SHARDS);
        Self {
            number,
            budget,
            page_bytes,
            most: count / shards,
            shards: (0..shards).map(|_| Mutex::default()).collect(),
            ..self
        }
    }

    /// Bytes of pages that are kept at most.
    pub fn budget(&self) -> usize {
        self.budget
    }

    /// Bytes of the pages that are kept, and of the source.
    pub fn bytes(&self) -> usize {
        let count: usize = self.shards.iter().map(|shard| lock(shard).pages.len()).sum();
        count * self.page_bytes + self.source.bytes()
    }

    /// The page of a column of the world.
    pub fn place(column: Column) -> Place {
        (column.x.div_euclid(PAGE), column.z.div_euclid(PAGE))
    }

    /// Reads the page at a place of the world. The reader must not ask for pages itself.
    #[inline]
    pub fn read<R>(&self, place: Place, read: impl Fn(&Page) -> R) -> R {
        let slot = Self::slot(place);
        let found = RECENT.with_borrow(|recent| {
            let recent = recent[slot].as_ref()?;
            (recent.cache == self.number && recent.page.place == place).then(|| read(&recent.page))
        });
        found.unwrap_or_else(|| {
            let page = self.find(place);
            let result = read(&page);
            self.remember(page);
            result
        })
    }

    /// Keeps a page as one that this thread asked for last.
    fn remember(&self, page: Arc<Page>) {
        let slot = Self::slot(page.place);
        RECENT.with_borrow_mut(|recent| recent[slot] = Some(Recent { cache: self.number, page }));
    }

    fn slot(place: Place) -> usize {
        (place.0 & 1 | (place.1 & 1) << 1) as usize
    }

    /// Reads data that a page may not hold yet; `make` computes it.
    pub fn read_or_make<R>(
        &self,
        place: Place,
        read: impl Fn(&Page) -> Option<R>,
        make: impl FnOnce(&Page),
    ) -> Option<R> {
        self.read(place, &read).or_else(|| {
            // Not while the thread's pages are borrowed: making asks for others.
            let page = self.find(place);
            make(&page);
            let result = read(&page);
            self.remember(page);
            result
        })
    }

    /// Heights of `N` x `N` columns from `low` on, if they all lie in or around one page.
    pub fn window<const N: usize>(&self, low: Column) -> Option<[[i32; N]; N]> {
        let place = Self::place(low.offset(BEFORE, BEFORE));
        let first = self.extent.clamp(Column::new(place.0 * PAGE, place.1 * PAGE));
        let last = Column::new(low.x.checked_add(N as i32 - 1)?, low.z.checked_add(N as i32 - 1)?);
        let end = |place: i32| place * PAGE + PAGE + AFTER;
        if Self::place(first) != place || last.x >= end(place.0) || last.z >= end(place.1) {
            return None;
        }
        self.read(place, |page| {
            let start = Page::height_index(low, place);
            let mut window = [[0; N]; N];
            for (row, heights) in window.iter_mut().zip(page.heights[start..].chunks(SIDE)) {
                row.copy_from_slice(&heights[..N]);
            }
            Some(window)
        })
    }

    /// Heights of the columns with these coordinates, which lie in the world, asked of the source.
    pub fn points(&self, columns: [&[i32]; 2], stride: i32) -> Vec<i32> {
        let mut heights = vec![0; columns[0].len() * columns[1].len()];
        fill_columns(columns, stride, &mut heights, |grid, heights| self.source.fill_heights(grid, heights));
        let (low, high) = self.bounds;
        heights.iter_mut().for_each(|height| *height = (*height).clamp(low, high));
        heights
    }

    /// The source's materials at single points.
    pub fn point_materials(&self, columns: [&[i32]; 2], stride: i32) -> Vec<ColumnMaterial> {
        let mut materials = vec![ColumnMaterial::default(); columns[0].len() * columns[1].len()];
        fill_columns(columns, stride, &mut materials, |grid, own| self.source.fill_materials(grid, own));
        let checked = |id: MaterialId| if id == MaterialId::GROUND { MaterialId(0) } else { id };
        for material in &mut materials {
            let ColumnMaterial { base, overlay, blend } = *material;
            *material = ColumnMaterial { base: checked(base), overlay: checked(overlay), blend };
        }
        materials
    }

    /// The source's materials of a page's own columns.
    pub fn source_materials(&self, page: &Page) -> Vec<ColumnMaterial> {
        let [xs, zs] = self.coordinates(page.low(), [PAGE as usize; 2]);
        self.point_materials([&xs, &zs], 1)
    }

    /// Coordinates of columns that follow each other, clamped to the rim.
    fn coordinates(&self, low: Column, [width, depth]: [usize; 2]) -> [Vec<i32>; 2] {
        let xs = (0..width as i32).map(|x| self.extent.clamp(low.offset(x, 0)).x).collect();
        let zs = (0..depth as i32).map(|z| self.extent.clamp(low.offset(0, z)).z).collect();
        [xs, zs]
    }

    /// The page at a place, from the cache if it is there.
    fn find(&self, place: Place) -> Arc<Page> {
        let number = u64::from(place.0.cast_unsigned()) | u64::from(place.1.cast_unsigned()) << 32;
        let shard = &self.shards[mix(number) as usize % self.shards.len()];
        if let Some(page) = lock(shard).get(place) {
            return page;
        }
        // Without the lock: it takes a while, and other threads may need other pages. Two may make the same one.
        let page = Arc::new(self.make(place));
        let mut shard = lock(shard);
        match shard.get(place) {
            Some(page) => page,
            None => {
                shard.keep(&page, self.most);
                page
            }
        }
    }

    fn make(&self, place: Place) -> Page {
        let low = Column::new(place.0 * PAGE - BEFORE, place.1 * PAGE - BEFORE);
        let [xs, zs] = self.coordinates(low, [SIDE; 2]);
        let heights = self.points([&xs, &zs], 1).into_boxed_slice();
        let (materials, tops, steep) = Default::default();
        Page { place, heights, materials, tops, steep }
    }
}

impl Shard {
    fn get(&mut self, place: Place) -> Option<Arc<Page>> {
        self.asked += 1;
        let kept = self.pages.get_mut(&place)?;
        kept.asked = self.asked;
        Some(Arc::clone(&kept.page))
    }

    /// Keeps a page, and in return drops the one that was not asked for longest if there are too many.
    fn keep(&mut self, page: &Arc<Page>, most: usize) {
        while self.pages.len() >= most.max(1) {
            let oldest = self.pages.iter().min_by_key(|(_, kept)| kept.asked).map(|(&place, _)| place);
            oldest.map(|place| self.pages.remove(&place));
        }
        if most > 0 {
            self.pages.insert(page.place, Kept { page: Arc::clone(page), asked: self.asked });
        }
    }
}

/// Poisoning is ignored: a panicking holder leaves the shard valid.
fn lock(shard: &Mutex<Shard>) -> MutexGuard<'_, Shard> {
    shard.lock().unwrap_or_else(PoisonError::into_inner)
}
