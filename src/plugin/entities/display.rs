//! Shows on the entities of a terrain what a commit changed.

use bevy::camera::visibility::VisibilityClass;
use bevy::diagnostic::Diagnostics;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::terrain_entities::{TerrainEntities, apply_actions, is_empty, trigger_if_alive};
use crate::lattice::ChunkPos;
use crate::plugin::lod_state::WantedTiles;
use crate::plugin::meshes::{BuiltNode, BuiltSurface, PendingMesh};
use crate::plugin::reports::Reports;
use crate::plugin::{BurrowFigures, ChunkChanged, ChunkCreated};
use crate::terrain::{FieldChange, MeshKey, World as TerrainWorld};

/// The parameters of systems that commit: entities, meshes and figures.
#[derive(SystemParam)]
pub(in crate::plugin) struct Display<'w, 's> {
    pub commands: Commands<'w, 's>,
    pub assets: Option<ResMut<'w, Assets<Mesh>>>,
    meshes: Query<'w, 's, &'static Mesh3d>,
    wanted: Res<'w, WantedTiles>,
    pub reports: Reports<'w>,
    pub figures: ResMut<'w, BurrowFigures>,
    pub diagnostics: Diagnostics<'w, 's>,
}

impl Display<'_, '_> {
    /// Shows all that a commit changed of a terrain.
    pub fn show(
        &mut self,
        (entity, world): (Entity, &TerrainWorld),
        entities: &mut TerrainEntities,
        surfaces: Vec<BuiltSurface>,
        fields: &[(ChunkPos, FieldChange)],
        is_step: bool,
    ) {
        let with_fields = fields.iter().map(|&(chunk, _)| (MeshKey::Chunk(chunk), None));
        let with_surfaces = surfaces.into_iter().map(|built| (built.drawn, Some(built)));
        let mut touched = Vec::new();
        for (drawn, built) in with_surfaces.chain(with_fields) {
            if let (MeshKey::Chunk(chunk), true) = (drawn, is_step) {
                touched.push(chunk);
            }
            self.show_part((entity, world), entities, drawn, built);
        }
        entities.update_fields(&mut self.commands, world, fields);
        entities.drop_empty(&mut self.commands, world, touched);
    }

    /// Shows a tile or chunk with its new surface, if it has a new one; spawns its entity if it has none yet.
    fn show_part(
        &mut self,
        (entity, world): (Entity, &TerrainWorld),
        entities: &mut TerrainEntities,
        drawn: MeshKey,
        built: Option<BuiltSurface>,
    ) {
        let commands = &mut self.commands;
        let child = entities.get(commands, drawn);
        let is_new = child.is_none();
        let is_gone = match drawn {
            MeshKey::Chunk(chunk) => is_empty(world, chunk),
            // It has an entity while it is drawn, or wanted.
            MeshKey::Tile(_) => built.as_ref().is_some_and(|built| !built.is_drawn),
        };
        if is_new && (is_gone || built.as_ref().is_some_and(|built| built.shown.is_empty)) {
            return;
        }
        let child = child.unwrap_or_else(|| entities.spawn(commands, entity, world, drawn));
        let has_changed = built.is_some();
        if let Some(BuiltSurface { mesh, shown, actions, is_drawn, .. }) = built {
            if let Some(assets) = &mut self.assets
                && is_drawn
            {
                swap(commands, assets, child, self.meshes.get(child).ok(), mesh);
                self.figures.swaps += 1;
            }
            apply_actions(commands, child, shown, actions);
        }
        match drawn {
            MeshKey::Chunk(_) if is_new => trigger_if_alive(commands, ChunkCreated { entity: child }),
            MeshKey::Chunk(_) if has_changed => trigger_if_alive(commands, ChunkChanged { entity: child }),
            _ => {}
        }
    }

    /// Shows nodes as they are drawn from now on.
    pub fn show_nodes(
        &mut self,
        (entity, world): (Entity, &TerrainWorld),
        entities: &mut TerrainEntities,
        nodes: Vec<BuiltNode>,
    ) {
        for BuiltNode { node, mesh, shown, hidden } in nodes {
            for drawn in hidden {
                self.hide_part(entity, entities, drawn);
            }
            for built in shown {
                self.show_part((entity, world), entities, built.drawn, Some(built));
            }
            let commands = &mut self.commands;
            let Some(mesh) = mesh else {
                entities.despawn_node(commands, node);
                continue;
            };
            let child = entities.node(commands, entity, world, node);
            if let Some(assets) = &mut self.assets {
                swap(commands, assets, child, self.meshes.get(child).ok(), mesh);
                self.figures.swaps += 1;
            }
        }
    }

    /// Stops drawing a tile or chunk. A tile that nothing else needs loses its entity.
    fn hide_part(&mut self, terrain: Entity, entities: &mut TerrainEntities, drawn: MeshKey) {
        let Some(child) = entities.get(&mut self.commands, drawn) else { return };
        match drawn {
            MeshKey::Tile(tile) if !self.wanted.has(terrain, tile) => {
                entities.despawn_tile(&mut self.commands, tile);
            }
            _ => {
                self.commands.entity(child).try_remove::<Drawing>();
            }
        }
    }
}

/// The components that an entity loses when it draws nothing. Bevy adds to the list of visibility classes with each
/// `Mesh3d` that is inserted and never takes anything from it: the entity would be seen twice after the next one.
type Drawing = (Mesh3d, VisibilityClass);

/// Bevy's renderer forgets which material an entity has when its mesh is removed, and asks again only when it comes
/// into view or gets another material.
fn refresh_material(mut child: EntityWorldMut) {
    if let Some(mut visibility) = child.get_mut::<ViewVisibility>() {
        visibility.set_changed();
    }
}

/// Replaces an entity's mesh: under the same handle, unless the new one was uploaded already.
fn swap(
    commands: &mut Commands,
    assets: &mut Assets<Mesh>,
    child: Entity,
    shown: Option<&Mesh3d>,
    mesh: Option<PendingMesh>,
) {
    let Ok(mut child) = commands.get_entity(child) else { return };
    let Some(mesh) = mesh else {
        child.try_remove::<Drawing>();
        return;
    };
    let (facts, former) = (mesh.facts.clone(), shown.map(|shown| &shown.0));
    let handle = mesh.show(assets, former);
    if former != Some(&handle) {
        child.try_insert(Mesh3d(handle)).queue_silenced(refresh_material);
    }
    child.try_insert(facts);
}
