//! Vertices with up to four materials, and meshes of them, local to the chunk or tile that draws them.

use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::indices::Indices;
use crate::ground::{ColumnMaterial, MaterialId};
use crate::lattice::SNAP;

/// Up to four materials with weights that sum up to 255.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MaterialMix {
    /// Material ids; those without weight are 0.
    pub ids: [u8; 4],
    /// Weight of each, 0..=255.
    pub weights: [u8; 4],
}

impl MaterialMix {
    /// One material alone.
    pub const fn pure(material: MaterialId) -> Self {
        Self { ids: [material.0, 0, 0, 0], weights: [255, 0, 0, 0] }
    }

    /// The two materials of a column.
    pub fn column(column: ColumnMaterial) -> Self {
        if column.blend == 0 || column.base == column.overlay {
            return Self::pure(column.base);
        }
        if column.blend == 255 {
            return Self::pure(column.overlay);
        }
        Self {
            ids: [column.base.0, column.overlay.0, 0, 0],
            weights: [255 - column.blend, column.blend, 0, 0],
        }
    }

    /// The shares of the materials of some columns, each of which counts the same, in integers. The four with the
    /// largest shares are kept.
    pub fn of_columns(columns: impl Iterator<Item = ColumnMaterial>) -> Self {
        let mut parts: Vec<(u8, i32)> = Vec::with_capacity(8);
        for column in columns {
            let mix = Self::column(column);
            for (&id, &weight) in mix.ids.iter().zip(&mix.weights).filter(|(_, weight)| **weight > 0) {
                match parts.iter_mut().find(|part| part.0 == id) {
                    Some(part) => part.1 += i32::from(weight),
                    None => parts.push((id, weight.into())),
                }
            }
        }
        Self::of_parts(&mut parts).unwrap_or_default()
    }

    /// The mix at `step` of [`SNAP`] steps from `a` to `b`, in integers. Equal ends give themselves; where nothing has
    /// any weight, it is `a`.
    pub fn lerp(a: Self, b: Self, step: i32) -> Self {
        if a == b {
            return a;
        }
        let mut parts: [(u8, i32); 8] = [(0, 0); 8];
        let mut count = 0;
        for (mix, share) in [(a, SNAP - step), (b, step)] {
            for (&id, &weight) in mix.ids.iter().zip(&mix.weights).filter(|(_, weight)| **weight > 0) {
                let weight = i32::from(weight) * share;
                match parts[..count].iter_mut().find(|part| part.0 == id) {
                    Some(part) => part.1 += weight,
                    None => {
                        parts[count] = (id, weight);
                        count += 1;
                    }
                }
            }
        }
        Self::of_parts(&mut parts[..count]).unwrap_or(a)
    }

    /// The mix of materials by weight, each there once; `None` without any.
    fn of_parts(parts: &mut [(u8, i32)]) -> Option<Self> {
        parts.sort_unstable_by_key(|&(id, weight)| (-weight, id));
        let kept = &parts[..parts.len().min(4)];
        let &(heaviest, _) = kept.first()?;
        let total: i32 = kept.iter().map(|part| part.1).sum::<i32>().max(1);
        let mut result = Self::default();
        let mut rest = 255;
        for (slot, &(id, weight)) in kept.iter().enumerate().skip(1) {
            result.ids[slot] = id;
            result.weights[slot] = (weight * 255 / total) as u8;
            rest -= weight * 255 / total;
        }
        (result.ids[0], result.weights[0]) = (heaviest, rest as u8);
        Some(result)
    }
}

/// A vertex of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vertex {
    /// Position in 1/4096 voxel, local to the chunk or tile.
    pub position: IVec3,
    /// Unit normal, towards the air.
    pub normal: Vec3,
    /// Materials at the vertex.
    pub materials: MaterialMix,
}

impl Vertex {
    /// Returns `true` if it equals the other one bit by bit. Normals of 0.0 and -0.0 differ here, though they compare
    /// equal.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        self == other && self.normal.to_array().map(f32::to_bits) == other.normal.to_array().map(f32::to_bits)
    }

    /// The position in voxels, exact in `f32`.
    pub fn position_f32(&self) -> [f32; 3] {
        self.position.to_array().map(|steps| steps as f32 / SNAP as f32)
    }
}

/// An indexed triangle mesh; triangles are counter-clockwise seen from the air.
///
/// One that is deserialised has no index beyond its vertices.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked", into = "Unchecked")]
pub struct SurfaceMesh {
    /// Vertices, shared by the triangles of a block or tile.
    pub vertices: Vec<Vertex>,
    /// Three for each triangle.
    pub indices: Indices,
}

/// A mesh as it comes from a file.
#[derive(Serialize, Deserialize)]
#[serde(rename = "SurfaceMesh")]
struct Unchecked {
    vertices: Vec<Vertex>,
    indices: Vec<u32>,
}

impl From<SurfaceMesh> for Unchecked {
    fn from(mesh: SurfaceMesh) -> Self {
        Self { indices: mesh.indices.iter().collect(), vertices: mesh.vertices }
    }
}

impl TryFrom<Unchecked> for SurfaceMesh {
    type Error = &'static str;

    fn try_from(of: Unchecked) -> Result<Self, Self::Error> {
        let vertices = of.vertices.len();
        if !of.indices.len().is_multiple_of(3) {
            return Err("the indices of the mesh do not form triangles");
        }
        if of.indices.iter().any(|&index| index as usize >= vertices) {
            return Err("the mesh has an index beyond its vertices");
        }
        if of.vertices.iter().any(|vertex| !vertex.normal.is_finite()) {
            return Err("the mesh has a normal that is not finite");
        }
        Ok(Self { indices: Indices::new(vertices, of.indices), vertices: of.vertices })
    }
}

impl SurfaceMesh {
    /// Returns `true` if there is nothing to draw.
    pub fn is_empty(&self) -> bool {
        self.indices.is_empty()
    }

    /// The triangles as vertices.
    pub fn triangles(&self) -> impl Iterator<Item = [Vertex; 3]> {
        self.indices.triangles().map(|triangle| triangle.map(|index| self.vertices[index as usize]))
    }

    /// Lowest and highest corner in voxels, `None` without vertices.
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let first = self.vertices.first()?.position;
        let (min, max) = self
            .vertices
            .iter()
            .fold((first, first), |(min, max), vertex| (min.min(vertex.position), max.max(vertex.position)));
        let voxels = |v: IVec3| v.to_array().map(|steps| steps as f32 / SNAP as f32);
        Some((voxels(min), voxels(max)))
    }

    /// Bytes of the buffers, their spare capacity included.
    pub fn bytes(&self) -> usize {
        self.vertices.capacity() * size_of::<Vertex>() + self.indices.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn weights_of_a_mix_sum_up(base in 0u8..4, overlay in 0u8..4, b2 in 0u8..8, o2 in 4u8..8, x: u8, y: u8, step in 0..=SNAP) {
            let a = MaterialMix::column(ColumnMaterial { base: MaterialId(base), overlay: MaterialId(overlay), blend: x });
            let b = MaterialMix::column(ColumnMaterial { base: MaterialId(b2), overlay: MaterialId(o2), blend: y });
            let mix = MaterialMix::lerp(a, b, step);
            prop_assert_eq!(mix.weights.iter().map(|&w| u32::from(w)).sum::<u32>(), 255);
            prop_assert_eq!(MaterialMix::lerp(a, a, step), a);
        }
    }

    #[test]
    fn a_mix_without_weight_is_its_first_end() {
        let (none, other) = (MaterialMix::default(), MaterialMix { ids: [1, 0, 0, 0], weights: [0; 4] });
        for step in [0, 1, SNAP] {
            assert_eq!(MaterialMix::lerp(none, other, step), none);
            assert_eq!(MaterialMix::lerp(other, none, step), other);
        }
    }
}
