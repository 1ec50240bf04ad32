//! Terrains that are despawned while they load or are dug.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_burrow::plugin::{ChunkChanged, ChunkCreated, FieldChanged, FieldCreated, FieldMerged};
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

/// Checks that nothing of a terrain is left.
fn assert_clean(stage: &mut Stage, when: &str) {
    stage.frames(4);
    let left =
        (stage.count::<Terrain>(), stage.count::<Tile>(), stage.count::<Chunk>(), stage.count::<Field>());
    assert_eq!(left, (0, 0, 0, 0), "{when}: terrains, tiles, chunks, fields");
    assert_eq!((stage.count::<Mesh3d>(), stage.meshes()), (0, 0), "{when}: entities with meshes, meshes");
}

/// Checks that a new terrain works normally afterwards.
fn assert_works(stage: &mut Stage) {
    let terrain = stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.settle();
    stage.assert_whole(terrain, "the next terrain");
}

#[test]
fn nothing_is_left_of_a_terrain_despawned_during_a_transaction() {
    let mut stage = Stage::drawing();
    for frames in 0..6 {
        let terrain = stage.show(steep());
        for brush in random_brushes(11, 80) {
            stage.send(brush);
        }
        stage.frame();
        assert!(stage.terrain(terrain).is_busy());
        stage.frames(frames);
        stage.app.world_mut().despawn(terrain);
        assert_clean(&mut stage, &format!("{frames} frames into a transaction"));
    }
    assert_works(&mut stage);
}

#[test]
fn nothing_is_left_of_a_terrain_despawned_while_it_loads() {
    let mut stage = Stage::drawing().with_settings(BurrowSettings { loads_per_frame: 2, ..default() });
    for frames in 0..24 {
        let mut model = steep();
        model.apply(random_brushes(12, 20));
        let terrain = stage.spawn(model);
        stage.send(dig(30.0, 4.0, 30.0, 6.0));
        stage.frames(frames);
        stage.app.world_mut().despawn(terrain);
        assert_clean(&mut stage, &format!("{frames} frames into loading"));
    }
    assert_works(&mut stage);
}

/// Tells [`despawn_terrains`] to despawn the terrains.
#[derive(Resource, Default)]
struct DespawnNow(bool);

/// A game's own system that despawns all terrains.
fn despawn_terrains(
    mut commands: Commands,
    mut despawn_now: ResMut<DespawnNow>,
    terrains: Query<Entity, With<Terrain>>,
) {
    if std::mem::take(&mut despawn_now.0) {
        for terrain in &terrains {
            commands.entity(terrain).despawn();
        }
    }
}

/// A stage whose game despawns terrains among the plugin's own systems. Commands of a system without an explicit order
/// may be applied just before those of the commit, or before any other set.
fn stage_that_despawns<M>(
    despawn_terrains: impl IntoScheduleConfigs<bevy::ecs::system::ScheduleSystem, M>,
) -> Stage {
    let mut stage = Stage::drawing();
    stage.app.init_resource::<DespawnNow>().add_systems(Update, despawn_terrains);
    stage
}

#[test]
fn a_terrain_may_be_despawned_in_the_frame_of_its_commit() {
    let despawn_terrains = despawn_terrains
        .after_ignore_deferred(BurrowSystems::Collect)
        .before_ignore_deferred(BurrowSystems::Commit);
    let mut stage = stage_that_despawns(despawn_terrains);
    let mut met = 0;
    for round in 0..20 {
        stage.show(steep());
        let commits = stage.figures().commits;
        for brush in random_brushes(13, 6) {
            stage.send(brush);
        }
        stage.frame();
        // Longer and longer waits, for slow machines.
        (0..1 << (round / 2).min(6)).for_each(|_| stage.rest());
        stage.app.world_mut().resource_mut::<DespawnNow>().0 = true;
        stage.frame();
        met += u32::from(stage.figures().commits > commits);
        assert_clean(&mut stage, "in the frame of a commit");
        if met > 2 {
            break;
        }
    }
    assert!(met > 0, "no terrain was despawned in the frame of its commit");
    assert_works(&mut stage);
}

#[test]
fn no_event_is_triggered_for_entities_despawned_with_their_terrain() {
    let despawn_terrains = despawn_terrains
        .after_ignore_deferred(BurrowSystems::Collect)
        .before_ignore_deferred(BurrowSystems::Commit);
    let mut stage = stage_that_despawns(despawn_terrains);
    stage.app.add_observer(|on: On<ChunkCreated>, all: Query<&Chunk>| {
        assert!(all.contains(on.entity), "no such chunk")
    });
    stage.app.add_observer(|on: On<ChunkChanged>, all: Query<&Chunk>| {
        assert!(all.contains(on.entity), "no such chunk")
    });
    stage.app.add_observer(|on: On<FieldCreated>, all: Query<&Field>| {
        assert!(all.contains(on.entity), "no such field")
    });
    stage.app.add_observer(|on: On<FieldChanged>, all: Query<&Field>| {
        assert!(all.contains(on.entity), "no such field")
    });
    stage.app.add_observer(|on: On<FieldMerged>, all: Query<&Field>| {
        assert!(all.contains(on.entity), "no such field")
    });
    for round in 0..6 {
        stage.show(steep());
        // In some rounds existing chunks and fields change, in others all are new.
        for brush in random_brushes(13, 40).into_iter().take(10 * round) {
            stage.send(brush);
        }
        stage.settle();
        for brush in random_brushes(14, 20) {
            stage.send(brush);
        }
        stage.frame();
        stage.rest();
        stage.app.world_mut().resource_mut::<DespawnNow>().0 = true;
        stage.frame();
        assert_clean(&mut stage, "in the frame of a commit");
    }
}

#[test]
fn a_terrain_may_be_despawned_in_the_frame_that_would_show_it() {
    let mut stage = stage_that_despawns(despawn_terrains.before(BurrowSystems::Load));
    for rest in [false, true] {
        stage.spawn(steep());
        stage.frame();
        if rest {
            stage.rest();
        }
        stage.app.world_mut().resource_mut::<DespawnNow>().0 = true;
        stage.frame();
        assert_clean(&mut stage, "in the frame that would show it");
    }
    assert_works(&mut stage);
}

#[test]
fn a_terrain_may_be_despawned_in_the_frame_that_spawned_it() {
    let mut stage = stage_that_despawns(despawn_terrains.before(BurrowSystems::Load));
    stage.frame();
    stage.spawn(steep());
    stage.app.world_mut().resource_mut::<DespawnNow>().0 = true;
    stage.frame();
    assert_clean(&mut stage, "in its first frame");
    assert_works(&mut stage);
}

#[test]
fn a_terrain_may_be_despawned_in_the_frame_of_a_brush() {
    let despawn_terrains = despawn_terrains.after(BurrowSystems::Commit).before(BurrowSystems::Begin);
    let mut stage = stage_that_despawns(despawn_terrains);
    stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.app.world_mut().resource_mut::<DespawnNow>().0 = true;
    stage.frame();
    assert_clean(&mut stage, "in the frame of a brush");
    assert_works(&mut stage);
}

#[test]
fn each_brush_of_a_despawned_terrain_gets_its_receipt() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0).with_tag(1));
    stage.frame();
    stage.send(dig(34.0, 4.0, 30.0, 6.0).with_tag(2));
    stage.app.world_mut().despawn(terrain);
    stage.frames(4);
    assert_eq!(stage.tags().len(), 2, "a brush was dropped silently: {:?}", stage.receipts());
}

#[test]
fn despawning_a_tile_or_chunk_causes_no_error() {
    let mut stage = Stage::drawing();
    stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.settle();
    for entity in stage.with_component::<Chunk>().into_iter().chain(stage.with_component::<Tile>()) {
        stage.app.world_mut().despawn(entity);
    }
    for brush in random_brushes(13, 40) {
        stage.send(brush);
    }
    stage.settle();
    assert_eq!(stage.receipts().len(), 41, "no brush is lost because of it");
}

#[test]
fn despawning_a_terrain_despawns_all_its_children() {
    let mut stage = Stage::drawing();
    stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.settle();
    let despawn =
        |mut commands: Commands, terrain: Single<Entity, With<Terrain>>| commands.entity(*terrain).despawn();
    stage.app.world_mut().run_system_once(despawn).expect("one terrain");
    assert_clean(&mut stage, "after a command");
}

/// For each despawned tile, the number of its terrain's children after it.
#[derive(Resource, Default)]
struct ChildrenAfter(Vec<usize>);

fn count_children_after(
    gone: On<Despawn, Tile>,
    tiles: Query<&ChildOf>,
    terrains: Query<&Children>,
    mut counts: ResMut<ChildrenAfter>,
) {
    let terrain = tiles.get(gone.entity).expect("below its terrain").parent();
    let mut from_the_end = terrains.get(terrain).expect("with children").iter().rev();
    counts.0.push(from_the_end.position(|child| child == gone.entity).expect("one of them"));
}

#[test]
fn tiles_are_despawned_from_the_end_of_their_terrains_children() {
    // Bevy searches the children from the end, so any other order is slow with thousands of them.
    let mut stage = Stage::drawing();
    stage.app.init_resource::<ChildrenAfter>().add_observer(count_children_after);
    let behind =
        |stage: &mut Stage| std::mem::take(&mut stage.app.world_mut().resource_mut::<ChildrenAfter>().0);
    let terrain = stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.settle();
    let own = stage.app.world_mut().spawn(ChildOf(terrain)).id();
    stage.app.world_mut().entity_mut(terrain).insert(level(1.0));
    stage.frames_until("another terrain is shown", |stage| {
        !stage.app.world().resource::<ChildrenAfter>().0.is_empty()
    });
    assert_eq!(behind(&mut stage), [1; 16], "the game's own child stays behind them");
    stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
    assert_eq!(behind(&mut stage), [0; 16]);
    let left = stage.app.world().get::<Children>(terrain).expect("the game's own child");
    assert_eq!(&**left, [own]);
}
