//! Games that edit the model themselves, or replace it.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level, random_brushes, steep};

/// Whether the shown ground at the origin is up to date.
fn is_ready(stage: &mut Stage) -> bool {
    let is_ready = |terrains: Terrains| terrains.is_ready(Vec3::ZERO, Vec3::splat(64.0));
    stage.app.world_mut().run_system_once(is_ready).expect("it runs")
}

#[test]
fn a_model_that_the_game_edits_itself_is_shown_whole() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    let mut model = stage.app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
    model.apply(random_brushes(14, 10));
    stage.frames(20);
    stage.frames_until("the edited world is shown", is_ready);
    stage.assert_whole(terrain, "edited by the game");
    for brush in random_brushes(15, 10) {
        stage.send(brush);
    }
    stage.settle();
    stage.assert_whole(terrain, "dug after that");
}

#[test]
fn the_old_world_is_shown_whole_while_a_new_one_loads() {
    let mut stage = Stage::drawing().with_settings(BurrowSettings { loads_per_frame: 4, ..default() });
    let terrain = stage.show(steep());
    let mut model = stage.app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
    model.apply(random_brushes(14, 10));
    let triangles = model.world().drawn().map(|(_, mesh)| mesh.indices.len() / 3).sum::<usize>();
    stage.frames_until("the new world is shown", |stage| {
        let shown = stage.shown(terrain);
        assert!(shown.is_closed(), "{shown:?}");
        let is_ready = is_ready(stage);
        assert_eq!(is_ready, shown.triangles == triangles, "ready when it is shown");
        is_ready
    });
}

#[test]
fn a_model_that_the_game_edits_while_it_loads_is_shown_whole() {
    let mut stage = Stage::drawing().with_settings(BurrowSettings { loads_per_frame: 1, ..default() });
    let terrain = stage.spawn(steep());
    stage.frames(3);
    let mut model = stage.app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
    model.apply(random_brushes(14, 10));
    let triangles: usize = model.world().drawn().map(|(_, mesh)| mesh.indices.len() / 3).sum();
    stage.frames_until("the edited world is shown", |stage| {
        let shown = stage.shown(terrain);
        assert!(shown.triangles == 0 || shown.is_closed(), "{shown:?}");
        shown.triangles == triangles
    });
    stage.frames(20);
    stage.assert_whole(terrain, "edited while it loaded");
}

#[test]
fn brushes_under_way_keep_their_receipts_when_the_game_edits_the_model() {
    let mut stage = Stage::drawing().without_waiting();
    let terrain = stage.show(steep());
    for brush in random_brushes(16, 10) {
        stage.send(brush);
    }
    stage.frame();
    let mut model = stage.app.world_mut().get_mut::<Terrain>(terrain).expect("a terrain");
    assert!(model.is_busy());
    model.apply(random_brushes(17, 1));
    stage.settle();
    stage.frames(20);
    assert_eq!(stage.tags(), (0..10).collect::<Vec<_>>());
}

#[test]
fn another_terrain_on_the_same_entity_takes_the_place_of_the_first() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.settle();
    stage.app.world_mut().entity_mut(terrain).insert(level(1.0));
    stage.frames_until("the other terrain is shown", is_ready);
    assert_eq!(stage.count::<Tile>(), 16);
    stage.assert_whole(terrain, "replaced");
}

#[test]
fn another_terrain_with_another_voxel_size_is_shown_in_its_own() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(1.0));
    stage.app.world_mut().entity_mut(terrain).insert(level(0.5));
    stage.frames_until("the other terrain is shown", is_ready);
    let place: &Transform = stage.app.world().get(terrain).expect("a place");
    assert_eq!(place.scale, Vec3::splat(0.5));
    stage.send(dig(16.0, 4.0, 16.0, 2.0));
    stage.settle();
    let mut model = level(0.5);
    model.apply([dig(32.0, 8.0, 32.0, 4.0)]);
    assert_eq!(stage.hash(terrain), model.world().hash());
}

#[test]
fn a_commit_does_not_go_into_another_terrain_on_the_same_entity() {
    let mut stage = Stage::drawing().without_waiting();
    let terrain = stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0));
    stage.frame();
    assert!(stage.terrain(terrain).is_busy());
    let pristine = level(1.0).world().hash();
    stage.app.world_mut().entity_mut(terrain).insert(level(1.0));
    stage.frames(80);
    assert_eq!(stage.hash(terrain), pristine, "the edit of the old world is in the new one");
}

#[test]
fn nothing_is_left_of_a_terrain_whose_component_is_removed() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(steep());
    stage.app.world_mut().entity_mut(terrain).remove::<Terrain>();
    stage.frames(4);
    assert_eq!((stage.count::<Tile>(), stage.count::<Mesh3d>()), (0, 0));
}

#[test]
fn a_terrain_removed_during_a_transaction_works_on_another_entity() {
    let mut stage = Stage::drawing().without_waiting();
    let first = stage.show(steep());
    stage.send(dig(30.0, 4.0, 30.0, 6.0).with_tag(1));
    stage.frame();
    assert!(stage.terrain(first).is_busy());
    stage.send(dig(20.0, 4.0, 20.0, 6.0).with_tag(2));
    stage.app.world_mut().run_schedule(First);
    let parked = stage.app.world_mut().entity_mut(first).take::<Terrain>().expect("it was there");
    stage.frames(4);
    let second = stage.show(parked);
    stage.send(dig(40.0, 4.0, 40.0, 5.0).with_tag(3));
    stage.settle();
    let outcomes: Vec<(u64, bool)> = stage
        .receipts()
        .iter()
        .map(|applied| (applied.receipt.tag, applied.receipt.outcome.is_ok()))
        .collect();
    assert_eq!(outcomes, [(1, false), (2, false), (3, true)]);
    let mut model = steep();
    model.apply([dig(40.0, 4.0, 40.0, 5.0)]);
    assert_eq!(stage.hash(second), model.world().hash(), "a brush with a receipt was not applied");
    stage.assert_whole(second, "parked");
}

#[test]
fn terrains_swapped_during_their_transactions_continue() {
    let mut stage = Stage::drawing().without_waiting();
    let (first, second) = (stage.spawn(steep()), stage.spawn_at(level(1.0), Vec3::X * 500.0));
    stage.settle();
    stage.send_to(first, dig(30.0, 4.0, 30.0, 6.0).with_tag(1));
    stage.send_to(second, dig(510.0, 8.0, 20.0, 4.0).with_tag(2));
    stage.frame();
    let mut both = stage.app.world_mut().query::<&mut Terrain>();
    let [mut a, mut b] = both.get_many_mut(stage.app.world_mut(), [first, second]).expect("both are there");
    assert!(a.is_busy() && b.is_busy());
    std::mem::swap(&mut *a, &mut *b);
    stage.frames(20);
    stage.settle();
    let mut tags = stage.tags();
    tags.sort_unstable();
    assert_eq!(tags, [1, 2]);
    let mut model = steep();
    model.apply([dig(30.0, 4.0, 30.0, 6.0)]);
    assert_eq!(stage.hash(second), model.world().hash());
    stage.assert_whole(first, "swapped");
}

#[test]
fn a_terrain_moved_to_another_entity_keeps_its_voxel_size() {
    let mut stage = Stage::drawing();
    let terrain = stage.show(level(0.5));
    stage.app.world_mut().entity_mut(terrain).insert(Transform::from_xyz(8.0, 0.0, 0.0));
    stage.send(dig(16.0, 4.0, 16.0, 2.0));
    stage.settle();
    let place: &Transform = stage.app.world().get(terrain).expect("a place");
    assert_eq!(*place, Transform::from_xyz(8.0, 0.0, 0.0).with_scale(Vec3::splat(0.5)));
    let mut model = level(0.5);
    model.apply([dig(16.0, 8.0, 32.0, 4.0)]);
    assert_eq!(stage.hash(terrain), model.world().hash());
}

/// The ways to replace a terrain.
const WAYS: [fn(&mut Stage, Entity, Terrain); 2] = [insert, assign];

fn insert(stage: &mut Stage, entity: Entity, other: Terrain) {
    stage.app.world_mut().entity_mut(entity).insert(other);
}

fn assign(stage: &mut Stage, entity: Entity, other: Terrain) {
    *stage.app.world_mut().get_mut::<Terrain>(entity).expect("a terrain") = other;
}

#[test]
fn a_terrain_that_is_replaced_while_it_loads_is_never_shown() {
    for replace in WAYS {
        let mut stage = Stage::drawing().with_settings(BurrowSettings { loads_per_frame: 1, ..default() });
        let mut former = steep();
        former.apply(random_brushes(14, 10));
        let terrain = stage.spawn(former);
        stage.frames(6);
        assert_eq!(stage.count::<Tile>(), 0, "the former still loads");
        replace(&mut stage, terrain, level(1.0));
        stage.frames_until("the other terrain is shown", |stage| {
            let triangles = stage.shown(terrain).triangles;
            assert!([0, 2 * 64 * 64].contains(&triangles), "{triangles} triangles are the former's");
            triangles > 0
        });
    }
}

#[test]
fn tiles_of_another_terrain_are_not_shown_in_the_scale_of_a_new_one() {
    for replace in WAYS {
        let mut stage = Stage::drawing()
            .with_settings(BurrowSettings { loads_per_frame: 1, ..default() })
            .without_waiting();
        let terrain = stage.show(level(1.0));
        stage.send(dig(30.0, 8.0, 30.0, 4.0));
        stage.frame();
        assert!(stage.terrain(terrain).is_busy());
        replace(&mut stage, terrain, level(0.5));
        stage.frame();
        assert_eq!((stage.count::<Tile>(), stage.count::<Mesh3d>()), (0, 0));
        stage.frames_until("the other terrain is shown", is_ready);
        assert_eq!(stage.count::<Tile>(), 16);
        stage.assert_whole(terrain, "replaced");
    }
}
