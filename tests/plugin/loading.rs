//! The first frames of a terrain.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

/// Loads a terrain and checks every frame; returns how many frames showed nothing yet.
fn load(stage: &mut Stage, terrain: Entity) -> usize {
    let mut empty = 0;
    stage.frames_until("the terrain is shown", |stage| {
        if stage.count::<Mesh3d>() == 0 {
            empty += 1;
            return false;
        }
        stage.assert_whole(terrain, "the first frame with meshes");
        true
    });
    for frame in 0..5 {
        stage.frame();
        stage.assert_whole(terrain, &format!("frame {frame} after the first"));
    }
    empty
}

#[test]
fn a_terrain_that_was_dug_before_shows_tiles_and_chunks_in_the_same_frame() {
    let mut model = steep();
    model.apply(random_brushes(4, 40));
    let (drawn, fields) = (model.world().drawn_chunks().count(), model.world().fields().count());
    assert!(drawn > 8 && fields > 8);

    for loads_per_frame in [1, 256] {
        let mut stage = Stage::drawing().with_settings(BurrowSettings { loads_per_frame, ..default() });
        let mut model = steep();
        model.apply(random_brushes(4, 40));
        let terrain = stage.spawn(model);
        let empty = load(&mut stage, terrain);
        assert!(loads_per_frame > 1 || empty >= 16 + drawn - 1, "one mesh a frame took {empty} frames");
        assert_eq!(stage.count::<Tile>(), 16);
        assert!(stage.count::<Chunk>() >= drawn);
        // Afterwards it behaves like any other terrain.
        for brush in random_brushes(5, 20) {
            stage.send(brush);
        }
        stage.settle();
        stage.assert_whole(terrain, "dug again");
    }
}

#[test]
fn brushes_that_come_while_a_terrain_loads_wait_and_then_apply() {
    let brushes = random_brushes(6, 24);
    let mut model = steep();
    model.apply(&brushes);

    // One mesh per frame: it loads for at least sixteen frames.
    let mut stage = Stage::drawing().with_settings(BurrowSettings { loads_per_frame: 1, ..default() });
    let terrain = stage.spawn(steep());
    let pristine = stage.hash(terrain);
    for pair in brushes.chunks(2) {
        pair.iter().for_each(|brush| stage.send(brush.clone()));
        stage.frame();
        assert_eq!(stage.count::<Tile>(), 0, "the terrain still loads");
        assert_eq!(stage.hash(terrain), pristine, "no brush is applied early");
    }
    assert_eq!(stage.terrain(terrain).queued(), brushes.len());
    assert!(stage.receipts().is_empty());
    load(&mut stage, terrain);
    stage.settle();
    assert_eq!(stage.tags(), (0..24).collect::<Vec<_>>());
    assert_eq!(stage.hash(terrain), model.world().hash());
    assert_eq!(stage.figures().commits, 1, "brushes that waited together are one commit");
    stage.assert_whole(terrain, "after loading");
}

#[test]
fn a_brush_in_the_first_frame_of_a_moved_and_scaled_terrain_goes_where_it_was_sent() {
    // A terrain may be dug in the frame that spawns it, in the very first frame of the app and later.
    for earlier in [0, 3] {
        let place = Vec3::new(100.0, 20.0, -40.0);
        let mut model = level(0.5);
        model.apply([dig(20.0, 8.0, 30.0, 4.0)]);

        let mut stage = Stage::drawing();
        stage.frames(earlier);
        let terrain = stage.spawn_at(level(0.5), place);
        stage.send(dig(110.0, 24.0, -25.0, 2.0));
        stage.settle();
        let outcomes: Vec<_> = stage.receipts().iter().map(|applied| &applied.receipt.outcome).collect();
        assert!(outcomes.iter().all(|outcome| outcome.is_ok()), "after {earlier} frames: {outcomes:?}");
        assert_eq!(stage.hash(terrain), model.world().hash(), "after {earlier} frames");
    }
}

#[test]
fn a_terrain_without_colours_loads_and_is_dug() {
    let mut stage = Stage::drawing();
    let terrain = stage.spawn(level(1.0));
    stage.app.world_mut().entity_mut(terrain).remove::<MaterialColors>();
    stage.settle();
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.settle();
    stage.assert_whole(terrain, "without colours");
    let meshes = stage.app.world().resource::<Assets<Mesh>>();
    assert!(meshes.iter().all(|(_, mesh)| mesh.attribute(Mesh::ATTRIBUTE_COLOR).is_none()));
}

/// The heights that a query found.
#[derive(Resource, Default)]
struct Floors(Vec<Option<f32>>);

#[test]
fn a_terrain_is_found_where_it_is_before_the_first_update() {
    let spawn = |mut commands: Commands| {
        commands.spawn((level(0.5), Transform::from_xyz(-256.0, 0.0, -256.0)));
        let island = (Transform::from_xyz(500.0, 20.0, 0.0), Visibility::default());
        commands.spawn(island).with_child(level(0.5));
    };
    let ask = |terrains: Terrains, mut floors: ResMut<Floors>| {
        floors.0 = vec![terrains.height(-250.0, -250.0), terrains.height(510.0, 10.0)];
    };
    let mut stage = Stage::drawing();
    stage.app.init_resource::<Floors>().add_systems(Startup, (spawn, ask).chain());
    stage.frame();
    assert_eq!(stage.app.world().resource::<Floors>().0, [Some(4.0), Some(24.0)]);
}
