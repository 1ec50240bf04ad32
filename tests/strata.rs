//! Strata: drawn materials equal those that a dig yields, nothing is stored for them, and solid ground is unaffected.

mod worlds;

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::ground::{Ground, Strata};
use bevy_burrow::lattice::{Column, LatticeBox, SNAP};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::{SurfaceMesh, Vertex};
use bevy_burrow::terrain::{MeshKey, World};
use bevy_burrow::volume::MaterialCounts;
use fastrand::Rng;
use glam::{IVec3, Vec3};
use worlds::{random_brush, random_ground, random_strata, random_world};

type ByMaterial = BTreeMap<MaterialId, u64>;

fn counted(counts: &MaterialCounts) -> ByMaterial {
    counts.iter().filter(|&(_, voxels)| voxels > 0).collect()
}

/// A preset, or random strata, in a random ground.
fn ground_with_strata(rng: &mut Rng, index: u64) -> (Ground, u32) {
    let (ground, chunk_size) = random_ground(rng, index);
    let strata = match index % 4 {
        0 => Strata::alpine(),
        1 => Strata::desert(),
        2 => Strata::mine(),
        _ => {
            let (low, high) = ground.height_range();
            random_strata(rng, [low as f32 / 256.0 - 20.0, high as f32 / 256.0 + 2.0])
        }
    };
    (ground.with_strata(&strata).expect("valid strata"), chunk_size)
}

fn terrain(ground: &Arc<Ground>, chunk_size: u32) -> Terrain {
    let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
    Terrain::new(Arc::clone(ground), &settings).expect("valid settings")
}

/// The material of a voxel: what is stored, else what the function of the ground says.
fn material(world: &World, point: IVec3) -> MaterialId {
    match world.samples().stored_material(point) {
        MaterialId::GROUND => world.ground().material(point),
        stored => stored,
    }
}

/// Everything within reach of some digs, before them.
fn solid_voxels(world: &World, place: LatticeBox) -> BTreeMap<[i32; 3], MaterialId> {
    let solid = place.points().filter(|&point| world.samples().is_solid(point));
    solid.map(|point| (point.to_array(), material(world, point))).collect()
}

#[test]
fn ten_thousand_digs_yield_what_the_function_says() {
    let (mut digs, mut materials) = (0, ByMaterial::new());
    for index in 0.. {
        if digs >= 10_000 {
            break;
        }
        let rng = &mut Rng::with_seed(index);
        let (ground, chunk_size) = ground_with_strata(rng, index);
        let ground = Arc::new(ground);
        let mut terrain = terrain(&ground, chunk_size);
        for _ in 0..120 {
            let (x, z) = (rng.i32(0..=ground.width()), rng.i32(0..=ground.depth()));
            let height = ground.height(Column::new(x, z)) as f32 / 256.0;
            let center = Vec3::new(x as f32 + rng.f32(), height - 12.0 * rng.f32(), z as f32 + rng.f32());
            let shape = Shape::sphere(center, 1.0 + 3.0 * rng.f32());
            // Some of the dug ground was built or painted before.
            if rng.u8(..4) == 0 {
                let stored = MaterialId([3, 77, 255][rng.usize(..3)]);
                let shape = Shape::sphere(center + Vec3::splat(1.5), 2.5);
                terrain.apply([if rng.bool() {
                    Brush::add(shape, stored)
                } else {
                    Brush::paint(shape, stored)
                }]);
            }
            let reach = LatticeBox { min: center.as_ivec3() - 8, max: center.as_ivec3() + 8 };
            let before = solid_voxels(terrain.world(), reach);
            let receipts = terrain.apply([Brush::dig(shape)]);
            let Ok(applied) = &receipts[0].outcome else { panic!("{receipts:?}") };
            let mut expected = ByMaterial::new();
            for (point, &material) in &before {
                if !terrain.world().samples().is_solid(IVec3::from_array(*point)) {
                    *expected.entry(material).or_default() += 1;
                }
            }
            assert_eq!(counted(&applied.removed), expected, "dig {digs} in world {index}");
            expected
                .into_iter()
                .for_each(|(material, voxels)| *materials.entry(material).or_default() += voxels);
            digs += 1;
        }
    }
    assert!(materials.values().filter(|&&voxels| voxels > 1000).count() > 12, "{materials:?}");
}

#[test]
fn refused_voxels_are_those_of_the_strata_that_resist() {
    let mut found = [0; 3];
    for index in 0..40 {
        let rng = &mut Rng::with_seed(index);
        let (ground, chunk_size) = ground_with_strata(rng, index);
        let ground = Arc::new(ground);
        let [mut free, mut ruled] = [(); 2].map(|()| terrain(&ground, chunk_size));
        let (unbreakable, hard) =
            (MaterialId([0, 9, 11, 13][rng.usize(..4)]), MaterialId([4, 8, 12][rng.usize(..3)]));
        let rules = DiggingRules::default().with_unbreakable(unbreakable).with_hardness(hard, 200);
        ruled.set_rules(rules).expect("valid rules");
        // Apart from each other, so that all ground is untouched.
        for (x, z) in (8..ground.depth() - 8)
            .step_by(16)
            .flat_map(|z| (8..ground.width() - 8).step_by(16).map(move |x| (x, z)))
        {
            let height = ground.height(Column::new(x, z)) as f32 / 256.0;
            let center = Vec3::new(x as f32, height - 10.0 * rng.f32(), z as f32);
            let dig = Brush::dig(Shape::sphere(center, 5.0)).with_power(60);
            let reach = LatticeBox { min: center.as_ivec3() - 8, max: center.as_ivec3() + 8 };
            let before = solid_voxels(free.world(), reach);
            free.apply([dig.clone()]);
            let receipts = ruled.apply([dig]);
            let Ok(applied) = &receipts[0].outcome else { panic!("{receipts:?}") };
            let mut expected = [(); 3].map(|()| ByMaterial::new());
            for (point, &material) in &before {
                if free.world().samples().is_solid(IVec3::from_array(*point)) {
                    continue;
                }
                let kind = if material == unbreakable { 1 } else { usize::from(material == hard) * 2 };
                *expected[kind].entry(material).or_default() += 1;
                found[kind] += 1;
            }
            let counts = [&applied.removed, &applied.refused.unbreakable, &applied.refused.too_hard];
            assert_eq!(counts.map(counted), expected, "world {index}");
        }
    }
    assert!(found.iter().all(|&voxels| voxels > 500), "{found:?}");
}

#[test]
fn strata_change_no_solid_ground_and_store_nothing() {
    let mut tiles = [0; 2];
    for index in 0..worlds::world_count(24) {
        let rng = &mut Rng::with_seed(index);
        let (ground, chunk_size) = ground_with_strata(&mut rng.clone(), index);
        let (bare, _) = random_ground(rng, index);
        let brushes: Vec<Brush> =
            (0..12).map(|_| random_brush(rng, &bare)).map(|brush| Brush::dig(brush.shape)).collect();
        let [mut with, mut without] = [ground, bare].map(|ground| terrain(&Arc::new(ground), chunk_size));
        assert_eq!(with.world().bricks().count(), 0);
        for brush in &brushes {
            let [a, b] = [&mut with, &mut without].map(|terrain| terrain.apply([brush]));
            let [a, b] =
                [a, b].map(|receipts| receipts.into_iter().next().and_then(|receipt| receipt.outcome.ok()));
            let total = |applied: &Option<Applied>| applied.as_ref().map(|applied| applied.removed.total());
            assert_eq!(total(&a), total(&b));
        }
        let bricks = |terrain: &Terrain| {
            let bricks = terrain.world().bricks().map(|(pos, brick)| {
                assert_eq!(brick.material_bytes(), 0, "nobody painted or built");
                let samples: Vec<_> = brick.edited_samples(pos).collect();
                (pos.0.to_array(), samples)
            });
            bricks.collect::<BTreeMap<_, _>>()
        };
        assert!(bricks(&with) == bricks(&without), "world {index}");
        let faces =
            |mesh: SurfaceMesh| (mesh.vertices.iter().map(|v| v.position).collect::<Vec<_>>(), mesh.indices);
        // Cliffs between columns have more vertices.
        let height = |column| with.world().ground().height(column);
        let top = |column: Column| (height(column) + 255).div_euclid(256);
        for tile in with.world().grid().tiles() {
            let (low, high) = with.world().grid().tile_cells(tile);
            let mut cells = (low.z..high.z).flat_map(|z| (low.x..high.x).map(move |x| Column::new(x, z)));
            let is_steep = cells.any(|cell| {
                let [a, b, c, d] = cell.corners().map(top);
                [(a, b), (b, c), (c, d), (d, a), (a, c)].iter().any(|(from, to)| from.abs_diff(*to) > 1)
            });
            let [with, without] = [&with, &without].map(|terrain| faces(terrain.world().tile_mesh(tile)));
            assert!(with == without || is_steep, "{tile:?} of world {index}");
            tiles[usize::from(with != without)] += 1;
        }
        for chunk in with.world().drawn_chunks() {
            assert!(faces(with.world().chunk_mesh(chunk)) == faces(without.world().chunk_mesh(chunk)));
        }
        // Undone, nothing is left.
        let hash = terrain(&Arc::new(ground_with_strata(&mut Rng::with_seed(index), index).0), chunk_size)
            .world()
            .hash();
        brushes.iter().for_each(|_| drop(with.undo()));
        with.apply::<Brush>([]);
        assert_eq!(with.world().hash(), hash);
    }
    assert!(tiles.iter().all(|&count| count > 20), "{tiles:?}");
}

#[test]
fn hashes_do_not_depend_on_chunks_or_batches() {
    for index in 0..12 {
        let rng = &mut Rng::with_seed(index);
        let (ground, _) = ground_with_strata(rng, index);
        let brushes: Vec<Brush> = (0..10).map(|_| worlds::any_random_brush(rng, &ground)).collect();
        let ground = Arc::new(ground);
        let run = |chunk_size: u32, batch: usize| {
            let mut terrain = terrain(&ground, chunk_size);
            let receipts: Vec<Receipt> =
                brushes.chunks(batch).flat_map(|batch| terrain.apply(batch)).collect();
            let removed =
                receipts.into_iter().map(|receipt| receipt.outcome.map(|applied| counted(&applied.removed)));
            (terrain.world().hash(), removed.collect::<Vec<_>>())
        };
        let expected = run(32, 1);
        for (chunk_size, batch) in [(8, 1), (25, 10), (100, 3)] {
            assert_eq!(run(chunk_size, batch), expected, "world {index}");
        }
    }
}

/// Checks that each corner of a triangle shows the material of the solid end of its edge; returns how many there are.
fn check_vertices(world: &World, mesh: &SurfaceMesh, origin: IVec3) -> usize {
    // Tiles also have vertices that no triangle uses.
    let vertices: Vec<_> = mesh.triangles().flatten().collect();
    for vertex in &vertices {
        let place = origin * SNAP + vertex.position;
        let low = place.map(|at| at.div_euclid(SNAP));
        // To the other end of the edge, or of the cell's diagonal.
        let step = place.map(|at| i32::from(at.rem_euclid(SNAP) != 0));
        let solid = match world.samples().is_solid(low) {
            // On a lattice point lies only the undug surface, over the highest solid voxel.
            _ if step == IVec3::ZERO => low - IVec3::Y,
            true => low,
            false => low + step,
        };
        let expected = material(world, solid);
        let mix = vertex.materials;
        assert_eq!((mix.ids, mix.weights), ([expected.0, 0, 0, 0], [255, 0, 0, 0]), "at {place} by {solid}");
    }
    vertices.len()
}

#[test]
fn every_vertex_shows_what_a_dig_there_yields() {
    let (mut tiles, mut chunks) = (0, 0);
    for index in (0..worlds::world_count(100)).filter(|index| index % 5 == 4) {
        let terrain = random_world(&mut Rng::with_seed(index), index);
        let world = terrain.world();
        for tile in world.grid().tiles() {
            tiles += check_vertices(world, &world.tile_mesh(tile), world.origin(MeshKey::Tile(tile)));
        }
        for chunk in world.drawn_chunks() {
            chunks += check_vertices(world, &world.chunk_mesh(chunk), world.origin(MeshKey::Chunk(chunk)));
        }
        let report = world.check_seams();
        assert!(report.is_flawless(), "world {index}: {report}");
    }
    assert!(tiles > 50_000 && chunks > 10_000, "{tiles} {chunks}");
}

/// Points of a triangle, as weights of its corners: all over it, none on an edge.
fn points_of(triangle: &[Vertex; 3]) -> Vec<Vec3> {
    let [a, b, c] = triangle.map(|vertex| vertex.position.as_vec3() / SNAP as f32);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let steps = (longest * 3.0).ceil().clamp(4.0, 40.0) as i32;
    let rows = (0..steps).flat_map(|i| (0..steps - i).map(move |j| (i, j)));
    rows.map(|(i, j)| {
        let [u, v] = [i, j].map(|at| (at as f32 + 1.0 / 3.0) / steps as f32);
        Vec3::new(u, v, 1.0 - u - v)
    })
    .collect()
}

/// The material with the most weight at a point of a triangle, as shaders find it.
fn shown(triangle: &[Vertex; 3], weights: Vec3) -> MaterialId {
    let mut sums = [0.0; 256];
    for (vertex, share) in triangle.iter().zip(weights.to_array()) {
        for (&id, &weight) in vertex.materials.ids.iter().zip(&vertex.materials.weights) {
            sums[usize::from(id)] += f32::from(weight) * share;
        }
    }
    let strongest = (0..=255).max_by(|&a: &u8, &b| sums[usize::from(a)].total_cmp(&sums[usize::from(b)]));
    MaterialId(strongest.unwrap_or_default())
}

/// How much farther from a point than the nearest solid voxel is the nearest one of this material; `None` if there is
/// none within 2 voxels.
fn error_at(world: &World, at: Vec3, shown: MaterialId) -> Option<f32> {
    let middle = at.floor().as_ivec3();
    let last = IVec3::new(world.ground().width(), middle.y + 3, world.ground().depth());
    let near = LatticeBox { min: (middle - 2).max(IVec3::Y * (middle.y - 2)), max: (middle + 3).min(last) };
    let solid = near.points().filter(|&point| world.samples().is_solid(point));
    let mut solid: Vec<(f32, IVec3)> = solid.map(|point| (at.distance(point.as_vec3()), point)).collect();
    solid.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let (own, _) = solid.iter().find(|&&(_, point)| material(world, point) == shown)?;
    Some(own - solid[0].0)
}

/// A random ground with cliffs and strata, dug in some places.
fn dug_cliffs(index: u64) -> Terrain {
    let rng = &mut Rng::with_seed(index);
    let (steep, tread) = ([3.0, 9.0, 25.0][index as usize % 3], rng.i32(1..6));
    let bumps: Vec<f64> = (0..41 * 41).map(|_| f64::from(rng.f32())).collect();
    let height = |x: i32, z: i32| {
        let terraces = f64::from((x + z / 2) / (3 * tread)) * steep;
        let h = terraces + bumps[(z * 41 + x) as usize] * if index.is_multiple_of(2) { 1.0 } else { steep };
        if index.is_multiple_of(5) { h.round() } else { h }
    };
    let ground = Ground::from_fn(40, 40, height).expect("finite heights");
    let (low, high) = ground.height_range();
    let strata = random_strata(rng, [low as f32 / 256.0 - 5.0, high as f32 / 256.0 + 2.0]);
    let ground = Arc::new(ground.with_strata(&strata).expect("valid strata"));
    let mut terrain = terrain(&ground, [8, 25, 32][rng.usize(..3)]);
    let brushes: Vec<Brush> = (0..8).map(|_| random_brush(rng, &ground)).collect();
    terrain.apply(brushes.into_iter().map(|brush| Brush::dig(brush.shape)));
    terrain
}

/// The border between two materials that are drawn is at most half a voxel off, so what is shown may be a voxel farther
/// away than what is nearest. Where heights are whole numbers, the surface lies a voxel above the highest solid points,
/// which adds 0.083 at most.
#[test]
fn every_point_shows_what_a_dig_there_yields() {
    let (mut points, mut far, mut misses) = ([0; 2], 0, Vec::new());
    for index in 0..worlds::world_count(12) {
        let terrain = dug_cliffs(index);
        let world = terrain.world();
        for (drawn, mesh) in world.drawn() {
            let origin = world.origin(drawn).as_vec3();
            for triangle in mesh.triangles() {
                let corners = triangle.map(|vertex| vertex.position.as_vec3() / SNAP as f32 + origin);
                for weights in points_of(&triangle) {
                    let at = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
                    let shown = shown(&triangle, weights);
                    points[usize::from(matches!(drawn, MeshKey::Chunk(_)))] += 1;
                    let error = error_at(world, at, shown);
                    far += u32::from(error.is_none_or(|error| error > 0.5));
                    if error.is_none_or(|error| error > 1.084) {
                        misses.push((index, drawn, at, shown, error));
                    }
                }
            }
        }
        let report = world.check_seams();
        assert!(report.is_flawless(), "world {index}: {report}");
    }
    println!("{points:?} points, {far} of them farther than half a voxel");
    assert!(misses.is_empty(), "{} of {points:?} points, {:?}", misses.len(), &misses[..misses.len().min(9)]);
    assert!(points.iter().all(|&count| count > 500_000), "{points:?}");
    assert!(far < points.iter().sum::<u32>() / 2000, "{far} of {points:?}");
}

/// Vertices of all that is drawn of a plain with one hole of a column's width and this depth in voxels.
fn vertices_around_a_hole(depth: f64, strata: bool) -> usize {
    let height = |x: i32, z: i32| if (x, z) == (16, 16) { 2000.0 - depth } else { 2000.0 };
    let ground = Ground::from_fn(32, 32, height).expect("valid heights");
    let ground = if strata { ground.with_strata(&Strata::alpine()).expect("valid strata") } else { ground };
    terrain(&Arc::new(ground), 32).world().drawn().map(|(_, mesh)| mesh.vertices.len()).sum()
}

#[test]
fn a_face_of_any_height_costs_a_bounded_number_of_vertices() {
    let plain = vertices_around_a_hole(0.0, true);
    for depth in [1.0, 10.0, 64.0, 65.0, 300.0, 4000.0, 30_000.0] {
        assert_eq!(vertices_around_a_hole(depth, false), plain);
        let cost = vertices_around_a_hole(depth, true) - plain;
        assert!(cost <= 12 * 64, "a hole {depth} voxels deep costs {cost} vertices");
    }
    // Up to the bound, beds show.
    assert!(vertices_around_a_hole(60.0, true) > plain + 300);
}
