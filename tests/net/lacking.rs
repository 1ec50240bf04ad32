//! Everybody has other images, grids and prefabs, players too that join late: what the server lacks is refused and taken
//! back, with all predictions that were built on it; all else reaches everybody.

use std::sync::Arc;

use bevy_burrow::brush::Edit;
use bevy_burrow::lattice::Column;
use bevy_burrow::net::{ClientEvent, ContentTable, Refusal, ServerSettings, UndoPolicy};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{Vec2, Vec3};

use crate::follower::{count, layered_hills, terrain};
use crate::play::Play;
use crate::worlds::{any_random_brush, check_fields, contents, random_grid};

fn images() -> [Arc<GreyImage>; 2] {
    [6_u16, 9].map(|side| {
        let samples = (0..side * side).map(|at| at * 700).collect();
        Arc::new(GreyImage::from_samples(side.into(), side.into(), samples).expect("an image"))
    })
}

/// Some of everything.
fn some(rng: &mut Rng, images: &[Arc<GreyImage>]) -> ContentTable {
    let (grids, prefabs) = contents();
    let mut table = ContentTable::default();
    for image in grids.iter().map(ShapeGrid::image).chain(images).filter(|_| rng.u8(..3) > 0) {
        table.add(Arc::clone(image));
    }
    for prefab in prefabs.iter().filter(|_| rng.u8(..3) > 0) {
        table.add_prefab(Arc::clone(prefab)).expect("it is small");
    }
    table
}

fn brush(rng: &mut Rng, ground: &Ground, images: &[Arc<GreyImage>]) -> Brush {
    let (x, z) = (rng.i32(40..64), rng.i32(40..64));
    let at = Vec3::new(x as f32, ground.height(Column::new(x, z)) as f32 / 256.0, z as f32);
    let prefabs = &contents().1;
    let paste = Paste::new(Arc::clone(&prefabs[rng.usize(..prefabs.len())]), at.round());
    let paste = paste.turned_about_y(rng.i32(0..4));
    match rng.u8(..8) {
        0 => Brush::paste(paste),
        1 => Brush::paste(paste.edited_only().mirrored()),
        2 => Brush::fill(random_grid(rng, at), rng.f32() * 3.0),
        3 => Brush::dig(random_grid(rng, at)),
        4 => {
            let image = Arc::clone(&images[rng.usize(..images.len())]);
            Brush::stamp(Shape::sphere(at, 6.0), Stamp::new(image, at, Vec2::splat(9.0), 3.0))
        }
        5 => Brush { operation: Operation::Paste { paste }, ..Brush::dig(random_grid(rng, at)) },
        6 => Brush::reset(Shape::sphere(at, 3.0 + rng.f32() * 9.0)),
        _ => any_random_brush(rng, ground),
    }
}

#[test]
fn who_lacks_whatever_has_the_world_of_the_server_in_the_end() {
    let (mut refused, mut unsent, mut confirmed) = (0, 0, 0);
    let (mut own_refusals, mut unknown) = (0, 0);
    for seed in 0..count("BURROW_WORLDS", 4) {
        let rng = &mut Rng::with_seed(seed + 70);
        let (ground, images) = (layered_hills(96), images());
        let settings = ServerSettings { undo: UndoPolicy::Own, ..ServerSettings::default() };
        let mut play = Play::new(&ground, settings);
        let known = some(rng, &images);
        play.server.contents_mut().add_all(&known);
        let loose = LooseSettings { largest: 4000, crumbs: 20, debris: 3000 };
        play.server.submit(Order::Loose(Some(loose))).expect("it can be shared");
        let join = |play: &mut Play, rng: &mut Rng, id: u64| {
            let table = some(rng, &images);
            play.join_with(id, table, Some(terrain(&ground)))
        };
        for id in 1..4 {
            join(&mut play, rng, id);
        }
        for turn in 0..50_u64 {
            let at = rng.usize(..play.players.len());
            let player = &mut play.players[at];
            if rng.u8(..8) == 0 {
                player.client.undo(None);
            }
            for step in 0..rng.u64(1..4) {
                let brush = brush(rng, &ground, &images).with_tag(turn * 10 + step).with_stroke(turn / 4);
                let Ok(edit) = Edit::quantize(&brush) else { continue };
                let can = player.client.contents_mut().can_send(&edit);
                own_refusals += usize::from(!can);
                unknown += usize::from(can && !known.can_send(&edit));
                player.client.submit(edit);
            }
            play.frames(rng.u32(..3));
            for player in &play.players {
                let shown = player.shown.as_ref().expect("it sees").world();
                assert_eq!(shown.hash(), player.client.shown_hash(), "seed {seed}, turn {turn}");
            }
            if turn == 25 || turn == 40 {
                join(&mut play, rng, turn);
            }
        }
        play.frames(120);
        check_fields(play.server.terrain().world(), &format!("seed {seed}"));
        let (hash, parts) = (play.hash(), play.server.terrain().parts().change.fields);
        for player in &play.players {
            let what = format!("seed {seed}, {:?}: {:?}", player.id, player.client.figures());
            assert!(player.client.has_joined(), "{what}");
            assert_eq!((player.client.world().hash(), player.client.pending()), (hash, 0), "{what}");
            let shown = player.shown.as_ref().expect("it sees");
            assert_eq!(shown.world().hash(), hash, "{what}");
            assert_eq!(shown.parts().change.fields, parts, "{what}");
            let figures = player.client.figures();
            assert_eq!((figures.malformed, figures.repairs, figures.gaps), (0, 0, 0), "{what}");
            let why = |why| {
                player.count(|event| matches!(event, ClientEvent::Refused { why: own, .. } if *own == why))
            };
            refused += why(Some(Refusal::UnknownContent));
            unsent += why(None);
            confirmed += player.confirmed();
        }
        assert_eq!(play.server.figures().malformed, 0, "seed {seed}");
        assert_eq!((unsent, refused), (own_refusals, unknown), "seed {seed}");
    }
    assert!(refused > 20 && unsent > 20 && confirmed > 100, "{refused} {unsent} {confirmed}");
}
