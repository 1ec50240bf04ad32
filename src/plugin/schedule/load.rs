//! Loads new terrains: all surfaces are built in a task, and shown in one frame once all of them are there.

use std::collections::BTreeSet;
use std::sync::Arc;

use bevy::ecs::entity::EntityHashMap;
use bevy::platform::collections::HashMap;
use bevy::platform::time::Instant;
use bevy::prelude::*;
use rayon::prelude::*;

use super::task::{InFlight, TaskCounter};
use crate::lattice::ChunkPos;
use crate::lod::Cut;
use crate::plugin::entities::{TerrainEntities, apply_actions, trigger_if_alive};
use crate::plugin::figures::MainThread;
use crate::plugin::lod_state::{LevelsOfDetail, LodState, ShownLevels};
use crate::plugin::meshes::{
    BuildSettings, BuiltNode, BuiltSurface, PendingMesh, SurfaceBuilder, VertexExtras, VertexKind,
};
use crate::plugin::{
    BurrowFigures, BurrowSettings, ChunkCreated, Held, MaterialColors, SkyLight, SlimVertices,
};
use crate::terrain::{DrawnCut, KnownNodes, MeshKey, Terrain, World};
use crate::threads::{ThreadTask, Threads, panic_message};
use crate::world::sky::LitWorld;

/// Surfaces of one snapshot that are built, and passed to the renderer, until all can be shown.
#[derive(Component)]
pub(in crate::plugin) struct Loading {
    world: Arc<World>,
    pub(super) vertices: VertexKind,
    has_lod: bool,
    task: Option<ThreadTask<BuiltWorld>>,
    waiting: Vec<BuiltSurface>,
    ready: HashMap<MeshKey, BuiltSurface>,
    levels: Option<BuiltNodes>,
}

/// Everything that is built of a world.
type BuiltWorld = (Vec<BuiltSurface>, Option<BuiltNodes>);

/// The coarsest nodes of a world with levels of detail.
struct BuiltNodes {
    drawn: DrawnCut,
    nodes: Vec<BuiltNode>,
    known: Arc<KnownNodes>,
}

impl Loading {
    /// Whether these are surfaces of this terrain, even if the game has changed it since.
    pub(super) fn is_of(&self, terrain: &Terrain) -> bool {
        self.world.version().is_same_world(terrain.world().version())
    }

    /// Passes meshes to the renderer, as many as are left of a frame's budget. Returns whether it has all.
    fn upload(&mut self, assets: &mut Option<ResMut<Assets<Mesh>>>, budget: &mut usize) -> bool {
        let rest = self.waiting.len().saturating_sub(*budget);
        *budget -= self.waiting.len() - rest;
        for mut built in self.waiting.split_off(rest) {
            if let (Some(assets), Some(mesh)) = (assets.as_mut(), &mut built.mesh) {
                // The budget was spent on it above.
                mesh.upload(assets, &mut 1);
            }
            self.ready.insert(built.drawn, built);
        }
        self.waiting.is_empty()
    }
}

/// Terrains without a task that are not held.
type Idle = (Without<Loading>, Without<InFlight>, Without<Held>);

/// Starts the task of each terrain that is new, or whose world the game changed itself: then only the changed surfaces
/// are built.
pub(in crate::plugin) fn start_loading(
    mut commands: Commands,
    mut terrains: Query<
        (
            Entity,
            &mut Terrain,
            Option<&MaterialColors>,
            (Has<SlimVertices>, Option<&SkyLight>),
            Has<LevelsOfDetail>,
            Option<&TerrainEntities>,
        ),
        Idle,
    >,
    build: BuildSettings,
    settings: Res<BurrowSettings>,
    mut counter: ResMut<TaskCounter>,
) {
    for (entity, mut terrain, colors, (is_slim, sky_light), has_lod, entities) in &mut terrains {
        let kind = VertexKind::of(is_slim, sky_light);
        let is_same_kind = |entities: &&TerrainEntities| {
            !entities.is_outdated && (entities.vertices, entities.has_lod) == (kind, has_lod)
        };
        let entities_of_kind = entities.filter(is_same_kind);
        if entities_of_kind.is_some_and(|entities| entities.show(terrain.world())) {
            continue;
        }
        let extras = VertexExtras::of(colors, kind);
        let builder = build.builder((entity, &terrain), extras);
        // The game does not see this as a change.
        let model = terrain.bypass_change_detection();
        let pending = entities_of_kind.and_then(|entities| model.take_pending_display(entities.shown));
        // If more has changed than a frame may swap, the terrain is loaded again over several frames.
        if let Some(pending) = pending.filter(|pending| pending.len() <= settings.swaps_per_frame) {
            let task = InFlight::pending_display(counter.next(), model, pending, builder);
            commands.entity(entity).try_insert(task);
            continue;
        }
        model.watch();
        let world = model.snapshot();
        let task = (!builder.is_idle() || has_lod).then(|| {
            let world = Arc::clone(&world);
            let builder = builder.lit_by(&Arc::new(LitWorld::new(Arc::clone(&world), Vec::new())));
            ThreadTask::start(Threads::Background, move || match has_lod {
                true => build_nodes(&world, &builder),
                false => (build_world(&world, &builder), None),
            })
        });
        let (waiting, ready) = (Vec::new(), HashMap::default());
        let loading = Loading { world, vertices: kind, has_lod, task, waiting, ready, levels: None };
        commands.entity(entity).try_insert(loading);
    }
}

/// Builds all surfaces of a world.
fn build_world(world: &World, builder: &SurfaceBuilder) -> Vec<BuiltSurface> {
    let _span = info_span!("burrow_load").entered();
    let chunks = world.drawn_chunks().map(MeshKey::Chunk);
    let all: Vec<MeshKey> = world.grid().tiles().map(MeshKey::Tile).chain(chunks).collect();
    all.par_iter().map(|&drawn| builder.build((drawn, true), false, || world.draft(drawn))).collect()
}

/// Builds the coarsest nodes of a world, and what processors make of its edited chunks.
fn build_nodes(world: &World, builder: &SurfaceBuilder) -> BuiltWorld {
    let _span = info_span!("burrow_load").entered();
    let known = Arc::new(KnownNodes::default());
    let cut = Cut::coarsest(world.lod_grid(u8::MAX));
    known.learn(world, cut.grid(), cut.nodes());
    let (drawn, updates) = world.draw_cut(cut);
    let chunks: Vec<MeshKey> = world.drawn_chunks().map(MeshKey::Chunk).collect();
    let build = |&drawn: &MeshKey| builder.build((drawn, false), false, || world.draft(drawn));
    let chunks = chunks.par_iter().map(build).collect();
    (chunks, Some(BuiltNodes { drawn, nodes: builder.build_nodes(updates), known }))
}

/// The number of attempts to load a terrain whose load panics.
const ATTEMPTS: u32 = 3;

/// What a load built; `None` if it panicked and is to be tried again. After some attempts the terrain is shown without
/// surfaces: otherwise its brushes would have no answers, and bodies above it would be held forever.
fn loaded(
    entity: Entity,
    done: std::thread::Result<BuiltWorld>,
    failures: &mut EntityHashMap<u32>,
) -> Option<BuiltWorld> {
    let count = failures.get(&entity).map_or(1, |count| count + 1);
    match done {
        Ok(built) => {
            failures.remove(&entity);
            Some(built)
        }
        Err(panic) if count < ATTEMPTS => {
            failures.insert(entity, count);
            error!(
                "loading the terrain {entity} panicked; it is tried again: {}",
                panic_message(panic.as_ref())
            );
            None
        }
        Err(panic) => {
            failures.remove(&entity);
            let why = panic_message(panic.as_ref());
            error!(
                "loading the terrain {entity} panicked {ATTEMPTS} times; only later edits are shown: {why}"
            );
            Some((Vec::new(), None))
        }
    }
}

/// Passes meshes to the renderer within each frame's budget, and shows all of them once none waits. Former tiles and
/// chunks are despawned in that frame.
pub(in crate::plugin) fn finish_loading(
    mut commands: Commands,
    settings: Res<BurrowSettings>,
    mut assets: Option<ResMut<Assets<Mesh>>>,
    mut terrains: Query<(Entity, &mut Terrain, &mut Loading, Option<&TerrainEntities>, Option<&Children>)>,
    mut failures: Local<EntityHashMap<u32>>,
    mut figures: ResMut<BurrowFigures>,
) {
    let start = Instant::now();
    let mut budget = if assets.is_some() { settings.loads_per_frame.max(1) } else { usize::MAX };
    for (entity, mut terrain, mut loading, old, children) in &mut terrains {
        if let Some(task) = &mut loading.task {
            let Some(done) = task.check() else { continue };
            let Some(parts) = loaded(entity, done, &mut failures) else {
                // It is loaded again.
                commands.entity(entity).try_remove::<Loading>();
                continue;
            };
            (loading.task, (loading.waiting, loading.levels)) = (None, parts);
        }
        if !loading.upload(&mut assets, &mut budget) {
            continue;
        }
        if let Some(old) = old {
            old.despawn(&mut commands, children);
        }
        let levels = loading.levels.take();
        let place = (entity, terrain.voxel_size());
        let mut entities = show(&mut commands, place, assets.as_deref_mut(), &mut loading);
        let model = terrain.bypass_change_detection();
        match levels {
            Some(BuiltNodes { drawn, nodes, known }) => {
                show_nodes(
                    &mut commands,
                    (entity, &loading.world),
                    &mut entities,
                    assets.as_deref_mut(),
                    nodes,
                );
                let shown = ShownLevels::of(drawn.cut(), drawn.cut().nodes().count());
                commands.entity(entity).try_insert((LodState::new(known), shown));
                model.draw_from_now_on(Some(Arc::new(drawn)));
            }
            None => {
                commands.entity(entity).try_remove::<LodState>();
                model.draw_from_now_on(None);
                // Changes that the game made meanwhile are shown next.
                if entities.show(model.world()) {
                    entities.trigger_ready(&mut commands, entity);
                }
            }
        }
        commands.entity(entity).try_insert(entities).try_remove::<Loading>();
    }
    figures.measure_loading(start.elapsed());
}

/// Spawns tiles, chunks and fields of a world that has loaded.
fn show(
    commands: &mut Commands,
    (terrain, voxel_size): (Entity, f32),
    mut assets: Option<&mut Assets<Mesh>>,
    loading: &mut Loading,
) -> TerrainEntities {
    let world = Arc::clone(&loading.world);
    let (version, has_lod) = (world.version(), loading.has_lod);
    let mut entities = TerrainEntities::new(version, voxel_size, loading.vertices, has_lod);
    let with_fields = world.fields().map(|(chunk, _)| chunk);
    let chunks: BTreeSet<ChunkPos> = with_fields.chain(world.drawn_chunks()).collect();
    // With levels, tiles come as they are drawn.
    let tiles = (!has_lod).then(|| world.grid().tiles().map(MeshKey::Tile)).into_iter().flatten();
    for drawn in tiles.chain(chunks.into_iter().map(MeshKey::Chunk)) {
        let child = entities.spawn(commands, terrain, &world, drawn);
        if let Some(built) = loading.ready.remove(&drawn) {
            if let (Some(mesh), Some(assets)) = (built.mesh, &mut assets) {
                insert_mesh(commands, assets, child, mesh);
            }
            apply_actions(commands, child, built.shown, built.actions);
        }
        if let MeshKey::Chunk(_) = drawn {
            trigger_if_alive(commands, ChunkCreated { entity: child });
        }
    }
    for (chunk, fields) in world.fields() {
        for field in fields.iter() {
            entities.spawn_field(commands, chunk, field);
        }
    }
    entities
}

/// Shows the coarsest nodes of a world that has loaded.
fn show_nodes(
    commands: &mut Commands,
    (terrain, world): (Entity, &World),
    entities: &mut TerrainEntities,
    mut assets: Option<&mut Assets<Mesh>>,
    nodes: Vec<BuiltNode>,
) {
    let mut insert = |commands: &mut Commands, child: Entity, mesh: Option<PendingMesh>| {
        if let (Some(mesh), Some(assets)) = (mesh, &mut assets) {
            insert_mesh(commands, assets, child, mesh);
        }
    };
    for BuiltNode { node, mesh, shown, .. } in nodes {
        if let Some(mesh) = mesh {
            let child = entities.node(commands, terrain, world, node);
            insert(commands, child, mesh);
        }
        for BuiltSurface { drawn, mesh, shown, actions, .. } in shown {
            let child = entities.get(commands, drawn);
            let child = child.unwrap_or_else(|| entities.spawn(commands, terrain, world, drawn));
            insert(commands, child, mesh);
            apply_actions(commands, child, shown, actions);
        }
    }
}

/// Gives an entity its first mesh.
fn insert_mesh(commands: &mut Commands, assets: &mut Assets<Mesh>, child: Entity, mesh: PendingMesh) {
    let facts = mesh.facts.clone();
    commands.entity(child).try_insert((Mesh3d(mesh.show(assets, None)), facts));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_that_panics_is_tried_again_and_then_given_up() {
        let terrain = Entity::PLACEHOLDER;
        let mut failures = EntityHashMap::default();
        let mut end = |is_ok: bool| {
            let done = if is_ok {
                Ok((Vec::new(), None))
            } else {
                Err(Box::new("on purpose") as Box<dyn std::any::Any + Send>)
            };
            loaded(terrain, done, &mut failures).is_some()
        };
        assert!(!end(false) && end(true), "one failure does not end it");
        assert_eq!([(); 3].map(|()| end(false)), [false, false, true], "it ends");
        assert_eq!([(); 3].map(|()| end(false)), [false, false, true], "another time too");
    }
}
