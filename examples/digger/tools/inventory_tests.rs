//! Tests of the inventory.

use super::*;
use crate::test_support::drain_hints;
use crate::world::landscape::{CLAY, GOLD, GRASS, ROCK};

/// A terrain of grass on rock, and an inventory that gets its receipts.
struct Game {
    terrain: Terrain,
    inventory: Inventory,
}

impl Game {
    fn new() -> Self {
        let grass_on_rock = ColumnMaterial { base: ROCK, overlay: GRASS, blend: 255 };
        let ground = Ground::from_fn(64, 64, |x, z| 20.0 + f64::from(x + z) * 0.1)
            .and_then(|ground| ground.with_materials(&MaterialControl::Uniform(grass_on_rock)))
            .expect("a small world");
        let terrain = Terrain::new(ground, &TerrainSettings::default()).expect("default settings");
        Self { terrain, inventory: Inventory::default() }
    }

    /// Applies one of the player's brushes.
    fn apply(&mut self, brush: Brush) -> Applied {
        self.apply_with_debt(brush, true)
    }

    fn apply_with_debt(&mut self, brush: Brush, allow_debt: bool) -> Applied {
        let receipts = self.terrain.apply([brush.with_tag(self.inventory.next_tag())]);
        self.inventory.apply_receipt(&receipts[0], allow_debt);
        receipts[0].outcome.clone().expect("a valid brush")
    }

    fn undo(&mut self) -> bool {
        let receipt = self.terrain.undo();
        self.apply_history(&receipt)
    }

    fn redo(&mut self) -> bool {
        let receipt = self.terrain.redo();
        self.apply_history(&receipt)
    }

    fn apply_history(&mut self, receipt: &Receipt) -> bool {
        let Ok(restored) = &receipt.outcome else { return false };
        self.inventory.apply_history(receipt.kind, &restored.tags);
        true
    }

    fn amount(&self, material: MaterialId) -> i64 {
        self.inventory.amount(material)
    }
}

fn sphere(x: f32, y: f32, radius: f32) -> Shape {
    Shape::sphere(Vec3::new(x, y, 30.0), radius)
}

fn add_change(applied: &Applied, sums: &mut Amounts) {
    for (material, voxels) in applied.removed.iter() {
        sums[usize::from(material.0)] += voxels as i64;
    }
    for (material, voxels) in applied.added.iter().chain(applied.painted.iter()) {
        sums[usize::from(material.0)] -= voxels as i64;
    }
}

#[test]
fn amounts_are_what_was_dug_less_what_was_used() {
    let mut game = Game::new();
    let mut random = fastrand::Rng::with_seed(3);
    game.inventory.gain(CLAY, 50_000);
    let mut expected = game.inventory.amounts;
    for i in 0..60 {
        let mut between = |low: f32, high: f32| low + (high - low) * random.f32();
        let middle = Vec3::new(between(8.0, 56.0), between(14.0, 32.0), between(8.0, 56.0));
        let ball = Shape::sphere(middle, between(1.0, 5.0));
        let applied = game.apply(match i % 3 {
            0 => Brush::dig(ball),
            1 => Brush::add(ball, CLAY),
            _ => Brush::paint(ball, CLAY),
        });
        add_change(&applied, &mut expected);
    }
    assert_eq!(game.inventory.amounts, expected);
    assert!(game.amount(ROCK) > 0 && game.amount(GRASS) > 0 && game.amount(CLAY) < 50_000);
}

#[test]
fn painting_uses_material_and_digging_returns_it() {
    let mut game = Game::new();
    game.inventory.gain(GOLD, 200);
    game.apply(Brush::paint(sphere(30.0, 24.0, 3.0), GOLD));
    let left = game.amount(GOLD);
    assert!(left < 200, "{left}");
    game.apply(Brush::dig(sphere(30.0, 24.0, 3.0)));
    assert!((left + 1..=200).contains(&game.amount(GOLD)), "{}", game.amount(GOLD));
}

#[test]
fn undo_and_redo_restore_the_amounts() {
    let mut game = Game::new();
    game.terrain.set_loose(Some(LooseSettings { crumbs: 6, debris: 3000, ..Default::default() }));
    game.inventory.gain(CLAY, 400);
    let mut amounts = vec![game.inventory.amounts];
    // A ball in the air, most of which breaks off. Then a pit, smoothed.
    for (number, brush) in [
        Brush::add(sphere(30.0, 45.0, 4.0), CLAY),
        Brush::dig(sphere(30.0, 49.0, 1.2)),
        Brush::dig(sphere(30.0, 24.0, 4.0)),
        Brush::smooth(sphere(30.0, 24.0, 6.0), 0.8),
        Brush::paint(sphere(30.0, 20.0, 6.0), CLAY),
    ]
    .into_iter()
    .enumerate()
    {
        let applied = game.apply(brush);
        amounts.push(game.inventory.amounts);
        if number == 1 {
            assert!(applied.loose.iter().any(|piece| piece.fate == PieceFate::BrokeOff));
            assert_eq!(game.amount(CLAY), 400, "all of the ball came back");
        }
    }
    for expected in amounts.iter().rev().skip(1) {
        assert!(game.undo());
        assert_eq!(game.inventory.amounts, *expected);
    }
    assert!(!game.undo(), "each brush was a step");
    for expected in &amounts[1..] {
        assert!(game.redo());
        assert_eq!(game.inventory.amounts, *expected);
    }
}

#[test]
fn undoing_a_stroke_restores_what_the_players_brushes_of_it_changed() {
    let mut game = Game::new();
    let before = game.inventory.amounts;
    let dig = |x: f32, tag: u64| Brush::dig(sphere(x, 24.0, 3.0)).with_tag(tag).with_stroke(1);
    // One that changes nothing, two of the player's, and one of a script's.
    let tags = [(); 3].map(|()| game.inventory.next_tag());
    for brush in [dig(90.0, tags[0]), dig(20.0, tags[1]), dig(40.0, tags[2]), dig(55.0, 9)] {
        for receipt in game.terrain.apply([brush]) {
            game.inventory.apply_receipt(&receipt, true);
        }
    }
    let after = game.inventory.amounts;
    assert_ne!(after, before);
    game.undo();
    assert_eq!((game.inventory.amounts, game.terrain.history().undos), (before, 0));
    game.redo();
    assert_eq!(game.inventory.amounts, after);
}

#[test]
fn undoing_a_dig_whose_material_was_used_leads_into_debt() {
    let mut game = Game::new();
    game.apply(Brush::dig(sphere(30.0, 24.0, 3.0)));
    let dug = game.amount(ROCK);
    assert!(dug > 0);
    game.inventory.gain(ROCK, -dug);
    game.undo();
    assert_eq!(game.amount(ROCK), -dug);
}

#[test]
fn digging_and_smoothing_in_turns_creates_no_material() {
    let mut game = Game::new();
    // The walls of a pit are concave: smoothing fills them.
    let (pit, floor) = (sphere(30.0, 24.0, 4.0), sphere(30.0, 20.0, 4.0));
    game.apply(Brush::dig(pit));
    // The player used everything elsewhere.
    game.inventory.amounts = Amounts::default();
    let (mut expected, mut lowest) = (Amounts::default(), 0);
    let mut amounts = vec![game.inventory.amounts];
    for _ in 0..5 {
        let smooth = || Brush::smooth(floor, 1.0).with_falloff(0.0);
        for brush in [smooth(), smooth(), smooth(), smooth(), Brush::dig(pit)] {
            let steps = game.terrain.history().undos;
            let applied = game.apply(brush);
            add_change(&applied, &mut expected);
            assert_eq!(game.inventory.amounts, expected);
            lowest = game.inventory.amounts.iter().copied().fold(lowest, i64::min);
            if game.terrain.history().undos > steps {
                amounts.push(game.inventory.amounts);
            }
        }
    }
    assert!(lowest < 0, "nothing was filled");
    for expected in amounts.iter().rev().skip(1) {
        game.undo();
        assert_eq!(game.inventory.amounts, *expected);
    }
}

#[test]
fn a_debt_is_paid_back_first_and_free_building_makes_none() {
    let mut game = Game::new();
    let build = |x: f32| Brush::add(sphere(x, 45.0, 3.0), CLAY);
    game.inventory.gain(CLAY, 10);
    game.apply_with_debt(build(15.0), false);
    assert_eq!(game.amount(CLAY), 0);
    game.undo();
    assert_eq!(game.amount(CLAY), 10);
    game.redo();
    game.apply(build(30.0));
    let debt = -game.amount(CLAY);
    assert!(debt > 50, "{debt}");
    // Free building does not change it.
    game.apply_with_debt(build(45.0), false);
    assert_eq!(game.amount(CLAY), -debt);
    game.inventory.gain(CLAY, debt + 7);
    assert_eq!((game.amount(CLAY), game.inventory.available(CLAY)), (7, 7));
}

#[test]
fn the_player_is_told_once_about_a_debt() {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, InventoryPlugin))
        .init_resource::<Actions>()
        .init_resource::<Settings>()
        .add_message::<Undo>()
        .add_message::<Redo>()
        .add_message::<HistoryMoved>()
        .add_message::<BrushApplied>()
        .add_message::<Hint>();
    let mut terrain = Game::new().terrain;
    let hints = [15.0, 30.0].map(|x| {
        let tag = app.world_mut().resource_mut::<Inventory>().next_tag();
        for receipt in terrain.apply([Brush::add(sphere(x, 45.0, 3.0), CLAY).with_tag(tag)]) {
            app.world_mut().write_message(BrushApplied { terrain: None, receipt });
        }
        app.update();
        drain_hints(&mut app)
    });
    assert!(
        matches!(&hints[0][..], [one] if one.starts_with("You owe") && one.contains("clay")),
        "{hints:?}"
    );
    assert!(hints[1].is_empty());
}

#[test]
fn brushes_of_scripts_are_free() {
    let mut game = Game::new();
    for receipt in game.terrain.apply([Brush::dig(sphere(30.0, 24.0, 4.0)).with_tag(9)]) {
        assert!(receipt.outcome.as_ref().is_ok_and(|applied| applied.removed.total() > 0));
        assert_eq!(game.inventory.apply_receipt(&receipt, true), []);
    }
    assert_eq!(game.amount(ROCK), 0);
}

#[test]
fn reserved_material_is_not_available() {
    let mut inventory = Inventory::default();
    inventory.gain(ROCK, 100);
    let (first, second) = (inventory.next_tag(), inventory.next_tag());
    inventory.reserve(first, ROCK, 70);
    inventory.reserve(second, ROCK, 20);
    assert_eq!((inventory.amount(ROCK), inventory.available(ROCK)), (100, 10));
    // A rejected brush used nothing.
    let rejected = Receipt::of_edit(first, Err(Rejection::TerrainGone));
    assert_eq!(inventory.apply_receipt(&rejected, true), []);
    assert_eq!((inventory.amount(ROCK), inventory.available(ROCK)), (100, 80));
    inventory.apply_receipt(&Receipt::of_edit(second, Ok(Applied::default())), true);
    assert_eq!(inventory.available(ROCK), 100);
}
