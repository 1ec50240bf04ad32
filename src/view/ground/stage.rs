//! A test app for materials that draws nothing, with terrains that have a look.

use bevy::prelude::*;

use super::keep_materials;
use super::look::GroundLook;
use super::material::{GroundExtension, GroundMaterial};
use super::textures::{GroundLoading, Textures};
use crate::ground::Ground;
use crate::plugin::{BurrowSystems, Phase};
use crate::terrain::{Terrain, TerrainSettings};

pub(super) fn textures(app: &mut App) -> Textures {
    let mut images = app.world_mut().resource_mut::<Assets<Image>>();
    let [albedo, relief, noise] = [(); 3].map(|()| images.add(Image::default()));
    Textures { albedo, relief, noise, without_anisotropy: false }
}

/// An app that draws nothing, and has textures.
pub(super) fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default()))
        .init_asset::<Image>()
        .init_asset::<GroundMaterial>()
        .init_resource::<GroundLoading>();
    keep_materials(&mut app);
    let propagate = Phase::Propagate.system(&mut app).in_set(BurrowSystems::Propagate);
    app.add_systems(Update, propagate);
    let ready = textures(&mut app);
    app.world_mut().resource_mut::<GroundLoading>().ready = Some(ready);
    app
}

/// Cells of the terrains along x and z.
pub(super) const SIZE: IVec2 = IVec2::splat(64);

pub(super) fn spawn_terrain(app: &mut App) -> Entity {
    let [width, depth] = SIZE.as_uvec2().to_array();
    let ground = Ground::flat(width, depth, 8.0).expect("valid");
    let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    app.world_mut().spawn((terrain, GroundLook::default(), GlobalTransform::IDENTITY)).id()
}

/// The material of an entity.
pub(super) fn extension(app: &App, of: Entity) -> GroundExtension {
    let material = app.world().get::<MeshMaterial3d<GroundMaterial>>(of).expect("it is dressed");
    let materials = app.world().resource::<Assets<GroundMaterial>>();
    materials.get(&material.0).expect("it is there").extension.clone()
}
