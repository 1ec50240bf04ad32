//! Levels of detail: the drawn surface is closed in each frame, covers the world once, and follows cameras and edits.

use bevy::camera::{Camera, PerspectiveProjection, Projection};
use bevy::prelude::*;
use bevy_burrow::lattice::TilePos;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::stage::{Stage, dig};

/// Mountains of 320 x 270 voxels, no multiple of a stride.
pub fn mountains() -> Terrain {
    let noise =
        NoiseHeights { seed: 9, octaves: 5, scale: 70.0, amplitude: 60.0, base: 0.0, ..Default::default() };
    let ground = Ground::from_noise(320, 270, &noise).expect("valid mountains");
    Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid settings")
}

/// Levels that change within some hundred metres.
pub fn levels() -> LevelsOfDetail {
    LevelsOfDetail { cell_pixels: 24.0, error_pixels: 1.0, ..default() }
}

fn spawn_camera(stage: &mut Stage, at: Vec3) -> Entity {
    let projection =
        Projection::Perspective(PerspectiveProjection { fov: 0.785, ..PerspectiveProjection::default() });
    let place = Transform::from_translation(at);
    stage.app.world_mut().spawn((Camera::default(), projection, place)).id()
}

/// A terrain with levels, and a camera over one corner of it.
fn show(stage: &mut Stage, model: Terrain) -> (Entity, Entity) {
    let camera = spawn_camera(stage, Vec3::new(20.0, 70.0, 30.0));
    let terrain = stage.app.world_mut().spawn((model, levels())).id();
    stage.settle();
    (terrain, camera)
}

fn shown_levels(stage: &Stage, terrain: Entity) -> &ShownLevels {
    stage.app.world().get(terrain).expect("the plugin adds it")
}

/// All tiles that have a mesh.
fn drawn_tiles(stage: &mut Stage) -> Vec<Tile> {
    let world = stage.app.world_mut();
    world.query_filtered::<&Tile, With<Mesh3d>>().iter(world).copied().collect()
}

/// Each tile of the world is drawn by one node. Chunks may draw all of a tile of level 0.
fn assert_covers_once(stage: &mut Stage, terrain: Entity, what: &str) {
    let grid = stage.terrain(terrain).world().grid();
    let mut covered = vec![0; grid.tiles().count()];
    let (across, _) = grid.tile_counts();
    for Tile { x, z, level } in drawn_tiles(stage) {
        for tile in (z..z + (1 << level)).flat_map(|z| (x..x + (1 << level)).map(move |x| TilePos { x, z })) {
            if grid.has_tile(tile) {
                covered[(tile.z * across + tile.x) as usize] += 1;
            }
        }
    }
    let drawn = stage.terrain(terrain).drawn_cut().expect("a cut is drawn").cut().clone();
    for (tile, count) in grid.tiles().zip(covered) {
        let level = drawn.node_at(tile).map(|node| node.level);
        assert!(count == 1 || count == 0 && level == Some(0), "{what}: {tile:?} of {level:?}: {count}");
    }
}

/// `BURROW_FRAMES` is the number of frames.
#[test]
fn no_frame_of_a_flight_with_digging_shows_a_hole() {
    let frames = std::env::var("BURROW_FRAMES").ok().and_then(|frames| frames.parse().ok()).unwrap_or(500);
    let mut stage = Stage::drawing();
    let (terrain, camera) = show(&mut stage, mountains());
    stage.assert_whole(terrain, "loaded");
    let mut rng = Rng::with_seed(4);
    let (mut cuts, mut max_levels, mut last) = (0, 0, shown_levels(&stage, terrain).clone());
    for frame in 0..frames {
        let turn = frame as f32 / 400.0;
        let at = Vec3::new(
            160.0 + 150.0 * turn.cos(),
            60.0 + 30.0 * (turn * 3.0).sin(),
            135.0 + 120.0 * turn.sin(),
        );
        stage.app.world_mut().get_mut::<Transform>(camera).expect("the camera").translation = at;
        if rng.u32(0..6) == 0 {
            let (x, z) = (rng.f32() * 320.0, rng.f32() * 270.0);
            let (x, z) = if rng.bool() { (at.x, at.z) } else { (x, z) };
            let height = stage.terrain(terrain).world().height(x.into(), z.into()).unwrap_or_default() as f32;
            let shape = Shape::sphere(Vec3::new(x, height, z), 2.0 + rng.f32() * 8.0);
            stage.send(if rng.bool() { Brush::dig(shape) } else { Brush::add(shape, MaterialId(5)) });
        }
        stage.frames(1);
        let what = format!("frame {frame}");
        let shown = stage.shown(terrain);
        assert!(shown.is_closed(), "{what}: {shown:?}");
        assert_covers_once(&mut stage, terrain, &what);
        if frame % 50 == 0 {
            stage.assert_whole(terrain, &what);
        }
        let now = shown_levels(&stage, terrain);
        cuts += usize::from(now.nodes != last.nodes);
        last = now.clone();
        max_levels = max_levels.max(last.nodes.iter().filter(|&&count| count > 0).count());
    }
    stage.settle();
    println!("{frames} frames, the cut changed in {cuts} of them; now {:?}", last.nodes);
    assert!(cuts > 30 && max_levels > 2, "{cuts} changes, {max_levels} levels");
    // All is exact at level 0, wherever it is drawn coarsely.
    assert!(stage.terrain(terrain).world().check_seams().is_flawless());
}

#[test]
fn ground_near_a_camera_is_fine_and_far_ground_coarse() {
    let mut stage = Stage::drawing();
    let (terrain, camera) = show(&mut stage, mountains());
    let near = |stage: &mut Stage, at: Vec3| {
        let drawn = stage.terrain(terrain).drawn_cut().expect("a cut").clone();
        let tile = TilePos { x: (at.x / 16.0) as i32, z: (at.z / 16.0) as i32 };
        drawn.cut().node_at(tile).expect("inside the world").level
    };
    let (here, there) = (Vec3::new(20.0, 40.0, 30.0), Vec3::new(300.0, 40.0, 250.0));
    assert_eq!(near(&mut stage, here), 0);
    assert!(near(&mut stage, there) > 0);
    stage.app.world_mut().get_mut::<Transform>(camera).expect("the camera").translation = there;
    stage.frames_until("the cut follows", |stage| {
        let shown = shown_levels(stage, terrain);
        shown.waiting == 0 && near(stage, there) == 0 && near(stage, here) > 0
    });
    stage.assert_whole(terrain, "moved");
    // A second camera has its own part of the cut.
    spawn_camera(&mut stage, here);
    stage.frames_until("both are near", |stage| near(stage, there) == 0 && near(stage, here) == 0);
    assert_covers_once(&mut stage, terrain, "two cameras");
}

#[test]
fn a_far_pit_shows_in_the_frame_of_its_commit() {
    let mut stage = Stage::drawing();
    let (terrain, _) = show(&mut stage, mountains());
    let level = |stage: &Stage| {
        let drawn = stage.terrain(terrain).drawn_cut().expect("a cut");
        drawn.cut().node_at(TilePos { x: 17, z: 14 }).expect("inside the world").level
    };
    let before = level(&stage);
    assert!(before > 0, "it is far away");
    let height = stage.terrain(terrain).world().height(280.0, 230.0).expect("inside the world") as f32;
    stage.send(dig(280.0, height, 230.0, 20.0));
    let shown = stage.shown(terrain);
    stage.frames_until("the receipt comes", |stage| !stage.receipts().is_empty());
    assert_ne!(stage.shown(terrain), shown, "the pit shows at once");
    assert_eq!(level(&stage), before, "at the level that is drawn");
    stage.assert_whole(terrain, "dug");
    // Then it is drawn finer, as it was dug.
    stage.frames_until("it is refined", |stage| level(stage) < before);
    stage.assert_whole(terrain, "refined");
    stage.app.world_mut().write_message(Undo { terrain: Some(terrain) });
    stage.settle();
    stage.assert_whole(terrain, "undone");
}

#[test]
fn changes_that_a_game_commits_itself_are_shown_at_all_levels() {
    let mut stage = Stage::drawing();
    let (terrain, _) = show(&mut stage, mountains());
    for (x, z) in [(40.0, 40.0), (280.0, 230.0), (160.0, 135.0)] {
        let mut model = stage.app.world_mut().get_mut::<Terrain>(terrain).expect("the terrain");
        let height = model.world().height(x, z).expect("inside the world") as f32;
        model.apply([Brush::dig(Shape::sphere(Vec3::new(x as f32, height, z as f32), 9.0))]);
        stage.settle_shown();
        stage.frames(4);
        stage.settle_shown();
        stage.assert_whole(terrain, &format!("dug at {x}, {z}"));
    }
}

#[test]
fn a_terrain_that_gets_or_loses_levels_loads_anew() {
    let mut stage = Stage::drawing();
    spawn_camera(&mut stage, Vec3::new(20.0, 70.0, 30.0));
    let terrain = stage.show(mountains());
    stage.send(dig(150.0, 20.0, 140.0, 9.0));
    stage.settle();
    let tiles = stage.count::<Tile>();
    assert_eq!(tiles, stage.terrain(terrain).world().grid().tiles().count());
    stage.app.world_mut().entity_mut(terrain).insert(levels());
    stage.frames_until("levels are drawn", |stage| {
        stage.terrain(terrain).drawn_cut().is_some() && shown_levels(stage, terrain).waiting == 0
    });
    stage.assert_whole(terrain, "with levels");
    assert!(stage.count::<Tile>() < tiles);
    let shown = shown_levels(&stage, terrain);
    assert_eq!(shown.nodes.iter().sum::<usize>(), stage.count::<Tile>());
    stage.app.world_mut().entity_mut(terrain).remove::<LevelsOfDetail>();
    stage.frames_until("all is drawn in full", |stage| stage.terrain(terrain).drawn_cut().is_none());
    stage.settle();
    stage.assert_whole(terrain, "without levels");
    assert_eq!(stage.count::<Tile>(), tiles);
}

#[test]
fn a_world_without_cameras_is_drawn_at_its_coarsest() {
    let mut stage = Stage::drawing();
    let terrain = stage.app.world_mut().spawn((mountains(), levels())).id();
    stage.settle();
    stage.assert_whole(terrain, "no camera");
    let nodes = &shown_levels(&stage, terrain).nodes;
    assert_eq!(nodes.iter().rev().skip(1).sum::<usize>(), 0, "{nodes:?}");
}

#[test]
fn a_server_without_meshes_has_no_use_for_levels_and_loses_nothing_by_them() {
    let mut stage = Stage::server();
    let terrain = stage.app.world_mut().spawn((mountains(), levels())).id();
    stage.settle();
    stage.send(dig(150.0, 20.0, 140.0, 9.0));
    stage.settle();
    assert_eq!(stage.receipts().len(), 1);
    assert!(stage.terrain(terrain).world().bricks().count() > 0);
}

#[test]
fn levels_follow_a_camera_while_brushes_come_in_every_frame() {
    let mut stage = Stage::drawing();
    let (terrain, camera) = show(&mut stage, mountains());
    let there = Vec3::new(300.0, 40.0, 250.0);
    stage.app.world_mut().get_mut::<Transform>(camera).expect("the camera").translation = there;
    let level = |stage: &Stage| {
        let drawn = stage.terrain(terrain).drawn_cut().expect("a cut");
        drawn.cut().node_at(TilePos { x: 18, z: 15 }).expect("inside the world").level
    };
    assert!(level(&stage) > 0);
    let mut frame = 0;
    stage.frames_until("the ground there is fine", |stage| {
        stage.send(dig(40.0 + (frame % 30) as f32, 20.0, 40.0, 2.0));
        frame += 1;
        level(stage) == 0
    });
    stage.settle();
    stage.assert_whole(terrain, "dug and moved");
}
