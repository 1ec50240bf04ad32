//! Undo and redo: back and forth by whole transactions, exact to the bit, within a budget of bytes.

mod worlds;

use std::collections::{BTreeMap, HashMap};

use allocation_counter::measure;
use bevy_burrow::lattice::{Column, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{Drawn, HistoryRejection, HistoryStep, World};
use bevy_burrow::volume::{Field, SampleView, Tally};
use fastrand::Rng;
use glam::{IVec3, Vec3};
use worlds::{random_brush, random_brush_at_a_face, random_ground, world_count};

/// Everything that a world is, but for what counts its commits.
#[derive(Debug, PartialEq)]
struct State {
    hash: u64,
    /// Every edited sample with its density and material, by brick.
    bricks: BTreeMap<[i32; 3], Vec<(IVec3, i32, MaterialId)>>,
    fields: BTreeMap<[i32; 3], Vec<Field>>,
    mask: Vec<Column>,
    meshes: Vec<(Drawn, SurfaceMesh)>,
    /// Bytes of what meshes and rings were assembled from.
    parts: usize,
}

impl State {
    fn of(world: &World) -> Self {
        let mut mask: Vec<Column> = world.mask().iter().collect();
        mask.sort_unstable_by_key(|cell| (cell.x, cell.z));
        Self {
            hash: world.hash(),
            bricks: world
                .bricks()
                .map(|(pos, brick)| (pos.0.to_array(), brick.edited_samples(pos).collect()))
                .collect(),
            fields: world
                .fields()
                .map(|(chunk, fields)| (chunk.as_ivec3().to_array(), fields.iter().copied().collect()))
                .collect(),
            mask,
            meshes: world.drawn().collect(),
            parts: world.memory().parts,
        }
    }

    /// Says where two differ, in less than all of their bytes.
    fn check(&self, world: &World, what: &str) {
        let now = Self::of(world);
        assert_eq!(self.hash, now.hash, "{what}: hash");
        assert!(self.bricks == now.bricks, "{what}: samples or materials");
        assert!(self.mask == now.mask, "{what}: mask");
        assert_eq!(self.fields, now.fields, "{what}: fields");
        for (before, after) in self.meshes.iter().zip(&now.meshes) {
            assert!(before == after, "{what}: mesh of {:?} or {:?}", before.0, after.0);
        }
        assert_eq!(self.meshes.len(), now.meshes.len(), "{what}: what is drawn");
        assert_eq!(self.parts, now.parts, "{what}: parts and rings");
    }
}

/// What somebody sees who swaps only the meshes that commits name.
struct Screen(HashMap<Drawn, SurfaceMesh>);

impl Screen {
    fn of(world: &World) -> Self {
        Self(world.drawn().collect())
    }

    /// Runs and commits everything that waits.
    fn play(&mut self, terrain: &mut Terrain) -> usize {
        let mut swapped = 0;
        while let Some(transaction) = terrain.begin() {
            let commit = transaction.run();
            for (tile, update) in &commit.meshes.tiles {
                self.0.insert(Drawn::Tile(*tile), update.mesh());
                swapped += 1;
            }
            for (chunk, surface) in &commit.meshes.chunks {
                self.0.insert(Drawn::Chunk(*chunk), surface.mesh().clone());
                swapped += 1;
            }
            terrain.commit(commit).expect("nobody else commits");
        }
        swapped
    }

    fn check(&self, world: &World, what: &str) {
        let drawn: HashMap<Drawn, SurfaceMesh> = world.drawn().collect();
        for (drawn, mesh) in self.0.iter().filter(|(_, mesh)| !mesh.is_empty()) {
            assert!(world.drawn_mesh_is(*drawn, mesh), "{what}: {drawn:?} shows something else");
        }
        let shown = |(drawn, mesh): &(&Drawn, &SurfaceMesh)| mesh.is_empty() || self.0.contains_key(drawn);
        assert!(drawn.iter().all(|pair| shown(&pair)), "{what}: something is not shown");
    }
}

/// The mesh of what is drawn, and is it this one?
trait MeshOf {
    fn drawn_mesh_is(&self, drawn: Drawn, mesh: &SurfaceMesh) -> bool;
}

impl MeshOf for World {
    fn drawn_mesh_is(&self, drawn: Drawn, mesh: &SurfaceMesh) -> bool {
        match drawn {
            Drawn::Tile(tile) => self.tile_mesh(tile) == *mesh,
            Drawn::Chunk(chunk) => self.chunk_mesh(chunk) == *mesh,
        }
    }
}

/// Any of the brushes that tests have, at the rim and at chunk faces as often as elsewhere.
fn any_brush(rng: &mut Rng, ground: &Ground, chunk_size: u32) -> Brush {
    match rng.u32(0..3) {
        0 => random_brush_at_a_face(rng, ground, chunk_size),
        _ => random_brush(rng, ground),
    }
}

fn terrain(ground: Ground, chunk_size: u32) -> Terrain {
    Terrain::new(ground, &TerrainSettings { chunk_size, ..Default::default() }).expect("valid settings")
}

#[test]
fn five_hundred_edits_are_undone_and_redone_to_the_bit() {
    let mut rng = Rng::with_seed(500);
    for (index, chunk_size) in [(3, 8), (1, 128)] {
        let (ground, _) = random_ground(&mut rng, index);
        let mut terrain = terrain(ground, chunk_size);
        let first = State::of(terrain.world());
        let mut screen = Screen::of(terrain.world());
        let mut steps = 0;
        for _ in 0..500 {
            let brush = any_brush(&mut rng, terrain.snapshot().ground(), chunk_size);
            let before = terrain.world().hash();
            let undos = terrain.history().undos;
            terrain.submit(&brush);
            screen.play(&mut terrain);
            steps += terrain.history().undos - undos;
            assert!(terrain.history().undos > undos || terrain.world().hash() == before);
        }
        let last = State::of(terrain.world());
        assert!(steps > 300 && terrain.history().undos == steps, "the budget holds all of {steps}");
        (0..steps).for_each(|_| terrain.submit_undo());
        screen.play(&mut terrain);
        assert!(terrain.take_history_receipts().iter().all(|receipt| receipt.outcome.is_ok()));
        first.check(terrain.world(), "all undone");
        screen.check(terrain.world(), "all undone");
        assert!(terrain.world().bricks().next().is_none() && terrain.world().mask().is_empty());
        (0..steps).for_each(|_| terrain.submit_redo());
        screen.play(&mut terrain);
        assert_eq!(terrain.take_history_receipts().len(), steps);
        last.check(terrain.world(), "all redone");
        screen.check(terrain.world(), "all redone");
        assert!(terrain.world().check_seams().is_flawless());
    }
}

#[test]
fn walks_through_history_meet_the_states_that_were() {
    let mut moved = 0;
    for index in 0..world_count(60) {
        let mut rng = Rng::with_seed(4100 + index);
        let (ground, usual) = random_ground(&mut rng, index);
        let chunk_size = if index % 2 == 0 { usual } else { rng.u32(8..=128) };
        let mut terrain = terrain(ground, chunk_size);
        let mut screen = Screen::of(terrain.world());
        // What was before each transaction, and what was undone.
        let (mut past, mut future): (Vec<State>, Vec<State>) = Default::default();
        for turn in 0..rng.usize(6..24) {
            let what = format!("world {index}, chunks of {chunk_size}, turn {turn}");
            let now = State::of(terrain.world());
            match rng.u32(0..5) {
                0 | 1 if !past.is_empty() => {
                    terrain.submit_undo();
                    screen.play(&mut terrain);
                    future.push(now);
                    let expected = past.pop().expect("there is a past");
                    expected.check(terrain.world(), &what);
                    moved += 1;
                }
                2 if !future.is_empty() => {
                    terrain.submit_redo();
                    screen.play(&mut terrain);
                    past.push(now);
                    let expected = future.pop().expect("there is a future");
                    expected.check(terrain.world(), &what);
                    moved += 1;
                }
                _ => {
                    let ground = terrain.snapshot();
                    for _ in 0..rng.usize(1..4) {
                        terrain.submit(&any_brush(&mut rng, ground.ground(), chunk_size));
                    }
                    let undos = terrain.history().undos;
                    screen.play(&mut terrain);
                    if terrain.history().undos > undos {
                        past.push(now);
                        future.clear();
                    }
                }
            }
            screen.check(terrain.world(), &what);
            let history = terrain.history();
            assert_eq!((history.undos, history.redos), (past.len(), future.len()), "{what}");
        }
        assert!(terrain.world().check_seams().is_flawless(), "world {index}");
    }
    assert!(moved > 100, "{moved} steps are not many");
}

#[test]
fn receipts_of_steps_count_what_changed() {
    for index in 0..world_count(40) {
        let mut rng = Rng::with_seed(4300 + index);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let mut terrain = terrain(ground, chunk_size);
        for _ in 0..6 {
            let ground = terrain.snapshot();
            terrain.apply([any_brush(&mut rng, ground.ground(), chunk_size)]);
        }
        let around: Vec<LatticeBox> = terrain.world().bricks().map(|(pos, _)| pos.samples()).collect();
        while terrain.history().undos > 0 {
            let before = terrain.snapshot();
            let restored = terrain.undo().outcome.expect("there is a step");
            let now = terrain.world();
            let (mut removed, mut added, mut painted, mut bounds) = (0, 0, 0, None);
            for point in around.iter().flat_map(|brick| brick.points()) {
                let (old, new) = (before.samples(), now.samples());
                let (was, is) = (old.is_solid(point), new.is_solid(point));
                removed += u64::from(was && !is);
                added += u64::from(is && !was);
                painted += u64::from(was && is && old.material(point) != new.material(point));
                let of = |view: SampleView| {
                    (view.is_edited(point), view.distance(point), view.stored_material(point))
                };
                if of(old) != of(new) {
                    LatticeBox::include(&mut bounds, LatticeBox::point(point));
                }
            }
            assert_eq!(restored.bounds, bounds, "world {index}");
            let totals = [&restored.removed, &restored.added, &restored.painted].map(Tally::total);
            assert_eq!(totals, [removed, added, painted], "world {index}");
        }
    }
}

#[test]
fn history_takes_the_bytes_it_says_and_stays_within_its_budget() {
    let mut full = 0;
    for index in 0..world_count(40) {
        let mut rng = Rng::with_seed(4200 + index);
        let (ground, chunk_size) = random_ground(&mut rng, index);
        let mut terrain = terrain(ground, chunk_size);
        let budget = [0, 100, 5_000, 60_000, 400_000, 64 << 20][rng.usize(0..6)];
        terrain.set_undo_budget(budget);
        let ground = terrain.snapshot();
        let mut most = 0;
        for _ in 0..40 {
            match rng.u32(0..6) {
                0 => terrain.submit_undo(),
                1 => terrain.submit_redo(),
                _ => terrain.submit(&any_brush(&mut rng, ground.ground(), chunk_size)),
            }
            while let Some(transaction) = terrain.begin() {
                let commit = transaction.run();
                terrain.commit(commit).expect("nobody else commits");
                let history = terrain.history();
                assert!(history.bytes <= budget, "world {index}: {history:?} with a budget of {budget}");
                most = most.max(history.undos);
            }
        }
        assert!(budget > 0 || most == 0);
        full += u64::from(budget > 0 && terrain.history().undos < most);
        let history = terrain.history();
        assert_eq!(terrain.memory().undo, history.bytes);
        // The world is let go of by whoever looked at it, so what history frees nobody else holds.
        drop(ground);
        let freed = measure(|| terrain.set_undo_budget(0));
        assert_eq!(-freed.bytes_current, history.bytes as i64, "world {index}: {history:?}");
        assert_eq!(terrain.history(), Default::default());
        assert!(terrain.undo().outcome == Err(HistoryRejection::NothingToUndo));
    }
    assert!(full > 3, "old steps fell off in {full} worlds only");
}

fn ball(x: f32, y: f32, z: f32, radius: f32) -> Brush {
    Brush::dig(Shape::sphere(Vec3::new(x, y, z), radius))
}

fn level() -> Terrain {
    terrain(Ground::flat(64, 64, 10.0).expect("flat ground"), 32)
}

#[test]
fn steps_keep_their_place_among_brushes() {
    let mut terrain = level();
    let pristine = terrain.world().hash();
    terrain.submit_undo();
    terrain.submit(&ball(10.0, 10.0, 10.0, 3.0).with_tag(1));
    terrain.submit(&ball(12.0, 10.0, 10.0, 3.0).with_tag(2));
    terrain.submit_undo();
    terrain.submit(&ball(40.0, 10.0, 40.0, 3.0).with_tag(3));
    terrain.submit_redo();
    terrain.submit_undo();
    terrain.submit_undo();
    terrain.submit_redo();
    let sent =
        [HistoryStep::Undo, HistoryStep::Undo, HistoryStep::Redo, HistoryStep::Undo, HistoryStep::Undo];
    assert_eq!(terrain.queued(), 9);
    let own = terrain.apply([ball(40.0, 10.0, 10.0, 3.0).with_tag(4)]);
    assert_eq!(own.iter().map(|receipt| receipt.tag).collect::<Vec<_>>(), [4]);
    assert_eq!(terrain.take_answered().iter().map(|receipt| receipt.tag).collect::<Vec<_>>(), [1, 2, 3]);
    let moves = terrain.take_history_receipts();
    let is_done: Vec<bool> = moves.iter().map(|receipt| receipt.outcome.is_ok()).collect();
    // Nothing yet; both balls; not after the third; the third; nothing; the third again.
    assert_eq!(is_done, [false, true, false, true, false, true]);
    assert_eq!(moves.iter().map(|receipt| receipt.step).take(5).collect::<Vec<_>>(), sent);
    assert_eq!(terrain.history().undos, 2);
    terrain.undo();
    assert_ne!(terrain.world().hash(), pristine);
    terrain.undo();
    assert_eq!(terrain.world().hash(), pristine);
}

#[test]
fn edits_that_change_nothing_are_no_steps_and_leave_what_can_be_redone() {
    let mut terrain = level();
    terrain.apply([ball(10.0, 10.0, 10.0, 3.0)]);
    assert!(terrain.undo().outcome.is_ok());
    terrain.apply([ball(10.0, 40.0, 10.0, 3.0), ball(-90.0, 10.0, 10.0, 3.0)]);
    assert_eq!((terrain.history().undos, terrain.history().redos), (0, 1));
    terrain.apply([ball(50.0, 10.0, 10.0, 3.0)]);
    assert_eq!((terrain.history().undos, terrain.history().redos), (1, 0));
    assert_eq!(terrain.redo().outcome, Err(HistoryRejection::NothingToRedo));
}

#[test]
fn a_step_that_is_given_up_is_not_lost() {
    let mut terrain = level();
    let pristine = terrain.world().hash();
    terrain.apply([ball(10.0, 10.0, 10.0, 3.0)]);
    terrain.submit_undo();
    let lost = terrain.begin().expect("a step waits").run();
    assert!(!terrain.is_ready(LatticeBox::point(IVec3::new(10, 10, 10))));
    assert!(terrain.is_ready(LatticeBox::point(IVec3::new(50, 10, 50))));
    terrain.abandon();
    assert!(terrain.commit(lost).is_err());
    assert!(!terrain.is_ready(LatticeBox::point(IVec3::new(10, 10, 10))));
    let again = terrain.begin().expect("it waits again").run();
    // Meanwhile its budget goes; the step is done all the same.
    terrain.set_undo_budget(0);
    terrain.commit(again).expect("it is waited for");
    assert_eq!(terrain.world().hash(), pristine);
    assert!(terrain.take_history_receipts().iter().all(|receipt| receipt.outcome.is_ok()));
    assert_eq!(terrain.history(), Default::default());
}

#[test]
fn fields_come_back_under_their_names_and_new_ones_get_new_names() {
    let mut terrain = level();
    let field = |terrain: &mut Terrain, brush: Brush| {
        terrain.apply([brush])[0].outcome.as_ref().expect("it reaches the world").chunks[0].field
    };
    let a = field(&mut terrain, ball(8.0, 10.0, 8.0, 2.0));
    let b = field(&mut terrain, ball(20.0, 10.0, 8.0, 2.0));
    let trench = Shape::capsule(Vec3::new(8.0, 10.0, 8.0), Vec3::new(20.0, 10.0, 8.0), 2.0);
    assert_eq!(field(&mut terrain, Brush::dig(trench)), a, "they merged");
    terrain.submit_undo();
    let commit = terrain.begin().expect("a step waits").run();
    let news = commit.field_news().to_vec();
    terrain.commit(commit).expect("nobody else commits");
    use bevy_burrow::terrain::FieldNews;
    assert_eq!(
        news.iter().map(|news| news.1).collect::<Vec<_>>(),
        [FieldNews::Changed(a), FieldNews::Created(b)]
    );
    terrain.submit_redo();
    let commit = terrain.begin().expect("a step waits").run();
    let news: Vec<_> = commit.field_news().iter().map(|news| news.1).collect();
    assert_eq!(news, [FieldNews::Changed(a), FieldNews::Merged { gone: b, into: a }]);
    terrain.commit(commit).expect("nobody else commits");
    (0..3).for_each(|_| assert!(terrain.undo().outcome.is_ok()));
    let c = field(&mut terrain, ball(8.0, 10.0, 8.0, 2.0));
    assert!(c > b, "{c:?} was the name of another field");
}
