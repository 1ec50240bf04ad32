//! Paths of many points and roads along them, compared with brute force.

use bevy_burrow::ground::FunctionSource;
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use fastrand::Rng;
use glam::{DVec2, DVec3, IVec3, Vec3};

use crate::measured::{assert_closed, bumpy, heights, terrain};

/// 1,000 of them with `BURROW_SPLINES`.
fn path_count() -> u64 {
    std::env::var("BURROW_SPLINES").ok().and_then(|count| count.parse().ok()).unwrap_or(6)
}

/// A random path below and above the surface.
fn random_path(rng: &mut Rng, steep: f32) -> BrushPath {
    let mut at = Vec3::new(10.0 + rng.f32() * 44.0, 20.0, 10.0 + rng.f32() * 44.0);
    let points: Vec<(Vec3, f32)> = (0..rng.usize(2..9))
        .map(|_| {
            let by = (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - 0.5) * Vec3::new(30.0, steep, 30.0);
            at = (at + by).clamp(Vec3::new(4.0, 10.0, 4.0), Vec3::new(60.0, 30.0, 60.0));
            (at, 1.0 + rng.f32() * 3.0)
        })
        .collect();
    if rng.bool() { BrushPath::spline(points) } else { BrushPath::polyline(points) }
}

/// Balls along a path, close to each other.
fn balls(path: &BrushPath) -> Vec<(DVec3, f64)> {
    let points: Vec<(DVec3, f64)> =
        path.points.iter().map(|&(at, radius)| (at.as_dvec3(), f64::from(radius))).collect();
    let mut balls = Vec::new();
    for index in 1..points.len() {
        let place = |index: usize| points[index.min(points.len() - 1)].0;
        let [a, b, c, d] = [place(index.saturating_sub(2)), place(index - 1), place(index), place(index + 1)];
        balls.extend((0..=400).map(|step| {
            let t = f64::from(step) / 400.0;
            let (t2, t3) = (t * t, t * t * t);
            let curve = b * (2.0 * t3 - 3.0 * t2 + 1.0)
                + (c - a) / 2.0 * (t3 - 2.0 * t2 + t)
                + c * (3.0 * t2 - 2.0 * t3)
                + (d - b) / 2.0 * (t3 - t2);
            let radius = points[index - 1].1 + (points[index].1 - points[index - 1].1) * t;
            (if path.is_smooth { curve } else { b.lerp(c, t) }, radius)
        }));
    }
    balls
}

const WORLD: LatticeBox = LatticeBox { min: IVec3::new(0, -4, 0), max: IVec3::new(64, 44, 64) };

#[test]
fn tunnels_and_walls_along_paths_are_where_balls_along_them_are() {
    for seed in 0..path_count() {
        let mut rng = Rng::with_seed(seed);
        let (path, mut ground) = (random_path(&mut rng, 16.0), terrain(bumpy(3.0)));
        let is_dug = seed % 2 == 0;
        let before: Vec<bool> = WORLD.points().map(|p| ground.world().samples().is_solid(p)).collect();
        let hash = ground.world().hash();
        let brush = if is_dug { Brush::dig(path.clone()) } else { Brush::add(path.clone(), MaterialId(3)) };
        assert!(ground.apply([brush])[0].outcome.is_ok());
        assert_closed(&ground);
        let balls = balls(&path);
        for (point, was_solid) in WORLD.points().zip(before) {
            let p = point.as_dvec3();
            let inside = balls.iter().map(|(at, radius)| radius - p.distance(*at)).fold(f64::MIN, f64::max);
            // Balls stand apart, and curves are made of lines.
            if inside.abs() < 0.25 {
                continue;
            }
            let expected = if inside > 0.0 { !is_dug } else { was_solid };
            assert_eq!(
                ground.world().samples().is_solid(point),
                expected,
                "seed {seed} at {point}: {inside}"
            );
        }
        // One step of undo, which leaves nothing.
        ground.undo();
        assert_eq!((ground.world().hash(), ground.world().bricks().count()), (hash, 0), "seed {seed}");
        ground.redo();
        ground.apply([Brush::reset(path)]);
        assert_eq!((ground.world().hash(), ground.world().bricks().count()), (hash, 0), "seed {seed}");
    }
}

/// The densities of a road along straight lines by the definition of [`Operation::Road`], in voxels: `None` where it
/// depends on rounding.
fn road_density(
    pieces: &[[(DVec3, f64); 2]],
    corridor: &Corridor,
    shoulder: f64,
    p: DVec3,
    own: f64,
) -> Option<f64> {
    let (above, below) = (f64::from(corridor.above), f64::from(corridor.below));
    let flat = |v: DVec3| DVec2::new(v.x, v.z);
    let mut places: Vec<(f64, f64)> = Vec::new();
    for &[(a, from), (b, to)] in pieces {
        // The nearest ball of the strip, as seen from above.
        let ball = |t: f64| flat(p).distance(flat(a).lerp(flat(b), t)) - (from + (to - from) * t);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..80 {
            let [one, two] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
            if ball(one) < ball(two) { high = two } else { low = one }
        }
        let way = flat(b) - flat(a);
        let foot = if way == DVec2::ZERO { 0.0 } else { (flat(p) - flat(a)).dot(way) / way.length_squared() };
        let up = p.y - a.lerp(b, foot.clamp(0.0, 1.0)).y;
        if (up - above).abs() < 0.02 || (up + below).abs() < 0.02 {
            return None;
        }
        if up < above && up > -below {
            places.push((ball(low.midpoint(high)), up));
        }
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let Some(&(beside, up)) = places.first() else { return Some(own) };
    if beside >= 0.0 {
        return Some(own);
    }
    let is_unclear = |other: &(f64, f64)| other.0 - beside < 0.05 && (other.1 - up).abs() > 0.01;
    if places.iter().any(is_unclear) {
        return None;
    }
    // In the middle between road and ceiling, or road and floor, the target jumps to what was there.
    if (2.0 * up - above).abs() < 0.04 || (2.0 * up + below).abs() < 0.04 {
        return None;
    }
    let t = (-beside / shoulder).min(1.0);
    let weight = t * t * (3.0 - 2.0 * t);
    let target = if up > above - up {
        own.max(above - up)
    } else if -up > up + below {
        own.min(-(up + below))
    } else {
        up
    };
    Some(own + (target - own) * weight)
}

#[test]
fn roads_have_the_densities_of_their_definition() {
    let mut changed = 0;
    for seed in 0..path_count() {
        let mut rng = Rng::with_seed(900 + seed);
        let mut path = random_path(&mut rng, 10.0);
        path.is_smooth = false;
        let corridor = Corridor::new(path, 4.0 + rng.f32() * 12.0, 2.0 + rng.f32() * 8.0);
        let shoulder = 0.5 + rng.f32() * 4.0;
        let mut ground = terrain(bumpy(6.0));
        let before: Vec<i32> = WORLD.points().map(|p| ground.world().samples().distance(p)).collect();
        let hash = ground.world().hash();
        let receipt = ground.apply([Brush::road(corridor.clone(), shoulder)]).remove(0);
        assert!(receipt.outcome.is_ok(), "{receipt:?}");
        assert_closed(&ground);
        let points: Vec<(DVec3, f64)> = corridor
            .path
            .points
            .iter()
            .map(|&(at, half)| (at.as_dvec3(), f64::from(half + shoulder)))
            .collect();
        let pieces: Vec<[(DVec3, f64); 2]> = points.windows(2).map(|pair| [pair[0], pair[1]]).collect();
        let mut unclear = 0;
        for (point, own) in WORLD.points().zip(before) {
            let own = f64::from(own) / 256.0;
            let Some(expected) = road_density(&pieces, &corridor, f64::from(shoulder), point.as_dvec3(), own)
            else {
                unclear += 1;
                continue;
            };
            let found = f64::from(ground.world().samples().distance(point)) / 256.0;
            // A weight is rounded to 1/256, and a distance to the side counts by the steepness of the shoulder.
            let most = 0.03 + (expected - own).abs() * 0.03 / f64::from(shoulder) + (own.abs() + 16.0) * 0.03;
            assert!(
                (found - expected).abs() < most,
                "seed {seed} at {point}: {found}, not {expected}; it was {own} before {corridor:?}, {shoulder}"
            );
            changed += usize::from(expected != own);
        }
        assert!(unclear < 30_000, "{unclear}");
        ground.undo();
        assert_eq!((ground.world().hash(), ground.world().bricks().count()), (hash, 0), "seed {seed}");
    }
    assert!(changed > 1500, "{changed}");
}

#[test]
fn a_road_of_two_kilometres_is_one_edit() {
    let hills = |x: i32, z: i32| 24.0 + 5.0 * (f64::from(x) * 0.02).sin() + 3.0 * (f64::from(z) * 0.1).cos();
    let mut ground = terrain(Ground::from_fn(2100, 128, hills).expect("finite"));
    let hash = ground.world().hash();
    let points = (0..=100).map(|i| {
        let x = 40.0 + 20.2 * i as f32;
        (Vec3::new(x, 24.0 + 3.0 * (x * 0.01).sin(), 64.0 + 30.0 * (x * 0.006).sin()), 3.0)
    });
    let road = Corridor::new(BrushPath::spline(points), 12.0, 10.0);
    let began = std::time::Instant::now();
    let receipt = ground.apply([Brush::road(road.clone(), 4.0)]).remove(0);
    println!("a road of 2 km: {:.2?}", began.elapsed());
    assert!(receipt.outcome.is_ok(), "{receipt:?}");
    let balls = balls(&road.path);
    let mut seen = 0;
    for &(at, _) in balls.iter().step_by(37) {
        let (x, z) = (at.x.round() as i32, at.z.round() as i32);
        let nearest = balls
            .iter()
            .min_by(|a, b| {
                let flat = |v: DVec3| DVec2::new(v.x - f64::from(x), v.z - f64::from(z)).length();
                flat(a.0).total_cmp(&flat(b.0))
            })
            .expect("a ball");
        let found = heights(ground.world(), x, z, 0, 60);
        assert_eq!(found.len(), 1, "{x} {z}");
        assert!((found[0] - nearest.0.y).abs() < 0.125, "{x} {z}: {found:?}, not {}", nearest.0.y);
        seen += 1;
    }
    assert!(seen > 1000, "{seen}");
    // Bricks along it, and none of the rest of the box around it.
    let bricks = ground.world().bricks().count();
    let around = 2028 * 30 * 68 / 512;
    assert!((1000..around * 2 / 3).contains(&bricks), "{bricks} of {around}");
    assert_closed(&ground);
    ground.undo();
    assert_eq!((ground.world().hash(), ground.world().bricks().count()), (hash, 0));
}

#[test]
fn roads_are_refused_in_other_shapes() {
    let brush = Brush { operation: Operation::Road, ..Brush::smooth(Shape::sphere(Vec3::ONE, 4.0), 1.0) };
    let error = bevy_burrow::brush::Edit::quantize(&brush).expect_err("no corridor");
    assert!(error.to_string().contains("`Brush::road`"), "{error}");
}

#[test]
fn a_long_path_counts_as_its_pieces_and_not_as_the_box_around_them() {
    let side = 4096;
    let source = FunctionSource::new(1, 19.0, 21.0, |_, _| 20.0);
    let ground = Ground::from_source(side, side, source).expect("a size");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    // From corner to corner, in and out of the ground: 3 million bricks in its box.
    let path = |aside: f32| {
        BrushPath::polyline([0.0, 1.0, 2.0, 3.0].map(|part: f32| {
            let along = 100.0 + part * 1250.0;
            (Vec3::new(along, 20.0 + (part % 2.0) * 200.0, along + aside), 2.0)
        }))
    };
    (0..30).for_each(|number| terrain.submit(Brush::dig(path(number as f32 * 9.0)).with_tag(number)));
    assert!(terrain.take_receipts().is_empty(), "there is room for all of them");
    let each = terrain.waiting_work() / 30;
    assert!((1_000..60_000).contains(&each), "{each} bricks");
    // What lies in the box, but not along the path, does not wait.
    let around = |at: IVec3| LatticeBox::point(at).grown(20);
    assert!(terrain.is_ready(around(IVec3::new(3000, 20, 600))));
    assert!(!terrain.is_ready(around(IVec3::new(100, 20, 110))));
    // Nor is it said to have changed.
    let (mut changed, mut count) = (0, 0);
    while let Some(transaction) = terrain.begin() {
        let commit = transaction.run();
        for own in commit.changed_boxes() {
            assert!(own.size().max_element() <= 64, "{own:?}");
            changed += own.volume();
            count += 1;
        }
        assert!(terrain.commit(commit).expect("in order").iter().all(|receipt| receipt.outcome.is_ok()));
    }
    assert!(count > 5 && changed < 1 << 24, "{count} boxes of {changed} samples");
    assert!(terrain.is_ready(around(IVec3::new(100, 20, 110))));
}
