//! Images, grids and prefabs, which edits refer to by name: each reaches those who lack it, once.

use std::sync::Arc;
use std::time::Duration;

use bevy_burrow::brush::Edit;
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::net::{ClientEvent, Refusal, Server, ServerSettings, ToClient, ToServer};
use bevy_burrow::prelude::*;
use glam::{IVec3, UVec3, Vec2, Vec3};

use crate::follower::terrain;
use crate::pair::{ID, joined, joins_again, new_client, pump, quick};
use crate::play::{Play, ball, flat};

fn image(side: u32) -> Arc<GreyImage> {
    let samples = (0..side * side).map(|at| (at * 900 % 60_000) as u16).collect();
    Arc::new(GreyImage::from_samples(side, side, samples).expect("an image"))
}

fn stamp(image: &Arc<GreyImage>, x: f32) -> Brush {
    let at = Vec3::new(x, 20.0, 64.0);
    Brush::stamp(Shape::sphere(at, 6.0), Stamp::new(Arc::clone(image), at, Vec2::splat(9.0), 3.0))
}

/// Players without an image get it, while they play, in the log that they join with, and when it was added later.
#[test]
fn who_lacks_the_image_of_a_stamp_gets_it() {
    let ground = flat(128);
    let mut play = Play::new(&ground, ServerSettings::default());
    let (first, later) = (image(8), image(100));
    let (a, b) = (play.join(1), play.join(2));
    for (image, x) in [(&first, 40.0), (&later, 80.0)] {
        play.server.contents_mut().add(Arc::clone(image));
        play.players[a].client.contents_mut().add(Arc::clone(image));
        play.dig(a, &stamp(image, x));
        play.dig(a, &ball(30.0, 30.0, 4.0));
        play.frames(40);
        for player in &play.players {
            assert_eq!(player.client.world().hash(), play.hash());
        }
    }
    let c = play.join(3);
    play.frames(40);
    assert!(play.players[c].client.has_joined());
    assert_eq!(play.players[c].client.world().hash(), play.hash());
    for player in [b, c].map(|at| &play.players[at]) {
        assert_eq!((player.client.figures().malformed, player.kicked()), (0, 0));
    }
    assert_eq!(play.server.figures().malformed, 0);
}

/// An image that the server lacks: the edit is refused, and the others in the message are applied.
#[test]
fn a_stamp_that_the_server_does_not_know_is_refused() {
    let ground = flat(128);
    let mut play = Play::new(&ground, ServerSettings::default());
    let (unknown, at) = (image(8), play.join(1));
    play.players[at].client.contents_mut().add(Arc::clone(&unknown));
    play.dig(at, &ball(30.0, 30.0, 4.0));
    play.dig(at, &stamp(&unknown, 64.0).with_tag(5));
    play.dig(at, &ball(90.0, 90.0, 4.0));
    play.frames(10);
    let player = &play.players[at];
    let refused = ClientEvent::Refused { tag: 5, why: Some(Refusal::UnknownContent) };
    assert_eq!((player.count(|event| *event == refused), player.confirmed()), (1, 2));
    assert_eq!((player.client.pending(), play.server.figures().malformed), (0, 0));
}

#[test]
fn paths_roads_and_grids_reach_everybody() {
    let ((mut server, ground), mut now) = (quick(128, 20), Duration::from_secs(1));
    server.connect(ID, now);
    let mut client = new_client(&ground, now);
    while !client.has_joined() {
        pump(&mut server, &mut client, &mut now);
    }
    let path = |y: f32| {
        BrushPath::spline([10.0, 40.0, 66.0, 90.0].map(|x| (Vec3::new(x, y - 0.05 * x, 20.0 + 0.6 * x), 2.0)))
    };
    let road = Corridor::new(path(3.0), 6.0, 9.0);
    for (tag, brush) in (1..).zip([Brush::dig(path(-8.0)), Brush::road(road, 2.0)]) {
        let before = server.terrain().world().hash();
        client.submit(Edit::quantize(&brush.with_tag(tag)).expect("valid"));
        client.advance(now);
        (0..200).for_each(|_| pump(&mut server, &mut client, &mut now));
        assert_ne!(server.terrain().world().hash(), before, "brush {tag}");
        assert_eq!(client.world().hash(), server.terrain().world().hash());
    }
    assert_eq!((server.figures().malformed, server.figures().refused), (0, 0));
    // A grid is named: the client gets it once.
    let grid = ShapeGrid::from_fn(UVec3::splat(40), |at| (at - 20).as_vec3().length() - 15.5).expect("valid");
    let shape = |x: f32| GridShape::new(grid.clone(), Vec3::new(x, 2.0, 70.0)).with_scale(0.5);
    let edit = |x: f32| Edit::quantize(&Brush::dig(shape(x))).expect("valid");
    assert!(server.submit(edit(50.0)).is_err(), "nobody can get it");
    server.contents_mut().add(Arc::clone(grid.image()));
    let sent = |server: &Server| server.figures().bulk_bytes;
    let before = sent(&server);
    for x in [50.0, 56.0, 30.0] {
        server.submit(edit(x)).expect("it is in the list");
        (0..200).for_each(|_| pump(&mut server, &mut client, &mut now));
        assert_eq!(client.world().hash(), server.terrain().world().hash());
    }
    let bytes = 2 * 40 * 40 * 40;
    assert!((bytes..bytes + bytes / 4).contains(&(sent(&server) - before)), "{}", sent(&server) - before);
    // Clients that have it dig with it too.
    client.submit(edit(90.0).with_labels(9, None));
    (0..200).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert_eq!(client.world().hash(), server.terrain().world().hash());
    assert_eq!((server.figures().malformed, server.figures().refused), (0, 0));
    // One that joins later gets the same world.
    assert!(joins_again(&mut server, &ground, &mut now).is_some());
}

/// A ball of some samples along its side.
fn grid_ball(side: i32) -> ShapeGrid {
    let middle = (side - 1) as f32 / 2.0;
    let distance = |at: IVec3| (at.as_vec3() - middle).length() - middle + 1.5;
    ShapeGrid::from_fn(UVec3::splat(side as u32), distance).expect("valid")
}

#[test]
fn a_paste_within_a_grid_reaches_everybody() {
    let (mut server, mut client, ground, mut now) = joined();
    let prefab = {
        let mut other = terrain(&ground);
        other.apply([Brush::add(Shape::sphere(Vec3::new(30.0, 20.0, 30.0), 9.0), MaterialId(3))]);
        let min = IVec3::new(18, 8, 18);
        Arc::new(other.world().copy(LatticeBox { min, max: min + 24 }, min).expect("in the world"))
    };
    let grid = grid_ball(20);
    let paste = |at: Vec3| {
        let within = GridShape::new(grid.clone(), at + 12.0);
        let operation = Operation::Paste { paste: Paste::new(Arc::clone(&prefab), at) };
        Edit::quantize(&Brush { operation, ..Brush::dig(within) }).expect("valid")
    };
    let at = Vec3::new(60.0, 8.0, 60.0);
    assert!(server.submit(paste(at)).is_err(), "nobody can get it");
    server.contents_mut().add(Arc::clone(grid.image()));
    assert!(server.submit(paste(at)).is_err(), "nobody can get the prefab");
    assert!(server.contents_mut().add_prefab(Arc::clone(&prefab)).is_some());
    let before = server.terrain().world().hash();
    server.submit(paste(at)).expect("both are in the list");
    (0..200).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert_ne!(server.terrain().world().hash(), before);
    assert_eq!(client.world().hash(), server.terrain().world().hash());
    // The client has both now.
    client.submit(paste(at + 20.0).with_labels(9, None));
    (0..200).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert_eq!(client.world().hash(), server.terrain().world().hash());
    assert_eq!((server.figures().malformed, server.figures().refused), (0, 0));
    assert_eq!(client.figures().malformed, 0);
    assert!(joins_again(&mut server, &ground, &mut now).is_some());
}

#[test]
fn the_largest_grid_with_materials_reaches_everybody() {
    let (mut server, mut client, ground, mut now) = joined();
    let grid = grid_ball(128).with_materials(|at| MaterialId(if at.y > 60 { 3 } else { 2 }));
    assert!(grid.has_materials());
    server.contents_mut().add(Arc::clone(grid.image()));
    let within = GridShape::new(grid, Vec3::new(60.0, 8.0, 60.0)).with_scale(0.25);
    server.submit(Brush::fill(within, 0.0)).expect("it is in the list");
    let before = server.terrain().world().hash();
    (0..1000).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert_ne!(server.terrain().world().hash(), before);
    assert_eq!(client.world().hash(), server.terrain().world().hash());
    assert_eq!((server.figures().malformed, client.figures().malformed), (0, 0));
    assert!(joins_again(&mut server, &ground, &mut now).is_some());
}

#[test]
fn a_grid_that_is_too_large_where_it_is_named_is_refused() {
    let (mut server, mut client, _, mut now) = joined();
    let (small, large) = (grid_ball(5), grid_ball(128));
    let known = [&small, &large].map(|grid| server.contents_mut().add(Arc::clone(grid.image())));
    let shape = GridShape::new(small, Vec3::splat(40.0)).with_scale(64.0);
    let edit = Edit::quantize(&Brush::dig(shape)).expect("valid");
    let mut message = ToServer::Edits { first: 1, edits: vec![edit] }.to_bytes();
    // That edit with the name of the other grid: 8,128 voxels a side.
    let name = known[0].0.to_le_bytes();
    let at = message.windows(8).position(|window| window == name).expect("its name is in it");
    message[at..at + 8].copy_from_slice(&known[1].0.to_le_bytes());
    let before = server.terrain().world().hash();
    server.receive(ID, &message, now);
    let answers: Vec<Vec<u8>> = server.take_outgoing().into_iter().map(|(_, _, bytes)| bytes).collect();
    let refused = ToClient::Refused { sequence: 1, why: Refusal::TooLarge }.to_bytes();
    assert_eq!(answers, [refused]);
    (0..20).for_each(|_| pump(&mut server, &mut client, &mut now));
    assert_eq!(server.terrain().world().hash(), before);
    assert_eq!((server.figures().malformed, server.figures().refused), (0, 1));
}
