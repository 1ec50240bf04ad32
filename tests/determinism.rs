//! Equal edits give equal worlds, bit for bit, regardless of batching, threads, chunk size or serialisation.

mod worlds;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::{BrickPos, Column, LatticeBox, SNAP};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::{Indices, SurfaceMesh};
use bevy_burrow::terrain::{MeshKey, World};
use fastrand::Rng;
use glam::{I64Vec3, Quat, Vec3};
use worlds::{
    any_random_brush, random_brush, random_brush_at_a_face, random_ground, random_rules,
    random_sculpting_brush, steep_real_ground,
};

/// A vertex as integers, for exact comparison.
type Bits = ([i64; 3], [u32; 3], [[u8; 4]; 2]);

/// A ground and edits of every kind, many of them on chunk faces of one of the chunk sizes.
fn random_script(seed: u64) -> (Ground, Vec<Brush>) {
    let mut rng = Rng::with_seed(seed);
    let (ground, _) = random_ground(&mut rng, seed);
    let brushes = (0..rng.u32(6..14))
        .map(|_| match rng.u32(0..8) {
            0 | 1 => random_sculpting_brush(&mut rng, &ground),
            5..8 => any_random_brush(&mut rng, &ground),
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

/// A script that is partly refused by digging rules, and whose last brush cuts a piece off.
struct HardScript {
    ground: Arc<Ground>,
    brushes: Vec<Brush>,
    rules: DiggingRules,
}

impl HardScript {
    fn new(seed: u64) -> Self {
        let mut rng = Rng::with_seed(seed);
        let (ground, mut brushes) = random_script(seed);
        brushes.iter_mut().for_each(|brush| brush.power = rng.u8(..) | rng.u8(..));
        // A ball on the ground, and a cut through its base.
        let column = Column::new(rng.i32(4..ground.width() - 4), rng.i32(4..ground.depth() - 4));
        let height = ground.height(column) as f32 / 256.0;
        let at = |up: f32| Vec3::new(column.x as f32, height + up, column.z as f32);
        brushes.push(Brush::add(Shape::sphere(at(5.0), 6.0), MaterialId(9)));
        brushes.push(Brush::dig(Shape::cuboid(at(2.0), Vec3::new(9.0, 1.2, 9.0))));
        let rules = random_rules(&mut rng, &ground);
        Self { ground: ground.into(), brushes, rules }
    }

    /// Runs the whole script in one transaction.
    fn play(&self, chunk_size: u32) -> (Terrain, Vec<Receipt>) {
        let mut terrain = terrain(&self.ground, chunk_size);
        terrain.set_rules(self.rules.clone()).expect("valid rules");
        terrain.set_loose(Some(LooseSettings { largest: 4000, crumbs: 9, debris: 4000 }));
        let receipts = terrain.apply(&self.brushes);
        (terrain, receipts)
    }
}

/// The outcomes of brushes without the parts that depend on the chunk size.
fn without_chunks(receipts: &[Receipt]) -> Vec<Result<Applied, Rejection>> {
    let applied =
        |receipt: &Receipt| receipt.outcome.clone().map(|applied| Applied { chunks: Vec::new(), ..applied });
    receipts.iter().map(applied).collect()
}

/// The number of receipts with refused voxels, and the number of pieces that came off.
fn refused_and_loose(receipts: &[Receipt]) -> (usize, usize) {
    let applied = || receipts.iter().filter_map(|receipt| receipt.outcome.as_ref().ok());
    let refused = applied().filter(|applied| !applied.refused.is_empty());
    (refused.count(), applied().map(|applied| applied.loose.len()).sum())
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

/// Every drawn mesh: its tile or chunk, vertices and indices.
fn drawn(world: &World) -> Vec<(MeshKey, Vec<Bits>, Indices)> {
    world.drawn().map(|(drawn, mesh)| (drawn, bits(&mesh, world.origin(drawn)), mesh.indices)).collect()
}

/// Every triangle in world coordinates in a canonical order: the same surface gives the same list.
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

/// The first sample that differs between two worlds; compares every brick stored in either of them and its neighbours.
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
        assert_eq!(first.0, second.0, "script {seed}: the hash differs");
        assert!(first == second, "script {seed}: same hash, but meshes or receipts differ");
    }
}

#[test]
fn worlds_do_not_depend_on_the_number_of_threads() {
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
fn refusals_and_loose_pieces_do_not_depend_on_the_number_of_threads() {
    let pools = [1, 2, 5].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    let (mut refused, mut loose) = (0, 0);
    for seed in 700..712 {
        let script = HardScript::new(seed);
        let runs = pools.each_ref().map(|pool| {
            pool.install(|| {
                let (terrain, receipts) = script.play(25);
                (terrain.world().hash(), drawn(terrain.world()), receipts)
            })
        });
        assert!(runs.iter().all(|run| run.0 == runs[0].0), "script {seed}: the hash depends on the threads");
        assert!(
            runs.iter().all(|run| *run == runs[0]),
            "script {seed}: meshes, receipts or pieces depend on the threads"
        );
        let found = refused_and_loose(&runs[0].2);
        (refused, loose) = (refused + found.0, loose + found.1);
    }
    assert!(refused > 5 && loose > 2, "{refused} refused, {loose} came off");
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
            assert!(other.world().mask() == at_once.world().mask(), "script {seed} {name}: the mask differs");
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
        let mut shown: BTreeMap<String, (MeshKey, SurfaceMesh)> =
            terrain.world().drawn().map(|(drawn, mesh)| (format!("{drawn:?}"), (drawn, mesh))).collect();
        for brush in &brushes {
            terrain.submit(brush);
            let commit = terrain.begin().expect("something is queued").run();
            let tiles =
                commit.meshes.tiles.iter().map(|(tile, update)| (MeshKey::Tile(*tile), update.mesh()));
            let chunks =
                commit.meshes.chunks.iter().map(|(at, chunk)| (MeshKey::Chunk(*at), chunk.mesh().clone()));
            for (drawn, mesh) in tiles.chain(chunks) {
                shown.insert(format!("{drawn:?}"), (drawn, mesh));
            }
            terrain.commit(commit).expect("no other commit");
        }
        let mut drawn: Vec<_> = terrain.world().drawn().filter(|(_, mesh)| !mesh.is_empty()).collect();
        let mut swapped: Vec<_> = shown.into_values().filter(|(_, mesh)| !mesh.is_empty()).collect();
        drawn.sort_by_key(|(drawn, _)| format!("{drawn:?}"));
        swapped.sort_by_key(|(drawn, _)| format!("{drawn:?}"));
        assert!(drawn == swapped, "script {seed}: a renderer that only applies the commits' meshes differs");
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
            assert!(first.world().mask() == other.world().mask(), "{what}: the mask differs");
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
            assert!(picture(other.world()) == expected, "{what}: same samples, but triangles differ");
        }
    }
}

#[test]
fn refusals_and_loose_pieces_do_not_depend_on_the_chunk_size() {
    let (mut refused, mut loose) = (0, 0);
    for seed in 600..612 {
        let script = HardScript::new(seed);
        let (first, receipts) = script.play(8);
        let expected = picture(first.world());
        for chunk_size in [25, 64, 128] {
            let (other, others) = script.play(chunk_size);
            let what = format!("script {seed}, chunks of 8 and of {chunk_size}");
            assert_eq!(first_difference(first.world(), other.world()), None, "{what}");
            assert_eq!(first.world().hash(), other.world().hash(), "{what}");
            assert!(without_chunks(&receipts) == without_chunks(&others), "{what}: receipts differ");
            assert!(picture(other.world()) == expected, "{what}: same samples, but triangles differ");
        }
        let found = refused_and_loose(&receipts);
        (refused, loose) = (refused + found.0, loose + found.1);
    }
    assert!(refused > 5 && loose > 2, "{refused} refused, {loose} came off");
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
            there.submit(&received);
        }
        let mut answers = Vec::new();
        while let Some(transaction) = there.begin() {
            answers.extend(there.commit(transaction.run()).expect("no other commit"));
        }
        let valid = |receipt: &&Receipt| !matches!(receipt.outcome, Err(Rejection::Brush(_)));
        assert!(answers.iter().eq(receipts.iter().filter(valid)), "script {seed}: receipts differ");
        assert_eq!(here.world().hash(), there.world().hash(), "script {seed}");
        assert!(drawn(here.world()) == drawn(there.world()), "script {seed}: meshes differ");
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
            // Painting with 0 restores the ground's own material.
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

/// Steep ground that is the same on every machine.
fn golden_ground() -> Ground {
    let height =
        |x: i32, z: i32| f64::from((x * x * 7 + z * z * 5 + x * z * 3) % 97) / 8.0 + f64::from(x) / 4.0;
    Ground::from_fn(52, 56, height).expect("finite heights")
}

#[test]
fn the_hash_of_a_dug_world_is_the_same_on_every_machine() {
    let ground = golden_ground();
    let script = golden_script(&ground);
    let mut terrain = terrain(&ground.into(), 25);
    let receipts = terrain.apply(&script);
    for (receipts, brushes) in receipts.chunks(3).zip(script.chunks(3)) {
        let changes =
            |receipt: &Receipt| receipt.outcome.as_ref().is_ok_and(|applied| applied.bounds.is_some());
        assert!(receipts.iter().any(changes), "none of these brushes changes anything: {brushes:?}");
    }
    assert_eq!(
        format!("{:#018x}", terrain.world().hash()),
        "0x2c65b13fc5ca894a",
        "the script gives another hash than before, or than on other machines. If the change is intended, put the new \
        hash here and say in the change log that saved journals give other worlds. If not, `ground`, `brush` or \
        `volume` evaluates floating-point arithmetic in another order than written"
    );
}

/// The FNV-1a hash of a sequence of words.
fn fold(words: impl IntoIterator<Item = u64>) -> u64 {
    words.into_iter().fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
}

/// All bits of a mesh, its triangles included; positions are relative to `origin`.
fn mesh_words(mesh: &SurfaceMesh, origin: glam::IVec3) -> impl Iterator<Item = u64> {
    let vertices = bits(mesh, origin).into_iter().flat_map(|(place, normal, materials)| {
        let place = place.map(|part| part as u64).into_iter();
        place.chain(normal.map(u64::from)).chain(materials.map(|four| u64::from(u32::from_le_bytes(four))))
    });
    let indices: Vec<u64> = mesh.indices.iter().map(u64::from).collect();
    vertices.chain([indices.len() as u64]).chain(indices)
}

/// The hash of every mesh that a world draws.
fn drawn_hash(world: &World) -> u64 {
    let meshes = world.drawn().map(|(drawn, mesh)| fold(mesh_words(&mesh, world.origin(drawn))));
    fold(meshes.collect::<Vec<_>>())
}

/// Every sculpting operation, on shapes of every kind, with falloffs narrower and wider than the shapes are deep.
fn sculpting_script(ground: &Ground) -> Vec<Brush> {
    let image = GreyImage::from_samples(4, 3, (0..12).map(|i| i * 5003).collect()).expect("twelve samples");
    let turn = Quat::from_xyzw(0.3, -0.1, 0.2, 0.9).normalize();
    (0..24)
        .map(|i| {
            let (x, z) = (7 + i % 5 * 9, 8 + i / 5 * 9);
            let height = (ground.height(Column::new(x, z)) / 64) as f32 / 4.0;
            let at = Vec3::new(x as f32 + 0.25, height, z as f32 - 0.5);
            let shape = match i % 5 {
                0 => Shape::sphere(at, 5.25),
                1 => Shape::turned_cuboid(at, Vec3::new(5.0, 3.5, 4.0), turn),
                2 => Shape::cylinder(at - Vec3::Y * 4.0, Vec3::new(1.0, 8.0, -2.0), 4.5),
                3 => Shape::capsule(at, at + Vec3::new(4.0, 1.0, 3.0), 3.25),
                _ => Shape::cone(at - Vec3::Y * 3.0, Vec3::new(-1.0, 9.0, 2.0), 6.0),
            };
            let stamp = Stamp::new(image.clone(), at, glam::Vec2::new(9.0, 7.5), 4.0).with_rotation(turn);
            let brush = match i % 8 {
                0 => Brush::smooth(shape, 0.75),
                1 => Brush::sharpen(shape, 1.0),
                2 => Brush::flatten(shape, at, Vec3::new(0.3, 1.0, -0.2)),
                3 => Brush::level(shape, height + 1.25),
                4 => Brush::raise(shape, 2.5),
                5 => Brush::lower(shape, 1.75),
                6 => Brush::stamp(shape, stamp),
                _ => Brush::terrace(shape, 2.0),
            };
            match i % 3 {
                0 => brush,
                1 => brush.with_falloff(1.5).with_material(MaterialId(2)),
                _ => brush.with_falloff(32.0).with_roughness(Roughness::new(0.5, 3.0, i as u32)),
            }
        })
        .collect()
}

/// A table, a ball on a post and a stick, and a cut through all of them that leaves a crumb of the stick.
fn falling_script() -> Vec<Brush> {
    // The post and the stick begin below the ground.
    let post = |x: f32, z: f32, half: f32, top: f32, material| {
        let (middle, half) = (Vec3::new(x, top * 0.5 - 1.0, z), Vec3::new(half, top * 0.5 + 1.0, half));
        Brush::add(Shape::cuboid(middle, half), MaterialId(material))
    };
    let board = |x: f32, z: f32, half: f32| {
        Brush::add(Shape::cuboid(Vec3::new(x, 48.0, z), Vec3::new(half, 1.75, half)), MaterialId(6))
    };
    let saw = Shape::cuboid(Vec3::new(26.0, 40.0, 28.0), Vec3::new(30.0, 1.25, 32.0));
    vec![
        post(14.0, 15.0, 2.25, 50.0, 4),
        board(14.0, 15.0, 6.5),
        post(36.0, 40.0, 1.25, 48.0, 5),
        Brush::add(Shape::sphere(Vec3::new(36.5, 50.0, 40.25), 5.0), MaterialId(7)),
        post(10.0, 42.0, 0.75, 46.0, 5),
        Brush::dig(saw).with_roughness(Roughness::new(0.5, 4.0, 9)),
    ]
}

#[test]
fn worlds_meshes_and_loose_pieces_are_the_same_on_every_machine() {
    let ground = Arc::new(golden_ground());
    let mut found: Vec<(&str, u64)> = Vec::new();

    let mut dug = terrain(&ground, 25);
    dug.apply(golden_script(&ground));
    found.push(("meshes of a dug world", drawn_hash(dug.world())));

    let mut sculpted = terrain(&ground, 32);
    let receipts = sculpted.apply(sculpting_script(&ground));
    let changes = |receipt: &Receipt| receipt.outcome.as_ref().is_ok_and(|own| own.bounds.is_some());
    assert!(
        receipts.iter().filter(|receipt| changes(receipt)).count() > 16,
        "too few brushes change something"
    );
    found.push(("a sculpted world", sculpted.world().hash()));
    found.push(("its meshes", drawn_hash(sculpted.world())));

    let protected = LatticeBox::new(glam::IVec3::new(20, 0, 10), glam::IVec3::new(30, 40, 30));
    let rules = DiggingRules::default()
        .with_hardness(MaterialId(0), 120)
        .with_unbreakable(MaterialId(3))
        .with_bedrock(4)
        .with_protected(protected.expect("not empty"));
    let mut ruled = terrain(&ground, 25);
    ruled.set_rules(rules).expect("valid rules");
    let script = golden_script(&ground).into_iter().chain(sculpting_script(&ground)).enumerate();
    let receipts = ruled.apply(script.map(|(i, brush)| brush.with_power([255, 180, 130, 60][i % 4])));
    assert!(refused_and_loose(&receipts).0 > 5, "too little is refused");
    found.push(("a world under rules", ruled.world().hash()));
    found.push(("its meshes", drawn_hash(ruled.world())));

    let mut fallen = terrain(&ground, 32);
    fallen.set_loose(Some(LooseSettings { largest: 10_000, crumbs: 12, debris: 10_000 }));
    let receipts = fallen.apply(falling_script());
    let applied = receipts.iter().filter_map(|receipt| receipt.outcome.as_ref().ok());
    let pieces: Vec<&LoosePiece> = applied.flat_map(|applied| &applied.loose).collect();
    assert!(pieces.iter().filter(|piece| piece.mesh.is_some()).count() > 1, "{} pieces", pieces.len());
    let meshes = pieces.iter().filter_map(|piece| Some((piece.mesh.as_ref()?, piece.bounds.min)));
    found.push(("a world that pieces fell out of", fallen.world().hash()));
    found.push(("its meshes", drawn_hash(fallen.world())));
    found.push(("the pieces", fold(meshes.flat_map(|(mesh, low)| mesh_words(mesh, low)))));

    let expected: [u64; 8] = [
        0xf9410c865fbdc66d, // meshes of a dug world
        0xdb77d09638d4323e, // a sculpted world
        0x16d0163316e85773, // its meshes
        0x2be050fdd41b2b4c, // a world under rules
        0x954ac34ea520151e, // its meshes
        0x0c4529be9710fafd, // a world that pieces fell out of
        0xc3721f5caf4c5f76, // its meshes
        0x7705ad1639b960a1, // the pieces
    ];
    let lines = |hashes: &[u64]| -> String {
        found.iter().zip(hashes).map(|((name, _), hash)| format!("{hash:#018x}, // {name}\n")).collect()
    };
    let hashes: Vec<u64> = found.iter().map(|(_, hash)| *hash).collect();
    assert!(
        hashes == expected,
        "hashes differ from the expected ones, or from those of other machines. If the change is intended, replace \
        the expected hashes by those found. Found:\n{}Expected:\n{}",
        lines(&hashes),
        lines(&expected)
    );
}
