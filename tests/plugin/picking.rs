//! Pointers hit the ground: what the picking backend reports.

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use bevy_picking::backend::PointerHits;
use bevy_picking::backend::ray::{RayId, RayMap};
use bevy_picking::pointer::PointerId;

use crate::stage::{Stage, dig, level};

/// A stage with a pointer whose ray points straight down at (30, 20) of the ground.
fn stage() -> (Stage, Entity, Entity) {
    let mut stage = Stage::drawing().recording::<PointerHits>();
    stage.app.init_resource::<RayMap>().add_message::<PointerHits>();
    let camera = stage.app.world_mut().spawn(Camera { order: 3, ..default() }).id();
    let ray = Ray3d::new(Vec3::new(30.0, 50.0, 20.0), Dir3::NEG_Y);
    let id = RayId { camera, pointer: PointerId::Mouse };
    stage.app.world_mut().resource_mut::<RayMap>().map.insert(id, ray);
    let terrain = stage.app.world_mut().spawn((level(1.0), InheritedVisibility::VISIBLE)).id();
    stage.settle();
    (stage, terrain, camera)
}

/// What the pointer hits in the next frame.
fn hits(stage: &mut Stage) -> Vec<PointerHits> {
    stage.recorded::<PointerHits>();
    stage.frame();
    stage.recorded()
}

#[test]
fn pointers_hit_the_terrain_with_the_hit_as_extra_data() {
    let (mut stage, terrain, camera) = stage();
    for depth in [42.0, 46.0] {
        let found = hits(&mut stage);
        let [PointerHits { pointer, picks, order }] = &found[..] else { panic!("{found:?}") };
        assert_eq!((*pointer, *order), (PointerId::Mouse, 3.0));
        let [(entity, data)] = &picks[..] else { panic!("{picks:?}") };
        assert_eq!((*entity, data.camera), (terrain, camera));
        assert!((data.depth - depth).abs() < 1e-3, "{data:?}");
        let hit = data.extra_as::<TerrainHit>().expect("what was hit");
        assert_eq!(
            (hit.terrain, Some(hit.position), Some(hit.normal)),
            (terrain, data.position, data.normal)
        );
        // In the pit from now on.
        stage.send(dig(30.0, 8.0, 20.0, 4.0));
        stage.settle();
    }
}

#[test]
fn terrains_that_are_hidden_on_other_layers_or_not_pickable_are_not_hit() {
    let (mut stage, terrain, camera) = stage();
    assert_eq!(hits(&mut stage).len(), 1);
    stage.app.world_mut().entity_mut(terrain).insert(InheritedVisibility::HIDDEN);
    assert!(hits(&mut stage).is_empty(), "hidden");
    stage.app.world_mut().entity_mut(terrain).insert((InheritedVisibility::VISIBLE, RenderLayers::layer(2)));
    assert!(hits(&mut stage).is_empty(), "on another layer");
    stage.app.world_mut().entity_mut(camera).insert(RenderLayers::layer(2));
    assert_eq!(hits(&mut stage).len(), 1);
    stage.app.world_mut().entity_mut(terrain).insert(bevy_picking::Pickable::IGNORE);
    assert!(hits(&mut stage).is_empty(), "ignored");
}

#[test]
fn without_bevys_picking_nothing_happens() {
    let mut stage = Stage::drawing();
    stage.show(level(1.0));
    stage.frames(2);
}
