//! The plugin group that games add. It lies above all modules whose plugins it has.

use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

use crate::plugin::{HeightmapPlugin, TerrainPlugin};

/// Everything a game needs. Parts can be disabled, as in any plugin group.
///
/// Add them after Bevy's own, `add_plugins((DefaultPlugins, BurrowPlugins))`: otherwise no terrain with a `GroundLook`
/// is drawn, and an error is logged.
///
/// | plugin | what it does |
/// | --- | --- |
/// | `TerrainPlugin` | transactions, entities, messages |
/// | `HeightmapPlugin` | asset loader for heightmap images, where there is an `AssetPlugin` |
/// | `GroundFilePlugin` | grounds of files, where there is an `AssetPlugin` (feature `format`) |
/// | `TerrainPickingPlugin` | hits of pointers on the ground, for `bevy_picking` (feature `picking`) |
/// | `SavePlugin` | saves worlds of terrains with a `SavedWorld` (feature `store`) |
/// | `TerrainMaterialPlugin<StandardMaterial>` | propagates materials to tiles, chunks and pieces (feature `render`) |
/// | `GroundPlugin` | texture layers for terrains with a `GroundLook` (feature `render`) |
#[derive(Default)]
pub struct BurrowPlugins;

impl PluginGroup for BurrowPlugins {
    fn build(self) -> PluginGroupBuilder {
        let group = PluginGroupBuilder::start::<Self>().add(TerrainPlugin).add(HeightmapPlugin);
        #[cfg(feature = "format")]
        let group = group.add(crate::plugin::GroundFilePlugin);
        #[cfg(feature = "picking")]
        let group = group.add(crate::plugin::TerrainPickingPlugin);
        #[cfg(feature = "store")]
        let group = group.add(crate::saves::SavePlugin);
        #[cfg(feature = "render")]
        let group = group
            .add(crate::view::TerrainMaterialPlugin::<StandardMaterial>::default())
            .add(crate::view::GroundPlugin);
        group
    }
}
