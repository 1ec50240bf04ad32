//! The seam validator: is everything that is drawn, together, one closed surface?
//!
//! Vertices are welded where their world positions are the same, which is where the GPU gets the same bits. The outer
//! rim of the world may be open; everything else must be closed, consistently oriented and manifold.

use std::collections::BTreeMap;
use std::fmt;

use glam::{DVec3, I64Vec3, IVec3, Vec3};
use rustc_hash::FxHashMap;

use super::mesh::SurfaceMesh;
use crate::lattice::{ChunkGrid, SNAP};

/// What may be wrong with a drawn surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum SeamFault {
    /// An edge with one triangle only, away from the rim.
    Open,
    /// An edge run through more often one way than the other, away from the rim.
    Unbalanced,
    /// An edge with more than two triangles.
    NonManifoldEdge,
    /// A vertex at which separate sheets touch.
    NonManifoldVertex,
    /// A triangle without area.
    Degenerate,
}

/// The counts of a surface, and where the first fault of each kind is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SeamReport {
    /// Triangles, degenerate ones left out.
    pub triangles: usize,
    /// Vertices after welding.
    pub vertices: usize,
    /// Edges after welding.
    pub edges: usize,
    /// Edges with one triangle only, away from the rim.
    pub open: usize,
    /// Edges run through more often one way than the other, away from the rim.
    pub unbalanced: usize,
    /// Edges with more than two triangles.
    pub nonmanifold_edges: usize,
    /// Vertices at which separate sheets touch.
    pub nonmanifold_vertices: usize,
    /// Triangles without area.
    pub degenerate: usize,
    /// Vertices - edges + triangles.
    pub euler: i64,
    /// Largest angle between the normals of vertices at one place, degrees.
    pub worst_normal_jump: f64,
    /// Where that is, in voxels.
    pub worst_normal_at: Option<DVec3>,
    /// A place, in voxels, for each kind of fault that was found.
    pub first: BTreeMap<SeamFault, DVec3>,
}

impl SeamReport {
    /// Is every edge off the rim closed and balanced, and is there a surface at all?
    pub fn is_closed(&self) -> bool {
        self.triangles > 0 && self.open == 0 && self.unbalanced == 0
    }

    /// Closed, manifold, without degenerate triangles, and shaded without a jump.
    pub fn is_flawless(&self) -> bool {
        self.is_closed() && self.first.is_empty() && self.worst_normal_at.is_none()
    }
}

impl fmt::Display for SeamReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} triangles: {} open, {} unbalanced, {} non-manifold edges, {} non-manifold vertices, {} degenerate, \
             Euler characteristic {}, worst normal jump {:.3} degrees",
            self.triangles,
            self.open,
            self.unbalanced,
            self.nonmanifold_edges,
            self.nonmanifold_vertices,
            self.degenerate,
            self.euler,
            self.worst_normal_jump
        )?;
        if let Some(place) = self.worst_normal_at {
            write!(f, " at ({}, {}, {})", place.x, place.y, place.z)?;
        }
        for (fault, place) in &self.first {
            write!(f, "; first {fault:?} at ({}, {}, {})", place.x, place.y, place.z)?;
        }
        Ok(())
    }
}

/// Triangles of many meshes, welded as they come in.
#[derive(Default)]
pub struct SeamSoup {
    numbers: FxHashMap<I64Vec3, u32>,
    places: Vec<I64Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    worst_normal: Option<(f64, u32)>,
    degenerate: Vec<u32>,
}

impl SeamSoup {
    /// Adds a mesh that is drawn at lattice point `origin`.
    pub fn add(&mut self, mesh: &SurfaceMesh, origin: IVec3) {
        let origin = origin.as_i64vec3() * i64::from(SNAP);
        // Only what is drawn: tiles keep the vertices of columns that the mask took from them.
        let mut numbers = vec![None; mesh.vertices.len()];
        for triangle in mesh.indices.triangles() {
            let [a, b, c] = [0, 1, 2].map(|i| {
                let index = triangle[i] as usize;
                *numbers[index].get_or_insert_with(|| {
                    let vertex = mesh.vertices[index];
                    self.weld(origin + vertex.position.as_i64vec3(), vertex.normal)
                })
            });
            let [pa, pb, pc] = [a, b, c].map(|n| self.places[n as usize]);
            if (pb - pa).cross(pc - pa) == I64Vec3::ZERO {
                self.degenerate.push(a);
            }
            // A triangle with a repeated vertex covers nothing, and its edges cancel; a flat one still links its edges.
            if a != b && b != c && c != a {
                self.triangles.push([a, b, c]);
            }
        }
    }

    fn weld(&mut self, place: I64Vec3, normal: Vec3) -> u32 {
        let fresh = self.places.len() as u32;
        let number = *self.numbers.entry(place).or_insert(fresh);
        if number == fresh {
            self.places.push(place);
            self.normals.push(normal);
        } else if self.normals[number as usize] != normal {
            let unit = |normal: Vec3| normal.as_dvec3().normalize_or_zero();
            let cosine = unit(self.normals[number as usize]).dot(unit(normal));
            if self.worst_normal.is_none_or(|(worst, _)| cosine < worst) {
                self.worst_normal = Some((cosine, number));
            }
        }
        number
    }

    /// Checks everything added so far. The rim of the world, where x or z is at its end, may be open.
    pub fn check(&self, grid: ChunkGrid) -> SeamReport {
        let mut report = SeamReport {
            triangles: self.triangles.len(),
            degenerate: self.degenerate.len(),
            ..SeamReport::default()
        };
        let voxels = |number: u32| self.places[number as usize].as_dvec3() / f64::from(SNAP);
        if let Some((cosine, number)) = self.worst_normal {
            report.worst_normal_jump = cosine.clamp(-1.0, 1.0).acos().to_degrees();
            report.worst_normal_at = Some(voxels(number));
        }
        if let Some(&number) = self.degenerate.first() {
            report.first.insert(SeamFault::Degenerate, voxels(number));
        }
        // All triangle sides, sorted by edge: lower vertex, higher vertex, direction, triangle corner before.
        let mut sides: Vec<(u32, u32, bool)> = Vec::with_capacity(self.triangles.len() * 3);
        let mut corners: Vec<(u32, u32, u32)> = Vec::with_capacity(self.triangles.len() * 3);
        for &[a, b, c] in &self.triangles {
            for (u, v, w) in [(a, b, c), (b, c, a), (c, a, b)] {
                sides.push((u.min(v), u.max(v), u < v));
                corners.push((u, v, w));
            }
        }
        sides.sort_unstable();
        for edge in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            report.edges += 1;
            let (u, v, _) = edge[0];
            let forward = edge.iter().filter(|side| side.2).count();
            let inner = !self.on_rim(u, v, grid);
            let middle = (voxels(u) + voxels(v)) / 2.0;
            let mut found = |is: bool, count: &mut usize, fault| {
                if is {
                    *count += 1;
                    report.first.entry(fault).or_insert(middle);
                }
            };
            found(inner && edge.len() == 1, &mut report.open, SeamFault::Open);
            found(inner && forward * 2 != edge.len(), &mut report.unbalanced, SeamFault::Unbalanced);
            found(edge.len() > 2, &mut report.nonmanifold_edges, SeamFault::NonManifoldEdge);
        }
        corners.sort_unstable();
        for fan in corners.chunk_by(|a, b| a.0 == b.0) {
            report.vertices += 1;
            if links(fan) > 1 {
                report.nonmanifold_vertices += 1;
                report.first.entry(SeamFault::NonManifoldVertex).or_insert_with(|| voxels(fan[0].0));
            }
        }
        report.euler = report.vertices as i64 - report.edges as i64 + report.triangles as i64;
        report
    }

    /// An edge is on the rim when both its ends lie on the same outer side of the world.
    fn on_rim(&self, u: u32, v: u32, grid: ChunkGrid) -> bool {
        let (u, v) = (self.places[u as usize], self.places[v as usize]);
        let (width, depth) =
            (i64::from(grid.width()) * i64::from(SNAP), i64::from(grid.depth()) * i64::from(SNAP));
        let both = |at: i64, u: i64, v: i64| u == at && v == at;
        both(0, u.x, v.x) || both(width, u.x, v.x) || both(0, u.z, v.z) || both(depth, u.z, v.z)
    }
}

/// In how many separate strips or rings do a vertex's triangles lie? `fan` holds (vertex, next, last) of each.
fn links(fan: &[(u32, u32, u32)]) -> usize {
    let mut parent: Vec<usize> = (0..fan.len()).collect();
    fn root(parent: &mut [usize], mut at: usize) -> usize {
        while parent[at] != at {
            parent[at] = parent[parent[at]];
            at = parent[at];
        }
        at
    }
    let mut groups = fan.len();
    for i in 0..fan.len() {
        for j in i + 1..fan.len() {
            // Neighbours around the vertex share an outgoing edge of one and the incoming edge of the other.
            if fan[i].1 == fan[j].2 || fan[i].2 == fan[j].1 {
                let (a, b) = (root(&mut parent, i), root(&mut parent, j));
                if a != b {
                    parent[a] = b;
                    groups -= 1;
                }
            }
        }
    }
    groups
}
