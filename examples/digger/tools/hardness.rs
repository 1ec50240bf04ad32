//! What breaks how easily: concrete and gold take more blows than soil and rock, and deep down nothing breaks at all.

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use bevy_burrow::volume::MaterialCounts;

use crate::tools::inventory::FIRST;
use crate::ui::hud::Hint;
use crate::world::landscape::{self, COAL, CONCRETE, GOLD, ROCK};

/// Nothing breaks below this height.
const BEDROCK: i32 = -32;

/// A pickaxe is a match for all but concrete and gold, a drill for all but gold, a bomb for everything.
pub fn rules() -> DiggingRules {
    DiggingRules::default()
        .with_hardness(ROCK, 90)
        .with_hardness(COAL, 110)
        .with_hardness(CONCRETE, 180)
        .with_hardness(GOLD, 200)
        .with_bedrock(BEDROCK)
}

/// Says why the ground does not give way.
pub struct ToughnessPlugin;

impl Plugin for ToughnessPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, explain.after(BurrowSystems::Commit));
    }
}

pub fn explain(mut receipts: MessageReader<BrushApplied>, mut hints: MessageWriter<Hint>) {
    for BrushApplied { receipt, .. } in receipts.read().filter(|answer| answer.receipt.tag >= FIRST) {
        let Ok(applied) = &receipt.outcome else { continue };
        let refused = &applied.refused;
        let broken = applied.removed.total();
        let most = |tally: &MaterialCounts| {
            tally.iter().max_by_key(|part| part.1).map(|(id, _)| landscape::name(id))
        };
        if refused.unbreakable.total() > broken {
            hints.write(Hint::new("bedrock: nothing breaks it"));
        } else if let Some(name) = most(&refused.too_hard).filter(|_| refused.too_hard.total() > broken) {
            hints.write(Hint::new(format!("{name} is too hard for this")));
        } else if let Some(name) = most(&refused.slowed).filter(|_| refused.slowed.total() > broken) {
            hints.write(Hint::new(format!("{name} is hard: keep at it")));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tools::Tool;

    /// Ground with a ball of a material, so deep.
    fn ground(material: MaterialId, depth: f32) -> (Terrain, Shape) {
        let ground = Ground::flat(64, 64, 10.0).expect("a world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        terrain.set_rules(rules()).expect("valid rules");
        let place = Vec3::new(32.0, 10.0 - depth, 32.0);
        terrain.apply([Brush::paint(Shape::sphere(place, 6.0), material)]);
        (terrain, Shape::sphere(place, 2.0))
    }

    /// What blows of a tool take of it.
    fn taken(tool: Tool, material: MaterialId) -> Vec<u64> {
        let (mut terrain, shape) = ground(material, 4.0);
        let blow = Brush::dig(shape).with_power(tool.power());
        let receipts = (0..9).flat_map(|_| terrain.apply([&blow]));
        receipts.map(|receipt| receipt.outcome.expect("a valid brush").removed.total()).collect()
    }

    #[test]
    fn what_is_harder_takes_more_blows() {
        let whole = taken(Tool::Bomb, GOLD)[0];
        assert!(whole > 25);
        for (tool, material) in [(Tool::Pickaxe, ROCK), (Tool::Pickaxe, COAL), (Tool::Drill, CONCRETE)] {
            assert_eq!(taken(tool, material)[0], whole, "{material:?}");
        }
        for (tool, material) in [(Tool::Pickaxe, CONCRETE), (Tool::Pickaxe, GOLD), (Tool::Drill, GOLD)] {
            let blows = taken(tool, material);
            // What is at the rim of the blow may never give way.
            let all: u64 = blows.iter().sum();
            assert!(blows[0] < whole && all > whole * 3 / 4, "{material:?}: {blows:?} of {whole}");
        }
    }

    #[test]
    fn nobody_is_left_wondering() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, ToughnessPlugin))
            .add_message::<BrushApplied>()
            .add_message::<Hint>();
        let mut told = |material: MaterialId, depth: f32, power: u8, tag: u64| {
            let (mut terrain, shape) = ground(material, depth);
            let receipts = terrain.apply([Brush::dig(shape).with_power(power).with_tag(tag)]);
            for receipt in receipts {
                app.world_mut().write_message(BrushApplied { terrain: Some(Entity::PLACEHOLDER), receipt });
            }
            app.update();
            let mut hints = app.world_mut().resource_mut::<Messages<Hint>>();
            hints.drain().map(|hint| hint.words().to_owned()).collect::<Vec<String>>().concat()
        };
        assert_eq!(told(ROCK, 4.0, 100, FIRST), "");
        assert_eq!(told(GOLD, 4.0, 100, FIRST), "gold is too hard for this");
        assert_eq!(told(GOLD, 4.0, 115, FIRST), "gold is hard: keep at it");
        assert_eq!(told(ROCK, 50.0, 255, FIRST), "bedrock: nothing breaks it");
        // Nobody's hand.
        assert_eq!(told(ROCK, 50.0, 255, 0), "");
    }
}
