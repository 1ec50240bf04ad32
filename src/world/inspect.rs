//! Queries for debug views: the parts of a world near a position.

use glam::{IVec3, Vec3};
use rustc_hash::FxHashMap;

use super::state::{MeshKey, World};
use crate::lattice::{BrickPos, ChunkPos, Column, LatticeBox, ONE, SNAP, TilePos};
use crate::surface::{MaskView, SurfaceMesh, tile};
use crate::volume::{Field, layers::ones};

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
            ones(cells).map(move |bit| Column::new(x << 3 | bit as i32 & 7, z << 3 | bit as i32 >> 3))
        });
        cells.filter(move |cell| (low.x..=high.x).contains(&cell.x) && (low.z..=high.z).contains(&cell.z))
    }

    /// The triangles of a tile's rings (rule 3) and steep cells, in voxels of the terrain.
    pub fn ring_triangles(&self, tile: TilePos) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        let has_tile = self.grid.has_tile(tile);
        let rings = has_tile.then(|| self.tile_rings(tile, &tile::borders(&self.view(), tile)));
        let (low, high) = self.grid.tile_cells(tile);
        let width = (high.x - low.x + 1).max(1) as u32;
        let columns = width * (high.z - low.z + 1).max(0) as u32;
        rings.into_iter().flat_map(move |rings| {
            let place = |index: u32| match index.checked_sub(columns) {
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
            let fans = rings.fans().chunks_exact(3).map(|fan| [0, 1, 2].map(|corner| place(fan[corner])));
            fans.collect::<Vec<_>>()
        })
    }

    /// The tiles that touch a box of samples seen from above, and the chunks in it that draw something.
    pub fn drawn_near(&self, samples: LatticeBox) -> Vec<MeshKey> {
        let Some(inside) = samples.intersection(self.grid.edit_bounds()) else { return Vec::new() };
        let (low, high) = (self.grid.chunk_of(inside.min), self.grid.chunk_of(inside.max));
        let tiles =
            (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| MeshKey::Tile(TilePos { x, z })));
        let mut chunks = self.maybe_drawn_in(LatticeBox { min: low.as_ivec3(), max: high.as_ivec3() });
        chunks.sort_unstable();
        tiles.chain(chunks.into_iter().map(MeshKey::Chunk)).collect()
    }

    /// The chunks with cells in a box that draw something or hold fields, in order.
    pub fn chunks_near(&self, cells: LatticeBox) -> Vec<ChunkPos> {
        let first = IVec3::new(0, i32::MIN, 0);
        let last = IVec3::new(self.grid.width() - 1, i32::MAX, self.grid.depth() - 1);
        let Some(inside) = LatticeBox::new(cells.min.max(first), cells.max.min(last)) else {
            return Vec::new();
        };
        let size = IVec3::splat(self.grid.size());
        let places = LatticeBox { min: inside.min.div_euclid(size), max: inside.max.div_euclid(size) };
        let mut chunks = self.maybe_drawn_in(places);
        chunks.append(&mut found_in(&self.fields, places));
        chunks.sort_unstable();
        chunks.dedup();
        chunks
    }

    /// The fields that reach into a box of samples, by age.
    pub fn fields_near(&self, samples: LatticeBox) -> Vec<&Field> {
        let Some(inside) = samples.intersection(self.grid.edit_bounds()) else { return Vec::new() };
        let (low, high) = (self.grid.chunk_of(inside.min), self.grid.chunk_of(inside.max));
        let chunks = found_in(&self.fields, LatticeBox { min: low.as_ivec3(), max: high.as_ivec3() });
        let fields = chunks.into_iter().filter_map(|chunk| self.fields.get(&chunk));
        let near = |field: &&Field| field.bounds.intersection(inside).is_some();
        let mut fields: Vec<&Field> = fields.flat_map(|fields| fields.iter()).filter(near).collect();
        fields.sort_unstable_by_key(|field| field.id);
        fields
    }

    /// The stored bricks that reach into a box of samples, in no order.
    pub fn bricks_near(&self, samples: LatticeBox) -> impl Iterator<Item = BrickPos> + '_ {
        let inside = samples.intersection(self.grid.edit_bounds());
        inside.into_iter().flat_map(move |inside| {
            let LatticeBox { min: low, max: high } = BrickPos::range(inside);
            let stack = move |(x, z): (i32, i32)| {
                let stack = self.stacks.get(&(x, z)).map(Vec::as_slice).unwrap_or_default();
                let from = stack.partition_point(|&y| y < low.y);
                let inside = stack.iter().skip(from).take_while(move |&&y| y <= high.y);
                inside.map(move |&y| BrickPos(IVec3::new(x, y, z)))
            };
            self.stacks_in(LatticeBox { min: low.with_y(0), max: high.with_y(0) }).flat_map(stack)
        })
    }

    /// The stacks of bricks in a box of height one: all positions of the box, or those with bricks where the world has
    /// fewer stacks than the box has positions.
    fn stacks_in(&self, columns: LatticeBox) -> Box<dyn Iterator<Item = (i32, i32)> + '_> {
        if columns.volume() <= self.stacks.len() as u64 {
            return Box::new(columns.points().map(|column| (column.x, column.z)));
        }
        let is_in = move |&(x, z): &(i32, i32)| columns.contains(IVec3::new(x, 0, z));
        Box::new(self.stacks.keys().copied().filter(is_in))
    }

    /// The chunks whose positions lie in a box that draw something, or may.
    fn maybe_drawn_in(&self, places: LatticeBox) -> Vec<ChunkPos> {
        let mut chunks = found_in(self.meshes.surfaces.table(), places);
        chunks.append(&mut found_in(&self.meshes.unmeshed, places));
        chunks
    }

    /// The stored mesh of a chunk; `None` if it draws nothing or no mesh is stored.
    pub fn chunk_surface(&self, chunk: ChunkPos) -> Option<&SurfaceMesh> {
        self.meshes.surfaces.get(chunk).map(|surface| surface.mesh())
    }
}

/// The chunks of a table whose positions lie in a box, in no order. Looks up each position of the box, or goes through
/// the table where that is shorter.
fn found_in<T>(table: &FxHashMap<ChunkPos, T>, places: LatticeBox) -> Vec<ChunkPos> {
    if places.volume() <= table.len() as u64 {
        places.points().map(ChunkPos::from_ivec3).filter(|chunk| table.contains_key(chunk)).collect()
    } else {
        table.keys().copied().filter(|chunk| places.contains(chunk.as_ivec3())).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, NoiseHeights, Strata};
    use crate::terrain::{Terrain, TerrainSettings};

    fn dug() -> Terrain {
        let noise = NoiseHeights { amplitude: 14.0, scale: 20.0, ..NoiseHeights::default() };
        dug_in(Ground::from_noise(70, 60, &noise).expect("valid"))
    }

    fn cliffs() -> Ground {
        let ground = Ground::from_fn(70, 60, |x, z| f64::from((x / 3 + z / 7) % 5 * 11)).expect("valid");
        ground.with_strata(&Strata::alpine()).expect("valid")
    }

    fn dug_in(ground: Ground) -> Terrain {
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
        for terrain in [dug(), dug_in(cliffs())] {
            let is_steep = terrain.world().ground().steep_cells().is_some();
            let count = count_ring_triangles(terrain.world());
            assert!(count > if is_steep { 10_000 } else { 50 }, "{count}");
        }
    }

    /// Checks that they are the last of their tile's mesh.
    fn count_ring_triangles(world: &World) -> usize {
        let mut count = 0;
        for tile in world.grid().tiles() {
            let rings: Vec<[Vec3; 3]> = world.ring_triangles(tile).collect();
            let mesh = tile::mesh(&world.view(), tile);
            let origin = world.origin(MeshKey::Tile(tile)).as_vec3();
            let all: Vec<[Vec3; 3]> = mesh
                .triangles()
                .map(|t| t.map(|vertex| origin + Vec3::from(vertex.position_f32())))
                .collect();
            assert_eq!(rings, all[all.len() - rings.len()..]);
            count += rings.len();
        }
        assert_eq!(world.ring_triangles(TilePos { x: 99, z: -5 }).count(), 0);
        assert_eq!(world.ring_triangles(TilePos { x: i32::MAX, z: i32::MIN }).count(), 0);
        count
    }

    #[test]
    fn what_is_near_touches_the_box() {
        let terrain = dug();
        let world = terrain.world();
        let everything = world.drawn_near(LatticeBox { min: IVec3::splat(-9999), max: IVec3::splat(9999) });
        assert_eq!(everything.len(), world.drawn().count());
        let near = world.drawn_near(LatticeBox { min: IVec3::new(17, -99, 17), max: IVec3::new(30, 99, 30) });
        assert_eq!(near.iter().filter(|drawn| matches!(drawn, MeshKey::Tile(_))).count(), 1);
        for drawn in near {
            if let MeshKey::Chunk(chunk) = drawn {
                assert_eq!(chunk.tile(), TilePos { x: 1, z: 1 });
                assert_eq!(world.chunk_surface(chunk), Some(&world.chunk_mesh(chunk)));
            }
        }
        assert!(world.drawn_near(LatticeBox::point(IVec3::new(-5, 0, 0))).is_empty());
    }

    #[test]
    fn what_is_near_is_the_same_whether_the_box_or_the_world_is_searched() {
        let mut terrain = dug();
        // Enough of them for small boxes to be searched by position.
        let brushes = (0..40).map(|step| {
            let (x, z) = ((step % 8 * 9) as f32, (step / 8 * 13) as f32);
            Brush::dig(Shape::sphere(Vec3::new(x, (step % 5 * 17) as f32 - 30.0, z), 4.0))
        });
        terrain.apply(brushes);
        let world = terrain.world();
        let (grid, mut rng) = (world.grid(), fastrand::Rng::with_seed(3));
        let mut found = [0; 3];
        for turn in 0..300 {
            let size = [3, 20, 90, 400][turn % 4];
            let mut number = || rng.i32(-60..100);
            let min = IVec3::new(number(), number(), number());
            let near = LatticeBox { min, max: min + size };
            let meets = |own: LatticeBox| own.intersection(near).is_some();

            let mut chunks: Vec<ChunkPos> =
                world.drawn_chunks().chain(world.fields().map(|(chunk, _)| chunk)).collect();
            chunks.sort_unstable();
            chunks.dedup();
            chunks.retain(|&chunk| meets(grid.chunk_cells(chunk)));
            assert_eq!(world.chunks_near(near), chunks, "{near:?}");

            let mut fields: Vec<&Field> = world.fields().flat_map(|(_, fields)| fields.iter()).collect();
            fields.retain(|field| meets(field.bounds));
            fields.sort_unstable_by_key(|field| field.id);
            assert_eq!(world.fields_near(near), fields, "{near:?}");

            let bricks: Vec<BrickPos> = world.bricks_near(near).collect();
            let in_world = near.intersection(grid.edit_bounds());
            let expected: HashSet<BrickPos> = in_world
                .into_iter()
                .flat_map(BrickPos::covering)
                .filter(|&brick| world.samples().brick(brick).is_some())
                .collect();
            assert_eq!(bricks.len(), expected.len(), "{near:?}");
            assert_eq!(bricks.into_iter().collect::<HashSet<_>>(), expected, "{near:?}");
            found[0] += chunks.len();
            found[1] += fields.len();
            found[2] += expected.len();
        }
        assert!(found.iter().all(|&found| found > 300), "{found:?}");
        let all = LatticeBox { min: IVec3::MIN, max: IVec3::MAX };
        assert_eq!(world.bricks_near(all).count(), world.bricks().count());
        assert_eq!(
            world.fields_near(all).len(),
            world.fields().map(|(_, fields)| fields.len()).sum::<usize>()
        );
        assert!(world.chunks_near(all).len() >= world.drawn_chunks().count());
    }

    #[test]
    fn no_box_of_any_numbers_is_too_much() {
        let terrain = dug();
        let numbers = [i32::MIN, -1, 0, 69, 70, i32::MAX];
        let points: Vec<IVec3> = numbers
            .into_iter()
            .flat_map(|x| numbers.into_iter().flat_map(move |y| numbers.map(|z| IVec3::new(x, y, z))))
            .collect();
        for (at, &min) in points.iter().enumerate() {
            for &max in points.iter().skip(at % 7).step_by(7) {
                let (near, world) = (LatticeBox { min, max }, terrain.world());
                let _ = (world.chunks_near(near), world.fields_near(near), world.drawn_near(near));
                assert!(world.bricks_near(near).count() <= world.bricks().count());
            }
        }
    }
}
