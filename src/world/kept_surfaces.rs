//! The surfaces of the chunks that changed last, within a limit of bytes.

use std::collections::VecDeque;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::lattice::{ChunkPos, shrink_if_sparse, table_bytes};
use crate::surface::ChunkSurface;

/// The most bytes of surfaces: some 1,500 chunks of 32 voxels that are dug all over.
const MAX_BYTES: usize = 64 << 20;

/// The surfaces of the chunks that changed last, none of them empty. A dig copies the unchanged parts of a kept
/// surface; that of any other chunk is made again as a whole, which takes about as long as the dig itself in chunks
/// of 32.
#[derive(Clone)]
pub(crate) struct KeptSurfaces {
    surfaces: FxHashMap<ChunkPos, Kept>,
    /// The chunks by the time of their last change, the first one longest ago; a chunk that changed again since, or
    /// whose surface is gone, has another time in the table or none.
    by_time: VecDeque<(u64, ChunkPos)>,
    time: u64,
    /// Bytes of all surfaces.
    bytes: usize,
    max_bytes: usize,
}

/// A kept surface, and when it changed last.
#[derive(Clone)]
pub(super) struct Kept {
    surface: Arc<ChunkSurface>,
    time: u64,
}

impl Default for KeptSurfaces {
    fn default() -> Self {
        Self {
            surfaces: FxHashMap::default(),
            by_time: VecDeque::new(),
            time: 0,
            bytes: 0,
            max_bytes: MAX_BYTES,
        }
    }
}

impl KeptSurfaces {
    /// The surface of a chunk, if it is kept.
    pub fn get(&self, chunk: ChunkPos) -> Option<&Arc<ChunkSurface>> {
        self.surfaces.get(&chunk).map(|kept| &kept.surface)
    }

    /// Whether the surface of a chunk is kept.
    pub fn contains(&self, chunk: ChunkPos) -> bool {
        self.surfaces.contains_key(&chunk)
    }

    /// Keeps a surface in place of the chunk's old one.
    pub fn insert(&mut self, chunk: ChunkPos, surface: Arc<ChunkSurface>) {
        self.time += 1;
        self.bytes += bytes(&surface);
        let old = self.surfaces.insert(chunk, Kept { surface, time: self.time });
        self.bytes -= old.map_or(0, |old| bytes(&old.surface));
        self.by_time.push_back((self.time, chunk));
    }

    /// Drops the surface of a chunk.
    pub fn remove(&mut self, chunk: ChunkPos) {
        self.bytes -= self.surfaces.remove(&chunk).map_or(0, |old| bytes(&old.surface));
    }

    /// Drops surfaces that changed longest ago until the rest is within the limit, but never the one that changed last;
    /// returns their chunks.
    pub fn trim(&mut self) -> Vec<ChunkPos> {
        let mut dropped = Vec::new();
        while self.bytes > self.max_bytes && self.surfaces.len() > 1 {
            let Some((time, chunk)) = self.by_time.pop_front() else { break };
            if self.surfaces.get(&chunk).is_some_and(|kept| kept.time == time) {
                self.remove(chunk);
                dropped.push(chunk);
            }
        }
        // Outdated times are dropped once they are the most.
        if self.by_time.len() > 2 * self.surfaces.len() + 64 {
            let surfaces = &self.surfaces;
            self.by_time.retain(|(time, chunk)| surfaces.get(chunk).is_some_and(|kept| kept.time == *time));
            self.by_time.shrink_to(2 * self.surfaces.len() + 64);
        }
        dropped
    }

    /// The chunks whose surfaces are kept, in no order.
    pub fn chunks(&self) -> impl Iterator<Item = ChunkPos> {
        self.surfaces.keys().copied()
    }

    /// The kept surfaces, in no order.
    pub fn surfaces(&self) -> impl Iterator<Item = &ChunkSurface> {
        self.surfaces.values().map(|kept| kept.surface.as_ref())
    }

    /// The table of surfaces by chunk.
    pub(super) fn table(&self) -> &FxHashMap<ChunkPos, Kept> {
        &self.surfaces
    }

    /// The number of surfaces.
    #[cfg(test)]
    pub fn len(&self) -> usize {
        self.surfaces.len()
    }

    /// Bytes of the tables, without the surfaces.
    pub fn table_bytes(&self) -> usize {
        table_bytes(&self.surfaces) + self.by_time.capacity() * size_of::<(u64, ChunkPos)>()
    }

    /// Shrinks the table where many surfaces are gone.
    pub fn shrink(&mut self) {
        shrink_if_sparse(&mut self.surfaces);
    }

    /// Sets the limit.
    #[cfg(test)]
    pub fn set_max_bytes(&mut self, max_bytes: usize) {
        self.max_bytes = max_bytes;
    }
}

/// Bytes of a surface.
fn bytes(surface: &ChunkSurface) -> usize {
    let (mesh, parts) = surface.bytes();
    mesh + parts
}

#[cfg(test)]
mod tests {
    use fastrand::Rng;
    use glam::Vec3;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, MaterialId};
    use crate::terrain::{Terrain, TerrainSettings};
    use crate::world::{MeshKey, World};

    fn any_brush(rng: &mut Rng) -> Brush {
        let at = Vec3::new(rng.f32() * 95.0, 4.0 + rng.f32() * 10.0, rng.f32() * 95.0);
        let shape = Shape::sphere(at, 1.0 + rng.f32() * 6.0);
        match rng.u8(0..6) {
            0 => Brush::reset(Shape::sphere(at, 25.0)),
            1 => Brush::add(shape, MaterialId(2)),
            _ => Brush::dig(shape),
        }
    }

    /// All that is drawn.
    fn drawn(world: &World) -> Vec<(MeshKey, crate::surface::SurfaceMesh)> {
        world.drawn().filter(|(_, mesh)| !mesh.is_empty()).collect()
    }

    #[test]
    fn what_is_drawn_does_not_depend_on_how_much_is_kept() {
        for seed in 0..6 {
            let mut rng = Rng::with_seed(seed);
            let settings = TerrainSettings { chunk_size: 8 + 8 * (seed as u32 % 3), ..Default::default() };
            let limits = [usize::MAX, 20_000, 0];
            let mut terrains = limits.map(|limit| {
                let ground = Ground::flat(96, 96, 8.0).expect("valid ground");
                let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
                terrain.edit_world(|world| world.meshes.surfaces.set_max_bytes(limit));
                terrain
            });
            for number in 0..60 {
                let (brush, is_undo) = (any_brush(&mut rng), rng.u8(0..6) == 0);
                for (terrain, limit) in terrains.iter_mut().zip(limits) {
                    if is_undo {
                        terrain.undo();
                    } else {
                        terrain.apply([brush.clone()]);
                    }
                    let kept = &terrain.world().meshes.surfaces;
                    assert_eq!(kept.bytes, kept.surfaces().map(bytes).sum::<usize>());
                    assert!(kept.bytes <= limit || kept.len() == 1, "{} bytes are kept", kept.bytes);
                    assert!(kept.by_time.len() <= 2 * kept.len() + 64);
                }
                if number % 10 == 9 {
                    let [all, some, few] = terrains.each_ref().map(|terrain| drawn(terrain.world()));
                    assert!(all == some && all == few, "after {number} edits");
                }
            }
            assert!(terrains[1].world().meshes.unmeshed.len() > 2, "everything was kept");
        }
    }

    #[test]
    fn the_surfaces_that_changed_last_are_kept() {
        let ground = Ground::flat(96, 96, 8.0).expect("valid ground");
        let settings = TerrainSettings { chunk_size: 8, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        terrain.edit_world(|world| world.meshes.surfaces.set_max_bytes(30_000));
        let dig = |x: i32| Brush::dig(Shape::sphere(Vec3::new(x as f32, 8.0, 40.0), 2.5));
        for x in 5..90 {
            terrain.apply([dig(x)]);
            let world = terrain.world();
            let touched: Vec<ChunkPos> = world
                .drawn_chunks()
                .filter(|chunk| (chunk.x * 8..chunk.x * 8 + 8).contains(&x) && chunk.z == 5)
                .filter(|chunk| !world.chunk_mesh(*chunk).is_empty())
                .collect();
            assert!(
                !touched.is_empty() && touched.iter().all(|chunk| world.meshes.surfaces.contains(*chunk))
            );
        }
        assert!(terrain.world().meshes.unmeshed.len() > 10, "everything was kept");
    }
}
