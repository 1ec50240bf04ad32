//! Several terrains in one app.

use std::slice::from_ref;

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::stage::{Stage, dig, level};

/// A terrain of 64 x 64 metres; and one of 32 x 32 metres with voxels of half a metre, four metres to its side and two
/// metres lower. Both have their ground at height 8 in voxels, that is at 8 and 4 - 2 = 2 metres.
fn pair() -> (Stage, Entity, Entity) {
    let mut stage = Stage::drawing();
    let first = stage.spawn(level(1.0));
    let second = stage.spawn_at(level(0.5), SECOND);
    stage.settle();
    (stage, first, second)
}

const SECOND: Vec3 = Vec3::new(68.0, -2.0, 10.0);

/// The hash of a fresh second terrain after world-space brushes.
fn second_after(brushes: &[Brush]) -> u64 {
    let mut model = level(0.5);
    model.apply(brushes.iter().map(|brush| brush.transformed(Quat::IDENTITY, SECOND * -2.0, 2.0)));
    model.world().hash()
}

fn first_after(brushes: &[Brush]) -> u64 {
    let mut model = level(1.0);
    model.apply(brushes);
    model.world().hash()
}

/// Terrain and success of each receipt.
fn answers(stage: &Stage) -> Vec<(Option<Entity>, bool)> {
    stage.receipts().iter().map(|applied| (applied.terrain, applied.receipt.outcome.is_ok())).collect()
}

#[test]
fn a_brush_changes_the_terrain_that_it_reaches_and_no_other() {
    let (mut stage, first, second) = pair();
    let (a, b) = (dig(30.0, 8.0, 30.0, 4.0), dig(80.0, 2.0, 20.0, 3.0));
    stage.send(a.clone());
    stage.settle();
    assert_eq!((stage.hash(first), stage.hash(second)), (first_after(from_ref(&a)), second_after(&[])));
    stage.send(b.clone());
    stage.settle();
    assert_eq!((stage.hash(first), stage.hash(second)), (first_after(&[a]), second_after(&[b])));
    assert_eq!(answers(&stage), [(Some(first), true), (Some(second), true)]);
    stage.assert_whole(first, "both dug");
    stage.assert_whole(second, "both dug");
    let removed =
        |index: usize| stage.receipts()[index].receipt.outcome.as_ref().expect("dug").removed.total();
    assert!(removed(1) > 2 * removed(0), "half voxels are smaller: a ball of 3 metres has radius 6 there");
}

#[test]
fn a_brush_across_two_terrains_changes_both() {
    let (mut stage, first, second) = pair();
    let tunnel =
        Brush::dig(Shape::capsule(Vec3::new(58.0, 5.0, 24.0), Vec3::new(76.0, 1.0, 24.0), 3.0)).with_tag(3);
    stage.send(tunnel.clone());
    stage.settle();
    assert_ne!(first_after(&[]), first_after(from_ref(&tunnel)));
    assert_ne!(second_after(&[]), second_after(from_ref(&tunnel)));
    assert_eq!(
        (stage.hash(first), stage.hash(second)),
        (first_after(from_ref(&tunnel)), second_after(&[tunnel]))
    );
    let mut answers = answers(&stage);
    answers.sort();
    let mut both = [(Some(first), true), (Some(second), true)];
    both.sort();
    assert_eq!(answers, both, "one receipt from each");
    assert_eq!(stage.tags(), [3, 3]);
    stage.assert_whole(first, "tunnel");
    stage.assert_whole(second, "tunnel");
}

#[test]
fn a_targeted_brush_changes_its_target_alone() {
    let (mut stage, first, second) = pair();
    let tunnel = Brush::dig(Shape::capsule(Vec3::new(58.0, 5.0, 24.0), Vec3::new(76.0, 1.0, 24.0), 3.0));
    stage.send_to(second, tunnel.clone());
    stage.settle();
    assert_eq!((stage.hash(first), stage.hash(second)), (first_after(&[]), second_after(&[tunnel])));
    // A brush outside its target is refused, even if another terrain is there.
    stage.send_to(second, dig(20.0, 8.0, 20.0, 4.0));
    stage.settle();
    assert_eq!(stage.hash(first), first_after(&[]));
    assert_eq!(answers(&stage), [(Some(second), true), (Some(second), false)]);
}

#[test]
fn a_brush_for_a_despawned_terrain_is_refused() {
    let (mut stage, first, second) = pair();
    stage.app.world_mut().despawn(second);
    let no_terrain = stage.app.world_mut().spawn_empty().id();
    for (tag, target) in [second, no_terrain, first].into_iter().enumerate() {
        stage.send_to(target, dig(30.0, 8.0, 30.0, 4.0).with_tag(tag as u64));
    }
    stage.settle();
    assert_eq!(answers(&stage), [(Some(second), false), (Some(no_terrain), false), (Some(first), true)]);
    assert_eq!(stage.tags(), [0, 1, 2]);
}

#[test]
fn a_terrain_is_dug_where_it_was_moved_to() {
    let (mut stage, first, _) = pair();
    stage.app.world_mut().get_mut::<Transform>(first).expect("a place").translation =
        Vec3::new(0.0, 0.0, -512.0);
    stage.frame();
    stage.send(dig(30.0, 8.0, 30.0 - 512.0, 4.0));
    stage.settle();
    assert_eq!(stage.hash(first), first_after(&[dig(30.0, 8.0, 30.0, 4.0)]));
    stage.assert_whole(first, "moved");
}

#[test]
fn a_terrain_below_another_entity_is_dug_where_that_one_puts_it() {
    let mut stage = Stage::drawing();
    let island = (Transform::from_xyz(500.0, -16.0, 0.0), Visibility::default());
    let island = stage.app.world_mut().spawn(island).id();
    let terrain = stage.spawn_at(level(0.5), Vec3::new(0.0, 0.0, 32.0));
    stage.app.world_mut().entity_mut(terrain).insert(ChildOf(island));
    stage.send(dig(500.0 + 16.0, -16.0 + 4.0, 32.0 + 8.0, 2.0));
    stage.settle();
    let mut model = level(0.5);
    model.apply([dig(32.0, 8.0, 16.0, 4.0)]);
    assert_eq!(stage.hash(terrain), model.world().hash());
    stage.assert_whole(terrain, "below another entity");
}

/// Brushes for level ground in the space to which `place` maps voxels of size `size`.
fn tools(place: Affine3A, size: f32) -> [Brush; 6] {
    let at = |x, y, z| place.transform_point3(Vec3::new(x, y, z));
    let up = |length: f32| place.transform_vector3(Vec3::Y * length);
    let ball = |x, z| Shape::sphere(at(x, 8.0, z), 6.0 * size);
    let normal = place.matrix3.inverse().transpose() * Vec3::new(1.0, 3.0, 0.0);
    [
        Brush::dig(Shape::capsule(at(8.0, 6.0, 50.0), at(50.0, 8.0, 58.0), 3.0 * size)),
        Brush::add(Shape::cone(at(40.0, 6.0, 16.0), up(9.0), 5.0 * size), MaterialId(3)),
        Brush::dig(Shape::cuboid(at(54.0, 8.0, 30.0), Vec3::splat(2.0 * size))),
        Brush::level(ball(12.0, 30.0), at(0.0, 10.0, 0.0).y).with_falloff(2.0 * size),
        Brush::flatten(ball(30.0, 30.0), at(30.0, 9.0, 30.0), normal).with_falloff(2.0 * size),
        Brush::dig(Shape::cylinder(at(14.0, 2.0, 12.0), up(9.0), 4.0 * size)),
    ]
}

#[test]
fn a_stretched_terrain_is_dug_where_brushes_are_in_the_world() {
    let mut stage = Stage::drawing();
    let place = Transform::from_xyz(500.0, -16.0, 0.0).with_scale(Vec3::new(1.0, 2.0, 1.0));
    let island = stage.app.world_mut().spawn((place, Visibility::default())).id();
    let terrain = stage.spawn(level(0.5));
    stage.app.world_mut().entity_mut(terrain).insert(ChildOf(island));
    let voxels = place.compute_affine() * Affine3A::from_scale(Vec3::splat(0.5));
    tools(voxels, voxels.matrix3.determinant().cbrt()).into_iter().for_each(|brush| stage.send(brush));
    stage.settle();
    assert_eq!(answers(&stage), [(Some(terrain), true); 6]);
    let mut model = level(0.5);
    model.apply(tools(Affine3A::IDENTITY, 1.0));
    assert_eq!(stage.hash(terrain), model.world().hash());
}

#[test]
fn each_terrain_reports_its_own_refusal_of_a_brush() {
    let mut stage = Stage::drawing();
    let (coarse, fine) = (stage.spawn(level(1.0)), stage.spawn(level(0.5)));
    stage.settle();
    // Too small for voxels of a metre, and just large enough for those of half a metre.
    stage.send(dig(10.0, 6.0, 10.0, 0.15));
    stage.settle();
    let (mut answers, mut both) = (answers(&stage), [(Some(coarse), false), (Some(fine), true)]);
    answers.sort();
    both.sort();
    assert_eq!(answers, both);
}

#[test]
fn a_brush_that_reaches_no_terrain_is_rejected_as_outside() {
    let (mut stage, ..) = pair();
    stage.send(dig(-500.0, 8.0, 30.0, 0.1));
    stage.frame();
    let [applied] = stage.receipts() else { panic!("one receipt") };
    assert_eq!((applied.terrain, &applied.receipt.outcome), (None, &Err(Rejection::OutsideWorld)));
}

/// The terrains that change detection reports.
#[derive(Resource, Default)]
struct Changes(Vec<Entity>);

#[test]
fn a_brush_does_not_mark_terrains_out_of_reach_as_changed() {
    let (mut stage, first, second) = pair();
    stage.app.init_resource::<Changes>().add_systems(
        Last,
        |changed: Query<Entity, Changed<Terrain>>, mut changes: ResMut<Changes>| {
            changes.0.extend(changed.iter());
        },
    );
    // A new system sees everything as changed at first.
    stage.frame();
    stage.app.world_mut().resource_mut::<Changes>().0.clear();
    stage.send(dig(30.0, 8.0, 30.0, 4.0));
    stage.settle();
    let changes = &stage.app.world().resource::<Changes>().0;
    assert!(changes.contains(&first) && !changes.contains(&second), "{changes:?}");
}
