//! Sequences of edits and changes of levels, commit by commit: after each commit, the drawn surface is closed, and
//! equals one that is made from scratch. `BURROW_WORLDS` is the number of sequences.

use std::collections::BTreeMap;
use std::sync::Arc;

use bevy_burrow::lattice::ChunkGrid;
use bevy_burrow::lod::{Cut, Node};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::{SeamChecker, SurfaceMesh};
use bevy_burrow::terrain::{ChooseCut, Commit, MeshKey, World};
use fastrand::Rng;

mod worlds;

/// What has a mesh of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    Part(MeshKey),
    Node(Node),
}

/// What is drawn, kept up to date by what commits say.
#[derive(Default)]
struct Display(BTreeMap<Key, SurfaceMesh>);

impl Display {
    fn set(&mut self, key: Key, mesh: SurfaceMesh) {
        if mesh.is_empty() {
            self.0.remove(&key);
        } else {
            self.0.insert(key, mesh);
        }
    }

    /// Shows a commit.
    fn show(&mut self, commit: &Commit) {
        let drawn_cut = commit.drawn_cut().expect("a cut is drawn");
        for (tile, update) in &commit.meshes.tiles {
            if drawn_cut.shows_parts(*tile) {
                self.set(Key::Part(MeshKey::Tile(*tile)), update.mesh());
            }
        }
        for (chunk, surface) in &commit.meshes.chunks {
            if drawn_cut.shows_parts(chunk.tile()) {
                self.set(Key::Part(MeshKey::Chunk(*chunk)), surface.mesh().clone());
            }
        }
        self.show_nodes(&commit.meshes.nodes);
    }

    fn show_nodes(&mut self, nodes: &[bevy_burrow::terrain::NodeUpdate]) {
        for update in nodes {
            update.hidden.iter().for_each(|&drawn| drop(self.0.remove(&Key::Part(drawn))));
            for (drawn, surface) in update.shown() {
                self.set(Key::Part(drawn), surface.into_owned());
            }
            let mesh = update.mesh.as_deref().cloned().unwrap_or_default();
            self.set(Key::Node(update.node), mesh);
        }
    }

    /// Everything that a cut draws of a world, made from scratch.
    fn from_scratch(world: &World, cut: &Cut) -> Self {
        let mut display = Self::default();
        for node in cut.nodes() {
            if !world.is_plain(cut, node) {
                display.set(Key::Node(node), world.node_mesh(cut, node));
                continue;
            }
            display.set(Key::Part(MeshKey::Tile(node.tile())), world.tile_mesh(node.tile()));
            for chunk in world.drawn_chunks().filter(|chunk| chunk.tile() == node.tile()) {
                display.set(Key::Part(MeshKey::Chunk(chunk)), world.chunk_mesh(chunk));
            }
        }
        display
    }

    fn assert_is(&self, expected: &Self, what: &str) {
        for key in self.0.keys().chain(expected.0.keys()) {
            let (found, expected) = (self.0.get(key), expected.0.get(key));
            assert!(found == expected, "{what}: {key:?}: {} {}", found.is_some(), expected.is_some());
        }
    }

    fn assert_is_closed(&self, world: &World, cut: &Cut, what: &str) {
        let mut checker = SeamChecker::default();
        for (key, mesh) in &self.0 {
            let origin = match key {
                Key::Part(drawn) => world.origin(*drawn),
                Key::Node(node) => cut.grid().columns(*node).0.at(0),
            };
            checker.add(mesh, origin);
        }
        let report = checker.check(world.grid());
        assert!(report.is_closed() && report.worst_normal_at.is_none(), "{what}: {report}");
    }
}

/// A number that looks random, by a node and a seed.
fn dice(node: Node, seed: u64) -> u64 {
    let words = [node.level.into(), node.x, node.z].map(|word: i32| u64::from(word.cast_unsigned()));
    words
        .into_iter()
        .fold(seed, |hash, word| (hash ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29))
}

/// A step towards a random cut.
fn random_step(rng: &mut Rng) -> Arc<ChooseCut> {
    let (seed, percent, most) = (rng.u64(..), rng.u64(20..90), rng.usize(1..40));
    Arc::new(move |_, cut| {
        let target = Cut::new(cut.grid(), |node| (dice(node, seed) >> 7) % 100 < percent);
        let mut next = cut.clone();
        next.step_to(&target, most, |node| dice(node, seed) % 64);
        next
    })
}

/// A brush that cuts into the surface or lies over or under it, often at a corner of chunks.
fn random_brush(rng: &mut Rng, ground: &Ground, grid: ChunkGrid) -> Brush {
    match rng.u32(0..3) {
        0 => worlds::random_brush_at_a_face(rng, ground, grid.size() as u32),
        1 => worlds::any_random_brush(rng, ground),
        _ => worlds::random_brush(rng, ground),
    }
}

#[test]
fn after_each_commit_what_is_drawn_is_closed_and_as_if_made_from_scratch() {
    let (mut joined, mut changes, mut edits) = (0, 0, 0);
    for index in 0..worlds::world_count(40) {
        let rng = &mut Rng::with_seed(index);
        let (ground, chunk_size) = worlds::random_ground(rng, index);
        let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
        let ground = Arc::new(ground);
        let mut terrain = Terrain::new(Arc::clone(&ground), &settings).expect("a valid size");
        // Of a restored one, no chunk has been meshed.
        let is_restored = index % 2 == 1;
        if is_restored {
            terrain.apply(
                (0..rng.usize(1..8))
                    .map(|_| random_brush(rng, &ground, terrain.world().grid()))
                    .collect::<Vec<_>>(),
            );
            terrain = Terrain::restore(Arc::clone(&ground), &settings, terrain.parts()).expect("its own");
        }
        let mut saved = vec![terrain.parts()];
        let grid = terrain.world().lod_grid(rng.u8(1..6));
        let (drawn, nodes) = terrain.world().draw_cut(Cut::coarsest(grid));
        let mut display = Display::default();
        display.show_nodes(&nodes);
        terrain.set_drawn_cut(Some(Arc::new(drawn)));
        for step in 0..rng.usize(6..16) {
            let what = format!("world {index}, step {step}");
            let is_edit = rng.u32(0..3) > 0;
            let transaction = if is_edit {
                if rng.u32(0..6) == 0 {
                    terrain.submit(Order::Undo);
                } else if rng.u32(0..6) == 0 {
                    let change = worlds::change_towards(&terrain, &saved[rng.usize(0..saved.len())]);
                    saved.push(terrain.parts());
                    terrain.submit(Order::parts(change, None));
                } else {
                    let count = rng.usize(1..3);
                    for _ in 0..count {
                        let brush = random_brush(rng, terrain.world().ground(), terrain.world().grid());
                        terrain.submit(&brush);
                    }
                }
                terrain.begin()
            } else {
                terrain.begin_cut(random_step(rng))
            };
            let Some(transaction) = transaction else { continue };
            let commit = transaction.run();
            display.show(&commit);
            terrain.commit(commit).expect("the one under way");
            (edits, changes) = (edits + usize::from(is_edit), changes + usize::from(!is_edit));
            let drawn = terrain.drawn_cut().expect("a cut is drawn");
            display.assert_is(&Display::from_scratch(terrain.world(), drawn.cut()), &what);
            display.assert_is_closed(terrain.world(), drawn.cut(), &what);
            joined +=
                display.0.keys().filter(|key| matches!(key, Key::Node(node) if node.level == 0)).count();
        }
    }
    println!(
        "{edits} edits, {changes} changes of levels; {joined} tiles drawn as one mesh with their chunks"
    );
    assert!(edits > 0 && changes > 0);
}

#[test]
fn edits_and_receipts_know_no_levels() {
    for index in 0..worlds::world_count(12) {
        let rng = &mut Rng::with_seed(index);
        let (ground, chunk_size) = worlds::random_ground(rng, index);
        let ground = Arc::new(ground);
        let settings = TerrainSettings { chunk_size, ..TerrainSettings::default() };
        let mut terrains =
            [(); 2].map(|()| Terrain::new(Arc::clone(&ground), &settings).expect("a valid size"));
        let cut = Cut::coarsest(terrains[0].world().lod_grid(5));
        let (drawn, _) = terrains[0].world().draw_cut(cut);
        terrains[0].set_drawn_cut(Some(Arc::new(drawn)));
        for _ in 0..8 {
            if let Some(change) = terrains[0].begin_cut(random_step(rng)) {
                let revision = terrains[0].world().revision();
                terrains[0].commit(change.run()).expect("the one under way");
                assert_eq!(terrains[0].world().revision(), revision, "nothing of the world changed");
            }
            let brush = random_brush(rng, &ground, terrains[0].world().grid());
            let [with, without] = terrains.each_mut().map(|terrain| terrain.apply([brush.clone()]));
            assert_eq!(with, without);
        }
        let [with, without] = terrains.each_ref().map(Terrain::world);
        assert_eq!(with.hash(), without.hash());
        assert!(with.drawn().eq(without.drawn()), "world {index}: level 0 differs");
    }
}

#[test]
fn cuts_of_another_world_are_not_drawn() {
    let terrain = |side| {
        let ground = Ground::flat(side, side, 4.5).expect("valid ground");
        Terrain::new(ground, &TerrainSettings { chunk_size: 8, ..TerrainSettings::default() }).expect("valid")
    };
    let (mut small, large) = (terrain(40), terrain(500));
    let foreign = Cut::random(large.world().lod_grid(4), 3, 70);
    let (drawn, nodes) = small.world().draw_cut(foreign.clone());
    assert_eq!(drawn.cut().grid().chunks(), small.world().grid());
    let mut display = Display::default();
    display.show_nodes(&nodes);
    display.assert_is_closed(small.world(), drawn.cut(), "the coarsest");
    small.set_drawn_cut(Some(Arc::new(large.world().draw_cut(foreign.clone()).0)));
    assert!(small.drawn_cut().is_none());
    small.set_drawn_cut(Some(Arc::new(drawn)));
    let change = small.begin_cut(Arc::new(move |_, _| foreign.clone())).expect("a cut is drawn");
    let commit = change.run();
    assert!(commit.meshes.nodes.is_empty());
    small.commit(commit).expect("the one under way");
    assert_eq!(small.drawn_cut().expect("as before").cut().grid().chunks(), small.world().grid());
}
