//! Follows commits: plants disappear and return in the same frame as their ground.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;

use super::{News, NewsList, PlantRemoved, PlantReturned, ShownPlants, transform_of};
use crate::plugin::{GroundChanged, Places, TerrainEntities};
use crate::scatter::{PlantChange, Scatter};
use crate::terrain::{Terrain, World};

/// Sends the messages of plants that go and return.
#[derive(SystemParam)]
pub(super) struct PlantMessages<'w> {
    removed: MessageWriter<'w, PlantRemoved>,
    returned: MessageWriter<'w, PlantReturned>,
}

impl PlantMessages<'_> {
    /// Writes a message for each change of a terrain's plants, and the news for what draws them.
    pub fn tell(
        &mut self,
        (terrain, world): (Entity, &World),
        place: &GlobalTransform,
        scatter: &Scatter,
        changes: Vec<PlantChange>,
        news: &mut NewsList,
    ) {
        for change in changes {
            let (plant, transform) = (change.plant, transform_of(&change.plant, place));
            if change.stands {
                self.returned.write(PlantReturned { terrain, plant, transform });
            } else {
                let is_felled = scatter.is_felled(world, &plant);
                self.removed.write(PlantRemoved { terrain, plant, transform, is_felled });
            }
            news.push(News::Changed(change));
        }
    }
}

/// Checks the plants whose ground a commit changed in this frame.
pub(super) fn follow_commits(
    mut changed: MessageReader<GroundChanged>,
    mut terrains: Query<(&Terrain, &TerrainEntities, &mut ShownPlants)>,
    places: Places,
    mut messages: PlantMessages,
) {
    for GroundChanged { terrain, versions: [before, after], boxes } in changed.read() {
        let Ok((model, _, mut shown)) = terrains.get_mut(*terrain) else { continue };
        let ShownPlants { patches: Some(patches), version, news, .. } = &mut *shown else { continue };
        if version.is_none_or(|version| !version.is_same_world(*after)) {
            continue; // Another world: loaded again as a whole.
        }
        let world = model.world();
        // This system runs twice in a frame, so it may have followed this commit already.
        if *version == Some(*after) || *version == Some(world.version()) {
            continue;
        }
        let changes: Vec<PlantChange> = match boxes {
            Some(boxes) if *version == Some(*before) => {
                boxes.iter().flat_map(|&samples| patches.update(world, Some(samples))).collect()
            }
            _ => patches.update(world, None),
        };
        *version = Some(*after);
        if changes.is_empty() {
            continue;
        }
        let place = places.of(*terrain).unwrap_or_default();
        messages.tell((*terrain, world), &place, patches.scatter(), changes, news);
    }
}
