//! The paper's five scenarios on examples worked out by hand, and the invariants of fields under random edits.
//!
//! A dig of radius r at lattice height on level ground raises each density to at least the negated distance to the
//! ball, but only up to two voxels outside the ball (rule 6). For r = 2 around (x, h, z) it changes samples up to 3
//! voxels sideways (two below the centre: at distance 2.6 and 3.6, both within 4), down to 4 voxels below, and up to
//! h itself.

mod worlds;

use std::collections::BTreeSet;

use bevy_burrow::lattice::{ChunkPos, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use bevy_burrow::volume::FieldId;
use fastrand::Rng;
use glam::{IVec3, Vec3};
use worlds::{random_brush, random_brush_at_a_face, random_ground};

/// Level ground at `height`, `chunks` chunks wide and deep.
fn level(chunk_size: u32, chunks: u32, height: i32) -> Terrain {
    let ground =
        Ground::flat(chunk_size * chunks, chunk_size * chunks, height.into()).expect("finite heights");
    Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings")
}

fn ball(x: i32, y: i32, z: i32, radius: f32) -> Shape {
    Shape::sphere(IVec3::new(x, y, z).as_vec3(), radius)
}

fn apply(terrain: &mut Terrain, brush: Brush) -> Applied {
    terrain.apply([brush]).remove(0).outcome.expect("a valid brush in the world")
}

fn dig(terrain: &mut Terrain, shape: Shape) -> Applied {
    apply(terrain, Brush::dig(shape))
}

/// The scenario of an edit that stays in one chunk.
fn only(applied: &Applied) -> Scenario {
    assert_eq!(applied.chunks.len(), 1, "{applied:?}");
    applied.chunks[0].scenario
}

fn cuboid(min: [i32; 3], max: [i32; 3]) -> LatticeBox {
    LatticeBox::new(min.into(), max.into()).expect("min is below max")
}

/// The boxes of a chunk's fields.
fn boxes(world: &World, chunk: [i32; 3]) -> Vec<LatticeBox> {
    let chunk = ChunkPos::from_ivec3(chunk.into());
    world.fields_of(chunk).into_iter().flat_map(|fields| fields.iter().map(|field| field.bounds)).collect()
}

/// Checks the invariants of all fields, and of each pair of them.
fn check_laws(world: &World, what: &str) {
    let grid = world.grid();
    let mut names = BTreeSet::<FieldId>::new();
    for (chunk, fields) in world.fields() {
        let fields: Vec<_> = fields.iter().collect();
        for (i, field) in fields.iter().enumerate() {
            assert!(names.insert(field.id), "{what}: two fields are called {:?}", field.id);
            let own = grid.chunk_samples(chunk);
            assert!(own.encloses(field.bounds), "{what}: {field:?} leaves its chunk {chunk:?}");
            for other in &fields[i + 1..] {
                assert!(!field.bounds.meets(other.bounds), "{what}: {field:?} meets {other:?}");
            }
        }
    }
    let mut tight = std::collections::BTreeMap::<FieldId, LatticeBox>::new();
    for (pos, brick) in world.bricks() {
        for (point, _, _) in brick.edited_samples(pos) {
            assert!(grid.edit_bounds().contains(point), "{what}: {point} lies outside the world");
            let fields = world.fields_of(grid.chunk_of(point));
            let mut holding =
                fields.into_iter().flat_map(|f| f.iter()).filter(|field| field.bounds.contains(point));
            let field =
                holding.next().unwrap_or_else(|| panic!("{what}: no field holds the edited sample {point}"));
            assert_eq!(holding.next(), None, "{what}: a second field holds {point}");
            let at = LatticeBox::point(point);
            tight.entry(field.id).and_modify(|bounds| *bounds = bounds.union(at)).or_insert(at);
        }
    }
    for (_, fields) in world.fields() {
        for field in fields.iter() {
            assert_eq!(
                tight.get(&field.id),
                Some(&field.bounds),
                "{what}: the box of {field:?} is not tight"
            );
        }
    }
}

#[test]
fn first_scenario_a_field_is_created_to_fit() {
    let mut terrain = level(32, 2, 10);
    let applied = dig(&mut terrain, ball(16, 10, 16, 2.0));
    assert_eq!(only(&applied), Scenario::Created);
    assert_eq!(boxes(terrain.world(), [0, 0, 0]), [cuboid([13, 6, 13], [19, 10, 19])]);
    assert_eq!(applied.bounds, Some(cuboid([13, 6, 13], [19, 10, 19])));

    // Two unedited samples between the pits are enough to keep the fields apart.
    let applied = dig(&mut terrain, ball(24, 10, 16, 2.0));
    assert_eq!(only(&applied), Scenario::Created);
    assert_eq!(boxes(terrain.world(), [0, 0, 0]).len(), 2);
    check_laws(terrain.world(), "two pits");
}

#[test]
fn second_scenario_an_edit_inside_leaves_the_box() {
    let mut terrain = level(32, 2, 10);
    let created = dig(&mut terrain, ball(16, 10, 16, 4.0));
    let before = boxes(terrain.world(), [0, 0, 0]);
    // The pit's floor is at y = 6. The painted ball covers 4 to 6: paint does not reach beyond its shape.
    let applied = apply(&mut terrain, Brush::paint(ball(16, 5, 16, 1.0), MaterialId(3)));
    assert_eq!(only(&applied), Scenario::Changed);
    assert_eq!(applied.chunks[0].field, created.chunks[0].field);
    // One of the ball's seven lattice points was dug before: (16, 6, 16) is air.
    assert_eq!(applied.painted.of(MaterialId(3)), 6);
    assert_eq!(boxes(terrain.world(), [0, 0, 0]), before);
    let field =
        terrain.world().fields_of(ChunkPos { x: 0, y: 0, z: 0 }).and_then(|f| f.get(created.chunks[0].field));
    assert_eq!(field.map(|field| field.revision), Some(1), "the second edit of this field");
}

#[test]
fn third_scenario_an_edit_reaches_out_and_the_field_grows() {
    let mut terrain = level(32, 2, 10);
    let created = dig(&mut terrain, ball(16, 10, 16, 2.0));
    // One sample farther along x: the boxes 13..=19 and 14..=20 overlap.
    let applied = dig(&mut terrain, ball(17, 10, 16, 2.0));
    assert_eq!(only(&applied), Scenario::Extended);
    assert_eq!(applied.chunks[0].field, created.chunks[0].field);
    assert_eq!(boxes(terrain.world(), [0, 0, 0]), [cuboid([13, 6, 13], [20, 10, 19])]);
    // The boxes 13..=20 and 21..=27 only lie side by side, but a cell touches both, so they are one field.
    assert_eq!(only(&dig(&mut terrain, ball(24, 10, 16, 2.0))), Scenario::Extended);
    assert_eq!(boxes(terrain.world(), [0, 0, 0]), [cuboid([13, 6, 13], [27, 10, 19])]);
    check_laws(terrain.world(), "a row");
}

#[test]
fn fourth_scenario_fields_that_an_edit_joins_merge() {
    let mut terrain = level(32, 2, 10);
    let mut pits = Vec::new();
    for (x, z) in [(6, 6), (26, 6), (6, 26), (26, 26)] {
        let applied = dig(&mut terrain, ball(x, 10, z, 2.0));
        assert_eq!(only(&applied), Scenario::Created);
        pits.push(applied.chunks[0].field);
    }
    // A trench joins the first two; the oldest field survives.
    let trench = Shape::capsule(Vec3::new(6.0, 10.0, 6.0), Vec3::new(26.0, 10.0, 6.0), 2.0);
    let applied = dig(&mut terrain, trench);
    assert_eq!(only(&applied), Scenario::Merged { fields: 2 });
    assert_eq!(applied.chunks[0].field, pits[0]);
    assert_eq!(boxes(terrain.world(), [0, 0, 0]).len(), 3);
    check_laws(terrain.world(), "a trench");
    // A wide pit in the middle meets the trench and both other pits: 16 +- 9 voxels sideways.
    let applied = dig(&mut terrain, ball(16, 10, 16, 8.0));
    assert_eq!(only(&applied), Scenario::Merged { fields: 3 });
    assert_eq!(applied.chunks[0].field, pits[0]);
    assert_eq!(boxes(terrain.world(), [0, 0, 0]).len(), 1);
    check_laws(terrain.world(), "a wide pit");
}

#[test]
fn fourth_scenario_counts_every_field_that_goes_in() {
    let mut terrain = level(64, 1, 10);
    for i in 0..7 {
        assert_eq!(only(&dig(&mut terrain, ball(8 + 8 * i, 10, 30, 2.0))), Scenario::Created);
    }
    let trench = Shape::capsule(Vec3::new(8.0, 10.0, 30.0), Vec3::new(56.0, 10.0, 30.0), 3.0);
    assert_eq!(only(&dig(&mut terrain, trench)), Scenario::Merged { fields: 7 });
    check_laws(terrain.world(), "seven pits");
}

#[test]
fn fifth_scenario_an_edit_on_a_face_an_edge_or_a_corner_is_split() {
    for chunk_size in [8, 25, 32, 50, 75, 100, 128] {
        let size = chunk_size as i32;
        // The surface lies in the horizontal face between chunks, so a corner of eight chunks lies on it. Samples on a
        // face belong to the chunk above it, those one below to the chunk below.
        for (at, chunks, name) in [
            ([size, size + 4, size / 2], 2, "face"),
            ([size, size + 4, size], 4, "edge"),
            ([size, size, size / 2], 4, "face on a face"),
            ([size, size, size], 8, "corner"),
        ] {
            let what = format!("{name} of chunks of {size}");
            let height = at[1];
            let mut terrain = level(chunk_size, 2, height);
            let applied = dig(&mut terrain, ball(at[0], at[1], at[2], 2.0));
            // A small chunk's neighbour on the far side is reached as well.
            let crowded = chunk_size == 8 && name != "corner";
            if !crowded {
                assert_eq!(applied.chunks.len(), chunks, "{what}: {applied:?}");
            }
            let grid = terrain.world().grid();
            let edited = terrain.world().bricks().flat_map(|(pos, brick)| brick.edited_samples(pos));
            let reached: BTreeSet<ChunkPos> = edited.map(|(point, ..)| grid.chunk_of(point)).collect();
            assert!(applied.chunks.iter().map(|part| part.chunk).eq(reached), "{what}: {applied:?}");
            assert!(applied.is_split(), "{what}");
            assert!(
                applied.chunks.iter().all(|part| part.scenario == Scenario::Created),
                "{what}: {applied:?}"
            );
            let ids: BTreeSet<FieldId> = applied.chunks.iter().map(|part| part.field).collect();
            assert_eq!(ids.len(), applied.chunks.len(), "{what}: each chunk has a field of its own");
            // Together the parts are what one edit in the middle of a chunk would give.
            let bounds = cuboid([at[0] - 3, at[1] - 4, at[2] - 3], [at[0] + 3, at[1], at[2] + 3]);
            assert_eq!(applied.bounds, Some(bounds), "{what}");
            let parts: Vec<LatticeBox> = applied
                .chunks
                .iter()
                .flat_map(|part| boxes(terrain.world(), part.chunk.as_ivec3().to_array()))
                .collect();
            assert_eq!(parts.len(), applied.chunks.len(), "{what}: one field in each chunk");
            assert_eq!(parts.iter().copied().reduce(LatticeBox::union), Some(bounds), "{what}");
            for (i, &part) in parts.iter().enumerate() {
                assert!(grid.chunk_samples(applied.chunks[i].chunk).encloses(part), "{what}: {part:?}");
                let mut others = parts[i + 1..].iter();
                assert!(others.all(|&other| part.intersection(other).is_none()), "{what}: the parts overlap");
            }
            check_laws(terrain.world(), &what);
            let report = terrain.world().check_seams();
            assert!(report.is_flawless(), "{what}: {report}");
        }
    }
}

#[test]
fn fifth_scenario_each_chunk_has_a_scenario_of_its_own() {
    let mut terrain = level(32, 2, 10);
    // Left of the face: one field. Right of it: two.
    dig(&mut terrain, ball(24, 10, 16, 2.0));
    dig(&mut terrain, ball(40, 10, 12, 2.0));
    dig(&mut terrain, ball(40, 10, 20, 2.0));
    // A trench across the face meets all three; it stays inside the box of the second one.
    let trench = Shape::capsule(Vec3::new(24.0, 10.0, 16.0), Vec3::new(40.0, 10.0, 16.0), 2.0);
    let applied = dig(&mut terrain, trench);
    let scenarios: Vec<_> = applied.chunks.iter().map(|part| (part.chunk.x, part.scenario)).collect();
    assert_eq!(scenarios, [(0, Scenario::Extended), (1, Scenario::Merged { fields: 2 })]);
    // The trench's walls reach slightly beyond it, but stay inside the boxes.
    let walls = Shape::capsule(Vec3::new(24.0, 10.0, 16.0), Vec3::new(40.0, 10.0, 16.0), 2.75);
    let again = apply(&mut terrain, Brush::paint(walls, MaterialId(2)));
    let scenarios: Vec<_> = again.chunks.iter().map(|part| (part.chunk.x, part.scenario)).collect();
    assert_eq!(scenarios, [(0, Scenario::Changed), (1, Scenario::Changed)]);

    // On untouched ground farther on, one chunk extends a field while the next creates its first.
    let applied =
        dig(&mut terrain, Shape::capsule(Vec3::new(24.0, 10.0, 16.0), Vec3::new(24.0, 10.0, 40.0), 2.0));
    let scenarios: Vec<_> = applied.chunks.iter().map(|part| (part.chunk.z, part.scenario)).collect();
    assert_eq!(scenarios, [(0, Scenario::Extended), (1, Scenario::Created)]);

    let mut counts = ScenarioCounts::default();
    for applied in [applied, again] {
        counts.count(&Receipt::of_edit(0, Ok(applied)));
    }
    assert_eq!(counts, ScenarioCounts { created: 1, changed: 2, extended: 1, merged: 0, split: 2 });
    check_laws(terrain.world(), "trenches");
}

#[test]
fn samples_of_the_far_rim_belong_to_the_last_chunk() {
    for chunk_size in [8, 25, 32] {
        let mut terrain = level(chunk_size, 2, 10);
        let end = 2 * chunk_size as i32;
        let applied = dig(&mut terrain, ball(end, 10, end, 2.0));
        assert!(applied.chunks.iter().all(|part| (part.chunk.x, part.chunk.z) == (1, 1)), "{applied:?}");
        assert_eq!(applied.bounds, Some(cuboid([end - 3, 6, end - 3], [end, 10, end])));
        check_laws(terrain.world(), "far rim");
    }
}

#[test]
fn field_invariants_hold_under_random_edits() {
    let mut merges = 0;
    for seed in 0..120 {
        let mut rng = Rng::with_seed(7000 + seed);
        let (ground, _) = random_ground(&mut rng, seed % 3);
        let chunk_size = [8, 25, 50, 75, 100, 32][seed as usize % 6];
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let brushes: Vec<Brush> = (0..rng.u32(4..30))
            .map(|_| match rng.bool() {
                true => random_brush(&mut rng, &ground),
                false => random_brush_at_a_face(&mut rng, &ground, chunk_size),
            })
            .collect();
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        let mut known: BTreeSet<FieldId> = BTreeSet::new();
        for batch in brushes.chunks(rng.usize(1..8)) {
            let before: BTreeSet<FieldId> = terrain
                .world()
                .fields()
                .flat_map(|(_, fields)| fields.iter().map(|f| f.id).collect::<Vec<_>>())
                .collect();
            for receipt in terrain.apply(batch) {
                for part in receipt.outcome.iter().flat_map(|applied| &applied.chunks) {
                    match part.scenario {
                        Scenario::Created => {
                            assert!(known.insert(part.field), "seed {seed}: a field id is used again")
                        }
                        Scenario::Merged { fields } => {
                            assert!(fields >= 2);
                            merges += 1;
                        }
                        Scenario::Changed | Scenario::Extended => {
                            assert!(known.contains(&part.field), "seed {seed}: {part:?} was never created");
                        }
                    }
                }
            }
            check_laws(terrain.world(), &format!("seed {seed}, chunks of {chunk_size}"));
            let after: BTreeSet<FieldId> = terrain
                .world()
                .fields()
                .flat_map(|(_, fields)| fields.iter().map(|f| f.id).collect::<Vec<_>>())
                .collect();
            assert!(after.iter().all(|id| before.contains(id) || known.contains(id)));
        }
    }
    println!("{merges} merges");
    assert!(merges > 50, "the edits are not varied enough");
}

#[test]
fn the_field_events_of_a_commit_are_the_difference_of_its_fields() {
    use bevy_burrow::terrain::FieldChange;
    use std::collections::BTreeMap;

    let fields = |world: &World| -> BTreeMap<FieldId, (ChunkPos, bevy_burrow::volume::Field)> {
        world
            .fields()
            .flat_map(|(chunk, f)| f.iter().map(|&f| (f.id, (chunk, f))).collect::<Vec<_>>())
            .collect()
    };
    for seed in 0..60 {
        let mut rng = Rng::with_seed(9000 + seed);
        let (ground, chunk_size) = random_ground(&mut rng, seed % 2);
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let brushes: Vec<Brush> =
            (0..24).map(|_| random_brush_at_a_face(&mut rng, &ground, chunk_size)).collect();
        let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
        for batch in brushes.chunks(rng.usize(1..6)) {
            for brush in batch {
                terrain.submit(brush);
            }
            let before = fields(terrain.world());
            let commit = terrain.begin().expect("queued edits").run();
            let news = commit.field_news().to_vec();
            terrain.commit(commit).expect("no other commit");
            let after = fields(terrain.world());
            let mut named = BTreeSet::new();
            for (chunk, news) in news {
                let id = match news {
                    FieldChange::Created(id) => {
                        assert!(!before.contains_key(&id) && after.get(&id).is_some_and(|f| f.0 == chunk));
                        id
                    }
                    FieldChange::Changed(id) => {
                        assert!(before.contains_key(&id) && after.get(&id).is_some_and(|f| f.0 == chunk));
                        id
                    }
                    FieldChange::Merged { gone, into } => {
                        assert!(
                            before.get(&gone).is_some_and(|f| f.0 == chunk) && !after.contains_key(&gone)
                        );
                        assert!(
                            after.get(&into).is_some_and(|f| f.0 == chunk),
                            "seed {seed}: merged into {into:?}, which no longer exists"
                        );
                        gone
                    }
                    FieldChange::Removed(id) => {
                        panic!("seed {seed}: {id:?} was removed, but nothing was undone")
                    }
                };
                assert!(named.insert(id), "seed {seed}: {id:?} is reported twice");
            }
            let differs = |id: &&FieldId| before.get(id) != after.get(id);
            let expected: BTreeSet<FieldId> =
                before.keys().chain(after.keys()).filter(differs).copied().collect();
            assert_eq!(named, expected, "seed {seed}");
        }
    }
}

#[test]
fn a_chain_of_merges_reports_the_surviving_field() {
    use bevy_burrow::terrain::FieldChange;

    let mut terrain = level(64, 1, 10);
    let pit = |x| ball(x, 10, 30, 2.0);
    let trench = |from: f32, to: f32| {
        Brush::dig(Shape::capsule(Vec3::new(from, 10.0, 30.0), Vec3::new(to, 10.0, 30.0), 2.0))
    };
    let [a, b, c] = [8, 28, 48].map(|x| dig(&mut terrain, pit(x)).chunks[0].field);
    // In one transaction, b absorbs c, then a absorbs b.
    terrain.submit(trench(28.0, 48.0));
    terrain.submit(trench(8.0, 28.0));
    let commit = terrain.begin().expect("queued edits").run();
    let news: Vec<FieldChange> = commit.field_news().iter().map(|&(_, news)| news).collect();
    terrain.commit(commit).expect("no other commit");
    let expected = [
        FieldChange::Changed(a),
        FieldChange::Merged { gone: b, into: a },
        FieldChange::Merged { gone: c, into: a },
    ];
    assert!(
        news.len() == 3 && expected.iter().all(|line| news.contains(line)),
        "`into` names the field that holds the merged data after the commit: {news:?}"
    );
}
