//! The material: bindings and pipelines of `ground.wgsl`.

use bevy::asset::Asset;
use bevy::material::OpaqueRendererMethod;
use bevy::mesh::{Mesh, MeshVertexBufferLayoutRef};
use bevy::pbr::{
    ExtendedMaterial, MaterialExtension, MaterialExtensionKey, MaterialExtensionPipeline, MaterialPipeline,
    MaterialPipelineKey,
};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy::render::render_resource::{
    AsBindGroup, Face, RenderPipelineDescriptor, ShaderType, SpecializedMeshPipelineError,
};
use bevy::shader::{ShaderDefVal, ShaderRef};

use super::super::vertex::prepass_vertex_shader;
use super::look::{GroundLayer, GroundLook, GroundQuality, MAX_LAYERS};
use crate::terrain::Terrain;

/// The material of terrains with a [`GroundLook`]: lit like Bevy's `StandardMaterial`, with colour, roughness and
/// relief from layers of texture. Shadows, fog, clustered decals, prepasses and deferred rendering work as they do
/// there.
///
/// Meshes without the attributes of a terrain show layer 0.
pub type GroundMaterial = ExtendedMaterial<GroundBase, GroundExtension>;

/// What a [`GroundMaterial`] has in common with Bevy's `StandardMaterial`, without that material's textures and
/// samplers, of which GPUs have few: none of its fields has one.
#[derive(Asset, AsBindGroup, Reflect, Clone, Debug, PartialEq)]
#[reflect(Default, Clone, PartialEq)]
#[uniform(99, BaseUniform)]
pub struct GroundBase {
    /// The colours of all layers are multiplied by this.
    pub base_color: Color,
    /// How much non-metals reflect, as in `StandardMaterial`: 0 to 1.
    pub reflectance: f32,
    /// Whether the ground shows its colours without any light.
    pub unlit: bool,
    /// Whether a camera's `DistanceFog` applies.
    pub fog_enabled: bool,
    /// Forward or deferred rendering.
    pub opaque_render_method: OpaqueRendererMethod,
}

impl Default for GroundBase {
    fn default() -> Self {
        Self {
            base_color: Color::WHITE,
            reflectance: 0.3,
            unlit: false,
            fog_enabled: true,
            opaque_render_method: OpaqueRendererMethod::Auto,
        }
    }
}

/// A [`GroundBase`], as `ground.wgsl` has it.
#[derive(ShaderType, Clone, Copy, Debug)]
pub(super) struct BaseUniform {
    color: Vec4,
    reflectance: f32,
    is_unlit: u32,
    has_fog: u32,
}

impl From<&GroundBase> for BaseUniform {
    fn from(base: &GroundBase) -> Self {
        Self {
            color: base.base_color.to_linear().to_vec4(),
            reflectance: base.reflectance,
            is_unlit: base.unlit.into(),
            has_fog: base.fog_enabled.into(),
        }
    }
}

impl Material for GroundBase {
    fn opaque_render_method(&self) -> OpaqueRendererMethod {
        self.opaque_render_method
    }

    fn specialize(
        _: &MaterialPipeline,
        descriptor: &mut RenderPipelineDescriptor,
        _: &MeshVertexBufferLayoutRef,
        _: MaterialPipelineKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        // In all passes alike: with a depth prepass, ground would be missing otherwise.
        descriptor.primitive.cull_mode = Some(Face::Back);
        Ok(())
    }
}

/// The part of a [`GroundMaterial`] that is not Bevy's.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug, PartialEq)]
#[bind_group_data(GroundKey)]
pub struct GroundExtension {
    #[uniform(100)]
    pub(super) uniform: GroundUniform,
    /// Colours (sRGB) and, in alpha, heights of the layers. Its sampler is that of `relief` too.
    #[texture(101, dimension = "2d_array")]
    #[sampler(102)]
    pub albedo: Option<Handle<Image>>,
    /// x and y of the layers' normals, occlusion, roughness.
    #[texture(103, dimension = "2d_array")]
    pub relief: Option<Handle<Image>>,
    /// The look's colour map, once it is loaded.
    #[texture(104)]
    pub color_map: Option<Handle<Image>>,
    /// Four kinds of noise in space.
    #[texture(105, dimension = "3d", visibility(vertex, fragment))]
    #[sampler(106, visibility(vertex, fragment))]
    pub(super) noise: Option<Handle<Image>>,
    /// Whether albedo and relief are read with the sampler of the noise, which is not anisotropic.
    pub(super) without_anisotropy: bool,
    pub(super) quality: GroundQuality,
}

/// The part of a [`GroundExtension`] that selects its pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GroundKey {
    without_anisotropy: bool,
    is_fine: bool,
    has_color_map: bool,
}

impl From<&GroundExtension> for GroundKey {
    fn from(extension: &GroundExtension) -> Self {
        Self {
            without_anisotropy: extension.without_anisotropy,
            is_fine: extension.quality == GroundQuality::High,
            has_color_map: extension.color_map.is_some(),
        }
    }
}

/// A layer, as `ground.wgsl` has it.
#[derive(ShaderType, Clone, Copy, Debug, PartialEq)]
pub(super) struct LayerUniform {
    per_metre: f32,
    relief: f32,
    metallic: f32,
    /// 1 if the texture is cut into pieces.
    pieces: f32,
}

/// A layer's colours, as `ground.wgsl` has them.
#[derive(ShaderType, Clone, Copy, Debug, PartialEq)]
pub(super) struct TintUniform {
    color: Vec3,
    /// The texture that shows from above, -1 for the same one.
    top: f32,
}

/// The uniform buffer of a [`GroundLook`], as in `ground.wgsl`.
#[derive(ShaderType, Clone, Debug, PartialEq)]
pub(super) struct GroundUniform {
    /// From world space to metres of the terrain; of a piece, from its mesh to these metres.
    pub place: Mat4,
    layers: [LayerUniform; MAX_LAYERS],
    tints: [TintUniform; MAX_LAYERS],
    /// The strength of the large relief of each layer.
    broad: [Vec4; MAX_LAYERS / 4],
    /// How much the colour map tints each layer.
    map_tints: [Vec4; MAX_LAYERS / 4],
    /// Where the colour map begins to show, and where it shows fully.
    map_distance: Vec2,
    /// What turns metres along x and z into the width and height of the colour map.
    per_side: Vec2,
    near: f32,
    far: f32,
    variety: f32,
    layer_count: f32,
    /// 1 for pieces, which move by themselves.
    is_piece: u32,
    /// Metres of a voxel; only for pieces made later.
    voxel: f32,
}

impl GroundUniform {
    /// `size` is the number of cells along x and z.
    pub(super) fn new(look: &GroundLook, place: &GlobalTransform, size: IVec2) -> Self {
        let count = look.layers.len().clamp(1, MAX_LAYERS);
        let (scale, rotation, translation) = place.to_scale_rotation_translation();
        let layer = |at: usize| look.layers.get(at).cloned().unwrap_or_default();
        let by_four = |of: &dyn Fn(GroundLayer) -> f32| {
            std::array::from_fn(|four| Vec4::from_array(std::array::from_fn(|at| of(layer(4 * four + at)))))
        };
        let map = look.color_map.as_ref();
        let (from, to) = map.map_or((0.0, 0.0), |map| map.distance);
        let strength = map.map_or(0.0, |map| map.strength);
        Self {
            place: Mat4::from_rotation_translation(rotation, translation).inverse(),
            layers: std::array::from_fn(|at| {
                let GroundLayer { metres, relief, metallic, has_pieces, .. } = layer(at);
                let pieces = if has_pieces { 1.0 } else { 0.0 };
                LayerUniform { per_metre: 1.0 / metres.max(0.01), relief, metallic, pieces }
            }),
            tints: std::array::from_fn(|at| {
                let GroundLayer { tint, top, .. } = layer(at);
                TintUniform { color: tint.to_vec3(), top: top.map_or(-1.0, f32::from) }
            }),
            broad: by_four(&|layer| layer.broad_relief),
            map_tints: by_four(&|layer| (layer.map_tint * strength).clamp(0.0, 1.0)),
            map_distance: Vec2::new(from, to.max(from + 0.1)),
            per_side: 1.0 / (size.max(IVec2::ONE).as_vec2() * scale.xz().abs().max(Vec2::splat(1e-6))),
            near: look.distance.0,
            far: look.distance.1.max(look.distance.0 + 0.1),
            variety: look.variety,
            layer_count: count as f32,
            is_piece: 0,
            voxel: scale.y,
        }
    }

    /// The uniform for a piece whose mesh is relative to a voxel.
    pub(super) fn of_piece(self, origin: IVec3) -> Self {
        let voxel = self.voxel;
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
    fn prepass_vertex_shader() -> ShaderRef {
        prepass_vertex_shader()
    }
    fn prepass_fragment_shader() -> ShaderRef {
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
        key: MaterialExtensionKey<Self>,
    ) -> Result<(), SpecializedMeshPipelineError> {
        let definitions = descriptor.vertex.shader_defs.clone();
        let has = |name: &str| definitions.contains(&ShaderDefVal::from(name));
        if has("PREPASS_PIPELINE") && !has("DEFERRED_PREPASS") {
            match &mut descriptor.fragment {
                // Normals have relief, which takes what the main pass takes.
                Some(fragment) if has("NORMAL_PREPASS") => descriptor.vertex.shader = fragment.shader.clone(),
                // Depth, shadows and motion take the attributes that Bevy's prepass does.
                fragment => {
                    let fragment = fragment.iter_mut();
                    fragment.for_each(|fragment| fragment.shader_defs.push("GROUND_PLAIN_PREPASS".into()));
                    return Ok(());
                }
            }
        }
        let mut attributes = vec![
            Mesh::ATTRIBUTE_POSITION.at_shader_location(0),
            Mesh::ATTRIBUTE_NORMAL.at_shader_location(1),
        ];
        let own = [Terrain::ATTRIBUTE_MATERIAL_IDS, Terrain::ATTRIBUTE_MATERIAL_WEIGHTS];
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
        // Pieces have none.
        if layout.0.contains(Terrain::ATTRIBUTE_SKY_LIGHT.id) {
            attributes.push(Terrain::ATTRIBUTE_SKY_LIGHT.at_shader_location(10));
            let definition = ShaderDefVal::from("GROUND_SKY_LIGHT");
            descriptor.vertex.shader_defs.push(definition.clone());
            if let Some(fragment) = &mut descriptor.fragment {
                fragment.shader_defs.push(definition);
            }
        }
        if let Some(fragment) = &mut descriptor.fragment {
            let GroundKey { without_anisotropy, is_fine, has_color_map } = key.bind_group_data;
            let definitions = [
                (without_anisotropy, "WITHOUT_ANISOTROPY"),
                (is_fine, "GROUND_FINE"),
                (has_color_map, "GROUND_COLOR_MAP"),
            ];
            fragment.shader_defs.extend(definitions.iter().filter(|own| own.0).map(|own| own.1.into()));
        }
        descriptor.vertex.buffers = vec![layout.0.get_layout(&attributes)?];
        Ok(())
    }
}
