//! Queries of columns and points against brute force.

use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::DVec3;

use crate::inputs::{dug_landscape, dug_worlds, point_near_surface, random_column};
use crate::triangles::{NUDGE, TOLERANCE, Triangles};

/// The crossings that spans consist of, lowest first: height, and whether it is a floor.
fn as_crossings(spans: &[Span]) -> Vec<(f64, bool)> {
    spans
        .iter()
        .flat_map(|span| [Some((span.floor, true)), span.ceiling.map(|y| (y, false))])
        .flatten()
        .collect()
}

/// Small offsets from a vertical line, in directions close to lattice lines and away from them, and the same at a
/// thousandth of the size.
fn steps() -> impl Iterator<Item = (f64, f64)> {
    let signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    let shapes = [(1.0, 0.99999), (0.99999, 1.0), (1.0, 0.3), (0.3, 1.0), (1.0, 1e-5), (1e-5, 1.0)];
    let around = move |by: f64| {
        signs.into_iter().flat_map(move |(sx, sz)| shapes.map(|(dx, dz)| (by * sx * dx, by * sz * dz)))
    };
    around(NUDGE).chain(around(NUDGE * 1e-3))
}

/// A coordinate clamped slightly inside the world.
fn inside(at: f64, end: f64) -> f64 {
    at.clamp(NUDGE * 1e-6, end - NUDGE / 10.0)
}

#[test]
fn columns_cross_what_is_drawn() {
    let (mut columns, mut close_calls, mut caves, mut worst) = (0, 0, 0, 0.0f64);
    for (name, terrain) in dug_worlds().chain([("the landscape".to_string(), dug_landscape())]) {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(78));
        let triangles = Triangles::of(world);
        let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
        let count = if name == "the landscape" { 4000 } else { 500 };
        for _ in 0..count {
            let (x, z) = random_column(&mut rng, world, &triangles);
            let what = format!("{name}: column ({x:?}, {z:?})");
            let spans = world.spans(x, z);
            columns += 1;
            caves += usize::from(spans.len() > 1);

            // Air and ground alternate, and the top span is open.
            for (i, span) in spans.iter().enumerate() {
                // At an edge a span may have no height, up to rounding.
                assert!(span.ceiling.is_none_or(|top| top >= span.floor - 1e-9), "{what}: {spans:?}");
                assert_eq!(span.ceiling.is_none(), i + 1 == spans.len(), "{what}: {spans:?}");
                assert!(
                    i == 0 || spans[i - 1].ceiling.is_some_and(|top| top <= span.floor + 1e-9),
                    "{what}: {spans:?}"
                );
            }
            assert_eq!(world.height(x, z), spans.last().map(|span| span.floor), "{what}");

            let answer = as_crossings(&spans);
            let difference = |expected: &[(f64, bool)]| {
                let pairs = || answer.iter().zip(expected);
                (answer.len() == expected.len() && pairs().all(|(a, b)| a.1 == b.1))
                    .then(|| pairs().map(|(a, b)| (a.0 - b.0).abs()).fold(0.0, f64::max))
            };
            let agrees =
                |expected: &[(f64, bool)]| difference(expected).is_some_and(|apart| apart <= TOLERANCE);
            let expected = triangles.column(x, z);
            if agrees(&expected) {
                worst = worst.max(difference(&expected).unwrap_or(0.0));
                continue;
            }
            close_calls += 1;
            let neighbours: Vec<Vec<(f64, bool)>> = steps()
                .map(|(dx, dz)| triangles.column(inside(x + dx, width), inside(z + dz, depth)))
                .collect();
            assert!(
                neighbours.iter().any(|expected| agrees(expected)),
                "{what}: {answer:?}, but brute force {expected:?}, and next to the column {neighbours:?}"
            );
        }
    }
    println!("{columns} columns, {caves} through caves, {close_calls} along edges; worst {worst:e} voxels");
    assert!(columns >= 10_000 && caves > 1000);
}

#[test]
fn is_solid_agrees_with_the_samples() {
    let (mut points, mut solid) = (0, 0);
    for (name, terrain) in dug_worlds() {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(79));
        let samples = world.samples();
        for _ in 0..1500 {
            let point = point_near_surface(&mut rng, world);
            // On the far rim, the query answers for a point 2^-20 voxel inside, which may be higher or lower.
            let on_rim = point.x == world.grid().width() || point.z == world.grid().depth();
            if on_rim && samples.distance(point).abs() < 16 {
                continue;
            }
            let is_solid = world.is_solid(point.as_dvec3());
            assert_eq!(
                is_solid,
                samples.is_solid(point),
                "{name}: {point}, sample {:?}",
                samples.sample(point)
            );
            points += 1;
            solid += usize::from(is_solid);
        }
    }
    println!("{points} lattice points, {solid} of them solid");
    assert!(points > 30_000 && solid * 4 > points && solid * 4 < points * 3);
}

#[test]
fn places_between_the_samples_are_solid_below_the_surface() {
    let (mut solid, mut buried) = (0, 0);
    for (name, terrain) in dug_worlds() {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(80));
        let triangles = Triangles::of(world);
        for _ in 0..500 {
            let place =
                point_near_surface(&mut rng, world).as_dvec3() + DVec3::new(rng.f64(), rng.f64(), rng.f64());
            let crossings = triangles.column(place.x, place.z);
            if crossings.iter().any(|crossing| (crossing.0 - place.y).abs() < TOLERANCE)
                || crossings.is_empty()
            {
                continue;
            }
            let above = crossings.iter().filter(|crossing| crossing.0 > place.y).count();
            let is_solid = world.is_solid(place);
            assert_eq!(is_solid, above % 2 == 1, "{name}: {place:?} between {crossings:?}");
            // A place is buried only if all corners around it are solid.
            assert!(is_solid || !world.is_buried(place), "{name}: {place:?} is buried in air");
            solid += usize::from(is_solid);
            buried += usize::from(world.is_buried(place));
        }
    }
    println!("{buried} of {solid} solid places are in cells of nothing but ground");
    assert!(buried > solid / 4 && buried < solid);
}

#[test]
fn the_normal_of_a_place_is_that_of_the_triangle_over_or_below_it() {
    let mut asked = 0;
    for (name, terrain) in dug_worlds() {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(81));
        let triangles = Triangles::of(world);
        let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
        for _ in 0..400 {
            let (x, z) = random_column(&mut rng, world, &triangles);
            let crossings = triangles.crossings(x, z);
            let Some(&(y, ..)) = crossings.get(rng.usize(0..crossings.len().max(1))) else { continue };
            let place = DVec3::new(x, y + (rng.f64() - 0.5) * 0.01, z);
            let mut candidates = Vec::new();
            for (dx, dz) in steps() {
                // Small offsets around the point, which the query rounds to 2^-20 voxel.
                let fine =
                    |at: f64, step: f64| (at * f64::from(1 << 20)).round() / f64::from(1 << 20) + step / 1e4;
                for (x, z) in [(x + dx, z + dz), (fine(x, dx), fine(z, dz))] {
                    let crossings = triangles.crossings(inside(x, width), inside(z, depth));
                    let apart = |crossing: &(f64, bool, u32)| (crossing.0 - place.y).abs();
                    let nearest = crossings.iter().map(apart).fold(f64::INFINITY, f64::min);
                    // A step of a millionth is a long way down a steep triangle.
                    let nearest = crossings.iter().filter(|crossing| apart(crossing) < nearest + 0.02);
                    candidates.extend(nearest.map(|crossing| triangles.normal(crossing.2)));
                }
            }
            let normal = world.normal(place).map(|normal| normal.as_dvec3());
            let alike = |candidate: &DVec3| normal.is_some_and(|normal| normal.dot(*candidate) > 1.0 - 1e-6);
            assert!(
                candidates.iter().any(alike),
                "{name}: at {place:?} {normal:?}, but the triangles there have {candidates:?}"
            );
            asked += 1;
        }
    }
    assert!(asked > 5000, "{asked}");
}
