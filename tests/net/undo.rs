//! Undo by players: in order with their digs, answered while others dig, and only where the policy allows it.

use bevy_burrow::net::{ClientEvent, ClientId, Refusal, ServerSettings, UndoPolicy};

use crate::play::{ONE, Play, ball, flat};

/// Whether the first of two digs is undone, and the second stays.
fn stays(frames: u32) -> bool {
    let ground = flat(128);
    let mut play = Play::new(&ground, ServerSettings { undo: UndoPolicy::Own, ..ServerSettings::default() });
    let at = play.join(1);
    play.dig(at, &ball(30.0, 30.0, 4.0).with_stroke(1));
    play.frames(frames);
    play.players[at].client.undo(None);
    play.frames(frames);
    play.dig(at, &ball(90.0, 90.0, 4.0).with_stroke(2));
    play.frames(20);
    play.is_solid(30.0, 30.0) && !play.is_solid(90.0, 90.0)
}

#[test]
fn an_undo_takes_back_what_was_dug_before_it_and_not_what_was_dug_after() {
    assert!(stays(5) && stays(1) && stays(0));
}

#[test]
fn undos_among_digs_are_done_in_order_while_the_server_is_behind() {
    let ground = flat(128);
    let settings = ServerSettings { undo: UndoPolicy::Own, work: 1, ..ServerSettings::default() };
    let mut play = Play::new(&ground, settings);
    let (a, b) = (play.join(1), play.join(2));
    for turn in 0..8_u32 {
        let at = 16.0 + 12.0 * turn as f32;
        play.dig(a, &ball(at, 30.0, 4.0).with_stroke(turn.into()));
        if turn % 2 == 0 {
            play.players[a].client.undo(None);
        }
        play.dig(b, &ball(at, 90.0, 4.0));
    }
    play.frames(60);
    for turn in 0..8 {
        let at = 16.0 + 12.0 * f64::from(turn);
        assert_eq!(play.is_solid(at, 30.0), turn % 2 == 0, "{turn}");
        assert!(!play.is_solid(at, 90.0));
    }
    for player in &play.players {
        assert_eq!((player.client.world().hash(), player.refused()), (play.hash(), 0));
    }
}

/// The number of answers to undos in ten seconds, while another player digs several times a frame on a server with
/// small work limits.
fn answers(digs: u32) -> usize {
    let ground = flat(128);
    let settings = ServerSettings { undo: UndoPolicy::Own, work: 60, ..ServerSettings::default() };
    let mut play = Play::new(&ground, settings);
    let (a, b) = (play.join(1), play.join(2));
    play.dig(a, &ball(30.0, 30.0, 3.0));
    play.frames(5);
    play.players[a].client.undo(None);
    for turn in 0..200 {
        (0..digs).for_each(|step| play.dig(b, &ball(10.0 + ((turn * digs + step) % 100) as f32, 90.0, 3.0)));
        play.frames(1);
    }
    play.players[a].count(|event| matches!(event, ClientEvent::Undone(_) | ClientEvent::UndoRefused(_)))
}

#[test]
fn an_undo_is_answered_though_others_keep_the_server_busy() {
    assert_eq!([answers(0), answers(4)], [1, 1]);
}

#[test]
fn an_undo_that_nobody_may_do_is_forbidden() {
    let ground = flat(64);
    let mut play = Play::new(&ground, ServerSettings::default());
    let at = play.join(1);
    play.dig(at, &ball(30.0, 30.0, 3.0));
    play.players[at].client.undo(None);
    play.frames(4);
    let forbidden = ClientEvent::UndoRefused(Some(Refusal::Forbidden));
    assert_eq!(play.players[at].count(|event| *event == forbidden), 1);
}

#[test]
fn who_is_made_an_administrator_is_one() {
    for when in ["before", "now", "came back"] {
        let ground = flat(128);
        let settings = ServerSettings { undo: UndoPolicy::Administrators, ..ServerSettings::default() };
        let mut play = Play::new(&ground, settings);
        let pristine = play.hash();
        if when == "before" {
            play.server.set_administrator(ClientId(2), true);
        }
        let (a, b) = (play.join(1), play.join(2));
        play.server.set_administrator(ClientId(2), true);
        if when == "came back" {
            play.cut(b);
            play.connect(b);
            play.frames(4);
        }
        play.dig(a, &ball(30.0, 30.0, 3.0));
        play.frames(4);
        assert_ne!(play.hash(), pristine);
        play.players[b].client.undo(Some(ONE));
        play.frames(4);
        assert_eq!(play.hash(), pristine, "{when}");
        play.server.set_administrator(ClientId(2), false);
        play.dig(a, &ball(30.0, 30.0, 3.0));
        play.players[b].client.undo(Some(ONE));
        play.frames(4);
        assert_ne!(play.hash(), pristine, "{when}");
    }
}
