//! Grounds of another size: all edits are kept on them, or the world is refused in one sentence and not changed.

use std::sync::Arc;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{BaseChanged, SimulatedDisk, Store, StoreError, StoreOptions, StoreWarning};
use bevy_burrow::terrain::Meshing;
use glam::Vec3;

use crate::play::{options, samples, save, state};

fn flat(width: u32, depth: u32) -> Arc<Ground> {
    Arc::new(Ground::flat(width, depth, 0.0).expect("valid heights"))
}

/// A world on a ground of this size with digs at these places; closed, or its process was killed.
fn dug(side: u32, places: &[(f32, f32)], is_closed: bool) -> (SimulatedDisk, Terrain) {
    let disk = SimulatedDisk::new();
    let mut world = Terrain::new(flat(side, side), &TerrainSettings::default()).expect("valid settings");
    world.set_meshing(Meshing::Never);
    let store = Store::create_in(Arc::new(disk.clone()), &mut world, options(99));
    let mut store = store.expect("a new world");
    for &(x, z) in places {
        world.apply([Brush::dig(Shape::sphere(Vec3::new(x, 0.0, z), 4.0))]);
        save(&mut store, &mut world).expect("the thread runs");
    }
    store.flush().expect("the disk works");
    let killed = disk.image().lose_process();
    drop(store);
    (if is_closed { disk } else { killed }, world)
}

fn open(
    disk: &SimulatedDisk,
    ground: &Arc<Ground>,
    base_changed: BaseChanged,
) -> Result<(Terrain, Vec<StoreWarning>), StoreError> {
    let options = StoreOptions { base_changed, ..options(99) };
    let opened = Store::open_in(Arc::new(disk.clone()), Arc::clone(ground), options);
    opened.map(|(_, own)| (own.terrain, own.warnings))
}

#[test]
fn another_size_and_back_changes_nothing_or_is_refused() {
    let places = [&[(30.0, 30.0)][..], &[(30.0, 30.0), (62.0, 30.0)], &[(62.0, 62.0)], &[]];
    let beyond = [&[(100.0, 100.0)][..], &[(30.0, 30.0), (62.0, 30.0), (100.0, 100.0)]];
    let cases = places.map(|own| (64, own)).into_iter().chain(beyond.map(|own| (128, own)));
    let cases = cases.chain(places.map(|own| (128, own)));
    for (side, places) in cases {
        for (is_closed, other) in
            [(true, (64, 64)), (false, (64, 64)), (true, (128, 128)), (false, (128, 128))]
                .into_iter()
                .flat_map(|(is_closed, other)| {
                    [(is_closed, other), (is_closed, (other.0, 96)), (is_closed, (8, 8))]
                })
        {
            let what = format!("{side}, {places:?}, closed: {is_closed}, over {other:?}");
            let (disk, world) = dug(side, places, is_closed);
            let (own, other) = (flat(side, side), flat(other.0, other.1));
            if other.hash() == own.hash() {
                continue;
            }
            let before = disk.paths();
            match open(&disk, &other, BaseChanged::Keep) {
                Ok((moved, warnings)) => {
                    let is_told = warnings.iter().any(|own| matches!(own, StoreWarning::BaseChanged { .. }));
                    assert!(is_told && (is_closed || places.is_empty()), "{what}: {warnings:?}");
                    assert_eq!(samples(&moved), samples(&world), "{what}");
                }
                Err(why) => {
                    let text = why.to_string();
                    assert!(matches!(why, StoreError::GroundSize { .. }), "{what}: {text}");
                    assert_eq!(disk.paths(), before, "{what}: nothing was changed");
                    let sizes = [&own, &other].map(|own| format!("{} x {}", own.width(), own.depth()));
                    assert!(sizes.iter().all(|size| text.contains(size)), "{what}: {text}");
                }
            }
            // Larger and back: fields at the rim have grown beyond the chunks here, and shrink again.
            match open(&disk, &own, BaseChanged::Keep) {
                Ok((back, _)) => assert_eq!(back.world().hash(), world.world().hash(), "{what}"),
                Err(why) => panic!("{what}: back: {why}"),
            }
        }
    }
}

#[test]
fn a_larger_map_keeps_what_was_dug_at_the_old_rim() {
    let (disk, world) = dug(64, &[(30.0, 30.0), (62.0, 30.0)], true);
    let (mut moved, _) = open(&disk, &flat(128, 128), BaseChanged::Keep).expect("it is larger");
    assert_eq!(moved.world().revision(), world.world().revision());
    assert!(moved.world().check_seams().is_flawless());
    // It can be edited there.
    moved.apply([Brush::dig(Shape::sphere(Vec3::new(66.0, 0.0, 30.0), 5.0))]);
    assert!(moved.world().check_seams().is_flawless());
}

#[test]
fn edits_are_made_again_on_a_larger_map_and_never_on_a_smaller_one() {
    for is_closed in [true, false] {
        let (disk, _) = dug(64, &[(30.0, 30.0), (62.0, 30.0)], is_closed);
        let (replayed, _) = open(&disk, &flat(128, 128), BaseChanged::Replay).expect("it is larger");
        let (_, again) = dug(128, &[(30.0, 30.0), (62.0, 30.0)], true);
        assert_eq!(replayed.world().hash(), again.world().hash());
        let (disk, world) = dug(128, &[(30.0, 30.0), (100.0, 100.0)], is_closed);
        let refused = open(&disk, &flat(64, 64), BaseChanged::Replay).expect_err("it is smaller");
        assert!(matches!(refused, StoreError::GroundSize { .. }), "{refused}");
        let (back, _) = open(&disk, &flat(128, 128), BaseChanged::Refuse).expect("its own ground");
        assert_eq!(state(&back), state(&world));
    }
}
