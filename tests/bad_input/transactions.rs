//! Transactions that are cancelled, stale, overtaken or committed to another terrain.

use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::Vec3;

use crate::terrains::{assert_flawless, small_terrain, terrain};
use crate::worlds::{random_brush, random_brush_at_a_face, random_ground};

#[test]
fn a_stale_commit_is_refused_and_loses_nothing() {
    let dig = |x: f32, tag: u64| Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 6.0), 2.0)).with_tag(tag);
    let expected = {
        let mut terrain = small_terrain();
        terrain.apply([dig(3.0, 1), dig(7.0, 2), dig(11.0, 3)]);
        terrain.world().hash()
    };

    // Edits that are applied at once overtake a running transaction. It is then run again together with them.
    let mut terrain = small_terrain();
    terrain.submit(dig(3.0, 1));
    let stale = terrain.begin().expect("a queued edit").run();
    terrain.submit(dig(7.0, 2));
    let receipts = terrain.apply([dig(11.0, 3)]);
    assert_eq!(receipts.iter().map(|receipt| receipt.tag).collect::<Vec<_>>(), [3]);
    assert_eq!(terrain.world().hash(), expected, "running and queued edits were applied as well");
    let before = terrain.snapshot();
    terrain.commit(stale).expect_err("the world has changed since");
    assert_eq!((terrain.world().hash(), terrain.world().revision()), (before.hash(), before.revision()));
    assert!(!terrain.is_busy() && terrain.queued() == 0);
    assert_flawless(&terrain, "after a stale commit");
}

#[test]
fn a_cancelled_transaction_is_not_committed_with_its_successor() {
    let dig = |x: f32, tag: u64| Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 6.0), 2.0)).with_tag(tag);
    let mut terrain = small_terrain();
    terrain.submit(dig(3.0, 1));
    let first = terrain.begin().expect("a queued edit");
    // Its task seems lost, so it is cancelled and run again together with the edits sent since.
    terrain.abandon();
    terrain.submit(dig(11.0, 2));
    let second = terrain.begin().expect("queued edits");
    assert_eq!(second.len(), 2);
    // The lost transaction finishes after all.
    let late = terrain.commit(first.run()).map_or(0, |receipts| receipts.len());
    let receipts = terrain.commit(second.run()).map_or(0, |receipts| receipts.len());
    let rest = terrain
        .begin()
        .map(|rest| rest.run())
        .and_then(|rest| terrain.commit(rest).ok())
        .map_or(0, |r| r.len());
    assert_eq!(late + receipts + rest, 2, "each brush gets exactly one receipt");
    let expected = {
        let mut terrain = small_terrain();
        terrain.apply([dig(3.0, 1), dig(11.0, 2)]);
        terrain.world().hash()
    };
    assert_eq!(terrain.world().hash(), expected, "an edit was lost");
}

#[test]
fn a_commit_of_another_terrain_is_refused() {
    let mut one = small_terrain();
    let mut other = terrain(Ground::flat(30, 30, 2.0).expect("finite heights"), 25);
    one.submit(Brush::dig(Shape::sphere(Vec3::new(6.0, 5.0, 6.0), 2.0)));
    other.submit(Brush::dig(Shape::sphere(Vec3::new(20.0, 2.0, 20.0), 2.0)));
    let commit = other.begin().expect("a queued edit").run();
    let before = one.world().hash();
    assert!(one.commit(commit).is_err(), "samples of a world of 30 x 30 cells went into one of 14 x 12");
    assert_eq!(one.world().hash(), before);
}

#[test]
fn cancelled_edits_are_queued_again_in_order() {
    let mut terrain = small_terrain();
    let tags = |terrain: &mut Terrain| -> Vec<u64> {
        let transaction = terrain.begin().expect("queued edits");
        let receipts = terrain.commit(transaction.run()).expect("no other commit");
        receipts.iter().map(|receipt| receipt.tag).collect()
    };
    let brush = |tag: u64| Brush::dig(Shape::sphere(Vec3::new(tag as f32, 8.0, 6.0), 1.5)).with_tag(tag);
    assert!(terrain.begin().is_none(), "nothing is queued");
    terrain.abandon();
    assert_eq!(terrain.queued(), 0, "no transaction was running");

    for tag in 0..3 {
        terrain.submit(brush(tag));
    }
    let lost = terrain.begin().expect("queued edits");
    assert!(terrain.is_busy() && terrain.queued() == 0);
    for tag in 3..5 {
        terrain.submit(brush(tag));
    }
    assert!(terrain.begin().is_none(), "one at a time");
    assert_eq!(terrain.queued(), 2);
    // The task is dropped together with its transaction.
    drop(lost);
    assert!(terrain.is_busy(), "the terrain still counts it as running");
    terrain.abandon();
    assert!(!terrain.is_busy());
    assert_eq!(terrain.queued(), 5);
    // Cancelling twice has no further effect.
    terrain.abandon();
    assert_eq!(terrain.queued(), 5);
    assert_eq!(tags(&mut terrain), [0, 1, 2, 3, 4]);

    // Dropping a computed commit has the same effect.
    terrain.submit(brush(7));
    drop(terrain.begin().expect("a queued edit").run());
    terrain.submit(brush(8));
    terrain.abandon();
    assert_eq!(tags(&mut terrain), [7, 8]);
    assert!(!terrain.is_busy() && terrain.queued() == 0);
}

#[test]
fn edits_overtaken_by_apply_keep_their_order() {
    // Dig after add and add after dig give different worlds, so the hash shows the order.
    let place = Shape::sphere(Vec3::new(7.0, 9.0, 6.0), 3.0);
    let nearby = Shape::sphere(Vec3::new(8.0, 9.0, 6.0), 3.0);
    let script = [
        Brush::dig(place),
        Brush::add(nearby, MaterialId(2)),
        Brush::dig(nearby),
        Brush::add(place, MaterialId(3)),
    ];
    let mut expected = small_terrain();
    expected.apply(&script);
    let mut terrain = small_terrain();
    terrain.submit(&script[0]);
    let _under_way = terrain.begin().expect("a queued edit");
    terrain.submit(&script[1]);
    terrain.submit(&script[2]);
    terrain.apply([&script[3]]);
    assert_eq!(terrain.world().hash(), expected.world().hash());
}

#[test]
fn snapshots_stay_as_they_were() {
    let mut rng = Rng::with_seed(8);
    let (ground, chunk_size) = random_ground(&mut rng, 1);
    let brushes: Vec<Brush> = (0..10)
        .map(|i| match i % 2 {
            0 => random_brush(&mut rng, &ground),
            _ => random_brush_at_a_face(&mut rng, &ground, chunk_size),
        })
        .collect();
    let mut terrain = terrain(ground, chunk_size);
    let mut snapshots = Vec::new();
    for brush in &brushes {
        let snapshot = terrain.snapshot();
        snapshots.push((snapshot.hash(), snapshot.revision(), snapshot.check_seams(), snapshot));
        terrain.apply([brush]);
    }
    for (hash, revision, report, snapshot) in snapshots {
        assert_eq!((snapshot.hash(), snapshot.revision()), (hash, revision));
        assert_eq!(snapshot.check_seams(), report);
    }
}
