//! Systems of levels of detail: find the cameras, choose what each terrain draws for all of them together, and keep tiles that
//! something else needs.

use std::sync::Arc;

use bevy::camera::{Camera, PerspectiveProjection, Projection};
use bevy::platform::collections::HashSet;
use bevy::platform::time::Instant;
use bevy::prelude::*;

use super::entities::TerrainEntities;
use super::level_state::{LevelState, LevelsOfDetail, WantedTiles};
use super::load::Loading;
use super::meshes::VertexExtras;
use super::processor::SurfaceBuilder;
use super::task::{InFlight, TaskCounter};
use super::{BurrowEngine, BurrowFigures, MaterialColors, SlimVertices, SurfaceProcessors};
use crate::levels::Eye;
use crate::terrain::{ChooseCut, Terrain};

/// Faster cameras were moved, and do not go on: metres a second.
const FASTEST: f32 = 2000.0;

/// A new terrain's cut is reached in steps of this many meshes.
const FIRST_MESHES: usize = 192;

/// Edits come first, but after this many transactions with them a change of levels has its turn.
const EDITS: u32 = 2;

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
