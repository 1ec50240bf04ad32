//! Vertex positions that are equal in all passes.

use bevy::asset::{AssetServer, embedded_asset};
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::shader::{ShaderRef, load_shader_library};

/// The vertex shader for the prepasses of a material whose main pass has a vertex shader of its own. Return it from
/// [`Material::prepass_vertex_shader`].
///
/// With a `DepthPrepass`, the main pass keeps only fragments with exactly the depth that the prepass wrote. Two vertex
/// shaders that are compiled separately may differ in the last bit, and then the ground is full of holes, on some GPUs
/// only. Graphics APIs promise equal bits for equal expressions whose results are *invariant*: `Invariant` in SPIR-V,
/// `[[invariant]]` in Metal, `precise` in HLSL, `invariant` in GLSL. So a vertex shader of your own takes its position
/// from `bevy_burrow::position`, as this one does, and declares it invariant:
///
/// ```wgsl
/// #import bevy_burrow::position::position_of
///
/// struct Varying {
///     @invariant @builtin(position) position: vec4<f32>,
///     // ...
/// }
///
/// @vertex
/// fn vertex(in: Vertex) -> Varying {
///     let position = position_of(in.position, in.instance_index);
///     var out: Varying;
///     out.position = position.clip; // in world space: position.world
///     // ...
/// }
/// ```
///
/// The two passes must also leave out the same triangles: set `descriptor.primitive.cull_mode` in
/// [`Material::specialize`], as Bevy's prepass otherwise draws backs of triangles, which the main pass leaves out.
///
/// Materials without a vertex shader of their own need nothing: there Bevy's shaders draw both passes.
///
/// The shaders are there wherever `GroundPlugin` or any
/// [`TerrainMaterialPlugin`](super::TerrainMaterialPlugin) is. They ignore skins and morph targets, which terrains do
/// not have, and draw shadows too.
pub fn prepass_vertex_shader() -> ShaderRef {
    "embedded://bevy_burrow/view/prepass.wgsl".into()
}

/// Provides the shaders of this module, once an app has all of its plugins.
pub(super) struct VertexPlugin;

impl VertexPlugin {
    /// Adds it, unless another plugin has done so.
    pub fn add_once(app: &mut App) {
        if !app.is_plugin_added::<Self>() {
            app.add_plugins(Self);
        }
    }
}

impl Plugin for VertexPlugin {
    fn build(&self, _: &mut App) {}

    fn finish(&self, app: &mut App) {
        if app.is_plugin_added::<PbrPlugin>() && app.world().contains_resource::<AssetServer>() {
            load_shader_library!(app, "position.wgsl");
            embedded_asset!(app, "prepass.wgsl");
        }
    }
}
