//! The entities below a terrain: tiles, chunks and fields, spawned and despawned as the world changes.

use bevy::ecs::entity::EntityHashSet;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;

use crate::lattice::{ChunkPos, TilePos};
use crate::lod::Node;
use crate::plugin::meshes::{VertexKind, node_origin};
use crate::plugin::{
    Chunk, CommitAction, Field, FieldChanged, FieldCreated, FieldMerged, ShownSurface, TerrainReady, Tile,
};
use crate::terrain::{FieldChange, MeshKey, Terrain, Version, World};
use crate::volume::{self, FieldId};

/// The entities below a terrain, and the world that they show. A terrain has this component once it has loaded.
#[derive(Component)]
pub struct TerrainEntities {
    pub(in crate::plugin) shown: Version,
    /// Metres along the side of the voxels that they were built for.
    pub(in crate::plugin) voxel_size: f32,
    /// The attributes of their vertices.
    pub(in crate::plugin) vertices: VertexKind,
    /// Whether they were built with [`LevelsOfDetail`](crate::plugin::LevelsOfDetail).
    pub(in crate::plugin) has_lod: bool,
    /// Whether all of them have to be rebuilt.
    pub(in crate::plugin) is_outdated: bool,
    drawn: HashMap<MeshKey, Entity>,
    /// Nodes of level 1 and above.
    nodes: HashMap<Node, Entity>,
    fields: HashMap<FieldId, Entity>,
    /// Tiles that have an entity whether they are drawn or not.
    kept: HashSet<TilePos>,
    /// Whether [`TerrainReady`] was triggered.
    is_ready_sent: bool,
}

impl TerrainEntities {
    pub(in crate::plugin) fn new(
        shown: Version,
        voxel_size: f32,
        vertices: VertexKind,
        has_lod: bool,
    ) -> Self {
        Self {
            shown,
            voxel_size,
            vertices,
            has_lod,
            is_outdated: false,
            drawn: HashMap::default(),
            nodes: HashMap::default(),
            fields: HashMap::default(),
            kept: HashSet::default(),
            is_ready_sent: false,
        }
    }

    /// Whether they show the current state of this world. `false` while changes of the game load.
    pub(crate) fn show(&self, world: &World) -> bool {
        self.shown == world.version()
    }

    /// Triggers [`TerrainReady`], once.
    pub(in crate::plugin) fn trigger_ready(&mut self, commands: &mut Commands, terrain: Entity) {
        if !self.is_ready_sent {
            self.is_ready_sent = true;
            trigger_if_alive(commands, TerrainReady { entity: terrain });
        }
    }

    /// Despawns tiles and chunks; fields lie below these. The last of the terrain's children goes first: Bevy looks for
    /// each from the end of their list, and moves up what is behind it.
    pub(in crate::plugin) fn despawn(&self, commands: &mut Commands, children: Option<&Children>) {
        let mut own: EntityHashSet = self.drawn.values().chain(self.nodes.values()).copied().collect();
        for child in children.into_iter().flat_map(|children| children.iter().rev()) {
            if own.remove(&child) {
                commands.entity(child).try_despawn();
            }
        }
        // Entities that a game moved to another parent.
        own.into_iter().for_each(|entity| commands.entity(entity).try_despawn());
    }

    /// The entity of a tile or chunk, if it has one and the game did not despawn it.
    pub(in crate::plugin) fn get(&self, commands: &mut Commands, drawn: MeshKey) -> Option<Entity> {
        self.drawn.get(&drawn).copied().filter(|&child| commands.get_entity(child).is_ok())
    }

    /// Spawns the entity of a tile or chunk below its terrain.
    pub(in crate::plugin) fn spawn(
        &mut self,
        commands: &mut Commands,
        terrain: Entity,
        world: &World,
        drawn: MeshKey,
    ) -> Entity {
        let place = Transform::from_translation(world.origin(drawn).as_vec3());
        let child = match drawn {
            MeshKey::Tile(tile) => spawn_below(commands, terrain, (Tile::from(tile), place)),
            MeshKey::Chunk(chunk) => spawn_below(commands, terrain, (Chunk::from(chunk), place)),
        };
        self.drawn.insert(drawn, child);
        child
    }

    /// Might a body over this tile fall through, as the tile has no entity yet that could have a collider?
    #[cfg(feature = "avian")]
    pub(crate) fn lack(&self, tile: TilePos) -> bool {
        self.has_lod && !self.drawn.contains_key(&MeshKey::Tile(tile))
    }

    /// The entity with the mesh of a node, which is spawned if there is none. One of level 0 is its tile's.
    pub(in crate::plugin) fn node(
        &mut self,
        commands: &mut Commands,
        terrain: Entity,
        world: &World,
        node: Node,
    ) -> Entity {
        if node.level == 0 {
            let drawn = MeshKey::Tile(node.tile());
            let tile = self.get(commands, drawn);
            return tile.unwrap_or_else(|| self.spawn_shown_tile(commands, terrain, world, node.tile()));
        }
        let old = self.nodes.get(&node).copied().filter(|&child| commands.get_entity(child).is_ok());
        old.unwrap_or_else(|| {
            let place = Transform::from_translation(node_origin(world.grid(), node).as_vec3());
            let child = spawn_below(commands, terrain, (Tile::from(node), place));
            self.nodes.insert(node, child);
            child
        })
    }

    /// Spawns the entity of a tile whose own surface is not drawn.
    fn spawn_shown_tile(
        &mut self,
        commands: &mut Commands,
        terrain: Entity,
        world: &World,
        tile: TilePos,
    ) -> Entity {
        let child = self.spawn(commands, terrain, world, MeshKey::Tile(tile));
        let shown = ShownSurface { revision: world.revision(), is_empty: false };
        commands.entity(child).try_insert(shown);
        child
    }

    /// Despawns the entity of a node of level 1 or above, if it has one.
    pub(super) fn despawn_node(&mut self, commands: &mut Commands, node: Node) {
        if let Some(child) = self.nodes.remove(&node) {
            commands.entity(child).try_despawn();
        }
    }

    /// Despawns the entity of a tile, if it has one.
    pub(super) fn despawn_tile(&mut self, commands: &mut Commands, tile: TilePos) {
        if let Some(child) = self.drawn.remove(&MeshKey::Tile(tile)) {
            commands.entity(child).try_despawn();
        }
    }

    /// Gives these tiles an entity, and takes it from others that are not drawn.
    pub(in crate::plugin) fn keep_tiles(
        &mut self,
        commands: &mut Commands,
        entity: Entity,
        terrain: &Terrain,
        wanted: &HashSet<TilePos>,
    ) {
        let Some(cut) = terrain.drawn_cut().map(|drawn| drawn.cut()) else { return };
        let (kept, gone) = (&self.kept, |tile: &&TilePos| !wanted.contains(*tile));
        let is_drawn = |tile: TilePos| cut.contains(Node::over(tile, 0));
        let gone: Vec<TilePos> = kept.iter().filter(gone).copied().collect();
        for tile in gone {
            self.kept.remove(&tile);
            if !is_drawn(tile) {
                self.despawn_tile(commands, tile);
            }
        }
        for &tile in wanted {
            self.kept.insert(tile);
            if !self.drawn.contains_key(&MeshKey::Tile(tile)) {
                self.spawn_shown_tile(commands, entity, terrain.world(), tile);
            }
        }
    }

    /// Spawns the entity of a field below its chunk, which must have one.
    pub(in crate::plugin) fn spawn_field(
        &mut self,
        commands: &mut Commands,
        chunk: ChunkPos,
        field: &volume::Field,
    ) {
        let Some(parent) = self.get(commands, MeshKey::Chunk(chunk)) else { return };
        let child = spawn_below(commands, parent, Field::from(field));
        self.fields.insert(field.id, child);
        trigger_if_alive(commands, FieldCreated { entity: child });
    }

    /// Updates the entities of fields that a commit changed, and triggers their events.
    pub(super) fn update_fields(
        &mut self,
        commands: &mut Commands,
        world: &World,
        news: &[(ChunkPos, FieldChange)],
    ) {
        for &(chunk, news) in news {
            let field = |id| world.fields_of(chunk).and_then(|fields| fields.get(id));
            match news {
                FieldChange::Created(id) => {
                    if let Some(field) = field(id) {
                        self.spawn_field(commands, chunk, field);
                    }
                }
                FieldChange::Changed(id) => {
                    let Some(field) = field(id) else { continue };
                    match self.living_field(commands, id) {
                        Some(child) => {
                            commands.entity(child).try_insert(Field::from(field));
                            trigger_if_alive(commands, FieldChanged { entity: child });
                        }
                        None => self.spawn_field(commands, chunk, field),
                    }
                }
                FieldChange::Removed(id) => {
                    let child = self.living_field(commands, id);
                    self.fields.remove(&id);
                    child.into_iter().for_each(|child| commands.entity(child).try_despawn());
                }
                FieldChange::Merged { gone, into } => {
                    let child = self.living_field(commands, gone);
                    let into = self.living_field(commands, into);
                    self.fields.remove(&gone);
                    let Some(child) = child else { continue };
                    if let Some(into) = into {
                        trigger_if_alive(commands, FieldMerged { entity: child, into });
                    }
                    commands.entity(child).try_despawn();
                }
            }
        }
    }

    /// Despawns chunks of this list that draw nothing and have no field any more, as after an undo.
    pub(super) fn drop_empty(&mut self, commands: &mut Commands, world: &World, chunks: Vec<ChunkPos>) {
        for chunk in chunks {
            if is_empty(world, chunk) {
                let child = self.get(commands, MeshKey::Chunk(chunk));
                self.drawn.remove(&MeshKey::Chunk(chunk));
                child.into_iter().for_each(|child| commands.entity(child).try_despawn());
            }
        }
    }

    fn living_field(&self, commands: &mut Commands, id: FieldId) -> Option<Entity> {
        self.fields.get(&id).copied().filter(|&child| commands.get_entity(child).is_ok())
    }
}

/// Spawns a child, unless its parent is gone by the time the command runs. It belongs to its parent from the start, for
/// observers of what it is.
fn spawn_below(commands: &mut Commands, parent: Entity, bundle: impl Bundle) -> Entity {
    let child = commands.spawn_empty().id();
    commands.queue(move |world: &mut bevy::ecs::world::World| {
        if world.get_entity(parent).is_ok() {
            if let Ok(mut child) = world.get_entity_mut(child) {
                child.insert((bundle, ChildOf(parent)));
            }
        } else {
            world.despawn(child);
        }
    });
    child
}

/// Triggers an event, unless its entity is gone by the time the command runs.
pub(crate) fn trigger_if_alive<'a, E: EntityEvent<Trigger<'a>: Default>>(commands: &mut Commands, event: E) {
    commands.queue(move |world: &mut bevy::ecs::world::World| {
        if world.get_entity(event.event_target()).is_ok() {
            world.trigger(event);
        }
    });
}

/// Whether a chunk has no field and draws nothing.
pub(super) fn is_empty(world: &World, chunk: ChunkPos) -> bool {
    world.fields_of(chunk).is_none() && !world.meshes.may_draw(chunk)
}

/// Records which surface an entity shows, and runs the actions that come with it.
pub(in crate::plugin) fn apply_actions(
    commands: &mut Commands,
    child: Entity,
    shown: ShownSurface,
    actions: Vec<CommitAction>,
) {
    let Ok(mut child) = commands.get_entity(child) else { return };
    child.try_insert(shown);
    for action in actions {
        action(&mut child);
    }
}
