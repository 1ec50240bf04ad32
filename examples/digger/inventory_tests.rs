//! Facts about what was dug and what is left of it.

use super::*;
use crate::landscape::{CLAY, GRASS, ROCK};

fn terrain() -> Terrain {
    let grass_on_rock = ColumnMaterial { base: ROCK, overlay: GRASS, blend: 255 };
    let ground = Ground::from_fn(64, 64, |x, z| 20.0 + f64::from(x + z) * 0.1)
        .and_then(|ground| ground.with_materials(&MaterialControl::Uniform(grass_on_rock)))
        .expect("a small world");
    Terrain::new(ground, &TerrainSettings::default()).expect("default settings")
}

#[test]
fn the_stock_is_what_came_less_what_went() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let mut chance = fastrand::Rng::with_seed(3);
    let concrete = inventory.stock(CONCRETE);
    let mut sums = [0i64; MATERIALS.len()];
    for i in 0..60 {
        let mut at = |low: f32, high: f32| low + (high - low) * chance.f32();
        let ball = Shape::sphere(Vec3::new(at(8.0, 56.0), at(14.0, 32.0), at(8.0, 56.0)), at(1.0, 5.0));
        let brush = match i % 3 {
            0 => Brush::dig(ball),
            1 => Brush::add(ball, CLAY),
            _ => Brush::paint(ball, CLAY),
        };
        let receipts = terrain.apply(&[brush.with_tag(inventory.tag())]);
        for receipt in receipts {
            let applied = receipt.outcome.as_ref().expect("a valid brush");
            for (material, voxels) in applied.removed.iter() {
                sums[usize::from(material.0)] += voxels as i64;
            }
            for (material, voxels) in applied.added.iter() {
                sums[usize::from(material.0)] -= voxels as i64;
            }
            let changes = inventory.enter(&receipt);
            assert!(i % 3 != 2 || changes.is_empty(), "paint costs nothing: {changes:?}");
        }
    }
    for (material, name) in MATERIALS {
        let begin = if material == CONCRETE { concrete } else { 0 };
        assert_eq!(inventory.stock(material), begin + sums[usize::from(material.0)], "{name}");
    }
    assert!(inventory.stock(ROCK) > 0 && inventory.stock(GRASS) > 0);
}

#[test]
fn brushes_of_scripts_cost_nothing() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let brush = Brush::dig(Shape::sphere(Vec3::new(30.0, 24.0, 30.0), 4.0)).with_tag(9);
    for receipt in terrain.apply(&[brush]) {
        assert!(receipt.outcome.as_ref().is_ok_and(|applied| applied.removed.total() > 0));
        assert_eq!(inventory.enter(&receipt), []);
    }
    assert_eq!(inventory.stock(ROCK), 0);
}

#[test]
fn what_is_pledged_is_not_spent_twice() {
    let mut inventory = Inventory::default();
    inventory.gain(ROCK, 100);
    let (first, second) = (inventory.tag(), inventory.tag());
    inventory.pledge(first, ROCK, 70);
    inventory.pledge(second, ROCK, 20);
    assert_eq!((inventory.stock(ROCK), inventory.free(ROCK)), (100, 10));
    // A brush that was rejected took nothing.
    let rejected = Receipt { tag: first, outcome: Err(Rejection::TerrainGone) };
    assert_eq!(inventory.enter(&rejected), []);
    assert_eq!((inventory.stock(ROCK), inventory.free(ROCK)), (100, 80));
    let nothing = Receipt { tag: second, outcome: Ok(Applied::default()) };
    inventory.enter(&nothing);
    assert_eq!(inventory.free(ROCK), 100);
}
