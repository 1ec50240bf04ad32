//! How the ground looks: materials on tiles and chunks.

mod material;

pub use material::TerrainMaterialPlugin;
