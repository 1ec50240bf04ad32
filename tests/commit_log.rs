//! The commit log, and terrains from what was saved: replayed records, restored parts and replaced parts lead to the
//! same world. `BURROW_WORLDS` is the number of random worlds.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::lattice::BrickPos;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{
    CommitRecord, MeshKey, Meshing, PartsError, Patch, ReplayError, RestoreError, World,
};
use bevy_burrow::volume::Brick;
use fastrand::Rng;
use glam::{IVec3, Vec3};

mod worlds;

use worlds::{any_random_brush, change_towards, random_ground, world_count};

/// Bytes that no test's log exceeds.
const PLENTY: usize = 1 << 30;

fn settings(chunk_size: u32) -> TerrainSettings {
    TerrainSettings { chunk_size, ..TerrainSettings::default() }
}

/// Edits, steps, rules and settings of loose pieces at random, with a log.
fn play(terrain: &mut Terrain, rng: &mut Rng, commits: usize) {
    for _ in 0..commits {
        match rng.u32(0..10) {
            0 => drop(terrain.undo()),
            1 => drop(terrain.redo()),
            2 => {
                let rules = DiggingRules::default().with_unbreakable(MaterialId(rng.u8(0..4)));
                let rules = if rng.bool() { rules } else { DiggingRules::default() };
                terrain.set_rules(rules).expect("valid rules");
            }
            3 => {
                let loose = LooseSettings { largest: 4096, crumbs: rng.u32(0..40), debris: rng.u32(0..400) };
                terrain.set_loose(rng.bool().then_some(loose));
            }
            _ => {
                let brushes: Vec<Brush> =
                    (0..rng.usize(1..4)).map(|_| any_random_brush(rng, terrain.world().ground())).collect();
                brushes.iter().for_each(|brush| terrain.submit(brush));
                // Rules that come while edits wait bind later ones only.
                if rng.u8(..6) == 0 {
                    let rules = DiggingRules::default().with_unbreakable(MaterialId(rng.u8(0..4)));
                    terrain.set_rules(rules).expect("valid rules");
                }
                terrain.apply([any_random_brush(rng, terrain.world().ground())]);
            }
        }
    }
}

/// All that a save must bring back.
fn state(terrain: &Terrain) -> impl PartialEq + std::fmt::Debug + use<> {
    let world = terrain.world();
    let fields: BTreeMap<_, Vec<_>> =
        world.fields().map(|(chunk, fields)| (chunk, fields.iter().copied().collect())).collect();
    let mut mask: Vec<_> = world.mask().iter().map(|cell| (cell.x, cell.z)).collect();
    mask.sort_unstable();
    let next = terrain.parts().change.next_field;
    let rules = terrain.rules().cloned();
    (world.hash(), world.revision(), fields, mask, next, rules, terrain.loose().copied())
}

/// Everything that is drawn; chunks that turn out to draw nothing are left out.
fn meshes(world: &World) -> BTreeMap<MeshKey, bevy_burrow::surface::SurfaceMesh> {
    world.drawn().filter(|(_, mesh)| !mesh.is_empty()).collect()
}

#[test]
fn a_log_replays_to_the_same_world_and_parts_restore_it() {
    for index in 0..world_count(24) {
        let mut rng = Rng::with_seed(index + 26);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let ground = Arc::new(ground);
        let mut terrain = Terrain::new(Arc::clone(&ground), &settings(chunk_size)).expect("valid");
        terrain.keep_log(Some(PLENTY));
        play(&mut terrain, &mut rng, 14);
        let records = terrain.take_log();
        assert!(!terrain.has_log());

        // Commits follow each other without a gap.
        let commits: Vec<u64> = records.iter().map(|record| record.revision).collect();
        assert!(commits.windows(2).all(|pair| pair[1] == pair[0] || pair[1] == pair[0] + 1), "{commits:?}");
        assert_eq!(commits.last().copied().unwrap_or_default(), terrain.world().revision());

        let mut replayed = Terrain::new(Arc::clone(&ground), &settings(chunk_size)).expect("valid");
        replayed.set_meshing(if rng.bool() { Meshing::Never } else { Meshing::All });
        for record in &records {
            replayed.replay(record).unwrap_or_else(|why| panic!("world {index}: {why}"));
        }
        assert_eq!(state(&replayed), state(&terrain), "world {index}");

        let restored = Terrain::restore(Arc::clone(&ground), &settings(chunk_size), terrain.parts());
        let restored = restored.unwrap_or_else(|why| panic!("world {index}: {why}"));
        assert_eq!(state(&restored), state(&terrain), "world {index}");
        for other in [&replayed, &restored] {
            assert!(meshes(other.world()) == meshes(terrain.world()), "world {index}");
        }

        // The bricks of the records, laid one over the other, are those of the world.
        let mut bricks: BTreeMap<BrickPos, Arc<Brick>> = BTreeMap::new();
        for (pos, brick) in records.iter().flat_map(|record| &record.change.bricks) {
            match brick {
                Some(brick) => bricks.insert(*pos, Arc::clone(brick)),
                None => bricks.remove(pos),
            };
        }
        let stored: BTreeMap<BrickPos, *const Brick> =
            terrain.world().bricks().map(|(pos, brick)| (pos, std::ptr::from_ref(brick))).collect();
        let laid: BTreeMap<BrickPos, *const Brick> =
            bricks.iter().map(|(pos, brick)| (*pos, Arc::as_ptr(brick))).collect();
        assert_eq!(laid, stored, "world {index}");
    }
}

#[test]
fn a_restored_world_continues_as_the_original() {
    for index in 0..world_count(16) {
        let mut rng = Rng::with_seed(index + 260);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let ground = Arc::new(ground);
        let mut terrain = Terrain::new(Arc::clone(&ground), &settings(chunk_size)).expect("valid");
        play(&mut terrain, &mut rng, 6);
        let restored = Terrain::restore(Arc::clone(&ground), &settings(chunk_size), terrain.parts());
        let mut restored = restored.expect("its own parts");
        terrain.clear_history();
        for round in 0..6 {
            let seed = rng.u64(..);
            for own in [&mut terrain, &mut restored] {
                play(own, &mut Rng::with_seed(seed), 1);
            }
            assert_eq!(state(&restored), state(&terrain), "world {index}, round {round}");
            assert!(meshes(restored.world()) == meshes(terrain.world()), "world {index}, round {round}");
        }
        assert!(restored.world().check_seams().is_flawless(), "world {index}");
    }
}

#[test]
fn a_world_can_be_put_in_place_of_another() {
    for index in 0..world_count(16) {
        let mut rng = Rng::with_seed(index + 2600);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let ground = Arc::new(ground);
        let mut terrains = [(); 2].map(|()| {
            let mut terrain = Terrain::new(Arc::clone(&ground), &settings(chunk_size)).expect("valid");
            play(&mut terrain, &mut rng, 5);
            terrain
        });
        let [from, to] = &mut terrains;
        let change = change_towards(to, &from.parts());
        let before = (to.world().hash(), meshes(to.world()));
        let hash = from.world().hash();
        if hash != before.0 {
            let wrong = to.apply_one(Order::parts(change.clone(), Some(hash ^ 1))).outcome;
            assert!(
                matches!(wrong, Err(Rejection::Parts(PartsError::Hash { found, .. })) if found == hash),
                "{wrong:?}"
            );
            assert!((to.world().hash(), meshes(to.world())) == before, "world {index}");
        }
        to.apply_one(Order::parts(change, Some(hash)))
            .outcome
            .unwrap_or_else(|why| panic!("world {index}: {why}"));
        assert!(meshes(to.world()) == meshes(from.world()), "world {index}");
        assert!(to.world().check_seams().is_flawless(), "world {index}");
        assert_eq!(to.history(), History::default());
        let mask = |terrain: &Terrain| {
            let mut cells: Vec<_> = terrain.world().mask().iter().map(|cell| (cell.x, cell.z)).collect();
            cells.sort_unstable();
            cells
        };
        assert_eq!(mask(to), mask(from), "world {index}");
    }
}

#[test]
fn hashes_of_regions_add_up_to_that_of_the_world() {
    for index in 0..world_count(16) {
        let mut rng = Rng::with_seed(index + 7);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let mut terrain = Terrain::new(ground, &settings(chunk_size)).expect("valid");
        play(&mut terrain, &mut rng, 6);
        let world = terrain.world();
        let sum = world.regions().map(|region| world.region_hash(region)).fold(0, u64::wrapping_add);
        assert_eq!(World::hash_of(world.ground().hash(), sum), world.hash(), "world {index}");
        let bricks: usize = world.regions().map(|region| world.bricks_in(region).count()).sum();
        assert_eq!(bricks, world.bricks().count(), "world {index}");
    }
}

#[test]
fn another_chunk_size_keeps_the_hash_and_has_fields_everywhere() {
    let mut rng = Rng::with_seed(3);
    let (ground, _) = random_ground(&mut rng, 1);
    let ground = Arc::new(ground);
    let mut terrain = Terrain::new(Arc::clone(&ground), &settings(25)).expect("valid");
    play(&mut terrain, &mut rng, 9);
    let restored = Terrain::restore(ground, &settings(16), terrain.parts()).expect("valid parts");
    assert_eq!(restored.world().hash(), terrain.world().hash());
    let (world, grid) = (restored.world(), restored.world().grid());
    for (pos, brick) in world.bricks() {
        for (point, ..) in brick.edited_samples(pos) {
            let fields = world.fields_of(grid.chunk_of(point)).expect("the chunk has fields");
            assert!(fields.iter().any(|field| field.bounds.contains(point)), "{point}");
        }
    }
    assert!(restored.world().check_seams().is_flawless());
}

fn flat() -> Terrain {
    let ground = Ground::flat(64, 64, 10.0).expect("valid");
    Terrain::new(ground, &TerrainSettings::default()).expect("valid")
}

fn dig(x: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 10.0, 32.0), 4.0))
}

#[test]
fn a_log_that_is_never_taken_is_bounded_and_shows_its_gap() {
    let mut terrain = flat();
    terrain.keep_log(Some(100_000));
    (0..200).for_each(|number| drop(terrain.apply([dig(number as f32 / 4.0)])));
    let records = terrain.take_log();
    assert!((1..100).contains(&records.len()), "{}", records.len());
    let first = records[0].revision;
    assert!(first > 1);
    assert!(records.iter().zip(first..).all(|(record, revision)| record.revision == revision));
    assert_eq!(records.last().map(|record| record.revision), Some(200));
    terrain.keep_log(None);
    terrain.apply([dig(3.0)]);
    assert!(!terrain.has_log());
}

#[test]
fn rules_are_logged_where_they_bind() {
    let mut terrain = flat();
    terrain.keep_log(Some(PLENTY));
    let rules = || DiggingRules::default().with_unbreakable(MaterialId(0));
    terrain.submit(dig(20.0));
    terrain.set_rules(rules()).expect("valid");
    terrain.submit(dig(30.0));
    terrain.apply::<Brush>([]);
    terrain.set_rules(DiggingRules::default()).expect("valid");
    let kinds: Vec<Vec<&str>> = terrain.take_log().iter().map(|record| kinds_of(record)).collect();
    // At first nothing is known of the rules; the last record has no commit.
    assert_eq!(kinds, [vec!["no rules", "loose"], vec!["edit", "rules", "edit"], vec!["no rules"]]);
}

fn kinds_of(record: &CommitRecord) -> Vec<&'static str> {
    let kind = |order: &Order| match order {
        Order::Rules(None) => "no rules",
        Order::Rules(Some(_)) => "rules",
        Order::Loose(_) => "loose",
        Order::Edit(_) => "edit",
        _ => "change",
    };
    record.orders.iter().map(kind).collect()
}

#[test]
fn an_undo_is_recorded_as_parts_that_share_the_change() {
    let mut terrain = flat();
    terrain.keep_log(Some(PLENTY));
    terrain.apply([dig(20.0)]);
    terrain.undo();
    // It lies outside the world.
    terrain.apply([dig(-900.0)]);
    let records = terrain.take_log();
    let [.., undone, rejected] = &records[..] else { panic!("{records:?}") };
    let [Order::Parts { change, hash }] = &undone.orders[..] else { panic!("{:?}", undone.orders) };
    assert!(Arc::ptr_eq(change, &undone.change) && !change.is_empty());
    assert_eq!(*hash, Some(undone.hash));
    assert!(rejected.orders.is_empty() && rejected.is_commit() && !rejected.has_change());
}

#[test]
fn a_record_that_does_not_fit_is_an_error() {
    let mut terrain = flat();
    terrain.keep_log(Some(PLENTY));
    terrain.apply([dig(20.0)]);
    terrain.apply([dig(30.0)]);
    let records: Vec<CommitRecord> = terrain.take_log();
    let mut other = flat();
    assert_eq!(other.replay(&records[2]).err(), Some(ReplayError::Revision { at: 0, found: 2 }));
    let wrong = CommitRecord { hash: records[1].hash ^ 1, ..records[1].clone() };
    assert!(matches!(other.replay(&wrong), Err(ReplayError::Hash { revision: 1, .. })));
}

#[test]
fn parts_that_do_not_fit_are_errors_and_change_nothing() {
    let mut terrain = flat();
    terrain.apply([dig(20.0)]);
    let (parts, hash) = (terrain.parts(), terrain.world().hash());
    let twice = Patch {
        bricks: parts.change.bricks.iter().take(1).cycle().take(2).cloned().collect(),
        ..Patch::default()
    };
    assert!(matches!(
        terrain.apply_one(Order::parts(twice, None)).outcome,
        Err(Rejection::Parts(PartsError::Unsorted(_)))
    ));
    let far = BrickPos(IVec3::new(400, 1, 3));
    let outside = Patch { bricks: vec![(far, parts.change.bricks[0].1.clone())], ..Patch::default() };
    assert_eq!(
        terrain.apply_one(Order::parts(outside, None)).outcome,
        Err(PartsError::OutsideWorld(far).into())
    );
    let higher = Arc::new(Ground::flat(64, 64, 11.0).expect("valid"));
    let restored = Terrain::restore(higher, &TerrainSettings::default(), parts);
    assert!(matches!(restored, Err(RestoreError::Parts(PartsError::OtherGround(_)))));
    assert_eq!(terrain.world().hash(), hash);
}

#[test]
fn nothing_is_meshed_that_nobody_asks_for() {
    let mut server = flat();
    server.set_meshing(Meshing::Never);
    let mut shown = flat();
    for x in [10.0, 20.0, 40.0] {
        server.apply([dig(x)]);
        shown.apply([dig(x)]);
    }
    let memory = server.world().memory();
    assert_eq!(memory.meshes, 0);
    assert!(meshes(server.world()) == meshes(shown.world()));
    assert!(server.world().check_seams().is_flawless());
    // Meshing again begins with what is dug next.
    server.set_meshing(Meshing::All);
    for own in [&mut server, &mut shown] {
        own.apply([dig(22.0)]);
    }
    assert!(server.world().memory().meshes > 0);
    assert!(meshes(server.world()) == meshes(shown.world()));
}

#[test]
fn a_piece_that_broke_off_comes_back_from_a_save() {
    let mut terrain = flat();
    terrain.set_loose(Some(LooseSettings { largest: 4096, crumbs: 0, debris: 4096 }));
    let place = Vec3::new(32.0, 20.0, 32.0);
    terrain.apply([Brush::add(Shape::cuboid(place, Vec3::new(3.0, 12.0, 3.0)), MaterialId(2))]);
    let receipts = terrain.apply([Brush::dig(Shape::cuboid(place.with_y(14.0), Vec3::new(6.0, 2.0, 6.0)))]);
    let piece = &receipts[0].outcome.as_ref().expect("applied").loose[0];
    assert!(piece.mesh.is_some());
    let json = serde_json::to_string(piece).expect("it can be saved");
    assert_eq!(serde_json::from_str::<LoosePiece>(&json).expect("it can be read"), *piece);
    // No triangle may point beyond the vertices.
    let vertices = piece.mesh.as_ref().map_or(0, |mesh| mesh.vertices.len());
    let broken = json.replacen("\"indices\":[", &format!("\"indices\":[{vertices},0,0,"), 1);
    assert!(serde_json::from_str::<LoosePiece>(&broken).is_err());
}

/// If this fails, the same edits no longer give the same world: raise [`Terrain::SIMULATION`] and enter the new hash.
#[test]
fn the_simulation_has_its_number() {
    let mut rng = Rng::with_seed(1);
    let ground = Ground::from_fn(96, 96, |x, z| f64::from((x * 7 + z * 3) % 23) / 2.0).expect("valid");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    terrain.set_loose(Some(LooseSettings { crumbs: 50, ..LooseSettings::default() }));
    for _ in 0..40 {
        terrain.apply([any_random_brush(&mut rng, terrain.world().ground())]);
    }
    assert_eq!((Terrain::SIMULATION, terrain.world().hash()), (2, 0x66078FB9F192FA79));
}
