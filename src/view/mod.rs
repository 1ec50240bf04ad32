//! How the ground looks: materials on tiles, chunks and pieces.
//!
//! A [`GroundLook`] on the terrain draws layers of texture, chosen by what the ground is made of, how steep it is, and
//! how deep below the pristine surface. [`GroundTextures`] are painted at the start, or are a game's own.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! # fn setup(mut commands: Commands, terrain: Terrain) {
//! commands.spawn((terrain, GroundLook { quality: GroundQuality::Low, variety: 0.3, ..default() }));
//! # }
//! fn loading(loading: Res<GroundLoading>) {
//!     if let Some(failure) = loading.failure() {
//!         error_once!("the game's own textures are missing: {failure}");
//!     } else if !loading.is_ready() {
//!         info_once!("textures are being painted");
//!     }
//! }
//! ```
//!
//! Add Bevy's renderer first: `add_plugins((DefaultPlugins, BurrowPlugins))`. In the other order no [`GroundLook`] is
//! drawn, and an error is logged; other materials work in any order.
//!
//! To use a material of your own, put it on the terrain instead, and add a [`TerrainMaterialPlugin`] for its type:
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! # #[derive(Asset, bevy::render::render_resource::AsBindGroup, TypePath, Clone)]
//! # struct Toon {}
//! # impl Material for Toon {}
//! # fn setup(app: &mut App, mut commands: Commands, terrain: Terrain, toon: Handle<Toon>) {
//! app.add_plugins((MaterialPlugin::<Toon>::default(), TerrainMaterialPlugin::<Toon>::default()));
//! commands.spawn((terrain, MeshMaterial3d(toon)));
//! # }
//! ```
//!
//! If that material has a vertex shader, see [`prepass_vertex_shader`].

pub mod ground;
mod material;
mod vertex;

#[doc(hidden)]
pub use ground::{
    ColorMap, GroundArrays, GroundArraysError, GroundBase, GroundLayer, GroundLayerImages, GroundLoading,
    GroundLook, GroundMaterial, GroundPlugin, GroundQuality, GroundTextureCache, GroundTextures,
    GroundTexturesError,
};
pub use material::TerrainMaterialPlugin;
pub use vertex::prepass_vertex_shader;
