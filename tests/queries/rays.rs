//! Ray queries against brute force.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{RayHit, World};
use fastrand::Rng;
use glam::{DVec3, IVec3, Vec3};

use crate::inputs::{dug_landscape, dug_worlds, point_near_surface, random_direction, small_terrain};
use crate::triangles::{NUDGE, TOLERANCE, Triangles, distance_to, meet};

/// Two directions perpendicular to a ray.
fn across(direction: DVec3) -> [DVec3; 2] {
    let (a, b) = direction.any_orthonormal_pair();
    [a, b]
}

/// Counts of the checks of many rays.
#[derive(Default, Debug)]
struct Figures {
    rays: usize,
    hits: usize,
    from_inside: usize,
    close_calls: usize,
    worst: f64,
}

/// Compares one ray with brute force.
fn check_ray(
    world: &World,
    triangles: &Triangles,
    origin: DVec3,
    direction: DVec3,
    max: f64,
    figures: &mut Figures,
    what: &str,
) {
    let what = || format!("{what}: ray from {origin:?} along {direction:?}, at most {max}");
    let answer = world.raycast(origin, direction, max);
    let unit = direction.normalize();
    let expected = triangles.raycast(origin, unit, max);
    figures.rays += 1;
    let agree = |t: Option<f64>| match (answer, t) {
        (Some(hit), Some(t)) => (hit.distance - t).abs() <= TOLERANCE,
        (None, None) => true,
        _ => false,
    };
    if !agree(expected.map(|hit| hit.0)) {
        // The ray may touch an edge: then rays next to it disagree with each other, too.
        figures.close_calls += 1;
        let [a, b] = across(unit);
        let beside = [a, -a, b, -b, a + b, a - b, b - a, -a - b];
        let mut answers: Vec<Option<f64>> = beside
            .iter()
            .map(|&d| triangles.raycast(origin + d * NUDGE, unit, max).map(|hit| hit.0))
            .collect();
        // It may start or end on the surface.
        for reach in [-NUDGE, NUDGE] {
            answers.push(triangles.raycast(origin + unit * reach, unit, max).map(|hit| hit.0 + reach));
            answers.push(triangles.raycast(origin, unit, max + reach).map(|hit| hit.0));
        }
        // It may run along a triangle, and may count as hitting it anywhere.
        let range =
            answers.iter().flatten().fold((f64::MAX, f64::MIN), |(low, high), &t| (low.min(t), high.max(t)));
        let between =
            answer.is_some_and(|hit| (range.0 - TOLERANCE..=range.1 + TOLERANCE).contains(&hit.distance));
        // It may graze edges, only some of which count as hits: before its first certain hit, or where rays next to
        // it disagree whether they hit anything.
        let is_early = |hit: RayHit| expected.is_none_or(|(t, _)| hit.distance < t);
        let is_unsure = answers.iter().any(Option::is_none) && answers.iter().any(Option::is_some);
        let touches = |hit: RayHit| {
            triangles.near(origin, unit).into_iter().any(|number| {
                let [a, b, c] = triangles.triangles[number as usize];
                let on_edge = [(a, b), (b, c), (c, a)].into_iter().any(|(p, q)| {
                    let along = ((hit.position - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
                    hit.position.distance(p.lerp(q, along)) <= NUDGE
                });
                // A ray in the plane of a triangle meets it anywhere.
                let normal = triangles.normal(number);
                let is_around = |p: DVec3| {
                    (p + NUDGE).cmpge(a.min(b).min(c)).all() && (p - NUDGE).cmple(a.max(b).max(c)).all()
                };
                let in_plane = normal.dot(unit).abs() <= 1e-9 && normal.dot(hit.position - a).abs() <= NUDGE;
                on_edge || (in_plane && is_around(hit.position))
            })
        };
        assert!(
            between
                || answers.iter().any(|&t| agree(t))
                || answer.is_some_and(|hit| (is_early(hit) || is_unsure) && touches(hit)),
            "{}: {answer:?}, but brute force {expected:?}, and next to the ray {answers:?}",
            what()
        );
        return;
    }
    let (Some(hit), Some((t, number))) = (answer, expected) else { return };
    figures.hits += 1;
    figures.from_inside += usize::from(hit.from_inside);
    figures.worst = figures.worst.max((hit.distance - t).abs());
    assert!(
        (hit.position - (origin + unit * hit.distance)).length() <= 1e-6 * (1.0 + origin.length()),
        "{}",
        what()
    );
    assert!((hit.normal.length() - 1.0).abs() < 1e-5, "{}: {hit:?}", what());
    assert_eq!(hit.from_inside, hit.normal.as_dvec3().dot(unit) > 0.0, "{}: {hit:?}", what());

    // The normal is that of a triangle at the hit; only on edges there are several.
    let near = triangles.near(origin, unit).into_iter();
    let same_place = near.filter(|&other| {
        meet(origin, unit, &triangles.triangles[other as usize], 1e-6)
            .is_some_and(|other| (other - hit.distance).abs() < 1e-4)
    });
    let normals: Vec<DVec3> = same_place.chain([number]).map(|number| triangles.normal(number)).collect();
    let alike = |normal: &DVec3| normal.dot(hit.normal.as_dvec3()) > 1.0 - 1e-6;
    assert!(normals.iter().any(alike), "{}: {hit:?}, but the triangles' normals are {normals:?}", what());
    check_material(world, &hit, &what());
}

/// The material of a hit is that of the nearest solid sample, or of the nearest one among the corners of its cube.
fn check_material(world: &World, hit: &RayHit, what: &str) {
    let samples = world.samples();
    // On a lattice plane, rounding decides on which side the hit lies.
    let (low, high) =
        ((hit.position - 1e-6).floor().as_ivec3(), (hit.position + 1e-6).floor().as_ivec3() + 1);
    let cube = LatticeBox::new(low, high).expect("low is below high");
    let materials_nearest = |around: LatticeBox| {
        let apart = |point: IVec3| point.as_dvec3().distance(hit.position);
        let solid: Vec<IVec3> = around.points().filter(|&point| samples.is_solid(point)).collect();
        let nearest = solid.iter().map(|&point| apart(point)).fold(f64::INFINITY, f64::min);
        let nearest = solid.into_iter().filter(move |&point| apart(point) < nearest + 1e-5);
        nearest.map(|point| samples.material(point)).collect::<Vec<_>>()
    };
    let candidates = [materials_nearest(cube), materials_nearest(cube.grown(1))].concat();
    assert!(candidates.contains(&hit.material), "{what}: {hit:?}, but the samples there are {candidates:?}");
}

/// A random ray: from the sky, the side, the ground or caves; anywhere or exactly on lattice lines, edges and vertices.
fn random_ray(rng: &mut Rng, world: &World, triangles: &Triangles) -> (DVec3, DVec3) {
    let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
    let free = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5);
    let target = point_near_surface(rng, world).as_dvec3();
    match rng.u32(0..9) {
        // From the sky.
        0 => {
            let above = DVec3::new(rng.f64() * width, target.y + 5.0 + rng.f64() * 60.0, rng.f64() * depth);
            (above, if rng.bool() { DVec3::NEG_Y } else { target + free - above })
        }
        // From outside the world.
        1 => {
            let angle = rng.f64() * 6.3;
            let away = DVec3::new(angle.cos(), rng.f64() - 0.3, angle.sin()) * (width + depth);
            let from = DVec3::new(width / 2.0, target.y, depth / 2.0) + away;
            (from, target + free - from)
        }
        // From very far away.
        2 => {
            let from = target + random_direction(rng) * [1e3, 1e4, 1e5][rng.usize(0..3)];
            (from, target + free - from)
        }
        // Near the surface: in the ground, in caves, just above the ground.
        3 => (target + free * 4.0, random_direction(rng)),
        // From lattice points, along lattice lines.
        4 => (target, random_direction(rng)),
        5 => (target - DVec3::new(0.0, free.y, free.z) * 3.0, random_direction(rng)),
        // From edited samples: caves and buildings.
        6 => {
            let fields: Vec<LatticeBox> = world
                .fields()
                .flat_map(|(_, fields)| fields.iter().map(|f| f.bounds).collect::<Vec<_>>())
                .collect();
            let Some(bounds) = (!fields.is_empty()).then(|| fields[rng.usize(0..fields.len())]) else {
                return (target + free, random_direction(rng));
            };
            let at = bounds.min.as_dvec3() + (bounds.size().as_dvec3()) * (free + 0.5);
            (if rng.bool() { at } else { at.round() }, random_direction(rng))
        }
        // Exactly at a vertex, the middle of an edge, or a point on an edge of the surface.
        7 => {
            let [a, b, _] = triangles.triangles[rng.usize(0..triangles.triangles.len())];
            let place = [a, (a + b) / 2.0, a.lerp(b, rng.f64())][rng.usize(0..3)];
            let direction = random_direction(rng);
            (place - direction * f64::from(rng.u32(1..40)), direction)
        }
        // At small triangles, and at large ones close to an edge.
        _ => {
            let [a, b, c] = triangles.triangles[rng.usize(0..triangles.triangles.len())];
            let (u, v) = (rng.f64() * 0.5, rng.f64() * [1e-9, 1e-3, 0.5][rng.usize(0..3)]);
            let place = a + (b - a) * u + (c - a) * v;
            let from = place + random_direction(rng) * 30.0;
            (from, place - from)
        }
    }
}

#[test]
fn rays_hit_what_is_drawn() {
    let mut figures = Figures::default();
    for (name, terrain) in dug_worlds().chain([("the landscape".to_string(), dug_landscape())]) {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(77));
        let triangles = Triangles::of(world);
        let rays = if name == "the landscape" { 4000 } else { 500 };
        for _ in 0..rays {
            let (origin, direction) = random_ray(&mut rng, world, &triangles);
            if direction.length() < 1e-9 {
                continue;
            }
            let max = [f64::INFINITY, 1e6, 20.0, 3.0][rng.usize(0..4)];
            check_ray(world, &triangles, origin, direction, max, &mut figures, &name);
        }
    }
    println!("{figures:?}");
    assert!(figures.rays > 10_000 && figures.hits > 5_000 && figures.from_inside > 500, "{figures:?}");
    assert!(figures.close_calls * 20 < figures.rays, "{figures:?}");
}

#[test]
fn the_length_of_a_direction_does_not_matter() {
    let terrain = small_terrain();
    let world = terrain.world();
    let mut rng = Rng::with_seed(9);
    for _ in 0..300 {
        let origin = DVec3::new(rng.f64() * 40.0, 12.0 + rng.f64() * 20.0, rng.f64() * 30.0);
        let direction = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.8, rng.f64() - 0.5).normalize();
        let expected = world.raycast(origin, direction, 1e3).map(|hit| hit.distance);
        for length in [1e-300, 1e-160, 1e-30, 1e30, 1e160, 1e300] {
            let found = world.raycast(origin, direction * length, 1e3).map(|hit| hit.distance);
            let agree = match (expected, found) {
                (Some(a), Some(b)) => (a - b).abs() <= TOLERANCE,
                (a, b) => a == b,
            };
            assert!(
                agree,
                "from {origin:?} along {direction:?} {expected:?}, but {found:?} at length {length:e}"
            );
        }
    }
}

#[test]
fn rays_do_not_slip_through_edges() {
    let mut rays = 0;
    for (name, terrain) in dug_worlds().chain([("small".to_string(), small_terrain())]) {
        let (world, mut rng) = (terrain.world(), Rng::with_seed(12));
        let triangles = Triangles::of(world);
        let (width, depth) = (f64::from(world.grid().width()), f64::from(world.grid().depth()));
        let heights = || triangles.triangles.iter().flatten().map(|place| place.y);
        let (low, high) =
            (heights().fold(f64::MAX, f64::min) - 1.0, heights().fold(f64::MIN, f64::max) + 1.0);
        for _ in 0..1500 {
            let first = if rng.bool() { triangles.tiles.min(triangles.triangles.len() - 1) } else { 0 };
            let [a, b, _] = triangles.triangles[rng.usize(first..triangles.triangles.len())];
            let target = [a, (a + b) / 2.0, a.lerp(b, rng.f64()), a.lerp(b, 0.25)][rng.usize(0..4)];
            let slant = [0.0, 1e-9, 1e-3, 0.125, 1.0][rng.usize(0..5)];
            let direction = match rng.bool() {
                true => DVec3::new((rng.f64() - 0.5) * slant, -1.0, (rng.f64() - 0.5) * slant),
                false => {
                    DVec3::new(f64::from(rng.i32(-2..=2)) * slant, -1.0, f64::from(rng.i32(-2..=2)) * slant)
                }
            };
            // Everything below `low` is ground, so a ray that comes down from the sky to there must hit something if
            // it stays over the world from the highest ground on.
            let at = |y: f64| target + direction * (target.y - y);
            let is_over =
                |p: DVec3| (0.01..width - 0.01).contains(&p.x) && (0.01..depth - 0.01).contains(&p.z);
            if !is_over(at(low)) || !is_over(at(high)) {
                continue;
            }
            let origin = target - direction * (high - target.y + [1.0, 1e3, 1e5, 1e7, 1e9][rng.usize(0..5)]);
            let hit = world.raycast(origin, target - origin, f64::INFINITY);
            assert!(
                hit.is_some_and(|hit| hit.position.y > low),
                "{name}: from {origin:?} to {target:?}: {hit:?}"
            );
            rays += 1;
        }
    }
    assert!(rays > 10_000, "{rays}");
}

#[test]
fn rays_in_the_plane_of_a_triangle_end_on_the_surface() {
    // Steps of level and sloping ground: rays in the plane of one triangle continue over others.
    let height = |x: i32, z: i32| if (x / 3 + z / 3) % 2 == 0 { 0.0 } else { f64::from((x * 7 + z * 5) % 4) };
    let ground = Ground::from_fn(40, 40, height).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    let mut rng = Rng::with_seed(3);
    for _ in 0..20 {
        let place = Vec3::new(rng.f32() * 40.0, 1.0, rng.f32() * 40.0);
        terrain.apply([Brush::dig(Shape::sphere(place, 2.0))]);
    }
    let world = terrain.world();
    let triangles = Triangles::of(world);
    let mut hits = 0;
    for _ in 0..20_000 {
        let [a, b, c] = triangles.triangles[rng.usize(0..triangles.triangles.len())];
        let (p, q) = (a.lerp(b, rng.f64()), b.lerp(c, rng.f64()));
        let Some(direction) = (q - p).try_normalize() else { continue };
        let origin = p - direction * rng.f64() * 50.0;
        let Some(hit) = world.raycast(origin, direction, 1e3) else { continue };
        hits += 1;
        let near = triangles.near(hit.position, DVec3::Y).into_iter();
        let apart = near.map(|number| distance_to(hit.position, triangles.triangles[number as usize]));
        let apart = apart.fold(f64::INFINITY, f64::min);
        assert!(apart <= TOLERANCE, "ray from {origin:?} along {direction:?}: {hit:?} is {apart} voxels off");
    }
    // The steps are close together: nine in ten such rays hit the ground next to their triangle.
    assert!(hits > 10_000, "{hits}");
}
