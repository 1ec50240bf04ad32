#![deny(unsafe_code)]
#![warn(missing_docs)]
//! Diggable ground for Bevy.

pub mod brush;
pub mod ground;
pub mod lattice;
#[cfg(feature = "plugin")]
pub mod plugin;
pub mod surface;
pub mod terrain;
#[cfg(feature = "render")]
pub mod view;
pub mod volume;

/// What most games import.
pub mod prelude {
    pub use crate::brush::{Brush, BrushError, Edit, Operation, Roughness, Shape};
    pub use crate::ground::{
        ColumnMaterial, Detail, GreyImage, Ground, ImageLimits, ImageScale, MaterialControl, MaterialId,
        MaterialRule, NoiseHeights, NoiseKind,
    };
    #[cfg(feature = "plugin")]
    pub use crate::plugin::{
        BrushApplied, BurrowFigures, BurrowPlugins, BurrowSettings, BurrowSystems, Chunk, Field, HeightmapImage,
        MaterialColors, TargetedBrush, TerrainHit, TerrainReady, Terrains, Tile,
    };
    pub use crate::terrain::{Applied, Receipt, Rejection, ScenarioCounts, Span, Terrain, TerrainSettings};
    #[cfg(feature = "render")]
    pub use crate::view::TerrainMaterialPlugin;
    pub use crate::volume::Scenario;
}
