//! Levels of detail by their figures, without drawing: `cargo bench --no-default-features --bench horizon [--
//! KILOMETRES] [PART...]`, where parts are `views`, `cdlod`, `load`, `nodes`, `edited`, `digs` and `flight`; all of
//! them unless some are named.
//!
//! A world of 16 x 16 km (or the given size) whose mountains are computed on demand, seen by an eye on a summit at 1440
//! lines and 45 degrees. Printed are nodes and triangles for views of 0.5 to 16 km; how long the coarsest nodes and the
//! whole cut take; what a node costs in a task, from noise and from an image, and on edited ground; what a flight at
//! 100 m/s with 20 digs a second needs; and the bytes that the ground and the meshes take, as a GPU gets them. `cdlod`
//! compares triangles with those of a published scheme.

#[path = "../../examples/shared/mountains.rs"]
mod mountains;

mod cdlod;
mod edited;

use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy_burrow::ground::{GreyImage, Ground, ImageScale, ImageSource, NoiseSource};
use bevy_burrow::lod::{Cut, LodSettings, Node, View, Viewpoint};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::{ChooseCut, GroundFacts, KnownNodes, NodeUpdate, World};
use glam::{Vec2, Vec3, Vec3Swizzles};
use rayon::prelude::*;

/// Pixels of a picture 1440 high at 45 degrees.
const PIXELS: f32 = 1738.0;

/// Bytes of a vertex as a game with a look has them, and of an index.
const VERTEX: usize = 32;

/// The cut that an eye needs, level by level from the coarsest, as the plugin reaches it.
fn cut_for(world: &World, choice: &LodSettings, eye: Viewpoint) -> Cut {
    let (known, mut cut) = (KnownNodes::default(), Cut::coarsest(world.lod_grid(u8::MAX)));
    loop {
        let next = known.next_cut(world, &cut, choice, &[eye], usize::MAX);
        if next == cut {
            return cut;
        }
        cut = next;
    }
}

fn main() {
    let given = std::env::args().skip(1).find_map(|arg| arg.parse().ok());
    let side = given.unwrap_or(16u32).clamp(1, 128) * 1024;
    let source = NoiseSource::new(&mountains::heights()).expect("valid noise");
    let ground = Arc::new(Ground::from_source(side, side, source).expect("a valid size"));
    let terrain = || Terrain::new(Arc::clone(&ground), &TerrainSettings::default()).expect("valid settings");
    let middle = side as f32 / 2.0 + 137.0;
    let summit = summit(terrain().world(), middle);
    println!("{side} x {side} cells; eye at {summit}, {} threads", rayon::current_num_threads());
    let parts: Vec<String> = std::env::args().skip(1).filter(|arg| PARTS.contains(&&**arg)).collect();
    for part in PARTS.iter().filter(|part| parts.is_empty() || parts.iter().any(|own| own == *part)) {
        match *part {
            "views" => views(terrain().world(), summit),
            "cdlod" => cdlod::compare(terrain().world(), summit),
            "load" => load(terrain(), summit),
            "nodes" => nodes(terrain().world(), summit),
            "edited" => edited::nodes(),
            "digs" => digs([terrain(), terrain()], summit),
            _ => flight(terrain(), summit),
        }
    }
}

const PARTS: [&str; 7] = ["views", "cdlod", "load", "nodes", "edited", "digs", "flight"];

/// Digs of radius 4 near the eye, with a cut drawn and without, in turns. The first round computes the ground that both
/// share, and shows where edits are: the cut is the one that they lead to, as in a game. It is not counted.
fn digs(mut terrains: [Terrain; 2], summit: Vec3) {
    let mut times = [Vec::new(), Vec::new()];
    for (round, number) in (0..3).flat_map(|round| (0..600).map(move |number| (round, number))) {
        if round == 1 && number == 0 {
            let cut = cut_for(terrains[0].world(), &LodSettings::default(), eye(summit));
            let (drawn, _) = terrains[0].world().draw_cut(cut);
            terrains[0].set_drawn_cut(Some(Arc::new(drawn)));
        }
        let (x, z) = ((number * 37 % 100) as f32 - 50.0, (number * 61 % 100) as f32 - 50.0);
        let (x, z) = (summit.x + x, summit.z + z);
        let height = terrains[0].world().height(x.into(), z.into()).unwrap_or_default() as f32;
        let shape = Shape::sphere(Vec3::new(x, height - round as f32 * 3.0, z), 4.0);
        for at in [(number + round) % 2, (number + round + 1) % 2] {
            let terrain = &mut terrains[at];
            terrain.submit(Brush::dig(shape));
            let transaction = terrain.begin().expect("a dig waits");
            let start = Instant::now();
            let commit = transaction.run();
            if round > 0 {
                times[at].push(start.elapsed());
            }
            terrain.commit(commit).expect("the one under way");
        }
    }
    let sums = times.each_ref().map(|times| times.iter().sum::<Duration>().as_secs_f64());
    let [with, without] = times.map(|mut times| {
        times.sort_unstable();
        times[times.len() / 2]
    });
    let ratio = with.as_secs_f64() / without.as_secs_f64();
    println!(
        "\na dig of radius 4 near the eye: {with:.1?} with levels, {without:.1?} without, {ratio:.3} times; all digs together {:.3} \
         times",
        sums[0] / sums[1]
    );
}

/// The highest of some places around the middle, 2 m above the ground.
fn summit(world: &World, middle: f32) -> Vec3 {
    let steps = (-20..=20).flat_map(|z| (-20..=20).map(move |x| (x, z)));
    let places = steps.map(|(x, z)| (middle + x as f32 * 50.0, middle + z as f32 * 50.0));
    let places = places.map(|(x, z)| {
        let height = world.height(x.into(), z.into()).unwrap_or_default();
        Vec3::new(x, height as f32 + 2.0, z)
    });
    places.max_by(|a, b| a.y.total_cmp(&b.y)).unwrap_or_default()
}

fn eye(position: Vec3) -> Viewpoint {
    Viewpoint { position, velocity: Vec3::ZERO, pixels: PIXELS, view: View::Perspective }
}

/// Directions in which an eye looks.
const DIRECTIONS: usize = 64;

/// Half the horizontal angle of view of a picture of 16 to 9 that is 45 degrees high.
const HALF_ANGLE: f32 = 0.635;

/// Returns `true` if any part of a node is within the angle of view, seen from above.
fn is_in_sight(cut: &Cut, node: Node, eye: Vec3, angle: f32) -> bool {
    let (low, high) = cut.grid().columns(node);
    let [low, high] = [low, high].map(|column| Vec2::new(column.x as f32, column.z as f32));
    let corners = [low, Vec2::new(low.x, high.y), high, Vec2::new(high.x, low.y)];
    // Outside neither side of the wedge.
    let sides = [-HALF_ANGLE, HALF_ANGLE].map(|half| Vec2::from_angle(angle + half));
    let is_inside = |corner: &Vec2, side: usize| {
        let across = sides[side].perp_dot(*corner - eye.xz());
        if side == 0 { across >= 0.0 } else { across <= 0.0 }
    };
    (0..2).all(|side| corners.iter().any(|corner| is_inside(corner, side)))
}

fn views(world: &World, summit: Vec3) {
    println!(
        "\n| view, km | nodes | triangles all round, millions | in sight, p50 | most | nodes by level |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    for view in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0] {
        let choice = LodSettings { view_distance: view * 1000.0, ..LodSettings::default() };
        let cut = cut_for(world, &choice, eye(summit));
        let nodes: Vec<Node> = cut.nodes().collect();
        let triangles = |&node: &Node| (node, world.node_mesh(&cut, node).indices.len() / 3);
        let triangles: Vec<(Node, usize)> = nodes.par_iter().map(triangles).collect();
        let mut in_sight: Vec<usize> = (0..DIRECTIONS)
            .map(|at| {
                let angle = at as f32 / DIRECTIONS as f32 * std::f32::consts::TAU;
                let seen = triangles.iter().filter(|(node, _)| is_in_sight(&cut, *node, summit, angle));
                seen.map(|(_, triangles)| triangles).sum()
            })
            .collect();
        in_sight.sort_unstable();
        let all: usize = triangles.iter().map(|(_, triangles)| triangles).sum();
        let [all, p50, most] =
            [all, in_sight[DIRECTIONS / 2], in_sight[DIRECTIONS - 1]].map(|count| count as f64 / 1e6);
        let mut levels = vec![0; usize::from(cut.grid().top()) + 1];
        nodes.iter().for_each(|node| levels[usize::from(node.level)] += 1);
        println!("| {view} | {} | {all:.3} | {p50:.3} | {most:.3} | {levels:?} |", nodes.len());
    }
}

/// Bytes of meshes as a GPU gets them.
fn bytes(nodes: &[NodeUpdate]) -> usize {
    let of = |mesh: &bevy_burrow::surface::SurfaceMesh| {
        let index = if mesh.vertices.len() < 1 << 16 { 2 } else { 4 };
        mesh.vertices.len() * VERTEX + mesh.indices.len() * index
    };
    let parts = |update: &NodeUpdate| update.shown().map(|(_, mesh)| of(&mesh)).sum::<usize>();
    nodes.iter().map(|update| update.mesh.as_deref().map_or(0, of) + parts(update)).sum()
}

fn load(terrain: Terrain, summit: Vec3) {
    let world = terrain.world();
    let start = Instant::now();
    let (_, first) = world.draw_cut(Cut::coarsest(world.lod_grid(u8::MAX)));
    let first_took = start.elapsed();
    let cut = cut_for(world, &LodSettings::default(), eye(summit));
    let chosen = start.elapsed();
    let (drawn, all) = world.draw_cut(cut);
    let took = start.elapsed();
    let area = (drawn.cut().grid().chunks().width() as f64 / 1000.0).powi(2);
    let view = area.min(std::f64::consts::PI * 8.0 * 8.0);
    let (meshes, ground) = (bytes(&all), world.memory().total());
    println!(
        "\nload: {} coarsest nodes in {first_took:.1?}, all {} known in {chosen:.1?}, drawn in {took:.1?}",
        first.len(),
        all.len()
    );
    println!(
        "memory: meshes {:.1} MB, the model {:.1} MB; {:.3} MB a km2 of a view of 8 km",
        meshes as f64 / 1e6,
        ground as f64 / 1e6,
        (meshes + ground) as f64 / 1e6 / view
    );
}

/// The time of a node in a task: its facts and its mesh, one thread.
fn nodes(world: &World, summit: Vec3) {
    let image = {
        let samples = (0..2048u32 * 2048).map(|at| {
            let (x, z) = (at % 2048, at / 2048);
            let wave = (x as f64 * 0.013).sin() * (z as f64 * 0.017).cos() * 0.4 + 0.5;
            (wave * 60_000.0) as u16 + ((x * 7 + z * 13) % 97) as u16
        });
        GreyImage::from_samples(2048, 2048, samples.collect()).expect("a valid image")
    };
    let scale = ImageScale { voxels_per_sample: 8, low: 0.0, high: 500.0, detail: None };
    let source = ImageSource::new(image, &scale).expect("valid");
    let [width, depth] = source.size().map(|cells| cells as u32);
    let ground = Ground::from_source(width, depth, source).expect("a valid size");
    let image = Terrain::new(ground, &TerrainSettings::default()).expect("valid settings");
    println!("\n| a node, ms | level 0 | 1 | 2 | 3 | 4 | 5 |\n| --- | --- | --- | --- | --- | --- | --- |");
    for (name, world) in [("noise", world), ("image", image.world())] {
        let grid = world.lod_grid(u8::MAX);
        let times = (0..6u8).map(|level| {
            // Each node is new, so no page of it was computed before.
            let cut = Cut::new(grid, |node| node.level > level);
            let (x, z) = ((summit.x / 32.0) as i32 >> level, (summit.z / 32.0) as i32 >> level);
            let mut times: Vec<Duration> = (0..24)
                .map(|at| Node {
                    level,
                    x: (x + at % 6 * 3) % ((1 << 9) >> level),
                    z: (z + at / 6 * 3) % ((1 << 9) >> level),
                })
                .filter(|&node| grid.has(node))
                .map(|node| {
                    let start = Instant::now();
                    let (facts, mesh) =
                        (GroundFacts::new(world.ground(), grid, node), world.node_mesh(&cut, node));
                    std::hint::black_box((facts, mesh));
                    start.elapsed()
                })
                .collect();
            times.sort_unstable();
            format!("{:.2}", times[times.len() / 2].as_secs_f64() * 1e3)
        });
        println!("| {name} | {} |", times.collect::<Vec<_>>().join(" | "));
    }
}

/// A minute at 100 m/s, 60 frames a second, one change of levels or transaction a frame.
fn flight(mut terrain: Terrain, summit: Vec3) {
    const FRAMES: usize = 3600;
    let known = Arc::new(KnownNodes::default());
    let (drawn, _) = terrain.world().draw_cut(cut_for(terrain.world(), &LodSettings::default(), eye(summit)));
    terrain.set_drawn_cut(Some(Arc::new(drawn)));
    let (mut made, mut digs, mut cuts, mut max_nodes) = (0, Vec::new(), Vec::new(), 0);
    let begin = Instant::now();
    let mut memory = Vec::new();
    for frame in 0..FRAMES {
        let seconds = frame as f32 / 60.0;
        let turn = seconds / 16.0;
        let at = summit + Vec3::new(turn.sin() * 1600.0, 60.0, (1.0 - turn.cos()) * 1600.0);
        let velocity = Vec3::new(turn.cos(), 0.0, turn.sin()) * 100.0;
        if frame % 3 == 0 {
            let height = terrain.world().height(at.x.into(), at.z.into()).unwrap_or_default() as f32;
            terrain.submit(Brush::dig(Shape::sphere(Vec3::new(at.x, height, at.z), 3.0)));
            let transaction = terrain.begin().expect("a dig waits");
            let start = Instant::now();
            let commit = transaction.run();
            digs.push(start.elapsed());
            terrain.commit(commit).expect("the one under way");
            continue;
        }
        let known = Arc::clone(&known);
        let eyes = [Viewpoint { position: at, velocity, pixels: PIXELS, view: View::Perspective }];
        let choose: Arc<ChooseCut> =
            Arc::new(move |world, cut| known.next_cut(world, cut, &LodSettings::default(), &eyes, 16));
        let start = Instant::now();
        let commit = terrain.begin_cut(choose).expect("a cut is drawn").run();
        cuts.push(start.elapsed());
        made += commit.meshes.nodes.iter().filter(|update| update.mesh.is_some()).count();
        max_nodes = max_nodes.max(commit.drawn_cut().map_or(0, |drawn| drawn.cut().nodes().count()));
        terrain.commit(commit).expect("the one under way");
        if frame % 600 == 1 {
            memory.push(terrain.memory().total() - terrain.memory().edits());
        }
    }
    let took = begin.elapsed();
    for times in [&mut digs, &mut cuts] {
        times.sort_unstable();
    }
    let at = |times: &[Duration], share: f64| times[((times.len() - 1) as f64 * share) as usize];
    println!(
        "\nflight of {} s in {took:.1?}: {made} nodes made, at most {max_nodes} drawn; a change of levels p50 {:.2?}, p99 {:.2?}; \
         a dig p50 {:.2?}, p99 {:.2?}",
        FRAMES / 60,
        at(&cuts, 0.5),
        at(&cuts, 0.99),
        at(&digs, 0.5),
        at(&digs, 0.99),
    );
    println!("bytes of the ground over the flight: {memory:?}");
}
