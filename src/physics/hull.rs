//! Colliders for loose pieces of ground: convex hulls.

use avian3d::prelude::*;
use bevy::math::Vec3;

use crate::lattice::SNAP;
use crate::surface::SurfaceMesh;

/// The largest share of its hull that a piece may lack to count as convex.
const HOLLOW: f32 = 0.25;

/// Cells along the longest side for the convex decomposition of other pieces.
const RESOLUTION: u32 = 24;

/// A collider for a loose piece of ground: its convex hull, or a convex decomposition for concave pieces. In metres
/// from the origin of the piece's mesh, which must be closed; `None` for a piece without volume.
///
/// It takes milliseconds, or tens of them for a large concave piece, so call it in a task.
pub fn debris_collider(piece: &SurfaceMesh, voxel_size: f32) -> Option<Collider> {
    let scale = voxel_size / SNAP as f32;
    let vertices: Vec<Vec3> = piece.vertices.iter().map(|vertex| vertex.position.as_vec3() * scale).collect();
    let triangles: Vec<[u32; 3]> = piece
        .indices
        .triangles()
        .filter(|t| t.iter().all(|&corner| (corner as usize) < vertices.len()))
        .collect();
    let corners = |t: &[u32; 3]| t.map(|corner| vertices[corner as usize] - vertices[0]);
    let volume: f32 = triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    let hull = Collider::convex_hull(vertices.clone())?;
    let full = hull.mass_properties(1.0).mass;
    if !full.is_finite() || full <= 0.0 {
        return None;
    }
    if volume >= full * (1.0 - HOLLOW) {
        return Some(hull);
    }
    let parameters = VhacdParameters { resolution: RESOLUTION, ..VhacdParameters::default() };
    Some(Collider::convex_decomposition_with_config(vertices, triangles, parameters))
}
