//! The same edits make the same world, bit for bit: however they are batched, threaded, cut into chunks or sent.

mod worlds;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::{BrickPos, Column, SNAP};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::{Indices, SurfaceMesh};
use bevy_burrow::terrain::{Drawn, World};
use fastrand::Rng;
use glam::{I64Vec3, Quat, Vec3};
use worlds::{
    random_brush, random_brush_at_a_face, random_ground, random_sculpting_brush, steep_real_ground,
};

/// A vertex without floats, so that it can be compared bit for bit.
type Bits = ([i64; 3], [u32; 3], [[u8; 4]; 2]);

/// A ground and edits of every kind, many of them on chunk faces of some chunk size.
fn random_script(seed: u64) -> (Ground, Vec<Brush>) {
    let mut rng = Rng::with_seed(seed);
    let (ground, _) = random_ground(&mut rng, seed);
    let brushes = (0..rng.u32(6..14))
        .map(|_| match rng.u32(0..5) {
            0 | 1 => random_sculpting_brush(&mut rng, &ground),
            2 => {
                let chunk_size = [8, 25, 32, 64, 100][rng.usize(0..5)];
                random_brush_at_a_face(&mut rng, &ground, chunk_size)
            }
            _ => random_brush(&mut rng, &ground),
        })
        .collect();
    (ground, brushes)
}

fn terrain(ground: &Arc<Ground>, chunk_size: u32) -> Terrain {
    let settings = TerrainSettings { chunk_size, ..Default::default() };
    Terrain::new(Arc::clone(ground), &settings).expect("valid settings")
}

/// Applies brushes in transactions of random lengths.
fn apply_in_batches(terrain: &mut Terrain, brushes: &[Brush], rng: &mut Rng) {
    let mut rest = brushes;
    while !rest.is_empty() {
        let (batch, later) = rest.split_at(rng.usize(1..=rest.len()));
        terrain.apply(batch);
        rest = later;
    }
}

fn bits(mesh: &SurfaceMesh, origin: glam::IVec3) -> Vec<Bits> {
    let origin = origin.as_i64vec3() * i64::from(SNAP);
    let vertex = |v: &bevy_burrow::surface::Vertex| {
        let place: I64Vec3 = origin + v.position.as_i64vec3();
        (place.to_array(), v.normal.to_array().map(f32::to_bits), [v.materials.ids, v.materials.weights])
    };
    mesh.vertices.iter().map(vertex).collect()
}

/// Every mesh as it is drawn: which, vertices, indices.
fn drawn(world: &World) -> Vec<(Drawn, Vec<Bits>, Indices)> {
    world.drawn().map(|(drawn, mesh)| (drawn, bits(&mesh, world.origin(drawn)), mesh.indices)).collect()
}

/// Every triangle in world places, in an order of its own: the same picture gives the same list.
fn picture(world: &World) -> Vec<[Bits; 3]> {
    let mut triangles: Vec<[Bits; 3]> = Vec::new();
    for (drawn, mesh) in world.drawn() {
        let vertices = bits(&mesh, world.origin(drawn));
        for corner in mesh.indices.triangles() {
            let mut triangle = corner.map(|index| vertices[index as usize]);
            let first = (0..3).min_by_key(|&i| triangle[i]).expect("three corners");
            triangle.rotate_left(first);
            triangles.push(triangle);
        }
    }
    triangles.sort_unstable();
    triangles
}

/// Where two worlds have other samples than each other: looks at every brick that either of them stores, and around it.
fn first_difference(a: &World, b: &World) -> Option<String> {
    let bricks: BTreeSet<[i32; 3]> = a.bricks().chain(b.bricks()).map(|(pos, _)| pos.0.to_array()).collect();
    let (left, right) = (a.samples(), b.samples());
    let differs = |&p: &glam::IVec3| {
        left.sample(p) != right.sample(p)
            || left.distance(p) != right.distance(p)
            || left.is_solid(p) != right.is_solid(p)
            || left.stored_material(p) != right.stored_material(p)
            || left.material(p) != right.material(p)
    };
    let around = |brick: [i32; 3]| BrickPos(brick.into()).samples().grown(1).points();
    let place = bricks.into_iter().flat_map(around).find(differs)?;
    let of = |view: bevy_burrow::volume::SampleView| (view.sample(place), view.material(place));
    Some(format!("at {place}: {:?} and {:?}", of(left), of(right)))
}

#[test]
fn two_runs_make_the_same_world_and_the_same_meshes() {
    for seed in 0..24 {
        let run = || {
            let (ground, brushes) = random_script(seed);
            let mut terrain = terrain(&ground.into(), 32);
            let receipts = terrain.apply(&brushes);
            (terrain.world().hash(), drawn(terrain.world()), receipts)
        };
        let (first, second) = (run(), run());
        assert_eq!(first.0, second.0, "script {seed}: other hash");
        assert!(first == second, "script {seed}: same hash, but other meshes or receipts");
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let pools = [1, 2, 5].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    for seed in 100..116 {
        let (ground, brushes) = random_script(seed);
        let ground = ground.into();
        let runs = pools.each_ref().map(|pool| {
            pool.install(|| {
                let mut terrain = terrain(&ground, 25);
                let receipts = terrain.apply(&brushes);
                (terrain.world().hash(), drawn(terrain.world()), receipts)
            })
        });
        assert!(runs.iter().all(|run| run.0 == runs[0].0), "script {seed}: the hash depends on the threads");
        assert!(
            runs.iter().all(|run| *run == runs[0]),
            "script {seed}: meshes or receipts depend on the threads"
        );
    }
}

#[test]
fn grounds_do_not_depend_on_the_number_of_threads() {
    let pools = [1, 2, 5].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    let noise = NoiseHeights { seed: 5, ..Default::default() };
    let make = || {
        let noise = Ground::from_noise(90, 70, &noise).expect("valid noise");
        (noise.hash(), steep_real_ground(80, 60, 11, 40, 300.0).hash())
    };
    let hashes = pools.each_ref().map(|pool| pool.install(make));
    assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:?}");
}

#[test]
fn one_transaction_or_many_make_the_same_world_and_the_same_meshes() {
    for seed in 200..240 {
        let (ground, brushes) = random_script(seed);
        let ground = ground.into();
        let chunk_size = [8, 25, 32, 100][seed as usize % 4];
        let mut at_once = terrain(&ground, chunk_size);
        let receipts = at_once.apply(&brushes);
        let expected = drawn(at_once.world());

        let mut one_by_one = terrain(&ground, chunk_size);
        let single: Vec<Receipt> = brushes.iter().flat_map(|brush| one_by_one.apply([brush])).collect();
        assert_eq!(single, receipts, "script {seed}: receipts depend on the batches");
        let mut batched = terrain(&ground, chunk_size);
        apply_in_batches(&mut batched, &brushes, &mut Rng::with_seed(seed));
        for (name, other) in [("one by one", &one_by_one), ("in batches", &batched)] {
            assert_eq!(first_difference(at_once.world(), other.world()), None, "script {seed} {name}");
            assert_eq!(other.world().hash(), at_once.world().hash(), "script {seed} {name}");
            assert!(other.world().mask() == at_once.world().mask(), "script {seed} {name}: other mask");
            assert!(
                drawn(other.world()) == expected,
                "script {seed} {name}: a mesh was not brought up to date"
            );
        }
    }
}

#[test]
fn the_meshes_of_commits_add_up_to_the_drawn_world() {
    for seed in 300..330 {
        let (ground, brushes) = random_script(seed);
        let mut terrain = terrain(&ground.into(), [8, 25, 32][seed as usize % 3]);
        let mut shown: BTreeMap<String, (Drawn, SurfaceMesh)> =
            terrain.world().drawn().map(|(drawn, mesh)| (format!("{drawn:?}"), (drawn, mesh))).collect();
        for brush in &brushes {
            terrain.submit(brush);
            let commit = terrain.begin().expect("something is queued").run();
            let tiles = commit.meshes.tiles.iter().map(|(tile, update)| (Drawn::Tile(*tile), update.mesh()));
            let chunks =
                commit.meshes.chunks.iter().map(|(at, chunk)| (Drawn::Chunk(*at), chunk.mesh().clone()));
            for (drawn, mesh) in tiles.chain(chunks) {
                shown.insert(format!("{drawn:?}"), (drawn, mesh));
            }
            terrain.commit(commit).expect("nothing came in between");
        }
        let mut drawn: Vec<_> = terrain.world().drawn().filter(|(_, mesh)| !mesh.is_empty()).collect();
        let mut swapped: Vec<_> = shown.into_values().filter(|(_, mesh)| !mesh.is_empty()).collect();
        drawn.sort_by_key(|(drawn, _)| format!("{drawn:?}"));
        swapped.sort_by_key(|(drawn, _)| format!("{drawn:?}"));
        assert!(drawn == swapped, "script {seed}: a renderer that follows the commits shows something else");
    }
}

#[test]
fn the_chunk_size_changes_neither_samples_nor_picture() {
    for seed in 400..416 {
        let (ground, brushes) = random_script(seed);
        let ground = ground.into();
        let mut first = terrain(&ground, 8);
        let receipts = first.apply(&brushes);
        let expected = picture(first.world());
        for chunk_size in [25, 32, 64, 100, 128] {
            let mut other = terrain(&ground, chunk_size);
            let counts = other.apply(&brushes);
            let what = format!("script {seed}, chunks of 8 and of {chunk_size}");
            assert_eq!(first_difference(first.world(), other.world()), None, "{what}");
            assert_eq!(first.world().hash(), other.world().hash(), "{what}");
            assert!(first.world().mask() == other.world().mask(), "{what}: other mask");
            for (a, b) in receipts.iter().zip(&counts) {
                let volumes = |receipt: &Receipt| {
                    let applied = receipt.outcome.as_ref().map_err(Clone::clone)?;
                    Ok::<_, Rejection>((
                        applied.bounds,
                        applied.removed.clone(),
                        applied.added.clone(),
                        applied.painted.clone(),
                    ))
                };
                assert_eq!(volumes(a), volumes(b), "{what}");
            }
            assert!(picture(other.world()) == expected, "{what}: same samples, but other triangles");
        }
    }
}

#[test]
fn edits_sent_as_json_make_the_same_world() {
    for seed in 500..530 {
        let (ground, brushes) = random_script(seed);
        let ground = ground.into();
        let mut here = terrain(&ground, 32);
        let receipts = here.apply(&brushes);
        let mut there = terrain(&ground, 32);
        for brush in &brushes {
            let Ok(edit) = Edit::quantize(brush) else { continue };
            let sent = serde_json::to_string(&edit).expect("an edit can be written");
            let received: Edit = serde_json::from_str(&sent).expect("an edit can be read back");
            assert_eq!(received, edit, "{sent}");
            there.submit_edit(&received);
        }
        if let Some(transaction) = there.begin() {
            let answers = there.commit(transaction.run()).expect("nothing came in between");
            let valid = |receipt: &&Receipt| !matches!(receipt.outcome, Err(Rejection::Brush(_)));
            assert!(answers.iter().eq(receipts.iter().filter(valid)), "script {seed}: other receipts");
        }
        assert_eq!(here.world().hash(), there.world().hash(), "script {seed}");
        assert!(drawn(here.world()) == drawn(there.world()), "script {seed}: other meshes");
    }
}

/// Every shape with every operation, with and without roughness, over steep and level ground.
fn golden_script(ground: &Ground) -> Vec<Brush> {
    let turn = Quat::from_xyzw(0.5, 0.5, -0.1, 0.7).normalize();
    let mut brushes = Vec::new();
    for (i, operation) in [
        Operation::Add { material: MaterialId(3) },
        Operation::Dig,
        Operation::Paint { material: MaterialId(6) },
        Operation::Paint { material: MaterialId::GROUND },
    ]
    .into_iter()
    .enumerate()
    {
        let at = |k: usize| {
            // The ground's own look is given back to what was painted.
            let (x, z) = (6.25 + 9.5 * k as f32, 8.0 + 11.125 * i.min(2) as f32 + (i / 3) as f32);
            let height = ground.height(Column::new(x as i32, z as i32));
            Vec3::new(x, (height / 64) as f32 / 4.0, z)
        };
        let shapes = [
            Shape::sphere(at(0), 5.0),
            Shape::turned_cuboid(at(1), Vec3::new(4.0, 2.5, 5.5), turn),
            Shape::cylinder(at(2) - Vec3::Y * 4.0, Vec3::new(3.0, 7.0, -2.0), 3.5),
            Shape::capsule(at(3), at(0) + Vec3::new(0.0, 4.0, 6.0), 2.25),
            Shape::cone(at(4) - Vec3::Y * 4.0, Vec3::new(-2.0, 11.0, 1.0), 4.0),
        ];
        for (k, shape) in shapes.into_iter().enumerate() {
            let smooth =
                Brush { operation: operation.clone(), ..Brush::dig(shape) }.with_tag((10 * i + k) as u64);
            let rough = Roughness::new(0.75 + 0.25 * k as f32, 2.0 + 1.5 * i as f32, 77 + k as u32);
            let moved = Shape::sphere(at(k) + Vec3::new(1.5, 1.0, 3.0), 3.0);
            brushes.push(Brush { shape: moved, ..smooth.clone() }.with_roughness(rough));
            brushes.push(smooth.clone().with_roughness(rough));
            brushes.push(smooth);
        }
    }
    brushes
}

#[test]
fn the_hash_of_a_dug_world_is_the_same_on_every_machine() {
    let height =
        |x: i32, z: i32| f64::from((x * x * 7 + z * z * 5 + x * z * 3) % 97) / 8.0 + f64::from(x) / 4.0;
    let ground = Ground::from_fn(52, 56, height).expect("finite heights");
    let script = golden_script(&ground);
    let mut terrain = terrain(&ground.into(), 25);
    let receipts = terrain.apply(&script);
    for (receipts, brushes) in receipts.chunks(3).zip(script.chunks(3)) {
        let changes =
            |receipt: &Receipt| receipt.outcome.as_ref().is_ok_and(|applied| applied.bounds.is_some());
        assert!(receipts.iter().any(changes), "brushes that change nothing prove nothing: {brushes:?}");
    }
    assert_eq!(
        format!("{:#018x}", terrain.world().hash()),
        "0x2c65b13fc5ca894a",
        "the same script made another world than before, or than on other machines. If edits are meant to come out \
         differently from now on, put the new hash here, and say in the change log that saved journals give other \
         worlds. If not, something in `ground`, `brush` or `volume` lost its written order of arithmetic"
    );
}
