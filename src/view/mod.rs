//! How the ground looks: materials on tiles and chunks.

pub mod ground;
mod material;

pub use ground::{
    GroundLayer, GroundLayerKind, GroundLoading, GroundLook, GroundMaterial, GroundPlugin, GroundQuality,
    GroundStrata, GroundTextures,
};
pub use material::TerrainMaterialPlugin;
