//! Facts about what was dug and what is left of it.

use super::*;
use crate::landscape::{CLAY, GOLD, GRASS, ROCK};

fn terrain() -> Terrain {
    let grass_on_rock = ColumnMaterial { base: ROCK, overlay: GRASS, blend: 255 };
    let ground = Ground::from_fn(64, 64, |x, z| 20.0 + f64::from(x + z) * 0.1)
        .and_then(|ground| ground.with_materials(&MaterialControl::Uniform(grass_on_rock)))
        .expect("a small world");
    Terrain::new(ground, &TerrainSettings::default()).expect("default settings")
}

fn sums(applied: &Applied, change: &mut [i64; MATERIALS.len()]) {
    for (material, voxels) in applied.removed.iter() {
        change[usize::from(material.0)] += voxels as i64;
    }
    for (material, voxels) in applied.added.iter().chain(applied.painted.iter()) {
        change[usize::from(material.0)] -= voxels as i64;
    }
}

#[test]
fn the_stock_is_what_came_less_what_went() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let mut chance = fastrand::Rng::with_seed(3);
    inventory.gain(CLAY, 50_000);
    let begin = inventory.stock;
    let mut change = [0i64; MATERIALS.len()];
    for i in 0..60 {
        let mut at = |low: f32, high: f32| low + (high - low) * chance.f32();
        let ball = Shape::sphere(Vec3::new(at(8.0, 56.0), at(14.0, 32.0), at(8.0, 56.0)), at(1.0, 5.0));
        let brush = match i % 3 {
            0 => Brush::dig(ball),
            1 => Brush::add(ball, CLAY),
            _ => Brush::paint(ball, CLAY),
        };
        for receipt in terrain.apply(&[brush.with_tag(inventory.tag())]) {
            sums(receipt.outcome.as_ref().expect("a valid brush"), &mut change);
            inventory.enter(&receipt);
        }
    }
    for (material, name) in MATERIALS {
        let at = usize::from(material.0);
        assert_eq!(inventory.stock(material), begin[at] + change[at], "{name}");
    }
    assert!(inventory.stock(ROCK) > 0 && inventory.stock(GRASS) > 0 && inventory.stock(CLAY) < 50_000);
}

#[test]
fn paint_is_used_up() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    inventory.gain(GOLD, 200);
    let hill = Shape::sphere(Vec3::new(30.0, 24.0, 30.0), 3.0);
    let mut apply = |brush: Brush, inventory: &mut Inventory| {
        let receipts = terrain.apply(&[brush.with_tag(inventory.tag())]);
        receipts.iter().for_each(|receipt| drop(inventory.enter(receipt)));
    };
    apply(Brush::paint(hill, GOLD), &mut inventory);
    let left = inventory.stock(GOLD);
    assert!(left < 200, "{left}");
    apply(Brush::dig(hill), &mut inventory);
    assert!(inventory.stock(GOLD) > left && inventory.stock(GOLD) <= 200, "{}", inventory.stock(GOLD));
}

#[test]
fn undo_takes_what_the_dig_gave_and_not_more() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    terrain.set_loose(Some(LooseSettings { crumbs: 6, debris: 3000, ..Default::default() }));
    inventory.gain(CLAY, 400);
    let mut stocks = vec![inventory.stock];
    let ball = |y: f32, radius: f32| Shape::sphere(Vec3::new(30.0, y, 30.0), radius);
    // A ball in the air; all but a chip of it falls off. Then a pit, smoothed.
    let brushes = [
        Brush::add(ball(45.0, 4.0), CLAY),
        Brush::dig(ball(49.0, 1.2)),
        Brush::dig(ball(24.0, 4.0)),
        Brush::smooth(ball(24.0, 6.0), 0.8),
        Brush::paint(ball(20.0, 6.0), CLAY),
    ];
    for (number, brush) in brushes.into_iter().enumerate() {
        let receipts = terrain.apply(&[brush.with_tag(inventory.tag())]);
        receipts.iter().for_each(|receipt| drop(inventory.enter(receipt)));
        inventory.close();
        stocks.push(inventory.stock);
        if number == 1 {
            let applied = receipts[0].outcome.as_ref().expect("a valid brush");
            assert!(applied.loose.iter().any(|piece| piece.fate == PieceFate::BrokeOff));
            assert_eq!(inventory.stock(CLAY), 400, "all of the ball came back");
        }
    }
    let all = stocks.len();
    for stock in stocks[..all - 1].iter().rev() {
        let receipt = terrain.undo();
        assert!(receipt.outcome.is_ok());
        inventory.step(receipt.step);
        assert_eq!(inventory.stock, *stock);
    }
    assert!(terrain.undo().outcome.is_err(), "the game and the ground count the same steps");
    for stock in &stocks[1..] {
        inventory.step(terrain.redo().step);
        assert_eq!(inventory.stock, *stock);
    }
}

#[test]
fn brushes_that_change_nothing_are_no_step_and_a_new_one_ends_redo() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let mut dig = |y: f32, inventory: &mut Inventory| {
        let brush = Brush::dig(Shape::sphere(Vec3::new(30.0, y, 30.0), 2.0)).with_tag(inventory.tag());
        terrain.apply(&[brush]).iter().for_each(|receipt| drop(inventory.enter(receipt)));
        inventory.close();
    };
    dig(24.0, &mut inventory);
    let dug = inventory.stock;
    dig(60.0, &mut inventory);
    inventory.step(HistoryStep::Undo);
    assert_eq!(inventory.stock, Inventory::default().stock);
    inventory.step(HistoryStep::Redo);
    assert_eq!(inventory.stock, dug);
    inventory.step(HistoryStep::Undo);
    dig(20.0, &mut inventory);
    assert_eq!(inventory.step(HistoryStep::Redo), []);
}

#[test]
fn no_stock_is_ever_below_nothing() {
    let mut inventory = Inventory::default();
    assert_eq!(inventory.gain(ROCK, -5), 0);
    assert_eq!((inventory.gain(ROCK, 3), inventory.gain(ROCK, -5), inventory.stock(ROCK)), (3, -3, 0));
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
