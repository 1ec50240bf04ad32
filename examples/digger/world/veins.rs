//! Veins of coal, gold and clay within the hill before the player: painted into the ground where nobody sees them yet, and
//! dug up as what they are.

use std::f32::consts::TAU;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::film::places::{Hillside, Places, flat};
use crate::tools::inventory::FIRST;
use crate::world::landscape::{CLAY, COAL, GOLD};

/// How many there are all over the hill, how far from its middle, and metres below the surface.
const SPARSE: u32 = 42;
const AROUND: f32 = 85.0;
const DEPTHS: (f32, f32) = (3.5, 24.0);
/// How many there are behind the slope, where one would dig: how far in, to the sides, and above its foot, in metres.
const DENSE: u32 = 60;
const IN: (f32, f32) = (6.0, 70.0);
const ASIDE: (f32, f32) = (-22.0, 22.0);
const ABOVE: (f32, f32) = (-4.0, 9.0);
/// Of their brushes; neither the hand nor a script has it.
pub const TAG: u64 = FIRST - 1;

/// Hides veins when the landscape is there.
pub struct VeinsPlugin;

impl Plugin for VeinsPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(hide).add_systems(Update, seal.after(BurrowSystems::Commit));
    }
}

fn hide(
    ready: On<TerrainReady>,
    terrains: Query<&Terrain>,
    places: Res<Places>,
    mut brushes: MessageWriter<Brush>,
) {
    let Ok(terrain) = terrains.get(ready.entity) else { return };
    let height = |place: Vec2| terrain.world().height(place.x.into(), place.y.into());
    brushes.write_batch(veins(&places.hillside, height));
}

/// Veins are part of the land: nobody takes them back, and nobody who undoes his first blow.
fn seal(mut receipts: MessageReader<BrushApplied>, mut terrains: Query<&mut Terrain>) {
    if receipts.read().filter(|answer| answer.receipt.tag == TAG).count() == 0 {
        return;
    }
    for mut terrain in &mut terrains {
        terrain.clear_history();
    }
}

/// The same ones in every game.
fn veins(hill: &Hillside, height: impl Fn(Vec2) -> Option<f64>) -> Vec<Brush> {
    let mut chance = fastrand::Rng::with_seed(11);
    let mut between = |(low, high): (f32, f32)| low + (high - low) * chance.f32();
    let vein = |number: u32| {
        let place = if number < SPARSE {
            let out = Vec2::from_angle(between((0.0, TAU))) * AROUND * between((0.0, 1.0)).sqrt();
            let place = hill.mouth.xz() + hill.inward * 45.0 + out;
            flat(place).with_y(height(place)? as f32 - between(DEPTHS))
        } else {
            let (forth, aside) = (hill.inward * between(IN), hill.inward.perp() * between(ASIDE));
            hill.mouth + flat(forth + aside).with_y(between(ABOVE))
        };
        let way = Vec2::from_angle(between((0.0, TAU))) * between((5.0, 13.0));
        let half = flat(way / 2.0).with_y(between((-1.2, 1.2)));
        let (ends, radius, seed) = ([place - half, place + half], between((0.9, 1.7)), number);
        let is_deep = |end: &Vec3| height(end.xz()).is_some_and(|top| end.y + DEPTHS.0 <= top as f32);
        if ![ends[0], place, ends[1]].iter().all(is_deep) {
            return None;
        }
        let material = match number % 5 {
            0 | 3 => COAL,
            1 | 4 => CLAY,
            _ => GOLD,
        };
        let brush = Brush::paint(Shape::capsule(ends[0], ends[1], radius), material);
        Some(brush.with_roughness(Roughness::new(0.8, 2.4, seed)).with_tag(TAG))
    };
    (0..SPARSE + DENSE).filter_map(vein).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the foot of a slope that rises to the right.
    const HILL: Hillside = Hillside { mouth: Vec3::new(60.0, 60.0, 128.0), inward: Vec2::X, onward: Vec2::Y };

    #[test]
    fn veins_lie_in_the_ground_and_can_be_found() {
        let rise = |x: i32| f64::from((x - 60).clamp(0, 40));
        let ground = Ground::from_fn(256, 256, |x, _| 60.0 + rise(x)).expect("a world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let all = veins(&HILL, |place| terrain.world().height(place.x.into(), place.y.into()));
        assert!(all.len() > (SPARSE + DENSE) as usize / 2, "{}", all.len());
        let painted: u64 = terrain
            .apply(&all)
            .iter()
            .map(|receipt| receipt.outcome.as_ref().expect("valid brushes").painted.of(GOLD))
            .sum();
        assert!(painted > 100, "{painted}");
        // Nobody sees any of them yet.
        assert!(terrain.world().mask().is_empty());
    }

    #[test]
    fn veins_can_not_be_undone() {
        let ground = Ground::from_fn(256, 256, |_, _| 60.0).expect("a world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let budget = terrain.undo_budget() / 2;
        terrain.set_undo_budget(budget);
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins))
            .add_systems(Update, seal.after(BurrowSystems::Commit));
        app.finish();
        app.cleanup();
        let terrain = app.world_mut().spawn(terrain).id();
        let all = veins(&HILL, |_| Some(60.0));
        app.world_mut().resource_mut::<Messages<Brush>>().write_batch(all);
        let start = std::time::Instant::now();
        let of = |app: &App| {
            let terrain = app.world().get::<Terrain>(terrain).expect("a terrain");
            (terrain.world().bricks().count(), terrain.history().undos)
        };
        while of(&app).0 == 0 && start.elapsed().as_secs() < 60 {
            app.update();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        let (bricks, undos) = of(&app);
        assert!(bricks > 0 && undos == 0, "{bricks} bricks, {undos} undos");
        // And his own blows find as much room as there ever was.
        let terrain = app.world().get::<Terrain>(terrain).expect("a terrain");
        assert_eq!(terrain.undo_budget(), budget);
    }
}
