//! The vertices of tiles' columns, which digging never changes, kept for the next dig.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use bevy::prelude::*;
use rustc_hash::FxHashMap;

use crate::ground::Ground;
use crate::lattice::TilePos;
use crate::surface::tile::{self, Rings};
use crate::surface::{SurfaceMesh, Vertex};
use crate::terrain::TileUpdate;

/// Bytes of vertices that are kept: 60 tiles of 32 x 32 cells.
const BUDGET: usize = 2 << 20;

/// The vertices over the columns of a tile, x fastest, as the heightmap draws them.
pub(super) struct TileColumns(Vec<Vertex>);

impl TileColumns {
    /// Computes them from the ground.
    pub fn new(update: &TileUpdate) -> Self {
        Self(tile::vertices(&update.ground, update.grid, update.tile, &Rings::default()))
    }

    /// Their vertices.
    pub fn vertices(&self) -> &[Vertex] {
        &self.0
    }

    /// The tile's whole mesh.
    pub fn surface(&self, update: &TileUpdate) -> SurfaceMesh {
        let vertices = [&self.0, update.rings.vertices()].concat();
        SurfaceMesh { vertices, indices: update.indices().clone() }
    }

    fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<Vertex>()
    }
}

/// Columns of the tiles that were dug last.
#[derive(Resource, Clone, Default)]
pub(super) struct KeptColumns(Arc<Mutex<Kept>>);

#[derive(Default)]
struct Kept {
    tiles: FxHashMap<Key, Entry>,
    bytes: usize,
    /// Counts uses.
    clock: u64,
}

/// A ground by its address, the size of its tiles, and a tile.
type Key = (usize, i32, TilePos);

struct Entry {
    /// As long as this is held, no other ground has the same address.
    _ground: Weak<Ground>,
    columns: Arc<TileColumns>,
    used: u64,
}

impl KeptColumns {
    /// The columns of a tile.
    pub fn of(&self, tile: &TileUpdate) -> Arc<TileColumns> {
        let key = (Arc::as_ptr(&tile.ground).addr(), tile.grid.size(), tile.tile);
        if let Some(known) = self.lock().find(key) {
            return known;
        }
        let columns = Arc::new(TileColumns::new(tile));
        self.lock().keep(key, &tile.ground, &columns);
        columns
    }

    fn lock(&self) -> MutexGuard<'_, Kept> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Kept {
    fn find(&mut self, key: Key) -> Option<Arc<TileColumns>> {
        self.clock += 1;
        let entry = self.tiles.get_mut(&key)?;
        entry.used = self.clock;
        Some(Arc::clone(&entry.columns))
    }

    /// Keeps the columns of a tile, in place of those that were not used for the longest time.
    fn keep(&mut self, key: Key, ground: &Arc<Ground>, columns: &Arc<TileColumns>) {
        let bytes = columns.bytes();
        if bytes > BUDGET {
            return;
        }
        let entry = Entry { _ground: Arc::downgrade(ground), columns: Arc::clone(columns), used: self.clock };
        self.bytes += bytes;
        let old = self.tiles.insert(key, entry);
        self.bytes -= old.map_or(0, |old| old.columns.bytes());
        while self.bytes > BUDGET {
            let oldest = self.tiles.iter().min_by_key(|(_, entry)| entry.used).map(|(key, _)| *key);
            let Some(old) = oldest.and_then(|oldest| self.tiles.remove(&oldest)) else { break };
            self.bytes -= old.columns.bytes();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::NoiseHeights;
    use crate::terrain::{MeshKey, SurfaceDraft, Terrain, TerrainSettings};

    fn tiles(ground: &Arc<Ground>, chunk_size: u32) -> Vec<TileUpdate> {
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let terrain = Terrain::new(Arc::clone(ground), &settings).unwrap();
        let world = terrain.world();
        let tile = |tile| match world.draft(MeshKey::Tile(tile)) {
            SurfaceDraft::Tile(tile) => tile,
            _ => panic!("a tile is drawn as a tile"),
        };
        world.grid().tiles().map(tile).collect()
    }

    #[test]
    fn kept_columns_are_those_of_their_own_ground_and_tile() {
        let ground = |seed| {
            Arc::new(Ground::from_noise(100, 80, &NoiseHeights { seed, ..Default::default() }).unwrap())
        };
        let (one, other) = (ground(1), ground(2));
        let kept = KeptColumns::default();
        for _ in 0..2 {
            for (ground, size) in [(&one, 16), (&other, 16), (&one, 32), (&other, 25)] {
                for tile in tiles(ground, size) {
                    let (found, expected) = (kept.of(&tile), TileColumns::new(&tile));
                    assert_eq!(found.vertices(), expected.vertices());
                    assert_eq!(found.surface(&tile), tile.mesh());
                }
            }
        }
        // Grounds that are gone leave nothing that others could find.
        drop((one, other));
        for seed in 3..20 {
            let ground = ground(seed);
            for tile in tiles(&ground, 16) {
                assert_eq!(kept.of(&tile).vertices(), TileColumns::new(&tile).vertices());
            }
        }
    }

    #[test]
    fn columns_are_kept_within_the_budget() {
        let ground = Arc::new(Ground::flat(1024, 1024, 3.0).unwrap());
        let (tiles, kept) = (tiles(&ground, 32), KeptColumns::default());
        for tile in &tiles {
            kept.of(tile);
            // The first one is used all the time, so it stays.
            let first = kept.of(&tiles[0]);
            assert!(Arc::ptr_eq(&first, &kept.of(&tiles[0])));
            let state = kept.lock();
            assert!(state.bytes <= BUDGET);
            assert_eq!(state.bytes, state.tiles.values().map(|entry| entry.columns.bytes()).sum::<usize>());
        }
        assert!(kept.lock().tiles.len() < tiles.len());
    }
}
