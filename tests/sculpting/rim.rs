//! At the world's rim everything behaves as it does inland.

use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::prelude::*;
use glam::{IVec3, Vec3};

use crate::measured::assert_closed;

const SIDE: f32 = 64.0;

/// Level ground of 64 x 64 cells, after brushes around a place at x on the surface of z = 32.
fn world(x: f32, brushes: impl Fn(f32) -> Vec<Brush>) -> Terrain {
    let ground = Ground::flat(SIDE as u32, SIDE as u32, 20.0).expect("valid");
    let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
    for brush in brushes(x) {
        let receipts = terrain.apply([brush]);
        assert!(receipts[0].outcome.is_ok(), "{receipts:?}");
    }
    assert_closed(&terrain);
    terrain
}

/// The x of brushes: at both rims and inland.
const PLACES: [f32; 3] = [0.0, SIDE, 32.0];

#[test]
fn level_ground_is_smooth_at_the_rim_too() {
    for height in [24.5, 15.5] {
        for x in PLACES {
            let terrain = world(x, |x| {
                let around = Shape::cuboid(Vec3::new(x, 20.0, 32.0), Vec3::splat(12.0));
                let smooth = Brush::smooth(Shape::sphere(Vec3::new(x, height, 32.0), 6.0), 1.0);
                let mut brushes = vec![Brush::level(around, height).with_falloff(0.0)];
                brushes.extend((0..10).map(|_| smooth.clone()));
                brushes
            });
            for offset in 0..4 {
                let at = if x > 40.0 { x - offset as f32 } else { x + offset as f32 };
                let found = terrain.world().height(at.into(), 32.0).expect("inside") as f32;
                assert!((found - height).abs() < 0.01, "{found} instead of {height} at {at}");
            }
        }
    }
}

#[test]
fn rules_do_not_apply_outside_the_world() {
    // Hard ground under a soft heap, and a protected box outside the world.
    let beyond = LatticeBox { min: IVec3::new(65, 0, 0), max: IVec3::new(90, 60, 64) };
    let rules = DiggingRules::default().with_hardness(MaterialId(0), 200).with_protected(beyond);
    let spans = |x: f32| {
        let ground = Ground::flat(SIDE as u32, SIDE as u32, 20.0).expect("valid");
        let mut terrain = Terrain::new(ground, &TerrainSettings::default()).expect("valid");
        terrain.set_rules(rules.clone()).expect("valid rules");
        let middle = Vec3::new(x, 26.0, 32.0);
        let heap = Brush::add(Shape::cuboid(middle, Vec3::splat(8.0)), MaterialId(5));
        terrain.apply([heap, Brush::dig(Shape::sphere(middle, 2.5)).with_power(10)]);
        assert_closed(&terrain);
        let spans = terrain.world().spans(x.into(), 32.0);
        // In hundredths of a voxel.
        spans.into_iter().map(|span| (span.floor * 100.0).round() as i32).collect::<Vec<_>>()
    };
    let inland = spans(32.0);
    assert_eq!(inland.len(), 2, "the dig left a hole in the heap");
    for x in PLACES {
        assert_eq!(spans(x), inland, "at {x}");
    }
}

#[test]
fn raise_and_lower_at_the_rim_use_no_samples_outside_the_world() {
    for x in PLACES {
        // In the middle of a pit's air, and of a tower.
        let air = world(x, |x| {
            let pit = Shape::cuboid(Vec3::new(x, 14.0, 32.0), Vec3::new(10.0, 8.0, 10.0));
            vec![Brush::dig(pit), Brush::raise(Shape::sphere(Vec3::new(x, 14.0, 32.0), 4.0), 2.0)]
        });
        let column = air.world().spans(x.into(), 32.0);
        assert!(column.iter().all(|span| span.floor < 7.0), "{column:?} at {x}");
        let tower = world(x, |x| {
            let tower = Shape::cuboid(Vec3::new(x, 41.0, 32.0), Vec3::new(10.0, 22.0, 10.0));
            let lower = Brush::lower(Shape::sphere(Vec3::new(x, 45.0, 32.0), 4.0), 2.0);
            vec![Brush::add(tower, MaterialId(2)), lower]
        });
        assert_eq!(tower.world().spans(x.into(), 32.0).len(), 1, "a hole in the tower at {x}");
    }
}
