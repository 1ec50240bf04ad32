//! Terrains below parents of all kinds: without a `Transform`, as the root of a floating origin is, moved by another
//! plugin, mirrored and stretched.

use bevy::ecs::system::RunSystemOnce;
use bevy::math::DVec3;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level};

/// A cell of a floating origin, as plugins like `big_space` have them: 1,000 m wide, and unknown to `Transform`.
#[derive(Component, Clone, Copy, Default)]
struct Cell(IVec3);

/// The cell in which the origin is.
#[derive(Resource, Default)]
struct Origin(IVec3);

/// What such a plugin does in place of Bevy: places are counted from the cell of the origin.
fn propagate(
    origin: Res<Origin>,
    mut entities: Query<(Entity, &Cell, &Transform, &mut GlobalTransform)>,
    children: Query<&Children>,
    mut below: Query<(&Transform, &mut GlobalTransform), Without<Cell>>,
) {
    for (entity, cell, local, mut place) in &mut entities {
        let corner = (cell.0 - origin.0).as_vec3() * 1000.0;
        place.set_if_neq(GlobalTransform::from_translation(corner) * *local);
        let mut todo = vec![(entity, *place)];
        while let Some((parent, from)) = todo.pop() {
            for child in children.get(parent).into_iter().flatten() {
                if let Ok((local, mut place)) = below.get_mut(*child) {
                    place.set_if_neq(from * *local);
                    todo.push((*child, *place));
                }
            }
        }
    }
}

/// A stage without Bevy's own propagation.
fn stage() -> Stage {
    let mut stage = Stage::with((MinimalPlugins, AssetPlugin::default(), bevy::mesh::MeshPlugin));
    stage.app.init_resource::<Origin>().add_systems(PostUpdate, propagate);
    stage
}

/// A terrain in a cell, below a root that has no `Transform`.
fn spawn(stage: &mut Stage, cell: IVec3, model: impl Bundle) -> Entity {
    let world = stage.app.world_mut();
    let root = world.spawn((GlobalTransform::default(), Visibility::default())).id();
    let terrain = world.spawn((model, Cell(cell), ChildOf(root))).id();
    stage.settle();
    stage.frames(2);
    terrain
}

fn cast(stage: &mut Stage, from: Vec3) -> Option<TerrainHit> {
    let ray = Ray3d::new(from, Dir3::NEG_Y);
    let ask = move |terrains: Terrains| terrains.raycast(ray, 1000.0);
    stage.app.world_mut().run_system_once(ask).expect("it can be asked")
}

fn is_dug(stage: &Stage, terrain: Entity, at: DVec3) -> bool {
    !stage.terrain(terrain).world().is_solid(at)
}

#[test]
fn brushes_and_rays_find_a_terrain_in_a_cell_of_a_floating_origin() {
    let mut stage = stage();
    let terrain = spawn(&mut stage, IVec3::new(-1, 0, 0), level(1.0));
    let hit = cast(&mut stage, Vec3::new(-970.0, 100.0, 30.0)).expect("it is there");
    assert_eq!((hit.position, hit.distance), (Vec3::new(-970.0, 8.0, 30.0), 92.0));
    stage.send(dig(-970.0, 8.0, 30.0, 4.0));
    stage.settle();
    assert!(is_dug(&stage, terrain, DVec3::new(30.0, 7.0, 30.0)));
    // The origin moves into the terrain's cell, and then far away.
    for origin in [IVec3::new(-1, 0, 0), IVec3::new(-9, 0, 3)] {
        stage.app.insert_resource(Origin(origin));
        stage.frames(2);
        let corner = (IVec3::new(-1, 0, 0) - origin).as_vec3() * 1000.0;
        let at = Vec3::new(10.0 + 8.0 * corner.x.signum(), 8.0, 50.0);
        assert!(cast(&mut stage, corner + at.with_y(100.0)).is_some(), "{origin}");
        stage.send(dig(corner.x + at.x, 8.0, corner.z + at.z, 3.0));
        stage.settle();
        assert!(is_dug(&stage, terrain, at.as_dvec3() - DVec3::Y), "{origin}");
    }
    // All drawn parts are where the terrain is.
    let place = *stage.app.world().get::<GlobalTransform>(terrain).expect("a place");
    let world = stage.app.world_mut();
    let mut parts = world.query_filtered::<(&Transform, &GlobalTransform), Or<(With<Tile>, With<Chunk>)>>();
    assert!(parts.iter(world).all(|(local, global)| *global == place * *local));
}

#[test]
fn levels_of_detail_follow_cells_and_not_transforms() {
    let mut stage = stage();
    let noise = NoiseHeights { seed: 9, octaves: 5, scale: 70.0, amplitude: 60.0, base: 0.0, ..default() };
    let ground = Ground::from_noise(320, 270, &noise).expect("valid mountains");
    let model = Terrain::new(ground, &TerrainSettings { chunk_size: 16, voxel_size: 1.0 }).expect("valid");
    let levels = LevelsOfDetail { cell_pixels: 24.0, error_pixels: 1.0, ..default() };
    let place = Transform::from_xyz(40.0, 90.0, 40.0);
    let camera = (Camera::default(), bevy::camera::Projection::default(), place);
    let world = stage.app.world_mut();
    let root = world.spawn((GlobalTransform::default(), Visibility::default())).id();
    world.spawn((camera, Cell(IVec3::new(5, 0, 5)), ChildOf(root)));
    let terrain = world.spawn((model, levels, Cell(IVec3::new(5, 0, 5)), ChildOf(root))).id();
    stage.settle();
    stage.frames(30);
    let nodes = |stage: &Stage| stage.app.world().get::<ShownLevels>(terrain).expect("levels").nodes.clone();
    let before = nodes(&stage);
    assert!(before[0] > 0, "{before:?}");
    for origin in [IVec3::new(5, 0, 5), IVec3::new(7, 0, 5), IVec3::ZERO] {
        stage.app.insert_resource(Origin(origin));
        for _ in 0..20 {
            stage.frames(1);
            assert_eq!(nodes(&stage), before, "origin in {origin}");
        }
    }
}

#[test]
fn a_place_that_another_plugin_maintains_is_kept() {
    // The terrain has a `Transform` that leads elsewhere, and so have all of its parents.
    fn put(mut terrains: Query<&mut GlobalTransform, With<Terrain>>) {
        for mut place in &mut terrains {
            place.set_if_neq(GlobalTransform::from_xyz(-1000.0, 0.0, 0.0));
        }
    }
    let mut stage = Stage::server();
    stage.app.add_systems(PostUpdate, put);
    let terrain = stage.show(level(1.0));
    stage.frames(2);
    assert!(cast(&mut stage, Vec3::new(-970.0, 100.0, 30.0)).is_some());
    stage.send(dig(-970.0, 8.0, 30.0, 4.0));
    stage.settle();
    assert!(is_dug(&stage, terrain, DVec3::new(30.0, 7.0, 30.0)));
}

#[test]
fn a_terrain_that_the_game_moves_is_where_its_transform_says_in_the_same_frame() {
    for mut stage in [Stage::drawing(), Stage::server()] {
        let terrain = stage.show(level(1.0));
        for step in 1..6 {
            let x = 100.0 * step as f32;
            stage.app.world_mut().get_mut::<Transform>(terrain).expect("a place").translation.x = x;
            stage.send(dig(x + 8.0 * step as f32, 8.0, 30.0, 3.0));
            stage.frame();
            assert!(cast(&mut stage, Vec3::new(x + 40.0, 100.0, 10.0)).is_some(), "step {step}");
            stage.settle();
            assert!(is_dug(&stage, terrain, DVec3::new(8.0 * f64::from(step), 7.0, 30.0)), "step {step}");
        }
    }
}

#[test]
fn rays_heights_and_brushes_are_right_below_mirrored_stretched_and_turned_parents() {
    let parents = [
        Transform::from_xyz(3.0, 4.0, 5.0).with_scale(Vec3::new(-1.0, 1.0, 1.0)),
        Transform::from_xyz(3.0, 4.0, 5.0).with_scale(Vec3::new(1.0, 1.0, -2.0)),
        Transform::from_xyz(3.0, 4.0, 5.0).with_scale(Vec3::new(2.0, 0.5, 3.0)),
        Transform::from_xyz(3.0, 4.0, 5.0).with_rotation(Quat::from_rotation_y(0.7)),
        Transform::from_xyz(-7.0, 0.0, 5.0)
            .with_rotation(Quat::from_rotation_y(-2.0))
            .with_scale(Vec3::splat(0.25)),
    ];
    for parent in parents {
        let mut stage = Stage::drawing();
        let root = stage.app.world_mut().spawn((parent, Visibility::default())).id();
        let terrain = stage.app.world_mut().spawn((level(1.0), ChildOf(root))).id();
        stage.settle();
        let place = GlobalTransform::from(parent);
        let top = place.transform_point(Vec3::new(30.0, 8.0, 20.0));
        let near = |a: f32, b: f32| (a - b).abs() < 1e-3;
        let hit = cast(&mut stage, top + Vec3::Y * 50.0).unwrap_or_else(|| panic!("{parent:?}"));
        assert!(hit.position.abs_diff_eq(top, 1e-3) && near(hit.distance, 50.0), "{parent:?}: {hit:?}");
        assert!(hit.normal.abs_diff_eq(Vec3::Y, 1e-4), "{parent:?}: {hit:?}");
        let height = stage
            .app
            .world_mut()
            .run_system_once(move |terrains: Terrains| terrains.height(top.x, top.z))
            .expect("it can be asked");
        assert!(height.is_some_and(|height| near(height, top.y)), "{parent:?}: {height:?}");
        stage.send(Brush::dig(Shape::sphere(top, 2.0)));
        stage.settle();
        assert!(is_dug(&stage, terrain, DVec3::new(30.0, 7.4, 20.0)), "{parent:?}");
        assert!(!is_dug(&stage, terrain, DVec3::new(34.0, 1.0, 26.0)), "{parent:?}");
        assert!(stage.terrain(terrain).world().check_seams().is_flawless());
    }
}

#[test]
fn a_terrain_whose_scale_is_0_is_left_out_and_nothing_panics() {
    let mut stage = Stage::drawing();
    let parent = Transform::from_scale(Vec3::new(1.0, 0.0, 1.0));
    let root = stage.app.world_mut().spawn((parent, Visibility::default())).id();
    let terrain = stage.app.world_mut().spawn((level(1.0), LevelsOfDetail::default(), ChildOf(root))).id();
    let camera =
        (Camera::default(), bevy::camera::Projection::default(), Transform::from_xyz(9.0, 20.0, 9.0));
    stage.app.world_mut().spawn(camera);
    stage.settle();
    assert!(cast(&mut stage, Vec3::new(30.0, 100.0, 30.0)).is_none());
    stage.send(dig(30.0, 8.0, 30.0, 3.0));
    stage.frames(10);
    assert_eq!(stage.receipts().len(), 1, "it is answered");
    for broken in [Vec3::NAN, Vec3::INFINITY] {
        stage.app.world_mut().get_mut::<Transform>(root).expect("a place").translation = broken;
        stage.send(dig(30.0, 8.0, 30.0, 3.0));
        stage.frames(4);
    }
    assert_eq!(stage.receipts().len(), 3);
    *stage.app.world_mut().get_mut::<Transform>(root).expect("a place") = Transform::IDENTITY;
    stage.send(dig(30.0, 8.0, 30.0, 3.0));
    stage.settle();
    assert!(is_dug(&stage, terrain, DVec3::new(30.0, 7.0, 30.0)), "once it has a place again");
}
