//! The rules of light, compared with rays that are cast through the world.

mod change;

use fastrand::Rng;
use glam::{DVec3, IVec3, Vec3};

use super::*;
use crate::brush::{Brush, Shape};
use crate::ground::{MaterialId, NoiseHeights, NoiseSource};
use crate::lod::Cut;
use crate::surface::Vertex;
use crate::terrain::{Terrain, TerrainSettings};

fn terrain(ground: Ground, chunk_size: u32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings")
}

fn dig(terrain: &mut Terrain, brushes: &[Brush]) {
    assert!(terrain.apply(brushes).iter().all(|receipt| receipt.outcome.is_ok()));
}

/// The vertices that triangles of tiles and chunks use, with the places of those in 1/4096 voxel.
fn vertices(world: &World) -> Vec<(IVec3, Vertex)> {
    let mut all: Vec<(IVec3, Vertex)> = Vec::new();
    for (drawn, mesh) in world.drawn() {
        let origin = world.origin(drawn) * SNAP;
        let mut used: Vec<u32> = mesh.indices.iter().collect();
        used.sort_unstable();
        used.dedup();
        all.extend(used.into_iter().map(|index| {
            let vertex = mesh.vertices[index as usize];
            (origin + vertex.position, vertex)
        }));
    }
    all
}

/// The share of the sky that is seen from a little above a vertex, weighted by the cosine to the vertical.
fn seen_sky(world: &World, place: IVec3, normal: Vec3) -> f64 {
    const RINGS: i32 = 8;
    const TURNS: i32 = 16;
    let from = place.as_dvec3() / f64::from(SNAP) + normal.as_dvec3() * 0.3;
    let mut open = 0;
    for (ring, turn) in (0..RINGS).flat_map(|ring| (0..TURNS).map(move |turn| (ring, turn))) {
        // Equal shares of the squared cosine.
        let up = ((f64::from(ring) + 0.5) / f64::from(RINGS)).sqrt();
        let angle = (f64::from(turn) + 0.5 * f64::from(ring % 2)) / f64::from(TURNS) * std::f64::consts::TAU;
        let out = (1.0 - up * up).sqrt();
        let direction = DVec3::new(out * angle.cos(), up, out * angle.sin());
        open += i32::from(world.raycast(from, direction, 120.0).is_none());
    }
    f64::from(open) / f64::from(RINGS * TURNS)
}

/// The mean error of light at some 80 vertices within a box, and the mean of the sky that they see.
fn mean_error(terrain: &Terrain, low: IVec3, high: IVec3) -> (f64, f64, usize) {
    let world = terrain.world();
    let mut all = vertices(world);
    all.retain(|(place, _)| place.cmpge(low * SNAP).all() && place.cmple(high * SNAP).all());
    let mut lights = SparseSky::new(SkyView::of(world));
    let (mut error, mut seen) = (0.0, 0.0);
    let step = (all.len() / 80).max(1);
    let chosen: Vec<_> = all.into_iter().step_by(step).collect();
    for (place, vertex) in &chosen {
        let sky = seen_sky(world, *place, vertex.normal);
        let light = f64::from(lights.light(*place).sky) / 255.0;
        if std::env::var("SKY_POINTS").is_ok() {
            println!("{:?} {sky:.2} {light:.2}", place.as_vec3() / SNAP as f32);
        }
        error += (sky - light).abs();
        seen += sky;
    }
    let count = chosen.len() as f64;
    (error / count, seen / count, chosen.len())
}

/// A cliff of some 14 voxels from a plain at 20, at x = 40.
fn cliff() -> Ground {
    Ground::from_fn(95, 79, |x, _| 20.0 + 14.0 * ((f64::from(x) - 38.0) / 4.0).clamp(0.0, 1.0))
        .expect("valid")
}

#[test]
fn light_is_the_share_of_the_sky_that_rays_find() {
    let hills = NoiseHeights { seed: 3, scale: 40.0, amplitude: 12.0, base: 24.0, ..Default::default() };
    let meadow = terrain(Ground::from_noise(95, 95, &hills).expect("valid hills"), 32);
    let trench = |x: i32, z: i32| {
        let side = (f64::from(x) - 40.0 - 4.0 * (f64::from(z) / 12.0).sin()).abs();
        26.0 - 8.0 * (1.0 - (side - 2.0) / 4.0).clamp(0.0, 1.0)
    };
    let gully = terrain(Ground::from_fn(79, 79, trench).expect("valid"), 32);
    let flat = || Ground::flat(79, 79, 24.0).expect("valid");
    let mut dug_gully = terrain(flat(), 32);
    dig(&mut dug_gully, &[Brush::dig(Shape::cuboid(Vec3::new(40.0, 22.0, 40.0), Vec3::new(3.0, 6.0, 24.0)))]);
    let mut pit = terrain(flat(), 32);
    dig(&mut pit, &[Brush::dig(Shape::cylinder(Vec3::new(40.0, 15.0, 40.0), Vec3::Y * 14.0, 5.0))]);
    let mut bowl = terrain(flat(), 32);
    dig(&mut bowl, &[Brush::dig(Shape::sphere(Vec3::new(40.0, 24.0, 40.0), 4.0))]);
    let mut overhang = terrain(cliff(), 32);
    dig(&mut overhang, &[Brush::dig(Shape::cuboid(Vec3::new(40.0, 22.5, 40.0), Vec3::new(6.0, 3.5, 12.0)))]);
    let mut tunnel = terrain(cliff(), 32);
    let ends = [Vec3::new(34.0, 22.0, 40.0), Vec3::new(66.0, 22.0, 40.0)];
    dig(&mut tunnel, &[Brush::dig(Shape::capsule(ends[0], ends[1], 2.5))]);
    let at = IVec3::new;
    let scenes = [
        ("meadow", &meadow, at(20, 0, 20), at(75, 60, 75)),
        ("gully", &gully, at(28, 0, 20), at(52, 60, 60)),
        ("dug gully", &dug_gully, at(33, 0, 24), at(47, 60, 56)),
        ("pit", &pit, at(33, 0, 33), at(47, 60, 47)),
        ("bowl", &bowl, at(34, 0, 34), at(46, 60, 46)),
        ("overhang", &overhang, at(34, 0, 30), at(47, 27, 50)),
        ("tunnel", &tunnel, at(40, 0, 34), at(70, 26, 46)),
        ("tunnel, 10 m in", &tunnel, at(50, 0, 34), at(54, 26, 46)),
    ];
    for (name, terrain, low, high) in scenes {
        let (error, seen, count) = mean_error(terrain, low, high);
        println!("{name}: mean error {error:.3}, mean sky {seen:.3}, {count} vertices");
        assert!(count > 20 && error <= 0.1, "{name}: {error:.3}");
    }
}

/// A ball that is dug into a plain so that its sides hang over, and a trench with upright walls.
fn dug_plain() -> Terrain {
    let mut terrain = terrain(Ground::flat(79, 79, 24.0).expect("valid"), 32);
    let trench = Shape::cuboid(Vec3::new(56.0, 22.0, 40.0), Vec3::new(3.0, 6.0, 16.0));
    let ball = Shape::sphere(Vec3::new(30.0, 21.5, 40.0), 4.0);
    dig(&mut terrain, &[Brush::dig(trench), Brush::dig(ball)]);
    terrain
}

#[test]
fn light_changes_between_neighbours_as_the_seen_sky_does() {
    let mut tunnel = terrain(cliff(), 32);
    let ends = [Vec3::new(34.0, 22.0, 40.0), Vec3::new(66.0, 22.0, 40.0)];
    dig(&mut tunnel, &[Brush::dig(Shape::capsule(ends[0], ends[1], 2.5))]);
    let at = IVec3::new;
    let plain = dug_plain();
    let scenes = [
        ("trench", &plain, at(51, 0, 30), at(61, 23, 50)),
        ("ball", &plain, at(24, 0, 34), at(36, 23, 46)),
        ("tunnel", &tunnel, at(42, 0, 34), at(66, 26, 46)),
    ];
    for (name, terrain, low, high) in scenes {
        let world = terrain.world();
        let mut lights = SparseSky::new(SkyView::of(world));
        let mut known: FxHashMap<IVec3, f64> = FxHashMap::default();
        let (mut jumps, mut sum, mut count) = (0, 0.0, 0);
        for (drawn, mesh) in world.drawn() {
            let origin = world.origin(drawn) * SNAP;
            let mut errors = |vertex: &Vertex| {
                let place = origin + vertex.position;
                let is_within = place.cmpge(low * SNAP).all() && place.cmple(high * SNAP).all();
                is_within.then(|| {
                    *known.entry(place).or_insert_with(|| {
                        f64::from(lights.light(place).sky) / 255.0 - seen_sky(world, place, vertex.normal)
                    })
                })
            };
            for corners in mesh.triangles() {
                let [Some(a), Some(b), Some(c)] = corners.map(|corner| errors(&corner)) else { continue };
                let jump = a.max(b).max(c) - a.min(b).min(c);
                jumps += usize::from(jump > 0.25);
                sum += jump;
                count += 1;
            }
        }
        let (mean, share) = (sum / f64::from(count), jumps as f64 / f64::from(count));
        println!(
            "{name}: light jumps by {mean:.3}, and by more than 0.25 in {share:.3} of {count} triangles"
        );
        assert!(count > 200 && mean < 0.08 && share < 0.05, "{name}: {mean:.3}, {share:.3}");
    }
}

#[test]
fn daylight_fades_into_a_tunnel() {
    // In directions that rays have and in ones between.
    for turn in [0.0_f32, 0.2, 0.39, 0.6, 0.785] {
        let mut tunnel = terrain(cliff(), 32);
        let (from, along) = (Vec3::new(34.0, 22.0, 30.0), Vec3::new(turn.cos(), 0.0, turn.sin()));
        dig(&mut tunnel, &[Brush::dig(Shape::capsule(from, from + 36.0 * along, 2.5))]);
        let world = tunnel.world();
        let mut lights = SparseSky::new(SkyView::of(world));
        let mut sums = [(0.0, 0.0); 12];
        for (place, _) in vertices(world) {
            let out = place.as_vec3() / SNAP as f32 - from;
            let (deep, aside) = (out.dot(along), out.reject_from(along).length());
            let light = lights.light(place);
            assert!(light.daylight >= light.sky, "{place}");
            if (8.0..32.0).contains(&deep) && aside < 3.0 {
                let own = &mut sums[(deep / 2.0) as usize - 4];
                *own = (own.0 + f32::from(light.daylight) / 255.0, own.1 + 1.0);
            }
        }
        let means = sums.map(|(sum, count)| sum / f32::max(count, 1.0));
        println!("{turn}: {means:.2?}");
        assert!(means[0] > 0.1 && means[2] > 0.03 && means[10] == 0.0, "{turn}: {means:?}");
        assert!(means.windows(2).all(|pair| pair[1] <= pair[0] + 0.02), "{turn}: {means:?}");
    }
}

#[test]
fn vertices_inside_built_ground_are_dark() {
    let mut terrain = terrain(Ground::flat(79, 79, 24.0).expect("valid"), 32);
    let mut inside = Vec::new();
    for height in [6.0, 4.0] {
        let block = Shape::cuboid(Vec3::new(40.0, 22.0 + height, 40.0), Vec3::new(8.0, height, 8.0));
        dig(&mut terrain, &[Brush::reset(Shape::sphere(Vec3::new(40.0, 30.0, 40.0), 20.0))]);
        dig(&mut terrain, &[Brush::add(block, MaterialId(1))]);
        let mut lights = SparseSky::new(SkyView::of(terrain.world()));
        let places = (35..45).map(|x| IVec3::new(x, 24, 40) * SNAP);
        inside.push(places.map(|place| lights.light(place)).collect::<Vec<_>>());
        // So what happens on top of a block draws no tile below it again.
        assert!(inside.iter().flatten().all(|light| *light == Light::NONE), "{inside:?}");
        assert!(lights.light(IVec3::new(20, 24, 40) * SNAP).sky > 200);
    }
}

#[test]
fn undug_cliffs_are_lit_as_their_tiles() {
    let ground = cliff();
    let mut painted = terrain(cliff(), 32);
    dig(&mut painted, &[Brush::paint(Shape::sphere(Vec3::new(40.0, 26.0, 40.0), 8.0), MaterialId::GROUND)]);
    let mut lights = SparseSky::new(SkyView::of(painted.world()));
    let mut on_cliff = 0;
    for (place, _) in vertices(painted.world()) {
        let ends = light::columns_of(place).map(|column| {
            let place = (column.at(0) * SNAP).with_y(ground.height(column) * (SNAP / ONE));
            i32::from(lights.light(place).sky)
        });
        let part = place.x.rem_euclid(SNAP).max(place.z.rem_euclid(SNAP));
        let expected = ends[0] + (ends[1] - ends[0]) * part / SNAP;
        let light = i32::from(lights.light(place).sky);
        assert!((light - expected).abs() <= 2, "{place}: {light}, a tile has {expected}");
        on_cliff += usize::from(part > 0);
    }
    assert!(on_cliff > 50, "{on_cliff}");
}

/// The highest solid sample of a column, looked for one by one.
fn top_by_samples(world: &World, column: Column) -> i32 {
    let samples = world.samples();
    let highest = world.bricks().map(|(pos, _)| pos.origin().y + 8).max().unwrap_or(0);
    let height = world.ground().height(column);
    let from = highest.max(height.div_euclid(ONE) + 2);
    let solid = (-200..from).rev().find(|&y| samples.is_solid(column.at(y))).expect("the deep is solid");
    let [own, upper] = [solid, solid + 1].map(|y| column.at(y));
    if !samples.is_edited(own) && !samples.is_edited(upper) {
        return height;
    }
    let [own, upper] = [own, upper].map(|point| samples.distance(point).abs());
    solid * ONE + ONE * own / (own + upper)
}

fn any_brush(rng: &mut Rng, ground: &Ground) -> Brush {
    let (x, z) = (rng.i32(0..=ground.width()), rng.i32(0..=ground.depth()));
    let y = ground.height(Column::new(x, z)) / ONE + rng.i32(-9..6);
    let shape = Shape::sphere(IVec3::new(x, y, z).as_vec3(), 1.0 + rng.f32() * 5.0);
    match rng.u8(0..8) {
        0 => Brush::reset(shape),
        1 | 2 => Brush::add(shape, MaterialId(2)),
        _ => Brush::dig(shape),
    }
}

fn hills(seed: u32) -> Ground {
    let noise = NoiseHeights { seed, scale: 24.0, amplitude: 16.0, base: 20.0, ..Default::default() };
    Ground::from_source(90, 70, NoiseSource::new(&noise).expect("valid hills")).expect("valid ground")
}

#[test]
fn tops_are_the_highest_solid_samples() {
    let mut rng = Rng::with_seed(4);
    let mut terrain = terrain(hills(5), 16);
    for _ in 0..50 {
        let brush = any_brush(&mut rng, terrain.world().ground());
        dig(&mut terrain, &[brush]);
    }
    let world = terrain.world();
    let mut lights = SparseSky::new(SkyView::of(world));
    let mut changed = 0;
    for column in (0..=70).flat_map(|z| (0..=90).map(move |x| Column::new(x, z))) {
        assert_eq!(lights.top(column), top_by_samples(world, column), "{column:?}");
        assert_eq!(lights.is_changed(column), lights.top(column) != world.ground().height(column));
        changed += usize::from(lights.is_changed(column));
    }
    assert!(changed > 500, "{changed}");
}

#[test]
fn equal_places_have_equal_light_whatever_draws_them() {
    let mut rng = Rng::with_seed(7);
    let mut terrain = terrain(hills(8), 16);
    for _ in 0..30 {
        let brush = any_brush(&mut rng, terrain.world().ground());
        dig(&mut terrain, &[brush]);
    }
    let world = terrain.world();
    let view = SkyView::of(world);
    let mut known: FxHashMap<IVec3, Light> = FxHashMap::default();
    let mut shared = 0;
    let mut note = |place: IVec3, light: Light| {
        let first = *known.entry(place).or_insert_with(|| {
            shared -= 1;
            light
        });
        shared += 1;
        assert_eq!(first, light, "at {:?}", place.as_vec3() / SNAP as f32);
    };
    for (drawn, mesh) in world.drawn() {
        let origin = world.origin(drawn) * SNAP;
        let (low, high) = world.grid().tile_cells(drawn.tile());
        let mut lights = SkyColumns::new(view, low, high);
        mesh.vertices
            .iter()
            .for_each(|vertex| note(origin + vertex.position, lights.light(origin + vertex.position)));
    }
    for level in 1..4 {
        let cut = Cut::random(world.lod_grid(level), u64::from(level), 60);
        for (node, mesh) in world.drawn_in(&cut) {
            let (low, high) = cut.grid().columns(node);
            let mut lights = SparseSky::new(view).with_grid(low, high, node.stride());
            let origin = low.at(0) * SNAP;
            mesh.vertices
                .iter()
                .for_each(|vertex| note(origin + vertex.position, lights.light(origin + vertex.position)));
        }
    }
    assert!(shared > 3000, "{shared} places are drawn more than once");
}

#[test]
fn light_can_be_asked_for_anywhere() {
    let mut terrain = terrain(Ground::flat(79, 79, 24.0).expect("valid"), 32);
    let ends = [Vec3::new(10.0, 12.0, 40.0), Vec3::new(70.0, 12.0, 40.0)];
    dig(&mut terrain, &[Brush::dig(Shape::capsule(ends[0], ends[1], 2.5))]);
    let world = terrain.world();
    assert_eq!(world.sky_light(DVec3::new(40.0, 24.0, 40.0)), 1.0);
    assert_eq!(world.sky_light(DVec3::new(40.0, 12.0, 40.0)), 0.0);
    for place in [DVec3::NAN, DVec3::INFINITY, DVec3::splat(-1e300), DVec3::splat(1e300)] {
        assert!((0.0..=1.0).contains(&world.sky_light(place)), "{place}");
    }
}
