//! Veins of coal, gold and clay within the hill before the player: painted into the ground where nobody sees them yet.

use std::f32::consts::TAU;

use bevy::prelude::*;
use bevy_burrow::prelude::*;

use crate::inventory::FIRST;
use crate::landscape::{CLAY, COAL, GOLD};
use crate::places::Places;

/// How many, and how far from the middle of the hill.
const VEINS: u32 = 42;
const AROUND: f32 = 85.0;
/// Of their brushes; neither the hand nor a script has it.
const TAG: u64 = FIRST - 1;
/// Bytes that the ground's history may take once veins are hidden.
const HISTORY: usize = 64 << 20;
/// Metres below the surface.
const DEPTHS: (f32, f32) = (3.5, 24.0);

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
    let middle = places.hillside.mouth.xz() + places.hillside.inward * 45.0;
    let height = |place: Vec2| terrain.world().height(place.x.into(), place.y.into());
    brushes.write_batch(veins(middle, height));
}

/// Veins are part of the land: nobody takes them back, and nobody who undoes his first blow.
fn seal(mut receipts: MessageReader<BrushApplied>, mut terrains: Query<&mut Terrain>) {
    if receipts.read().filter(|answer| answer.receipt.tag == TAG).count() == 0 {
        return;
    }
    for mut terrain in &mut terrains {
        // Without room for it, history is empty.
        terrain.set_undo_budget(0);
        terrain.set_undo_budget(HISTORY);
    }
}

/// The same ones in every game.
fn veins(middle: Vec2, height: impl Fn(Vec2) -> Option<f64>) -> Vec<Brush> {
    let mut chance = fastrand::Rng::with_seed(11);
    let mut between = |low: f32, high: f32| low + (high - low) * chance.f32();
    let vein = |number: u32| {
        let out = Vec2::from_angle(between(0.0, TAU)) * AROUND * between(0.0, 1.0).sqrt();
        let depth = between(DEPTHS.0, DEPTHS.1);
        let way = Vec2::from_angle(between(0.0, TAU)) * between(5.0, 13.0);
        let (tilt, radius, seed) = (between(-2.5, 2.5), between(0.9, 1.7), number);
        let place = middle + out;
        let from = Vec3::new(place.x, height(place)? as f32 - depth, place.y);
        let to = from + Vec3::new(way.x, tilt, way.y);
        let material = match number % 5 {
            0 | 3 => COAL,
            1 | 4 => CLAY,
            _ => GOLD,
        };
        let brush = Brush::paint(Shape::capsule(from, to, radius), material);
        Some(brush.with_roughness(Roughness::new(0.8, 2.4, seed)).with_tag(TAG))
    };
    (0..VEINS).filter_map(vein).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn veins_lie_in_the_ground_and_can_be_found() {
        let ground = Ground::from_fn(256, 256, |x, z| 60.0 + f64::from(x + z) * 0.05).expect("a world");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let all = veins(Vec2::splat(128.0), |place| terrain.world().height(place.x.into(), place.y.into()));
        assert_eq!(all.len(), VEINS as usize);
        let painted: u64 = terrain
            .apply(&all)
            .iter()
            .map(|receipt| receipt.outcome.as_ref().expect("valid brushes").painted.of(GOLD))
            .sum();
        assert!(painted > 100, "{painted}");
        assert!(terrain.world().check_seams().is_flawless());
    }

    #[test]
    fn veins_can_not_be_undone() {
        let ground = Ground::from_fn(256, 256, |_, _| 60.0).expect("a world");
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        let mut app = App::new();
        app.add_plugins((MinimalPlugins, BurrowPlugins))
            .add_systems(Update, seal.after(BurrowSystems::Commit));
        app.finish();
        app.cleanup();
        let terrain = app.world_mut().spawn(terrain).id();
        let all = veins(Vec2::splat(128.0), |_| Some(60.0));
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
    }
}
