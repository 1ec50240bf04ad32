//! Laws of levels that look inside: of vertices and nesting, of running transactions; and negative controls, each of
//! which breaks one rule and must be noticed.

use std::collections::BTreeMap;
use std::sync::Arc;

use fastrand::Rng;
use glam::{IVec3, Vec3};
use rustc_hash::{FxHashMap, FxHashSet};

use super::{Commit, Order, Terrain, TerrainSettings, World};
use crate::brush::{Brush, Shape};
use crate::ground::{Ground, MaterialId};
use crate::lattice::{BrickPos, Column, SNAP};
use crate::lod::{Cut, Node};
use crate::surface::lod::{self, Fault, LodView, nodes_near};
use crate::surface::vertex::WorldView;
use crate::surface::{Mask, MaskView, SeamChecker, SeamReport, SurfaceMesh};
use crate::volume::{Brick, pristine_layers};
use crate::worlds::{any_random_brush, random_ground_of_size, world_count};

type Drawings = BTreeMap<Node, SurfaceMesh>;

fn draw(view: &LodView) -> Drawings {
    view.cut.nodes().map(|node| (node, lod::node_mesh(view, node))).collect()
}

fn seams(view: &LodView, drawings: &Drawings) -> SeamReport {
    let mut checker = SeamChecker::default();
    for (node, mesh) in drawings {
        checker.add(mesh, view.cut.grid().columns(*node).0.at(0));
    }
    checker.check(view.world.grid)
}

/// The cut with a node split, if no other node has to be split for it.
fn split(cut: &Cut, node: Node) -> Option<Cut> {
    let finer = Cut::new(cut.grid(), |other| cut.is_split(other) || other == node);
    let gone = cut.nodes().filter(|&other| !finer.contains(other)).count();
    (gone == 1).then_some(finer)
}

/// The drawn surface before and after a node splits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Counts {
    open: usize,
    nonmanifold_edges: usize,
    normal_jumps: usize,
    /// Vertices of lattice edges that are elsewhere after the split.
    moved: usize,
    /// Edited vertices of the node that are vertices of its children, lie on a straight side, or neither.
    nested: usize,
    on_side: usize,
    lost: usize,
    /// Nodes that do not touch the one that splits, and change.
    apart_redrawn: usize,
}

impl Counts {
    fn is_lawful(self) -> bool {
        [self.open, self.moved, self.lost, self.apart_redrawn, self.normal_jumps] == [0; 5]
    }

    fn add(&mut self, other: Self) {
        self.open += other.open;
        self.nonmanifold_edges += other.nonmanifold_edges;
        self.normal_jumps += other.normal_jumps;
        self.moved += other.moved;
        self.nested += other.nested;
        self.on_side += other.on_side;
        self.lost += other.lost;
        self.apart_redrawn += other.apart_redrawn;
    }
}

fn edges(view: &LodView) -> FxHashMap<(IVec3, usize, i32), IVec3> {
    let coarse = view.cut.nodes().filter(|node| node.level > 0);
    coarse.flat_map(|node| lod::edge_vertices(view, node)).map(|own| (own.edge, own.place)).collect()
}

/// Counts what all laws speak of, when each of some nodes splits.
fn examine(world: &World, cut: &Cut, nodes: &[Node], fault: Option<Fault>) -> Counts {
    fn view<'a>(world: &'a World, cut: &'a Cut, fault: Option<Fault>) -> LodView<'a> {
        LodView { fault, ..world.lod_view(cut) }
    }
    let before = draw(&view(world, cut, fault));
    let report = seams(&view(world, cut, fault), &before);
    let mut counts = Counts {
        open: report.open + report.unbalanced,
        nonmanifold_edges: report.nonmanifold_edges,
        normal_jumps: report.worst_normal_at.is_some().into(),
        ..Counts::default()
    };
    let places = edges(&view(world, cut, fault));
    for &node in nodes {
        let Some(finer) = split(cut, node) else { continue };
        let after = draw(&view(world, &finer, fault));
        counts.open += seams(&view(world, &finer, fault), &after).open;
        let touching = cut.touching(node);
        let is_redrawn = |other: &Node| {
            !touching.contains(other) && after.get(other).is_some_and(|mesh| *mesh != before[other])
        };
        counts.apart_redrawn += before.keys().filter(|other| is_redrawn(other)).count();
        let is_moved = |(edge, place): &(_, IVec3)| places.get(edge).is_some_and(|before| before != place);
        counts.moved += edges(&view(world, &finer, fault)).into_iter().filter(is_moved).count();
        let mut drawn: FxHashSet<IVec3> = FxHashSet::default();
        for (child, mesh) in after.iter().filter(|(child, _)| node.covers(**child)) {
            let origin = finer.grid().columns(*child).0.at(0) * SNAP;
            drawn.extend(mesh.triangles().flatten().map(|vertex| vertex.position + origin));
        }
        for own in lod::edge_vertices(&view(world, cut, fault), node) {
            if own.edge.2 == node.stride() && !own.is_pristine {
                let count = if drawn.contains(&own.place) {
                    &mut counts.nested
                } else if own.is_half_level {
                    &mut counts.on_side
                } else {
                    &mut counts.lost
                };
                *count += 1;
            }
        }
    }
    counts
}

fn coarse_nodes(world: &World, cut: &Cut) -> Vec<Node> {
    let mut nodes: Vec<Node> = cut.nodes().filter(|node| node.level > 0).collect();
    nodes.sort_unstable_by_key(|&node| (!world.has_edits(cut.grid(), node), node));
    nodes
}

/// Brushes over the corners of nodes.
fn corner_brush(rng: &mut Rng, ground: &Ground, cut: &Cut) -> Brush {
    let mut nodes: Vec<Node> = cut.nodes().collect();
    nodes.sort_unstable();
    let (low, high) = cut.grid().columns(nodes[rng.usize(0..nodes.len())]);
    let (mut x, z) = ([low.x, high.x][rng.usize(0..2)], [low.z, high.z][rng.usize(0..2)]);
    if rng.bool() {
        x = rng.i32(0..=ground.width());
    }
    let y =
        ground.height(Column::new(x, z)) as f32 / 256.0 + [-6.0, -2.0, -0.3, 0.0, 1.5, 4.0][rng.usize(0..6)];
    let shape = Shape::sphere(Vec3::new(x as f32, y, z as f32), [2.0, 3.7, 6.0, 9.0][rng.usize(0..4)]);
    if rng.bool() { Brush::dig(shape) } else { Brush::add(shape, MaterialId(3)) }
}

fn random_world(index: u64) -> (Terrain, Cut) {
    let mut rng = Rng::with_seed(index);
    let chunk_size = [8, 25][rng.usize(0..2)];
    let [width, depth] = [(); 2].map(|()| rng.u32(chunk_size + 3..chunk_size * 2 + 60));
    let ground = random_ground_of_size(&mut rng, index, width, depth);
    let settings = TerrainSettings { chunk_size, ..Default::default() };
    let mut terrain = Terrain::new(ground, &settings).expect("valid settings");
    let cut = Cut::random(terrain.world().lod_grid(4), rng.u64(..), rng.u64(10..80));
    let brushes: Vec<Brush> = (0..rng.u32(1..7))
        .map(|_| match rng.u32(0..2) {
            0 => any_random_brush(&mut rng, terrain.world().ground()),
            _ => corner_brush(&mut rng, terrain.world().ground(), &cut),
        })
        .collect();
    terrain.apply(brushes);
    (terrain, cut)
}

#[test]
fn vertices_stay_and_are_vertices_of_finer_levels() {
    let mut total = Counts::default();
    for index in 0..world_count(60) {
        let (terrain, cut) = random_world(index);
        let nodes = coarse_nodes(terrain.world(), &cut);
        let counts = examine(terrain.world(), &cut, &nodes[..nodes.len().min(2)], None);
        assert!(counts.is_lawful(), "world {index}: {counts:?}");
        total.add(counts);
    }
    println!("{total:?}");
    assert!(total.nested > 100 && total.on_side < total.nested / 20, "{total:?}");
}

/// A rough world, edited over faces and corners of nodes and at the rim.
fn control_world() -> (Terrain, Cut) {
    let mut rng = Rng::with_seed(19);
    let (width, depth) = (75, 70);
    let heights: Vec<f64> = (0..(width + 1) * (depth + 1)).map(|_| rng.f64() * 6.0).collect();
    let height = |x: i32, z: i32| heights[(z * (width as i32 + 1) + x) as usize];
    let ground = Ground::from_fn(width, depth, height).expect("finite heights");
    let mut terrain = Terrain::new(ground, &TerrainSettings { chunk_size: 8, ..Default::default() })
        .expect("valid settings");
    let cut = Cut::random(terrain.world().lod_grid(2), 3, 50);
    let mut brushes: Vec<Brush> =
        (0..12).map(|_| corner_brush(&mut rng, terrain.world().ground(), &cut)).collect();
    let dig = |x: f32, z: f32| Brush::dig(Shape::sphere(Vec3::new(x, 2.0, z), 4.0));
    brushes.extend([9.0, 27.0, 43.0, 69.0].map(|z| dig(75.0, z)));
    brushes.extend([13.0, 36.0, 58.0].map(|x| dig(x, 70.0)));
    terrain.apply(brushes);
    (terrain, cut)
}

fn control(fault: Option<Fault>) -> Counts {
    let (terrain, cut) = control_world();
    let nodes = coarse_nodes(terrain.world(), &cut);
    let counts = examine(terrain.world(), &cut, &nodes, fault);
    println!("{fault:?}: {counts:?}");
    counts
}

#[test]
fn without_a_fault_the_control_world_is_lawful() {
    let counts = control(None);
    assert!(counts.is_lawful() && counts.nonmanifold_edges == 0 && counts.nested > 0, "{counts:?}");
}

#[test]
fn without_rule_7_levels_do_not_meet() {
    for fault in [Fault::StraightSides, Fault::NoZipper, Fault::NoPromotion, Fault::NoSquares] {
        assert!(control(Some(fault)).open > 0, "{fault:?} went unnoticed");
    }
}

#[test]
fn without_rule_8_vertices_move_or_are_lost() {
    assert!(control(Some(Fault::LinearWalls)).open > 0);
    assert!(control(Some(Fault::NoDescent)).lost > 0);
    assert!(control(Some(Fault::OwnDescent)).moved > 0);
}

#[test]
fn without_rule_9_the_rim_opens() {
    for fault in [Fault::WholeCells, Fault::OverTheRim] {
        assert!(control(Some(fault)).open > 0, "{fault:?} went unnoticed");
    }
}

#[test]
fn promoting_whole_nodes_changes_nodes_far_away() {
    assert!(control(Some(Fault::NodePromotion)).apart_redrawn > 0);
}

#[test]
fn walls_in_three_coats_are_noticed() {
    let counts = control(Some(Fault::ThreeCoats));
    assert!(counts.open == 0 && counts.nonmanifold_edges > 0, "{counts:?}");
}

#[test]
fn where_levels_meet_vertices_are_not_each_their_own() {
    let mut jumps = 0;
    for index in 0..40 {
        let (terrain, cut) = random_world(index);
        let view = LodView { fault: Some(Fault::OwnVertices), ..terrain.world().lod_view(&cut) };
        let report = seams(&view, &draw(&view));
        assert!(report.is_closed());
        jumps += usize::from(report.worst_normal_at.is_some());
    }
    assert!(jumps > 0);
}

/// The bricks and words of the mask that a running transaction changes.
fn overlay(world: &World, commit: &Commit) -> (Vec<(BrickPos, Arc<Brick>)>, Mask) {
    let (mut bricks, mut mask) = (BTreeMap::new(), Mask::default());
    for change in commit.outcome.changes.iter().map(|own| &own.change) {
        for (pos, brick) in &change.patch.bricks {
            let pristine = || Arc::new(Brick::pristine(pristine_layers(world.ground(), *pos)));
            bricks.insert(*pos, brick.clone().unwrap_or_else(pristine));
        }
        change.mask.iter().for_each(|&(word, cells)| mask.lay_word(word, cells));
    }
    (bricks.into_iter().collect(), mask)
}

/// Runs the submitted edits, and compares the meshes of the running transaction with those after its commit.
fn check_transaction(terrain: &mut Terrain, cut: &Cut, what: &str) -> [usize; 2] {
    let before = draw(&terrain.world().lod_view(cut));
    let commit = terrain.begin().expect("something waits").run();
    let (bricks, mask) = overlay(terrain.world(), &commit);
    let running = {
        let world = terrain.world();
        let latest: Vec<_> = bricks.iter().map(|(pos, brick)| (*pos, brick.as_ref())).collect();
        let positions: Vec<BrickPos> = bricks.iter().map(|(pos, _)| *pos).collect();
        let samples = world.samples().under(&latest);
        let mask = MaskView::new(world.mask()).over(&mask);
        let view = WorldView { samples, mask, grid: world.grid() };
        let view = LodView::new(view, cut, world.edited_stacks().over(&positions));
        let is_plain: Vec<bool> = cut.nodes().map(|node| lod::is_plain(&view, node)).collect();
        (draw(&view), is_plain)
    };
    terrain.commit(commit).expect("the one under way");
    let view = terrain.world().lod_view(cut);
    let after = draw(&view);
    assert!(running.0 == after, "{what}");
    assert!(cut.nodes().map(|node| lod::is_plain(&view, node)).eq(running.1), "{what}");
    // Nodes that are not near do not change.
    let mut near = FxHashSet::default();
    for (pos, _) in &bricks {
        let samples = pos.samples();
        near.extend(nodes_near(cut, Column::of(samples.min), Column::of(samples.max)));
    }
    let changed: Vec<Node> =
        after.iter().filter(|(node, mesh)| before[*node] != **mesh).map(|own| *own.0).collect();
    assert!(changed.iter().all(|node| near.contains(node)), "{what}: {changed:?}, {near:?}");
    [changed.len(), near.len()]
}

#[test]
fn a_running_transaction_draws_what_is_drawn_after_it() {
    let mut total = [0; 2];
    for index in 0..world_count(40) {
        let (mut terrain, cut) = random_world(index);
        let mut rng = Rng::with_seed(!index);
        for turn in 0..4 {
            if turn == 3 {
                terrain.submit(Order::Undo);
            } else {
                for _ in 0..rng.u32(1..4) {
                    let brush = corner_brush(&mut rng, terrain.world().ground(), &cut);
                    terrain.submit(&brush);
                }
            }
            let [changed, near] =
                check_transaction(&mut terrain, &cut, &format!("world {index}, turn {turn}"));
            total = [total[0] + changed, total[1] + near];
        }
    }
    println!("{} nodes changed, of {} near edits", total[0], total[1]);
    assert!(total[0] > 0);
}
