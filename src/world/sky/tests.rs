use fastrand::Rng;
use glam::{DVec3, IVec3, Vec3};

use super::*;
use crate::brush::{Brush, Shape};
use crate::ground::{MaterialId, NoiseHeights, NoiseSource};
use crate::lattice::{ChunkPos, TilePos};
use crate::lod::{Cut, Node};
use crate::loose::LooseSettings;
use crate::redraw::{relit_nodes, relit_parts};
use crate::surface::{SurfaceMesh, Vertex};
use crate::terrain::{Order, Terrain, TerrainSettings, Transaction};
use crate::world::MeshKey;

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

/// The light of all corners of triangles of a tile or chunk.
fn lights_of(world: &World, drawn: MeshKey) -> Vec<Light> {
    let mesh = match drawn {
        MeshKey::Tile(tile) => world.tile_mesh(tile),
        MeshKey::Chunk(chunk) => world.chunk_mesh(chunk),
    };
    let (low, high) = world.grid().tile_cells(drawn.tile());
    let mut lights = SkyColumns::new(SkyView::of(world), low, high);
    let origin = world.origin(drawn) * SNAP;
    mesh.triangles().flatten().map(|vertex| lights.light(origin + vertex.position)).collect()
}

#[test]
fn a_commit_lights_all_that_it_changes() {
    let mut relit_tiles = 0;
    for (seed, size) in [(1, 16), (2, 32), (3, 8)] {
        let mut rng = Rng::with_seed(seed);
        let mut terrain = terrain(hills(seed as u32), size);
        for _ in 0..25 {
            let before = World::clone(terrain.world());
            let brush = any_brush(&mut rng, before.ground());
            terrain.submit(brush);
            let commit = terrain.begin().expect("it waits").run();
            let lit = LitWorld::new(Arc::new(before.clone()), commit.change().bricks);
            let mut redrawn: Vec<MeshKey> =
                commit.meshes.tiles.iter().map(|(tile, _)| MeshKey::Tile(*tile)).collect();
            redrawn.extend(commit.meshes.chunks.iter().map(|(chunk, _)| MeshKey::Chunk(*chunk)));
            let relit = relit_parts(&lit, |drawn| redrawn.contains(&drawn));
            terrain.commit(commit).expect("it is next");
            let world = terrain.world();
            // The running commit has the light of the committed one.
            for tile in world.grid().tiles() {
                let (low, high) = world.grid().tile_cells(tile);
                let [mut running, mut done] =
                    [lit.view(), SkyView::of(world)].map(|view| SkyColumns::new(view, low, high));
                assert_eq!(running.lights(), done.lights());
            }
            assert!(!relit.iter().any(|drawn| redrawn.contains(drawn)));
            relit_tiles += relit.iter().filter(|drawn| matches!(drawn, MeshKey::Tile(_))).count();
            let tiles = world.grid().tiles().map(MeshKey::Tile);
            for drawn in tiles.chain(before.drawn_chunks().map(MeshKey::Chunk)) {
                if !redrawn.contains(&drawn) && !relit.contains(&drawn) {
                    assert_eq!(lights_of(&before, drawn), lights_of(world, drawn), "{drawn:?}");
                }
            }
        }
    }
    assert!(relit_tiles > 20, "{relit_tiles}");
}

/// A ground, and what players do there.
struct Scene {
    name: &'static str,
    chunk_size: u32,
    ground: Ground,
    /// Whether ground that is cut off breaks off.
    is_loose: bool,
    brush: fn(&mut Rng, &Ground) -> Brush,
}

fn scenes(seed: u32) -> [Scene; 5] {
    fn at(rng: &mut Rng, low: [i32; 3], high: [i32; 3]) -> Vec3 {
        let along =
            |axis: usize, rng: &mut Rng| low[axis] as f32 + rng.f32() * (high[axis] - low[axis]) as f32;
        Vec3::new(along(0, rng), along(1, rng), along(2, rng))
    }
    let gully = |x: i32, z: i32| {
        let side = (f64::from(x) - 40.0 - 4.0 * (f64::from(z) / 12.0).sin()).abs();
        26.0 - 8.0 * (1.0 - (side - 2.0) / 4.0).clamp(0.0, 1.0)
    };
    let slope = |x: i32, z: i32| 20.0 + 0.4 * f64::from(x) + 0.2 * f64::from(z);
    let ground = |height: &(dyn Fn(i32, i32) -> f64 + Sync)| Ground::from_fn(79, 79, height).expect("valid");
    [
        Scene { name: "hills", chunk_size: 16, ground: hills(seed), is_loose: false, brush: any_brush },
        Scene {
            name: "tunnels and overhangs",
            chunk_size: 32,
            ground: cliff(),
            is_loose: false,
            brush: |rng, _| {
                let from = at(rng, [36, 22, 20], [56, 30, 60]);
                let to = from + at(rng, [-8, -3, -8], [8, 3, 8]);
                Brush::dig(Shape::capsule(from, to, 1.5 + rng.f32() * 2.0))
            },
        },
        Scene {
            name: "roofs and loose pieces",
            chunk_size: 16,
            ground: ground(&|_, _| 20.0),
            is_loose: true,
            brush: |rng, _| {
                let center = at(rng, [24, 20, 24], [56, 28, 56]);
                let size = at(rng, [1, 1, 1], [9, 4, 9]);
                match rng.u8(0..3) {
                    0 => Brush::add(Shape::cuboid(center, size), MaterialId(2)),
                    _ => Brush::dig(Shape::cuboid(center, size)),
                }
            },
        },
        Scene { name: "gully", chunk_size: 8, ground: ground(&gully), is_loose: false, brush: any_brush },
        Scene {
            name: "borders and rims",
            chunk_size: 32,
            ground: ground(&slope),
            is_loose: false,
            brush: |rng, ground| {
                let along = |rng: &mut Rng| [0, 0, 31, 32, 33, 64, 77, 79][rng.usize(0..8)];
                let (x, z) = (along(rng), along(rng));
                let y = ground.height(Column::new(x, z)) / ONE - rng.i32(-1..3);
                Brush::dig(Shape::sphere(IVec3::new(x, y, z).as_vec3(), 1.0 + rng.f32() * 3.0))
            },
        },
    ]
}

/// What is drawn whose light differs between two worlds that draw the same shapes there, without parts that are drawn again.
fn otherwise_lit(before: &World, after: &World, is_drawn_anew: impl Fn(MeshKey) -> bool) -> Vec<MeshKey> {
    let tiles = before.grid().tiles().map(MeshKey::Tile);
    let all = tiles.chain(before.drawn_chunks().map(MeshKey::Chunk)).filter(|drawn| !is_drawn_anew(*drawn));
    all.filter(|&drawn| lights_of(before, drawn) != lights_of(after, drawn)).collect()
}

/// Nodes of a cut whose light differs, without those that are drawn again.
fn otherwise_lit_nodes(before: &World, after: &World, cut: &Cut, drawn_anew: &[Node]) -> Vec<Node> {
    let all = before.drawn_in(cut).filter(|(node, _)| node.level > 0 && !drawn_anew.contains(node));
    let differs = |(node, mesh): &(Node, SurfaceMesh)| {
        let (low, high) = cut.grid().columns(*node);
        let [mut old, mut new] = [before, after]
            .map(|world| SparseSky::new(SkyView::of(world)).with_grid(low, high, node.stride()));
        let places = mesh.vertices.iter().map(|vertex| low.at(0) * SNAP + vertex.position);
        { places }.any(|place| old.light(place) != new.light(place))
    };
    all.filter(differs).map(|(node, _)| node).collect()
}

#[test]
fn everything_whose_light_changes_is_lit_again_wherever_players_dig() {
    for seed in 0..2 {
        for Scene { name, chunk_size, ground, is_loose, brush } in scenes(seed) {
            let mut rng = Rng::with_seed(u64::from(seed) + 20);
            let mut terrain = terrain(ground, chunk_size);
            terrain.set_loose(is_loose.then(LooseSettings::default));
            let cut = Cut::random(terrain.world().lod_grid(2), u64::from(seed), 12);
            let drawn = Arc::new(terrain.world().draw_cut(cut.clone()).0);
            terrain.set_drawn_cut(Some(Arc::clone(&drawn)));
            // Without what is lit again, light would be wrong in this many places.
            let (mut parts, mut nodes) = (0, 0);
            for number in 0..24 {
                let before = World::clone(terrain.world());
                match number % 6 {
                    4 => terrain.submit(Order::Undo),
                    5 if rng.bool() => terrain.submit(Order::Redo),
                    _ => terrain.submit(brush(&mut rng, before.ground())),
                }
                let Some(commit) = terrain.begin().map(Transaction::run) else { continue };
                let lit = LitWorld::new(Arc::new(before.clone()), commit.change().bricks);
                let tiles = commit.meshes.tiles.iter().map(|(tile, _)| MeshKey::Tile(*tile));
                let chunks = commit.meshes.chunks.iter().map(|(chunk, _)| MeshKey::Chunk(*chunk));
                let redrawn: Vec<MeshKey> = tiles.chain(chunks).collect();
                let relit = relit_parts(&lit, |drawn| redrawn.contains(&drawn));
                let mut new_nodes: Vec<Node> = commit.meshes.nodes.iter().map(|update| update.node).collect();
                let own_nodes = new_nodes.clone();
                let relit_nodes = relit_nodes(&lit, &drawn, |node| own_nodes.contains(&node));
                terrain.commit(commit).expect("it is next");
                let world = terrain.world();
                let needed = otherwise_lit(&before, world, |drawn| redrawn.contains(&drawn));
                let missing: Vec<_> = needed.iter().filter(|drawn| !relit.contains(drawn)).collect();
                assert!(missing.is_empty(), "{name}: {missing:?} after {number} of {seed}");
                parts += needed.len();
                let needed = otherwise_lit_nodes(&before, world, &cut, &new_nodes);
                nodes += needed.len();
                new_nodes.extend(relit_nodes.iter().map(|update| update.node));
                let missing = otherwise_lit_nodes(&before, world, &cut, &new_nodes);
                assert!(missing.is_empty(), "{name}: {missing:?} after {number} of {seed}");
                // Columns that are brought up to date have the light of new ones, and that of each column alone.
                for tile in world.grid().tiles() {
                    let (low, high) = world.grid().tile_cells(tile);
                    let mut updated = SkyColumns::new(lit.view_before(), low, high).after(&lit);
                    let mut lone = SparseSky::new(SkyView::of(world));
                    assert_eq!(updated.lights(), SkyColumns::new(SkyView::of(world), low, high).lights());
                    let columns =
                        (low.z..=high.z).flat_map(|z| (low.x..=high.x).map(move |x| Column::new(x, z)));
                    let ground = updated.ground_lights();
                    for (&light, column) in ground.iter().zip(columns).step_by(7) {
                        let height = world.ground().height(column) * (SNAP / ONE);
                        let expected = lone.light((column.at(0) * SNAP).with_y(height));
                        assert_eq!(light, expected, "{name}: {column:?} after {number} of {seed}");
                    }
                }
            }
            assert!(parts > 4, "{name}: {parts} parts");
            println!("{name}: {parts} parts and {nodes} nodes are lit again");
        }
    }
}

#[test]
fn a_dig_on_a_plain_redraws_nothing_for_its_light() {
    let mut terrain = terrain(Ground::flat(127, 127, 20.0).expect("valid"), 32);
    let before = terrain.snapshot();
    terrain.submit(Brush::dig(Shape::sphere(Vec3::new(60.0, 20.0, 62.0), 4.0)));
    let commit = terrain.begin().expect("it waits").run();
    let lit = LitWorld::new(before, commit.change().bricks);
    let redrawn: Vec<TilePos> = commit.meshes.tiles.iter().map(|(tile, _)| *tile).collect();
    let chunks: Vec<ChunkPos> = commit.meshes.chunks.iter().map(|(chunk, _)| *chunk).collect();
    let is_redrawn = |drawn| match drawn {
        MeshKey::Tile(tile) => redrawn.contains(&tile),
        MeshKey::Chunk(chunk) => chunks.contains(&chunk),
    };
    assert_eq!(relit_parts(&lit, is_redrawn), []);
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
