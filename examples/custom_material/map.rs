//! The material: paper with contour lines.

use bevy::asset::embedded_asset;
use bevy::mesh::MeshVertexBufferLayoutRef;
use bevy::pbr::{MaterialPipeline, MaterialPipelineKey};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy::render::render_resource::{
    AsBindGroup, Face, RenderPipelineDescriptor, SpecializedMeshPipelineError,
};
use bevy::shader::{ShaderDefVal, ShaderRef};
use bevy_burrow::prelude::*;
use bevy_burrow::view::prepass_vertex_shader;

/// Makes terrains with a [`MapMaterial`] show it.
pub struct MapPlugin;

impl Plugin for MapPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "examples/", "map.wgsl");
        // Bevy's plugin draws it; the other one hands it on from the terrain to its tiles and chunks.
        app.add_plugins((
            MaterialPlugin::<MapMaterial>::default(),
            TerrainMaterialPlugin::<MapMaterial>::default(),
        ));
    }
}

/// A map.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct MapMaterial {
    /// Colours of dug ground, near the surface and deep below.
    #[uniform(0)]
    shallow: LinearRgba,
    #[uniform(0)]
    deep: LinearRgba,
    /// Metres between contour lines; every fifth is thick.
    #[uniform(0)]
    step: f32,
}

impl Default for MapMaterial {
    fn default() -> Self {
        Self {
            shallow: Color::srgb(0.96, 0.72, 0.34).into(),
            deep: Color::srgb(0.55, 0.10, 0.16).into(),
            step: 2.0,
        }
    }
}

const SHADER: &str = concat!("embedded://", env!("CARGO_CRATE_NAME"), "/custom_material/map.wgsl");

impl Material for MapMaterial {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }

    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }

    // Its positions are those of `map.wgsl`, to the bit. Those of Bevy's prepass might differ by rounding.
    fn prepass_vertex_shader() -> ShaderRef {
        prepass_vertex_shader()
    }

    fn specialize(
        _: &MaterialPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        layout: &MeshVertexBufferLayoutRef,
        _: MaterialPipelineKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        // Unless told, a prepass draws the backs of triangles too. The main pass does not, and nothing would be drawn
        // wherever ground is seen from below.
        descriptor.primitive.cull_mode = Some(Face::Back);
        // The prepass, which draws shadows too, wants no attributes of ours.
        if descriptor.vertex.shader_defs.contains(&ShaderDefVal::from("PREPASS_PIPELINE")) {
            return Ok(());
        }
        let attributes = [
            Mesh::ATTRIBUTE_POSITION.at_shader_location(0),
            Mesh::ATTRIBUTE_NORMAL.at_shader_location(1),
            Mesh::ATTRIBUTE_COLOR.at_shader_location(2),
            Terrain::ATTRIBUTE_GROUND_DEPTH.at_shader_location(3),
        ];
        descriptor.vertex.buffers = vec![layout.0.get_layout(&attributes)?];
        Ok(())
    }
}
