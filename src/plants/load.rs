//! Which patches are loaded: those around cameras and sources, made in a task.

use std::sync::Arc;

use bevy::ecs::entity_disabling::Disabled;
use bevy::ecs::query::Allow;
use bevy::prelude::*;

use super::follow::PlantMessages;
use super::{News, PlantSource, Plants, ShownPlants};
use crate::plugin::{Places, Squares, TerrainEntities, are_same, position_on, voxel_metres};
use crate::scatter::{PatchPos, Plant, PlantPatches, Scatter};
use crate::terrain::{Terrain, World as TerrainWorld};
use crate::threads::{ThreadTask, Threads, free_later};

/// The most cells whose patches one task makes.
const CELLS: i32 = 1 << 16;

/// The largest radius of a source, in voxels. A world may be far larger, and its squares are counted whenever a viewer
/// moves.
const LARGEST_RADIUS: f32 = 2048.0;

/// The place of a camera, or of a source with its radius, in voxels of the terrain.
pub(super) type Viewer = (Vec2, Option<f32>);

/// A task that makes patches.
pub(super) struct LoadTask(ThreadTask<Vec<(PatchPos, Vec<Plant>)>>);

impl std::fmt::Debug for LoadTask {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("LoadTask")
    }
}

/// Reads rules that are new or changed.
pub(super) fn read_rules(mut changed: Query<(Entity, &Plants, &mut ShownPlants), Changed<Plants>>) {
    for (entity, Plants(rules), mut shown) in &mut changed {
        let scatter =
            Scatter::new(rules).map_err(|error| error!("the terrain {entity} has no plants: {error}"));
        shown.clear();
        shown.patches = scatter.ok().map(|scatter| PlantPatches::new(Arc::new(scatter)));
    }
}

/// Without rules there are no plants.
pub(super) fn forget_rules(gone: On<Remove, Plants>, mut terrains: Query<&mut ShownPlants, Allow<Disabled>>) {
    if let Ok(mut shown) = terrains.get_mut(gone.entity) {
        shown.clear();
        free_later(shown.patches.take());
    }
}

/// Without ground there are none either.
pub(super) fn forget_ground(
    gone: On<Remove, Terrain>,
    mut terrains: Query<&mut ShownPlants, Allow<Disabled>>,
) {
    if let Ok(mut shown) = terrains.get_mut(gone.entity) {
        shown.clear();
    }
}

impl ShownPlants {
    /// Drops all patches.
    fn clear(&mut self) {
        let scatter = self.scatter().cloned();
        free_later(std::mem::replace(&mut self.patches, scatter.map(PlantPatches::new)));
        (self.task, self.version, self.is_settled) = (None, None, false);
        self.news.push(News::Cleared);
    }

    /// Drops patches that no viewer is near to, and starts to make those that are missing.
    fn load_around(&mut self, viewers: Vec<Viewer>, world: &TerrainWorld) {
        let Some(patches) = &mut self.patches else { return };
        let scatter = Arc::clone(patches.scatter());
        let near = near(&scatter, (world.ground().width(), world.ground().depth()), &viewers);
        self.viewers = viewers;
        let far: Vec<PatchPos> =
            patches.iter().map(|(pos, _)| pos).filter(|pos| !near.kept.contains(pos)).collect();
        for pos in far {
            free_later(patches.remove(pos));
            self.news.push(News::Unloaded(pos));
        }
        let missing = near.wanted(|pos| patches.get(pos).is_none());
        self.is_settled = missing.is_empty();
        if self.is_settled {
            return;
        }
        let mut cells = 0;
        let first = missing.into_iter().take_while(|pos| {
            let fits = cells < CELLS;
            cells += scatter.patch_size(pos.species).pow(2);
            fits
        });
        // Not a snapshot of the world: digs would have to copy its index meanwhile.
        let (first, ground): (Vec<PatchPos>, _) = (first.collect(), world.shared_ground());
        self.task = Some(LoadTask(ThreadTask::start(Threads::Background, move || {
            first.into_iter().map(|pos| (pos, scatter.patch(&ground, pos))).collect()
        })));
    }
}

/// Loads patches that cameras and sources are near to, and drops those that none is near to.
pub(super) fn choose_patches(
    mut terrains: Query<(Entity, &Terrain, &TerrainEntities, &mut ShownPlants)>,
    viewers: Query<(Entity, Option<&PlantSource>), Or<(With<Camera3d>, With<PlantSource>)>>,
    places: Places,
    mut messages: PlantMessages,
) {
    for (entity, terrain, entities, mut shown) in &mut terrains {
        let world = terrain.world();
        let is_same = |version: &crate::terrain::Version| version.is_same_world(world.version());
        if shown.patches.is_none() || !entities.show(world) && shown.version.as_ref().is_some_and(is_same) {
            continue;
        }
        if shown.version.as_ref().is_some_and(|version| !is_same(version)) {
            shown.clear();
        }
        let version = Some(world.version());
        let shown = &mut *shown;
        let Some(patches) = &mut shown.patches else { continue };
        if shown.version != version {
            // Follows commits that were not seen, where a game gates their systems.
            let changes = patches.update(world, None);
            let place = places.of(entity).unwrap_or_default();
            messages.tell((entity, world), &place, patches.scatter(), changes, &mut shown.news);
            shown.version = version;
        }
        if let Some(LoadTask(task)) = &mut shown.task {
            let Some(done) = task.check() else { continue };
            shown.task = None;
            for (pos, plants) in done.unwrap_or_default() {
                patches.insert(world, pos, plants);
                shown.news.push(News::Loaded(pos));
            }
        }
        let Some(place) = places.of(entity) else { continue };
        let (inverse, voxel) = (place.affine().inverse(), voxel_metres(&place));
        let viewers: Vec<Viewer> = viewers
            .iter()
            .filter_map(|(viewer, source)| {
                let position = position_on(&inverse, &places.of(viewer)?)?;
                Some((position, source.map(|source| source.radius / voxel)))
            })
            .collect();
        if shown.is_settled && are_same(&shown.viewers, &viewers) {
            continue;
        }
        shown.load_around(viewers, world);
    }
}

/// The patches around viewers in a world of these many cells.
fn near(scatter: &Scatter, cells: (i32, i32), viewers: &[Viewer]) -> Squares<PatchPos> {
    let mut near = Squares::default();
    for (species, own) in (0..=u8::MAX).zip(scatter.species()) {
        for &(position, radius) in viewers {
            let radius = radius.map_or(own.view.end, |radius| radius.clamp(0.0, LARGEST_RADIUS));
            let key = |square: IVec2| PatchPos { species, x: square.x, z: square.y };
            near.add((position, radius), scatter.patch_size(species), cells, key);
        }
    }
    near
}
