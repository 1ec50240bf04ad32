//! Tiles that a transaction touches: which, and what they draw now.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use glam::IVec3;
use rayon::Scope;
use rayon::prelude::*;

use super::by_brick::PARALLEL_PLACES;
use super::commit::Stages;
use super::dirty::grown_into;
#[cfg(feature = "plugin")]
use super::recipe::{SurfaceDraft, TileDraft};
use super::world::World;
use crate::ground::Ground;
use crate::lattice::{ChunkGrid, Column, LatticeBox, TilePos, sort_by_place};
use crate::surface::tile::{self, Rings};
use crate::surface::vertex::WorldView;
use crate::surface::{Indices, Mask, SurfaceMesh};

/// What changes in a tile's mesh. Its columns stay as they are.
#[derive(Clone, Debug)]
pub struct TileUpdate {
    /// The whole list of indices.
    pub indices: Indices,
    /// The rings; their vertices follow after those of the columns.
    pub rings: Arc<Rings>,
    tile: TilePos,
    ground: Arc<Ground>,
    grid: ChunkGrid,
}

impl TileUpdate {
    /// The tile's whole mesh, its columns included.
    pub fn mesh(&self) -> SurfaceMesh {
        let vertices = tile::vertices(&self.ground, self.grid, self.tile, &self.rings);
        SurfaceMesh { vertices, indices: self.indices.clone() }
    }

    /// The same without its columns, as long as nobody asks for them.
    #[cfg(feature = "plugin")]
    pub(crate) fn draft(&self) -> SurfaceDraft<'_> {
        let Self { indices, rings, tile, ground, grid } = self;
        let indices = std::borrow::Cow::Borrowed(indices);
        SurfaceDraft::Tile(TileDraft { tile: *tile, grid: *grid, ground, rings, indices })
    }
}

/// It is known which tiles are touched.
const FOUND: u8 = 1;
/// Somebody said that there is time.
const CALLED: u8 = 2;

/// The tiles of a transaction in the making. Which they are can be found early; they are drawn when that is known and somebody
/// says that there is time.
pub(super) struct TileWork<'a> {
    world: &'a World,
    view: &'a WorldView<'a>,
    /// Words of the mask that change.
    newer: &'a Mask,
    /// Set by whoever has made it; threads that work for rayon must not wait for each other in here.
    touched: OnceLock<(Vec<Patch>, Duration)>,
    drawn: OnceLock<(Vec<(TilePos, TileUpdate)>, Duration)>,
    /// Of what drawing waits for, what is there: `FOUND`, `CALLED`.
    there: AtomicU8,
}

impl<'a> TileWork<'a> {
    pub fn new(world: &'a World, view: &'a WorldView<'a>, newer: &'a Mask) -> Self {
        let (touched, drawn, there) = (OnceLock::new(), OnceLock::new(), AtomicU8::new(0));
        Self { world, view, newer, touched, drawn, there }
    }

    /// Begins to find out which tiles are touched.
    pub fn begin<'s>(&'s self, scope: &Scope<'s>) {
        scope.spawn(|scope| {
            self.find();
            self.arrive(FOUND, scope);
        });
    }

    /// Says that there is time to draw them; once is enough.
    pub fn go_on<'s>(&'s self, scope: &Scope<'s>) {
        self.arrive(CALLED, scope);
    }

    /// What comes second has tiles drawn.
    fn arrive<'s>(&'s self, what: u8, scope: &Scope<'s>) {
        let before = self.there.fetch_or(what, Ordering::AcqRel);
        if before | what == FOUND | CALLED && before & what == 0 {
            scope.spawn(|_| self.draw());
        }
    }

    fn find(&self) {
        let found = timed(|| touched_patches(self.world, self.view.grid, self.newer));
        // Nobody waits for it: who needs it and does not find it does it himself.
        let _ = self.touched.set(found);
    }

    fn draw(&self) {
        if let Some((touched, _)) = self.touched.get() {
            let _ = self.drawn.set(timed(|| draw_tiles(self.world, self.view, touched)));
        }
    }

    /// The tiles, in order, and how long they took. Does what is not done yet.
    pub fn finish(self) -> (Vec<(TilePos, TileUpdate)>, Duration) {
        if self.touched.get().is_none() {
            self.find();
        }
        if self.drawn.get().is_none() {
            self.draw();
        }
        let took = self.touched.into_inner().map(|(_, took)| took).unwrap_or_default();
        let (drawn, also) = self.drawn.into_inner().unwrap_or_default();
        (drawn, took + also)
    }
}

/// What some work makes, and how long it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let mut took = Duration::ZERO;
    let made = Stages::time(&mut took, work);
    (made, took)
}

/// A tile, and 8x8 cells of it as (z, x), in units of 8 cells.
type Patch = (TilePos, (i32, i32));

/// The patch itself and those beside it, in units of patches.
const BESIDE: [(i32, i32); 5] = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)];

/// Patches that lose a cell to the mask or get one back, or border on one that does, by the tiles that draw them.
fn touched_patches(world: &World, grid: ChunkGrid, newer: &Mask) -> Vec<Patch> {
    let turned = |word| newer.get_word(word).map_or(0, |cells| cells ^ world.mask.word(word));
    // Does a word turn cells of the patch that is one of these steps further, or beside it?
    let touches = |(x, z): (i32, i32), step: usize| {
        let (dx, dz) = BESIDE[step];
        grown_into(turned((x - dx, z - dz)), dx, dz) != 0
    };
    // Of several words that touch a patch, the one of the first step tells of it.
    let is_first = |patch, step| touches(patch, step) && !(0..step).any(|other| touches(patch, other));
    let touched_by = |&((x, z), _): &((i32, i32), u64)| {
        let patches = (0..).zip(BESIDE).map(move |(step, (dx, dz))| ((x + dx, z + dz), step));
        let patches = patches.filter(|&(patch, step)| is_first(patch, step));
        patches.flat_map(|(patch, _)| tiles_of(grid, patch).map(move |tile| (tile, (patch.1, patch.0))))
    };
    let words: Vec<_> = newer.words().collect();
    let mut touched: Vec<Patch> = if words.len() < PARALLEL_PLACES {
        words.iter().flat_map(touched_by).collect()
    } else {
        words.par_iter().flat_map_iter(touched_by).collect()
    };
    sort_by_place(&mut touched, |(tile, _)| [tile.x, tile.z, 0]);
    touched
}

/// The tiles of these patches, with their new rings and index lists.
fn draw_tiles(world: &World, view: &WorldView, touched: &[Patch]) -> Vec<(TilePos, TileUpdate)> {
    let tiles: Vec<_> = touched.chunk_by(|a, b| a.0 == b.0).collect();
    let update = |touched: &&[Patch]| {
        let tile = touched[0].0;
        let mut patches: Vec<(i32, i32)> = touched.iter().map(|&(_, patch)| patch).collect();
        patches.sort_unstable();
        let borders = tile::borders(view, tile);
        let nothing = Rings::default();
        let old = world.rings.get(&tile).map_or(&nothing, Arc::as_ref);
        let rings = Arc::new(old.updated(view, tile, &borders, &patches));
        let indices = tile::indices(view.grid, tile, &borders, &rings);
        (tile, TileUpdate { indices, rings, tile, ground: Arc::clone(&world.ground), grid: view.grid })
    };
    if tiles.len() < 8 {
        tiles.iter().map(update).collect()
    } else {
        tiles.par_iter().with_max_len(1).map(update).collect()
    }
}

/// The tiles that draw some of the 8x8 cells of a word.
fn tiles_of(grid: ChunkGrid, (x, z): (i32, i32)) -> impl Iterator<Item = TilePos> {
    let last = |at: i32, cells: i32| (at * 8 + 7).min(cells - 1);
    let cells = LatticeBox::new(
        IVec3::new((x * 8).max(0), 0, (z * 8).max(0)),
        IVec3::new(last(x, grid.width()), 0, last(z, grid.depth())),
    );
    cells.into_iter().flat_map(move |cells| {
        let (low, high) =
            (grid.tile_of_cell(Column::of(cells.min)), grid.tile_of_cell(Column::of(cells.max)));
        (low.z..=high.z).flat_map(move |z| (low.x..=high.x).map(move |x| TilePos { x, z }))
    })
}
