//! Triangles of the published scheme CDLOD (F. Strugar, "Continuous Distance-Dependent Level of Detail for Rendering
//! Heightmaps", Journal of Graphics, GPU, and Game Tools 14(4), 2009) compared with those of a cut, for the same
//! ground, eye and limits.
//!
//! CDLOD draws a node of its quadtree as a grid of fixed size. A level is drawn within a range around the eye that
//! doubles from level to level; where a node reaches into the range of the next finer level, only quarters of it are
//! drawn, with a quarter of the grid each. Ranges are the same everywhere, so they follow from the greatest error that
//! a level has anywhere. Nodes beyond the view are not drawn. Its morphing costs no triangles and is left out:
//! with it, ranges would be larger.

use bevy_burrow::lod::{Cut, LodGrid, LodSettings, Node};
use bevy_burrow::terrain::{GroundFacts, World};
use glam::{Vec2, Vec3, Vec3Swizzles};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

/// Most nodes along each side, evenly spread, from which the greatest error of a level is taken.
const SAMPLES: i32 = 24;

/// CDLOD's quadtree over a world.
struct Quadtree<'a> {
    world: &'a World,
    grid: LodGrid,
    eye: Vec3,
    /// How far each level is drawn, from level 0 on.
    ranges: Vec<f32>,
    heights: FxHashMap<Node, [f32; 2]>,
    /// Nodes and quarters that are drawn, and their triangles.
    drawn: [usize; 2],
}

impl Quadtree<'_> {
    /// Selects the grids of a node; returns `false` if it is beyond the range of its level.
    fn select(&mut self, node: Node, level: usize) -> bool {
        if !self.grid.has(node) {
            return true;
        }
        let distance = self.distance(node);
        if distance > self.ranges[level] {
            return false;
        }
        let size = self.grid.chunks().size() as usize;
        let whole = 2 * size * size;
        let Some(children) = node.children().filter(|_| distance <= self.ranges[level - 1]) else {
            self.draw(whole);
            return true;
        };
        for child in children {
            if !self.select(child, level - 1) {
                self.draw(whole / 4);
            }
        }
        true
    }

    fn draw(&mut self, triangles: usize) {
        self.drawn = [self.drawn[0] + 1, self.drawn[1] + triangles];
    }

    /// From the eye to the box around a node.
    fn distance(&mut self, node: Node) -> f32 {
        let (low, high) = self.grid.columns(node);
        let heights = self.heights.entry(node);
        let facts = || GroundFacts::new(self.world.ground(), self.grid, node).heights;
        let [bottom, top] = *heights.or_insert_with(facts);
        let low = Vec3::new(low.x as f32, bottom, low.z as f32);
        self.eye.distance(self.eye.clamp(low, Vec3::new(high.x as f32, top, high.z as f32)))
    }
}

/// The greatest error of each level, of nodes that are evenly spread; 0 at level 0.
fn greatest_errors(world: &World, grid: LodGrid) -> Vec<f32> {
    let greatest = |level: u8| {
        let step = |tiles: i32| (((tiles - 1) >> level) / SAMPLES + 1) as usize;
        let (across, down) = grid.chunks().tile_counts();
        let places = |tiles: i32| (0..=(tiles - 1) >> level).step_by(step(tiles));
        let nodes: Vec<Node> =
            places(down).flat_map(|z| places(across).map(move |x| Node { level, x, z })).collect();
        let errors = nodes.par_iter().map(|&node| GroundFacts::new(world.ground(), grid, node).error);
        if level == 0 { 0.0 } else { errors.reduce(|| 0.0, f32::max) }
    };
    (0..=grid.top()).map(greatest).collect()
}

/// How far level 0 is drawn: where level 1 begins, its error or its cells are within the limits, and so for the levels
/// above, each at twice the distance.
fn first_range(errors: &[f32], choice: &LodSettings, pixels: f32) -> f32 {
    let by_error = errors.iter().zip(0..).skip(1).map(|(error, level)| {
        let distance = error * pixels / choice.error_pixels;
        distance / (1u64 << (level - 1)) as f32
    });
    let by_cells = 2.0 * pixels / choice.cell_pixels;
    by_error.fold(0.0, f32::max).min(by_cells)
}

/// Returns `true` if a node of a cut lies within the view, at least in part.
fn is_in_view(cut: &Cut, node: Node, eye: Vec3, view: f32) -> bool {
    let (low, high) = cut.grid().columns(node);
    let [low, high] = [low, high].map(|column| Vec2::new(column.x as f32, column.z as f32));
    eye.xz().distance(eye.xz().clamp(low, high)) <= view
}

/// Prints triangles all round, within the view, for views of 0.5 to 16 km.
pub fn compare(world: &World, summit: Vec3) {
    let grid = world.lod_grid(u8::MAX);
    let errors = greatest_errors(world, grid);
    let first = first_range(&errors, &LodSettings::default(), super::PIXELS);
    println!("\nCDLOD: greatest errors by level {errors:.1?} voxels, so level 0 reaches {first:.0} voxels");
    println!(
        "\n| view, km | meshes | triangles, millions | CDLOD: grids drawn | triangles, millions | ratio |"
    );
    println!("| --- | --- | --- | --- | --- | --- |");
    let mut heights = FxHashMap::default();
    for view in [0.5, 1.0, 2.0, 4.0, 8.0, 16.0].map(|km: f32| km * 1000.0) {
        let choice = LodSettings { view_distance: view, ..LodSettings::default() };
        let cut = super::cut_for(world, &choice, super::eye(summit));
        let nodes: Vec<Node> = cut.nodes().filter(|&node| is_in_view(&cut, node, summit, view)).collect();
        let own: usize = nodes.par_iter().map(|&node| world.node_mesh(&cut, node).indices.len() / 3).sum();
        // The coarsest level is drawn as far as the view.
        let ranges = (0..=grid.top()).map(|level| match level {
            level if level == grid.top() => view,
            level => (first * (1u64 << level) as f32).min(view),
        });
        let ranges = ranges.collect();
        let mut tree = Quadtree { world, grid, eye: summit, ranges, heights, drawn: [0; 2] };
        for root in grid.roots() {
            tree.select(root, usize::from(grid.top()));
        }
        let [grids, triangles] = tree.drawn;
        let [millions, others] = [own, triangles].map(|triangles| triangles as f64 / 1e6);
        println!(
            "| {} | {} | {millions:.3} | {grids} | {others:.3} | {:.2} |",
            view / 1000.0,
            nodes.len(),
            others / millions
        );
        heights = tree.heights;
    }
}
