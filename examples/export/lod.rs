//! The world as a cut of its quadtree draws it: what an eye would see, or a random cut.

use std::cell::RefCell;
use std::collections::HashMap;

use bevy_burrow::lod::{Cut, LodSettings, Node, NodeFacts, View, Viewpoint};
use bevy_burrow::surface::{SeamChecker, SeamReport, SurfaceMesh};
use bevy_burrow::terrain::World;
use glam::Vec3;
use serde::Serialize;

use crate::Args;

/// Vertical angle of view of the eye, in degrees.
const ANGLE: f32 = 45.0;

/// In a random cut, this many of a hundred nodes are split that could be.
const SPLIT: u64 = 60;

/// A cut, and all that it draws.
pub struct Levels {
    pub cut: Cut,
    pub nodes: Vec<(Node, SurfaceMesh)>,
}

/// Figures of the drawn mesh at one level.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct LevelFigures {
    pub level: u8,
    /// Voxels along a cell.
    pub stride: i32,
    pub nodes: usize,
    pub triangles: usize,
}

impl Levels {
    /// The cut that was asked for; `None` if the world is drawn in full.
    pub fn new(args: &Args, world: &World) -> Option<Self> {
        let grid = world.lod_grid(u8::MAX);
        let cut = match (&args.eye[..], args.random_cut) {
            (&[x, y, z], _) => {
                let pixels = args.screen_height as f32 / (2.0 * (ANGLE / 2.0).to_radians().tan());
                let eye = Viewpoint {
                    position: Vec3::new(x, y, z),
                    velocity: Vec3::ZERO,
                    pixels,
                    view: View::Perspective,
                };
                // Asked more than once where limits grow.
                let known: RefCell<HashMap<Node, NodeFacts>> = RefCell::default();
                let facts =
                    |node| *known.borrow_mut().entry(node).or_insert_with(|| world.node_facts(grid, node));
                LodSettings::default().cut(&Cut::coarsest(grid), &[eye], facts)
            }
            (_, Some(seed)) => Cut::random(grid, seed, SPLIT),
            _ => return None,
        };
        let nodes = world.drawn_in(&cut).collect();
        Some(Self { cut, nodes })
    }

    /// Checks that all of it is one closed surface.
    pub fn check_seams(&self, world: &World) -> SeamReport {
        let mut checker = SeamChecker::default();
        for (node, mesh) in &self.nodes {
            checker.add(mesh, self.cut.grid().columns(*node).0.at(0));
        }
        checker.check(world.grid())
    }

    /// Nodes and triangles by level, for all levels that there may be.
    pub fn figures(&self) -> Vec<LevelFigures> {
        let levels = 0..=self.cut.grid().top();
        let mut figures: Vec<LevelFigures> = levels
            .map(|level| LevelFigures { level, stride: 1 << level, ..LevelFigures::default() })
            .collect();
        for (node, mesh) in &self.nodes {
            let own = &mut figures[usize::from(node.level)];
            own.nodes += 1;
            own.triangles += mesh.indices.len() / 3;
        }
        figures
    }
}
