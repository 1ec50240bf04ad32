//! The input for the surface of one tile or chunk, without the rest of the world.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use crate::ground::Ground;
use crate::lattice::{ChunkGrid, TilePos};
use crate::surface::mask::Borders;
use crate::surface::tile::{self, Rings};
use crate::surface::vertex::WorldView;
use crate::surface::{ChunkSurface, Indices, SurfaceMesh};
use crate::world::{MeshKey, UnmeshedChunk, World};

/// The mesh data of a tile. Its columns never change, so only its rings and indices do.
#[derive(Clone, Debug)]
pub struct TileUpdate {
    pub(crate) tile: TilePos,
    pub(crate) grid: ChunkGrid,
    pub(crate) ground: Arc<Ground>,
    /// The rings; their vertices follow after those of the columns.
    pub(crate) rings: Arc<Rings>,
    borders: Borders,
    indices: OnceLock<Indices>,
}

impl TileUpdate {
    /// A tile as a view has it, with rings that `rings` makes.
    pub(crate) fn new(
        world: &World,
        view: &WorldView,
        tile: TilePos,
        rings: impl FnOnce(&Borders) -> Arc<Rings>,
    ) -> Self {
        let borders = tile::borders(view, tile);
        let (rings, ground) = (rings(&borders), Arc::clone(&world.ground));
        Self { tile, grid: view.grid, ground, rings, borders, indices: OnceLock::new() }
    }

    /// The whole list of indices; made when it is first asked for.
    pub fn indices(&self) -> &Indices {
        self.indices.get_or_init(|| tile::indices(self.grid, self.tile, &self.borders, &self.rings))
    }

    /// The rings that the world keeps: none of a tile that does not border on the mask, as steep cells depend on the
    /// ground only.
    pub(crate) fn kept_rings(&self) -> Arc<Rings> {
        if self.borders.has_bordering() { Arc::clone(&self.rings) } else { Arc::default() }
    }

    /// The tile's whole mesh, its columns included.
    pub fn mesh(&self) -> SurfaceMesh {
        let vertices = tile::vertices(&self.ground, self.grid, self.tile, &self.rings);
        SurfaceMesh { vertices, indices: self.indices().clone() }
    }
}

/// The complete input for the surface of one tile or chunk, to make it on another thread. Unlike a snapshot it does not
/// hold the world, so the next commit has nothing to copy.
#[derive(Clone)]
pub(crate) enum SurfaceDraft {
    Nothing,
    /// A tile; its columns can be made in other forms from the ground.
    Tile(TileUpdate),
    Chunk(Arc<ChunkSurface>),
    /// A chunk whose surface is not kept: made where it is asked for.
    Unmeshed(Arc<UnmeshedChunk>),
}

impl World {
    /// The present input for the surface of a tile or chunk.
    pub(crate) fn draft(&self, drawn: MeshKey) -> SurfaceDraft {
        match drawn {
            MeshKey::Tile(tile) if self.grid.has_tile(tile) => {
                let rings = |borders: &Borders| self.tile_rings(tile, borders);
                SurfaceDraft::Tile(TileUpdate::new(self, &self.view(), tile, rings))
            }
            MeshKey::Tile(_) => SurfaceDraft::Nothing,
            MeshKey::Chunk(chunk) => {
                let unmeshed = || self.unmeshed(chunk).map(|chunk| SurfaceDraft::Unmeshed(Arc::new(chunk)));
                let kept = self.meshes.surfaces.get(chunk).cloned().map(SurfaceDraft::Chunk);
                kept.or_else(unmeshed).unwrap_or(SurfaceDraft::Nothing)
            }
        }
    }
}

impl SurfaceDraft {
    /// Returns `true` if nothing is drawn.
    #[cfg(any(feature = "plugin", test))]
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Nothing => true,
            Self::Tile(tile) => tile.indices().is_empty(),
            Self::Chunk(chunk) => chunk.is_empty(),
            Self::Unmeshed(chunk) => chunk.surface().is_empty(),
        }
    }

    /// The surface, relative to the origin of the tile or chunk.
    pub fn surface(&self) -> Cow<'_, SurfaceMesh> {
        match self {
            Self::Nothing => Cow::default(),
            Self::Tile(tile) => Cow::Owned(tile.mesh()),
            Self::Chunk(chunk) => Cow::Borrowed(chunk.mesh()),
            Self::Unmeshed(chunk) => Cow::Borrowed(chunk.surface().mesh()),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::IVec3;

    use super::*;
    use crate::ground::Strata;
    use crate::lattice::{Column, ONE};
    use crate::prelude::*;

    #[test]
    fn a_draft_makes_the_surface_that_the_world_has() {
        let ground = |amplitude| {
            let noise = NoiseHeights { seed: 5, scale: 20.0, amplitude, base: 4.0, ..Default::default() };
            Ground::from_noise(70, 60, &noise).expect("valid hills")
        };
        let cliffs = ground(60.0).with_strata(&Strata::alpine()).expect("valid strata");
        for ground in [ground(9.0), cliffs] {
            check_drafts(ground);
        }
    }

    fn check_drafts(ground: Ground) {
        let is_steep = ground.steep_cells().is_some();
        let settings = TerrainSettings { chunk_size: 16, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        for number in 0..12 {
            let (x, z) = (number * 23 % 70, number * 31 % 60);
            let y = match is_steep {
                true => terrain.world().ground().height(Column::new(x, z)) / ONE,
                false => number * 7 % 12,
            };
            let place = IVec3::new(x, y, z).as_vec3();
            terrain.apply([Brush::dig(Shape::sphere(place, 5.0))]);
            if number % 4 == 3 {
                terrain.undo();
            }
            let world = terrain.world();
            for (drawn, mesh) in world.drawn() {
                let draft = world.draft(drawn);
                assert!(*draft.surface() == mesh, "{drawn:?} after {number} digs");
                assert_eq!(draft.is_empty(), mesh.is_empty());
            }
            for (&tile, rings) in &world.meshes.rings {
                let view = world.view();
                assert!(!rings.is_empty());
                assert!(**rings == Rings::new(&view, tile, &tile::borders(&view, tile)), "{tile:?}");
            }
        }
        let outside = MeshKey::Tile(TilePos { x: 90, z: 0 });
        assert!(terrain.world().draft(outside).is_empty());
    }
}
