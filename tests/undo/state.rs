//! The full state of a world, and what a renderer shows of it.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::hash::{Hash, Hasher};

use bevy_burrow::lattice::{Column, LIMIT, LatticeBox};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::SurfaceMesh;
use bevy_burrow::terrain::{MeshKey, World};
use bevy_burrow::volume::Field;
use glam::IVec3;
use rustc_hash::FxHasher;

/// The full state of a world except its commit counters. Samples and meshes are kept as hashes, so that hundreds of
/// states fit into memory.
#[derive(Debug)]
pub struct State {
    hash: u64,
    /// Every edited sample with its density and material, by brick.
    bricks: BTreeMap<[i32; 3], u64>,
    fields: BTreeMap<[i32; 3], Vec<Field>>,
    mask: Vec<Column>,
    /// Every bit of every mesh.
    meshes: Vec<(MeshKey, u64)>,
    /// Bytes of the parts of which meshes and rings are assembled.
    parts: usize,
}

impl State {
    pub fn of(world: &World) -> Self {
        let mut mask: Vec<Column> = world.mask().iter().collect();
        mask.sort_unstable_by_key(|cell| (cell.x, cell.z));
        let bricks = world.bricks().map(|(pos, brick)| {
            let samples = brick.edited_samples(pos);
            (pos.0.to_array(), hash_of(|hasher| samples.for_each(|sample| sample.hash(hasher))))
        });
        Self {
            hash: world.hash(),
            bricks: bricks.collect(),
            fields: world
                .fields()
                .map(|(chunk, fields)| (chunk.as_ivec3().to_array(), fields.iter().copied().collect()))
                .collect(),
            mask,
            meshes: world.drawn().map(|(drawn, mesh)| (drawn, mesh_hash(&mesh))).collect(),
            parts: world.memory().parts,
        }
    }

    /// Whether there are no edits.
    pub fn is_pristine(&self) -> bool {
        self.bricks.is_empty() && self.fields.is_empty() && self.mask.is_empty()
    }

    /// Checks that the world is in this state; the message says where it differs. Seams need no check: they depend on
    /// meshes only.
    pub fn check(&self, world: &World, what: &str) {
        check_index(world, what);
        let now = Self::of(world);
        assert_eq!(self.hash, now.hash, "{what}: hash");
        assert_eq!(self.bricks, now.bricks, "{what}: samples or materials");
        assert_eq!(self.mask, now.mask, "{what}: mask");
        assert_eq!(self.fields, now.fields, "{what}: fields");
        for (before, after) in self.meshes.iter().zip(&now.meshes) {
            assert!(before == after, "{what}: mesh of {:?} or {:?}", before.0, after.0);
        }
        assert_eq!(self.meshes.len(), now.meshes.len(), "{what}: what is drawn");
        assert_eq!(self.parts, now.parts, "{what}: parts and rings");
    }
}

/// Checks that the index by position finds exactly the stored bricks, including those above and below each other.
fn check_index(world: &World, what: &str) {
    let all = LatticeBox { min: IVec3::splat(-LIMIT), max: IVec3::splat(LIMIT) };
    let listed: BTreeSet<[i32; 3]> = world.bricks_near(all).map(|pos| pos.0.to_array()).collect();
    let held: BTreeSet<[i32; 3]> = world.bricks().map(|(pos, _)| pos.0.to_array()).collect();
    assert_eq!(world.bricks_near(all).count(), listed.len(), "{what}: a brick is listed twice");
    assert!(listed == held, "{what}: {} bricks by place instead of {}", listed.len(), held.len());
    for (pos, _) in world.bricks() {
        assert!(world.bricks_near(pos.samples()).eq([pos]), "{what}: {pos:?} is not found by place");
    }
}

fn hash_of(write: impl FnOnce(&mut FxHasher)) -> u64 {
    let mut hasher = FxHasher::default();
    write(&mut hasher);
    hasher.finish()
}

/// The hash of positions, normals, materials and weights, bit by bit, and of the triangles.
fn mesh_hash(mesh: &SurfaceMesh) -> u64 {
    hash_of(|hasher| {
        for vertex in &mesh.vertices {
            let normal = vertex.normal.to_array().map(f32::to_bits);
            (vertex.position, normal, vertex.materials.ids, vertex.materials.weights).hash(hasher);
        }
        mesh.indices.hash(hasher);
    })
}

/// The meshes that a renderer shows if it only applies the meshes in commits.
pub struct DisplayedMeshes(HashMap<MeshKey, SurfaceMesh>);

impl DisplayedMeshes {
    pub fn of(world: &World) -> Self {
        Self(world.drawn().collect())
    }

    /// Runs and commits all pending work; returns the receipts of its brushes.
    pub fn play(&mut self, terrain: &mut Terrain) -> Vec<Receipt> {
        let mut receipts = Vec::new();
        while let Some(transaction) = terrain.begin() {
            let commit = transaction.run();
            for (tile, update) in &commit.meshes.tiles {
                self.0.insert(MeshKey::Tile(*tile), update.mesh());
            }
            for (chunk, surface) in &commit.meshes.chunks {
                self.0.insert(MeshKey::Chunk(*chunk), surface.mesh().clone());
            }
            receipts.extend(terrain.commit(commit).expect("no other commit"));
        }
        receipts
    }

    pub fn check(&self, world: &World, what: &str) {
        let drawn: HashMap<MeshKey, SurfaceMesh> = world.drawn().collect();
        for (drawn, mesh) in self.0.iter().filter(|(_, mesh)| !mesh.is_empty()) {
            assert!(world.drawn_mesh_is(*drawn, mesh), "{what}: {drawn:?} shows a stale mesh");
        }
        let shown = |(drawn, mesh): &(&MeshKey, &SurfaceMesh)| mesh.is_empty() || self.0.contains_key(drawn);
        assert!(drawn.iter().all(|pair| shown(&pair)), "{what}: something is not shown");
    }
}

/// Comparison of a drawn mesh with another one.
trait MeshOf {
    fn drawn_mesh_is(&self, drawn: MeshKey, mesh: &SurfaceMesh) -> bool;
}

impl MeshOf for World {
    fn drawn_mesh_is(&self, drawn: MeshKey, mesh: &SurfaceMesh) -> bool {
        match drawn {
            MeshKey::Tile(tile) => self.tile_mesh(tile) == *mesh,
            MeshKey::Chunk(chunk) => self.chunk_mesh(chunk) == *mesh,
        }
    }
}
