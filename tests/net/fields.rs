//! Fields while players dig, build, reset, paste and undo in the same chunks: they hold what is edited and nothing else.

use std::sync::Arc;

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::net::{ClientEvent, Refusal, ServerSettings, UndoPolicy};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World;
use fastrand::Rng;
use glam::{IVec3, Vec3};

use crate::follower::{count, terrain};
use crate::play::{Play, ball, flat};
use crate::worlds::check_fields;

fn play_of(ground: &Arc<Ground>) -> Play {
    Play::new(ground, ServerSettings { undo: UndoPolicy::Own, ..ServerSettings::default() })
}

/// Boxes of all fields, in order.
fn boxes(world: &World) -> Vec<LatticeBox> {
    let mut all: Vec<LatticeBox> =
        world.fields().flat_map(|(_, fields)| fields.iter().map(|field| field.bounds)).collect();
    all.sort_by_key(|own| (own.min.to_array(), own.max.to_array()));
    all
}

fn reset(x: f32, z: f32, radius: f32) -> Brush {
    Brush::reset(Shape::sphere(Vec3::new(x, 20.0, z), radius))
}

/// Two players in one chunk, of 32 voxels a side. Nothing is left of the field of ground that is undone.
#[test]
fn undos_of_two_players_in_one_chunk_leave_no_field_behind() {
    let ground = flat(64);
    let mut play = play_of(&ground);
    let (a, b) = (play.join(1), play.join(2));
    play.dig(a, &ball(7.0, 7.0, 2.0));
    play.frames(4);
    play.dig(b, &ball(22.0, 22.0, 2.0));
    play.frames(4);
    for player in [a, b] {
        play.players[player].client.undo(None);
        play.frames(4);
        check_fields(play.server.terrain().world(), "undone");
    }
    assert_eq!(play.server.terrain().world().fields().count(), 0);
}

/// A reset shrinks a field, another player digs next to the rest, and the reset is undone.
#[test]
fn an_undone_reset_has_its_field_though_others_dug_in_the_chunk_since() {
    let ground = flat(64);
    let mut play = play_of(&ground);
    let (a, b) = (play.join(1), play.join(2));
    // One field, because the edits meet.
    play.dig(b, &Brush::dig(Shape::capsule(Vec3::new(4.0, 20.0, 4.0), Vec3::new(20.0, 20.0, 4.0), 2.0)));
    play.frames(4);
    let before = boxes(play.server.terrain().world());
    play.dig(a, &reset(4.0, 4.0, 5.0));
    play.frames(4);
    assert_ne!(boxes(play.server.terrain().world()), before);
    play.dig(b, &ball(20.0, 24.0, 2.0));
    play.frames(4);
    check_fields(play.server.terrain().world(), "reset");
    play.players[a].client.undo(None);
    play.frames(4);
    check_fields(play.server.terrain().world(), "undone");
    let after = boxes(play.server.terrain().world());
    assert!(before.iter().all(|own| after.iter().any(|field| field.encloses(*own))), "{before:?} {after:?}");
}

/// A stroke that continues after another player dug in its chunk.
#[test]
fn an_undone_stroke_leaves_the_fields_of_those_who_dug_between_its_edits() {
    let ground = flat(64);
    let mut play = play_of(&ground);
    let (a, b) = (play.join(1), play.join(2));
    play.dig(a, &ball(5.0, 5.0, 2.0).with_stroke(1));
    play.frames(4);
    play.dig(b, &ball(26.0, 26.0, 3.0));
    play.frames(4);
    play.dig(a, &ball(7.0, 5.0, 2.0).with_stroke(1));
    play.frames(4);
    play.players[a].client.undo(None);
    play.frames(4);
    assert!(play.is_solid(5.0, 5.0) && !play.is_solid(26.0, 26.0));
    check_fields(play.server.terrain().world(), "undone");
}

#[test]
fn fields_fit_what_is_edited_whatever_players_do_and_undo() {
    let (mut undone, mut touched) = (0, 0);
    for seed in 0..count("BURROW_WORLDS", 4) {
        let (ground, mut rng) = (flat(64), Rng::with_seed(seed));
        let mut play = play_of(&ground);
        let prefab = {
            let mut other = terrain(&ground);
            other.apply([Brush::add(Shape::sphere(Vec3::new(30.0, 20.0, 30.0), 3.0), MaterialId(3))]);
            let around = LatticeBox::point(IVec3::new(30, 20, 30)).grown(6);
            Arc::new(other.world().copy(around, IVec3::new(30, 20, 30)).expect("in the world"))
        };
        play.server.contents_mut().add_prefab(Arc::clone(&prefab)).expect("it is small");
        for id in 1..4 {
            let at = play.join(id);
            play.players[at].client.contents_mut().add_prefab(Arc::clone(&prefab)).expect("it is small");
        }
        for turn in 0..60_u64 {
            let player = rng.usize(..3);
            let at = Vec3::new(rng.f32() * 48.0, 18.0 + rng.f32() * 4.0, rng.f32() * 48.0);
            let shape = Shape::sphere(at, 1.5 + rng.f32() * 4.0);
            let brush = match rng.u8(..9) {
                0..3 => Brush::dig(shape),
                3 => Brush::add(shape, MaterialId(2)),
                4 => Brush::paint(shape, MaterialId(4)),
                5 => Brush::paste(Paste::new(Arc::clone(&prefab), at.round()).edited_only()),
                6 => Brush::fill(shape, 2.0),
                _ => Brush::reset(shape),
            };
            match rng.u8(..3) {
                0 => play.players[player].client.undo(None),
                1 => play.dig(player, &brush.with_stroke(turn / 8)),
                _ => play.dig(player, &brush),
            }
            play.frames(rng.u32(..4));
            check_fields(play.server.terrain().world(), &format!("seed {seed}, turn {turn}"));
        }
        play.frames(20);
        for player in &play.players {
            let (own, servers) = (player.client.world(), play.server.terrain().world());
            assert_eq!((own.hash(), boxes(own)), (servers.hash(), boxes(servers)), "seed {seed}");
            undone += player.count(|event| matches!(event, ClientEvent::Undone(_)));
            touched += player.count(|event| *event == ClientEvent::UndoRefused(Some(Refusal::Touched)));
        }
        assert_eq!(play.server.figures().malformed, 0);
    }
    assert!(undone > 20 && touched > 4, "{undone} undone, {touched} refused");
}
