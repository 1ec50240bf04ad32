//! Surface meshes as Bevy meshes.

use bevy::asset::RenderAssetUsages;
use bevy::camera::primitives::Aabb;
use bevy::mesh::{
    Indices, Mesh, MeshVertexAttribute, PrimitiveTopology, VertexAttributeValues, VertexFormat,
};
use bevy::prelude::*;

use super::MaterialColors;
use crate::surface::{MaterialMix, SurfaceMesh};

/// Up to four material ids of a vertex, for materials that look them up.
pub const ATTRIBUTE_MATERIAL_IDS: MeshVertexAttribute =
    MeshVertexAttribute::new("Vertex_BurrowMaterialIds", 0x6275_7272_6f77_0001, VertexFormat::Uint8x4);

/// The weight of each of a vertex's material ids, 0..=1.
pub const ATTRIBUTE_MATERIAL_WEIGHTS: MeshVertexAttribute =
    MeshVertexAttribute::new("Vertex_BurrowMaterialWeights", 0x6275_7272_6f77_0002, VertexFormat::Unorm8x4);

/// A mesh ready to be swapped in, with its bounds; `None` where nothing is to be drawn.
pub(super) type Ready = Option<(Mesh, Aabb)>;

/// Builds the Bevy mesh, in the task.
pub(super) fn build(surface: &SurfaceMesh, colors: &MaterialColors) -> Ready {
    if surface.is_empty() {
        return None;
    }
    let (min, max) = surface.bounds()?;
    let vertices = &surface.vertices;
    let positions: Vec<[f32; 3]> = vertices.iter().map(|vertex| vertex.position_f32()).collect();
    let normals: Vec<[f32; 3]> = vertices.iter().map(|vertex| vertex.normal.to_array()).collect();
    let colors: Vec<[f32; 4]> = vertices.iter().map(|vertex| blend(vertex.materials, colors)).collect();
    let ids = vertices.iter().map(|vertex| vertex.materials.ids).collect();
    let weights = vertices.iter().map(|vertex| vertex.materials.weights).collect();
    let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::RENDER_WORLD)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
        .with_inserted_attribute(ATTRIBUTE_MATERIAL_IDS, VertexAttributeValues::Uint8x4(ids))
        .with_inserted_attribute(ATTRIBUTE_MATERIAL_WEIGHTS, VertexAttributeValues::Unorm8x4(weights))
        .with_inserted_indices(Indices::U32(surface.indices.clone()));
    Some((mesh, Aabb::from_min_max(Vec3::from(min), Vec3::from(max))))
}

/// The mixed colour of a vertex.
fn blend(mix: MaterialMix, colors: &MaterialColors) -> [f32; 4] {
    let color = |id: u8| {
        let known = colors.0.get(usize::from(id)).or(colors.0.last());
        known.copied().unwrap_or(LinearRgba::WHITE).to_f32_array()
    };
    let mut sum = [0.0; 4];
    for (&id, &weight) in mix.ids.iter().zip(&mix.weights).filter(|(_, weight)| **weight > 0) {
        for (sum, part) in sum.iter_mut().zip(color(id)) {
            *sum += part * f32::from(weight) / 255.0;
        }
    }
    sum
}
