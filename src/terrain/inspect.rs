//! What a debug view asks of a world: parts of it near a place, without a copy of the rest.

use glam::{IVec3, Vec3};

use super::world::{Drawn, World};
use crate::lattice::{ChunkPos, Column, LatticeBox, ONE, SNAP, TilePos};
use crate::surface::{MaskView, SurfaceMesh};

impl World {
    /// The cells of the mask from `low` to `high`, both included, in no order.
    pub fn mask_cells(&self, low: Column, high: Column) -> impl Iterator<Item = Column> + '_ {
        let view = MaskView::new(self.mask());
        let last = Column::new(self.grid.width() - 1, self.grid.depth() - 1);
        let (low, high) =
            (Column::new(low.x.max(0), low.z.max(0)), Column::new(high.x.min(last.x), high.z.min(last.z)));
        let words =
            (low.z >> 3..=high.z >> 3).flat_map(move |z| (low.x >> 3..=high.x >> 3).map(move |x| (x, z)));
        let cells = words.flat_map(move |(x, z)| {
            let cells = view.word((x, z));
            (0..64)
                .filter(move |bit| cells >> bit & 1 == 1)
                .map(move |bit| Column::new(x << 3 | bit & 7, z << 3 | bit >> 3))
        });
        cells.filter(move |cell| (low.x..=high.x).contains(&cell.x) && (low.z..=high.z).contains(&cell.z))
    }

    /// The triangles of a tile's rings (rule 3), in voxels of the terrain.
    pub fn ring_triangles(&self, tile: TilePos) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        let rings = self.rings.get(&tile).filter(|_| self.grid.has_tile(tile));
        let (low, high) = self.grid.tile_cells(tile);
        let width = (high.x - low.x + 1).max(1) as u32;
        let columns = width * (high.z - low.z + 1).max(0) as u32;
        rings.into_iter().flat_map(move |rings| {
            let place = move |&index: &u32| match index.checked_sub(columns) {
                None => {
                    let column = low.offset((index % width) as i32, (index / width) as i32);
                    let height = self.ground.height(column) as f32 / ONE as f32;
                    Vec3::new(column.x as f32, height, column.z as f32)
                }
                Some(own) => {
                    let own =
                        rings.vertices().get(own as usize).map_or(IVec3::ZERO, |vertex| vertex.position);
                    (own + low.at(0) * SNAP).as_vec3() / SNAP as f32
                }
            };
            rings.fans().chunks_exact(3).map(move |fan| [place(&fan[0]), place(&fan[1]), place(&fan[2])])
        })
    }

    /// The tiles that touch a box of samples seen from above, and the chunks in it that draw something.
    pub fn drawn_near(&self, samples: LatticeBox) -> Vec<Drawn> {
        let Some(inside) = samples.intersection(self.grid.edit_bounds()) else { return Vec::new() };
        let (low, high) = (self.grid.chunk_of(inside.min), self.grid.chunk_of(inside.max));
        let tiles =
            (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| Drawn::Tile(TilePos { x, z })));
        let is_near = |chunk: &ChunkPos| {
            chunk.as_ivec3().cmpge(low.as_ivec3()).all() && chunk.as_ivec3().cmple(high.as_ivec3()).all()
        };
        let mut chunks: Vec<ChunkPos> = self.surfaces.keys().copied().filter(is_near).collect();
        chunks.sort_unstable();
        tiles.chain(chunks.into_iter().map(Drawn::Chunk)).collect()
    }

    /// The mesh of a chunk as it is kept; `None` where it draws nothing.
    pub fn chunk_surface(&self, chunk: ChunkPos) -> Option<&SurfaceMesh> {
        self.surfaces.get(&chunk).map(|surface| surface.mesh())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, NoiseHeights};
    use crate::surface::tile;
    use crate::terrain::{Terrain, TerrainSettings};

    fn dug() -> Terrain {
        let noise = NoiseHeights { amplitude: 14.0, scale: 20.0, ..NoiseHeights::default() };
        let ground = Ground::from_noise(70, 60, &noise).expect("valid");
        let mut terrain =
            Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid");
        let height = |x: f32, z: f32| terrain.world().height(x.into(), z.into()).unwrap_or_default() as f32;
        let brushes = [(20.0, 20.0), (31.0, 33.0), (69.0, 2.0)]
            .map(|(x, z)| Brush::dig(Shape::sphere(Vec3::new(x, height(x, z), z), 5.0)));
        terrain.apply(brushes);
        terrain
    }

    #[test]
    fn cells_of_a_box_are_those_of_the_mask_in_it() {
        let terrain = dug();
        let world = terrain.world();
        for (low, high) in
            [((0, 0), (69, 59)), ((-90, -9), (500, 500)), ((17, 18), (25, 31)), ((40, 40), (30, 30))]
        {
            let (low, high) = (Column::new(low.0, low.1), Column::new(high.0, high.1));
            let found: Vec<Column> = world.mask_cells(low, high).collect();
            let is_in =
                |cell: &Column| (low.x..=high.x).contains(&cell.x) && (low.z..=high.z).contains(&cell.z);
            let expected: HashSet<Column> = world.mask().iter().filter(is_in).collect();
            assert_eq!(found.len(), expected.len());
            assert_eq!(found.into_iter().collect::<HashSet<_>>(), expected);
        }
    }

    #[test]
    fn ring_triangles_are_the_last_of_a_tiles_mesh() {
        let terrain = dug();
        let world = terrain.world();
        let mut count = 0;
        for tile in world.grid().tiles() {
            let rings: Vec<[Vec3; 3]> = world.ring_triangles(tile).collect();
            let mesh = tile::mesh(&world.view(), tile);
            let origin = world.origin(Drawn::Tile(tile)).as_vec3();
            let all: Vec<[Vec3; 3]> = mesh
                .triangles()
                .map(|t| t.map(|vertex| origin + Vec3::from(vertex.position_f32())))
                .collect();
            assert_eq!(rings, all[all.len() - rings.len()..]);
            count += rings.len();
        }
        assert!(count > 50, "{count}");
        assert_eq!(world.ring_triangles(TilePos { x: 99, z: -5 }).count(), 0);
        assert_eq!(world.ring_triangles(TilePos { x: i32::MAX, z: i32::MIN }).count(), 0);
    }

    #[test]
    fn what_is_near_touches_the_box() {
        let terrain = dug();
        let world = terrain.world();
        let everything = world.drawn_near(LatticeBox { min: IVec3::splat(-9999), max: IVec3::splat(9999) });
        assert_eq!(everything.len(), world.drawn().count());
        let near = world.drawn_near(LatticeBox { min: IVec3::new(17, -99, 17), max: IVec3::new(30, 99, 30) });
        assert_eq!(near.iter().filter(|drawn| matches!(drawn, Drawn::Tile(_))).count(), 1);
        for drawn in near {
            if let Drawn::Chunk(chunk) = drawn {
                assert_eq!(chunk.tile(), TilePos { x: 1, z: 1 });
                assert_eq!(world.chunk_surface(chunk), Some(&world.chunk_mesh(chunk)));
            }
        }
        assert!(world.drawn_near(LatticeBox::point(IVec3::new(-5, 0, 0))).is_empty());
    }
}
