//! All clients have the same world: while they dig over lossy connections, after joining late or reconnecting, after a restart
//! of the server, and after tampered messages are detected.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy_burrow::brush::Edit;
use bevy_burrow::net::{ClientId, Entries, Entry, Lane, Rate, Server, ServerSettings, ToClient, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::store::{SimulatedDisk, Store, StoreOptions};
use bevy_burrow::terrain::Patch;
use fastrand::Rng;
use glam::Vec3;

use crate::bots::{Bot, Play, TICK};
use crate::follower::{count, hills, layered_hills, terrain};
use crate::worlds::any_random_brush;

fn settings() -> ServerSettings {
    ServerSettings { undo: UndoPolicy::Own, ..ServerSettings::default() }
}

/// Digs until this many edits were ordered.
fn dig(play: &mut Play, edits: u64) {
    let end = play.server.figures().ordered + edits;
    while play.server.figures().ordered < end {
        play.seconds(1.0);
    }
}

#[test]
fn all_have_the_same_world_at_every_number() {
    let mut play = Play::new(&hills(96), 8, settings());
    play.changes_rules = true;
    dig(&mut play, count("BURROW_EDITS", 600));
    play.settle();
    let reference = &play.reference;
    let undone: usize = reference.undone.values().map(Vec::len).sum();
    println!(
        "{} entries, {} undone, {} changes of rules, {} loose pieces, {:?} of virtual time",
        reference.number, undone, reference.rule_changes, reference.loose, play.now
    );
    assert!(undone > 0 && reference.rule_changes > 3 && reference.loose > 0);
    assert!(play.up_lag <= TICK);
    for bot in &play.bots {
        let figures = bot.client.figures();
        println!(
            "{:?} own {} frames, lag {:?}, {figures:?} {:?}",
            bot.id, bot.own_frames, bot.lag, bot.events
        );
        assert_eq!((figures.repairs, figures.gaps), (0, 0));
        assert!(figures.hash_checks > 5);
        assert!(bot.own_frames <= 2, "an own edit was shown after {} frames", bot.own_frames);
        assert!(bot.lag <= 2 * TICK, "an edit of others was shown {:?} after it came", bot.lag);
        assert_eq!(bot.answered, bot.edits(), "every edit is answered once");
        assert_eq!(bot.event("predicted"), bot.edits());
        assert_eq!(bot.event("undone") + bot.event("not undone"), bot.undos, "every undo is answered once");
        assert_eq!(bot.undone, reference.undone.get(&bot.id).cloned().unwrap_or_default());
    }
}

/// Calls a function for the entries that are sent to the first player, until it has changed some; it may drop them.
fn tamper(play: &mut Play, mut change: impl FnMut(&mut Vec<Entry>) -> Tampered + 'static) {
    let (ground, stamps) = (Arc::clone(&play.ground), Arc::clone(&play.image));
    let mut known = bevy_burrow::net::ContentTable::default();
    known.add(stamps);
    let mut is_done = false;
    play.tamper = Some(Box::new(move |to, lane, bytes| {
        if is_done || to != ClientId(1) || lane != Lane::Main {
            return Some(bytes);
        }
        match ToClient::from_bytes(&bytes, &ground, &known) {
            Ok(ToClient::Entries(Entries { first, mut entries })) => {
                let tampered = change(&mut entries);
                is_done = !matches!(tampered, Tampered::Not);
                let message = ToClient::Entries(Entries { first, entries });
                (!matches!(tampered, Tampered::Dropped)).then(|| message.to_bytes())
            }
            _ => Some(bytes),
        }
    }));
    play.bots[0].may_differ = true;
}

enum Tampered {
    Not,
    Changed,
    Dropped,
}

fn sphere(x: f32, z: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, 20.0, z), 4.0))
}

fn edit(brush: &Brush) -> Edit {
    Edit::quantize(brush).expect("a valid brush")
}

#[test]
fn a_lost_message_is_noticed_and_what_it_held_comes_again() {
    let mut play = Play::new(&hills(96), 3, settings());
    play.seconds(3.0);
    let mut after = 10;
    tamper(&mut play, move |_| {
        after -= 1;
        if after == 0 { Tampered::Dropped } else { Tampered::Not }
    });
    play.seconds(8.0);
    play.settle();
    let figures = play.bots[0].client.figures();
    assert_eq!((figures.gaps, figures.repairs), (1, 0));
    assert_eq!(play.bots[0].event("joined"), 2);
    assert_eq!(play.bots[1].client.figures().gaps, 0);
}

/// Only the first player has something to repair, and has repaired it once.
fn check_repaired(play: &Play) {
    let repairs: Vec<u64> = play.bots.iter().map(|bot| bot.client.figures().repairs).collect();
    assert!(repairs[0] > 0, "nothing was noticed");
    assert_eq!((play.bots[0].event("repaired"), &repairs[1..]), (1, &[0, 0][..]));
    assert_eq!(play.server.figures().repairs, repairs[0]);
}

/// Three bots that have joined and do not dig.
fn quiet_play() -> Play {
    let mut play = Play::new(&hills(96), 3, settings());
    play.bots.iter_mut().for_each(|bot| bot.is_digging = false);
    play.seconds(3.0);
    play
}

/// The server changes parts of the world, and one bot receives different parts.
fn tamper_with_parts(play: &mut Play, mut damage: impl FnMut(&mut Patch) + 'static) {
    let mut other = terrain(&play.ground);
    other.apply([sphere(40.0, 40.0)]);
    play.server.submit(Order::parts(other.parts().change, None)).expect("it fits");
    tamper(play, move |entries| {
        for entry in entries {
            if let Entry::Order { order: Order::Parts { change, .. }, .. } = entry {
                damage(Arc::make_mut(change));
                return Tampered::Changed;
            }
        }
        Tampered::Not
    });
}

#[test]
fn rules_that_come_one_edit_late_are_noticed_at_the_next_mark_and_repaired() {
    let mut play = quiet_play();
    play.server.submit(Order::rules(DiggingRules::default().with_bedrock(60))).expect("valid rules");
    play.server.submit(edit(&sphere(40.0, 40.0))).expect("no stamp");
    play.server.submit(Order::rules(DiggingRules::default())).expect("valid rules");
    play.server.submit(edit(&sphere(80.0, 80.0))).expect("no stamp");
    tamper(&mut play, |entries| {
        entries.swap(0, 1);
        Tampered::Changed
    });
    play.settle();
    check_repaired(&play);
}

#[test]
fn a_brick_that_is_missing_is_noticed_at_the_next_mark_and_repaired() {
    let mut play = quiet_play();
    tamper_with_parts(&mut play, |change| {
        let at = change.bricks.iter().position(|(_, brick)| brick.is_some()).expect("a brick");
        change.bricks.remove(at);
    });
    play.settle();
    check_repaired(&play);
}

#[test]
fn names_of_fields_that_drift_are_noticed_at_the_next_mark_and_repaired() {
    let mut play = quiet_play();
    // Later fields have other names than those of the others; samples are equal.
    tamper_with_parts(&mut play, |change| change.next_field = 70);
    play.seconds(3.0);
    assert_eq!(play.bots[0].client.figures().repairs, 0, "no field has a name of its own");
    play.server.submit(edit(&sphere(80.0, 80.0))).expect("no stamp");
    play.bots[0].may_differ = false;
    play.settle();
    check_repaired(&play);
}

fn wait_until(play: &mut Play, at: usize, is_so: impl Fn(&Bot) -> bool) {
    for _ in 0..1200 {
        play.seconds(0.1);
        if is_so(&play.bots[at]) {
            return;
        }
    }
    panic!("{:?} waits: {:?}", play.bots[at].id, play.bots[at].client.figures());
}

fn wait_until_joined(play: &mut Play, at: usize) {
    wait_until(play, at, |bot| bot.client.has_joined());
}

/// Lets the server itself order this many edits.
fn dig_before(play: &mut Play, edits: u64) {
    let mut rng = Rng::with_seed(3);
    for done in 0..edits {
        let edit = Edit::quantize(&any_random_brush(&mut rng, &play.ground));
        if let Ok(edit) = edit
            && play.server.contents_mut().can_send(&edit)
        {
            play.server.submit(edit).expect("its content is known");
        }
        if done % 500 == 499 {
            play.server.advance(play.now);
            play.send();
        }
    }
    play.server.advance(play.now);
    play.send();
}

/// Players who dig while another one joins.
const OTHERS: usize = 4;

/// A client joins after many edits, over a line of 256 KiB a second, while four others dig.
fn join_late(log_bytes: usize) -> Play {
    // Without undo, edits that wait go into one transaction.
    let settings = ServerSettings { log_bytes, ..ServerSettings::default() };
    let edits = count("BURROW_EDITS", 600);
    let mut play = Play::new(&hills(if edits > 20_000 { 512 } else { 160 }), OTHERS as u64, settings);
    play.seconds(2.0);
    dig_before(&mut play, edits);
    play.seconds(20.0);
    let before = play.now;
    play.line.rate = 256 << 10;
    play.join();
    play.bots[OTHERS].client.set_near(64);
    wait_until(&mut play, OTHERS, |bot| bot.playable_at.is_some());
    let late = &play.bots[OTHERS];
    let playable = late.playable_at.expect("it is there") - before;
    println!(
        "{edits} edits, {log_bytes} bytes of log at most: {:?} bytes by lane, playable after {playable:?}",
        late.bytes
    );
    assert!(playable <= Duration::from_secs(15));
    assert!(play.bots.iter().all(|bot| bot.order.most.max(bot.bulk.most) <= 5 << 20));
    assert!(late.bytes.iter().sum::<u64>() <= 2_500_000, "too many bytes until play begins");
    play
}

/// All regions of many edits take minutes.
const MANY: u64 = 20_000;

#[test]
fn a_late_client_plays_soon() {
    let mut play = join_late(8 << 20);
    let late = &play.bots[OTHERS];
    assert!(late.client.has_joined(), "all of the log is there");
    assert!(late.client.figures().applied > count("BURROW_EDITS", 600) * 3 / 4, "it got regions");
    assert!(late.event("others") < 500, "old edits are reported one by one");
    play.settle();
    assert!(play.bots.iter().all(|bot| bot.client.figures().repairs == 0));
}

#[test]
fn a_late_client_plays_soon_without_the_whole_log() {
    let edits = count("BURROW_EDITS", 600);
    let mut play = join_late(edits as usize * 10);
    assert!(play.bots[OTHERS].client.figures().applied < edits / 2, "it got the log");
    if edits <= MANY {
        wait_until(&mut play, OTHERS, |bot| bot.client.has_joined());
        println!("joined with {:?} bytes by lane", play.bots[OTHERS].bytes);
        play.settle();
    }
    assert!(play.bots.iter().all(|bot| bot.client.figures().repairs == 0));
}

/// Cuts the first player's line for some seconds while others dig, and restores it.
fn come_back(settings: ServerSettings, away: f64) -> Play {
    let mut play = Play::new(&hills(96), 3, settings);
    play.seconds(6.0);
    play.cut(0);
    play.seconds(away);
    let before = play.bots[0].bytes;
    play.reconnect(0);
    let since = play.now;
    wait_until_joined(&mut play, 0);
    println!(
        "away {away} s: {:?} bytes by lane, before {before:?}, joined after {:?}",
        play.bots[0].bytes,
        play.now - since
    );
    play.settle();
    for bot in &play.bots {
        let figures = bot.client.figures();
        assert_eq!((figures.repairs, figures.gaps), (0, 0));
        assert_eq!(bot.answered, bot.edits(), "every edit of {:?} is answered once", bot.id);
        let undos = bot.event("undone") + bot.event("not undone");
        assert_eq!(undos, bot.undos, "every undo of {:?} is answered once", bot.id);
    }
    play
}

#[test]
fn a_client_that_reconnects_gets_the_entries_since() {
    come_back(settings(), 3.0);
}

#[test]
fn a_client_that_was_away_long_gets_the_regions_that_differ() {
    come_back(ServerSettings { log_bytes: 0, ..settings() }, 6.0);
}

/// Cuts a player's line while it joins, and restores it.
fn cut_while_joining(log_bytes: usize, rate: u64) {
    let slow = Rate { per_second: rate, burst: rate / 2 };
    let mut play = Play::new(&hills(160), 2, ServerSettings { bulk: slow, log_bytes, ..settings() });
    play.seconds(2.0);
    dig_before(&mut play, 1200);
    play.join();
    play.seconds(3.0);
    assert!(play.bots[2].bytes[Lane::Bulk as usize] > 0 && !play.bots[2].client.has_joined());
    play.cut(2);
    play.seconds(1.0);
    let sent = play.server.figures().bulk_bytes;
    play.seconds(2.0);
    assert_eq!(play.server.figures().bulk_bytes, sent, "nothing more is sent");
    play.reconnect(2);
    wait_until_joined(&mut play, 2);
    play.settle();
    assert!(play.bots.iter().all(|bot| bot.client.figures().repairs == 0));
    assert_eq!(play.bots[2].event("playable"), 1);
}

#[test]
fn a_client_cut_off_while_regions_come_gets_all_of_them_later() {
    cut_while_joining(0, 32 << 10);
}

#[test]
fn a_client_cut_off_while_the_log_comes_gets_all_of_it_later() {
    cut_while_joining(8 << 20, 4 << 10);
}

fn options() -> StoreOptions {
    StoreOptions { loss_window: Duration::ZERO, ..StoreOptions::default() }
}

#[test]
fn a_server_that_was_killed_goes_on_where_it_was_saved() {
    let ground = hills(96);
    let mut play = Play::new(&ground, 3, settings());
    let mut disk = SimulatedDisk::new();
    let mut saved = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut saved, options()).expect("a new world");
    for run in 0..3 {
        // Nothing is ordered while no client is connected.
        play.changes_rules = false;
        let stamps = play.server.contents_mut().clone();
        play.server = Server::open(saved, &store, settings());
        *play.server.contents_mut() = stamps;
        for at in 0..3 {
            if run > 0 {
                let bot = &play.bots[at];
                assert!(bot.durable <= play.server.epoch().number, "durable edits are lost");
            }
            play.cut(at);
        }
        let number = play.server.epoch().number;
        begin_again(&mut play);
        play.seconds(0.5);
        (0..3).for_each(|at| play.reconnect(at));
        play.changes_rules = run == 1;
        let start = Instant::now();
        for step in 0.. {
            play.step();
            play.server.save(&mut store).expect("the store's thread runs");
            let is_durable = play.bots.iter().all(|bot| bot.durable > number);
            if step >= 600 && is_durable {
                break;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "nothing became durable");
            // The store writes at its own pace.
            std::thread::sleep(Duration::from_micros(u64::from(step >= 600) * 1000));
        }
        // It is killed: the store does not save waiting commits.
        disk = disk.image().lose_process();
        drop(store);
        let (again, opened) =
            Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options()).expect("it can be opened");
        // Later runs are saved there.
        if run == 2 {
            let number = play.bots.iter().map(|bot| bot.durable).max().unwrap_or_default();
            let server = Server::open(opened.terrain, &again, settings());
            assert!(server.epoch().number >= number);
            break;
        }
        (store, saved) = (again, opened.terrain);
    }
    play.settle();
    assert!(play.bots.iter().all(|bot| bot.client.figures().repairs == 0));
}

/// The reference continues from the state of a server that was opened again.
fn begin_again(play: &mut Play) {
    let number = play.server.epoch().number;
    let world = play.server.terrain().world();
    assert_eq!(play.reference.hashes[&number], world.hash());
    let parts = play.server.terrain().parts();
    let mut reference = Terrain::restore(Arc::clone(&play.ground), &TerrainSettings::default(), parts)
        .expect("a world's own parts");
    reference.set_meshing(bevy_burrow::terrain::Meshing::Never);
    play.reference.begin_again(reference, number);
}

#[test]
fn each_edit_is_done_once_though_the_server_is_killed() {
    let ground = layered_hills(96);
    let mut play = Play::new(&ground, 5, ServerSettings::default());
    play.bots.iter_mut().for_each(|bot| bot.is_undoing = false);
    let mut disk = SimulatedDisk::new();
    let mut saved = terrain(&ground);
    let mut store = Store::create_in(Arc::new(disk.clone()), &mut saved, options()).expect("a new world");
    play.server = Server::open(saved, &store, ServerSettings::default());
    play.server.contents_mut().add(Arc::clone(&play.image));
    (0..5).for_each(|at| {
        play.cut(at);
        play.reconnect(at);
    });
    // Edits that were confirmed to their players but not saved when the server was killed.
    let (mut lost, mut unseen, mut rng) = (BTreeSet::new(), 0, Rng::with_seed(4));
    let kills = count("BURROW_KILLS", 5);
    for kill in 0..kills {
        for _ in 0..rng.u32(60..200) {
            play.step();
            play.server.save(&mut store).expect("the store's thread runs");
        }
        if kill % 2 == 0 {
            store.flush().expect("a disk that works");
        }
        disk = disk.image().lose_process();
        drop(store);
        let (again, opened) =
            Store::open_in(Arc::new(disk.clone()), Arc::clone(&ground), options()).expect("it can be opened");
        play.server = Server::open(opened.terrain, &again, ServerSettings::default());
        play.server.contents_mut().add(Arc::clone(&play.image));
        store = again;
        (0..5).for_each(|at| play.cut(at));
        let number = play.server.epoch().number;
        let is_open = |author: ClientId, sequence| play.bots[author.0 as usize - 1].open.contains(&sequence);
        for &(at, author, sequence) in &play.reference.done {
            match (at <= number, is_open(author, sequence)) {
                (true, true) => unseen += 1,
                (false, false) => drop(lost.insert((author, sequence))),
                _ => {}
            }
        }
        begin_again(&mut play);
        play.seconds(0.3);
        (0..5).for_each(|at| play.reconnect(at));
    }
    play.settle();
    let mut done: Vec<(ClientId, u64)> =
        play.reference.done.iter().map(|(_, author, sequence)| (*author, *sequence)).collect();
    done.sort_unstable();
    println!("{kills} kills, {} edits, {unseen} saved and not confirmed, {} lost", done.len(), lost.len());
    assert!(unseen > 0, "no saved edit was unconfirmed");
    assert!(done.windows(2).all(|pair| pair[0] != pair[1]), "an edit was applied twice");
    for bot in &play.bots {
        assert!(bot.open.is_empty() && bot.answered == bot.edits());
        for sequence in 1..=bot.edits() {
            let is_done = done.binary_search(&(bot.id, sequence)).is_ok();
            let is_known = bot.refused.contains(&sequence) || lost.contains(&(bot.id, sequence));
            assert!(is_done != is_known, "{:?} {sequence}: done {is_done}", bot.id);
        }
    }
}
