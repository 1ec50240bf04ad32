//! Settings of a terrain that the panel can change.

use bevy::ecs::system::Commands;
use bevy::log::warn;
use bevy::prelude::{Entity, EntityWorldMut};

use crate::terrain::{LooseSettings, Terrain};
use crate::threads::free_later;
use crate::view::GroundLook;
use crate::volume::DiggingRules;

/// The settings that the panel shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TerrainControls {
    pub rules: DiggingRules,
    /// Maximum size of the undo history, in bytes.
    pub undo_budget: usize,
    pub loose: Option<LooseSettings>,
    pub look: Option<GroundLook>,
    #[cfg(feature = "scatter")]
    pub plants: Option<crate::scatter::ScatterRules>,
}

impl TerrainControls {
    pub fn of(terrain: &Terrain, loose: Option<&LooseSettings>, look: Option<&GroundLook>) -> Self {
        let rules = terrain.rules().cloned().unwrap_or_default();
        let undo_budget = terrain.undo_budget();
        Self {
            rules,
            undo_budget,
            loose: loose.copied(),
            look: look.cloned(),
            #[cfg(feature = "scatter")]
            plants: None,
        }
    }

    /// Applies the settings that differ from `before` to the terrain.
    pub fn apply(self, before: &Self, entity: Entity, commands: &mut Commands) {
        let Ok(mut terrain) = commands.get_entity(entity) else { return };
        if self.loose != before.loose {
            match self.loose {
                Some(loose) => terrain.try_insert(loose),
                None => terrain.try_remove::<LooseSettings>(),
            };
        }
        if let Some(look) = self.look.filter(|look| before.look.as_ref() != Some(look)) {
            terrain.try_insert(look);
        }
        #[cfg(feature = "scatter")]
        if let Some(plants) = self.plants.filter(|plants| before.plants.as_ref() != Some(plants)) {
            terrain.try_insert(crate::plants::Plants(plants));
        }
        if self.rules != before.rules {
            terrain.queue_silenced(move |mut terrain: EntityWorldMut| {
                let Some(mut terrain) = terrain.get_mut::<Terrain>() else { return };
                if let Err(error) = terrain.set_rules(self.rules) {
                    warn!("{error}");
                }
            });
        }
        if self.undo_budget != before.undo_budget {
            terrain.queue_silenced(move |mut terrain: EntityWorldMut| {
                let Some(mut terrain) = terrain.get_mut::<Terrain>() else { return };
                let waste = terrain.rebudget_undo(self.undo_budget);
                if !waste.is_empty() {
                    free_later(waste);
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;
    use bevy::prelude::{DetectChanges, World};

    use super::*;
    use crate::brush::{Brush, Shape};
    use crate::ground::{Ground, MaterialId};
    use crate::terrain::{History, TerrainSettings};

    #[test]
    fn only_changes_are_applied() {
        let mut world = World::new();
        let ground = Ground::flat(64, 64, 8.0).expect("valid");
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        let look = Some(GroundLook::default());
        let terrain = world.spawn((terrain, GroundLook::default())).id();
        let read = |world: &World| {
            let entity = world.entity(terrain);
            TerrainControls::of(entity.get().expect("it is there"), entity.get(), entity.get())
        };
        let rules = DiggingRules::default().with_bedrock(i32::MIN).with_hardness(MaterialId(3), 9);
        let loose = Some(LooseSettings { crumbs: 5, ..LooseSettings::default() });
        let steps = [
            TerrainControls {
                rules: rules.clone(),
                undo_budget: 5 << 20,
                loose: None,
                look: look.clone(),
                ..Default::default()
            },
            TerrainControls {
                rules: rules.clone(),
                undo_budget: 6 << 20,
                loose: None,
                look: look.clone(),
                ..Default::default()
            },
            TerrainControls {
                rules: rules.clone(),
                undo_budget: 6 << 20,
                loose,
                look: look.clone(),
                ..Default::default()
            },
            TerrainControls {
                rules: DiggingRules::default(),
                undo_budget: 6 << 20,
                loose,
                look: look.clone(),
                ..Default::default()
            },
            TerrainControls {
                look: Some(GroundLook { variety: 0.25, ..GroundLook::default() }),
                ..TerrainControls::default()
            },
        ];
        for step in steps {
            let before = read(&world);
            assert_ne!(before, step);
            step.clone().apply(&before, terrain, &mut world.commands());
            world.flush();
            assert_eq!(read(&world), step);
            world.clear_trackers();
            step.clone().apply(&step, terrain, &mut world.commands());
            world.flush();
            let terrain = world.entity(terrain).get_ref::<Terrain>().expect("it is there");
            assert!(!terrain.is_changed() && !terrain.is_added());
        }
    }

    #[test]
    fn each_terrain_has_its_own_budget_of_undo() {
        let mut world = World::new();
        let [large, small] = [20.0, 40.0].map(|x| {
            let ground = Ground::flat(64, 64, 8.0).expect("valid");
            let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
            terrain.apply([Brush::dig(Shape::sphere(Vec3::new(x, 8.0, 30.0), 5.0))]);
            world.spawn(terrain).id()
        });
        let read = |world: &World, of| world.get::<Terrain>(of).map(|of| (of.undo_budget(), of.history()));
        let before = TerrainControls::of(world.get(small).expect("it is there"), None, None);
        let (at_first, of_large) = (read(&world, small), read(&world, large));
        assert!(at_first.is_some_and(|(budget, history)| budget == before.undo_budget && history.undos == 1));
        TerrainControls { undo_budget: 0, ..before.clone() }.apply(&before, small, &mut world.commands());
        world.flush();
        assert_eq!(read(&world, small), Some((0, History::default())));
        assert_eq!(read(&world, large), of_large);
    }
}
