//! Veins of coal, gold and clay in the hill before the player, painted into the ground where they cannot be seen from
//! outside.

use std::f32::consts::TAU;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::film::places::{Hillside, Places, flat};
use crate::tools::inventory::FIRST_PLAYER_TAG;
use crate::world::landscape::{CLAY, COAL, GOLD};

/// Number of veins spread over the hill, and how far they are from its middle in metres.
const SPARSE: u32 = 42;
const SPARSE_RADIUS: f32 = 85.0;
/// Metres that veins lie below the surface.
const DEPTHS: (f32, f32) = (3.5, 24.0);
/// Number of veins behind the slope, where players dig, and their distances inward, sideways and up, in metres.
const DENSE: u32 = 60;
const INWARD: (f32, f32) = (6.0, 70.0);
const SIDEWAYS: (f32, f32) = (-22.0, 22.0);
const UP: (f32, f32) = (-4.0, 9.0);
/// The tag of their brushes. Neither the player's nor a script's brushes have it.
pub const VEIN_TAG: u64 = FIRST_PLAYER_TAG - 1;

/// Paints the veins when the terrain is ready.
pub struct VeinsPlugin;

impl Plugin for VeinsPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(paint_veins).add_systems(Update, clear_history.after(BurrowSystems::Commit));
    }
}

fn paint_veins(
    ready: On<TerrainReady>,
    terrains: Query<&Terrain>,
    places: Res<Places>,
    mut brushes: MessageWriter<Brush>,
) {
    let Ok(terrain) = terrains.get(ready.entity) else { return };
    let height = |place: Vec2| terrain.world().height(place.x.into(), place.y.into());
    brushes.write_batch(veins(&places.hillside, height));
}

/// Veins are part of the landscape: the player's undo must not remove them.
fn clear_history(mut receipts: MessageReader<BrushApplied>, mut terrains: Query<&mut Terrain>) {
    if receipts.read().filter(|answer| answer.receipt.tag == VEIN_TAG).count() == 0 {
        return;
    }
    for mut terrain in &mut terrains {
        terrain.clear_history();
    }
}

/// The same veins in every game.
fn veins(hill: &Hillside, height: impl Fn(Vec2) -> Option<f64>) -> Vec<Brush> {
    let mut random = fastrand::Rng::with_seed(11);
    let mut between = |(low, high): (f32, f32)| low + (high - low) * random.f32();
    let vein = |number: u32| {
        let middle = if number < SPARSE {
            let out = Vec2::from_angle(between((0.0, TAU))) * SPARSE_RADIUS * between((0.0, 1.0)).sqrt();
            let place = hill.mouth.xz() + hill.inward * 45.0 + out;
            flat(place).with_y(height(place)? as f32 - between(DEPTHS))
        } else {
            let offset = hill.inward * between(INWARD) + hill.inward.perp() * between(SIDEWAYS);
            hill.mouth + flat(offset).with_y(between(UP))
        };
        let length = Vec2::from_angle(between((0.0, TAU))) * between((5.0, 13.0));
        let half = flat(length / 2.0).with_y(between((-1.2, 1.2)));
        let (ends, radius, seed) = ([middle - half, middle + half], between((0.9, 1.7)), number);
        let is_deep = |end: &Vec3| height(end.xz()).is_some_and(|top| end.y + DEPTHS.0 <= top as f32);
        if ![ends[0], middle, ends[1]].iter().all(is_deep) {
            return None;
        }
        let material = [COAL, CLAY, GOLD, COAL, CLAY][number as usize % 5];
        let brush = Brush::paint(Shape::capsule(ends[0], ends[1], radius), material);
        Some(brush.with_roughness(Roughness::new(0.8, 2.4, seed)).with_tag(VEIN_TAG))
    };
    (0..SPARSE + DENSE).filter_map(vein).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::update_until;

    /// The foot of a slope that rises along x.
    const HILL: Hillside = Hillside { mouth: Vec3::new(60.0, 60.0, 128.0), inward: Vec2::X, onward: Vec2::Y };

    #[test]
    fn veins_lie_in_the_ground_and_can_be_found() {
        let rise = |x: i32| f64::from((x - 60).clamp(0, 40));
        let ground = Ground::from_fn(256, 256, |x, _| 60.0 + rise(x)).expect("a world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let all = veins(&HILL, |place| terrain.world().height(place.x.into(), place.y.into()));
        assert!(all.len() > (SPARSE + DENSE) as usize / 2, "{}", all.len());
        let receipts = terrain.apply(&all);
        let painted =
            receipts.iter().map(|receipt| receipt.outcome.as_ref().expect("valid").painted.of(GOLD));
        let painted: u64 = painted.sum();
        assert!(painted > 100, "{painted}");
        // None of them can be seen.
        assert!(terrain.world().mask().is_empty());
    }

    #[test]
    fn veins_cannot_be_undone() {
        let ground = Ground::from_fn(256, 256, |_, _| 60.0).expect("a world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let budget = terrain.undo_budget() / 2;
        terrain.set_undo_budget(budget);
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins))
            .add_systems(Update, clear_history.after(BurrowSystems::Commit));
        app.finish();
        app.cleanup();
        let entity = app.world_mut().spawn(terrain).id();
        app.world_mut().resource_mut::<Messages<Brush>>().write_batch(veins(&HILL, |_| Some(60.0)));
        update_until(&mut app, "veins are painted", |app| {
            app.world().get::<Terrain>(entity).is_some_and(|terrain| terrain.world().bricks().count() > 0)
        });
        let terrain = app.world().get::<Terrain>(entity).expect("a terrain");
        assert_eq!((terrain.history().undos, terrain.undo_budget()), (0, budget));
    }
}
