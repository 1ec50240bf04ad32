//! Matter is conserved: ground, debris and inventories together have as many voxels at every step, whatever is dug, undone and
//! redone, wherever debris has rolled.

use std::collections::BTreeMap;

use bevy::prelude::*;
use bevy_burrow::physics::{Debris, DebrisSettings, TerrainDebris};
use bevy_burrow::prelude::*;
use bevy_burrow::terrain::World as TerrainWorld;
use fastrand::Rng;

use crate::stage::{STEP, Stage, level};

/// How many steps: `BURROW_STEPS`, and from which seed: `BURROW_SEED`.
pub fn number(name: &str, default: u64) -> u64 {
    std::env::var(name).ok().and_then(|number| number.parse().ok()).unwrap_or(default)
}

/// How many more solid voxels a world has than its pristine ground.
pub fn built(world: &TerrainWorld) -> i64 {
    let (samples, bounds) = (world.samples(), world.grid().edit_bounds());
    let more = world.bricks().flat_map(|(pos, _)| pos.samples().intersection(bounds)).flat_map(|own| {
        own.points().map(|point| {
            let column = bevy_burrow::lattice::Column::of(point);
            let was_solid = point.y * 256 < world.ground().height(column);
            i64::from(samples.is_solid(point)) - i64::from(was_solid)
        })
    });
    more.sum()
}

/// What a game owns of the ground: its inventory, and crumbs that vanished.
#[derive(Resource, Default)]
pub struct Owned {
    pub inventory: i64,
    pub crumbs: i64,
}

fn voxels<'a>(pieces: impl IntoIterator<Item = &'a LoosePiece>, fate: PieceFate) -> i64 {
    let own = pieces.into_iter().filter(|piece| piece.fate == fate);
    own.map(|piece| piece.voxels as i64).sum()
}

/// Follows receipts, as a game's inventory does.
pub fn follow(
    mut applied: MessageReader<BrushApplied>,
    mut moved: MessageReader<HistoryMoved>,
    mut owned: ResMut<Owned>,
) {
    for BrushApplied { receipt, .. } in applied.read() {
        let Ok(applied) = &receipt.outcome else { continue };
        owned.inventory += applied.removed.total() as i64 - applied.added.total() as i64;
        owned.crumbs += voxels(&applied.loose, PieceFate::Removed);
    }
    for HistoryMoved { receipt, .. } in moved.read() {
        let Ok(restored) = &receipt.outcome else { continue };
        let returned = |fate: PieceFate| -> i64 {
            let own = restored.returned.iter().filter(|piece| piece.fate == fate);
            own.map(|piece| piece.materials.total() as i64).sum()
        };
        let cut = |fate| voxels(restored.cut_again.iter().map(|(_, piece)| piece), fate);
        let [crumbs, debris] =
            [PieceFate::Removed, PieceFate::BrokeOff].map(|fate| cut(fate) - returned(fate));
        owned.inventory += restored.removed.total() as i64 - restored.added.total() as i64 - crumbs - debris;
        owned.crumbs += crumbs;
    }
}

/// Voxels of all debris; `None` while some is not a body yet.
pub fn debris(app: &mut App) -> Option<i64> {
    let world = app.world_mut();
    let listed: usize = world.query::<&TerrainDebris>().iter(world).map(|all| all.len()).sum();
    let voxels: Vec<i64> = world.query::<&Debris>().iter(world).map(|debris| debris.voxels as i64).collect();
    (voxels.len() == listed).then(|| voxels.into_iter().sum())
}

/// Something that is built, or cut off again: walls, tables and beams, and digs through them.
pub fn random_brush(rng: &mut Rng) -> Brush {
    let part = |rng: &mut Rng, low: f32, high: f32| low + rng.f32() * (high - low);
    let at = |rng: &mut Rng, low: f32, high: f32| {
        Vec3::new(part(rng, 8.0, 40.0), part(rng, low, high), part(rng, 8.0, 40.0))
    };
    let material = MaterialId(rng.u8(1..5));
    match rng.u8(0..8) {
        0 => Brush::add(Shape::cuboid(at(rng, 14.0, 18.0), Vec3::new(1.2, 10.0, 1.2)), material),
        1 => {
            let half = Vec3::new(part(rng, 2.0, 7.0), 1.2, part(rng, 2.0, 7.0));
            Brush::add(Shape::cuboid(at(rng, 18.0, 26.0), half), material)
        }
        2 => Brush::add(Shape::sphere(at(rng, 12.0, 24.0), part(rng, 1.5, 4.0)), material),
        3 | 4 => {
            let half = Vec3::new(part(rng, 4.0, 30.0), 1.2, part(rng, 4.0, 30.0));
            Brush::dig(Shape::cuboid(at(rng, 10.0, 22.0), half))
        }
        5 => {
            let rough = Roughness::new(2.0, 2.0, rng.u32(..));
            Brush::dig(Shape::sphere(at(rng, 8.0, 20.0), part(rng, 3.0, 7.0))).with_roughness(rough)
        }
        _ => Brush::dig(Shape::sphere(at(rng, 4.0, 22.0), part(rng, 2.0, 5.0))),
    }
}

#[test]
fn ground_debris_and_inventories_are_constant() {
    let mut rng = Rng::with_seed(number("BURROW_SEED", 1));
    let (mut stage, terrain) = Stage::with_ground(level(48, 1.0));
    stage.app.init_resource::<Owned>().add_systems(Last, follow).insert_resource(DebrisSettings {
        most: 100_000,
        stay: 1e9,
        ..default()
    });
    stage.app.world_mut().entity_mut(terrain).insert(LooseSettings {
        largest: 6000,
        crumbs: 6,
        debris: 4000,
    });
    stage.frame();
    let (mut fallen, mut returned, mut most) = (0, 0, 0);
    for step in 0..number("BURROW_STEPS", 150) {
        // Sometimes several in one frame.
        for _ in 0..rng.usize(1..3) {
            match rng.u8(0..10) {
                0..=5 => stage.send(random_brush(&mut rng).with_tag(step)),
                6..=7 => drop(stage.app.world_mut().write_message(Undo::default())),
                8 => drop(stage.app.world_mut().write_message(Redo::default())),
                _ => stage.frames(rng.usize(0..40)),
            }
        }
        stage.frame();
        stage.settle();
        let mut now = None;
        stage.frames_until("all debris are bodies", |stage| {
            now = debris(&mut stage.app);
            now.is_some()
        });
        let now = now.unwrap_or_default();
        let owned = stage.app.world().resource::<Owned>();
        let solid = built(stage.terrain(terrain).world());
        let sum = solid + now + owned.inventory + owned.crumbs;
        let Owned { inventory, crumbs } = owned;
        assert_eq!(sum, 0, "step {step}: {solid} solid, {now} debris, {inventory} owned, {crumbs} crumbs");
        (fallen, returned) = (fallen + usize::from(now > most), returned + usize::from(now < most));
        most = now;
        stage.frames(rng.usize(0..30));
    }
    assert!(fallen > 5 && returned > 5, "debris grew {fallen} times and shrank {returned} times");
}

/// A beam at the end of a pillar, and the saw that cuts it off; `number` tells beams apart.
fn beam(number: u64) -> [Brush; 2] {
    let z = 12.0 + 24.0 * number as f32;
    [
        Brush::add(Shape::cuboid(Vec3::new(12.0, 34.0, z), Vec3::new(2.2, 30.0, 2.2)), MaterialId(2)),
        Brush::add(Shape::cuboid(Vec3::new(26.0, 62.0, z), Vec3::new(14.2, 2.2, 2.2)), MaterialId(3)),
    ]
}

fn saw(number: u64) -> Brush {
    let z = 12.0 + 24.0 * number as f32;
    Brush::dig(Shape::cuboid(Vec3::new(19.0, 62.0, z), Vec3::new(1.2, 4.0, 4.0))).with_tag(number)
}

/// A stage with beams.
fn beams(count: u64) -> (Stage, Entity) {
    let mut terrain = level(64, 1.0);
    terrain.apply((0..count).flat_map(beam));
    let (mut stage, entity) = Stage::with_ground(terrain);
    stage.app.insert_resource(DebrisSettings { stay: 1e9, ..default() });
    let loose = LooseSettings { crumbs: 8, debris: 9000, ..default() };
    stage.app.world_mut().entity_mut(entity).insert(loose);
    stage.frame();
    (stage, entity)
}

/// Debris by the tag of its brush, and where it is.
fn lying(stage: &mut Stage) -> BTreeMap<u64, Vec3> {
    let world = stage.app.world_mut();
    let mut all = world.query::<(&Debris, &Transform)>();
    all.iter(world).map(|(debris, place)| (debris.tag, place.translation)).collect()
}

fn saw_off(stage: &mut Stage, number: u64) {
    let before = lying(stage).len();
    stage.dig([saw(number)]);
    stage.frames_until("the beam takes shape", |stage| lying(stage).len() > before);
    stage.frames((6.0 / STEP) as usize);
    assert!(lying(stage)[&number].y < 20.0, "it has fallen");
}

fn undo(stage: &mut Stage) {
    stage.app.world_mut().write_message(Undo::default()).expect("the plugin added the message");
    stage.frame();
    stage.settle();
    stage.frames(10);
}

#[test]
fn an_undo_takes_debris_from_where_it_has_fallen_and_no_other() {
    let (mut stage, terrain) = beams(2);
    let whole = stage.terrain(terrain).world().hash();
    saw_off(&mut stage, 0);
    let one = stage.terrain(terrain).world().hash();
    saw_off(&mut stage, 1);
    undo(&mut stage);
    assert_eq!(stage.terrain(terrain).world().hash(), one);
    assert_eq!(lying(&mut stage).into_keys().collect::<Vec<_>>(), [0]);
    undo(&mut stage);
    assert_eq!(stage.terrain(terrain).world().hash(), whole);
    assert_eq!(lying(&mut stage).len(), 0);
}

#[test]
fn debris_of_another_dig_stays_where_ground_comes_back() {
    let (mut stage, _) = beams(1);
    saw_off(&mut stage, 0);
    let at = lying(&mut stage)[&0];
    // A pit next to the beam, or around it: nothing is cut off there.
    stage.dig([Brush::dig(Shape::sphere(at.with_y(6.0), 4.0)).with_tag(9)]);
    stage.frames((1.0 / STEP) as usize);
    undo(&mut stage);
    assert_eq!(lying(&mut stage).into_keys().collect::<Vec<_>>(), [0], "its matter is not lost");
}

#[test]
fn a_redo_lets_the_same_piece_fall_again() {
    let (mut stage, terrain) = beams(1);
    saw_off(&mut stage, 0);
    let ids = |stage: &mut Stage| -> Vec<PieceId> {
        let world = stage.app.world_mut();
        world.query::<&Debris>().iter(world).map(|debris| debris.id).collect()
    };
    let (before, sawn) = (ids(&mut stage), stage.terrain(terrain).world().hash());
    undo(&mut stage);
    assert!(ids(&mut stage).is_empty());
    stage.app.world_mut().write_message(Redo::default()).expect("the plugin added the message");
    stage.frames_until("it falls again", |stage| !ids(stage).is_empty());
    assert_eq!((ids(&mut stage), stage.terrain(terrain).world().hash()), (before, sawn));
    undo(&mut stage);
    assert!(ids(&mut stage).is_empty());
}

#[test]
fn of_equal_pieces_the_last_one_returns_first() {
    let (mut stage, _) = beams(1);
    let dig = |stage: &mut Stage, tag: u64| {
        let count = lying(stage).len();
        stage.dig([saw(0).with_tag(tag)]);
        stage.frames_until("the beam takes shape", |stage| lying(stage).len() > count);
        stage.frames((6.0 / STEP) as usize);
    };
    dig(&mut stage, 0);
    // An equal beam again.
    stage.dig(beam(0));
    dig(&mut stage, 1);
    undo(&mut stage);
    assert_eq!(lying(&mut stage).into_keys().collect::<Vec<_>>(), [0], "the second one is ground again");
    // Once more; this time it crumbles before the undo.
    stage.app.world_mut().resource_mut::<DebrisSettings>().stay = 0.1;
    stage.dig([saw(0).with_tag(2)]);
    stage.frames_until("it takes shape", |stage| lying(stage).len() == 2);
    stage.frames_until("it crumbles", |stage| lying(stage).len() == 1);
    undo(&mut stage);
    assert_eq!(lying(&mut stage).into_keys().collect::<Vec<_>>(), [0], "that one had crumbled");
    // Back to before the second beam, and then before the first cut.
    undo(&mut stage);
    undo(&mut stage);
    assert!(lying(&mut stage).is_empty(), "the first one is ground again");
}
