//! A log that loses records never looks whole, and one that loses none is whole: whatever is submitted, begun, given
//! up, taken or held meanwhile. `BURROW_WORLDS` is the number of random sequences.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::lattice::BrickPos;
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{
    CommitRecord, MeshKey, Meshing, ReplayError, Transaction, WorkLimits, WorldParts,
};
use fastrand::Rng;
use glam::Vec3;

mod worlds;

use worlds::{any_random_brush, change_towards, random_ground, world_count};

const PLENTY: usize = 1 << 30;

fn flat() -> Terrain {
    let ground = Ground::flat(64, 64, 10.0).expect("valid");
    Terrain::new(ground, &TerrainSettings::default()).expect("valid")
}

fn dig(x: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 10.0, 32.0), 4.0))
}

fn rules() -> DiggingRules {
    DiggingRules::default().with_unbreakable(MaterialId(0))
}

/// Returns `true` if a record follows a revision, as seen by a reader of the log.
fn follows(record: &CommitRecord, at: u64) -> bool {
    record.revision == at || record.revision == at + 1
}

/// Returns `true` if it is a commit, and not only a change of rules and settings.
fn is_commit(record: &CommitRecord) -> bool {
    let of_commit = |order: &Order| matches!(order, Order::Edit(_) | Order::Parts { .. });
    record.orders.is_empty() || record.orders.iter().any(of_commit)
}

#[test]
fn a_log_that_lost_records_never_looks_whole() {
    // Limits under which it keeps nothing, records of rules only, a commit or some.
    for limit in [0, 100, 300, 600, 1000, 3000, 12_000, 30_000, 60_000, 100_000] {
        for seed in 0..60 {
            let mut rng = Rng::with_seed(seed);
            let mut terrain = flat();
            terrain.keep_log(Some(limit));
            let mut follower = flat();
            for _ in 0..24 {
                match rng.u32(0..8) {
                    0 => terrain.set_rules(rules()).expect("valid"),
                    1 => terrain.set_rules(DiggingRules::default()).expect("valid"),
                    2 => terrain.set_loose(rng.bool().then(LooseSettings::default)),
                    3 => drop(terrain.undo()),
                    4 => {}
                    _ => drop(terrain.apply([dig(rng.f32() * 64.0)])),
                }
                if rng.u32(0..4) > 0 {
                    continue;
                }
                let records = terrain.take_log();
                let mut at = follower.world().revision();
                let is_whole = records.iter().all(|record| {
                    let is_next = follows(record, at);
                    at = record.revision;
                    is_next
                });
                if !is_whole || at != terrain.world().revision() {
                    let (ground, parts) = (Ground::flat(64, 64, 10.0).expect("valid"), terrain.parts());
                    follower = Terrain::restore(ground, &TerrainSettings::default(), parts).expect("valid");
                    continue;
                }
                for record in &records {
                    let what = format!("limit {limit}, seed {seed}");
                    assert_eq!(
                        is_commit(record),
                        record.revision == follower.world().revision() + 1,
                        "{what}"
                    );
                    follower.replay(record).unwrap_or_else(|why| panic!("{what}: {why}"));
                }
                assert_eq!(follower.world().hash(), terrain.world().hash());
                if !records.is_empty() {
                    assert_eq!(follower.rules(), terrain.rules(), "limit {limit}, seed {seed}");
                    assert_eq!(follower.loose(), terrain.loose());
                }
            }
        }
    }
}

#[test]
fn a_lower_limit_holds_at_once() {
    let mut terrain = flat();
    terrain.keep_log(Some(PLENTY));
    (0..50).for_each(|number| drop(terrain.apply([dig(number as f32)])));
    terrain.keep_log(Some(40_000));
    assert!((1..40).contains(&terrain.take_log().len()));
}

#[test]
fn rules_are_logged_once_nothing_waits_even_if_that_was_a_step_without_effect() {
    let mut terrain = flat();
    terrain.keep_log(Some(PLENTY));
    drop(terrain.take_log());
    terrain.submit(Order::Undo);
    terrain.set_rules(rules()).expect("valid");
    assert!(terrain.begin().is_none());
    let records = terrain.take_log();
    assert!(matches!(&records[..], [record] if matches!(record.orders[..], [Order::Rules(Some(_))])));
}

#[test]
fn a_record_is_replayed_at_once_even_while_a_transaction_is_under_way() {
    let mut leader = flat();
    leader.keep_log(Some(PLENTY));
    leader.submit(dig(12.0));
    leader.apply([dig(20.0)]);
    let records = leader.take_log();
    let mut follower = flat();
    follower.submit(dig(12.0));
    let lost = follower.begin().expect("it waits");
    let last = records.last().expect("a commit");
    // What waits comes first, and makes it another world.
    assert!(matches!(follower.replay(last), Err(ReplayError::Revision { at: 1, found: 1 })));
    assert!(!follower.is_busy());
    assert!(follower.commit(lost.run()).is_err());
}

#[test]
fn what_is_replayed_is_logged_like_what_it_was() {
    let mut leader = flat();
    leader.keep_log(Some(PLENTY));
    leader.apply([dig(20.0)]);
    // One whose edits were all rejected.
    leader.apply([dig(-900.0)]);
    leader.set_rules(rules()).expect("valid");
    leader.undo();
    leader.apply([dig(30.0), dig(-900.0), dig(34.0)]);
    let mut follower = flat();
    follower.keep_log(Some(PLENTY));
    for record in &leader.take_log() {
        follower.replay(record).expect("its own");
    }
    let of = |record: &CommitRecord| (record.revision, record.hash, is_commit(record));
    let expected = [(0, false), (1, true), (2, true), (2, false), (3, true), (4, true)];
    let found: Vec<(u64, bool)> =
        follower.take_log().iter().map(of).map(|(revision, _, is_commit)| (revision, is_commit)).collect();
    assert_eq!(found, expected);
    assert_eq!(follower.world().hash(), leader.world().hash());
}

#[test]
fn a_record_that_makes_more_than_one_commit_is_told() {
    let mut leader = flat();
    leader.keep_log(Some(PLENTY));
    leader.apply([dig(20.0)]);
    let mut record = leader.take_log().pop().expect("a commit");
    record.orders.push(Order::parts(Arc::clone(&record.change), Some(record.hash)));
    assert!(matches!(flat().replay(&record), Err(ReplayError::Revision { .. })));
}

/// What is held meanwhile.
#[derive(Default)]
struct Held {
    transaction: Option<Transaction>,
    stale: Vec<Transaction>,
    snapshots: Vec<Arc<bevy_burrow::terrain::World>>,
    saved: Vec<WorldParts>,
}

/// One random thing that a game may do.
fn act(terrain: &mut Terrain, rng: &mut Rng, held: &mut Held) {
    match rng.u32(0..24) {
        0 => terrain.submit(Order::Undo),
        1 => terrain.submit(Order::Redo),
        2 => terrain.set_rules(if rng.bool() { rules() } else { DiggingRules::default() }).expect("valid"),
        3 => {
            let loose = LooseSettings { largest: 4096, crumbs: rng.u32(0..40), debris: rng.u32(0..400) };
            terrain.set_loose(rng.bool().then_some(loose));
        }
        4 => {
            let transaction = rng.u64(1..400);
            terrain.set_work_limits(WorkLimits { transaction, ..WorkLimits::default() });
        }
        5 => held.snapshots.push(terrain.snapshot()),
        6 => held.snapshots.clear(),
        7 => held.saved.push(terrain.parts()),
        8 if !held.saved.is_empty() => {
            let parts = &held.saved[rng.usize(0..held.saved.len())];
            let change = change_towards(terrain, parts);
            // Edits that wait change the world in between.
            terrain.submit(Order::parts(change, None));
        }
        9 => terrain.abandon(),
        10 => terrain.set_meshing(if rng.bool() { Meshing::Never } else { Meshing::All }),
        11 => terrain.set_undo_budget(rng.usize(0..200_000)),
        12 => terrain.submit(dig(-900.0)),
        13 => {
            for stale in held.stale.drain(..) {
                // The work was queued again, and so may even be under way.
                assert!(terrain.commit(stale.run()).is_err());
            }
        }
        14 | 15 => {
            if let Some(transaction) = terrain.begin() {
                held.stale.extend(held.transaction.replace(transaction));
            }
        }
        16..=18 => {
            if let Some(transaction) = held.transaction.take() {
                drop(terrain.commit(transaction.run()));
            }
        }
        19 => drop(terrain.apply([any_random_brush(rng, terrain.world().ground())])),
        _ => {
            let brush = any_random_brush(rng, terrain.world().ground());
            let stroke = if rng.bool() { brush.with_stroke(rng.u64(1..3)) } else { brush };
            terrain.submit(&stroke);
        }
    }
}

#[test]
fn whatever_a_game_does_its_log_replays() {
    for index in 0..world_count(60) {
        let mut rng = Rng::with_seed(index ^ 0x1065);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let (ground, settings) =
            (Arc::new(ground), TerrainSettings { chunk_size, ..TerrainSettings::default() });
        let mut terrain = Terrain::new(Arc::clone(&ground), &settings).expect("valid");
        terrain.keep_log(Some(PLENTY));
        let mut held = Held::default();
        (0..rng.usize(10..60)).for_each(|_| act(&mut terrain, &mut rng, &mut held));
        terrain.apply::<Brush>([]);
        let records = terrain.take_log();
        let mut replayed = Terrain::new(Arc::clone(&ground), &settings).expect("valid");
        let mut bricks: BTreeMap<BrickPos, u64> = BTreeMap::new();
        for record in &records {
            replayed.replay(record).unwrap_or_else(|why| panic!("world {index}: {why}"));
            for (pos, brick) in &record.change.bricks {
                bricks.remove(pos);
                bricks.extend(brick.iter().map(|brick| (*pos, Arc::as_ptr(brick) as u64)));
            }
        }
        let (own, other) = (terrain.parts(), replayed.parts());
        assert_eq!((own.revision, &own.edit_settings), (other.revision, &other.edit_settings));
        assert_eq!(own.change.fields, other.change.fields, "world {index}");
        assert_eq!(own.change.next_field, other.change.next_field, "world {index}");
        let stored: BTreeMap<BrickPos, u64> = own
            .change
            .bricks
            .iter()
            .flat_map(|(pos, brick)| brick.iter().map(move |brick| (*pos, Arc::as_ptr(brick) as u64)))
            .collect();
        assert!(bricks == stored, "world {index}");
        let restored = Terrain::restore(Arc::clone(&ground), &settings, own).expect("its own parts");
        assert!(meshes(&terrain) == meshes(&replayed), "world {index}");
        assert!(meshes(&terrain) == meshes(&restored), "world {index}");
        assert!(restored.world().mask().iter().all(|cell| terrain.world().mask().contains(cell)));
        assert!(terrain.world().check_seams().is_flawless(), "world {index}");
    }
}

#[test]
fn edits_at_the_worlds_ends_come_back() {
    let limit = bevy_burrow::lattice::LIMIT as f32;
    for (index, chunk_size) in [8, 12, 25, 32, 100].into_iter().enumerate() {
        for (width, depth) in [(64, 40), (61, 33), (8, 9)] {
            let height = |x: i32, z: i32| f64::from((x * 5 + z * 11) % 17);
            let ground = Arc::new(Ground::from_fn(width, depth, height).expect("valid heights"));
            let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
            let mut terrain = Terrain::new(Arc::clone(&ground), &settings).expect("valid");
            terrain.keep_log(Some(PLENTY));
            let (w, d) = (width as f32, depth as f32);
            let corners = [(0.0, 0.0), (w, d), (w, 0.0), (0.0, d), (w, d / 2.0), (w / 2.0, d)];
            for (x, z) in corners {
                for y in [8.0, limit - 2.0, -limit + 2.0, limit, -limit] {
                    let at = Vec3::new(x, y, z);
                    terrain.apply([Brush::add(Shape::sphere(at, 5.0), MaterialId(1))]);
                    terrain.apply([Brush::dig(Shape::sphere(at, 3.0))]);
                }
            }
            let what = format!("chunks of {chunk_size} over {width} x {depth}");
            let seed = index as u64;
            for meshing in [Meshing::All, Meshing::Never] {
                let mut replayed = Terrain::new(Arc::clone(&ground), &settings).expect("valid");
                replayed.set_meshing(meshing);
                let mut restored =
                    Terrain::restore(Arc::clone(&ground), &settings, terrain.parts()).expect("its own parts");
                restored.set_meshing(meshing);
                if meshing == Meshing::All {
                    terrain
                        .take_log()
                        .iter()
                        .for_each(|record| drop(replayed.replay(record).expect("its own")));
                    assert!(meshes(&replayed) == meshes(&terrain), "{what}");
                }
                assert!(meshes(&restored) == meshes(&terrain), "{what}");
                let again = any_random_brush(&mut Rng::with_seed(seed), &ground);
                restored.apply([again.clone()]);
                let mut goes_on =
                    Terrain::restore(Arc::clone(&ground), &settings, terrain.parts()).expect("valid");
                goes_on.set_meshing(Meshing::Never);
                goes_on.apply([again]);
                assert!(meshes(&restored) == meshes(&goes_on), "{what}");
            }
        }
    }
}

/// Everything that is drawn.
fn meshes(terrain: &Terrain) -> Vec<(MeshKey, SurfaceMesh)> {
    terrain.world().drawn().filter(|(_, mesh)| !mesh.is_empty()).collect()
}
