//! Render layers and shadow settings of a terrain are propagated to everything below it.

use bevy::camera::visibility::RenderLayers;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, level, random_brushes, steep};

/// Whether all tiles, chunks and pieces have exactly this layer, or none.
fn all_have(stage: &mut Stage, layer: Option<usize>) -> bool {
    let expected = layer.map(RenderLayers::layer);
    let world = stage.app.world_mut();
    let mut drawn =
        world.query_filtered::<Option<&RenderLayers>, Or<(With<Tile>, With<Chunk>, With<GroundPiece>)>>();
    drawn.iter(world).all(|own| own == expected.as_ref())
}

#[test]
fn layers_are_propagated_to_tiles_chunks_and_pieces() {
    let mut stage = Stage::drawing();
    let terrain = stage.spawn(steep());
    stage.app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(2));
    stage.frames_until("the terrain is shown", |stage| stage.count::<Mesh3d>() > 0);
    assert!(all_have(&mut stage, Some(2)), "in the first frame that shows it");

    stage.app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ZERO });
    for brush in random_brushes(20, 20) {
        stage.send(brush);
        stage.frame();
        assert!(all_have(&mut stage, Some(2)), "in every frame, new chunks and pieces too");
    }
    stage.settle();
    assert!(stage.count::<Chunk>() > 0 && all_have(&mut stage, Some(2)));

    *stage.app.world_mut().get_mut::<RenderLayers>(terrain).expect("layers") = RenderLayers::layer(3);
    stage.frame();
    assert!(all_have(&mut stage, Some(3)), "in the frame after a change");
    stage.app.world_mut().entity_mut(terrain).remove::<RenderLayers>();
    stage.frame();
    assert!(all_have(&mut stage, None), "in the frame after they were taken off");
    stage.app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(4));
    stage.frame();
    assert!(all_have(&mut stage, Some(4)), "a terrain may get them late");
}

#[test]
fn layers_of_a_pieces_own_are_kept_and_each_terrain_has_its_own() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    stage.app.world_mut().entity_mut(terrain).insert(RenderLayers::layer(2));
    stage.frame();
    let piece = GroundPiece { terrain, origin: IVec3::ZERO };
    let piece = stage.app.world_mut().spawn((piece, RenderLayers::layer(5))).id();
    stage.spawn_at(level(1.0), Vec3::X * 200.0);
    stage.settle();
    assert_eq!(stage.app.world().get(piece), Some(&RenderLayers::layer(5)));
    // A terrain, its tiles, and the piece.
    assert_eq!((stage.count::<Tile>(), stage.count::<RenderLayers>()), (32, 1 + 16 + 1));
}

#[cfg(feature = "render")]
#[test]
fn shadows_are_propagated() {
    use bevy::light::{NotShadowCaster, NotShadowReceiver};

    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    stage.app.world_mut().entity_mut(terrain).insert((NotShadowCaster, NotShadowReceiver));
    stage.send(crate::stage::dig(30.0, 8.0, 30.0, 4.0));
    stage.settle();
    let count = |stage: &mut Stage| (stage.count::<NotShadowCaster>(), stage.count::<NotShadowReceiver>());
    let all = 1 + stage.count::<Tile>() + stage.count::<Chunk>();
    assert!(all > 17);
    assert_eq!(count(&mut stage), (all, all));
    stage.app.world_mut().entity_mut(terrain).remove::<(NotShadowCaster, NotShadowReceiver)>();
    stage.frame();
    assert_eq!(count(&mut stage), (0, 0));
}
