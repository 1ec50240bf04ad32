//! Changes around a saved world: its terrain, its level, its folder, its rules. Edits of one world are never written
//! into another, and edits that were reported as applied are saved.
#![cfg(feature = "store")]

use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_burrow::format::Level;
use bevy_burrow::prelude::*;
use bevy_burrow::store::{Store, StoreOptions};

use crate::saved::{
    Folder, Heard, app, app_with, dig, dig_now, empty, exit, flat, hash, hash_in, heard, model, run_until,
    run_until_applied, run_until_closed, run_until_opened, saved, terrain, with_assets,
};

#[test]
fn another_level_on_the_entity_closes_the_world_and_is_not_written_into_it() {
    let others = [
        ("higher", flat(128, 20.0, 32, 1.0)),
        ("larger", flat(256, 8.0, 32, 1.0)),
        ("smaller", flat(64, 8.0, 32, 1.0)),
        ("chunks", flat(128, 8.0, 64, 1.0)),
        ("voxels", flat(128, 8.0, 32, 0.5)),
    ];
    for (name, other) in others {
        let folder = Folder::new(name);
        let first = || flat(128, 8.0, 32, 1.0);
        let (mut game, entity) = app_with(&folder.0, first());
        run_until_opened(&mut game);
        dig_now(&mut game, 30.0);
        let before = hash(&game, entity);
        game.world_mut().entity_mut(entity).insert(other);
        dig_now(&mut game, 20.0);
        run_until_closed(&mut game, 1);
        let closed = &heard(&game).closed[0];
        assert_eq!(
            (closed.because, closed.outcome.as_ref().ok()),
            (ClosedBecause::OtherTerrain, Some(&1)),
            "{name}"
        );
        assert_eq!((closed.terrain, &closed.path), (entity, &folder.0), "{name}");
        assert!(game.world().get::<SavedWorld>(entity).is_none(), "{name}: nothing says that it is saved");
        assert!(
            game.world().get::<WorldStore>(entity).is_none() && heard(&game).warnings.is_empty(),
            "{name}"
        );
        exit(game);
        assert_eq!(hash_in(&folder.0, first()), Ok((1, before)), "{name}");
    }
}

#[test]
fn levels_with_worlds_of_their_own_take_turns_on_one_entity() {
    let (first, second) = (Folder::new("turns-a"), Folder::new("turns-b"));
    // Over the same ground, so that nothing but the folder tells them apart.
    for in_one_insertion in [true, false] {
        let (mut game, entity) = app(&first.0);
        run_until_opened(&mut game);
        dig_now(&mut game, 30.0);
        let mut hashes = [hash(&game, entity), 0];
        for (turn, folder) in [&second, &first, &second, &first].into_iter().enumerate() {
            let which = (turn + 1) % 2;
            game.world_mut().resource_mut::<Heard>().opened.clear();
            let mut entry = game.world_mut().entity_mut(entity);
            if in_one_insertion {
                entry.insert((terrain(), saved(&folder.0)));
            } else {
                entry.insert(terrain());
                entry.insert(saved(&folder.0));
            }
            // Sent to the world that comes.
            dig(&mut game, 40.0 + 10.0 * turn as f32);
            run_until_opened(&mut game);
            let receipts = heard(&game).receipts;
            run_until_applied(&mut game, receipts.max(turn + 2));
            hashes[which] = hash(&game, entity);
        }
        exit(game);
        for (folder, expected) in [(&first, hashes[0]), (&second, hashes[1])] {
            let (_, found) = hash_in(&folder.0, terrain()).expect("it is there");
            assert_eq!(found, expected);
        }
    }
}

#[test]
fn what_was_dug_in_the_frame_of_a_change_is_in_the_world_that_was_left() {
    for change in 0..4 {
        let (first, second) = (Folder::new("frame-a"), Folder::new("frame-b"));
        let (mut game, entity) = app(&first.0);
        run_until_opened(&mut game);
        dig_now(&mut game, 30.0);
        // The game digs through the model, and changes the world before the store got anything.
        let mut own = game.world_mut().get_mut::<Terrain>(entity).expect("a terrain");
        own.apply([Brush::dig(Shape::sphere(Vec3::new(60.0, 11.0, 60.0), 5.0))]);
        let before = own.world().hash();
        let mut entry = game.world_mut().entity_mut(entity);
        match change {
            0 => drop(entry.insert(saved(&second.0))),
            1 => drop(entry.insert((terrain(), saved(&second.0)))),
            2 => drop(entry.remove::<SavedWorld>()),
            _ => entry.despawn(),
        }
        exit(game);
        assert_eq!(hash_in(&first.0, terrain()), Ok((2, before)), "change {change}");
    }
}

#[test]
fn who_leaves_a_world_and_ends_the_app_at_once_loses_nothing() {
    let folder = Folder::new("leaves");
    let (mut game, entity) = app(&folder.0);
    run_until_opened(&mut game);
    dig_now(&mut game, 30.0);
    let before = hash(&game, entity);
    game.world_mut().despawn(entity);
    // The loss window has not passed, and nothing waits for the store's thread but the exit.
    exit(game);
    let (_, opened) =
        Store::open(&folder.0, crate::saved::ground(), StoreOptions::default()).expect("closed");
    assert_eq!(opened.terrain.world().hash(), before);
}

#[test]
fn a_terrain_that_is_disabled_is_saved_all_the_same() {
    let folder = Folder::new("disabled");
    let (mut game, entity) = app(&folder.0);
    run_until_opened(&mut game);
    dig_now(&mut game, 30.0);
    let mut own = game.world_mut().get_mut::<Terrain>(entity).expect("a terrain");
    own.apply([Brush::dig(Shape::sphere(Vec3::new(60.0, 11.0, 60.0), 5.0))]);
    let before = own.world().hash();
    game.world_mut().entity_mut(entity).insert(bevy::ecs::entity_disabling::Disabled);
    exit(game);
    assert_eq!(hash_in(&folder.0, terrain()), Ok((2, before)));
}

#[test]
fn a_terrain_that_comes_while_a_world_is_read_takes_its_place_or_is_another_level() {
    let folder = Folder::new("comes");
    let new = || flat(128, 8.0, 32, 1.0);
    let (mut first, entity) = app_with(&folder.0, new());
    run_until_opened(&mut first);
    dig_now(&mut first, 30.0);
    let before = hash(&first, entity);
    exit(first);
    for (is_other, by_assignment) in [(false, false), (false, true), (true, false), (true, true)] {
        // Somebody has it open for a while, so that reading takes long.
        let ground = Ground::flat(128, 128, 8.0).expect("valid");
        let holder = Store::open(&folder.0, ground, StoreOptions::default()).expect("a world");
        let (mut game, entity) = app_with(&folder.0, new());
        (0..20).for_each(|_| game.update());
        let other = flat(128, if is_other { 20.0 } else { 8.0 }, 32, 1.0);
        if by_assignment {
            *game.world_mut().get_mut::<Terrain>(entity).expect("a terrain") = other;
        } else {
            game.world_mut().entity_mut(entity).insert(other);
        }
        (0..20).for_each(|_| game.update());
        drop(holder);
        run_until_opened(&mut game);
        assert_eq!(heard(&game).opened[0].is_err(), is_other);
        assert_eq!(game.world().get::<SavedWorld>(entity).is_none(), is_other);
        assert_eq!(hash(&game, entity) == before, !is_other);
        dig_now(&mut game, 60.0);
        if is_other {
            exit(game);
            assert_eq!(hash_in(&folder.0, new()), Ok((1, before)));
            continue;
        }
        // Back to what was there.
        let mut own = game.world_mut().get_mut::<Terrain>(entity).expect("a terrain");
        assert!(own.undo().outcome.is_ok());
        exit(game);
        let (_, found) = hash_in(&folder.0, new()).expect("it can be opened");
        assert_eq!(found, before);
        drop(std::fs::remove_dir_all(&folder.0));
        let (mut first, entity) = app_with(&folder.0, new());
        run_until_opened(&mut first);
        dig_now(&mut first, 30.0);
        assert_eq!(hash(&first, entity), before);
        exit(first);
    }
}

#[test]
fn saving_may_begin_while_somebody_digs() {
    for folder_exists in [false, true] {
        let folder = Folder::new("save-as");
        let new = || flat(384, 64.0, 32, 1.0);
        if folder_exists {
            exit(app_with(&folder.0, new()).0);
        }
        let mut game = empty();
        let entity = game.world_mut().spawn(new()).id();
        run_until(&mut game, "the terrain is there", |world| world.resource::<Heard>().ready > 0);
        let brush = |tag: u64| {
            let at = Vec3::new(60.0 + 40.0 * (tag % 7) as f32, 62.0, 60.0 + 40.0 * (tag / 7) as f32);
            Brush::dig(Shape::sphere(at, if tag == 9 { 50.0 } else { 6.0 })).with_tag(tag)
        };
        let first = if folder_exists { 9 } else { 0 };
        for tag in first..30 {
            game.world_mut().write_message(brush(tag));
            game.update();
            if tag == 9 {
                assert!(model(&game, entity).is_busy(), "a large dig is under way");
                game.world_mut().entity_mut(entity).insert(saved(&folder.0));
            }
        }
        run_until_opened(&mut game);
        run_until_applied(&mut game, 30 - first as usize);
        let mut expected = new();
        (first..30).for_each(|tag| drop(expected.apply([brush(tag)])));
        assert_eq!(hash(&game, entity), expected.world().hash(), "each receipt has its hole");
        if !folder_exists {
            // What the player did before can still be undone.
            let mut own = game.world_mut().get_mut::<Terrain>(entity).expect("a terrain");
            let undone = (0..25).filter(|_| own.undo().outcome.is_ok()).count();
            (0..undone).for_each(|_| drop(own.redo()));
            assert!(undone >= 25, "{undone}");
            assert_eq!(own.world().hash(), expected.world().hash());
        }
        exit(game);
        assert_eq!(hash_in(&folder.0, new()).map(|(_, hash)| hash), Ok(expected.world().hash()));
    }
}

#[test]
fn what_the_game_does_by_itself_while_a_new_world_is_made_is_in_it() {
    let folder = Folder::new("by-itself");
    let (mut game, entity) = app(&folder.0);
    let mut digs = 0;
    while heard(&game).opened.is_empty() {
        digs += 1;
        let mut own = game.world_mut().get_mut::<Terrain>(entity).expect("a terrain");
        let at = Vec3::new(8.0 + (digs * 7 % 80) as f32, 11.0, 8.0 + (digs % 80) as f32);
        own.apply([Brush::dig(Shape::sphere(at, 3.0))]);
        game.update();
    }
    let (revision, before) = (model(&game, entity).world().revision(), hash(&game, entity));
    assert!(revision > 0);
    exit(game);
    assert_eq!(hash_in(&folder.0, terrain()), Ok((revision, before)));
}

const MISSING: &str = "burrow-saves-missing.burrow_level";

#[test]
fn a_level_that_can_not_be_loaded_holds_no_terrain() {
    for case in ["failed before", "fails later", "no handle"] {
        let mut game = with_assets();
        let level: Handle<BurrowLevel> = match case {
            "no handle" => Handle::default(),
            _ => game.world().resource::<AssetServer>().load(MISSING),
        };
        if case == "failed before" {
            let id = level.id();
            run_until(&mut game, "it fails", move |world| {
                world.resource::<AssetServer>().load_state(id).is_failed()
            });
            (0..10).for_each(|_| game.update());
        }
        game.world_mut().spawn((terrain(), StartLevel(level)));
        run_until(&mut game, case, |world| world.resource::<Heard>().ready > 0);
    }
}

#[test]
fn a_level_that_is_taken_off_holds_no_terrain() {
    let mut game = with_assets();
    // It is never added.
    let level = game.world().resource::<Assets<BurrowLevel>>().reserve_handle();
    let entity = game.world_mut().spawn((terrain(), StartLevel(level))).id();
    (0..10).for_each(|_| game.update());
    assert_eq!(heard(&game).ready, 0, "it may still come");
    game.world_mut().entity_mut(entity).remove::<StartLevel>();
    run_until(&mut game, "it begins without", |world| world.resource::<Heard>().ready > 0);
}

#[test]
fn a_missing_level_beside_a_saved_world_costs_no_digs() {
    let folder = Folder::new("missing");
    drop(Store::create(&folder.0, &mut terrain(), StoreOptions::default()).expect("a new world"));
    // Held open for half a second, in which the level fails.
    let holder = Store::open(&folder.0, crate::saved::ground(), StoreOptions::default()).expect("a world");
    let mut holder = Some(holder);
    let mut game = with_assets();
    let level = game.world().resource::<AssetServer>().load(MISSING);
    let entity = game.world_mut().spawn((terrain(), saved(&folder.0), StartLevel(level))).id();
    let (start, mut sent) = (Instant::now(), 0);
    while heard(&game).opened.is_empty() {
        if sent < 10 {
            dig(&mut game, 8.0 * sent as f32 + 8.0);
            sent += 1;
        }
        game.update();
        std::thread::sleep(Duration::from_millis(5));
        if start.elapsed() > Duration::from_millis(500) {
            holder = None;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "never opened");
    }
    drop(holder);
    run_until_applied(&mut game, sent);
    let mut expected = terrain();
    for number in 0..sent {
        let x = 8.0 * number as f32 + 8.0;
        expected.apply([Brush::dig(Shape::sphere(Vec3::new(x, 11.0, 40.0), 4.0))]);
    }
    assert_eq!(hash(&game, entity), expected.world().hash());
}

#[test]
fn a_level_beside_a_world_that_is_open_changes_nothing() {
    let folder = Folder::new("level-later");
    let (mut game, entity) = app(&folder.0);
    game.insert_resource(Assets::<BurrowLevel>::default());
    run_until_opened(&mut game);
    dig_now(&mut game, 30.0);
    let before = hash(&game, entity);
    let mut other = terrain();
    other.apply([Brush::dig(Shape::sphere(Vec3::new(60.0, 11.0, 20.0), 6.0))]);
    let level = BurrowLevel::new(&Level::of(&other)).expect("it can be written");
    let level = game.world_mut().resource_mut::<Assets<BurrowLevel>>().add(level);
    game.world_mut().entity_mut(entity).insert(StartLevel(level));
    (0..100).for_each(|_| game.update());
    assert_eq!(hash(&game, entity), before);
    dig_now(&mut game, 50.0);
}

#[test]
fn rules_of_a_new_version_of_the_game_hold_in_worlds_of_an_old_one() {
    let folder = Folder::new("rules");
    let rules = |below| DiggingRules::default().with_bedrock(below);
    let loose = LooseSettings { crumbs: 7, ..LooseSettings::default() };
    // What the game sets, what holds then, and a depth with whether it can be dug.
    let versions = [
        ((None, None), (None, None), (-30.0, true)),
        ((Some(-20), Some(loose)), (Some(-20), Some(loose)), (-30.0, false)),
        ((Some(-40), None), (Some(-40), Some(loose)), (-30.0, true)),
        // A game that sets none continues with the saved ones.
        ((None, None), (Some(-40), Some(loose)), (-45.0, false)),
    ];
    for (number, ((set, set_loose), held, (depth, is_dug))) in versions.into_iter().enumerate() {
        let mut new = terrain();
        if let Some(below) = set {
            new.set_rules(rules(below)).expect("valid rules");
        }
        new.set_loose(set_loose);
        let (mut game, entity) = app_with(&folder.0, new);
        // It waits until the world is read, and obeys the rules of that.
        let at = Vec3::new(20.0 + 20.0 * number as f32, depth, 40.0);
        game.world_mut().write_message(Brush::dig(Shape::sphere(at, 3.0)));
        run_until_opened(&mut game);
        run_until(&mut game, "it is answered", move |world| {
            world.get::<Terrain>(entity).is_some_and(|own| own.queued() == 0 && !own.is_busy())
        });
        let found = model(&game, entity);
        assert_eq!((found.rules().and_then(|rules| rules.bedrock), found.loose().copied()), held, "{number}");
        assert_eq!(!found.world().is_solid(at.as_dvec3()), is_dug, "{number}");
        exit(game);
    }
}
