//! A process that digs is killed at random, also while it makes checkpoints, while it recovers, and, a quarter of the
//! times, while it rebuilds a damaged database, with a log that is whole or not. `BURROW_KILLS` is how often, and
//! `BURROW_SEED` the seed.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use bevy_burrow::store::{Store, StoreOptions};
use bevy_burrow::terrain::Meshing;
use fastrand::Rng;

use crate::play::{TURN, act, count, ground, save, terrain};

const FOLDER: &str = "BURROW_KILLED_WORLD";
const SEED: &str = "BURROW_KILLED_SEED";
const LOG_BYTES: &str = "BURROW_KILLED_LOG_BYTES";
const DATABASE: &str = "regions.redb";

fn options(log_bytes: u64) -> StoreOptions {
    let loss_window = Duration::from_millis(5);
    StoreOptions { loss_window, checkpoint_commits: 60, log_bytes, ..StoreOptions::default() }
}

fn say(line: std::fmt::Arguments) {
    let mut out = std::io::stdout().lock();
    // The reader may be gone.
    drop(out.write_fmt(format_args!("{line}\n")).and_then(|()| out.flush()));
}

/// The process that is killed; run by the other test only.
#[test]
#[ignore = "it is run by another test, and killed"]
fn child() {
    let (Ok(folder), Ok(seed)) = (std::env::var(FOLDER), std::env::var(SEED)) else { return };
    let mut rng = Rng::with_seed(seed.parse().expect("a number"));
    let options = || options(count(LOG_BYTES, u64::MAX));
    let ground = ground(3);
    say(format_args!("\nopening"));
    let (mut store, mut terrain) = if Store::is_in(&folder) {
        let (store, opened) = Store::open(&folder, ground, options()).expect("it can be opened");
        (store, opened.terrain)
    } else {
        let mut terrain = terrain(&ground);
        (Store::create(&folder, &mut terrain, options()).expect("a new world"), terrain)
    };
    terrain.set_meshing(Meshing::Never);
    let mut durable = store.durable();
    say(format_args!("durable {durable}"));
    loop {
        act(&mut terrain, &mut rng);
        say(format_args!("asked {} {}", terrain.world().revision(), terrain.world().hash()));
        save(&mut store, &mut terrain).expect("the thread runs");
        if store.durable() != durable {
            durable = store.durable();
            say(format_args!("durable {durable}"));
        }
        match rng.u32(0..60) {
            0 => {
                say(format_args!("checkpoint"));
                let durable = store.checkpoint().expect("the disk works");
                say(format_args!("durable {durable}"));
            }
            1 => say(format_args!("durable {}", store.flush().expect("the disk works"))),
            _ => {}
        }
    }
}

/// The known states of a world whose process is killed.
#[derive(Default)]
struct Known {
    hashes: BTreeMap<u64, Vec<u64>>,
    acknowledged: u64,
    latest: u64,
}

impl Known {
    fn hear(&mut self, line: &str) {
        let mut words = line.split(' ');
        let (word, mut numbers) = (words.next(), words.filter_map(|word| word.parse().ok()));
        match (word, numbers.next(), numbers.next()) {
            (Some("durable"), Some(revision), _) => self.acknowledged = self.acknowledged.max(revision),
            (Some("asked"), Some(revision), Some(hash)) => {
                self.hashes.entry(revision).or_default().push(hash);
                self.latest = revision;
            }
            _ => {}
        }
    }
}

/// Reads the output of a process until it should be stopped, or a time has passed.
fn hear(lines: &Receiver<String>, known: &mut Known, until: Instant, stop: &str) {
    loop {
        match lines.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(line) => {
                known.hear(&line);
                if line == stop {
                    return;
                }
            }
            Err(RecvTimeoutError::Timeout) => return,
            Err(RecvTimeoutError::Disconnected) => panic!("the process ended without being killed"),
        }
    }
}

/// Damages a database so that its structure is lost, but no record.
fn damage(database: &Path) -> bool {
    let flip = || {
        let mut bytes = std::fs::read(database)?;
        bytes.iter_mut().take(1).for_each(|byte| *byte ^= 1);
        std::fs::write(database, bytes)
    };
    flip().is_ok()
}

fn kill_once(folder: &Path, log_bytes: u64, rng: &mut Rng, known: &mut Known) -> &'static str {
    let kind = rng.u32(0..8);
    let is_rebuilt = kind < 2 && damage(&folder.join(DATABASE));
    let program = std::env::current_exe().expect("it runs");
    let mut child = Command::new(program)
        .args(["kill::child", "--exact", "--ignored", "--nocapture"])
        .env(FOLDER, folder)
        .env(SEED, rng.u64(..).to_string())
        .env(LOG_BYTES, log_bytes.to_string())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it can be started");
    let out = BufReader::new(child.stdout.take().expect("it is piped"));
    let (sender, lines) = channel();
    let listener = std::thread::spawn(move || {
        out.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)).ok();
    });
    let soon = |rng: &mut Rng, most: u64| Instant::now() + Duration::from_micros(rng.u64(0..most));
    let long = Instant::now() + Duration::from_secs(20);
    let during = match kind {
        0..=1 if is_rebuilt => {
            hear(&lines, known, long, "opening");
            hear(&lines, known, soon(rng, 12_000), "");
            "rebuild"
        }
        2 => {
            hear(&lines, known, long, "opening");
            hear(&lines, known, soon(rng, 12_000), "");
            "recovery"
        }
        3 => {
            hear(&lines, known, long, "checkpoint");
            hear(&lines, known, soon(rng, 15_000), "");
            "checkpoint"
        }
        _ => {
            hear(&lines, known, long, "opening");
            hear(&lines, known, soon(rng, 150_000), "");
            "anything"
        }
    };
    child.kill().expect("it runs");
    child.wait().expect("it was started");
    listener.join().expect("no panic");
    lines.try_iter().for_each(|line| known.hear(&line));
    during
}

#[test]
fn a_killed_process_loses_nothing_that_was_acknowledged() {
    let kills = count("BURROW_KILLS", 20);
    let mut rng = Rng::with_seed(count("BURROW_SEED", 26));
    let place = std::env::temp_dir().join(format!("bevy_burrow_kill_{}", std::process::id()));
    let (mut known, mut folder, mut log_bytes) = (Known::default(), PathBuf::new(), u64::MAX);
    let (mut when, mut lost, mut in_flight) = (BTreeMap::<&str, u64>::new(), 0, 0);
    for kill in 0..kills {
        // So that few kills see both kinds of logs.
        if kill % 50 == 0 || kill == 8 {
            drop(std::fs::remove_dir_all(&place));
            (known, folder) = (Known::default(), place.join(kill.to_string()));
            log_bytes = if kill % 100 == 0 { u64::MAX } else { 0 };
            known.hashes.insert(0, vec![terrain(&ground(3)).world().hash()]);
        }
        *when.entry(kill_once(&folder, log_bytes, &mut rng, &mut known)).or_default() += 1;
        if !Store::is_in(&folder) {
            assert!(known.acknowledged == 0 && known.latest == 0, "kill {kill}: the world is gone");
            continue;
        }
        let opened = Store::open(&folder, ground(3), options(log_bytes));
        let (store, opened) = opened.unwrap_or_else(|why| panic!("kill {kill} in {folder:?}: {why}"));
        let (revision, hash) = (opened.terrain.world().revision(), opened.terrain.world().hash());
        let bounds = known.acknowledged..=known.latest;
        assert!(
            bounds.contains(&revision),
            "kill {kill}: {revision}, not in {bounds:?}: {:?}",
            opened.warnings
        );
        assert!(known.hashes[&revision].contains(&hash), "kill {kill}: {revision}, {:?}", opened.warnings);
        let turn = store.get(TURN).map_or(0, |turn| u64::from_le_bytes(turn.try_into().expect("8 bytes")));
        assert_eq!(turn, revision, "kill {kill}: game data is of another revision");
        lost += known.latest - revision;
        in_flight += known.latest - known.acknowledged;
        (known.acknowledged, known.latest) = (revision, revision);
        known.hashes = BTreeMap::from([(revision, vec![hash])]);
    }
    drop(std::fs::remove_dir_all(&place));
    println!("{kills} kills during {when:?}; of {in_flight} revisions in flight {lost} were lost");
}
