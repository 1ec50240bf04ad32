//! Draws a cut and counts its faults.

use std::collections::BTreeMap;

use bevy_burrow::lattice::SNAP;
use bevy_burrow::lod::{Cut, Node};
use bevy_burrow::surface::{SeamChecker, SurfaceMesh, Vertex};
use bevy_burrow::terrain::World;
use glam::{I64Vec3, IVec3};
use rustc_hash::FxHashMap;

use crate::random::levels_around;

/// The meshes of all nodes.
pub type Drawings = BTreeMap<Node, SurfaceMesh>;

pub fn draw(world: &World, cut: &Cut) -> Drawings {
    world.drawn_in(cut).collect()
}

/// Counts of drawn triangles and of faults.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    pub worlds: usize,
    pub triangles: usize,
    /// Triangles of nodes above level 0.
    pub coarse: usize,
    pub open: usize,
    pub unbalanced: usize,
    /// Triangles two of whose corners are one.
    pub collapsed: usize,
    /// Triangles without area that do not lie in a plane between levels.
    pub flat: usize,
    pub nonmanifold_edges: usize,
    /// Non-manifold edges that do not lie over an alternating corner.
    pub stray: usize,
    /// Vertices at one place with different normals.
    pub normal_jumps: usize,
    /// Vertices at one place with different materials.
    pub material_jumps: usize,
}

impl Counts {
    pub fn add(&mut self, other: &Self) {
        self.worlds += other.worlds;
        self.triangles += other.triangles;
        self.coarse += other.coarse;
        self.open += other.open;
        self.unbalanced += other.unbalanced;
        self.collapsed += other.collapsed;
        self.flat += other.flat;
        self.nonmanifold_edges += other.nonmanifold_edges;
        self.stray += other.stray;
        self.normal_jumps += other.normal_jumps;
        self.material_jumps += other.material_jumps;
    }

    pub fn is_flawless(&self) -> bool {
        let faults = [self.open, self.unbalanced, self.collapsed, self.flat, self.stray, self.normal_jumps];
        self.triangles > 0 && faults == [0; 6]
    }
}

/// Counts what is wrong with the drawings of a cut.
pub fn check(world: &World, cut: &Cut, drawings: &Drawings) -> Counts {
    let (mut checker, mut counts) = (SeamChecker::default(), Counts { worlds: 1, ..Counts::default() });
    let mut first: FxHashMap<IVec3, Vertex> = FxHashMap::default();
    let mut edges: FxHashMap<[IVec3; 2], usize> = FxHashMap::default();
    for (node, mesh) in drawings {
        let origin = cut.grid().columns(*node).0.at(0);
        checker.add(mesh, origin);
        counts.coarse += if node.level > 0 { mesh.indices.len() / 3 } else { 0 };
        for triangle in mesh.triangles() {
            let places = triangle.map(|vertex| vertex.position + origin * SNAP);
            for (place, vertex) in places.into_iter().zip(triangle) {
                let other = *first.entry(place).or_insert(vertex);
                let bits = |vertex: Vertex| vertex.normal.to_array().map(|part| (part + 0.0).to_bits());
                if bits(other) != bits(vertex) {
                    if counts.normal_jumps == 0 {
                        println!(
                            "normals {} and {} at {}",
                            other.normal,
                            vertex.normal,
                            place.as_dvec3() / 4096.0
                        );
                    }
                    counts.normal_jumps += 1;
                }
                counts.material_jumps += usize::from(other.materials != vertex.materials);
            }
            let [a, b, c] = places;
            counts.collapsed += usize::from(a == b || b == c || c == a);
            let [ab, ac] = [b - a, c - a].map(|side| side.as_i64vec3());
            counts.flat += usize::from(ab.cross(ac) == I64Vec3::ZERO && !is_between_levels(cut, places));
            for [u, v] in [[a, b], [b, c], [c, a]] {
                let edge = if u.to_array() < v.to_array() { [u, v] } else { [v, u] };
                *edges.entry(edge).or_default() += 1;
            }
        }
    }
    let pinched = edges.iter().filter(|(_, uses)| **uses > 2);
    counts.stray = pinched.filter(|(edge, _)| !edge.iter().all(|&end| is_alternating(cut, end))).count();
    let report = checker.check(world.grid());
    if !report.is_closed() {
        println!("{report}");
    }
    counts.triangles = report.triangles;
    counts.open = report.open;
    counts.unbalanced = report.unbalanced;
    counts.nonmanifold_edges = report.nonmanifold_edges;
    counts
}

/// Returns `true` if the corners lie in one plane between nodes of different levels.
fn is_between_levels(cut: &Cut, corners: [IVec3; 3]) -> bool {
    let [a, b, c] = corners.map(|corner| [corner.x, corner.z]);
    let middle = |axis: usize| a[axis].min(b[axis]).min(c[axis]).midpoint(a[axis].max(b[axis]).max(c[axis]));
    (0..2).any(|axis| {
        let is_plane = a[axis] == b[axis] && b[axis] == c[axis] && a[axis] % SNAP == 0;
        let mut at = [a[0], a[1]];
        at[1 - axis] = middle(1 - axis);
        let [x, z] = at.map(|at| at.div_euclid(SNAP));
        let around = levels_around(cut, x, z);
        is_plane && if axis == 0 { around[2] != around[3] } else { around[1] != around[3] }
    })
}

/// Returns `true` if four nodes meet here whose levels go fine, coarse, fine, coarse.
fn is_alternating(cut: &Cut, place: IVec3) -> bool {
    let [a, b, c, d] = levels_around(cut, place.x.div_euclid(SNAP), place.z.div_euclid(SNAP));
    (place.x | place.z) % SNAP == 0 && a == d && b == c && a != b && a.is_some() && b.is_some()
}
