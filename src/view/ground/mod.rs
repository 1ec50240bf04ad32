//! The look of the ground: layers of texture, chosen by material.
//!
//! | part | content |
//! | --- | --- |
//! | [`GroundLook`] | a terrain's settings; put it on the terrain instead of a material |
//! | [`GroundTextures`] | the textures: baked by this crate, or a game's own |
//! | [`GroundLoading`] | their progress, and why a game's own are not used |
//! | [`GroundMaterial`] | the resulting material |
//!
//! # How layers meet
//!
//! The corners of a triangle list the same materials, each with a weight that is blended between them: linear along any
//! edge, whichever triangle one comes from. Noise of about the size of a cell multiplies the weights, so that borders
//! do not run along edges of triangles. A pixel samples its two strongest layers, less the weight of the third one, so
//! that none comes or goes with a jump, and where both weigh nearly the same their heights decide which is on top. So
//! what shows is always what a vertex of the triangle has, and a border strays from the middle between two vertices by
//! less than half their distance.

mod bake;
mod cache;
mod fit;
mod look;
mod material;
mod noise;
mod pack;
mod paint;
mod palette;
mod pieces;
#[cfg(test)]
mod stage;
mod textures;

pub use cache::GroundTextureCache;
pub use fit::GroundTexturesError;
#[doc(hidden)]
pub use look::MAX_LAYERS;
pub use look::{ColorMap, GroundLayer, GroundLook, GroundQuality};
pub use material::GroundMaterial;
#[doc(hidden)]
pub use material::{GroundBase, GroundExtension};
pub use pack::{GroundArrays, GroundArraysError, GroundLayerImages};
pub use textures::{GroundLoading, GroundTextures};

use bevy::asset::{AssetEventSystems, embedded_asset};
use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::pbr::{MaterialPlugin, PbrPlugin};
use bevy::prelude::*;

use super::vertex::VertexPlugin;
use crate::plugin::{
    BurrowSystems, GroundPiece, Phase, SkyLight, SlimVertices, propagate_look, remove_inherited,
    warn_of_textures, warn_of_undrawn,
};
use crate::terrain::Terrain;
use material::GroundUniform;

/// Applies materials and textures to terrains that have a [`GroundLook`]. Does nothing without a renderer. Add it after
/// Bevy's plugins; otherwise no ground is drawn and an error is logged.
#[doc(hidden)]
#[derive(Default)]
pub struct GroundPlugin;

impl Plugin for GroundPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<GroundTextures>().init_resource::<GroundLoading>().add_observer(thicken_vertices);
        if !app.is_plugin_added::<PbrPlugin>() {
            return;
        }
        VertexPlugin::add_once(app);
        embedded_asset!(app, "ground.wgsl");
        // Pieces have separate materials, which contain their original position in the ground.
        propagate_look::<GroundMaterial>(app);
        warn_of_undrawn::<GroundLook>(app);
        warn_of_textures(app);
        keep_materials(app);
        app.add_plugins(MaterialPlugin::<GroundMaterial>::default())
            .add_systems(Phase::Look, textures::load_textures.before(add_materials));
    }

    fn finish(&self, app: &mut App) {
        if is_before_renderer(app) {
            error!(
                "no terrain with a GroundLook will be drawn: BurrowPlugins were added before Bevy's PbrPlugin. \
                 Add DefaultPlugins first"
            );
        }
    }
}

/// Adds the systems that create materials and update them with terrains and looks.
fn keep_materials(app: &mut App) {
    let look = Phase::Look.system(app).after(BurrowSystems::Begin).before(BurrowSystems::Propagate);
    app.add_systems(Update, look)
        .add_systems(Phase::Look, (add_materials, remove_materials).chain())
        .add_systems(
            Phase::Propagate,
            (remove_inherited::<MeshMaterial3d<GroundMaterial>, GroundPiece>, pieces::add_materials).chain(),
        )
        // Transforms are final by then; a material that changes later shows only in the next frame.
        .add_systems(
            PostUpdate,
            (note_color_maps.run_if(on_message::<AssetEvent<Image>>), follow, pieces::follow)
                .chain()
                .after(TransformSystems::Propagate)
                .before(AssetEventSystems),
        );
}

/// The material that this plugin gave a terrain. A material that the game inserted is not removed.
#[derive(Component, Clone, Copy)]
struct OwnMaterial(AssetId<GroundMaterial>);

/// Gives each terrain with a look its material as soon as the textures are there, and another one when these change.
fn add_materials(
    mut commands: Commands,
    loading: Res<GroundLoading>,
    looks: Query<
        (Entity, &GroundLook, &GlobalTransform, Option<&MeshMaterial3d<GroundMaterial>>),
        With<Terrain>,
    >,
    images: Res<Assets<Image>>,
    mut materials: ResMut<Assets<GroundMaterial>>,
) {
    let Some(textures) = &loading.ready else { return };
    for (entity, look, place, material) in &looks {
        let current = material.and_then(|material| materials.get(&material.0));
        let fits = |current: &GroundMaterial| {
            let GroundExtension { albedo, relief, without_anisotropy, .. } = &current.extension;
            albedo.as_ref() == Some(&textures.albedo)
                && relief.as_ref() == Some(&textures.relief)
                && *without_anisotropy == textures.without_anisotropy
        };
        if current.is_some_and(fits) {
            continue;
        }
        let extension = GroundExtension {
            // The terrain's size comes with `follow`, in the same frame.
            uniform: GroundUniform::new(look, place, IVec2::ONE),
            albedo: Some(textures.albedo.clone()),
            relief: Some(textures.relief.clone()),
            noise: Some(textures.noise.clone()),
            color_map: loaded_color_map(look, &images),
            without_anisotropy: textures.without_anisotropy,
            quality: look.quality,
        };
        let base = current.map_or_else(GroundBase::default, |current| current.base.clone());
        let own = materials.add(GroundMaterial { base, extension });
        commands.entity(entity).try_insert((OwnMaterial(own.id()), MeshMaterial3d(own)));
    }
}

/// Restores vertex colours on a terrain that lost its look.
fn thicken_vertices(gone: On<Remove, GroundLook>, mut commands: Commands) {
    commands.entity(gone.entity).try_remove::<(SlimVertices, SkyLight)>();
}

/// Removes the material of a terrain that has lost its look and has no other material.
fn remove_materials(
    mut commands: Commands,
    with_own: Query<(Entity, Option<&MeshMaterial3d<GroundMaterial>>, &OwnMaterial), Without<GroundLook>>,
) {
    for (entity, material, own) in &with_own {
        let mut terrain = commands.entity(entity);
        terrain.try_remove::<OwnMaterial>();
        if material.is_some_and(|material| material.0.id() == own.0) {
            terrain.try_remove::<MeshMaterial3d<GroundMaterial>>();
        }
    }
}

fn uniform_of(terrain: &Terrain, look: &GroundLook, place: &GlobalTransform) -> GroundUniform {
    let ground = terrain.world().ground();
    GroundUniform::new(look, place, IVec2::new(ground.width(), ground.depth()))
}

/// A look's colour map, if it is loaded: a material with one that is not would not be drawn.
fn loaded_color_map(look: &GroundLook, images: &Assets<Image>) -> Option<Handle<Image>> {
    let image = &look.color_map.as_ref()?.image;
    images.contains(image).then(|| image.clone())
}

/// A colour map that is loaded, or loaded again, changes the looks that have it.
fn note_color_maps(
    mut events: MessageReader<AssetEvent<Image>>,
    mut looks: Query<&mut GroundLook, (With<Terrain>, Allow<Disabled>)>,
    mut materials: ResMut<Assets<GroundMaterial>>,
) {
    let changed: Vec<AssetId<Image>> = events
        .read()
        .filter_map(|event| match event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => Some(*id),
            _ => None,
        })
        .collect();
    for mut look in &mut looks {
        let Some(map) = &look.color_map else { continue };
        let id = map.image.id();
        if !changed.contains(&id) {
            continue;
        }
        look.set_changed();
        // Materials that show it already are bound to what it was before.
        let is_bound = |(own, material): (_, &GroundMaterial)| {
            let map = material.extension.color_map.as_ref();
            map.is_some_and(|map| map.id() == id).then_some(own)
        };
        let bound: Vec<_> = materials.iter().filter_map(is_bound).collect();
        for own in bound {
            if let Some(mut material) = materials.get_mut(own) {
                let _: &mut GroundMaterial = &mut material;
            }
        }
    }
}

/// Textures move with the terrain, in the frame that draws it elsewhere, and follow its look.
fn follow(
    looks: Query<
        (&Terrain, &GroundLook, &GlobalTransform, &MeshMaterial3d<GroundMaterial>),
        (
            Or<(Changed<GroundLook>, Changed<GlobalTransform>, Changed<MeshMaterial3d<GroundMaterial>>)>,
            Allow<Disabled>,
        ),
    >,
    images: Res<Assets<Image>>,
    mut materials: ResMut<Assets<GroundMaterial>>,
) {
    for (terrain, look, place, material) in &looks {
        // Bevy prepares the material and all tiles again once it is touched, and a terrain's transform counts as
        // changed whenever anything below it moves.
        let (uniform, quality) = (uniform_of(terrain, look, place), look.quality);
        let color_map = loaded_color_map(look, &images);
        let is_other = |material: &GroundMaterial| {
            let own = &material.extension;
            own.uniform != uniform || own.quality != quality || own.color_map != color_map
        };
        if !materials.get(&material.0).is_some_and(is_other) {
            continue;
        }
        if let Some(mut material) = materials.get_mut(&material.0) {
            material.extension.uniform = uniform;
            material.extension.quality = quality;
            material.extension.color_map = color_map;
        }
    }
}

/// Whether Bevy's renderer for materials was added only after the ground.
fn is_before_renderer(app: &App) -> bool {
    app.is_plugin_added::<PbrPlugin>() && !app.is_plugin_added::<MaterialPlugin<GroundMaterial>>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bevy identifies plugins by their names.
    struct Renderer;

    impl Plugin for Renderer {
        fn build(&self, _: &mut App) {}

        fn name(&self) -> &str {
            std::any::type_name::<PbrPlugin>()
        }
    }

    fn app() -> App {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, AssetPlugin::default()));
        app
    }

    #[test]
    fn the_ground_comes_after_the_renderer_or_without_one() {
        assert!(!is_before_renderer(app().add_plugins(GroundPlugin)));
        assert!(!is_before_renderer(app().add_plugins((Renderer, GroundPlugin))));
        assert!(is_before_renderer(app().add_plugins((GroundPlugin, Renderer))));
    }

    fn material_of(app: &App, terrain: Entity) -> Option<MeshMaterial3d<GroundMaterial>> {
        app.world().get(terrain).cloned()
    }

    #[test]
    fn a_look_that_makes_way_for_another_one_leaves_no_frame_without_ground() {
        let mut app = stage::app();
        let terrain = stage::spawn_terrain(&mut app);
        app.update();
        let before = material_of(&app, terrain);
        assert!(before.is_some());
        let other = GroundLook { variety: 0.9, ..default() };
        app.world_mut().entity_mut(terrain).remove::<GroundLook>().insert(other.clone());
        app.update();
        assert_eq!(material_of(&app, terrain), before);
        let uniform = GroundUniform::new(&other, &GlobalTransform::IDENTITY, stage::SIZE);
        assert_eq!(stage::extension(&app, terrain).uniform, uniform);
        app.world_mut().entity_mut(terrain).remove::<GroundLook>();
        app.update();
        assert_eq!(material_of(&app, terrain), None);
    }

    #[test]
    fn a_color_map_shows_once_it_is_loaded_and_again_when_it_changes() {
        let mut app = stage::app();
        let terrain = stage::spawn_terrain(&mut app);
        let handle = app.world().resource::<Assets<Image>>().reserve_handle();
        let look = GroundLook { color_map: Some(ColorMap::new(handle.clone())), ..default() };
        app.world_mut().entity_mut(terrain).insert(look);
        let piece = app.world_mut().spawn(GroundPiece { terrain, origin: IVec3::ONE }).id();
        (0..3).for_each(|_| app.update());
        assert_eq!(stage::extension(&app, terrain).color_map, None, "ground is drawn without it");
        let load = |app: &mut App| {
            let mut images = app.world_mut().resource_mut::<Assets<Image>>();
            images.insert(&handle, Image::default()).expect("a handle of these assets");
            app.update();
            app.update();
        };
        load(&mut app);
        for entity in [terrain, piece] {
            assert_eq!(stage::extension(&app, entity).color_map, Some(handle.clone()));
        }
        // Materials are bound again to what is loaded again.
        app.world_mut().resource_mut::<Messages<AssetEvent<GroundMaterial>>>().clear();
        load(&mut app);
        let mut events = app.world_mut().resource_mut::<Messages<AssetEvent<GroundMaterial>>>();
        let changes = events.drain().filter(|event| matches!(event, AssetEvent::Modified { .. })).count();
        assert_eq!(changes, 2, "the terrain and its piece");
        app.world_mut().get_mut::<GroundLook>(terrain).expect("a look").color_map = None;
        app.update();
        for entity in [terrain, piece] {
            assert_eq!(stage::extension(&app, entity).color_map, None);
        }
    }

    #[test]
    fn a_terrain_that_is_disabled_meanwhile_shows_what_its_color_map_became() {
        let mut app = stage::app();
        let terrain = stage::spawn_terrain(&mut app);
        let handle = app.world().resource::<Assets<Image>>().reserve_handle();
        let look = GroundLook { color_map: Some(ColorMap::new(handle.clone())), ..default() };
        app.world_mut().entity_mut(terrain).insert(look);
        (0..3).for_each(|_| app.update());
        app.world_mut().entity_mut(terrain).insert(Disabled);
        app.update();
        let mut images = app.world_mut().resource_mut::<Assets<Image>>();
        images.insert(&handle, Image::default()).expect("a handle of these assets");
        // So long that the message of the asset is gone.
        (0..5).for_each(|_| app.update());
        app.world_mut().entity_mut(terrain).remove::<Disabled>();
        app.update();
        assert_eq!(stage::extension(&app, terrain).color_map, Some(handle));
    }

    #[test]
    fn a_material_that_the_game_put_on_a_terrain_stays_when_the_look_goes() {
        let mut app = stage::app();
        let terrain = stage::spawn_terrain(&mut app);
        app.update();
        let with_own = material_of(&app, terrain).expect("it is with_own");
        let mut materials = app.world_mut().resource_mut::<Assets<GroundMaterial>>();
        let copy = materials.get(&with_own.0).expect("it is there").clone();
        let own = MeshMaterial3d(materials.add(copy));
        app.world_mut().entity_mut(terrain).insert(own.clone());
        app.update();
        app.world_mut().entity_mut(terrain).remove::<GroundLook>();
        app.update();
        assert_eq!(material_of(&app, terrain), Some(own));
    }
}
