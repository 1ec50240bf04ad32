//! Incremental updates equal a computation from scratch.

use bevy_burrow::lattice::Column;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::Vec3;

use crate::checked_terrain::CheckedTerrain;
use crate::play::{any_brush, any_ground, play};
use crate::worlds::world_count;

#[test]
fn every_commit_equals_a_world_made_from_scratch() {
    for seed in 0..world_count(30) {
        let mut rng = Rng::with_seed(seed);
        let (ground, chunk_size) = any_ground(&mut rng, seed);
        let what = format!("world {seed}, {}x{} in chunks of {chunk_size}", ground.width(), ground.depth());
        let mut checked = CheckedTerrain::new(ground, chunk_size);
        play(&mut checked, &mut rng, 10, 7.0, &what);
    }
}

#[test]
fn a_normal_that_only_changes_the_sign_of_its_zeros_is_redrawn() {
    // The tile's normal of flat ground and the gradient of its samples both point straight up, but differ in a zero's
    // sign.
    let ground = || Ground::flat(32, 32, 10.5).expect("valid ground");
    let paint = |from: f32, to: f32| {
        let (middle, half) = (Vec3::new((from + to) * 0.5, 9.0, 4.0), Vec3::new((to - from) * 0.5, 2.0, 2.0));
        Brush::paint(Shape::cuboid(middle, half), MaterialId::GROUND)
    };
    // Column 8, on the face of two bricks, lies on the mask's border only until the second brush.
    let (first, second) = (paint(2.0, 7.0), paint(9.0, 14.0));
    let (mut once, mut twice) = (CheckedTerrain::new(ground(), 32), CheckedTerrain::new(ground(), 32));
    once.apply(&[first.clone(), second.clone()], "at once");
    twice.apply(&[first], "first");
    twice.apply(&[second], "second");
    assert!(once.chunks == twice.chunks, "the result depends on batching");
}

#[test]
fn commits_at_the_ends_of_the_lattice_equal_worlds_made_from_scratch() {
    for (i, base) in [32_768.0, 32_767.5, 32_761.0, -32_768.0, -32_767.25, -32_760.0].into_iter().enumerate()
    {
        let mut rng = Rng::with_seed(i as u64);
        let bumps: Vec<f64> = (0..13 * 12).map(|_| rng.f64() * 6.0).collect();
        let height = |x: i32, z: i32| (base + bumps[(z * 13 + x) as usize] - 3.0).clamp(-32_768.0, 32_768.0);
        let ground = Ground::from_fn(12, 11, height).expect("heights in range");
        let mut checked = CheckedTerrain::new(ground, [8, 13, 128][i % 3]);
        play(&mut checked, &mut rng, 8, 7.0, &format!("ground at {base}"));
    }
}

#[test]
fn commits_on_a_huge_cliff_equal_worlds_made_from_scratch() {
    for seed in 0..2 {
        let mut rng = Rng::with_seed(seed);
        let height = |x: i32, z: i32| if x + z > 9 { 30_000.5 } else { -30_000.25 - f64::from(z) };
        let mut checked = CheckedTerrain::new(Ground::from_fn(12, 9, height).expect("heights in range"), 100);
        checked.is_meshed_again = false;
        for i in 0..3 {
            let y = [30_000.0, -30_000.0, 0.0, 130.0, 29_000.0][rng.usize(0..5)];
            let place = Vec3::new(6.0 + rng.f32() * 3.0, y, rng.f32() * 5.0);
            let brush = any_brush(&mut rng, place, 3.0);
            checked.apply(&[brush], &format!("cliff {seed}, transaction {i}"));
        }
        checked.check_meshes(&format!("cliff {seed}"));
    }
}

#[test]
fn large_brushes_over_small_ones_equal_worlds_made_from_scratch() {
    let mut rng = Rng::with_seed(7);
    let (ground, _) = any_ground(&mut rng, 2);
    let ground = Ground::from_fn(70, 60, |x, z| {
        f64::from(ground.height(Column::new(x % ground.width(), z % ground.depth()))) / 256.0
    });
    let mut checked = CheckedTerrain::new(ground.expect("finite heights"), 27);
    play(&mut checked, &mut rng, 4, 6.0, "small");
    for (i, brush) in [
        Brush::dig(Shape::sphere(Vec3::new(35.0, 0.0, 30.0), 28.0)),
        Brush::add(Shape::cuboid(Vec3::new(30.0, 10.0, 30.0), Vec3::new(500.0, 9.0, 500.0)), MaterialId(3)),
        Brush::paint(Shape::cuboid(Vec3::new(30.0, 0.0, 30.0), Vec3::splat(24.0)), MaterialId(2)),
        Brush::paint(Shape::cuboid(Vec3::new(30.0, 0.0, 30.0), Vec3::splat(23.0)), MaterialId::GROUND),
        Brush::dig(Shape::cylinder(Vec3::new(35.0, -25.0, 30.0), Vec3::Y * 60.0, 21.0))
            .with_roughness(Roughness::new(8.0, 5.0, 1)),
    ]
    .into_iter()
    .enumerate()
    {
        checked.apply(&[brush], &format!("large brush {i}"));
    }
    assert!(checked.kinds.len() > 1, "kinds of uniform bricks: {:?}", checked.kinds);
    play(&mut checked, &mut rng, 4, 6.0, "small again");
}
