//! Worlds in real folders: removed locks, links, relative paths, read-only files, and stray ones.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bevy_burrow::prelude::*;
use bevy_burrow::store::{Files, Folder, Store, StoreError, StoreWarning, read_world, replay};

use crate::opening::Place;
use crate::play::{State, act, ground, options, save, state, terrain};

/// A world with `commits` commits and only the first checkpoint.
fn create(path: &Path, ground: &Arc<Ground>, commits: u64) -> (Store, Terrain) {
    let (mut world, mut rng) = (terrain(ground), fastrand::Rng::with_seed(8));
    let mut store = Store::create(path, &mut world, options(u64::MAX)).expect("a new world");
    while world.world().revision() < commits {
        act(&mut world, &mut rng);
        save(&mut store, &mut world).expect("the thread runs");
    }
    store.flush().expect("the disk works");
    (store, world)
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a new folder");
    for entry in fs::read_dir(from).expect("a folder").flatten() {
        let target = to.join(entry.file_name());
        match entry.path().is_dir() {
            true => copy_folder(&entry.path(), &target),
            false => drop(fs::copy(entry.path(), target).expect("a file")),
        }
    }
}

/// A world with commits in its log only, as if the process had been killed.
fn killed(name: &str, ground: &Arc<Ground>) -> (Place, State) {
    let (living, killed) = (Place::new(&format!("{name}_living")), Place::new(name));
    let (store, world) = create(&living.0, ground, 6);
    copy_folder(&living.0, &killed.0);
    drop(store);
    (killed, state(&world))
}

fn opened(path: &Path, ground: &Arc<Ground>) -> Result<(State, Vec<StoreWarning>), StoreError> {
    let opened = Store::open(path, Arc::clone(ground), options(99));
    opened.map(|(_, own)| (state(&own.terrain), own.warnings))
}

#[cfg(unix)]
#[test]
fn a_world_stays_locked_though_its_lock_is_removed() {
    let (place, ground) = (Place::new("removed_lock"), ground(1));
    let (store, world) = create(&place.0, &ground, 3);
    fs::remove_file(place.0.join("lock")).expect("it is there");
    let locked = opened(&place.0, &ground).expect_err("it is open");
    assert!(matches!(locked, StoreError::Locked(_)), "{locked}");
    assert!(matches!(Store::inspect(&place.0), Err(StoreError::Locked(_))));
    drop(store);
    assert_eq!(opened(&place.0, &ground).expect("it is closed").0, state(&world));
}

#[test]
fn stray_files_are_left_alone() {
    let ground = ground(1);
    for stray in [
        "7.log",
        "18446744073709551615.log",
        "1152921504606846976.log",
        "99999999.log",
        "notes.txt",
        "00000002 (copy).log",
    ] {
        let (place, expected) = killed("stray", &ground);
        let path = place.0.join("journal").join(stray);
        fs::write(&path, b"").expect("a new file");
        for _ in 0..3 {
            assert_eq!(
                opened(&place.0, &ground).expect("it is not one of its files"),
                (expected.clone(), vec![]),
                "{stray}"
            );
        }
        assert!(path.exists());
        // Saving continues next to the stray file.
        let (mut store, own) = Store::open(&place.0, Arc::clone(&ground), options(99)).expect("it is whole");
        let mut world = own.terrain;
        act(&mut world, &mut fastrand::Rng::with_seed(3));
        save(&mut store, &mut world).expect("the thread runs");
        drop(store);
        assert_eq!(opened(&place.0, &ground).expect("it is whole"), (state(&world), vec![]), "{stray}");
    }
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_one_that_leads_nowhere_is_reported() {
    use std::os::unix::fs::symlink;
    let ground = ground(1);
    for path in ["regions.redb", "journal", "journal/00000001.log"] {
        let ((place, expected), elsewhere) = (killed("linked", &ground), Place::new("elsewhere"));
        fs::rename(place.0.join(path), &elsewhere.0).expect("the same disk");
        symlink(&elsewhere.0, place.0.join(path)).expect("a link");
        assert_eq!(opened(&place.0, &ground).expect("it is there"), (expected, vec![]), "{path}");
        drop(fs::remove_file(&elsewhere.0));
    }
    let (place, _) = killed("linked", &ground);
    let path = place.0.join("journal/00000001.log");
    fs::remove_file(&path).expect("it is there");
    symlink("nowhere", &path).expect("a link");
    let refused = opened(&place.0, &ground).expect_err("commits are in it");
    assert!(refused.to_string().contains("00000001.log"), "{refused}");
}

/// Makes files and folders writable or read-only.
#[cfg(unix)]
fn allow(place: &Path, writing: bool) {
    use std::os::unix::fs::PermissionsExt;
    let (folder, file) = if writing { (0o755, 0o644) } else { (0o555, 0o444) };
    let set = |path: &Path, mode| fs::set_permissions(path, PermissionsExt::from_mode(mode)).expect("ours");
    let folders = [place.to_owned(), place.join("journal")];
    if writing {
        folders.iter().for_each(|path| set(path, folder));
    }
    for path in &folders {
        let entries = fs::read_dir(path).expect("a folder").flatten().map(|entry| entry.path());
        entries.filter(|path| path.is_file()).for_each(|path| set(&path, file));
    }
    if !writing {
        folders.iter().for_each(|path| set(path, folder));
    }
}

/// Tests nothing where permissions have no effect, as for root; tests with the simulated disk cover these cases.
#[cfg(unix)]
#[test]
fn a_world_that_may_only_be_read_is_read() {
    let ground = ground(1);
    for has_lock in [true, false] {
        let (place, expected) = killed("read_only", &ground);
        if !has_lock {
            drop(fs::remove_file(place.0.join("lock")));
        }
        let files = || {
            let (folder, mut all) = (Folder::new(&place.0), Vec::new());
            for name in ["", "journal", "quarantine"] {
                all.extend(folder.list(name).expect("a folder"));
            }
            all
        };
        allow(&place.0, false);
        let before = files();
        let info = Store::inspect(&place.0);
        let checked = Store::check(&place.0, Arc::clone(&ground), None);
        let read = read_world(&place.0, Arc::clone(&ground), None);
        let replayed = replay(&place.0, Arc::clone(&ground), None);
        // As root the lock can be made.
        let after: Vec<String> = files().into_iter().filter(|name| has_lock || name != "lock").collect();
        let opened = opened(&place.0, &ground);
        allow(&place.0, true);
        assert_eq!(info.expect("it can be read").damage, Vec::<String>::new());
        assert_eq!(state(&checked.expect("it can be read").terrain), expected);
        assert_eq!(state(&read.expect("it can be read").terrain), expected);
        assert_eq!(replayed.expect("its log is whole").world().hash(), expected.hash);
        assert_eq!(opened.expect("it can be played").0, expected);
        assert_eq!(after, before, "nothing was changed");
    }
}

#[test]
fn errors_of_the_system_name_the_file() {
    let (place, ground) = (Place::new("named"), ground(1));
    drop(create(&place.0, &ground, 3));
    let segment = place.0.join("journal/00000001.log");
    fs::remove_file(&segment).expect("it is there");
    fs::create_dir(place.0.join("regions.new")).expect("a new folder");
    let folder = Folder::new(&place.0);
    for error in [
        Files::read(&folder, "journal/00000001.log").expect_err("it is gone"),
        folder.remove("journal/00000001.log").expect_err("it is gone"),
        folder.rename("journal/00000001.log", "lock").expect_err("it is gone"),
        folder.sync_folder("nowhere").expect_err("it is not there"),
    ] {
        let text = error.to_string();
        assert!(["00000001.log", "lock", "nowhere"].iter().any(|name| text.contains(name)), "{text}");
    }
}

#[test]
fn a_folder_with_files_without_a_byte_is_empty() {
    let ground = ground(1);
    for paths in [
        &["regions.redb"][..],
        &["journal/00000001.log"],
        &["regions.redb", "journal/00000001.log", "regions.new"],
    ] {
        let place = Place::new("empty");
        fs::create_dir_all(place.0.join("journal")).expect("a new folder");
        paths.iter().for_each(|path| fs::write(place.0.join(path), b"").expect("a new file"));
        assert!(!Store::is_in(&place.0), "{paths:?}");
        let missing = opened(&place.0, &ground).expect_err("there is none");
        assert!(matches!(missing, StoreError::Missing(_)), "{paths:?}: {missing}");
        let (store, world) = create(&place.0, &ground, 4);
        drop(store);
        assert_eq!(opened(&place.0, &ground).expect("it is whole"), (state(&world), vec![]), "{paths:?}");
    }
}

#[test]
fn a_journal_that_is_removed_after_a_crash_is_missed() {
    let ground = ground(1);
    let is_told =
        |warnings: &[StoreWarning]| warnings.iter().any(|own| matches!(own, StoreWarning::LogMissing { .. }));
    let (place, _) = killed("journal", &ground);
    fs::remove_dir_all(place.0.join("journal")).expect("a folder");
    let checked = Store::check(&place.0, Arc::clone(&ground), None).expect("it can be read");
    assert!(checked.warnings.iter().any(|own| own.contains("the log is missing")), "{:?}", checked.warnings);
    let (now, warnings) = opened(&place.0, &ground).expect("the database is whole");
    assert!(is_told(&warnings) && now.hash == terrain(&ground).world().hash(), "{warnings:?}");
    assert_eq!(opened(&place.0, &ground).expect("it is whole").1, vec![], "it was reported");
    // After it was closed, no log is missing.
    let place = Place::new("journal_closed");
    let (store, world) = create(&place.0, &ground, 5);
    drop(store);
    fs::remove_dir_all(place.0.join("journal")).expect("a folder");
    assert_eq!(opened(&place.0, &ground).expect("the database is whole"), (state(&world), vec![]));
}

/// Run by the next test in a separate process, because it changes the current folder.
#[test]
#[ignore = "it is run by another test"]
fn child_that_changes_its_folder() {
    let Ok(place) = std::env::var("BURROW_CURRENT").map(PathBuf::from) else { return };
    let (there, ground) = (place.join("there"), ground(1));
    fs::create_dir_all(&there).expect("a new folder");
    for path in ["world", "", "."] {
        let here = place.join(format!("here{}", path.len()));
        drop(fs::remove_dir_all(&here));
        fs::create_dir_all(&here).expect("a new folder");
        std::env::set_current_dir(&here).expect("a folder");
        let (mut world, mut rng) = (terrain(&ground), fastrand::Rng::with_seed(8));
        let mut store = Store::create(path, &mut world, options(9)).expect("a new world");
        for turn in 0..30 {
            if turn == 10 {
                std::env::set_current_dir(&there).expect("a folder");
            }
            act(&mut world, &mut rng);
            save(&mut store, &mut world).expect("the thread runs");
            store.flush().expect("the disk works");
        }
        assert_eq!(store.take_warnings(), [], "{path}");
        drop(store);
        let place = here.join(path);
        let now = opened(&place, &ground).expect("it is where it was made");
        assert_eq!(now, (state(&world), vec![]), "{path}");
        assert_eq!(fs::read_dir(&there).expect("a folder").count(), 0, "{path}");
    }
}

#[test]
fn a_world_stays_where_it_is_when_the_current_folder_changes() {
    let place = Place::new("current");
    let program = std::env::current_exe().expect("it runs");
    let output = std::process::Command::new(program)
        .args(["folders::child_that_changes_its_folder", "--exact", "--ignored", "--nocapture"])
        .env("BURROW_CURRENT", &place.0)
        .output()
        .expect("it can be started");
    let text =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
}

#[test]
fn an_unsaved_world_that_is_replaced_by_hand_is_not_taken_for_damaged() {
    // All files of a world are removed except the one that marks it as not closed.
    let ground = ground(1);
    let (place, _) = killed("left", &ground);
    fs::remove_dir_all(place.0.join("journal")).expect("a folder");
    fs::remove_file(place.0.join("regions.redb")).expect("it is there");
    let (store, world) = create(&place.0, &ground, 2);
    let copy = Place::new("left_copy");
    copy_folder(&place.0, &copy.0);
    drop(store);
    for place in [&place, &copy] {
        assert_eq!(opened(&place.0, &ground).expect("it is whole"), (state(&world), vec![]));
    }
}
