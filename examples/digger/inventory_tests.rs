//! Facts about what was dug and what is left of it.

use super::*;
use crate::landscape::{CLAY, GOLD, GRASS, ROCK};

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
        terrain.apply(&[brush]).iter().for_each(|receipt| drop(inventory.enter(receipt, true)));
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
fn what_was_dug_and_smoothed_over_again_and_again_makes_no_ground() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let ball = |y: f32, radius: f32| Shape::sphere(Vec3::new(30.0, y, 30.0), radius);
    // The walls of a pit are hollow everywhere: smoothed, they only grow.
    let (pit, floor) = (ball(24.0, 4.0), ball(20.0, 4.0));
    let mut apply = |brush: Brush, inventory: &mut Inventory| {
        let receipts = terrain.apply(&[brush.with_tag(inventory.tag())]);
        receipts.iter().for_each(|receipt| drop(inventory.enter(receipt, true)));
        inventory.close();
        receipts[0].outcome.clone().expect("a valid brush")
    };
    apply(Brush::dig(pit), &mut inventory);
    // All of it is built elsewhere.
    inventory.stock = Change::default();
    let (mut change, mut owed) = (Change::default(), 0);
    let mut stocks = vec![inventory.stock];
    for _ in 0..5 {
        let smooth = || Brush::smooth(floor, 1.0).with_falloff(0.0);
        for brush in [smooth(), smooth(), smooth(), smooth(), Brush::dig(pit)] {
            let steps = inventory.past.len();
            let applied = apply(brush, &mut inventory);
            sums(&applied, &mut change);
            assert_eq!(inventory.stock, change);
            owed = inventory.stock.iter().copied().fold(owed, i64::min);
            if inventory.past.len() > steps {
                stocks.push(inventory.stock);
            }
        }
    }
    assert!(owed < 0, "nothing was filled");
    for stock in stocks.iter().rev().skip(1) {
        inventory.step(terrain.undo().step);
        assert_eq!(inventory.stock, *stock);
    }
}

#[test]
fn what_is_owed_is_paid_off_first_and_where_building_is_free_nothing_is() {
    let (mut terrain, mut inventory) = (terrain(), Inventory::default());
    let mut build = |x: f32, inventory: &mut Inventory, owes: bool| {
        let brush = Brush::add(Shape::sphere(Vec3::new(x, 45.0, 30.0), 3.0), CLAY).with_tag(inventory.tag());
        terrain.apply(&[brush]).iter().for_each(|receipt| drop(inventory.enter(receipt, owes)));
        inventory.close();
    };
    inventory.gain(CLAY, 10);
    build(15.0, &mut inventory, false);
    assert_eq!(inventory.stock(CLAY), 0);
    inventory.step(HistoryStep::Undo);
    assert_eq!(inventory.stock(CLAY), 10);
    inventory.step(HistoryStep::Redo);
    build(30.0, &mut inventory, true);
    let owed = -inventory.stock(CLAY);
    assert!(owed > 50, "{owed}");
    // A present does not pay it off.
    build(45.0, &mut inventory, false);
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

/// What transactions made of a stock of rock, those that can be undone and those that can be done again.
fn after(past: &[i64], future: &[i64]) -> Inventory {
    let change = |by: &i64| {
        let mut change = Change::default();
        change[usize::from(ROCK.0)] = *by;
        change
    };
    let (past_sum, past) = (past.iter().sum(), past.iter().map(change).collect());
    let mut inventory = Inventory { past, future: future.iter().map(change).collect(), ..default() };
    inventory.gain(ROCK, past_sum);
    inventory
}

#[test]
fn what_steps_under_way_take_is_not_free_and_what_they_give_not_yet() {
    use HistoryStep::{Redo, Undo};
    let cases: [(&[i64], &[i64], &[HistoryStep], i64, i64); 11] = [
        // What was dug is taken back, once.
        (&[100], &[], &[Undo], 0, 0),
        (&[100], &[], &[Undo, Undo], 0, 0),
        (&[60, 40], &[], &[Undo], 60, 60),
        (&[60, 40], &[], &[Undo, Undo], 0, 0),
        // What was built comes back, and what was dug before it goes then.
        (&[100, -70], &[], &[Undo], 30, 100),
        (&[100, -70], &[], &[Undo, Undo], -70, 0),
        // The other way round.
        (&[100], &[-70], &[Redo], 30, 30),
        (&[100], &[50], &[Redo], 100, 150),
        (&[100], &[-20, 50], &[Redo, Redo], 80, 130),
        // There and back.
        (&[100], &[], &[Undo, Redo], 0, 100),
        (&[100], &[-70], &[Redo, Undo], -70, 100),
    ];
    for (past, future, steps, free, left) in cases {
        let mut inventory = after(past, future);
        steps.iter().for_each(|step| inventory.await_step(*step));
        assert_eq!(inventory.free(ROCK), free, "{past:?} {future:?} {steps:?}");
        for step in steps {
            inventory.end_step(*step);
            inventory.step(*step);
        }
        assert_eq!(
            (inventory.free(ROCK), inventory.stock(ROCK)),
            (left, left),
            "{past:?} {future:?} {steps:?}"
        );
    }
}

#[test]
fn a_brush_before_an_undo_is_what_it_takes_back() {
    let mut inventory = after(&[100], &[]);
    let tag = inventory.tag();
    inventory.pledge(tag, ROCK, 70);
    inventory.await_step(HistoryStep::Undo);
    // Nobody knows yet whether the brush will change anything.
    assert_eq!(inventory.free(ROCK), -70);
    // It does.
    inventory.pledges.clear();
    inventory.gain(ROCK, -70);
    inventory.past.push_back(after(&[-70], &[]).past[0]);
    assert_eq!(inventory.free(ROCK), 30);
    inventory.end_step(HistoryStep::Undo);
    inventory.step(HistoryStep::Undo);
    assert_eq!(inventory.free(ROCK), 100);
}

#[test]
fn a_step_is_awaited_until_it_is_answered() {
    let mut app = app();
    app.insert_resource(after(&[100], &[-70]));
    let free = |app: &mut App| {
        app.update();
        app.world().resource::<Inventory>().free(ROCK)
    };
    let answer = |app: &mut App, step, outcome| {
        let receipt = HistoryReceipt { step, outcome };
        app.world_mut().write_message(HistoryMoved { terrain: None, receipt });
    };
    // One that is refused takes nothing.
    app.world_mut().write_message(Redo::default());
    assert_eq!(free(&mut app), 30);
    assert_eq!(free(&mut app), 30);
    answer(&mut app, HistoryStep::Redo, Err(HistoryRejection::NothingToRedo));
    assert_eq!(free(&mut app), 100);
    app.world_mut().write_message(Undo::default());
    assert_eq!(free(&mut app), 0);
    answer(&mut app, HistoryStep::Undo, Ok(Restored::default()));
    assert_eq!(free(&mut app), 0);
    assert_eq!(app.world().resource::<Inventory>().stock(ROCK), 0);
    // Nobody waits for what was sent in another game.
    app.world_mut().write_message(Undo::default());
    app.update();
    app.world_mut().trigger(NewGame);
    answer(&mut app, HistoryStep::Undo, Err(HistoryRejection::TerrainGone));
    app.world_mut().resource_mut::<Inventory>().gain(ROCK, 50);
    assert_eq!(free(&mut app), 50);
}
