//! At the world's rim everything is as it is inland: beyond it is nobody's ground.

use bevy_burrow::prelude::*;
use glam::Vec3;

use crate::measured::assert_closed;

const SIDE: f32 = 64.0;

/// Level ground of 64 x 64 cells, after some brushes around a place at x on the surface of z = 32.
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

/// Places on the rim and inland; of the middle of a brush there.
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
fn nothing_comes_from_beyond_the_rim() {
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
