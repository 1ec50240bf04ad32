//! The `Terrains` system parameter: queries in world space.

use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy_burrow::prelude::*;
use fastrand::Rng;

use crate::stage::{Stage, dig, hills, random_brushes};

const PLACE: Vec3 = Vec3::new(-20.0, 12.0, 300.0);
const VOXEL: f32 = 0.5;

fn ask<T: 'static>(stage: &mut Stage, question: impl Fn(&Terrains) -> T + Send + Sync + 'static) -> T {
    stage
        .app
        .world_mut()
        .run_system_once(move |terrains: Terrains| question(&terrains))
        .expect("the system runs")
}

/// A moved and scaled terrain that was dug through the app, and a model with the same edits.
fn dug() -> (Stage, Entity, Terrain) {
    let settings = TerrainSettings { chunk_size: 16, voxel_size: VOXEL };
    let fresh = || Terrain::new(hills(), &settings).expect("valid settings");
    let (mut model, mut stage) = (fresh(), Stage::drawing());
    let terrain = stage.spawn_at(fresh(), PLACE);
    stage.settle();
    for brush in random_brushes(18, 60) {
        model.apply([&brush]);
        stage.send(brush.transformed(Quat::IDENTITY, PLACE, VOXEL));
    }
    stage.settle();
    assert_eq!(stage.hash(terrain), model.world().hash());
    (stage, terrain, model)
}

fn to_world(local: bevy::math::DVec3) -> Vec3 {
    (local * f64::from(VOXEL) + PLACE.as_dvec3()).as_vec3()
}

#[test]
fn rays_in_world_space_agree_with_the_model() {
    let (mut stage, terrain, model) = dug();
    let mut rng = Rng::with_seed(3);
    let (mut hits, mut inside) = (0, 0);
    for index in 0..400 {
        let place = |rng: &mut Rng| {
            Vec3::new(rng.f32() * 68.0 - 2.0, rng.f32() * 70.0 - 30.0, rng.f32() * 68.0 - 2.0)
        };
        // Coordinates that are exact in `f32` in both spaces.
        let (from, to) = ((place(&mut rng) * 8.0).round() / 8.0, (place(&mut rng) * 8.0).round() / 8.0);
        let direction = (to - from).normalize_or(Vec3::NEG_Y);
        let reach = [1000.0, 20.0][index % 2];
        let expected = model.world().raycast(from.as_dvec3(), direction.as_dvec3(), f64::from(reach));
        let ray = Ray3d::new(from * VOXEL + PLACE, Dir3::new(direction).expect("a direction"));
        let found = ask(&mut stage, move |terrains| terrains.raycast(ray, reach * VOXEL));
        let (Some(expected), Some(found)) = (expected, found) else {
            assert_eq!(expected.is_some(), found.is_some(), "from {from} towards {direction} within {reach}");
            continue;
        };
        hits += 1;
        inside += usize::from(found.from_inside);
        assert_eq!(
            (found.terrain, found.from_inside, found.material),
            (terrain, expected.from_inside, expected.material)
        );
        let apart = found.position.distance(to_world(expected.position));
        assert!(apart < 1e-3, "{apart} metres apart");
        assert!((f64::from(found.distance) - expected.distance * f64::from(VOXEL)).abs() < 1e-3);
        assert!(found.normal.abs_diff_eq(expected.normal, 1e-3));
    }
    assert!(hits > 100 && inside > 10, "{hits} hits, {inside} from inside");
}

#[test]
fn heights_and_spans_in_world_space_are_those_of_the_model() {
    let (mut stage, _, model) = dug();
    let mut rng = Rng::with_seed(4);
    let mut caves = 0;
    for _ in 0..400 {
        let (x, z) = ((rng.f32() * 1100.0).floor() / 16.0 - 2.0, (rng.f32() * 1100.0).floor() / 16.0 - 2.0);
        let (wx, wz) = (x * VOXEL + PLACE.x, z * VOXEL + PLACE.z);
        let expected = model.world().spans(f64::from(x), f64::from(z));
        let spans = ask(&mut stage, move |terrains| terrains.spans(wx, wz));
        assert_eq!(spans.len(), expected.len(), "over ({x}, {z})");
        caves += usize::from(spans.len() > 1);
        let world = |y: f64| y * f64::from(VOXEL) + f64::from(PLACE.y);
        for (found, expected) in spans.iter().zip(&expected) {
            assert!((found.floor - world(expected.floor)).abs() < 1e-9);
            assert_eq!(found.ceiling.is_some(), expected.ceiling.is_some());
            assert!(found.ceiling.zip(expected.ceiling).is_none_or(|(a, b)| (a - world(b)).abs() < 1e-9));
        }
        let height = ask(&mut stage, move |terrains| terrains.height(wx, wz));
        assert_eq!(height, spans.last().map(|span| span.floor as f32));
        if let (Some(height), Some(below)) = (height, model.world().height(f64::from(x), f64::from(z))) {
            assert!((f64::from(height) - world(below)).abs() < 1e-4);
            let solid = move |y: f32| Vec3::new(wx, y, wz);
            let (under, over) = ask(&mut stage, move |terrains| {
                (terrains.is_solid(solid(height - 0.01)), terrains.is_solid(solid(height + 0.01)))
            });
            assert!(!over);
            assert!(under || spans.iter().any(|span| span.ceiling.is_some()), "a thin roof at most");
        }
    }
    assert!(caves > 10, "{caves} columns with a cave");
}

#[test]
fn ground_is_ready_when_no_edit_is_pending() {
    let mut stage = Stage::drawing().without_waiting();
    let settings = TerrainSettings { chunk_size: 16, voxel_size: VOXEL };
    stage.spawn_at(Terrain::new(hills(), &settings).expect("valid settings"), PLACE);
    let around = |x: f32, z: f32| {
        let center = PLACE + Vec3::new(x, 2.0, z);
        move |terrains: &Terrains| terrains.is_ready(center - 3.0, center + 3.0)
    };
    assert!(!ask(&mut stage, around(8.0, 8.0)), "it did not load yet");
    stage.settle();
    assert!(ask(&mut stage, around(8.0, 8.0)) && ask(&mut stage, around(26.0, 26.0)));
    let at = PLACE + Vec3::new(8.0, 2.0, 8.0);
    stage.send(dig(at.x, at.y, at.z, 2.0));
    stage.frame();
    assert!(!ask(&mut stage, around(8.0, 8.0)), "its edit is pending");
    assert!(ask(&mut stage, around(26.0, 26.0)), "no edit is on its way there");
    stage.settle();
    assert!(ask(&mut stage, around(8.0, 8.0)));
}

#[test]
fn of_two_terrains_a_ray_meets_the_nearer_one() {
    let mut stage = Stage::drawing();
    let far = stage.spawn(crate::stage::level(1.0));
    let near = stage.spawn_at(crate::stage::level(0.5), Vec3::new(0.0, 100.0, 0.0));
    stage.settle();
    let down = |x: f32| Ray3d::new(Vec3::new(x, 200.0, 10.0), Dir3::NEG_Y);
    let hit = ask(&mut stage, move |terrains| terrains.raycast(down(10.0), 1000.0)).expect("ground");
    assert_eq!((hit.terrain, hit.distance, hit.position.y), (near, 96.0, 104.0));
    let hit = ask(&mut stage, move |terrains| terrains.raycast(down(50.0), 1000.0)).expect("ground");
    assert_eq!((hit.terrain, hit.distance), (far, 192.0));
    assert_eq!(ask(&mut stage, move |terrains| terrains.raycast(down(50.0), 100.0)), None);
    assert_eq!(ask(&mut stage, move |terrains| terrains.raycast(down(90.0), 1000.0)), None);
}

/// A terrain that is moved, rotated and scaled, with a spot of another material; its transform, and its model.
fn turned() -> (Stage, Transform, Terrain) {
    let settings = TerrainSettings { chunk_size: 16, voxel_size: VOXEL };
    let fresh = || {
        let mut terrain = Terrain::new(hills(), &settings).expect("valid settings");
        terrain.apply([Brush::paint(Shape::sphere(Vec3::new(30.0, 10.0, 30.0), 16.0), MaterialId(5))]);
        terrain
    };
    let turn = Quat::from_euler(EulerRot::YXZ, 0.7, 0.4, -0.3);
    let place = Transform::from_translation(PLACE).with_rotation(turn);
    let mut stage = Stage::drawing();
    stage.app.world_mut().spawn((fresh(), place));
    stage.settle();
    (stage, place.with_scale(Vec3::splat(VOXEL)), fresh())
}

#[test]
fn rays_hit_a_turned_terrain_where_it_is() {
    let (mut stage, place, model) = turned();
    let (mut hits, mut alike) = (0, 0);
    for index in 0..100 {
        let (x, z) = ((index * 37 % 61) as f32 + 1.3, (index * 17 % 59) as f32 + 1.2);
        let (from, along) = (Vec3::new(x, 60.0, z), Vec3::new(0.2, -1.0, 0.1).normalize());
        let expected = model.world().raycast(from.as_dvec3(), along.as_dvec3(), 1000.0);
        let direction = Dir3::new(place.rotation * along).expect("a direction");
        let ray = Ray3d::new(place.transform_point(from), direction);
        let found = ask(&mut stage, move |terrains| terrains.raycast(ray, 500.0));
        let (Some(expected), Some(found)) = (expected, found) else {
            assert_eq!(expected.is_some(), found.is_some(), "from {from}");
            continue;
        };
        hits += 1;
        let apart = found.position.distance(place.transform_point(expected.position.as_vec3()));
        assert!(apart < 1e-2, "{apart} metres apart");
        assert!((f64::from(found.distance) - expected.distance * f64::from(VOXEL)).abs() < 1e-2);
        assert!(found.normal.is_normalized());
        alike += usize::from(found.normal.abs_diff_eq(place.rotation * expected.normal, 1e-3));
    }
    // Rounding may move a ray across an edge.
    assert!(hits > 50 && alike + 2 >= hits, "{alike} normals of {hits} are alike");
}

#[test]
fn normals_and_materials_of_a_turned_terrain_are_those_of_the_model() {
    let (mut stage, place, model) = turned();
    let (mut all, mut painted) = (0, 0);
    for (x, z) in (1..63).step_by(3).flat_map(|x| (1..63).step_by(3).map(move |z| (x, z))) {
        // Away from the edges of triangles, and clearly nearest to one lattice point.
        let (x, z) = (x as f32 + 0.3, z as f32 + 0.2);
        let y = model.world().height(f64::from(x), f64::from(z)).expect("ground") as f32;
        let local = Vec3::new(x, y - 0.1, z);
        let at = place.transform_point(local);
        let found = ask(&mut stage, move |terrains| terrains.normal(at).zip(terrains.material(at)));
        let (normal, material) = found.expect("ground");
        let expected = place.rotation * model.world().normal(local.as_dvec3()).expect("ground");
        assert!(normal.is_normalized() && normal.abs_diff_eq(expected, 1e-3), "{normal} at {local}");
        assert_eq!(material, model.world().material_under(local.as_dvec3()), "at {local}");
        all += 1;
        painted += usize::from(material == MaterialId(5));
    }
    assert!(painted > 20 && painted < all - 20, "{painted} of {all} are painted");
}

#[test]
fn where_terrains_overlap_the_topmost_one_and_the_nearest_one_answer() {
    let (x, z) = (10.3_f32, 10.2_f32);
    let lower = crate::stage::steep();
    let low = lower.world().height(f64::from(x), f64::from(z)).expect("ground") as f32;
    let low = Vec3::new(x, low, z);
    let slope = lower.world().normal(low.as_dvec3()).expect("ground");
    let clay = ColumnMaterial { base: MaterialId(4), overlay: MaterialId(4), blend: 255 };
    for is_first_upper in [false, true] {
        let mut stage = Stage::drawing();
        for is_upper in [is_first_upper, !is_first_upper] {
            if is_upper {
                let ground = Ground::flat(64, 64, 8.0).expect("valid ground");
                let ground = ground.with_materials(&MaterialControl::Uniform(clay)).expect("valid materials");
                let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
                stage.spawn_at(terrain, Vec3::Y * 100.0);
            } else {
                stage.spawn(crate::stage::steep());
            }
        }
        stage.settle();
        let (height, spans) = ask(&mut stage, move |terrains| (terrains.height(x, z), terrains.spans(x, z)));
        assert_eq!((height, spans), (Some(108.0), vec![Span { floor: 108.0, ceiling: None }]));
        let places = [low, Vec3::new(x, 108.0, z)];
        let normals = ask(&mut stage, move |terrains| places.map(|at| terrains.normal(at).expect("ground")));
        assert!(normals[0].abs_diff_eq(slope, 1e-5) && normals[1].abs_diff_eq(Vec3::Y, 1e-5), "{normals:?}");
        let materials = ask(&mut stage, move |terrains| places.map(|at| terrains.material(at)));
        assert_eq!(materials, [Some(MaterialId(0)), Some(MaterialId(4))]);
    }
}

#[test]
fn ground_of_a_turned_terrain_is_not_ready_where_an_edit_is_pending() {
    let mut stage = Stage::drawing().without_waiting();
    let place = Transform::from_rotation(Quat::from_rotation_y(std::f32::consts::FRAC_PI_4));
    stage.app.world_mut().spawn((crate::stage::level(1.0), place));
    stage.settle();
    let local = Vec3::new(30.0, 8.0, 30.0);
    let middle = place.transform_point(local);
    let around = move |terrains: &Terrains| terrains.is_ready(middle - 8.0, middle + 8.0);
    assert!(ask(&mut stage, around));
    for beside in [Vec3::X, Vec3::Z] {
        let at = place.transform_point(local + beside * 6.0);
        stage.send(dig(at.x, at.y, at.z, 1.0));
        stage.frame();
        assert!(!ask(&mut stage, around), "an edit {beside} of the middle is pending");
        stage.settle();
        assert!(ask(&mut stage, around));
    }
}

#[test]
fn nothing_is_ready_without_a_terrain_or_for_nan_corners() {
    let mut stage = Stage::drawing().without_waiting();
    let everywhere = |terrains: &Terrains| terrains.is_ready(Vec3::NEG_INFINITY, Vec3::INFINITY);
    assert!(!ask(&mut stage, everywhere), "there is none");
    stage.show(crate::stage::level(1.0));
    assert!(ask(&mut stage, everywhere));
    for corner in [Vec3::NAN, Vec3::new(0.0, f32::NAN, 0.0)] {
        assert!(!ask(&mut stage, move |terrains| terrains.is_ready(corner, Vec3::ONE)));
        assert!(!ask(&mut stage, move |terrains| terrains.is_ready(Vec3::ZERO, corner)));
    }
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.frame();
    assert!(!ask(&mut stage, everywhere), "an edit is pending");
}
