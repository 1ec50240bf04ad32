//! What the panel sets of a terrain.

use bevy::ecs::system::Commands;
use bevy::log::warn;
use bevy::prelude::{Entity, EntityWorldMut};

use crate::plugin::{LooseGround, free_later};
use crate::terrain::Terrain;
use crate::view::GroundLook;
use crate::volume::DiggingRules;

/// What a terrain has of settings, to be changed where they are shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Customs {
    pub rules: DiggingRules,
    /// Bytes that undo may take.
    pub undo_budget: usize,
    pub loose: Option<LooseGround>,
    pub look: Option<GroundLook>,
}

impl Customs {
    pub fn of(terrain: &Terrain, loose: Option<&LooseGround>, look: Option<&GroundLook>) -> Self {
        let rules = terrain.rules().cloned().unwrap_or_default();
        let undo_budget = terrain.undo_budget();
        Self { rules, undo_budget, loose: loose.copied(), look: look.cloned() }
    }

    /// Hands what differs on to the terrain.
    pub fn enact(self, before: &Self, entity: Entity, commands: &mut Commands) {
        let Ok(mut terrain) = commands.get_entity(entity) else { return };
        if self.loose != before.loose {
            match self.loose {
                Some(loose) => terrain.try_insert(loose),
                None => terrain.try_remove::<LooseGround>(),
            };
        }
        if let Some(look) = self.look.filter(|look| before.look.as_ref() != Some(look)) {
            terrain.try_insert(look);
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
    fn what_differs_and_nothing_else_is_handed_on() {
        let mut world = World::new();
        let ground = Ground::flat(64, 64, 8.0).expect("valid");
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        let look = Some(GroundLook::default());
        let terrain = world.spawn((terrain, GroundLook::default())).id();
        let read = |world: &World| {
            let entity = world.entity(terrain);
            Customs::of(entity.get().expect("it is there"), entity.get(), entity.get())
        };
        let rules = DiggingRules::default().with_bedrock(i32::MIN).with_hardness(MaterialId(3), 9);
        let loose = Some(LooseGround { crumbs: 5, ..LooseGround::default() });
        let steps = [
            Customs { rules: rules.clone(), undo_budget: 5 << 20, loose: None, look: look.clone() },
            Customs { rules: rules.clone(), undo_budget: 6 << 20, loose: None, look: look.clone() },
            Customs { rules: rules.clone(), undo_budget: 6 << 20, loose, look: look.clone() },
            Customs { rules: DiggingRules::default(), undo_budget: 6 << 20, loose, look: look.clone() },
            Customs {
                look: Some(GroundLook { variety: 0.25, ..GroundLook::default() }),
                ..Customs::default()
            },
        ];
        for step in steps {
            let before = read(&world);
            assert_ne!(before, step);
            step.clone().enact(&before, terrain, &mut world.commands());
            world.flush();
            assert_eq!(read(&world), step);
            world.clear_trackers();
            step.clone().enact(&step, terrain, &mut world.commands());
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
        let before = Customs::of(world.get(small).expect("it is there"), None, None);
        let (at_first, of_large) = (read(&world, small), read(&world, large));
        assert!(at_first.is_some_and(|(budget, history)| budget == before.undo_budget && history.undos == 1));
        Customs { undo_budget: 0, ..before.clone() }.enact(&before, small, &mut world.commands());
        world.flush();
        assert_eq!(read(&world, small), Some((0, History::default())));
        assert_eq!(read(&world, large), of_large);
    }
}
