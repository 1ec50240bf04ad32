//! Systems of levels of detail: find the cameras, choose the nodes that each terrain draws for all of them together,
//! and keep tiles that something else needs.

use std::sync::Arc;

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera, CameraProjection, Projection};
use bevy::math::{Affine3A, Vec4Swizzles};
use bevy::platform::collections::HashSet;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::load::Loading;
use super::task::{InFlight, TaskCounter};
use crate::lod::{View, Viewpoint};
use crate::plugin::entities::TerrainEntities;
use crate::plugin::entities::places::{Places, voxel_metres};
use crate::plugin::figures::MainThread;
use crate::plugin::lod_state::{DetailSource, LevelsOfDetail, LodState, WantedTiles, Watchers};
use crate::plugin::meshes::{BuildSettings, VertexExtras, VertexKind};
use crate::plugin::{BurrowEngine, BurrowFigures, Held, MaterialColors, SkyLight, SlimVertices};
use crate::terrain::{ChooseCut, Terrain};

/// Faster cameras were teleported, and will not continue like this: metres a second.
const FASTEST: f32 = 2000.0;

/// A new terrain's cut is reached in steps of this many meshes.
const FIRST_MESHES: usize = 400;

/// Edits come first, but after this many transactions with them a change of levels has its turn.
const EDITS: u32 = 2;

/// The height of a picture whose camera has none yet, in pixels.
const HEIGHT: f32 = 1080.0;

/// The width of such a picture, in pixels.
const WIDTH: f32 = 1920.0;

/// How a camera draws, in its own space and in metres.
#[derive(Clone, Copy)]
enum Lens {
    /// Pixels that a metre covers one metre away.
    Perspective { pixels: f32 },
    /// Pixels that a metre covers, the axis of the view from its near to its far end, and the radius around it.
    Parallel { pixels: f32, near: Vec3, far: Vec3, radius: f32 },
}

impl Lens {
    /// The lens of a camera; `None` if it draws nothing.
    fn of(camera: &Camera, projection: &Projection) -> Option<Self> {
        // A minimised window has a picture of no size, or of one pixel.
        let sizes = [camera.physical_target_size(), camera.physical_viewport_size()];
        if !camera.is_active || sizes.into_iter().flatten().any(|size| size.min_element() <= 1) {
            return None;
        }
        let size = camera.physical_viewport_size().map(|size| size.as_vec2());
        let size = size.unwrap_or(Vec2::new(WIDTH, HEIGHT));
        let clip = match projection {
            Projection::Orthographic(projection) => {
                // The area is only known after Bevy's own update.
                let mut projection = projection.clone();
                projection.update(size.x, size.y);
                projection.get_clip_from_view()
            }
            _ => projection.get_clip_from_view(),
        };
        // Only a part of a larger picture may be drawn.
        let size =
            camera.sub_camera_view.map_or(size, |sub| size * sub.full_size.as_vec2() / sub.size.as_vec2());
        // Pictures may be shifted against the axis, and turned around it.
        let row = clip.row(1);
        let pixels = size.y / 2.0 * row.xy().length();
        let lens = if projection.is_perspective() {
            Self::Perspective { pixels }
        } else {
            let inverse = clip.inverse();
            let [near, far, corner] =
                [Vec3::Z, Vec3::ZERO, Vec3::ONE].map(|place| inverse.project_point3(place));
            Self::Parallel { pixels, near, far, radius: near.distance(corner) }
        };
        lens.is_valid().then_some(lens)
    }

    fn of_source(source: &DetailSource) -> Option<Self> {
        let pixels = source.picture_height / (2.0 * (source.fov / 2.0).tan());
        let lens = Self::Perspective { pixels };
        lens.is_valid().then_some(lens)
    }

    fn is_valid(self) -> bool {
        match self {
            Self::Perspective { pixels } => pixels.is_finite() && pixels > 0.0,
            Self::Parallel { pixels, near, far, radius } => {
                let is_finite = near.is_finite() && far.is_finite() && radius.is_finite();
                is_finite && pixels.is_finite() && pixels > 0.0
            }
        }
    }

    /// Where an eye with this lens is, in the voxels of a terrain; `metres` are those of a voxel.
    fn eye(self, terrain_from_view: &Affine3A, metres: f32) -> Viewpoint {
        let velocity = Vec3::ZERO;
        match self {
            Self::Perspective { pixels } => {
                let position = terrain_from_view.translation.into();
                Viewpoint { position, velocity, pixels, view: View::Perspective }
            }
            Self::Parallel { pixels, near, far, radius } => {
                let [near, far] = [near, far].map(|place| terrain_from_view.transform_point3(place));
                let view = View::Parallel { axis: far - near, radius: radius / metres };
                Viewpoint { position: near, velocity, pixels: pixels * metres, view }
            }
        }
    }
}

/// Finds the viewpoints of each terrain, with their velocities.
///
/// Positions of cameras and terrains are read together, so that no system of the game can move both in between.
pub(in crate::plugin) fn find_eyes(
    cameras: Query<(Entity, &Camera, &Projection, Option<&RenderLayers>), Without<Camera2d>>,
    sources: Query<(Entity, &DetailSource)>,
    places: Places,
    time: Option<Res<Time<Real>>>,
    mut terrains: Query<(Entity, &Terrain, Option<&RenderLayers>, &mut Watchers), With<LevelsOfDetail>>,
) {
    if terrains.is_empty() {
        return;
    }
    let seconds = time.map_or(0.0, |time| time.delta_secs());
    let cameras = cameras.iter().filter_map(|(entity, camera, projection, layers)| {
        Some((
            entity,
            Lens::of(camera, projection)?,
            places.of(entity)?,
            Some(layers.cloned().unwrap_or_default()),
        ))
    });
    let sources = sources
        .iter()
        .filter_map(|(entity, source)| Some((entity, Lens::of_source(source)?, places.of(entity)?, None)));
    let mut lenses: Vec<(Entity, Lens, GlobalTransform, Option<RenderLayers>)> =
        cameras.chain(sources).collect();
    lenses.sort_unstable_by_key(|(entity, ..)| *entity);
    for (entity, terrain, layers, mut watchers) in &mut terrains {
        let Some(place) = places.of(entity) else { continue };
        let (inverse, metres) = (place.affine().inverse(), voxel_metres(&place));
        let layers = layers.cloned().unwrap_or_default();
        if watchers.voxel_size != terrain.voxel_size() {
            *watchers = Watchers { voxel_size: terrain.voxel_size(), ..default() };
        }
        let mut seen: Vec<(Entity, Viewpoint)> = Vec::new();
        for (viewer, lens, at, own) in &lenses {
            if own.as_ref().is_some_and(|own| !own.intersects(&layers)) {
                continue;
            }
            let mut eye = lens.eye(&(inverse * at.affine()), metres);
            if !eye.is_finite() {
                continue;
            }
            let before = watchers.eyes.iter().find(|(other, _)| other == viewer).map(|(_, eye)| eye);
            let pause = !watchers.is_current;
            eye.velocity = before.map_or(Vec3::ZERO, |before| velocity(before, &eye, seconds, metres, pause));
            seen.push((*viewer, eye));
        }
        watchers.is_current = !seen.is_empty();
        // Without viewpoints, nothing is merged.
        if watchers.is_current {
            watchers.eyes = seen;
        }
    }
}

/// The velocity of an eye from its previous position, also across a pause without cameras.
fn velocity(before: &Viewpoint, now: &Viewpoint, seconds: f32, metres: f32, is_after_pause: bool) -> Vec3 {
    let way = now.position - before.position;
    if is_after_pause {
        return if way.length() < 1.0 { before.velocity } else { Vec3::ZERO };
    }
    if seconds <= 0.0 {
        return Vec3::ZERO;
    }
    // Frames differ in length: the mean of some of them.
    let mean = before.velocity + (way / seconds - before.velocity) * (seconds * 8.0).min(1.0);
    if way.length() * metres / seconds < FASTEST { mean } else { Vec3::ZERO }
}

/// Starts a change of levels on each terrain that needs one and has no running transaction.
pub(in crate::plugin) fn begin_lod_changes(
    mut commands: Commands,
    mut terrains: Query<
        (
            Entity,
            &mut Terrain,
            &LevelsOfDetail,
            &mut LodState,
            &Watchers,
            &TerrainEntities,
            Option<&MaterialColors>,
            (Has<SlimVertices>, Option<&SkyLight>),
        ),
        (Without<Loading>, Without<InFlight>, Without<Held>),
    >,
    build: BuildSettings,
    engine: Res<BurrowEngine>,
    mut figures: ResMut<BurrowFigures>,
    mut counter: ResMut<TaskCounter>,
) {
    let start = Instant::now();
    for (entity, mut terrain, settings, mut state, watchers, entities, colors, (is_slim, sky_light)) in
        &mut terrains
    {
        let kind = VertexKind::of(is_slim, sky_light);
        if !entities.show(terrain.world()) || entities.vertices != kind || terrain.is_busy() {
            continue;
        }
        if terrain.queued() > 0 && state.edits < EDITS {
            continue;
        }
        let eyes = watchers.eyes();
        let version = terrain.world().version();
        if state.is_settled && !state.is_outdated(&eyes, settings, version) {
            continue;
        }
        let (choice, known) = (settings.choice(terrain.voxel_size()), Arc::clone(&state.known));
        let most = if state.is_complete { settings.meshes_per_change.max(1) } else { FIRST_MESHES };
        let chosen = eyes.clone();
        let choose: Arc<ChooseCut> =
            Arc::new(move |world, cut| known.next_cut(world, cut, &choice, &chosen, most));
        // The game does not see this as a change.
        let Some(transaction) = terrain.bypass_change_detection().begin_cut_for(choose, true) else {
            continue;
        };
        (state.eyes, state.settings, state.shown) = (eyes, Some(settings.clone()), Some(version));
        (state.edits, state.is_settled) = (0, false);
        let extras = VertexExtras::of(colors, kind);
        let builder = build.builder((entity, &terrain), extras);
        let engine = terrain.engine().unwrap_or(&engine).clone();
        let task = InFlight::transaction(counter.next(), entity, transaction, engine, builder);
        commands.entity(entity).try_insert(task);
    }
    figures.measure(start.elapsed());
}

/// Spawns entities of wanted tiles, and despawns those of tiles that are neither wanted nor drawn any more.
pub(in crate::plugin) fn keep_wanted_tiles(
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
