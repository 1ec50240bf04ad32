//! Loose ground: a component enables it, and messages report the pieces that broke off.

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, level};

/// A slab on a pillar, on level ground at 8.
fn table() -> Terrain {
    let mut terrain = level(1.0);
    let pillar = Shape::cuboid(Vec3::new(32.0, 14.0, 32.0), Vec3::new(1.2, 8.0, 1.2));
    let slab = Shape::cuboid(Vec3::new(32.0, 22.0, 32.0), Vec3::new(6.2, 2.2, 6.2));
    terrain.apply([Brush::add(pillar, MaterialId(2)), Brush::add(slab, MaterialId(3))]);
    terrain
}

fn saw() -> Brush {
    Brush::dig(Shape::cuboid(Vec3::new(32.0, 14.0, 32.0), Vec3::new(4.0, 1.2, 4.0))).with_tag(9)
}

#[test]
fn a_piece_that_breaks_off_is_reported_with_its_mesh() {
    let mut model = table();
    model.set_loose(Some(LooseSettings { debris: 9000, ..default() }));
    model.apply([saw()]);
    for (is_drawing, stage) in [(true, Stage::drawing()), (false, Stage::server())] {
        let mut stage = stage.recording::<LoosePieceFound>();
        let terrain = stage.show(table());
        stage.app.world_mut().entity_mut(terrain).insert(LooseSettings { debris: 9000, ..default() });
        stage.send(saw());
        stage.settle();
        assert_eq!(stage.hash(terrain), model.world().hash());
        let recorded = stage.recorded::<LoosePieceFound>();
        let [found] = &recorded[..] else { panic!("one piece: {recorded:?}") };
        assert_eq!((found.terrain, found.tag, found.piece.fate), (terrain, 9, PieceFate::BrokeOff));
        assert_eq!(found.origin(), found.piece.bounds.min.as_vec3());
        let mesh = found.mesh(&model, &MaterialColors::default()).expect("it broke off");
        assert!(mesh.count_vertices() > 100);
        let receipt = &stage.receipts()[0].receipt;
        assert_eq!(receipt.outcome.as_ref().map(|applied| applied.loose.len()), Ok(1));
        if is_drawing {
            stage.assert_whole(terrain, "without the slab");
        }
        // An undo restores it together with the ground of the cut.
        stage.write(Undo { terrain: None });
        stage.settle();
        assert_eq!(stage.hash(terrain), table().world().hash());
        stage.app.world_mut().entity_mut(terrain).remove::<LooseSettings>();
        stage.send(saw());
        stage.settle();
        assert!(stage.recorded::<LoosePieceFound>().is_empty(), "the search is off");
        assert_ne!(stage.hash(terrain), model.world().hash());
    }
}

#[test]
fn loose_pieces_of_a_games_own_edits_are_found_before_any_brush() {
    let loose = LooseSettings { debris: 9000, ..default() };
    let spawns: [fn(&mut World, LooseSettings) -> Entity; 3] = [
        |world, loose| world.spawn((table(), loose)).id(),
        |world, loose| world.spawn(table()).insert(loose).id(),
        |world, loose| world.spawn(loose).insert(table()).id(),
    ];
    for spawn in spawns {
        let mut stage = Stage::server();
        let world = stage.app.world_mut();
        let entity = spawn(world, loose);
        let mut terrain = world.get_mut::<Terrain>(entity).expect("a terrain");
        let receipts = terrain.apply([saw()]);
        assert_eq!(receipts[0].outcome.as_ref().map(|applied| applied.loose.len()), Ok(1));
    }
}
