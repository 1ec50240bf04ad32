//! One material for each terrain: an entity with materials of two types is drawn with either, whichever Bevy extracts
//! last.

use bevy::prelude::*;

use super::propagate::{Overruled, PropagateSteps, propagate_to_ground, propagate_to_pieces};
use crate::plugin::components::Materials;
use crate::plugin::reports::{Report, Reported, Reports};
use crate::plugin::{Phase, TerrainReady};
use crate::terrain::Terrain;

/// The precedence of a look, which all other materials make way for.
const LOOK: usize = 63;

/// The names of the types that are propagated; those of a game in the order in which their plugins were added.
#[derive(Resource, Default)]
struct MaterialTypes(Vec<(usize, &'static str)>);

/// Records the materials of terrains, one bit for each type.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct NoteMaterials;

/// A terrain that was just shown, and may have no material.
#[derive(Component, Default)]
struct JustReady;

/// Propagates a material of a terrain to its tiles, chunks and pieces, if no other one takes precedence: the one of a
/// look does, or else the one whose plugin was added last.
pub(crate) fn propagate_material<M: Material>(app: &mut App) {
    let bit = app.world().get_resource::<MaterialTypes>().map_or(0, |types| types.0.len().min(LOOK - 1));
    choose::<M>(app, bit);
    propagate_to_ground::<MeshMaterial3d<M>>(app);
    propagate_to_pieces::<MeshMaterial3d<M>>(app);
}

/// Propagates the material of a look to tiles and chunks. It takes precedence over any other.
pub(crate) fn propagate_look<M: Material>(app: &mut App) {
    choose::<M>(app, LOOK);
    propagate_to_ground::<MeshMaterial3d<M>>(app);
}

/// Adds the systems that choose between materials.
fn choose<M: Material>(app: &mut App, bit: usize) {
    app.init_resource::<MaterialTypes>().init_resource::<Reported>();
    if app.world().resource::<MaterialTypes>().0.is_empty() {
        app.configure_sets(Phase::Propagate, NoteMaterials.in_set(PropagateSteps::Choose)).add_systems(
            Phase::Propagate,
            warn_of_several.in_set(PropagateSteps::Choose).after(NoteMaterials),
        );
    }
    app.world_mut().resource_mut::<MaterialTypes>().0.push((bit, std::any::type_name::<M>()));
    let note = move |mut terrains: Query<(&mut Materials, Has<MeshMaterial3d<M>>), With<Terrain>>| {
        for (mut materials, has) in &mut terrains {
            let others = materials.0 & !(1 << bit);
            materials.set_if_neq(Materials(others | u64::from(has) << bit));
        }
    };
    let overrule =
        move |mut commands: Commands,
              terrains: Query<(Entity, Ref<Materials>, Has<Overruled<MeshMaterial3d<M>>>)>| {
            for (entity, materials, is_overruled) in
                terrains.iter().filter(|(_, materials, _)| materials.is_changed())
            {
                let is_there = materials.0 >> bit & 1 > 0;
                let has_better = bit < LOOK && materials.0 >> (bit + 1) > 0;
                match (is_there && has_better, is_overruled) {
                    (true, false) => {
                        commands.entity(entity).try_insert(Overruled::<MeshMaterial3d<M>>::default());
                    }
                    (false, true) => {
                        commands.entity(entity).try_remove::<Overruled<MeshMaterial3d<M>>>();
                    }
                    _ => {}
                }
            }
        };
    app.add_systems(
        Phase::Propagate,
        (
            // They write different bits.
            note.in_set(NoteMaterials).ambiguous_with(NoteMaterials),
            overrule.in_set(PropagateSteps::Choose).after(NoteMaterials),
        ),
    );
}

/// Logs terrains that have several materials.
fn warn_of_several(
    terrains: Query<(Entity, &Materials), Changed<Materials>>,
    types: Res<MaterialTypes>,
    reports: Reports,
) {
    for (entity, materials) in &terrains {
        if materials.0.count_ones() > 1 && reports.is_new(entity, Report::SeveralMaterials) {
            let mut own: Vec<_> = types.0.iter().filter(|(bit, _)| materials.0 >> bit & 1 > 0).collect();
            own.sort_unstable();
            let names: Vec<&str> = own.iter().map(|(_, name)| *name).collect();
            warn!(
                "the terrain {entity} has materials of several types and is drawn with the last of these: {}; remove the \
                 others' `MeshMaterial3d`",
                names.join(", ")
            );
        }
    }
}

/// Adds a system that logs terrains whose material has textures: meshes of ground have no texture coordinates.
pub(crate) fn warn_of_textures(app: &mut App) {
    app.init_resource::<Reported>().add_systems(
        Phase::Propagate,
        warn_of_unused_textures
            .after(PropagateSteps::Propagate)
            .run_if(resource_exists::<Assets<StandardMaterial>>),
    );
}

fn warn_of_unused_textures(
    terrains: Query<
        (Entity, &MeshMaterial3d<StandardMaterial>),
        (With<Terrain>, Changed<MeshMaterial3d<StandardMaterial>>),
    >,
    materials: Res<Assets<StandardMaterial>>,
    reports: Reports,
) {
    for (entity, material) in &terrains {
        let Some(material) = materials.get(&material.0) else { continue };
        let textures = [
            &material.base_color_texture,
            &material.normal_map_texture,
            &material.metallic_roughness_texture,
            &material.occlusion_texture,
            &material.emissive_texture,
        ];
        if textures.into_iter().any(Option::is_some) && reports.is_new(entity, Report::Textures) {
            warn!(
                "the textures in the `StandardMaterial` of the terrain {entity} are not drawn: meshes of ground have no \
                 texture coordinates. Use a `GroundLook` with `GroundTextures` of your own, or a material that projects them"
            );
        }
    }
}

/// Adds systems that log terrains which are shown and have nothing to be drawn with: neither a material nor a look,
/// which may still wait for its textures.
pub(crate) fn warn_of_undrawn<L: Component>(app: &mut App) {
    let note = |ready: On<TerrainReady>, mut commands: Commands| {
        commands.entity(ready.entity).try_insert(JustReady);
    };
    app.init_resource::<Reported>()
        .init_resource::<MaterialTypes>()
        .add_observer(note)
        .add_systems(Phase::Propagate, warn_of_nothing::<L>.after(PropagateSteps::Propagate));
}

/// A game may dress a terrain when it is ready, so this is asked a little later.
fn warn_of_nothing<L: Component>(
    mut commands: Commands,
    terrains: Query<(Entity, &Materials, Has<L>), (With<Terrain>, With<JustReady>)>,
    types: Res<MaterialTypes>,
    reports: Reports,
) {
    for (entity, materials, has_look) in &terrains {
        commands.entity(entity).try_remove::<JustReady>();
        if materials.0 == 0 && !has_look && reports.is_new(entity, Report::NoMaterial) {
            let names: Vec<&str> = types.0.iter().map(|(_, name)| *name).collect();
            warn!(
                "the terrain {entity} is ready, and nothing of it is drawn: insert a `GroundLook` or a `MeshMaterial3d` on its \
                 entity. Materials of these types go to its tiles: {}; add a `TerrainMaterialPlugin` for another type",
                names.join(", ")
            );
        }
    }
}
