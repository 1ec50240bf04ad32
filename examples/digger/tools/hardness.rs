//! How hard the materials are: concrete and gold take more hits than soil and rock, and nothing breaks bedrock.

use bevy::prelude::*;
use bevy_burrow::prelude::*;
use bevy_burrow::volume::MaterialCounts;

use crate::tools::inventory::FIRST_PLAYER_TAG;
use crate::ui::hud::Hint;
use crate::ui::texts;
use crate::world::landscape::{self, COAL, CONCRETE, GOLD, ROCK, SANDSTONE, SHALE};

/// Below this height, nothing breaks.
pub const BEDROCK: i32 = -32;

/// A pickaxe breaks all but concrete and gold at once, a drill all but gold, and a bomb everything.
pub fn rules() -> DiggingRules {
    DiggingRules::default()
        .with_hardness(SHALE, 60)
        .with_hardness(SANDSTONE, 80)
        .with_hardness(ROCK, 90)
        .with_hardness(COAL, 110)
        .with_hardness(CONCRETE, 180)
        .with_hardness(GOLD, 200)
        .with_bedrock(BEDROCK)
}

/// Tells the player why the ground does not break.
pub struct HardnessPlugin;

impl Plugin for HardnessPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, explain.after(BurrowSystems::Commit));
    }
}

pub fn explain(mut receipts: MessageReader<BrushApplied>, mut hints: MessageWriter<Hint>) {
    for BrushApplied { receipt, .. } in
        receipts.read().filter(|answer| answer.receipt.tag >= FIRST_PLAYER_TAG)
    {
        let Ok(applied) = &receipt.outcome else { continue };
        let refused = &applied.refused;
        let broken = applied.removed.total();
        // The most frequent material, if there is more of it than was broken.
        let most = |counts: &MaterialCounts| {
            let most =
                counts.iter().max_by_key(|count| count.1).map(|(material, _)| landscape::name(material));
            most.filter(|_| counts.total() > broken)
        };
        if refused.unbreakable.total() > broken {
            hints.write(Hint(texts::UNBREAKABLE.into()));
        } else if let Some(name) = most(&refused.too_hard) {
            hints.write(Hint(texts::too_hard(name)));
        } else if let Some(name) = most(&refused.slowed) {
            hints.write(Hint(texts::hard(name)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::drain_hints;
    use crate::tools::Tool;

    /// Ground with a ball of a material at this depth.
    fn ground(material: MaterialId, depth: f32) -> (Terrain, Shape) {
        let ground = Ground::flat(64, 64, 10.0).expect("a world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        terrain.set_rules(rules()).expect("valid rules");
        let place = Vec3::new(32.0, 10.0 - depth, 32.0);
        terrain.apply([Brush::paint(Shape::sphere(place, 6.0), material)]);
        (terrain, Shape::sphere(place, 2.0))
    }

    /// What hits of a tool dig of it.
    fn dig(tool: Tool, material: MaterialId) -> Vec<u64> {
        let (mut terrain, shape) = ground(material, 4.0);
        let hit = Brush::dig(shape).with_power(tool.power());
        let receipts = (0..9).flat_map(|_| terrain.apply([&hit]));
        receipts.map(|receipt| receipt.outcome.expect("a valid brush").removed.total()).collect()
    }

    #[test]
    fn harder_materials_take_more_hits() {
        let whole = dig(Tool::Bomb, GOLD)[0];
        assert!(whole > 25);
        for (tool, material) in [(Tool::Pickaxe, ROCK), (Tool::Pickaxe, COAL), (Tool::Drill, CONCRETE)] {
            assert_eq!(dig(tool, material)[0], whole, "{material:?}");
        }
        for (tool, material) in [(Tool::Pickaxe, CONCRETE), (Tool::Pickaxe, GOLD), (Tool::Drill, GOLD)] {
            let hits = dig(tool, material);
            // What is at the edge of the brush may never break.
            let all: u64 = hits.iter().sum();
            assert!(hits[0] < whole && all > whole * 3 / 4, "{material:?}: {hits:?} of {whole}");
        }
    }

    #[test]
    fn the_player_is_told_why_ground_does_not_break() {
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, HardnessPlugin)).add_message::<BrushApplied>().add_message::<Hint>();
        for (material, depth, power, tag, hint) in [
            (ROCK, 4.0, 100, FIRST_PLAYER_TAG, ""),
            (GOLD, 4.0, 100, FIRST_PLAYER_TAG, "This tool is too weak for gold."),
            (GOLD, 4.0, 115, FIRST_PLAYER_TAG, "The gold is hard. Keep digging."),
            (ROCK, 50.0, 255, FIRST_PLAYER_TAG, "Bedrock can't be broken."),
            // A script's brush.
            (ROCK, 50.0, 255, 0, ""),
        ] {
            let (mut terrain, shape) = ground(material, depth);
            for receipt in terrain.apply([Brush::dig(shape).with_power(power).with_tag(tag)]) {
                app.world_mut().write_message(BrushApplied { terrain: Some(Entity::PLACEHOLDER), receipt });
            }
            app.update();
            assert_eq!(drain_hints(&mut app).concat(), hint);
        }
    }
}
