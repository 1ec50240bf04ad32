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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BurrowPlugins;
    use crate::brush::{Brush, Shape};
    use crate::ground::Ground;
    use crate::plants::{PlantSource, Plants, PlantsPlugin};
    use crate::plugin::test_app::{commit_two_in_a_frame, meshes_only, run_until};
    use crate::scatter::{PatchPos, ScatterRules, Species, ViewDistances};
    use crate::terrain::TerrainSettings;

    /// Level ground of 6 x 6 patches.
    fn level() -> Terrain {
        let ground = Ground::flat(96, 96, 20.0).expect("valid ground");
        Terrain::new(ground, &TerrainSettings::default()).expect("valid settings")
    }

    /// A dig in the patch with this number along x and z.
    fn dig(patch: i32) -> Brush {
        let middle = patch as f32 * 16.0 + 8.0;
        Brush::dig(Shape::sphere(Vec3::new(middle, 20.0, middle), 3.0))
    }

    /// An app with a terrain all of whose grass is loaded.
    fn app() -> (App, Entity) {
        let mut app = meshes_only();
        app.add_plugins((BurrowPlugins, PlantsPlugin));
        app.finish();
        app.cleanup();
        app.world_mut().spawn((PlantSource { radius: 90.0 }, Transform::from_xyz(48.0, 20.0, 48.0)));
        let view = ViewDistances { end: 60.0, ..default() };
        let rules = ScatterRules { seed: 1, species: vec![Species { view, ..Species::named("grass") }] };
        let terrain = app.world_mut().spawn((level(), Plants(rules))).id();
        run_until(&mut app, |app| {
            let patches = shown(app, terrain).patches();
            patches.is_some_and(|patches| patches.len() == 36) && !shown(app, terrain).is_loading()
        });
        (app, terrain)
    }

    fn shown(app: &App, terrain: Entity) -> &ShownPlants {
        app.world().get(terrain).expect("`Plants` requires it")
    }

    /// Plants that do not stand in the patch with this number along x and z.
    fn gone(app: &App, terrain: Entity, patch: i32) -> usize {
        let patches = shown(app, terrain).patches().expect("valid rules");
        patches.get(PatchPos { species: 0, x: patch, z: patch }).expect("it is loaded").gone_count()
    }

    #[test]
    fn after_two_commits_in_one_frame_only_plants_near_them_are_looked_at_again() {
        let (mut app, terrain) = app();
        // A patch far away says of plants that they are gone, which is wrong until something looks at them again.
        let mut dug = level();
        dug.apply([dig(5)]);
        let far = PatchPos { species: 0, x: 5, z: 5 };
        let mut plants = app.world_mut().get_mut::<ShownPlants>(terrain).expect("`Plants` requires it");
        let patches = plants.patches.as_mut().expect("valid rules");
        let in_far = patches.scatter().patch(dug.world().ground(), far);
        patches.insert(dug.world(), far, in_far);
        let wrong = gone(&app, terrain, 5);
        assert!(wrong > 0);
        commit_two_in_a_frame(&mut app, terrain, [1, 3].map(dig));
        assert!(gone(&app, terrain, 1) > 0 && gone(&app, terrain, 3) > 0);
        (0..3).for_each(|_| app.update());
        assert_eq!(gone(&app, terrain, 5), wrong);
        assert_eq!(gone(&app, terrain, 0) + gone(&app, terrain, 4), 0);
    }
}
