//! The light of what a commit changes, for benchmarks: without the plugin, nothing else computes it.

use std::sync::Arc;

use super::commit::Commit;
use crate::lattice::SNAP;
use crate::redraw::relit_parts;
use crate::world::sky::{LitWorld, SkyColumns, SkyLights};
use crate::world::{MeshKey, World};

impl Commit {
    /// Computes the light of all surfaces that a commit to this world makes or lights otherwise, and returns the number
    /// of their vertices: for benchmarks.
    #[doc(hidden)]
    pub fn light(&self, before: Arc<World>) -> usize {
        let lit = LitWorld::new(before, self.change().bricks);
        let tiles = self.meshes.tiles.iter().map(|(tile, _)| MeshKey::Tile(*tile));
        let chunks = self.meshes.chunks.iter().map(|(chunk, _)| MeshKey::Chunk(*chunk));
        let redrawn: Vec<MeshKey> = tiles.chain(chunks).collect();
        let relit = relit_parts(&lit, |drawn| redrawn.contains(&drawn));
        let mut parts: Vec<MeshKey> = redrawn.into_iter().chain(relit).collect();
        parts.sort_unstable_by_key(|drawn| (drawn.tile(), *drawn));
        let mut count = 0;
        for parts in parts.chunk_by(|a, b| a.tile() == b.tile()) {
            let (low, high) = lit.before().grid().tile_cells(parts[0].tile());
            let mut lights = SkyColumns::new(lit.view(), low, high);
            for &drawn in parts {
                let MeshKey::Chunk(chunk) = drawn else {
                    count += std::hint::black_box(lights.ground_lights()).len();
                    continue;
                };
                let fresh = self.meshes.chunks.iter().find(|(own, _)| *own == chunk);
                let kept = || lit.before().meshes.surfaces.get(chunk).map(|surface| surface.mesh());
                let Some(mesh) = fresh.map(|(_, surface)| surface.mesh()).or_else(kept) else { continue };
                let origin = lit.before().grid().origin(chunk) * SNAP;
                for vertex in &mesh.vertices {
                    std::hint::black_box(lights.light(origin + vertex.position));
                }
                count += mesh.vertices.len();
            }
        }
        count
    }
}
