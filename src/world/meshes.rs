//! The surfaces that a world keeps: those of chunks and the rings of tiles, and how a commit swaps them.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::kept_surfaces::KeptSurfaces;
use crate::lattice::{ChunkPos, TilePos, shrink_if_sparse};
use crate::surface::ChunkSurface;
use crate::surface::tile::Rings;

/// The surfaces that a world keeps, from whose unchanged parts the next ones are copied.
#[derive(Clone, Default)]
pub(crate) struct Meshes {
    /// The surfaces of the chunks that changed last.
    pub surfaces: KeptSurfaces,
    /// Chunks that may draw something and whose surface is not kept: a table without values, counted and shrunk like
    /// the others.
    pub unmeshed: FxHashMap<ChunkPos, ()>,
    /// The rings of tiles that bordered on the mask when they were last drawn; some are empty. Other rings
    /// are built when they are needed.
    pub rings: FxHashMap<TilePos, Arc<Rings>>,
}

/// Surfaces that take the place of those that a world keeps.
#[derive(Clone, Default)]
pub(crate) struct NewSurfaces {
    /// Surfaces of chunks; an empty one is not kept.
    pub chunks: Vec<(ChunkPos, Arc<ChunkSurface>)>,
    /// Rings of tiles; empty ones are not kept.
    pub rings: Vec<(TilePos, Arc<Rings>)>,
    /// Chunks that change without being meshed.
    pub outdated: Vec<ChunkPos>,
}

impl Meshes {
    /// Puts new surfaces in place.
    pub fn apply(&mut self, new: NewSurfaces) {
        for chunk in new.outdated {
            self.surfaces.remove(chunk);
            self.unmeshed.insert(chunk, ());
        }
        for (chunk, surface) in new.chunks {
            self.unmeshed.remove(&chunk);
            if surface.is_empty() {
                self.surfaces.remove(chunk);
            } else {
                self.surfaces.insert(chunk, surface);
            }
        }
        self.unmeshed.extend(self.surfaces.trim().into_iter().map(|chunk| (chunk, ())));
        for (tile, rings) in new.rings {
            if rings.is_empty() {
                self.rings.remove(&tile);
            } else {
                self.rings.insert(tile, rings);
            }
        }
    }

    /// Forgets all surfaces; they are made when they are asked for.
    pub fn forget(&mut self) {
        self.unmeshed.extend(std::mem::take(&mut self.surfaces).chunks().map(|chunk| (chunk, ())));
        self.rings = FxHashMap::default();
    }

    /// The chunks that draw something and those that may, as their surface is not kept: in no order.
    pub fn maybe_drawn(&self) -> impl Iterator<Item = ChunkPos> {
        self.surfaces.chunks().chain(self.unmeshed.keys().copied())
    }

    /// Returns `true` if the chunk draws something, or may do so.
    pub fn may_draw(&self, chunk: ChunkPos) -> bool {
        self.surfaces.contains(chunk) || self.unmeshed.contains_key(&chunk)
    }

    /// Shrinks the tables where many entries are gone.
    pub fn shrink(&mut self) {
        self.surfaces.shrink();
        shrink_if_sparse(&mut self.rings);
        shrink_if_sparse(&mut self.unmeshed);
    }
}
