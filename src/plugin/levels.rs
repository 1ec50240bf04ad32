//! Levels of detail: which nodes of the quadtree each terrain draws, chosen for all cameras together.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};

use bevy::camera::{Camera, PerspectiveProjection, Projection};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::platform::time::Instant;
use bevy::prelude::*;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

use super::entities::TerrainEntities;
use super::load::Loading;
use super::meshes::VertexExtras;
use super::processor::SurfaceBuilder;
use super::task::{InFlight, TaskCounter};
use super::{BurrowEngine, BurrowFigures, MaterialColors, SlimVertices, SurfaceProcessors};
use crate::lattice::TilePos;
use crate::levels::{Choice, Cut, Eye, LevelGrid, Node, NodeFacts};
use crate::terrain::{ChooseCut, GroundFacts, Terrain, Version, World as Ground};

/// Draws far ground coarsely: insert it on a terrain's entity, and worlds may be many kilometres wide.
///
/// The ground is cut into squares, each of which is drawn at one of several levels of detail: at level L, its cells are 2^L
/// voxels wide. Levels are chosen by what cameras see of them in pixels, for all active cameras with a perspective projection
/// together. Where they look does not matter, so turning changes nothing. Everything drawn together stays closed, and edits
/// are exact everywhere: levels change what is drawn and nothing else.
///
/// The defaults need no change. A terrain that gets or loses this component loads anew.
///
/// With it, a [`Tile`](super::Tile) has an entity while it is drawn, and of level 0 also while something else needs it, like a
/// collider. [`SurfaceProcessor`](super::SurfaceProcessor)s are called for tiles and chunks of level 0 only, when they come
/// into view and when they change.
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(ShownLevels)]
pub struct LevelsOfDetail {
    /// Metres; ground farther away from all cameras is drawn at the coarsest level that the rest allows.
    pub view_distance: f32,
    /// Ground is drawn finer while it would differ by more than this many pixels from the next finer level.
    pub error_pixels: f32,
    /// And while its cells are larger than this many pixels.
    pub cell_pixels: f32,
    /// Dug and built ground is drawn finer while its cells are larger than this many pixels.
    pub edited_pixels: f32,
    /// Levels are chosen for where cameras will be in this many seconds, too.
    pub look_ahead: f32,
    /// The most squares that are drawn, about; where more would be needed, all ground is drawn coarser.
    pub most_nodes: usize,
    /// Meshes made for one change of levels, unless a single square needs more.
    pub meshes_per_change: usize,
}

impl Default for LevelsOfDetail {
    fn default() -> Self {
        let Choice {
            cell_pixels, error_pixels, edited_pixels, look_ahead, view_distance, most_nodes, ..
        } = Choice::default();
        Self {
            view_distance,
            error_pixels,
            cell_pixels,
            edited_pixels,
            look_ahead,
            most_nodes,
            meshes_per_change: 16,
        }
    }
}

impl LevelsOfDetail {
    fn choice(&self, voxel_size: f32) -> Choice {
        Choice {
            cell_pixels: self.cell_pixels,
            error_pixels: self.error_pixels,
            edited_pixels: self.edited_pixels,
            look_ahead: self.look_ahead,
            view_distance: self.view_distance / voxel_size,
            most_nodes: self.most_nodes,
            ..Choice::default()
        }
    }
}

/// What is drawn of a terrain with [`LevelsOfDetail`]; the plugin writes it.
#[derive(Component, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct ShownLevels {
    /// How many squares of each level are drawn, from level 0 on.
    pub nodes: Vec<usize>,
    /// Squares that are still to be drawn otherwise for what cameras see now; 0 once all is drawn as it should be.
    pub waiting: usize,
}

impl ShownLevels {
    /// The share of squares that are drawn as they should be, 0..=1.
    pub fn progress(&self) -> f32 {
        let nodes = self.nodes.iter().sum::<usize>();
        if nodes == 0 { 0.0 } else { nodes as f32 / (nodes + self.waiting) as f32 }
    }

    pub(crate) fn of(cut: &Cut, waiting: usize) -> Self {
        let mut nodes = vec![0; usize::from(cut.grid().top()) + 1];
        cut.nodes().for_each(|node| nodes[usize::from(node.level)] += 1);
        Self { nodes, waiting }
    }
}

/// Tiles that need an entity of their own even while they are not drawn at level 0, by terrain.
#[derive(Resource, Default)]
pub(crate) struct WantedTiles(pub(crate) HashMap<Entity, HashSet<TilePos>>);

impl WantedTiles {
    pub(super) fn has(&self, terrain: Entity, tile: TilePos) -> bool {
        self.0.get(&terrain).is_some_and(|tiles| tiles.contains(&tile))
    }
}

/// What is known of nodes, shared with tasks. Heights and errors depend on the ground alone, and are kept for nodes that were
/// drawn once.
#[derive(Default)]
pub(super) struct KnownNodes {
    facts: RwLock<FxHashMap<Node, GroundFacts>>,
    /// Nodes with edits, at one version of the world.
    edited: RwLock<Option<(Version, Arc<FxHashSet<Node>>)>>,
    /// Nodes that were still to change when the last cut was chosen.
    waiting: AtomicUsize,
}

impl KnownNodes {
    /// Finds the facts of these nodes where they are not known yet.
    pub(super) fn learn(&self, world: &Ground, grid: LevelGrid, nodes: &[Node]) {
        let is_new = |node: &&Node| !self.read().contains_key(node);
        let new: Vec<Node> = nodes.iter().filter(is_new).copied().collect();
        let facts = |node| (node, GroundFacts::new(world.ground(), grid, node));
        let found: Vec<_> = new.into_par_iter().map(facts).collect();
        self.facts.write().unwrap_or_else(PoisonError::into_inner).extend(found);
    }

    fn read(&self) -> std::sync::RwLockReadGuard<'_, FxHashMap<Node, GroundFacts>> {
        self.facts.read().unwrap_or_else(PoisonError::into_inner)
    }

    fn edited(&self, world: &Ground, grid: LevelGrid) -> Arc<FxHashSet<Node>> {
        let mut known = self.edited.write().unwrap_or_else(PoisonError::into_inner);
        match &*known {
            Some((version, nodes)) if *version == world.version() => Arc::clone(nodes),
            _ => {
                let nodes = Arc::new(world.edited_nodes(grid));
                *known = Some((world.version(), Arc::clone(&nodes)));
                nodes
            }
        }
    }

    /// One step towards the cut that these eyes need. Nodes that were not drawn yet are not split, so what is coarse comes
    /// first.
    fn next_cut(&self, world: &Ground, cut: &Cut, choice: &Choice, eyes: &[Eye], most: usize) -> Cut {
        let edited = self.edited(world, cut.grid());
        let target = {
            let facts = self.read();
            choice.cut(cut, eyes, |node| {
                let known = facts.get(&node).copied();
                known.map_or(NodeFacts::default(), |GroundFacts { heights, error }| NodeFacts {
                    heights,
                    error,
                    has_edits: edited.contains(&node),
                })
            })
        };
        let nearest = |node: Node| {
            let (low, high) = cut.grid().columns(node);
            let [low, high] = [low, high].map(|column| Vec2::new(column.x as f32, column.z as f32));
            let distance = |eye: &Eye| {
                let place = eye.position.xz();
                place.distance(place.clamp(low, high.max(low)))
            };
            eyes.iter().map(distance).fold(f32::INFINITY, f32::min) as u64
        };
        let mut next = cut.clone();
        let step = next.step_to(&target, most, nearest).unwrap_or_default();
        self.learn(world, cut.grid(), &step.new);
        let changed = next.nodes().filter(|&node| !target.contains(node)).count();
        self.waiting.store(changed.max(step.new.len()), Ordering::Relaxed);
        next
    }
}

/// What a terrain's levels were last chosen for.
#[derive(Component, Default)]
pub(super) struct LevelState {
    pub known: Arc<KnownNodes>,
    eyes: Vec<Eye>,
    settings: Option<LevelsOfDetail>,
    shown: Option<Version>,
    /// Is all drawn as it should be for these?
    pub is_settled: bool,
    /// Transactions with edits since the cut was last chosen.
    edits: u32,
    /// Were all nodes drawn once?
    is_complete: bool,
}

/// How far an eye moves before levels are chosen again, in voxels.
const NEAR: f32 = 1.0;

/// Faster cameras were moved, and do not go on: metres a second.
const FASTEST: f32 = 2000.0;

/// A new terrain's cut is reached in steps of this many meshes.
const FIRST_MESHES: usize = 192;

/// Edits come first, but after this many transactions with them a change of levels has its turn.
const EDITS: u32 = 2;

impl LevelState {
    pub(super) fn new(known: Arc<KnownNodes>) -> Self {
        Self { known, ..Self::default() }
    }

    /// Notes that a change of levels was shown, after which none is left if it changed nothing.
    pub(super) fn count(&mut self, changed: usize) -> usize {
        self.is_settled = changed == 0;
        self.is_complete |= self.is_settled;
        if self.is_settled { 0 } else { self.known.waiting.load(Ordering::Relaxed) }
    }

    /// Notes a transaction with edits.
    pub(super) fn count_edit(&mut self) {
        self.edits = self.edits.saturating_add(1);
    }

    /// Is the choice for these outdated?
    fn is_outdated(&self, eyes: &[Eye], settings: &LevelsOfDetail, shown: Version) -> bool {
        let is_near = |(a, b): (&Eye, &Eye)| {
            a.position.distance(b.position) < NEAR
                && a.pixels == b.pixels
                && a.velocity.distance(b.velocity) < NEAR.max(a.velocity.length() / 4.0)
        };
        self.settings.as_ref() != Some(settings)
            || self.shown != Some(shown)
            || self.eyes.len() != eyes.len()
            || !self.eyes.iter().zip(eyes).all(is_near)
    }
}

/// All cameras that may see ground, in world space: [`Eye`]s in metres.
#[derive(Resource, Default)]
pub(super) struct Eyes(Vec<(Entity, Eye)>);

/// The height of a picture whose camera has none yet, in pixels.
const HEIGHT: f32 = 1080.0;

/// Finds where cameras are, and where they go.
pub(super) fn find_eyes(
    cameras: Query<(Entity, &Camera, &Projection, &GlobalTransform)>,
    time: Option<Res<Time>>,
    mut eyes: ResMut<Eyes>,
) {
    let seconds = time.map_or(0.0, |time| time.delta_secs());
    let before = std::mem::take(&mut eyes.0);
    for (entity, camera, projection, transform) in &cameras {
        let Projection::Perspective(PerspectiveProjection { fov, .. }) = projection else { continue };
        let position = transform.translation();
        let height = camera.physical_viewport_size().map_or(HEIGHT, |size| size.y.max(1) as f32);
        let pixels = height / (2.0 * (fov / 2.0).tan());
        if !camera.is_active || !position.is_finite() || !pixels.is_finite() {
            continue;
        }
        let known = before.iter().find(|(other, _)| *other == entity);
        let velocity = known.filter(|_| seconds > 0.0).map_or(Vec3::ZERO, |(_, eye)| {
            let now = (position - eye.position) / seconds;
            // Frames differ in length: the mean of some of them.
            let mean = eye.velocity + (now - eye.velocity) * (seconds * 8.0).min(1.0);
            if now.length() < FASTEST { mean } else { Vec3::ZERO }
        });
        eyes.0.push((entity, Eye { position, velocity, pixels }));
    }
    eyes.0.sort_unstable_by_key(|(entity, _)| *entity);
}

impl Eyes {
    /// The same in a terrain's voxels.
    fn over(&self, place: &GlobalTransform) -> Vec<Eye> {
        let inverse = place.affine().inverse();
        let over = |eye: &Eye| Eye {
            position: inverse.transform_point3(eye.position),
            velocity: inverse.transform_vector3(eye.velocity),
            pixels: eye.pixels,
        };
        self.0.iter().map(|(_, eye)| over(eye)).filter(|eye| eye.position.is_finite()).collect()
    }
}

/// Starts a change of levels on each terrain that needs one and has no other transaction under way.
pub(super) fn begin_level_changes(
    mut commands: Commands,
    mut terrains: Query<
        (
            Entity,
            &mut Terrain,
            &LevelsOfDetail,
            &mut LevelState,
            &GlobalTransform,
            &TerrainEntities,
            Option<&MaterialColors>,
            Has<SlimVertices>,
        ),
        (Without<Loading>, Without<InFlight>),
    >,
    eyes: Res<Eyes>,
    assets: Option<Res<Assets<Mesh>>>,
    processors: Res<SurfaceProcessors>,
    engine: Res<BurrowEngine>,
    mut figures: ResMut<BurrowFigures>,
    mut counter: ResMut<TaskCounter>,
) {
    let start = Instant::now();
    for (entity, mut terrain, settings, mut state, place, entities, colors, is_slim) in &mut terrains {
        if !entities.show(terrain.world()) || entities.is_slim != is_slim || terrain.is_busy() {
            continue;
        }
        if terrain.queued() > 0 && state.edits < EDITS {
            continue;
        }
        let eyes = eyes.over(place);
        let version = terrain.world().version();
        if state.is_settled && !state.is_outdated(&eyes, settings, version) {
            continue;
        }
        let (choice, known) = (settings.choice(terrain.voxel_size()), Arc::clone(&state.known));
        let most = if state.is_complete { settings.meshes_per_change.max(1) } else { FIRST_MESHES };
        let chosen = eyes.clone();
        let choose: Arc<ChooseCut> =
            Arc::new(move |world, cut| known.next_cut(world, cut, &choice, &chosen, most));
        // For the game this is no change.
        let Some(transaction) = terrain.bypass_change_detection().begin_cut_for(choose, true) else {
            continue;
        };
        (state.eyes, state.settings, state.shown) = (eyes, Some(settings.clone()), Some(version));
        (state.edits, state.is_settled) = (0, false);
        let extras = VertexExtras::of(colors, is_slim);
        let builder = SurfaceBuilder::new((entity, &terrain), extras, assets.is_some(), &processors);
        let engine = terrain.engine().unwrap_or(&engine).clone();
        let task = InFlight::transaction(counter.next(), entity, transaction, engine, builder);
        commands.entity(entity).try_insert(task);
    }
    figures.main_thread += start.elapsed();
}

/// Gives wanted tiles an entity, and takes it from those that are neither wanted nor drawn any more.
pub(super) fn keep_wanted_tiles(
    mut commands: Commands,
    wanted: Res<WantedTiles>,
    mut terrains: Query<(Entity, &Terrain, &mut TerrainEntities), With<LevelsOfDetail>>,
) {
    let nothing = HashSet::default();
    for (entity, terrain, mut entities) in &mut terrains {
        if wanted.is_changed() || entities.is_added() {
            let tiles = wanted.0.get(&entity).unwrap_or(&nothing);
            entities.keep_tiles(&mut commands, entity, terrain, tiles);
        }
    }
}
