//! Games that run the plugin's systems in one state only, and terrains that are disabled for a while.

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::entity_disabling::Disabled;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level};

#[derive(Resource, Clone, PartialEq)]
struct Playing(bool);

/// A stage whose plugin runs while the game is played.
fn stage() -> Stage {
    let mut stage = Stage::drawing().recording::<HistoryMoved>();
    stage.run_while(Playing(true));
    stage
}

/// Some frames without the plugin's systems.
fn pause(stage: &mut Stage, change: impl FnOnce(&mut Stage)) {
    stage.app.world_mut().resource_mut::<Playing>().0 = false;
    stage.frames(4);
    change(stage);
    stage.frames(20);
    stage.app.world_mut().resource_mut::<Playing>().0 = true;
    stage.frames(4);
    stage.settle();
}

#[test]
fn every_brush_and_step_that_is_sent_in_a_pause_is_answered() {
    let mut stage = stage();
    let terrain = stage.show(level(1.0));
    let mut model = level(1.0);
    pause(&mut stage, |stage| {
        for tag in 0..12 {
            let brush = dig(10.0 + 4.0 * tag as f32, 8.0, 30.0, 4.0).with_tag(tag);
            model.apply([&brush]);
            stage.send(brush);
            stage.frames(3);
        }
        stage.send_to(terrain, dig(30.0, 8.0, 50.0, 4.0).with_tag(12));
        stage.send_to(Entity::PLACEHOLDER, dig(30.0, 8.0, 50.0, 4.0).with_tag(13));
        stage.send(dig(5000.0, 8.0, 50.0, 4.0).with_tag(14));
        stage.frames(5);
    });
    let mut tags = stage.tags();
    tags.sort_unstable();
    assert_eq!(tags, (0..15).collect::<Vec<_>>());
    model.apply([dig(30.0, 8.0, 50.0, 4.0)]);
    assert_eq!(stage.hash(terrain), model.world().hash());
    stage.recorded::<HistoryMoved>();
    pause(&mut stage, |stage| {
        stage.write(Undo::default());
        stage.frames(5);
        stage.write(Redo::default());
        stage.write(Undo { terrain: Some(Entity::PLACEHOLDER) });
    });
    let moved = stage.recorded::<HistoryMoved>();
    assert_eq!(moved.len(), 3, "{moved:?}");
}

fn with<C: Component>(stage: &mut Stage) -> usize {
    let world = stage.app.world_mut();
    world
        .query_filtered::<(), (With<C>, Or<(With<Tile>, With<Chunk>, With<GroundPiece>)>)>()
        .iter(world)
        .count()
}

#[test]
fn layers_that_change_in_a_pause_are_caught_up_with() {
    let mut stage = stage();
    let terrain = stage.app.world_mut().spawn((level(1.0), RenderLayers::layer(3))).id();
    stage.settle();
    stage.app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ZERO });
    stage.frames(4);
    assert_eq!(with::<RenderLayers>(&mut stage), 17);
    pause(&mut stage, |stage| {
        stage.app.world_mut().entity_mut(terrain).remove::<RenderLayers>();
    });
    assert_eq!(with::<RenderLayers>(&mut stage), 0);
    pause(&mut stage, |stage| {
        stage.app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(5));
    });
    assert_eq!(with::<RenderLayers>(&mut stage), 17);
    // Removed and inserted again: others than before.
    pause(&mut stage, |stage| {
        stage.app.world_mut().entity_mut(terrain).remove::<RenderLayers>();
        stage.frames(4);
        stage.app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(6));
    });
    let world = stage.app.world_mut();
    let mut layers = world.query_filtered::<&RenderLayers, Or<(With<Tile>, With<GroundPiece>)>>();
    assert!(layers.iter(world).all(|layers| *layers == RenderLayers::layer(6)));
}

#[cfg(feature = "examples")]
#[test]
fn looks_and_shadows_that_are_removed_in_a_pause_are_caught_up_with() {
    use bevy::light::NotShadowCaster;

    let mut stage = Stage::windowless();
    stage
        .app
        .insert_resource(GroundTextures::Baked { side: 16, anisotropy: 1 })
        .insert_resource(Playing(true));
    stage.app.configure_sets(Update, BurrowSystems::Propagate.run_if(resource_equals(Playing(true))));
    let terrain = stage.app.world_mut().spawn((level(1.0), GroundLook::default(), NotShadowCaster)).id();
    stage.frames_until("it is dressed", |stage| with::<MeshMaterial3d<GroundMaterial>>(stage) == 16);
    pause(&mut stage, |stage| {
        stage.app.world_mut().entity_mut(terrain).remove::<(GroundLook, NotShadowCaster)>();
    });
    assert_eq!(with::<MeshMaterial3d<GroundMaterial>>(&mut stage), 0);
    assert_eq!(with::<NotShadowCaster>(&mut stage), 0);
}

#[test]
fn terrains_that_go_in_a_pause_answer_at_once() {
    let mut stage = stage();
    let terrain = stage.show(level(1.0));
    stage.send(dig(30.0, 8.0, 30.0, 4.0).with_tag(7));
    stage.frame();
    stage.app.world_mut().resource_mut::<Playing>().0 = false;
    stage.app.world_mut().despawn(terrain);
    stage.frames(3);
    assert_eq!(stage.tags(), [7]);
    assert_eq!(stage.count::<Tile>(), 0);
}

#[test]
fn brushes_that_wait_in_a_disabled_terrain_are_answered_when_it_goes() {
    for is_whole in [true, false] {
        let mut stage = Stage::drawing();
        let terrain = stage.show(level(1.0));
        stage.send(dig(30.0, 8.0, 30.0, 4.0).with_tag(7));
        stage.frame();
        stage.app.world_mut().entity_mut(terrain).insert(Disabled);
        stage.frames(4);
        if is_whole {
            stage.app.world_mut().despawn(terrain);
        } else {
            stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
        }
        stage.frames(4);
        assert_eq!(stage.tags(), [7], "each brush has one receipt");
        assert_eq!(stage.count::<Tile>(), 0, "nothing is left that nobody owns");
        let world = stage.app.world_mut();
        let rest = world.query_filtered::<(), (With<Tile>, Allow<Disabled>)>().iter(world).count();
        assert_eq!(rest, 0);
    }
}

#[test]
fn a_terrain_that_was_disabled_goes_on_where_it_was() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    for tag in 0..6 {
        stage.send(dig(8.0 + 8.0 * tag as f32, 8.0, 30.0, 4.0).with_tag(tag));
        stage.frame();
        stage.app.world_mut().entity_mut(terrain).insert_recursive::<Children>(Disabled);
        // What changes meanwhile is caught up with.
        stage.app.world_mut().entity_mut(terrain).insert(LooseSettings::default());
        stage.frames(6);
        stage.app.world_mut().entity_mut(terrain).remove_recursive::<Children, Disabled>();
        stage.settle();
    }
    assert_eq!(stage.tags(), (0..6).collect::<Vec<_>>());
    let mut model = level(1.0);
    model.apply((0..6).map(|tag| dig(8.0 + 8.0 * tag as f32, 8.0, 30.0, 4.0)).collect::<Vec<_>>());
    assert_eq!(stage.hash(terrain), model.world().hash());
    stage.assert_whole(terrain, "enabled again");
}

#[test]
fn another_terrain_in_place_of_a_disabled_one_is_shown_once_it_is_enabled() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    stage.app.world_mut().entity_mut(terrain).insert(Disabled);
    stage.send(dig(30.0, 8.0, 30.0, 4.0).with_tag(1));
    stage.frames(2);
    stage.app.world_mut().entity_mut(terrain).insert(level(0.5));
    stage.frames(4);
    stage.app.world_mut().entity_mut(terrain).remove::<Disabled>();
    stage.settle_shown();
    stage.assert_whole(terrain, "another voxel size");
    assert_eq!(stage.tags(), [1], "rejected, as no terrain was there");
    let scale = stage.app.world().get::<Transform>(terrain).expect("a place").scale;
    assert_eq!(scale, Vec3::splat(0.5));
}
