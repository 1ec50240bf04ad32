//! What the panel sets of a terrain.

use bevy::ecs::system::Commands;
use bevy::prelude::{Entity, EntityWorldMut};

use crate::plugin::LooseGround;
use crate::terrain::Terrain;
use crate::view::GroundLook;
use crate::volume::DiggingRules;

/// What a terrain has of settings, to be changed where they are shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Customs {
    pub rules: DiggingRules,
    pub loose: Option<LooseGround>,
    pub look: Option<GroundLook>,
}

impl Customs {
    pub fn of(terrain: &Terrain, loose: Option<&LooseGround>, look: Option<&GroundLook>) -> Self {
        let rules = terrain.world().rules().cloned().unwrap_or_default();
        Self { rules, loose: loose.copied(), look: look.cloned() }
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
                if let Some(mut terrain) = terrain.get_mut::<Terrain>() {
                    terrain.set_rules(self.rules);
                }
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::{DetectChanges, World};

    use super::*;
    use crate::ground::{Ground, MaterialId};
    use crate::terrain::TerrainSettings;

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
            Customs { rules: rules.clone(), loose: None, look: look.clone() },
            Customs { rules: rules.clone(), loose, look: look.clone() },
            Customs { rules: DiggingRules::default(), loose, look: look.clone() },
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
}
