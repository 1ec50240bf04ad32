//! What one tile's or chunk's surface is made from, without the rest of the world.

use std::borrow::Cow;
use std::sync::Arc;

use super::surface::ChunkSurface;
use super::world::{Drawn, World};
use crate::ground::Ground;
use crate::lattice::{ChunkGrid, TilePos};
use crate::surface::mask::Borders;
use crate::surface::tile::{self, Rings};
use crate::surface::{Indices, SurfaceMesh};

/// All that the surface of one tile or chunk is made from, for somebody who makes it elsewhere: unlike a snapshot it leaves
/// the world alone, and the next commit has nothing to copy.
pub(crate) struct SurfaceRecipe(Source);

enum Source {
    Nothing,
    Tile { tile: TilePos, grid: ChunkGrid, ground: Arc<Ground>, borders: Borders, rings: Arc<Rings> },
    Chunk(Arc<ChunkSurface>),
}

impl World {
    /// What the surface of a tile or chunk is made from, as it is now.
    pub(crate) fn recipe(&self, drawn: Drawn) -> SurfaceRecipe {
        SurfaceRecipe(match drawn {
            Drawn::Tile(tile) if self.grid.has_tile(tile) => Source::Tile {
                tile,
                grid: self.grid,
                ground: Arc::clone(&self.ground),
                borders: tile::borders(&self.view(), tile),
                rings: self.rings.get(&tile).cloned().unwrap_or_default(),
            },
            Drawn::Tile(_) => Source::Nothing,
            Drawn::Chunk(chunk) => self.surfaces.get(&chunk).cloned().map_or(Source::Nothing, Source::Chunk),
        })
    }
}

impl SurfaceRecipe {
    /// The surface, relative to the origin of the tile or chunk; empty where nothing is drawn.
    pub fn draft(&self) -> SurfaceDraft<'_> {
        match &self.0 {
            Source::Nothing => SurfaceDraft::Mesh(Cow::default()),
            Source::Tile { tile, grid, ground, borders, rings } => SurfaceDraft::Tile(TileDraft {
                tile: *tile,
                grid: *grid,
                ground,
                rings,
                indices: Cow::Owned(tile::indices(*grid, *tile, borders, rings)),
            }),
            Source::Chunk(surface) => SurfaceDraft::Mesh(Cow::Borrowed(surface.mesh())),
        }
    }
}

/// A surface that may not have its vertices yet.
pub(crate) enum SurfaceDraft<'a> {
    /// All of it.
    Mesh(Cow<'a, SurfaceMesh>),
    /// A tile: whoever wants its columns in another form makes them of the ground.
    Tile(TileDraft<'a>),
}

/// A tile's mesh without its columns.
pub(crate) struct TileDraft<'a> {
    pub tile: TilePos,
    pub grid: ChunkGrid,
    pub ground: &'a Ground,
    pub rings: &'a Rings,
    pub indices: Cow<'a, Indices>,
}

impl<'a> SurfaceDraft<'a> {
    /// Is nothing drawn?
    pub fn is_empty(&self) -> bool {
        match self {
            Self::Mesh(mesh) => mesh.is_empty(),
            Self::Tile(draft) => draft.indices.is_empty(),
        }
    }

    /// The whole surface.
    pub fn surface(self) -> Cow<'a, SurfaceMesh> {
        match self {
            Self::Mesh(mesh) => mesh,
            Self::Tile(TileDraft { tile, grid, ground, rings, indices }) => Cow::Owned(SurfaceMesh {
                vertices: tile::vertices(ground, grid, tile, rings),
                indices: indices.into_owned(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::prelude::*;

    #[test]
    fn a_recipe_makes_the_surface_that_the_world_has() {
        let noise = NoiseHeights { seed: 5, scale: 20.0, amplitude: 9.0, base: 4.0, ..Default::default() };
        let ground = Ground::from_noise(70, 60, &noise).expect("valid hills");
        let settings = TerrainSettings { chunk_size: 16, ..Default::default() };
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        for number in 0..12 {
            let place =
                Vec3::new((number * 23 % 70) as f32, (number * 7 % 12) as f32, (number * 31 % 60) as f32);
            terrain.apply([Brush::dig(Shape::sphere(place, 5.0))]);
            if number % 4 == 3 {
                terrain.undo();
            }
            let world = terrain.world();
            for (drawn, mesh) in world.drawn() {
                let recipe = world.recipe(drawn);
                assert!(*recipe.draft().surface() == mesh, "{drawn:?} after {number} digs");
                assert_eq!(recipe.draft().is_empty(), mesh.is_empty());
            }
        }
        let outside = Drawn::Tile(TilePos { x: 90, z: 0 });
        assert!(terrain.world().recipe(outside).draft().is_empty());
    }
}
