//! Warning with saved worlds is reported for each world, and nothing waits for ever.
#![cfg(feature = "store")]

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Store, StoreOptions, StoreWarning};

use crate::saved::{
    Folder, Heard, app, dig_now, empty, exit, ground, hash, hash_in, heard, run_until, run_until_opened,
    saved, terrain,
};

#[test]
fn any_loss_window_saves() {
    for (number, loss_window) in
        [Duration::ZERO, Duration::from_secs(365 * 86_400), Duration::MAX].into_iter().enumerate()
    {
        let folder = Folder::new(&format!("window-{number}"));
        let mut game = empty();
        let entity = game.world_mut().spawn((terrain(), SavedWorld { loss_window, ..saved(&folder.0) })).id();
        run_until_opened(&mut game);
        for revision in 1..=3 {
            dig_now(&mut game, 20.0 * revision as f32);
            game.world_mut().write_message(SaveNow::default());
            run_until(&mut game, "it is told", move |world| {
                world.resource::<Heard>().saved.contains(&revision)
            });
        }
        assert_eq!(heard(&game).warnings, []);
        let before = hash(&game, entity);
        exit(game);
        assert_eq!(hash_in(&folder.0, terrain()), Ok((3, before)));
    }
}

#[test]
fn a_world_that_is_closed_slowly_is_opened_in_the_end() {
    let folder = Folder::new("slowly");
    let mut other = terrain();
    let store = Store::create(&folder.0, &mut other, StoreOptions::default()).expect("a new world");
    let closing = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(5));
        drop(store);
    });
    let (mut game, _) = app(&folder.0);
    // Other terrains do not wait for it, however few threads there are.
    for _ in 0..8 {
        let path = folder.0.clone();
        game.world_mut().spawn((terrain(), saved(&path)));
    }
    let other = Folder::new("slowly-other");
    game.world_mut().spawn((terrain(), saved(&other.0)));
    let start = Instant::now();
    run_until_opened(&mut game);
    assert!(!closing.is_finished(), "the other one was opened after {:?}", start.elapsed());
    run_until(&mut game, "the slow one is opened", |world| world.resource::<Heard>().opened.len() >= 2);
    assert_eq!(heard(&game).opened[..2], [Ok(0), Ok(0)]);
    assert!(heard(&game).warnings.contains(&StoreWarning::WaitsForLock));
    closing.join().expect("no panic");
}

#[test]
fn a_component_that_is_inserted_again_at_once_saves() {
    for at_once in [true, false] {
        let folder = Folder::new("again");
        let mut dug = terrain();
        // So that it takes a while to make the world.
        for number in 0..200 {
            let (x, z) = ((number * 13 % 90) as f32, (number * 29 % 90) as f32);
            dug.apply([Brush::dig(Shape::sphere(Vec3::new(x, 11.0 - (number % 60) as f32, z), 5.0))]);
        }
        let before = dug.world().hash();
        let mut game = empty();
        let entity = game.world_mut().spawn((dug, saved(&folder.0))).id();
        game.update();
        if !at_once {
            run_until_opened(&mut game);
            game.world_mut().resource_mut::<Heard>().opened.clear();
        }
        game.world_mut().entity_mut(entity).insert(saved(&folder.0));
        run_until_opened(&mut game);
        assert!(heard(&game).opened.iter().all(Result::is_ok), "{:?}", heard(&game).opened);
        assert_eq!(hash(&game, entity), before);
    }
}

/// Makes a folder unwritable by putting a file in the place of its journal's folder.
#[test]
fn each_world_that_can_not_be_saved_is_told_of() {
    let folders = [Folder::new("trouble-a"), Folder::new("trouble-b"), Folder::new("trouble-c")];
    let mut game = empty();
    let entities: Vec<Entity> =
        folders.iter().map(|folder| game.world_mut().spawn((terrain(), saved(&folder.0))).id()).collect();
    run_until(&mut game, "all are opened", |world| world.resource::<Heard>().opened.len() == 3);
    #[derive(Resource, Default)]
    struct Troubled(Vec<Entity>);
    game.init_resource::<Troubled>().add_systems(
        Last,
        |mut found: MessageReader<StoreWarningFound>, mut troubled: ResMut<Troubled>| {
            let failing = found.read().filter(|found| matches!(found.warning, StoreWarning::NotSaved(_)));
            troubled.0.extend(failing.map(|found| found.terrain));
        },
    );
    for folder in &folders[..2] {
        drop(std::fs::remove_dir_all(&folder.0));
        std::fs::write(&folder.0, b"in the way").expect("a new file");
    }
    for entity in &entities {
        let mut own = game.world_mut().get_mut::<Terrain>(*entity).expect("a terrain");
        own.apply([Brush::dig(Shape::sphere(Vec3::new(40.0, 11.0, 40.0), 4.0))]);
    }
    let expected: Vec<Entity> = entities[..2].to_vec();
    run_until(&mut game, "both are reported", move |world| {
        expected.iter().all(|entity| world.resource::<Troubled>().0.contains(entity))
    });
    assert!(!game.world().resource::<Troubled>().0.contains(&entities[2]));
    // Data that can't be saved when its world is closed is reported too.
    game.world_mut().despawn(entities[0]);
    run_until(&mut game, "it is closed", |world| !world.resource::<Heard>().closed.is_empty());
    let closed = &heard(&game).closed[0];
    assert!(closed.terrain == entities[0] && closed.outcome.is_err(), "{closed:?}");
    for folder in &folders[..2] {
        drop(std::fs::remove_file(&folder.0));
    }
    // What stays in memory can be saved elsewhere.
    let elsewhere = Folder::new("trouble-elsewhere");
    let before = hash(&game, entities[1]);
    game.world_mut().entity_mut(entities[1]).insert(saved(&elsewhere.0));
    run_until(&mut game, "it is opened", |world| world.resource::<Heard>().opened.len() == 4);
    exit(game);
    assert_eq!(hash_in(&elsewhere.0, terrain()), Ok((1, before)));
    assert_eq!(
        hash_in(&folders[2].0, Terrain::new(ground(), &TerrainSettings::default()).expect("valid"))
            .map(|(revision, _)| revision),
        Ok(1)
    );
}
