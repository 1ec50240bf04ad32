//! The seam validator: checks that everything drawn together is one closed surface.
//!
//! Vertices are welded where their world positions are the same, which is where the GPU gets the same bits. The outer
//! rim of the world may be open; everything else must be closed, consistently oriented and manifold.

use std::collections::BTreeMap;
use std::fmt;

use glam::{DVec3, I64Vec3, IVec3, Vec3};
use rustc_hash::FxHashMap;

use super::mesh::SurfaceMesh;
use crate::lattice::{ChunkGrid, SNAP};

/// Faults of a drawn surface.
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
    /// Where the largest angle is, in voxels.
    pub worst_normal_at: Option<DVec3>,
    /// A place, in voxels, for each kind of fault that was found.
    pub first: BTreeMap<SeamFault, DVec3>,
}

impl SeamReport {
    /// Returns `true` if every edge off the rim is closed and balanced, and there is a surface at all.
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

/// Triangles of many meshes, welded as they are added.
#[derive(Default)]
pub struct SeamChecker {
    numbers: FxHashMap<I64Vec3, u32>,
    places: Vec<I64Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    worst_normal: Option<(f64, u32)>,
    degenerate: Vec<u32>,
}

impl SeamChecker {
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
        let next = self.places.len() as u32;
        let number = *self.numbers.entry(place).or_insert(next);
        if number == next {
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

    /// Checks everything that was added. The rim of the world, where x or z is at its end, may be open.
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

/// Number of separate strips or rings formed by a vertex's triangles. `fan` holds (vertex, next, last) of each.
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
            // Neighbours around the vertex share an edge; whether both run it the same way is another matter.
            let ((_, a, b), (_, c, d)) = (fan[i], fan[j]);
            if a == d || b == c || a == c || b == d {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Indices, MaterialMix, Vertex};

    /// Corners of two tetrahedra around the first one, and the middle of an edge; in voxels.
    const CORNERS: [[i32; 3]; 8] = [
        [20, 20, 20],
        [24, 20, 20],
        [20, 24, 20],
        [20, 20, 24],
        [22, 20, 20],
        [16, 20, 20],
        [20, 16, 20],
        [20, 20, 16],
    ];

    /// The faces of a tetrahedron.
    fn body([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 4] {
        [[a, c, b], [a, b, d], [b, c, d], [c, a, d]]
    }

    fn mesh(corners: &[[i32; 3]], triangles: &[[u32; 3]]) -> SurfaceMesh {
        let vertex = |&corner: &[i32; 3]| Vertex {
            position: IVec3::from_array(corner) * SNAP,
            normal: Vec3::Y,
            materials: MaterialMix::default(),
        };
        let vertices: Vec<Vertex> = corners.iter().map(vertex).collect();
        SurfaceMesh { indices: Indices::new(vertices.len(), triangles.as_flattened().to_vec()), vertices }
    }

    /// In a world of 64 x 48 cells.
    fn report(meshes: &[(&SurfaceMesh, IVec3)]) -> SeamReport {
        let mut checker = SeamChecker::default();
        meshes.iter().for_each(|&(mesh, origin)| checker.add(mesh, origin));
        checker.check(ChunkGrid::new(32, 64, 48))
    }

    /// How many faults of each kind there are; there is a place for those and no others.
    fn counts(report: &SeamReport) -> [usize; 5] {
        let all = [
            (SeamFault::Open, report.open),
            (SeamFault::Unbalanced, report.unbalanced),
            (SeamFault::NonManifoldEdge, report.nonmanifold_edges),
            (SeamFault::NonManifoldVertex, report.nonmanifold_vertices),
            (SeamFault::Degenerate, report.degenerate),
        ];
        let found = all.iter().filter(|(_, count)| *count > 0).map(|(fault, _)| fault);
        assert!(report.first.keys().eq(found), "{report}");
        all.map(|(_, count)| count)
    }

    #[test]
    fn a_closed_body_is_flawless() {
        let found = report(&[(&mesh(&CORNERS, &body([0, 1, 2, 3])), IVec3::ZERO)]);
        assert!(found.is_flawless() && found.is_closed(), "{found}");
        assert_eq!(counts(&found), [0; 5]);
        // Vertices that no triangle has count nothing.
        assert_eq!([found.triangles, found.vertices, found.edges], [4, 4, 6]);
        assert_eq!((found.euler, found.worst_normal_at), (2, None));
        assert!(!report(&[]).is_closed(), "an empty list is not a surface");
    }

    #[test]
    fn each_fault_is_found_and_no_other() {
        let whole = body([0, 1, 2, 3]);
        let [bottom, side, slope, back] = whole;
        // Open, unbalanced, edges and vertices that are not manifold, triangles without area.
        for (what, triangles, expected) in [
            ("a face is missing", vec![bottom, side, slope], [3, 3, 0, 0, 0]),
            ("a face looks inwards", vec![bottom, [0, 3, 1], slope, back], [0, 3, 0, 0, 0]),
            ("a face is there twice", vec![bottom, side, side, slope, back], [0, 3, 3, 0, 0]),
            ("two bodies share an edge", [whole, body([0, 1, 6, 7])].concat(), [0, 0, 1, 0, 0]),
            ("two bodies share a corner", [whole, body([0, 5, 6, 7])].concat(), [0, 0, 0, 1, 0]),
            ("a vertex hangs on an edge", vec![bottom, [0, 4, 3], [4, 1, 3], slope, back], [3, 3, 0, 0, 0]),
            (
                "a triangle is a line, and closes that gap",
                vec![bottom, [0, 4, 3], [4, 1, 3], [0, 1, 4], slope, back],
                [0, 0, 0, 0, 1],
            ),
            ("a triangle has a corner twice", [&whole[..], &[[0, 0, 1]]].concat(), [0, 0, 0, 0, 1]),
        ] {
            let report = report(&[(&mesh(&CORNERS, &triangles), IVec3::ZERO)]);
            assert_eq!(counts(&report), expected, "{what}: {report}");
            assert!(!report.is_flawless() && report.worst_normal_at.is_none(), "{what}");
            assert_eq!(report.is_closed(), expected[..2] == [0, 0], "{what}");
        }
    }

    #[test]
    fn faults_are_where_they_are_said_to_be() {
        let [bottom, side, slope, _] = body([0, 1, 2, 3]);
        let report = report(&[(&mesh(&CORNERS, &[bottom, side, slope]), IVec3::X)]);
        let middle = DVec3::new(21.0, 22.0, 20.0);
        assert_eq!(report.first[&SeamFault::Open], middle);
        assert!(report.to_string().contains("3 open"), "{report}");
        assert!(report.to_string().contains("first Open at (21, 22, 20)"), "{report}");
    }

    #[test]
    fn meshes_are_welded_where_they_meet_to_the_step() {
        let [bottom, side, slope, back] = body([0, 1, 2, 3]);
        let by = IVec3::new(7, -9, 4);
        let moved = CORNERS.map(|corner| (IVec3::from_array(corner) - by).to_array());
        let (first, mut second) = (mesh(&CORNERS, &[bottom, side]), mesh(&moved, &[slope, back]));
        assert!(report(&[(&first, IVec3::ZERO), (&second, by)]).is_flawless());
        // Both edges of the gap's one side, and both of its other.
        second.vertices[3].position.x += 1;
        let torn = report(&[(&first, IVec3::ZERO), (&second, by)]);
        assert_eq!((torn.vertices, torn.open), (5, 4), "{torn}");
    }

    #[test]
    fn only_the_rim_of_the_world_may_be_open() {
        let sheet =
            |corners: [[i32; 3]; 4]| report(&[(&mesh(&corners, &[[0, 1, 2], [0, 2, 3]]), IVec3::ZERO)]);
        let [width, depth] = [64, 48];
        let whole = [[0, 0, 0], [0, 5, depth], [width, 9, depth], [width, 3, 0]];
        assert!(sheet(whole).is_flawless());
        // A sheet that ends one voxel before, on each side.
        let sides = [([0, 1], IVec3::X), ([1, 2], -IVec3::Z), ([2, 3], -IVec3::X), ([3, 0], IVec3::Z)];
        for (corners, by) in sides {
            let mut short = whole;
            for corner in corners {
                short[corner] = (IVec3::from_array(short[corner]) + by).to_array();
            }
            assert_eq!(counts(&sheet(short)), [1, 1, 0, 0, 0], "{by}");
        }
        // An edge from one side of the rim to another one lies in neither.
        for (x, z) in [(0, 0), (0, depth), (width, 0), (width, depth)] {
            let inwards = |at: i32| if at == 0 { 5 } else { at - 5 };
            let corners = [[x, 0, z], [inwards(x), 0, z], [x, 0, inwards(z)]];
            let report = report(&[(&mesh(&corners, &[[0, 1, 2]]), IVec3::ZERO)]);
            assert_eq!(counts(&report), [1, 1, 0, 0, 0], "{x} {z}");
        }
    }

    #[test]
    fn the_worst_jump_between_normals_is_found() {
        let [bottom, side, slope, back] = body([0, 1, 2, 3]);
        let (first, mut second) = (mesh(&CORNERS, &[bottom, side]), mesh(&CORNERS, &[slope, back]));
        // Equal, if not by their bits.
        second.vertices[1].normal = Vec3::new(-0.0, 1.0, -0.0);
        let both = |second: &SurfaceMesh| report(&[(&first, IVec3::ZERO), (second, IVec3::ZERO)]);
        assert!(both(&second).is_flawless());
        let tilted = |degrees: f32| Vec3::new(degrees.to_radians().sin(), degrees.to_radians().cos(), 0.0);
        (second.vertices[2].normal, second.vertices[3].normal) = (tilted(10.0), tilted(30.0));
        let report = both(&second);
        assert!((report.worst_normal_jump - 30.0).abs() < 1e-3, "{report}");
        assert_eq!(report.worst_normal_at, Some(DVec3::new(20.0, 20.0, 24.0)));
        assert!(report.is_closed() && !report.is_flawless());
        assert_eq!(counts(&report), [0; 5]);
    }
}
