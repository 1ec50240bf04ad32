//! Debris: ground that breaks off falls, and disappears when an undo restores that ground.

use avian3d::prelude::*;
use bevy::prelude::*;
use bevy_burrow::physics::{Debris, DebrisCrumbled, DebrisSettings, TerrainDebris};
use bevy_burrow::prelude::*;

use crate::stage::{STEP, Stage, level};

/// A slab on a pillar, on level ground at 8 voxels. Digging the pillar away cuts the slab off.
const PILLAR: Vec3 = Vec3::new(32.0, 14.0, 32.0);
const SLAB: Vec3 = Vec3::new(32.0, 22.0, 32.0);

/// How many pieces of debris have crumbled.
#[derive(Resource, Default)]
struct Crumbled(usize);

/// A stage with such a table on a terrain at `place`, and its entity. Pieces stay for `stay` seconds.
fn stage(voxel_size: f32, place: Vec3, stay: f32) -> (Stage, Entity) {
    with_table(Stage::new(), voxel_size, place, stay)
}

fn with_table(stage: Stage, voxel_size: f32, place: Vec3, stay: f32) -> (Stage, Entity) {
    let mut terrain = level(64, voxel_size);
    // The terrain's own coordinates are in voxels.
    terrain.apply([
        Brush::add(Shape::cuboid(PILLAR, Vec3::new(1.2, 8.0, 1.2)), MaterialId(2)),
        Brush::add(Shape::cuboid(SLAB, Vec3::new(6.2, 2.2, 6.2)), MaterialId(3)),
    ]);
    let (mut stage, entity) = stage.on(terrain);
    stage
        .app
        .init_resource::<Crumbled>()
        .add_observer(|_: On<DebrisCrumbled>, mut crumbled: ResMut<Crumbled>| crumbled.0 += 1);
    stage.app.insert_resource(DebrisSettings { stay, ..default() });
    let loose = LooseSettings { crumbs: 8, debris: 9000, ..default() };
    let mut entity_mut = stage.app.world_mut().entity_mut(entity);
    entity_mut.insert(loose);
    entity_mut.get_mut::<Transform>().expect("terrains have one").translation = place;
    stage.frame();
    stage.settle();
    (stage, entity)
}

/// Cuts the table's slab off, on a terrain at `place`.
fn saw(voxel_size: f32, place: Vec3) -> Brush {
    let half = Vec3::new(4.0, 1.2, 4.0) * voxel_size;
    Brush::dig(Shape::cuboid(place + PILLAR * voxel_size, half)).with_tag(9)
}

fn pieces(stage: &mut Stage) -> Vec<(Debris, Transform)> {
    let world = stage.app.world_mut();
    world.query::<(&Debris, &Transform)>().iter(world).map(|(debris, at)| (debris.clone(), *at)).collect()
}

#[test]
fn a_slab_that_is_sawn_off_falls_and_lies_on_the_ground() {
    for (voxel_size, place) in [(1.0, Vec3::ZERO), (0.5, Vec3::new(100.0, -20.0, 7.0))] {
        let (mut stage, terrain) = stage(voxel_size, place, 1e9);
        stage.dig([saw(voxel_size, place)]);
        stage.frames_until("the slab takes shape", |stage| !pieces(stage).is_empty());
        let [(debris, at)] = &pieces(&mut stage)[..] else { panic!("one piece") };
        assert_eq!((debris.tag, debris.material), (9, MaterialId(3)));
        let listed = stage.app.world().get::<TerrainDebris>(terrain).expect("the terrain lists its pieces");
        assert_eq!(listed.len(), 1);
        let middle = at.translation;
        let home = place + SLAB * voxel_size;
        // The upper end of the pillar falls with it.
        assert!(middle.distance(home) < 3.0 * voxel_size, "{middle} is not {home}");
        stage.frames((4.0 / STEP) as usize);
        let [(_, at)] = &pieces(&mut stage)[..] else { panic!("it stays") };
        // It may lie on the rest of the pillar, but neither in the ground nor up where it was.
        let height = (at.translation.y - place.y) / voxel_size;
        assert!((9.5..19.0).contains(&height), "{height}");
        assert_eq!(stage.figures().lifted, 0);
    }
}

/// World positions of the pieces' meshes, and the bodies whose children they are.
fn drawn(stage: &mut Stage) -> Vec<(Vec3, Entity)> {
    let world = stage.app.world_mut();
    let mut drawn = world.query_filtered::<(&Transform, &ChildOf), (With<GroundPiece>, With<Mesh3d>)>();
    let places = drawn.iter(world).map(|(own, parent)| {
        let body = world.get::<Transform>(parent.parent()).expect("bodies have a place");
        ((*body * *own).translation, parent.parent())
    });
    places.collect()
}

#[test]
fn a_piece_of_a_terrain_without_colours_is_drawn() {
    let (mut stage, terrain) = with_table(Stage::with_meshes(), 1.0, Vec3::ZERO, 1e9);
    stage.send(saw(1.0, Vec3::ZERO));
    stage.frames_until("the saw cuts", |stage| stage.terrain(terrain).is_busy());
    stage.app.world_mut().entity_mut(terrain).remove::<MaterialColors>();
    stage.frames_until("the slab takes shape", |stage| !pieces(stage).is_empty());
    assert_eq!(drawn(&mut stage).len(), 1);
}

/// For each piece found: whether it was drawn in the same frame where it was in the ground.
#[derive(Resource, Default)]
struct Seen(Vec<bool>);

fn look(
    mut found: MessageReader<LoosePieceFound>,
    pieces: Query<(&GroundPiece, &Mesh3d)>,
    meshes: Res<Assets<Mesh>>,
    mut seen: ResMut<Seen>,
) {
    for LoosePieceFound { terrain, piece, .. } in found.read() {
        let here = GroundPiece { terrain: *terrain, origin: piece.bounds.min };
        seen.0.push(pieces.iter().any(|(drawn, mesh)| *drawn == here && meshes.contains(&mesh.0)));
    }
}

#[test]
fn a_piece_is_drawn_in_the_frame_in_which_the_ground_loses_it() {
    for (voxel_size, place) in [(1.0, Vec3::ZERO), (0.5, Vec3::new(100.0, -20.0, 7.0))] {
        let (mut stage, _) = with_table(Stage::with_meshes(), voxel_size, place, 1e9);
        stage.app.init_resource::<Seen>().add_systems(Last, look);
        stage.send(saw(voxel_size, place));
        let mut homes = Vec::new();
        stage.frames_until("the slab takes shape", |stage| {
            let (seen, drawn) = (stage.app.world().resource::<Seen>().0.clone(), drawn(stage));
            assert_eq!(drawn.len(), seen.len(), "as many are drawn as were found");
            let is_body = !pieces(stage).is_empty();
            for (home, body) in drawn {
                // Before its collider is ready, it neither falls nor is in the way.
                let body = stage.app.world().entity(body);
                assert_eq!(body.contains::<RigidBody>(), is_body);
                assert_eq!(body.contains::<Collider>(), is_body);
                homes.push(home);
            }
            is_body
        });
        assert_eq!(stage.app.world().resource::<Seen>().0, [true]);
        assert!(homes.iter().all(|home| home.distance(homes[0]) < 1e-4), "{homes:?}");
        let height = |stage: &mut Stage| {
            let [(_, body)] = drawn(stage)[..] else { panic!("one piece") };
            assert!(stage.app.world().entity(body).contains::<Debris>());
            stage.place(body).y
        };
        let before = height(&mut stage);
        stage.frames((1.0 / STEP) as usize);
        let after = height(&mut stage);
        assert!(after < before - voxel_size, "it was at {before}, and is at {after}");
    }
}

#[test]
fn a_rolling_boulder_does_not_count_as_buried() {
    let (mut stage, _) = stage(1.0, Vec3::ZERO, 1e9);
    // A boulder rounder than its bounding box, whose corners turn through the ground.
    stage.dig([Brush::add(Shape::sphere(SLAB + Vec3::new(0.0, 6.0, 0.0), 7.0), MaterialId(2))]);
    stage.dig([saw(1.0, Vec3::ZERO), Brush::dig(Shape::cuboid(SLAB, Vec3::new(9.0, 2.5, 9.0)))]);
    stage.frames_until("pieces take shape", |stage| !pieces(stage).is_empty());
    stage.frames((6.0 / STEP) as usize);
    assert!(!pieces(&mut stage).is_empty());
    assert_eq!(stage.figures().lifted, 0);
}

#[test]
fn an_undo_removes_the_debris_of_restored_ground() {
    let (mut stage, _) = stage(1.0, Vec3::ZERO, 1e9);
    let hash = {
        let world = stage.app.world_mut();
        world.query::<&Terrain>().single(world).expect("one terrain").world().hash()
    };
    stage.dig([saw(1.0, Vec3::ZERO)]);
    stage.frames_until("the slab takes shape", |stage| !pieces(stage).is_empty());
    stage.app.world_mut().write_message(Undo::default()).expect("the plugin added the message");
    stage.frames_until("the debris is removed", |stage| pieces(stage).is_empty());
    let world = stage.app.world_mut();
    assert_eq!(world.query::<&Terrain>().single(world).expect("one terrain").world().hash(), hash);
    assert_eq!(world.resource::<Crumbled>().0, 0, "an undo counted as crumbling");
}

#[test]
fn debris_crumbles_after_its_time_and_is_despawned_with_its_terrain() {
    let (mut stage, terrain) = stage(1.0, Vec3::ZERO, 0.5);
    stage.dig([saw(1.0, Vec3::ZERO)]);
    stage.frames_until("it crumbles", |stage| stage.app.world().resource::<Crumbled>().0 == 1);
    stage.frame();
    assert!(pieces(&mut stage).is_empty());
    // Another piece, of a terrain that is replaced by the next one.
    stage.app.world_mut().resource_mut::<DebrisSettings>().stay = 1e9;
    let again = Brush::add(Shape::cuboid(SLAB, Vec3::new(3.2, 2.2, 3.2)), MaterialId(3));
    let corner = Brush::dig(Shape::cuboid(SLAB - Vec3::Y * 2.0, Vec3::new(6.0, 1.0, 6.0)));
    stage.dig([again, corner]);
    stage.frames_until("it takes shape", |stage| !pieces(stage).is_empty());
    stage.app.world_mut().entity_mut(terrain).insert(level(64, 1.0));
    stage.frames(2);
    assert!(pieces(&mut stage).is_empty());
}

#[test]
fn there_is_no_more_debris_than_the_settings_say() {
    let (mut stage, _) = stage(1.0, Vec3::ZERO, 1e9);
    stage.app.world_mut().resource_mut::<DebrisSettings>().most = 0;
    stage.dig([saw(1.0, Vec3::ZERO)]);
    stage.frames(100);
    assert!(pieces(&mut stage).is_empty());
}

#[test]
fn debris_ages_with_physics() {
    let (mut stage, _) = stage(1.0, Vec3::ZERO, 1.0);
    stage.dig([saw(1.0, Vec3::ZERO)]);
    stage.frames_until("it takes shape", |stage| !pieces(stage).is_empty());
    let left = |stage: &mut Stage| pieces(stage)[0].0.left;
    // A second has far fewer steps than these.
    stage.app.world_mut().resource_mut::<Time<Physics>>().pause();
    stage.frame();
    let before = left(&mut stage);
    stage.frames(200);
    assert_eq!(left(&mut stage), before, "nothing ages while physics rests");
    stage.app.world_mut().resource_mut::<Time<Physics>>().unpause();
    let start = stage.seconds();
    stage.frames(20);
    let aged = before - left(&mut stage);
    assert!(aged > 0.0 && (aged - (stage.seconds() - start)).abs() < 2.5 * STEP, "{aged}");
    stage.frames_until("it crumbles", |stage| pieces(stage).is_empty());
}
