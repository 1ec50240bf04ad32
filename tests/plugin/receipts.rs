//! Receipts: how brushes are batched, answered and refused.

use bevy::prelude::*;
use bevy_burrow::brush::BrushError;
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

#[test]
fn many_brushes_in_one_frame_make_one_transaction() {
    let mut stage = Stage::drawing();
    stage.show(steep());
    assert_eq!(stage.figures().commits, 0);
    for brush in random_brushes(7, 60) {
        stage.send(brush);
    }
    stage.settle();
    assert_eq!((stage.figures().commits, stage.figures().brushes), (1, 60));
    assert_eq!(stage.tags(), (0..60).collect::<Vec<_>>());
}

#[test]
fn brushes_that_come_while_a_transaction_runs_make_the_next_one() {
    let mut stage = Stage::drawing().without_waiting();
    let terrain = stage.show(steep());
    stage.send(dig(20.0, 4.0, 20.0, 4.0).with_tag(0));
    stage.frame();
    assert!(stage.terrain(terrain).is_busy(), "it began in the frame in which the brush was sent");
    // One frame collects these. The first transaction may or may not be finished by then.
    for tag in 1..20 {
        stage.send(dig(20.0 + tag as f32, 4.0, 20.0, 4.0).with_tag(tag));
    }
    stage.settle();
    assert_eq!(stage.figures().commits, 2);
    assert_eq!(stage.tags(), (0..20).collect::<Vec<_>>());
}

#[test]
fn the_world_is_the_same_however_brushes_are_batched() {
    let brushes = random_brushes(8, 90);
    let mut model = steep();
    let expected = model.apply(&brushes);
    let batchings: [(&str, &dyn Fn(usize) -> bool, bool); 4] = [
        ("all in one frame", &|_| false, false),
        ("one a frame", &|_| true, false),
        ("bursts of seven", &|index| index % 7 == 6, false),
        ("one transaction each", &|_| true, true),
    ];
    for (name, ends_frame, waits) in batchings {
        let mut stage = Stage::drawing();
        let terrain = stage.show(steep());
        for (index, brush) in brushes.iter().enumerate() {
            stage.send(brush.clone());
            if waits {
                stage.settle();
            } else if ends_frame(index) {
                stage.frame();
            }
        }
        stage.settle();
        assert_eq!(stage.hash(terrain), model.world().hash(), "{name}");
        let receipts: Vec<_> = stage.receipts().iter().map(|applied| applied.receipt.clone()).collect();
        assert_eq!(receipts, expected, "{name}");
        stage.assert_whole(terrain, name);
    }
}

/// Brushes that every terrain refuses, and a valid brush that lies elsewhere.
fn refused() -> Vec<Brush> {
    let (at, nan) = (Vec3::new(30.0, 8.0, 30.0), f32::NAN);
    let shapes = [
        Shape::sphere(at, nan),
        Shape::sphere(at * nan, 3.0),
        Shape::sphere(at, f32::INFINITY),
        Shape::sphere(at, -3.0),
        Shape::sphere(at, 0.0),
        Shape::sphere(at, f32::MIN_POSITIVE / 2.0),
        Shape::sphere(at, 1e9),
        Shape::sphere(at, 400.0),
        Shape::sphere(Vec3::splat(1e9), 3.0),
        Shape::sphere(Vec3::splat(f32::MAX), 3.0),
        Shape::cylinder(at, Vec3::ZERO, 3.0),
        Shape::turned_cuboid(at, Vec3::ONE, Quat::from_xyzw(0.0, 0.0, 0.0, 0.0)),
        Shape::capsule(at, Vec3::new(f32::NEG_INFINITY, 0.0, 0.0), 2.0),
        Shape::sphere(Vec3::new(-500.0, 8.0, 30.0), 3.0),
    ];
    let mut brushes: Vec<Brush> = shapes.map(Brush::dig).to_vec();
    brushes.push(dig(30.0, 8.0, 30.0, 3.0).with_roughness(Roughness::new(nan, 4.0, 1)));
    brushes.into_iter().enumerate().map(|(tag, brush)| brush.with_tag(tag as u64)).collect()
}

#[test]
fn refused_brushes_say_why_and_change_nothing() {
    for targeted in [false, true] {
        let mut stage = Stage::drawing();
        let terrain = stage.show(level(1.0));
        stage.send(dig(20.0, 8.0, 20.0, 4.0).with_tag(99));
        stage.settle();
        let entities = |stage: &mut Stage| {
            (
                stage.count::<Tile>(),
                stage.count::<Chunk>(),
                stage.count::<Field>(),
                stage.meshes(),
                stage.hash(terrain),
            )
        };
        let before = entities(&mut stage);
        let count = refused().len();
        for brush in refused() {
            if targeted { stage.send_to(terrain, brush) } else { stage.send(brush) }
        }
        stage.settle();
        let receipts = &stage.receipts()[1..];
        assert_eq!(receipts.len(), count);
        for (tag, applied) in receipts.iter().enumerate() {
            assert_eq!(applied.receipt.tag, tag as u64);
            // Brushes that reach the terrain are refused by it.
            let (is_nowhere, is_far) = (tag == 1 || tag == 12, tag == 8 || tag == 9 || tag == 13);
            let is_refused_here = targeted || !(is_nowhere || is_far);
            assert_eq!(applied.terrain, is_refused_here.then_some(terrain), "brush {tag}");
            match &applied.receipt.outcome {
                Err(Rejection::OutsideWorld) => assert!(tag == 13 || (is_far && !targeted)),
                Err(Rejection::Brush(error)) => assert!(tag != 13 && !error.to_string().is_empty()),
                outcome => panic!("brush {tag} was let through: {outcome:?}"),
            }
        }
        let why = |tag: usize| receipts[tag].receipt.outcome.clone().expect_err("refused");
        assert!(matches!(why(0), Rejection::Brush(BrushError::NotFinite { what: "radius", .. })));
        assert!(matches!(why(3), Rejection::Brush(BrushError::TooSmall { .. })));
        assert!(matches!(why(7), Rejection::Brush(BrushError::TooLarge { .. })));
        assert_eq!(entities(&mut stage), before);
        stage.assert_whole(terrain, "after refused brushes");

        stage.send(dig(40.0, 8.0, 40.0, 4.0).with_tag(7));
        stage.settle();
        let last = stage.receipts().last().expect("a receipt");
        assert!(last.receipt.tag == 7 && last.receipt.outcome.is_ok(), "later brushes still work");
        assert_ne!(stage.hash(terrain), before.4);
    }
}

#[test]
fn a_bad_brush_among_good_ones_leaves_them_alone() {
    let mut model = steep();
    let good = random_brushes(9, 30);
    model.apply(&good);
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    for (good, bad) in good.iter().zip(refused().iter().cycle()) {
        stage.send(bad.clone().with_tag(1000));
        stage.send(good.clone());
    }
    stage.settle();
    assert_eq!(stage.hash(terrain), model.world().hash());
    let tags = stage.tags();
    assert_eq!(tags.iter().filter(|&&tag| tag == 1000).count(), 30);
    assert!(tags.into_iter().filter(|&tag| tag < 1000).eq(0..30), "good brushes are answered in order");
}

#[test]
fn a_dig_in_the_air_gets_a_receipt_without_change() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    let before = stage.hash(terrain);
    stage.send(dig(30.0, 40.0, 30.0, 3.0).with_tag(5));
    stage.settle();
    let [applied] = stage.receipts() else { panic!("one receipt") };
    assert_eq!((applied.terrain, applied.receipt.tag), (Some(terrain), 5));
    assert_eq!(applied.receipt.outcome, Ok(Applied::default()));
    assert_eq!(stage.hash(terrain), before);
    assert_eq!(stage.count::<Chunk>(), 0);
}

#[test]
fn a_paste_in_voxels_is_moved_to_world_space_as_it_is() {
    let mut model = level(0.5);
    let tower = Shape::cuboid(Vec3::new(16.0, 11.0, 16.0), Vec3::new(3.0, 4.0, 2.0));
    model.apply([Brush::add(tower, MaterialId(3))]);
    let around = LatticeBox { min: IVec3::new(10, 4, 10), max: IVec3::new(22, 18, 22) };
    let copied = model.world().copy(around, IVec3::new(16, 8, 16)).expect("it is small");
    let paste = Paste::new(copied, Vec3::new(44.0, 0.0, 40.0)).turned_about_y(1).edited_only();
    let paste = Brush::paste(paste.onto_ground(model.world().ground()));

    let mut stage = Stage::server();
    let mut shown = level(0.5);
    shown.apply([Brush::add(tower, MaterialId(3))]);
    let terrain = stage.spawn_at(shown, Vec3::new(-64.0, 32.0, 8.0));
    stage.settle();
    let place = *stage.app.world().get::<GlobalTransform>(terrain).expect("it has a place");
    let (scale, rotation, translation) = place.to_scale_rotation_translation();
    stage.send(paste.transformed(rotation, translation, scale.x));
    stage.frames_until("it is pasted", |stage| !stage.receipts().is_empty());
    let before = model.world().hash();
    model.apply([paste]);
    assert_eq!(stage.hash(terrain), model.world().hash());
    assert_ne!(model.world().hash(), before);
}
