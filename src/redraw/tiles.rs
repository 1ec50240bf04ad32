//! The tiles that a transaction touches, and their new surfaces.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use glam::IVec3;
use rayon::Scope;
use rayon::prelude::*;

use super::dirty::grown_into;
use super::source::TileUpdate;
use super::stages::Stages;
use crate::lattice::{ChunkGrid, Column, ItemCost, LatticeBox, TilePos, parallel_map, sort_by_place};
use crate::surface::Mask;
use crate::surface::mask::Borders;
use crate::surface::tile::Rings;
use crate::surface::vertex::WorldView;
use crate::world::World;

/// Set when the touched tiles are known.
const FOUND: u8 = 1;
/// Set when the caller allows drawing to start.
const ALLOWED: u8 = 2;

/// The tiles that a transaction draws. The touched ones can be found early; drawing starts once they are known and the
/// caller allows it.
pub(crate) struct TileWork<'a> {
    world: &'a World,
    view: &'a WorldView<'a>,
    /// Words of the mask that change.
    newer: &'a Mask,
    /// Set by the thread that made it; rayon's threads must not wait for each other here.
    touched: OnceLock<(Vec<Patch>, Duration)>,
    drawn: OnceLock<(Vec<(TilePos, TileUpdate)>, Duration)>,
    /// Which of `FOUND` and `ALLOWED` are set.
    state: AtomicU8,
}

impl<'a> TileWork<'a> {
    pub fn new(world: &'a World, view: &'a WorldView<'a>, newer: &'a Mask) -> Self {
        let (touched, drawn, state) = (OnceLock::new(), OnceLock::new(), AtomicU8::new(0));
        Self { world, view, newer, touched, drawn, state }
    }

    /// Starts to find the touched tiles.
    pub fn begin<'s>(&'s self, scope: &Scope<'s>) {
        scope.spawn(|scope| {
            self.find();
            self.set(FOUND, scope);
        });
    }

    /// Allows drawing to start; more calls have no effect.
    pub fn allow<'s>(&'s self, scope: &Scope<'s>) {
        self.set(ALLOWED, scope);
    }

    /// Sets a flag, and starts drawing once both are set.
    fn set<'s>(&'s self, flag: u8, scope: &Scope<'s>) {
        let before = self.state.fetch_or(flag, Ordering::AcqRel);
        if before | flag == FOUND | ALLOWED && before & flag == 0 {
            scope.spawn(|_| self.draw());
        }
    }

    fn find(&self) {
        let found = timed(|| touched_patches(self.world, self.view.grid, self.newer));
        // `finish` calls this again if it has not run yet.
        let _ = self.touched.set(found);
    }

    fn draw(&self) {
        if let Some((touched, _)) = self.touched.get() {
            let _ = self.drawn.set(timed(|| draw_tiles(self.world, self.view, touched)));
        }
    }

    /// The tiles, in order, and how long they took. Does what has not been done yet.
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

/// The result of some work, and how long it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let mut took = Duration::ZERO;
    let made = Stages::time(&mut took, work);
    (made, took)
}

/// A tile, and 8x8 cells of it as (z, x), in units of 8 cells.
type Patch = (TilePos, (i32, i32));

/// The patch itself and its neighbours, in units of patches.
const BESIDE: [(i32, i32); 5] = [(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)];

/// Patches that lose a cell to the mask or get one back, or border on one that does, by the tiles that draw them.
fn touched_patches(world: &World, grid: ChunkGrid, newer: &Mask) -> Vec<Patch> {
    let turned = |word| newer.get_word(word).map_or(0, |cells| cells ^ world.mask.word(word));
    // Whether a word changes cells of the patch that is one of these steps away, or of its neighbours.
    let touches = |(x, z): (i32, i32), step: usize| {
        let (dx, dz) = BESIDE[step];
        grown_into(turned((x - dx, z - dz)), dx, dz) != 0
    };
    // Of several words that touch a patch, the one of the first step reports it.
    let is_first = |patch, step| touches(patch, step) && !(0..step).any(|other| touches(patch, other));
    let touched_by = |&((x, z), _): &((i32, i32), u64)| {
        let patches = (0..).zip(BESIDE).map(move |(step, (dx, dz))| ((x + dx, z + dz), step));
        let patches = patches.filter(|&(patch, step)| is_first(patch, step));
        patches.flat_map(|(patch, _)| tiles_of(grid, patch).map(move |tile| (tile, (patch.1, patch.0))))
    };
    let words: Vec<_> = newer.words().collect();
    let mut touched: Vec<Patch> = if ItemCost::Lookup.is_shared(words.len()) {
        words.par_iter().flat_map_iter(touched_by).collect()
    } else {
        words.iter().flat_map(touched_by).collect()
    };
    sort_by_place(&mut touched, |(tile, _)| [tile.x, tile.z, 0]);
    touched
}

/// The tiles of these patches, with their new rings and index lists.
fn draw_tiles(world: &World, view: &WorldView, touched: &[Patch]) -> Vec<(TilePos, TileUpdate)> {
    let tiles: Vec<_> = touched.chunk_by(|a, b| a.0 == b.0).collect();
    parallel_map(&tiles, ItemCost::Surface, |touched| {
        let tile = touched[0].0;
        let mut patches: Vec<(i32, i32)> = touched.iter().map(|&(_, patch)| patch).collect();
        patches.sort_unstable();
        let rings = |borders: &Borders| {
            Arc::new(match world.meshes.rings.get(&tile) {
                Some(old) => old.updated(view, tile, borders, &patches),
                // They are kept from now on.
                None => Rings::new(view, tile, borders),
            })
        };
        let update = TileUpdate::new(world, view, tile, rings);
        // Computed here, in the task.
        update.indices();
        (tile, update)
    })
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
