//! The topology of a mesh: whether it is closed, its components and handles, and its orientation.

use std::collections::HashMap;

use serde::Serialize;

use crate::contender::{Mesh, Sharing};

/// Figures that do not depend on the order of vertices and triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Topology {
    /// Vertices after welding that are used by some triangle.
    pub vertices: usize,
    /// Vertices in the mesher's output.
    pub written: usize,
    /// Triangles.
    pub triangles: usize,
    /// Edges used more often in one direction than in the other. If there are none, the surface is closed.
    pub unbalanced: usize,
    /// Edges of more than two triangles.
    pub crowded: usize,
    /// Triangles with two corners in one vertex.
    pub degenerate: usize,
    /// Connected components.
    pub components: usize,
    /// Vertices minus edges plus triangles: for closed manifolds, twice the components minus twice the handles.
    pub euler: i64,
    /// Whether the signed volume is positive: triangles are counter-clockwise seen from the air.
    pub faces_air: bool,
}

/// Why the topology cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum TopologyError {
    /// A vertex of marching cubes that is not on a lattice edge.
    #[error("vertex {vertex} at {position:?} lies on no edge of the lattice")]
    OffLattice {
        /// Index of the vertex.
        vertex: usize,
        /// Position of the vertex.
        position: [f32; 3],
    },
    /// An index out of range.
    #[error("index {index} of {vertices} vertices")]
    Index {
        /// The index.
        index: u32,
        /// The number of vertices.
        vertices: usize,
    },
}

impl Topology {
    /// Computes the topology. Vertices that are not shared are welded if they lie on the same lattice edge.
    pub fn of(mesh: &Mesh, sharing: Sharing) -> Result<Self, TopologyError> {
        let (written, triangles) = (mesh.positions.len(), welded(mesh, sharing)?);
        let mut pieces = Pieces::new(written);
        // How often an edge is used from its low to its high vertex, and back.
        let mut runs: HashMap<(usize, usize), [u32; 2]> = HashMap::new();
        let mut degenerate = 0;
        for &[a, b, c] in &triangles {
            degenerate += usize::from(a == b || b == c || c == a);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                runs.entry((from.min(to), from.max(to))).or_default()[usize::from(from > to)] += 1;
                pieces.join(from, to);
            }
        }
        let mut used: Vec<usize> = triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        Ok(Self {
            vertices: used.len(),
            written,
            triangles: triangles.len(),
            unbalanced: runs.values().filter(|[there, back]| there != back).count(),
            crowded: runs.values().filter(|[there, back]| there + back > 2).count(),
            degenerate,
            components: used.iter().filter(|&&vertex| pieces.root(vertex) == vertex).count(),
            euler: used.len() as i64 - runs.len() as i64 + triangles.len() as i64,
            faces_air: volume(mesh) >= 0.0,
        })
    }

    /// The total genus of all components, for a closed manifold.
    pub fn genus(&self) -> i64 {
        self.components as i64 - self.euler / 2
    }
}

/// Edges of a chunk's mesh that are used more often in one direction than in the other, except on the chunk's faces,
/// where its neighbours continue. `faces` are the lowest and highest coordinate along each axis.
pub fn open_inside(mesh: &Mesh, sharing: Sharing, faces: [f32; 2]) -> Result<usize, TopologyError> {
    let mut runs: HashMap<(usize, usize), i32> = HashMap::new();
    for [a, b, c] in welded(mesh, sharing)? {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *runs.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
        }
    }
    let is_on_face = |(a, b): (usize, usize)| {
        let (a, b) = (mesh.positions[a], mesh.positions[b]);
        (0..3).any(|axis| faces.contains(&a[axis]) && a[axis] == b[axis])
    };
    Ok(runs.into_iter().filter(|&(edge, more)| more != 0 && !is_on_face(edge)).count())
}

/// The corners of all triangles after welding of unshared vertices on the same lattice edge.
fn welded(mesh: &Mesh, sharing: Sharing) -> Result<Vec<[usize; 3]>, TopologyError> {
    let written = mesh.positions.len();
    if let Some(&index) = mesh.indices.iter().find(|&&index| index as usize >= written) {
        return Err(TopologyError::Index { index, vertices: written });
    }
    let number = match sharing {
        Sharing::Shared => (0..written).collect(),
        Sharing::Partly | Sharing::TriangleSoup => weld(&mesh.positions)?,
    };
    let corners =
        mesh.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(|index| number[index as usize]));
    Ok(corners.collect())
}

/// Six times the volume that a mesh encloses.
fn volume(mesh: &Mesh) -> f64 {
    let corner = |index: u32| mesh.positions[index as usize].map(f64::from);
    let of_triangle = |t: &[u32]| {
        let [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = [corner(t[0]), corner(t[1]), corner(t[2])];
        ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    };
    mesh.indices.chunks_exact(3).map(of_triangle).sum()
}

/// For each vertex, the first one on the same lattice edge.
fn weld(positions: &[[f32; 3]]) -> Result<Vec<usize>, TopologyError> {
    let mut first = HashMap::new();
    let numbered = positions.iter().enumerate().map(|(vertex, &position)| {
        let edge = lattice_edge(position).ok_or(TopologyError::OffLattice { vertex, position })?;
        Ok(*first.entry(edge).or_insert(vertex))
    });
    numbered.collect()
}

/// The axis and lower end of the lattice edge on which a position lies: up to rounding, at most one coordinate is not
/// an integer. Programs round differently, but never to another edge.
fn lattice_edge(position: [f32; 3]) -> Option<(usize, [i32; 3])> {
    const ROUNDING: f32 = 5e-4;
    let off = position.map(|along| (along - along.round()).abs());
    let axis = (0..3).max_by(|&a, &b| off[a].total_cmp(&off[b]))?;
    let on_edge = (0..3).all(|other| other == axis || off[other] < ROUNDING);
    let mut low = position.map(|along| along.round() as i32);
    low[axis] = position[axis].floor() as i32;
    on_edge.then_some((axis, low))
}

/// Connected components of vertices (union-find).
struct Pieces {
    parent: Vec<usize>,
}

impl Pieces {
    fn new(vertices: usize) -> Self {
        Self { parent: (0..vertices).collect() }
    }

    fn root(&mut self, mut vertex: usize) -> usize {
        while self.parent[vertex] != vertex {
            self.parent[vertex] = self.parent[self.parent[vertex]];
            vertex = self.parent[vertex];
        }
        vertex
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
    }
}
