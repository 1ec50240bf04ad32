//! The material of plants: Bevy's, with a vertex shader that places many copies of one mesh.

use bevy::asset::Asset;
use bevy::pbr::{ExtendedMaterial, MaterialExtension, StandardMaterial};
use bevy::prelude::*;
use bevy::reflect::TypePath;
use bevy::render::render_resource::{AsBindGroup, ShaderType};
use bevy::render::storage::ShaderBuffer;
use bevy::shader::ShaderRef;

/// The material with which plants are drawn.
pub type PlantMaterial = ExtendedMaterial<StandardMaterial, PlantExtension>;

/// The part of a [`PlantMaterial`] that is not Bevy's.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct PlantExtension {
    #[uniform(100, visibility(vertex))]
    pub(super) uniform: PlantUniform,
    /// Where each plant stands, and how it is turned.
    #[storage(101, read_only, visibility(vertex))]
    pub(super) records: Handle<ShaderBuffer>,
    /// A bit for each plant that does not stand.
    #[storage(102, read_only, visibility(vertex))]
    pub(super) gone: Handle<ShaderBuffer>,
}

/// The uniform buffer, as `plants.wgsl` has it.
#[derive(ShaderType, Clone, Copy, Debug, PartialEq)]
pub(super) struct PlantUniform {
    /// Metres from the camera from which on they are drawn.
    pub begin: f32,
    /// Metres from the camera up to which they are drawn.
    pub end: f32,
    /// The share of `end` over which they shrink to nothing; 0 for those that another mesh follows.
    pub fade: f32,
    /// Metres by which the wind moves what is a metre above the ground.
    pub sway: f32,
    /// How much a plant may differ in brightness and hue, as a share.
    pub tint: f32,
    /// 1 if they follow the slope, 0 if they are upright.
    pub slope: f32,
    /// Voxels in a metre.
    pub voxels: f32,
}

/// Where the shader is.
const SHADER: &str = "embedded://bevy_burrow/plants/plants.wgsl";

impl MaterialExtension for PlantExtension {
    fn vertex_shader() -> ShaderRef {
        SHADER.into()
    }
    fn prepass_vertex_shader() -> ShaderRef {
        SHADER.into()
    }
    fn deferred_vertex_shader() -> ShaderRef {
        SHADER.into()
    }
}
