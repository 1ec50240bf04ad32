//! Facts about what was dug and what is left of it.

use super::*;
use crate::world::landscape::{CLAY, GOLD, GRASS, ROCK};

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, InventoryPlugin))
        .init_resource::<Actions>()
        .init_resource::<Settings>()
        .add_message::<Undo>()
        .add_message::<Redo>()
        .add_message::<HistoryMoved>()
        .add_message::<BrushApplied>()
        .add_message::<Hint>();
    app
}

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
            inventory.enter(&receipt, true);
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
        receipts.iter().for_each(|receipt| drop(inventory.enter(receipt, true)));
    };
    apply(Brush::paint(hill, GOLD), &mut inventory);
    let left = inventory.stock(GOLD);
    assert!(left < 200, "{left}");
    apply(Brush::dig(hill), &mut inventory);
    assert!(inventory.stock(GOLD) > left && inventory.stock(GOLD) <= 200, "{}", inventory.stock(GOLD));
}

/// Enters a step as the game does.
fn enter_step(inventory: &mut Inventory, receipt: &HistoryReceipt) {
    if let Ok(restored) = &receipt.outcome {
        inventory.step(receipt.step, &restored.tags);
    }
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
        receipts.iter().for_each(|receipt| drop(inventory.enter(receipt, true)));
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
        enter_step(&mut inventory, &receipt);
        assert_eq!(inventory.stock, *stock);
    }
    assert!(terrain.undo().outcome.is_err(), "each brush was a step");
    for stock in &stocks[1..] {
        enter_step(&mut inventory, &terrain.redo());
        assert_eq!(inventory.stock, *stock);
    }
}

#[test]
fn a_stroke_is_undone_whole_and_of_the_hand_alone() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let before = inventory.stock;
    let dig = |x: f32, tag: u64| Brush::dig(Shape::sphere(Vec3::new(x, 24.0, 30.0), 3.0)).with_tag(tag);
    // One that changes nothing, two of the hand's, and one of a script's.
    let tags = [inventory.tag(), inventory.tag(), inventory.tag()];
    let brushes = [dig(90.0, tags[0]), dig(20.0, tags[1]), dig(40.0, tags[2]), dig(55.0, 9)];
    for brush in brushes {
        let receipts = terrain.apply([brush.with_stroke(1)]);
        receipts.iter().for_each(|receipt| drop(inventory.enter(receipt, true)));
    }
    let dug = inventory.stock;
    assert_ne!(dug, before);
    enter_step(&mut inventory, &terrain.undo());
    assert_eq!((inventory.stock, terrain.history().undos), (before, 0));
    enter_step(&mut inventory, &terrain.redo());
    assert_eq!(inventory.stock, dug);
}

#[test]
fn what_was_dug_and_spent_is_owed_once_the_dig_is_undone() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let brush = Brush::dig(Shape::sphere(Vec3::new(30.0, 24.0, 30.0), 3.0)).with_tag(inventory.tag());
    terrain.apply([brush]).iter().for_each(|receipt| drop(inventory.enter(receipt, true)));
    let dug = inventory.stock(ROCK);
    assert!(dug > 0);
    inventory.gain(ROCK, -dug);
    enter_step(&mut inventory, &terrain.undo());
    assert_eq!(inventory.stock(ROCK), -dug);
}

#[test]
fn what_was_dug_and_smoothed_over_again_and_again_makes_no_ground() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let ball = |y: f32, radius: f32| Shape::sphere(Vec3::new(30.0, y, 30.0), radius);
    // The walls of a pit are hollow everywhere: smoothed, they only grow.
    let (pit, floor) = (ball(24.0, 4.0), ball(20.0, 4.0));
    let apply = |brush: Brush, terrain: &mut Terrain, inventory: &mut Inventory| {
        let receipts = terrain.apply(&[brush.with_tag(inventory.tag())]);
        receipts.iter().for_each(|receipt| drop(inventory.enter(receipt, true)));
        receipts[0].outcome.clone().expect("a valid brush")
    };
    apply(Brush::dig(pit), &mut terrain, &mut inventory);
    // All of it is built elsewhere.
    inventory.stock = Change::default();
    let (mut change, mut owed) = (Change::default(), 0);
    let mut stocks = vec![inventory.stock];
    for _ in 0..5 {
        let smooth = || Brush::smooth(floor, 1.0).with_falloff(0.0);
        for brush in [smooth(), smooth(), smooth(), smooth(), Brush::dig(pit)] {
            let steps = terrain.history().undos;
            let applied = apply(brush, &mut terrain, &mut inventory);
            sums(&applied, &mut change);
            assert_eq!(inventory.stock, change);
            owed = inventory.stock.iter().copied().fold(owed, i64::min);
            if terrain.history().undos > steps {
                stocks.push(inventory.stock);
            }
        }
    }
    assert!(owed < 0, "nothing was filled");
    for stock in stocks.iter().rev().skip(1) {
        enter_step(&mut inventory, &terrain.undo());
        assert_eq!(inventory.stock, *stock);
    }
}

#[test]
fn what_is_owed_is_paid_off_first_and_where_building_is_free_nothing_is() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let build = |x: f32, terrain: &mut Terrain, inventory: &mut Inventory, owes: bool| {
        let brush = Brush::add(Shape::sphere(Vec3::new(x, 45.0, 30.0), 3.0), CLAY).with_tag(inventory.tag());
        terrain.apply(&[brush]).iter().for_each(|receipt| drop(inventory.enter(receipt, owes)));
    };
    inventory.gain(CLAY, 10);
    build(15.0, &mut terrain, &mut inventory, false);
    assert_eq!(inventory.stock(CLAY), 0);
    enter_step(&mut inventory, &terrain.undo());
    assert_eq!(inventory.stock(CLAY), 10);
    enter_step(&mut inventory, &terrain.redo());
    build(30.0, &mut terrain, &mut inventory, true);
    let owed = -inventory.stock(CLAY);
    assert!(owed > 50, "{owed}");
    // A present does not pay it off.
    build(45.0, &mut terrain, &mut inventory, false);
    assert_eq!(inventory.stock(CLAY), -owed);
    inventory.gain(CLAY, owed + 7);
    assert_eq!((inventory.stock(CLAY), inventory.free(CLAY)), (7, 7));
}

#[test]
fn who_begins_to_owe_is_told_once() {
    let mut app = app();
    let mut terrain = terrain();
    let told = [15.0, 30.0].map(|x| {
        let tag = app.world_mut().resource_mut::<Inventory>().tag();
        let brush = Brush::add(Shape::sphere(Vec3::new(x, 45.0, 30.0), 3.0), CLAY).with_tag(tag);
        for receipt in terrain.apply(&[brush]) {
            app.world_mut().write_message(BrushApplied { terrain: None, receipt });
        }
        app.update();
        let mut hints = app.world_mut().resource_mut::<Messages<Hint>>();
        hints.drain().map(|hint| hint.words().to_owned()).collect::<Vec<String>>()
    });
    assert!(matches!(&told[0][..], [one] if one.contains("clay owed")), "{told:?}");
    assert_eq!(told[1], Vec::<String>::new());
}

#[test]
fn brushes_of_scripts_cost_nothing() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let brush = Brush::dig(Shape::sphere(Vec3::new(30.0, 24.0, 30.0), 4.0)).with_tag(9);
    for receipt in terrain.apply(&[brush]) {
        assert!(receipt.outcome.as_ref().is_ok_and(|applied| applied.removed.total() > 0));
        assert_eq!(inventory.enter(&receipt, true), []);
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
    assert_eq!(inventory.enter(&rejected, true), []);
    assert_eq!((inventory.stock(ROCK), inventory.free(ROCK)), (100, 80));
    let nothing = Receipt { tag: second, outcome: Ok(Applied::default()) };
    inventory.enter(&nothing, true);
    assert_eq!(inventory.free(ROCK), 100);
}
