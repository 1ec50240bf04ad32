//! The `Terrains` parameter: questions in world space.

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
fn rays_in_world_space_meet_what_the_model_says() {
    let (mut stage, terrain, model) = dug();
    let mut rng = Rng::with_seed(3);
    let (mut hits, mut inside) = (0, 0);
    for index in 0..400 {
        let place = |rng: &mut Rng| {
            Vec3::new(rng.f32() * 68.0 - 2.0, rng.f32() * 70.0 - 30.0, rng.f32() * 68.0 - 2.0)
        };
        // Coordinates that a float holds exactly, in either space.
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
fn ground_is_ready_when_no_edit_is_on_its_way() {
    let mut stage = Stage::drawing();
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
    assert!(!ask(&mut stage, around(8.0, 8.0)), "its edit is under way");
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
