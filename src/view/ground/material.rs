//! The material: bindings and pipelines of `ground.wgsl`.

use bevy::asset::Asset;
use bevy::mesh::{Mesh, MeshVertexBufferLayoutRef};
use bevy::pbr::{
    ExtendedMaterial, MaterialExtension, MaterialExtensionKey, MaterialExtensionPipeline, StandardMaterial,
};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy::render::render_resource::{
    AsBindGroup, RenderPipelineDescriptor, ShaderType, SpecializedMeshPipelineError,
};
use bevy::shader::{ShaderDefVal, ShaderRef};

use super::look::{GroundLayer, GroundLayerKind, GroundLook, GroundQuality, MAX_LAYERS};
use crate::plugin::{
    ATTRIBUTE_GROUND_COVER, ATTRIBUTE_GROUND_DEPTH, ATTRIBUTE_MATERIAL_IDS, ATTRIBUTE_MATERIAL_WEIGHTS,
};

/// What terrains with a [`GroundLook`] are drawn with: Bevy's own material, whose colour, roughness and relief come from
/// layers of texture. Shadows, fog, prepasses and deferred rendering work as ever.
///
/// Meshes without the attributes of a terrain show layer 0.
pub type GroundMaterial = ExtendedMaterial<StandardMaterial, GroundExtension>;

/// The part of a [`GroundMaterial`] that is not Bevy's.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug, PartialEq)]
pub struct GroundExtension {
    #[uniform(100)]
    pub(super) uniform: GroundUniform,
    /// Colours (sRGB) and, in alpha, heights of the layers.
    #[texture(101, dimension = "2d_array")]
    #[sampler(102)]
    pub albedo: Option<Handle<Image>>,
    /// x and y of the layers' normals, occlusion, roughness.
    #[texture(103, dimension = "2d_array")]
    #[sampler(104)]
    pub relief: Option<Handle<Image>>,
    /// Four kinds of noise in space.
    #[texture(105, dimension = "3d")]
    #[sampler(106)]
    pub(super) noise: Option<Handle<Image>>,
}

/// What the shader reads of a [`GroundLook`]; as `ground.wgsl` has it.
#[derive(ShaderType, Clone, Debug, PartialEq)]
pub(super) struct GroundUniform {
    /// From world space to metres of the terrain; of a piece, from its mesh to these metres.
    pub place: Mat4,
    /// 1 / metres, relief, metallic, kind.
    layers: [Vec4; MAX_LAYERS],
    /// Tint; the texture that shows from above, -1 for the same one.
    tints: [Vec4; MAX_LAYERS],
    /// Layers of soil and subsoil, how deep each reaches.
    soil: Vec4,
    /// Layers of the beds.
    beds: Vec4,
    /// Height, bend; the seam's layer and thickness.
    rock: Vec4,
    /// Depth of the seam; the vein's layer, thickness, depth.
    vein: Vec4,
    /// Cosines of cliffs, distances.
    far: Vec4,
    /// Variety, quality, metres of a voxel, number of layers.
    detail: Vec4,
    /// 1 for pieces, which move by themselves.
    is_piece: u32,
}

impl GroundUniform {
    pub(super) fn new(look: &GroundLook, place: &GlobalTransform) -> Self {
        let strata = &look.strata;
        let count = look.layers.len().clamp(1, MAX_LAYERS);
        let number = |layer: u8| f32::from(layer).min(count as f32 - 1.0);
        let cosine = |slope: f32| 1.0 / (slope * slope + 1.0).sqrt();
        let (scale, rotation, translation) = place.to_scale_rotation_translation();
        let layer = |at: usize| look.layers.get(at).cloned().unwrap_or_default();
        Self {
            place: Mat4::from_rotation_translation(rotation, translation).inverse(),
            layers: std::array::from_fn(|at| {
                let layer = layer(at);
                let kind = match layer.kind {
                    GroundLayerKind::Body => 0.0,
                    GroundLayerKind::Skin => 1.0,
                    GroundLayerKind::Strata => 2.0,
                };
                Vec4::new(1.0 / layer.metres.max(0.01), layer.relief, layer.metallic, kind)
            }),
            tints: std::array::from_fn(|at| {
                let GroundLayer { tint, top, .. } = layer(at);
                tint.to_vec3().extend(top.map_or(-1.0, f32::from))
            }),
            soil: Vec4::new(number(strata.soil.0), number(strata.subsoil.0), strata.soil.1, strata.subsoil.1),
            beds: Vec4::from_array(strata.beds.map(number)),
            rock: Vec4::new(strata.height.max(0.1), strata.bend, number(strata.seam.0), strata.seam.1),
            vein: Vec4::new(strata.seam.2, number(strata.vein.0), strata.vein.1, strata.vein.2),
            far: Vec4::new(
                cosine(look.cliffs.1),
                cosine(look.cliffs.0).max(cosine(look.cliffs.1) + 0.001),
                look.distance.0,
                look.distance.1.max(look.distance.0 + 0.1),
            ),
            detail: Vec4::new(
                look.variety,
                if look.quality == GroundQuality::High { 1.0 } else { 0.0 },
                scale.y,
                count as f32,
            ),
            is_piece: 0,
        }
    }

    /// The same for a piece whose mesh counts from a voxel.
    pub(super) fn of_piece(self, origin: IVec3) -> Self {
        let voxel = self.detail.z;
        let place = Mat4::from_scale_rotation_translation(
            Vec3::splat(voxel),
            Quat::IDENTITY,
            origin.as_vec3() * voxel,
        );
        Self { place, is_piece: 1, ..self }
    }
}

/// Where the shader is.
const SHADER: &str = "embedded://bevy_burrow/view/ground/ground.wgsl";

impl MaterialExtension for GroundExtension {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }
    fn fragment_shader() -> ShaderRef {
        SHADER.into()
    }
    fn deferred_vertex_shader() -> ShaderRef {
        SHADER.into()
    }
    fn deferred_fragment_shader() -> ShaderRef {
        SHADER.into()
    }

    fn specialize(
        _: &MaterialExtensionPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        layout: &MeshVertexBufferLayoutRef,
        _: MaterialExtensionKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        let has = |name: &str| descriptor.vertex.shader_defs.contains(&ShaderDefVal::from(name));
        // Depth, shadows and motion are Bevy's own.
        if has("PREPASS_PIPELINE") && !has("DEFERRED_PREPASS") {
            return Ok(());
        }
        let mut attributes = vec![
            Mesh::ATTRIBUTE_POSITION.at_shader_location(0),
            Mesh::ATTRIBUTE_NORMAL.at_shader_location(1),
        ];
        let own = [
            ATTRIBUTE_MATERIAL_IDS,
            ATTRIBUTE_MATERIAL_WEIGHTS,
            ATTRIBUTE_GROUND_DEPTH,
            ATTRIBUTE_GROUND_COVER,
        ];
        if own.iter().all(|attribute| layout.0.contains(attribute.id)) {
            attributes.extend(
                own.iter().zip(8..).map(|(attribute, location)| attribute.at_shader_location(location)),
            );
            let definition = ShaderDefVal::from("GROUND_ATTRIBUTES");
            descriptor.vertex.shader_defs.push(definition.clone());
            if let Some(fragment) = &mut descriptor.fragment {
                fragment.shader_defs.push(definition);
            }
        }
        descriptor.vertex.buffers = vec![layout.0.get_layout(&attributes)?];
        Ok(())
    }
}
