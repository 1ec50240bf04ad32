//! Levels of detail as components: a game's settings, the shown levels, and the plugin's state for a terrain's nodes.

use std::sync::Arc;

use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;

use crate::lattice::TilePos;
use crate::lod::{Cut, LodSettings, View, Viewpoint};
use crate::terrain::{KnownNodes, Version};

/// Draws far ground coarsely: insert it on a terrain's entity, and worlds may be many kilometres wide.
///
/// The ground is cut into squares, each of which is drawn at one of several levels of detail: at level L, its cells are
/// 2^L voxels wide. Levels are chosen by the size of cells on the screen. Everything drawn together stays closed, and
/// edits are exact everywhere: levels change what is drawn and nothing else.
///
/// # Which cameras count
///
/// | camera | levels |
/// | --- | --- |
/// | any perspective, custom and off-axis ones included | by distance. Where it looks does not matter, so turning changes nothing |
/// | orthographic | by size on the screen in what is in view, coarser around it |
/// | inactive, or with a picture of size 0, as of a minimised window | none |
/// | with no `RenderLayers` in common with the terrain | none |
/// | a `Camera2d` | none |
/// | no camera, but a [`DetailSource`] | as for a camera in its place |
///
/// Levels are chosen for all of these cameras together. While there is none, levels stay as they are. Distances and
/// speeds are measured in the terrain's own space and in real time, so shifted origins and slow motion change nothing.
///
/// The defaults need no change. Values of 0, negative ones and NaN are allowed: `max_nodes` bounds what they can cost.
/// A terrain that gets or loses this component is loaded again.
///
/// With it, a [`Tile`](super::Tile) has an entity while it is drawn, and of level 0 also while something else needs it,
/// like a collider. [`SurfaceProcessor`](super::SurfaceProcessor)s are called for tiles and chunks of level 0 only,
/// when they come into view and when they change.
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(ShownLevels, Watchers)]
pub struct LevelsOfDetail {
    /// Metres; ground farther away from all cameras is drawn at the coarsest level that the rest allows. With 0 or
    /// less, all ground is.
    pub view_distance: f32,
    /// Ground is drawn finer while it would differ by more than this many pixels from the next finer level, and its
    /// cells are larger than [`cell_pixels`](Self::cell_pixels). Less than 0.01 counts as
    /// 0.01, here and in both fields below.
    pub error_pixels: f32,
    /// The least size of cells in pixels, except for dug and built ground: see [`error_pixels`](Self::error_pixels).
    pub cell_pixels: f32,
    /// Dug and built ground is drawn finer while its cells are larger than this many pixels.
    pub edited_pixels: f32,
    /// Levels are chosen for where cameras will be in this many seconds, too. With 0, only for where they are.
    pub look_ahead: f32,
    /// The approximate maximum of drawn squares; if more would be needed, all ground is drawn coarser.
    pub max_nodes: usize,
    /// Meshes made for one change of levels, unless a single square needs more. 0 counts as 1.
    pub meshes_per_change: usize,
}

impl Default for LevelsOfDetail {
    fn default() -> Self {
        let LodSettings {
            cell_pixels,
            error_pixels,
            edited_pixels,
            look_ahead,
            view_distance,
            max_nodes,
            ..
        } = LodSettings::default();
        Self {
            view_distance,
            error_pixels,
            cell_pixels,
            edited_pixels,
            look_ahead,
            max_nodes,
            meshes_per_change: 16,
        }
    }
}

impl LevelsOfDetail {
    pub(super) fn choice(&self, voxel_size: f32) -> LodSettings {
        LodSettings {
            cell_pixels: self.cell_pixels,
            error_pixels: self.error_pixels,
            edited_pixels: self.edited_pixels,
            look_ahead: self.look_ahead,
            view_distance: self.view_distance / voxel_size,
            max_nodes: self.max_nodes,
            ..LodSettings::default()
        }
    }
}

/// The drawn levels of a terrain with [`LevelsOfDetail`]; the plugin updates it.
#[derive(Component, Reflect, Clone, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default)]
pub struct ShownLevels {
    /// How many squares of each level are drawn, from level 0 on.
    pub nodes: Vec<usize>,
    /// Squares that are not drawn at their chosen level yet; 0 once all are.
    pub waiting: usize,
}

impl ShownLevels {
    /// The share of squares that are drawn at their chosen level, 0..=1.
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

/// A place around which ground is drawn as finely as for a perspective camera there, even if there is no camera: for a
/// loading screen that waits for [`TerrainReady`](super::TerrainReady) before it spawns the player's camera, or for a
/// place that a cut scene will soon show. Insert it on an entity with a `Transform`, and remove it when it is no longer
/// needed.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default)]
#[require(Transform)]
pub struct DetailSource {
    /// The vertical field of view in radians. A source whose field of view is not between 0 and pi is ignored.
    pub fov: f32,
    /// The height of the picture in pixels. A source without a height greater than 0 is ignored.
    pub picture_height: f32,
}

impl Default for DetailSource {
    /// Bevy's default field of view, in a picture of 1,080 lines.
    fn default() -> Self {
        Self { fov: std::f32::consts::FRAC_PI_4, picture_height: 1080.0 }
    }
}

/// The viewpoints of a terrain, in its voxels; without any, the last ones.
#[derive(Component, Default)]
pub(super) struct Watchers {
    pub eyes: Vec<(Entity, Viewpoint)>,
    /// Whether there was a camera or source in the last frame.
    pub is_current: bool,
    /// The size of the voxels.
    pub voxel_size: f32,
}

impl Watchers {
    /// Everybody who looks.
    pub fn eyes(&self) -> Vec<Viewpoint> {
        self.eyes.iter().map(|&(_, eye)| eye).collect()
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

/// The inputs of the last choice of a terrain's levels.
#[derive(Component, Default)]
pub(super) struct LodState {
    pub known: Arc<KnownNodes>,
    pub eyes: Vec<Viewpoint>,
    pub settings: Option<LevelsOfDetail>,
    pub shown: Option<Version>,
    /// Whether everything is drawn at its chosen level.
    pub is_settled: bool,
    /// Transactions with edits since the cut was last chosen.
    pub edits: u32,
    /// Whether all nodes have been drawn once.
    pub is_complete: bool,
}

/// Whether views differ by less than what changes levels.
fn is_same_view(a: View, b: View) -> bool {
    match (a, b) {
        (View::Perspective, View::Perspective) => true,
        (View::Parallel { axis: a, radius }, View::Parallel { axis: b, radius: other }) => {
            a.distance(b) < NEAR && (radius - other).abs() < NEAR
        }
        _ => false,
    }
}

/// How far an eye moves before levels are chosen again, in voxels.
const NEAR: f32 = 1.0;

impl LodState {
    pub(super) fn new(known: Arc<KnownNodes>) -> Self {
        Self { known, ..Self::default() }
    }

    /// Records that a change of levels was shown; the choice is settled if it changed nothing.
    pub(super) fn count(&mut self, changed: usize) -> usize {
        self.is_settled = changed == 0;
        self.is_complete |= self.is_settled;
        if self.is_settled { 0 } else { self.known.waiting() }
    }

    /// Records a transaction with edits.
    pub(super) fn count_edit(&mut self) {
        self.edits = self.edits.saturating_add(1);
    }

    /// Whether the choice for these inputs is outdated.
    pub(super) fn is_outdated(&self, eyes: &[Viewpoint], settings: &LevelsOfDetail, shown: Version) -> bool {
        let is_near = |(a, b): (&Viewpoint, &Viewpoint)| {
            a.position.distance(b.position) < NEAR
                && a.pixels == b.pixels
                && is_same_view(a.view, b.view)
                && a.velocity.distance(b.velocity) < NEAR.max(a.velocity.length() / 4.0)
        };
        self.settings.as_ref() != Some(settings)
            || self.shown != Some(shown)
            || self.eyes.len() != eyes.len()
            || !self.eyes.iter().zip(eyes).all(is_near)
    }
}
