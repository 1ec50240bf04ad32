//! Draws the views as children of the terrains and keeps them up to date.

use std::sync::Arc;
use std::time::Duration;

use bevy::asset::AssetEventSystems;
use bevy::camera::visibility::{RenderLayers, VisibilitySystems};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::lines::{Layer, LineBuffer};
use super::place::Place;
use super::views::{self, Dirty};
use super::{BurrowDebug, DebugView};
use crate::lattice::BrickPos;
use crate::plugin::{BrushApplied, CommitSameFrame, HistoryMoved, voxel_metres};
use crate::terrain::{DrawnCut, Terrain, Version};

/// The shortest time between two drawings of a view while the world changes.
const PERIOD: Duration = Duration::from_millis(100);
/// The length of the camera's ray to the ground, in voxels.
const SIGHT: f64 = 2000.0;
/// Depth bias of the lines, against z-fighting.
const BIAS: f32 = -0.0004;
/// Lines of a box.
const BOX_LINES: usize = 12;

/// Adds the debug views. Requires `BurrowPlugins`. All are off until switched on in [`BurrowDebug`].
#[derive(Default)]
pub struct BurrowDebugPlugin;

impl Plugin for BurrowDebugPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<BurrowDebug>()
            .init_resource::<DirtyBricks>()
            .add_systems(PostUpdate, note_dirty.after(CommitSameFrame).before(draw))
            .add_systems(
                PostUpdate,
                draw.after(TransformSystems::Propagate)
                    .after(VisibilitySystems::VisibilityPropagate)
                    .before(AssetEventSystems)
                    .run_if(resource_exists::<Assets<GizmoAsset>>),
            );
    }
}

/// Lines of a debug view, below a terrain's entity.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component)]
#[require(Transform)]
pub struct DebugLines {
    /// The view.
    pub view: DebugView,
}

/// Bricks that edits may have changed recently, with the time.
#[derive(Resource, Default)]
struct DirtyBricks(HashMap<(Entity, BrickPos), Duration>);

/// Records the stored bricks in the bounds of new receipts, and forgets old ones.
fn note_dirty(
    time: Option<Res<Time>>,
    debug: Res<BurrowDebug>,
    mut receipts: MessageReader<BrushApplied>,
    mut moves: MessageReader<HistoryMoved>,
    terrains: Query<&Terrain>,
    mut dirty: ResMut<DirtyBricks>,
) {
    let now = time.map_or(Duration::ZERO, |time| time.elapsed());
    let fade = Duration::try_from_secs_f32(debug.fade).unwrap_or(Duration::ZERO);
    if !dirty.0.is_empty() {
        dirty.0.retain(|_, since| now.saturating_sub(*since) < fade);
    }
    if !debug.dirty {
        dirty.0.clear();
        receipts.clear();
        moves.clear();
        return;
    }
    let most = debug.max_lines / BOX_LINES;
    let edited = receipts.read().map(|applied| {
        let bounds = applied.receipt.outcome.as_ref().ok().and_then(|applied| applied.bounds);
        (applied.terrain, bounds)
    });
    let restored = moves.read().map(|moved| {
        let bounds = moved.receipt.outcome.as_ref().ok().and_then(|restored| restored.bounds);
        (moved.terrain, bounds)
    });
    for (entity, bounds) in edited.chain(restored) {
        let (Some(entity), Some(bounds)) = (entity, bounds) else { continue };
        let Ok(terrain) = terrains.get(entity) else { continue };
        for brick in terrain.world().bricks_near(bounds) {
            if dirty.0.len() >= most {
                break;
            }
            dirty.0.insert((entity, brick), now);
        }
    }
}

/// The state that a view was drawn for.
#[derive(Clone, PartialEq)]
struct Key {
    version: Version,
    /// For the view of levels.
    cut: Option<Arc<DrawnCut>>,
    focus: IVec3,
    settings: BurrowDebug,
    /// Counts frames in which bricks fade, for the dirty view.
    fading: u64,
    render_layers: Option<RenderLayers>,
}

/// The last drawing of a view.
struct Drawing {
    key: Key,
    since: Duration,
    /// The number of its entities. A game may despawn them.
    layers: usize,
}

impl Drawing {
    /// Whether it need not be drawn again: nothing has changed, or only the world has, a moment ago, and a game has
    /// despawned none of its entities, of which there are `layers`.
    fn is_current(&self, key: &Key, layers: usize, now: Duration, period: Duration) -> bool {
        let old = &self.key;
        let is_urgent = old.settings != key.settings
            || old.fading != key.fading
            || old.render_layers != key.render_layers;
        let is_as_it_was = old == key || !is_urgent && now.saturating_sub(self.since) < period;
        is_as_it_was && layers == self.layers
    }
}

/// Draws views that are outdated, and removes those that are switched off.
fn draw(
    mut commands: Commands,
    time: Option<Res<Time>>,
    debug: Res<BurrowDebug>,
    dirty: Res<DirtyBricks>,
    terrains: Query<(Entity, &Terrain, &GlobalTransform, Option<&RenderLayers>, &InheritedVisibility)>,
    cameras: Query<(&Camera, &GlobalTransform), With<Camera3d>>,
    shown: Query<(Entity, &DebugLines, &ChildOf)>,
    mut assets: ResMut<Assets<GizmoAsset>>,
    mut drawn: Local<HashMap<(Entity, DebugView), Drawing>>,
    mut frames: Local<u64>,
    mut faded: Local<bool>,
) {
    let is_seen = |terrain: Entity| terrains.get(terrain).is_ok_and(|(.., seen)| seen.get());
    for (entity, lines, parent) in &shown {
        if !debug.shows(lines.view) || !is_seen(parent.parent()) {
            commands.entity(entity).try_despawn();
        }
    }
    drawn.retain(|(terrain, view), _| debug.shows(*view) && is_seen(*terrain));
    if !DebugView::ALL.into_iter().any(|view| debug.shows(view)) {
        return;
    }
    // One more time after the last one is forgotten.
    *frames += u64::from(!dirty.0.is_empty() || *faded);
    *faded = !dirty.0.is_empty();
    // Without a clock, views are drawn as soon as they are outdated.
    let period = if time.is_some() { PERIOD } else { Duration::ZERO };
    let now = time.map_or(Duration::ZERO, |time| time.elapsed());
    for (entity, terrain, own_place, render_layers, _) in terrains.iter().filter(|(.., seen)| seen.get()) {
        let Some(focus) = focus(&debug, terrain, own_place, &cameras) else { continue };
        let (place, rounded) = place(&debug, focus, voxel_metres(own_place));
        for view in DebugView::ALL.into_iter().filter(|&view| debug.shows(view)) {
            let fading = if view == DebugView::Dirty { *frames } else { 0 };
            let key = Key {
                version: terrain.world().version(),
                cut: terrain.drawn_cut().filter(|_| view == DebugView::Levels).cloned(),
                focus: rounded,
                settings: debug.clone(),
                fading,
                render_layers: render_layers.cloned(),
            };
            let own =
                shown.iter().filter(|(_, lines, parent)| lines.view == view && parent.parent() == entity);
            let own: Vec<Entity> = own.map(|(lines, ..)| lines).collect();
            let is_current = |last: &Drawing| last.is_current(&key, own.len(), now, period);
            if drawn.get(&(entity, view)).is_some_and(is_current) {
                continue;
            }
            let fresh = fresh_bricks(&dirty, entity, &debug, now);
            let mut out = LineBuffer::new(debug.max_lines);
            views::draw(view, terrain, place, if view == DebugView::Dirty { &fresh } else { &[] }, &mut out);
            own.into_iter().for_each(|old| commands.entity(old).try_despawn());
            let layers = out.finish();
            drawn.insert((entity, view), Drawing { key, since: now, layers: layers.len() });
            for layer in layers {
                // They are drawn in this frame, after transforms were propagated.
                let lines = (DebugLines { view }, gizmo(layer, &mut assets), ChildOf(entity), *own_place);
                let mut lines = commands.spawn(lines);
                if let Some(render_layers) = render_layers {
                    lines.insert(render_layers.clone());
                }
            }
        }
    }
}

/// What views are drawn around, in voxels of this many metres; with the focus in steps, as a key.
fn place(debug: &BurrowDebug, focus: Vec3, scale: f32) -> (Place, IVec3) {
    // Rounded, so that small moves of the camera draw nothing again.
    let step = (debug.near / scale / 4.0).max(1.0);
    let steps = (focus / step).round();
    let place = Place {
        focus: steps * step,
        radius: debug.radius / scale,
        near: debug.near / scale,
        #[cfg(feature = "navigation")]
        agent: debug.agent.scaled(1.0 / scale),
    };
    (place, steps.as_ivec3())
}

fn gizmo(layer: Layer, assets: &mut Assets<GizmoAsset>) -> Gizmo {
    let mut asset = GizmoAsset::default();
    for (from, to, color) in layer.lines {
        asset.line(from, to, color);
    }
    let line_config = GizmoLineConfig { width: layer.width, ..default() };
    Gizmo { handle: assets.add(asset), line_config, depth_bias: BIAS }
}

/// The dirty bricks of a terrain in order, each with its freshness.
fn fresh_bricks(dirty: &DirtyBricks, terrain: Entity, debug: &BurrowDebug, now: Duration) -> Vec<Dirty> {
    let mut fresh: Vec<Dirty> = dirty
        .0
        .iter()
        .filter(|((of, _), _)| *of == terrain)
        .map(|((_, brick), since)| (*brick, 1.0 - now.saturating_sub(*since).as_secs_f32() / debug.fade))
        .collect();
    fresh.sort_unstable_by_key(|(brick, _)| brick.0.to_array());
    fresh
}

/// The centre of the views, in voxels of a terrain: set by the game, or where the camera looks at the ground, or its
/// place.
fn focus(
    debug: &BurrowDebug,
    terrain: &Terrain,
    place: &GlobalTransform,
    cameras: &Query<(&Camera, &GlobalTransform), With<Camera3d>>,
) -> Option<Vec3> {
    let inverse = place.affine().inverse();
    let focus = match debug.focus {
        Some(focus) => inverse.transform_point3(focus),
        None => {
            let (_, eye) = cameras.iter().find(|(camera, _)| camera.is_active).or(cameras.iter().next())?;
            let origin = inverse.transform_point3(eye.translation());
            let along = inverse.transform_vector3(*eye.forward());
            let hit = terrain.world().raycast(origin.as_dvec3(), along.as_dvec3(), SIGHT);
            hit.map_or(origin, |hit| hit.position.as_vec3())
        }
    };
    focus.is_finite().then_some(focus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BurrowPlugins;
    use crate::ground::Ground;
    use crate::terrain::TerrainSettings;

    /// An app that shows the chunks of a terrain, which stands there.
    fn app(place: Transform) -> (App, Entity) {
        let mut app = App::new();
        app.add_plugins((
            MinimalPlugins,
            AssetPlugin::default(),
            TransformPlugin,
            BurrowPlugins,
            BurrowDebugPlugin,
        ))
        .init_asset::<GizmoAsset>()
        .insert_resource(BurrowDebug { chunks: true, focus: Some(Vec3::splat(120.0)), ..default() });
        app.finish();
        app.cleanup();
        let ground = Ground::flat(64, 64, 8.0).expect("valid");
        let terrain = Terrain::new(ground, &TerrainSettings { voxel_size: 0.5, ..default() }).expect("valid");
        let entity = app.world_mut().spawn((terrain, place, InheritedVisibility::VISIBLE)).id();
        app.update();
        (app, entity)
    }

    #[test]
    fn lines_are_where_their_terrain_is_in_the_frame_they_come_in_and_go_when_it_is_hidden() {
        let place = Transform::from_xyz(100.0, 116.0, 104.0);
        let (mut app, entity) = app(place);
        let mut lines = app.world_mut().query_filtered::<&GlobalTransform, With<DebugLines>>();
        let places: Vec<&GlobalTransform> = lines.iter(app.world()).collect();
        let expected = GlobalTransform::from(place.with_scale(Vec3::splat(0.5)));
        assert!(!places.is_empty() && places.iter().all(|&&place| place == expected), "{places:?}");
        app.world_mut().entity_mut(entity).insert(InheritedVisibility::HIDDEN);
        app.update();
        assert_eq!(lines.iter(app.world()).count(), 0);
    }

    #[test]
    fn lines_that_a_game_despawns_are_drawn_again_and_others_are_left_alone() {
        let (mut app, entity) = app(Transform::from_xyz(100.0, 116.0, 104.0));
        let mut lines = app.world_mut().query_filtered::<Entity, With<DebugLines>>();
        let before: Vec<Entity> = lines.iter(app.world()).collect();
        app.update();
        assert!(!before.is_empty());
        assert_eq!(lines.iter(app.world()).collect::<Vec<_>>(), before);
        app.world_mut().entity_mut(entity).despawn_children();
        assert_eq!(lines.iter(app.world()).count(), 0);
        app.update();
        assert_eq!(lines.iter(app.world()).count(), before.len());
    }
}
