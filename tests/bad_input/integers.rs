//! Queries about points, boxes, columns, chunks and tiles with arbitrary integers always return an answer.

use bevy_burrow::brush::Evaluator;
use bevy_burrow::lattice::{BrickPos, ChunkPos, Column, LIMIT, LatticeBox, TilePos};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::mask::cell_sheet;
use bevy_burrow::terrain::{MeshKey, World};
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::terrains::small_terrain;

const NUMBERS: [i32; 12] =
    [i32::MIN, i32::MIN + 1, -LIMIT - 1, -LIMIT, -1, 0, 7, 30, LIMIT, LIMIT + 1, i32::MAX - 1, i32::MAX];

/// All triples of the numbers.
fn points() -> impl Iterator<Item = IVec3> {
    let pairs = || NUMBERS.into_iter().flat_map(|x| NUMBERS.map(|y| (x, y)));
    pairs().flat_map(|(x, y)| NUMBERS.map(|z| IVec3::new(x, y, z)))
}

fn dug() -> Terrain {
    let mut terrain = small_terrain();
    let dig = Brush::dig(Shape::sphere(Vec3::new(7.0, 8.0, 6.0), 5.0));
    terrain.apply([dig.with_roughness(Roughness::new(1.0, 3.0, 1))]);
    terrain
}

fn evaluator() -> Evaluator {
    let brush = Brush::dig(Shape::cone(Vec3::new(7.0, 8.0, 6.0), Vec3::new(1.0, 6.0, 2.0), 5.0));
    let brush = brush.with_roughness(Roughness::new(1.0, 3.0, 1));
    Edit::quantize(&brush).expect("a valid brush").evaluator()
}

#[test]
fn every_lattice_point_has_a_sample() {
    let (terrain, evaluator) = (dug(), evaluator());
    let world = terrain.world();
    let (samples, ground, grid) = (world.samples(), world.ground(), world.grid());
    for point in points() {
        let column = Column::of(point);
        assert_eq!(samples.is_solid(point), samples.distance(point) < 0, "{point}");
        if !grid.edit_bounds().contains(point) {
            assert!(!samples.is_edited(point), "{point}");
            assert_eq!(samples.distance(point), ground.distance(point), "{point}");
            assert_eq!(samples.material(point), ground.material(point), "{point}");
        }
        assert!(ground.normal(column).is_normalized() && ground.slope(column).is_finite(), "{column:?}");
        assert!(!cell_sheet(ground, column).is_empty(), "{column:?}");
        let far = point.as_dvec3().distance(Vec3::new(7.0, 8.0, 6.0).as_dvec3()) > 20.0;
        assert!(!far || evaluator.distance(point) > 5 * 256, "{point}");
        assert!(!far || evaluator.is_out_of_reach(LatticeBox::point(point)), "{point}");
        let brick = BrickPos::of(point);
        assert!(brick.samples().contains(point) && BrickPos::index(point) < 512, "{point}");
        assert!(brick.samples().encloses(LatticeBox::point(brick.origin())), "{point}");
        assert!(!world.mask().contains(column) || grid.has_cell(column), "{column:?}");
        let _ = (column.corners(), grid.chunk_of(point), grid.tile_of_cell(column));
    }
}

#[test]
fn meshes_of_arbitrary_chunks_and_tiles_return() {
    let terrain = dug();
    let world = terrain.world();
    let grid = world.grid();
    for point in points() {
        let (chunk, tile) = (ChunkPos::from_ivec3(point), TilePos { x: point.x, z: point.z });
        let draws = |world: &World| world.drawn_chunks().any(|own| own == chunk);
        assert_eq!(world.chunk_mesh(chunk).is_empty(), !draws(world), "{chunk:?}");
        assert_eq!(world.chunk_surface(chunk).is_some(), draws(world), "{chunk:?}");
        assert_eq!(world.tile_mesh(tile).is_empty(), !grid.has_tile(tile), "{tile:?}");
        assert!(grid.has_tile(tile) || world.ring_triangles(tile).count() == 0, "{tile:?}");
        assert!(world.fields_of(chunk).is_none() || draws(world), "{chunk:?}");
        let _ = (world.origin(MeshKey::Tile(tile)), world.origin(MeshKey::Chunk(chunk)));
        let _ = (grid.chunk_samples(chunk), grid.chunk_cells(chunk), grid.tile_cells(tile));
    }
}

#[test]
fn queries_of_arbitrary_boxes_return() {
    let (mut terrain, evaluator) = (dug(), evaluator());
    terrain.apply([Brush::add(Shape::sphere(Vec3::new(7.0, 40.0, 6.0), 2.0), MaterialId(3))]);
    terrain.submit(Brush::dig(Shape::sphere(Vec3::new(2.0, 3.0, 2.0), 1.0)));
    let everything = terrain.world().drawn().count();
    let (mut ready, mut loose) = ([0; 2], 0);
    let (corners, mut rng) = (points().collect::<Vec<_>>(), Rng::with_seed(5));
    for &min in &corners {
        let max = corners[rng.usize(0..corners.len())];
        for samples in
            [LatticeBox { min, max }, LatticeBox { min, max: min.max(max) }, LatticeBox::point(min)]
        {
            let holds_any = LatticeBox::new(samples.min, samples.max).is_some();
            assert_eq!(samples.volume() > 0, holds_any, "{samples:?}");
            let grown = samples.grown(3);
            assert!(!holds_any || grown.encloses(samples) && grown.meets(samples), "{samples:?}");
            let world = terrain.world();
            assert!(world.drawn_near(samples).len() <= everything, "{samples:?}");
            ready[usize::from(terrain.is_ready(samples))] += 1;
            loose += world.loose_pieces(samples, &LooseSettings::default()).len();
            let _ = evaluator.is_out_of_reach(samples);
        }
    }
    let all = LatticeBox { min: IVec3::MIN, max: IVec3::MAX };
    assert_eq!(terrain.world().drawn_near(all).len(), everything);
    assert_eq!(terrain.world().loose_pieces(all, &LooseSettings::default()).len(), 1);
    assert!(!terrain.is_ready(all) && !evaluator.is_out_of_reach(all));
    assert!(ready[0] > 20 && ready[1] > 1000 && loose > 20, "{ready:?} {loose}");
}
