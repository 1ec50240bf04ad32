//! Small transactions are committed in the frame in which they began, whole; all others later.

use std::time::Duration;

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level};

/// As long as it takes, or never.
fn settings(waits: bool) -> BurrowSettings {
    BurrowSettings { same_frame: Duration::from_secs(if waits { 60 } else { 0 }), ..default() }
}

/// A terrain with layers that has been shown.
fn stage(waits: bool) -> (Stage, Entity) {
    let mut stage = Stage::drawing().with_settings(settings(waits));
    let terrain = stage.show(level(1.0));
    stage.app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(3));
    stage.frame();
    (stage, terrain)
}

fn layers(stage: &mut Stage) -> Vec<Option<RenderLayers>> {
    let world = stage.app.world_mut();
    let mut parts = world.query_filtered::<Option<&RenderLayers>, With<Chunk>>();
    parts.iter(world).map(|layers| layers.cloned()).collect()
}

#[test]
fn a_brush_is_shown_whole_in_its_frame() {
    let (mut stage, terrain) = stage(true);
    for x in [20.0, 30.0, 44.0] {
        let (commits, hash) = (stage.figures().commits, stage.hash(terrain));
        stage.send(dig(x, 8.0, 30.0, 4.0));
        stage.frame();
        assert_eq!(stage.figures().commits, commits + 1);
        assert_ne!(stage.hash(terrain), hash);
        assert!(!stage.terrain(terrain).is_busy());
        stage.assert_whole(terrain, "in the frame of the brush");
        // Its entities are as those of any other frame.
        assert!(layers(&mut stage).iter().all(|layers| *layers == Some(RenderLayers::layer(3))));
        let world = stage.app.world_mut();
        let mut chunks = world.query_filtered::<(&GlobalTransform, &Transform), With<Chunk>>();
        for (global, local) in chunks.iter(world) {
            assert_eq!(global.translation(), local.translation, "transforms are those of this frame");
        }
    }
    assert_eq!(stage.receipts().len(), 3);
}

#[test]
fn undo_is_shown_in_its_frame() {
    let (mut stage, terrain) = stage(true);
    let pristine = stage.hash(terrain);
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.frame();
    assert_ne!(stage.hash(terrain), pristine);
    stage.write(Undo::default());
    stage.frame();
    assert_eq!(stage.hash(terrain), pristine);
    stage.assert_whole(terrain, "undone");
}

#[test]
fn without_waiting_a_brush_is_shown_later() {
    let (mut stage, terrain) = stage(false);
    let hash = stage.hash(terrain);
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.frame();
    assert_eq!((stage.hash(terrain), stage.receipts().len()), (hash, 0));
    stage.settle();
    assert_ne!(stage.hash(terrain), hash);
}

#[test]
fn large_edits_and_servers_do_not_wait() {
    let mut server = Stage::server().with_settings(settings(true));
    let terrain = server.show(level(1.0));
    let hash = server.hash(terrain);
    server.send(dig(30.0, 8.0, 30.0, 4.0));
    server.frame();
    assert_eq!(server.hash(terrain), hash);
    // A limit of a few microseconds is less than its work.
    let short = BurrowSettings { same_frame: Duration::from_micros(25), ..default() };
    let mut stage = Stage::drawing().with_settings(short);
    let terrain = stage.show(level(1.0));
    let hash = stage.hash(terrain);
    stage.send(dig(30.0, 8.0, 30.0, 20.0));
    stage.frame();
    assert_eq!(stage.hash(terrain), hash);
    stage.settle();
}

#[test]
fn a_gate_holds_in_its_frame_too() {
    #[derive(Resource)]
    struct Open(bool);
    let mut stage = Stage::drawing().with_settings(settings(true));
    stage.app.insert_resource(Open(true));
    let gate = BurrowSystems::Commit.run_if(|open: Res<Open>| open.0);
    stage.app.configure_sets(Update, gate);
    let terrain = stage.show(level(1.0));
    let hash = stage.hash(terrain);
    stage.app.insert_resource(Open(false));
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.frames(3);
    assert_eq!(stage.hash(terrain), hash, "commits are gated");
    stage.app.insert_resource(Open(true));
    stage.frames_until("it is committed", |stage| stage.hash(terrain) != hash);
}

#[test]
fn a_tile_keeps_what_a_game_took_from_it() {
    let (mut stage, _) = stage(true);
    let tiles = stage.with_component::<Tile>();
    for tile in &tiles {
        stage.app.world_mut().entity_mut(*tile).remove::<RenderLayers>();
    }
    for x in [20.0, 44.0] {
        stage.send(dig(x, 8.0, 30.0, 4.0));
        stage.frame();
    }
    assert!(layers(&mut stage).iter().all(Option::is_some));
    for tile in tiles {
        assert!(stage.app.world().get::<RenderLayers>(tile).is_none());
    }
}

#[test]
fn ground_that_breaks_off_is_gone_when_its_debris_is_there() {
    let mut stage = Stage::drawing().with_settings(settings(true)).recording::<LoosePieceFound>();
    let mut ground = level(1.0);
    let pillar = Shape::cuboid(Vec3::new(32.0, 12.0, 32.0), Vec3::new(1.2, 6.0, 1.2));
    let slab = Shape::cuboid(Vec3::new(32.0, 18.0, 32.0), Vec3::new(4.2, 2.2, 4.2));
    ground.apply([Brush::add(pillar, MaterialId(2)), Brush::add(slab, MaterialId(3))]);
    let terrain = stage.show(ground);
    stage.app.world_mut().entity_mut(terrain).insert(LooseSettings { debris: 9000, ..default() });
    let hash = stage.hash(terrain);
    stage.send(Brush::dig(Shape::cuboid(Vec3::new(32.0, 12.0, 32.0), Vec3::new(3.0, 1.2, 3.0))));
    stage.frame();
    // Systems that make debris run in `Update`.
    assert_eq!((stage.hash(terrain), stage.recorded::<LoosePieceFound>().len()), (hash, 0));
    stage.frames_until("it is committed", |stage| stage.hash(terrain) != hash);
    assert_eq!(stage.recorded::<LoosePieceFound>().len(), 1);
    // Nor does it come back before its debris can be removed.
    let hash = stage.hash(terrain);
    stage.write(Undo::default());
    stage.frame();
    assert_eq!(stage.hash(terrain), hash);
    stage.frames_until("it is undone", |stage| stage.hash(terrain) != hash);
}

#[test]
fn a_chunk_that_is_new_follows_its_terrain_in_the_next_frame() {
    let (mut stage, terrain) = stage(true);
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.frame();
    assert!(!layers(&mut stage).is_empty());
    stage.app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(5));
    stage.frame();
    assert!(layers(&mut stage).iter().all(|layers| *layers == Some(RenderLayers::layer(5))));
}

#[test]
fn the_budget_of_swaps_holds_for_all_commits_of_a_frame() {
    let settings = BurrowSettings { swaps_per_frame: 1, ..settings(true) };
    let mut stage = Stage::drawing().with_settings(settings);
    stage.show(level(1.0));
    stage.spawn_at(level(1.0), Vec3::new(100.0, 0.0, 0.0));
    stage.settle();
    for round in 0..4 {
        let mut commits = stage.figures().commits;
        for x in [0.0, 100.0] {
            stage.send(dig(x + 20.0 + 8.0 * round as f32, 8.0, 30.0, 4.0));
        }
        for _ in 0..2 {
            stage.frame();
            assert_eq!(stage.figures().commits, commits + 1);
            commits += 1;
        }
    }
}

#[test]
fn an_app_that_exits_leaves_an_edit_to_its_next_start() {
    let (mut stage, terrain) = stage(true);
    let hash = stage.hash(terrain);
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.write(AppExit::Success);
    stage.frame();
    assert_eq!(stage.hash(terrain), hash);
}

/// Bevy ends the app at the end of the frame, when its window is closed.
#[test]
fn an_app_whose_window_closes_leaves_an_edit_to_its_next_start() {
    let (mut stage, terrain) = stage(true);
    let hash = stage.hash(terrain);
    stage.app.world_mut().spawn(bevy::window::ClosingWindow);
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.frame();
    assert_eq!(stage.hash(terrain), hash);
}
