//! Worlds and edits at the limits of size, lattice coordinates and height.

use bevy_burrow::lattice::{Column, LIMIT, LatticeBox};
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{DVec3, IVec3, Vec3};

use crate::terrains::{assert_flawless, terrain};
use crate::worlds::{any_random_brush, contents};

/// Digs, fills and paints at several places on the surface, the rim and the corners, and checks the world after each
/// edit.
fn edit_and_check(mut terrain: Terrain, rng: &mut Rng, what: &str) -> Terrain {
    let grid = terrain.world().grid();
    let (width, depth) = (grid.width(), grid.depth());
    for step in 0..6 {
        let (x, z) = match step % 3 {
            0 => ([0, width][rng.usize(0..2)], [0, depth][rng.usize(0..2)]),
            1 => (rng.i32(0..=width), [0, depth][rng.usize(0..2)]),
            _ => (rng.i32(0..=width), rng.i32(0..=depth)),
        };
        let height = terrain.world().ground().height(Column::new(x, z)) as f32 / 256.0;
        let y = (height + rng.f32() * 6.0 - 3.0).clamp(-(LIMIT as f32), LIMIT as f32);
        let shape = Shape::sphere(Vec3::new(x as f32, y, z as f32), [1.0, 2.5, 4.0][rng.usize(0..3)]);
        let brush = match rng.u32(0..4) {
            0 => Brush::add(shape, MaterialId(3)),
            1 => Brush::paint(shape, MaterialId(4)),
            _ => Brush::dig(shape),
        };
        let receipt = terrain.apply([&brush]).remove(0);
        assert!(receipt.outcome.is_ok(), "{what}: {brush:?}: {receipt:?}");
        assert_flawless(&terrain, format!("{what}, step {step}: {brush:?}"));
        // Queries work there too.
        let world = terrain.world();
        let spans = world.spans(x.into(), z.into());
        assert!(!spans.is_empty(), "{what}, step {step}: nothing at ({x}, {z})");
        let top = spans[spans.len() - 1].floor;
        let above = DVec3::new(x.into(), top + 10.0, z.into());
        let hit = world.raycast(above, DVec3::NEG_Y, 1e6);
        // At the edge of a cliff, rounding may take the ray or the column past the ground.
        assert!(hit.is_some(), "{what}, step {step}: a ray from {above} down hits nothing");
    }
    terrain
}

#[test]
fn the_smallest_and_narrowest_worlds_are_dug_without_a_hole() {
    for (width, depth) in
        [(1, 1), (1, 2), (2, 1), (1, 9), (7, 1), (1, 40), (40, 1), (8, 8), (9, 8), (8, 9), (3, 17)]
    {
        for chunk_size in [8, 9, 25, 128] {
            let mut rng = Rng::with_seed(u64::from(width * 100 + depth + chunk_size));
            for relief in [0.0, 1.5, 40.0] {
                let seed = rng.i32(0..1000);
                let height = |x: i32, z: i32| {
                    f64::from((x * 7919 + z * 104_729 + seed * 31).rem_euclid(64)) / 64.0 * relief
                };
                let ground = Ground::from_fn(width, depth, height).expect("finite heights");
                let what = format!("{width} x {depth} cells, relief {relief}, chunks of {chunk_size}");
                edit_and_check(terrain(ground, chunk_size), &mut rng, &what);
            }
        }
    }
}

#[test]
fn worlds_at_the_ends_of_the_lattice_are_dug_without_a_hole() {
    let limit = f64::from(LIMIT);
    for height in [
        limit,
        limit - 1.0 / 256.0,
        limit - 1.0,
        32_767.5,
        -limit,
        1.0 / 256.0 - limit,
        1.0 - limit,
        -32_766.5,
    ] {
        for chunk_size in [8, 25, 128] {
            let mut rng = Rng::with_seed(chunk_size.into());
            let ground = Ground::flat(12, 11, height).expect("heights within the limit");
            let mut terrain =
                edit_and_check(terrain(ground, chunk_size), &mut rng, &format!("level at {height}"));
            // From one end of the lattice to the next chunk, and as far out as a brush may lie.
            let end = Vec3::new(6.0, (limit * height.signum()) as f32, 6.0);
            terrain.apply([Brush::add(Shape::sphere(end, 3.0), MaterialId(2))]);
            assert_flawless(&terrain, format!("added at the end, level at {height}"));
            terrain.apply([Brush::dig(Shape::capsule(end, end * 0.9995, 1.5))]);
            assert_flawless(&terrain, format!("shaft at the end, level at {height}"));
        }
    }
}

#[test]
fn edits_at_the_ends_of_the_lattice_far_from_the_ground_are_closed() {
    let limit = LIMIT as f32;
    let ground = Ground::flat(12, 11, 3.0).expect("finite heights");
    let mut terrain = terrain(ground, 25);
    for y in [limit, -limit, limit - 0.5, 2.0 - limit] {
        for shape in [
            Shape::sphere(Vec3::new(6.0, y, 6.0), 3.0),
            Shape::cuboid(Vec3::new(0.0, y, 11.0), Vec3::splat(2.25)),
        ] {
            for brush in
                [Brush::add(shape, MaterialId(1)), Brush::dig(shape), Brush::paint(shape, MaterialId(2))]
            {
                assert!(terrain.apply([&brush])[0].outcome.is_ok());
                assert_flawless(&terrain, &brush);
            }
        }
    }
    for y in [limit, -limit] {
        // Ground added at the very top is closed by the pristine air above it, holes at the bottom by the rock below.
        terrain.apply([Brush::add(Shape::sphere(Vec3::new(6.0, y, 6.0), 3.0), MaterialId(1))]);
        assert_flawless(&terrain, "a ball at the end");
    }
}

#[test]
fn cliffs_of_thousands_of_voxels_are_dug_without_a_hole() {
    let cliffs: [(&str, fn(i32, i32) -> f64); 5] = [
        ("one step", |x, _| if x < 5 { -2000.25 } else { 3000.5 }),
        ("a needle", |x, z| if (x, z) == (4, 4) { 4000.0 } else { 0.0 }),
        ("a shaft", |x, z| if (x, z) == (4, 4) { -4000.0 } else { 0.0 }),
        ("a chessboard", |x, z| if (x + z) % 2 == 0 { 1500.125 } else { -1500.0 }),
        ("a stair", |x, z| f64::from(x * 700 - z * 450) + 0.5),
    ];
    for (name, height) in cliffs {
        for chunk_size in [8, 32] {
            let mut rng = Rng::with_seed(3);
            let ground = Ground::from_fn(9, 8, height).expect("heights within the limit");
            let mut terrain = terrain(ground, chunk_size);
            let top = terrain.world().height(4.0, 4.0).expect("a column of the world") as f32;
            for (x, y, z, radius) in [
                (4.0, top, 4.0, 2.0),
                (4.5, top * 0.5, 4.5, 2.5),
                (5.0, 7.0, 3.0, 3.0),
                (0.0, 0.25, 8.0, 1.5),
            ] {
                let shape = Shape::sphere(Vec3::new(x, y, z), radius);
                let brush = if rng.bool() { Brush::dig(shape) } else { Brush::add(shape, MaterialId(1)) };
                assert!(terrain.apply([&brush])[0].outcome.is_ok());
                assert_flawless(&terrain, format!("{name}, chunks of {chunk_size}: {brush:?}"));
            }
        }
    }
}

#[test]
fn a_cliff_over_the_whole_lattice_is_dug_without_a_hole() {
    let ground = Ground::from_fn(3, 2, |x, _| if x < 2 { -32_000.0 } else { 32_000.0 })
        .expect("heights within the limit");
    let mut terrain = terrain(ground, 128);
    for y in [-31_999.0, 0.0, 31_999.5] {
        terrain.apply([Brush::dig(Shape::sphere(Vec3::new(1.5, y, 1.0), 2.0))]);
    }
    assert_flawless(&terrain, "a cliff of 64000 voxels");
}

#[test]
fn any_edits_of_the_smallest_and_narrowest_worlds_are_closed_and_undone() {
    let mut changed = 0;
    for (width, depth) in [(1, 1), (1, 2), (1, 9), (9, 1), (3, 17), (40, 1), (8, 8)] {
        for chunk_size in [8, 25] {
            let mut rng = Rng::with_seed(u64::from(width * 100 + depth + chunk_size));
            let height = |x: i32, z: i32| f64::from((x * 7919 + z * 104_729).rem_euclid(64)) / 24.0;
            let ground = Ground::from_fn(width, depth, height).expect("finite heights");
            let mut terrain = terrain(ground, chunk_size);
            terrain.set_loose(rng.bool().then(|| LooseSettings {
                crumbs: 9,
                debris: 200,
                ..Default::default()
            }));
            let pristine = terrain.world().hash();
            for step in 0..12 {
                let brush = any_random_brush(&mut rng, terrain.world().ground());
                let outcome = terrain.apply([&brush]).remove(0).outcome;
                changed += usize::from(outcome.is_ok_and(|applied| applied.bounds.is_some()));
                let what = format!("{width} x {depth} cells, chunks of {chunk_size}, step {step}: {brush:?}");
                assert_flawless(&terrain, what);
            }
            while terrain.undo().outcome.is_ok() {}
            assert_eq!(terrain.world().hash(), pristine);
        }
    }
    assert!(changed > 50, "{changed}");
}

#[test]
fn paths_roads_grids_fills_pastes_and_resets_at_the_ends_of_the_lattice_are_closed() {
    let limit = LIMIT as f32;
    let (grids, prefabs) = contents();
    for height in [3.0, f64::from(LIMIT), -f64::from(LIMIT)] {
        let mut terrain = terrain(Ground::flat(14, 13, height).expect("finite heights"), 25);
        let pristine = terrain.world().hash();
        for y in [limit, -limit, limit - 0.5, 2.0 - limit] {
            let (at, other) = (Vec3::new(5.0, y, 6.0), Vec3::new(11.0, y - 3.0 * y.signum(), 9.0));
            let path = BrushPath::spline([(at, 2.0), (other, 2.5), (at + Vec3::Z, 1.0)]);
            let corridor = Corridor::new(path.clone(), 5.0, 4.0);
            let (ball, grid) = (Shape::sphere(at, 3.0), GridShape::new(grids[4].clone(), at));
            for brush in [
                Brush::add(path.clone(), MaterialId(1)),
                Brush::dig(path),
                Brush::road(corridor.clone(), 2.0),
                Brush::fill(grid.clone(), 5.0),
                Brush::fill(ball, 16.0),
                Brush::carve(grid, 16.0),
                Brush::raise(corridor.clone(), 2.0),
                Brush::paste(Paste::new(prefabs[1].clone(), at)),
                Brush::paste(Paste::new(prefabs[0].clone(), other).turned_about_x(1)),
                Brush::reset(corridor),
            ] {
                let outcome = terrain.apply([&brush]).remove(0).outcome;
                // The middle of a prefab may lie beyond the end.
                let is_beyond = matches!(outcome, Err(Rejection::Brush(BrushError::OutOfRange { .. })));
                let is_paste = matches!(brush.operation, Operation::Paste { .. });
                assert!(
                    outcome.is_ok() || is_paste && is_beyond,
                    "ground at {height}: {brush:?}: {outcome:?}"
                );
                assert_flawless(&terrain, format!("ground at {height}: {brush:?}"));
            }
            let around =
                LatticeBox { min: IVec3::new(0, y as i32 - 6, 0), max: IVec3::new(9, y as i32 + 6, 9) };
            // A copy ends with the lattice.
            assert!(terrain.world().copy(around, around.min).is_err());
            assert!(terrain.world().shape_grid(around).is_ok());
        }
        while terrain.undo().outcome.is_ok() {}
        assert_eq!(terrain.world().hash(), pristine);
    }
}
