//! Vertices and meshes as integers for exact comparison, and the mixing function of hashes.

use bevy_burrow::surface::{Indices, SurfaceMesh, Vertex};

/// A vertex as bit patterns: 0.0 and -0.0 differ.
type Bits = ([i32; 3], [u32; 3], [u8; 4], [u8; 4]);
/// A mesh as bit patterns.
pub type MeshBits = (Vec<Bits>, Indices);

pub fn bits(vertex: &Vertex) -> Bits {
    let normal = vertex.normal.to_array().map(f32::to_bits);
    (vertex.position.to_array(), normal, vertex.materials.ids, vertex.materials.weights)
}

pub fn mesh_bits(mesh: &SurfaceMesh) -> MeshBits {
    (mesh.vertices.iter().map(bits).collect(), mesh.indices.clone())
}

pub fn sorted(vertices: &[Vertex], indices: impl Iterator<Item = usize>) -> Vec<[Bits; 3]> {
    let corners: Vec<Bits> = indices.map(|index| bits(&vertices[index])).collect();
    let mut triangles: Vec<[Bits; 3]> = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    triangles.sort_unstable();
    triangles
}

/// SplitMix64, of which the documented hash of samples consists.
pub fn mix(value: u64) -> u64 {
    let z = value.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}
