//! Debug views: drawn as children of their terrains while they are on, and removed when they are off.

use bevy::camera::visibility::RenderLayers;
use bevy::mesh::MeshPlugin;
use bevy::prelude::*;
use bevy_burrow::debug::{BurrowDebug, BurrowDebugPlugin, DebugLines, DebugView};
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level};

/// A stage with meshes, and whatever `more` adds.
fn stage(more: impl Fn(&mut App) + Send + Sync + 'static) -> Stage {
    Stage::with((MinimalPlugins, AssetPlugin::default(), MeshPlugin, TransformPlugin, more))
}

/// A stage with the debug views, around a dug pit.
fn dug_stage() -> (Stage, Entity) {
    let views = |app: &mut App| {
        app.init_asset::<GizmoAsset>().add_plugins(BurrowDebugPlugin);
    };
    let mut stage = stage(views);
    let focus = Some(Vec3::new(32.0, 8.0, 32.0));
    stage.app.insert_resource(BurrowDebug { focus, fade: 1e6, ..default() });
    let terrain = stage.show(level(1.0));
    // No system computes visibility here.
    stage.app.world_mut().entity_mut(terrain).insert(InheritedVisibility::VISIBLE);
    // Dirty bricks are recorded only while their view is on.
    stage.app.world_mut().resource_mut::<BurrowDebug>().dirty = true;
    stage.send(dig(32.0, 8.0, 32.0, 5.0));
    stage.settle();
    stage.frames(2);
    (stage, terrain)
}

/// The number of line vertices that a view draws.
fn vertices(stage: &mut Stage, view: DebugView) -> usize {
    let world = stage.app.world_mut();
    let mut lines = world.query::<(&DebugLines, &Gizmo)>();
    let handles: Vec<_> = lines
        .iter(world)
        .filter(|(lines, _)| lines.view == view)
        .map(|(_, gizmo)| gizmo.handle.clone())
        .collect();
    let assets = world.resource::<Assets<GizmoAsset>>();
    handles.iter().filter_map(|handle| assets.get(handle)).map(|asset| asset.list_positions.len()).sum()
}

fn switch(stage: &mut Stage, view: DebugView, is_on: bool) {
    *stage.app.world_mut().resource_mut::<BurrowDebug>().switch(view) = is_on;
    stage.frames(2);
}

#[test]
fn each_view_draws_while_it_is_on_and_nothing_when_it_is_off() {
    let (mut stage, _) = dug_stage();
    for view in DebugView::ALL {
        switch(&mut stage, view, true);
        assert!(vertices(&mut stage, view) > 10, "{view:?}");
        for other in DebugView::ALL.into_iter().filter(|other| *other != view && *other != DebugView::Dirty) {
            assert_eq!(vertices(&mut stage, other), 0, "{view:?} drew {other:?}");
        }
        switch(&mut stage, view, false);
        assert_eq!(vertices(&mut stage, view), 0, "{view:?}");
    }
    assert_eq!(stage.count::<DebugLines>(), 0);
    // Gizmo assets are freed together with the entities that show them.
    stage.frames(2);
    assert_eq!(stage.app.world().resource::<Assets<GizmoAsset>>().len(), 0);
}

#[test]
fn views_follow_the_world_and_its_history() {
    let (mut stage, terrain) = dug_stage();
    switch(&mut stage, DebugView::Mask, true);
    let small = vertices(&mut stage, DebugView::Mask);
    stage.send(dig(40.0, 8.0, 32.0, 8.0));
    stage.settle();
    stage.frames_until("the mask grows", |stage| vertices(stage, DebugView::Mask) > small);
    stage.app.world_mut().write_message(bevy_burrow::plugin::Undo { terrain: Some(terrain) });
    stage.frames_until("the mask shrinks", |stage| vertices(stage, DebugView::Mask) == small);
}

#[test]
fn dirty_bricks_fade() {
    let (mut stage, _) = dug_stage();
    assert!(vertices(&mut stage, DebugView::Dirty) > 10);
    stage.app.world_mut().resource_mut::<BurrowDebug>().fade = 0.05;
    stage.frames_until("the bricks are forgotten", |stage| vertices(stage, DebugView::Dirty) == 0);
}

#[test]
fn no_view_draws_more_lines_than_allowed() {
    let (mut stage, _) = dug_stage();
    stage.app.world_mut().resource_mut::<BurrowDebug>().max_lines = 9;
    for view in DebugView::ALL {
        switch(&mut stage, view, true);
        assert_eq!(vertices(&mut stage, view), 18, "{view:?}");
        switch(&mut stage, view, false);
    }
}

#[test]
fn debug_lines_are_despawned_with_their_terrain() {
    let (mut stage, terrain) = dug_stage();
    switch(&mut stage, DebugView::Chunks, true);
    let other = stage.spawn_at(level(0.5), Vec3::new(200.0, 0.0, 0.0));
    stage.settle();
    stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
    stage.frames(2);
    let world = stage.app.world_mut();
    let mut lines = world.query_filtered::<&ChildOf, With<DebugLines>>();
    assert!(lines.iter(world).all(|parent| parent.parent() == other));
    world.despawn(other);
    stage.frames(2);
    assert_eq!(stage.count::<DebugLines>(), 0);
}

#[test]
fn lines_are_on_the_layers_of_their_terrain() {
    let (mut stage, terrain) = dug_stage();
    switch(&mut stage, DebugView::Chunks, true);
    for layers in [Some(RenderLayers::layer(2)), Some(RenderLayers::layer(3)), None] {
        let mut entity = stage.app.world_mut().entity_mut(terrain);
        match layers.clone() {
            Some(layers) => entity.insert(layers),
            None => entity.remove::<RenderLayers>(),
        };
        stage.frame();
        let world = stage.app.world_mut();
        let mut lines = world.query_filtered::<Option<&RenderLayers>, With<DebugLines>>();
        let own: Vec<_> = lines.iter(world).map(|own| own.cloned()).collect();
        assert!(!own.is_empty() && own.iter().all(|own| *own == layers), "{own:?} for {layers:?}");
    }
}

#[test]
fn without_gizmos_the_views_do_nothing() {
    let mut stage = stage(|app: &mut App| {
        app.add_plugins(BurrowDebugPlugin).insert_resource(BurrowDebug { mask: true, ..default() });
    });
    stage.show(level(1.0));
    stage.send(dig(32.0, 8.0, 32.0, 5.0));
    stage.settle();
    assert_eq!(stage.count::<DebugLines>(), 0);
}
