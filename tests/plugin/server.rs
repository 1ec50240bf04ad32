//! A dedicated server: `MinimalPlugins`, no assets, no meshes, the same world.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_burrow::plugin::ChunkChanged;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

#[test]
fn a_server_has_the_same_world_as_the_model() {
    let brushes = random_brushes(10, 120);
    let mut model = steep();
    let expected = model.apply(&brushes);

    let mut stage = Stage::server();
    assert!(!stage.app.world().contains_resource::<AssetServer>());
    let terrain = stage.show(steep());
    for burst in brushes.chunks(9) {
        burst.iter().for_each(|brush| stage.send(brush.clone()));
        stage.frame();
    }
    stage.settle();
    assert_eq!(stage.hash(terrain), model.world().hash());
    let receipts: Vec<_> = stage.receipts().iter().map(|applied| applied.receipt.clone()).collect();
    assert_eq!(receipts, expected);

    let fields: usize = model.world().fields().map(|(_, fields)| fields.len()).sum();
    assert_eq!((stage.count::<Tile>(), stage.count::<Field>()), (16, fields));
    assert!(stage.count::<Chunk>() >= model.world().fields().count());
    assert_eq!(stage.count::<Mesh3d>(), 0);
}

#[test]
fn a_server_digs_a_moved_and_scaled_terrain_where_its_clients_do() {
    let place = Vec3::new(100.0, 20.0, -40.0);
    let mut model = level(0.5);
    model.apply([dig(20.0, 8.0, 30.0, 4.0)]);
    for mut stage in [Stage::drawing(), Stage::server()] {
        let terrain = stage.spawn_at(level(0.5), place);
        stage.settle();
        stage.send(dig(110.0, 24.0, -25.0, 2.0));
        stage.settle();
        assert!(stage.receipts()[0].receipt.outcome.is_ok(), "{:?}", stage.receipts());
        assert_eq!(stage.hash(terrain), model.world().hash());
    }
}

#[test]
fn questions_are_answered_on_a_server_too() {
    let place = Vec3::new(100.0, 20.0, -40.0);
    for mut stage in [Stage::drawing(), Stage::server()] {
        stage.spawn_at(level(0.5), place);
        stage.settle();
        let ask = |terrains: Terrains| {
            let ray = Ray3d::new(Vec3::new(110.0, 50.0, -25.0), Dir3::NEG_Y);
            (terrains.height(110.0, -25.0), terrains.raycast(ray, 100.0).map(|hit| hit.distance))
        };
        let answers = stage.app.world_mut().run_system_once(ask).expect("it runs");
        assert_eq!(answers, (Some(24.0), Some(26.0)));
    }
}

#[test]
fn a_server_is_notified_of_a_chunk_that_is_dug_again() {
    #[derive(Resource, Default)]
    struct ChangedChunks(Vec<Entity>);

    for mut stage in [Stage::drawing(), Stage::server()] {
        stage.app.init_resource::<ChangedChunks>().add_observer(
            |changed: On<ChunkChanged>, mut all: ResMut<ChangedChunks>| all.0.push(changed.entity),
        );
        stage.show(level(1.0));
        let mut deepen = |radius| {
            stage.send(dig(24.0, 8.0, 24.0, radius));
            stage.settle();
            (stage.with_component::<Chunk>(), stage.app.world().resource::<ChangedChunks>().0.clone())
        };
        let (chunks, changed) = deepen(3.0);
        assert_eq!((chunks.len(), changed), (1, vec![]), "it is new");
        assert_eq!(deepen(4.0), (chunks.clone(), chunks));
    }
}
