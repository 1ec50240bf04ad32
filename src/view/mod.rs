//! How the ground looks: materials on tiles, chunks and pieces.
//!
//! A [`GroundLook`] on the terrain draws layers of texture, chosen by what the ground is made of, how steep it is, and how
//! deep below the surface that was there before anyone dug. [`GroundTextures`] are painted at the start, or a game's own.
//!
//! ```no_run
//! # use bevy::prelude::*;
//! # use bevy_burrow::prelude::*;
//! # fn setup(mut commands: Commands, terrain: Terrain) {
//! commands.spawn((terrain, GroundLook { quality: GroundQuality::Low, cliffs: (0.8, 1.4), ..default() }));
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
//! Bevy's renderer must be there first: `add_plugins((DefaultPlugins, BurrowPlugins))`. The other way round no
//! [`GroundLook`] is drawn, and an error says so; other materials are handed on in any order.
//!
//! A game that has a material of its own puts that on the terrain instead, and adds a [`TerrainMaterialPlugin`] for it:
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

pub mod ground;
mod material;

pub use ground::{
    GroundArrays, GroundArraysError, GroundLayer, GroundLayerImages, GroundLayerKind, GroundLoading,
    GroundLook, GroundMaterial, GroundPlugin, GroundQuality, GroundStrata, GroundTextures,
    GroundTexturesError,
};
pub use material::TerrainMaterialPlugin;
