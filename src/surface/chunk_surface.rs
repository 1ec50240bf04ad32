//! The surface of one chunk: the parts of its blocks, assembled to one mesh.

use crate::surface::meshed_blocks::MeshedBlock;
use crate::surface::{Indices, SurfaceMesh};

/// The marching cubes surface of one chunk: one mesh, with the position of each block's part.
#[derive(Clone, Debug, Default)]
pub struct ChunkSurface {
    mesh: SurfaceMesh,
    /// In order of their bricks.
    parts: Vec<Part>,
}

/// A block's part of the mesh.
#[derive(Clone, Copy, Debug)]
struct Part {
    key: PartKey,
    /// Where the part's vertices end; they begin where those of the part before end.
    vertices: usize,
    /// Where the part's indices end.
    indices: usize,
}

/// A brick's position in [layer order](crate::lattice::BrickPos::layer_order): the order of parts.
pub(crate) type PartKey = [i32; 3];

/// A part that was meshed again. Without indices, the part is removed.
#[derive(Clone, Copy)]
pub(crate) struct FreshPart<'a> {
    pub key: PartKey,
    pub part: MeshedBlock<'a>,
}

/// Where the data of a part begins: vertices, indices.
type Start = (usize, usize);

impl ChunkSurface {
    /// The chunk's mesh, relative to its lowest lattice point.
    pub fn mesh(&self) -> &SurfaceMesh {
        &self.mesh
    }

    /// Returns `true` if the chunk draws nothing.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    fn start(&self, part: usize) -> Start {
        part.checked_sub(1).map_or((0, 0), |before| (self.parts[before].vertices, self.parts[before].indices))
    }

    /// The number of the part with a key.
    fn find(&self, key: PartKey) -> Option<usize> {
        self.parts.binary_search_by(|part| part.key.cmp(&key)).ok()
    }

    /// The surface with these parts, in order, in place of old ones; others are copied. `None` where that changes
    /// nothing.
    pub(crate) fn updated<'a>(&self, fresh: impl Iterator<Item = FreshPart<'a>>) -> Option<Self> {
        let changes: Vec<FreshPart> = fresh.filter(|part| self.differs(part)).collect();
        if changes.is_empty() {
            return None;
        }
        let (mut parts, mut vertices, mut indices) =
            (self.parts.len(), self.mesh.vertices.len(), self.mesh.indices.len());
        for change in &changes {
            if let Some(at) = self.find(change.key) {
                let (part, (vertex, index)) = (self.parts[at], self.start(at));
                (parts, vertices, indices) =
                    (parts - 1, vertices - (part.vertices - vertex), indices - (part.indices - index));
            }
            if !change.part.indices.is_empty() {
                (parts, vertices, indices) =
                    (parts + 1, vertices + change.part.vertices.len(), indices + change.part.indices.len());
            }
        }
        let mut new = Self::default();
        new.parts.reserve_exact(parts);
        new.mesh.vertices.reserve_exact(vertices);
        new.mesh.indices = Indices::with_capacity(vertices, indices);
        let mut kept = 0;
        for change in &changes {
            let upto = kept + self.parts[kept..].partition_point(|part| part.key < change.key);
            new.copy(self, kept, upto);
            new.add(change);
            let is_replaced = self.parts.get(upto).is_some_and(|part| part.key == change.key);
            kept = upto + usize::from(is_replaced);
        }
        new.copy(self, kept, self.parts.len());
        Some(new)
    }

    /// Returns `true` if a part differs from the one with its key, or if there is none with it.
    fn differs(&self, fresh: &FreshPart) -> bool {
        let Some(at) = self.find(fresh.key) else {
            return !fresh.part.indices.is_empty();
        };
        let ((vertex, index), part) = (self.start(at), self.parts[at]);
        !fresh.part.vertices.are_same(&self.mesh.vertices[vertex..part.vertices])
            || !self.mesh.indices.is_part(index..part.indices, fresh.part.indices, vertex)
    }

    /// Appends parts of another surface as they are.
    fn copy(&mut self, from: &Self, first: usize, end: usize) {
        if first == end {
            return;
        }
        let ((vertex, index), (vertex_end, index_end)) = (from.start(first), from.start(end));
        let vertices = |at: usize, by: usize| at - vertex + by;
        let (v, i) = (self.mesh.vertices.len(), self.mesh.indices.len());
        self.mesh.vertices.extend_from_slice(&from.mesh.vertices[vertex..vertex_end]);
        self.mesh.indices.extend_moved(&from.mesh.indices, index..index_end, vertex, v);
        let shift = |part: &Part| Part {
            key: part.key,
            vertices: vertices(part.vertices, v),
            indices: part.indices - index + i,
        };
        self.parts.extend(from.parts[first..end].iter().map(shift));
    }

    fn add(&mut self, fresh: &FreshPart) {
        if fresh.part.indices.is_empty() {
            return;
        }
        self.mesh.indices.extend_from_part(fresh.part.indices, self.mesh.vertices.len());
        fresh.part.vertices.append_to(&mut self.mesh.vertices);
        let (vertices, indices) = (self.mesh.vertices.len(), self.mesh.indices.len());
        self.parts.push(Part { key: fresh.key, vertices, indices });
    }

    /// Bytes of the mesh, and of what is kept to assemble the next one.
    pub(crate) fn bytes(&self) -> (usize, usize) {
        (self.mesh.bytes(), self.parts.capacity() * size_of::<Part>() + size_of::<Self>())
    }
}
