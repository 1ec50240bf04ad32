//! The reference that a terrain under test is compared with.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use bevy_burrow::lattice::{ChunkPos, LatticeBox, TilePos};
use bevy_burrow::prelude::*;
use bevy_burrow::surface::block::Mesher;
use bevy_burrow::volume::FieldId;
use glam::IVec3;

use crate::bits::{MeshBits, mesh_bits};

/// Every edited sample: density and stored material.
pub type Samples = HashMap<IVec3, (i32, MaterialId)>;

/// What an edit changed, according to the reference.
#[derive(Debug, Default, PartialEq)]
pub struct Effect {
    pub chunks: BTreeSet<ChunkPos>,
    pub bounds: Option<LatticeBox>,
    pub removed: BTreeMap<MaterialId, u64>,
    pub added: BTreeMap<MaterialId, u64>,
    pub painted: BTreeMap<MaterialId, u64>,
}

/// A terrain under test and a reference world that is edited sample by sample.
pub struct CheckedTerrain {
    pub terrain: Terrain,
    pub samples: Samples,
    /// Meshes that are only ever updated by commits.
    pub tiles: HashMap<TilePos, MeshBits>,
    pub chunks: HashMap<ChunkPos, MeshBits>,
    /// Kinds of uniform bricks at some commit, with the bytes of their materials.
    pub kinds: HashMap<(i32, MaterialId), usize>,
    pub fields: BTreeSet<(ChunkPos, FieldId)>,
    pub mesher: Mesher,
    /// Whether to mesh everything again after each commit: too slow for tall cliffs, whose sheets have many blocks.
    pub is_meshed_again: bool,
}

impl CheckedTerrain {
    pub fn new(ground: Ground, chunk_size: u32) -> Self {
        let settings = TerrainSettings { chunk_size, ..Default::default() };
        let terrain = Terrain::new(ground, &settings).expect("valid settings");
        let world = terrain.world();
        let tiles = world.grid().tiles().map(|tile| (tile, mesh_bits(&world.tile_mesh(tile)))).collect();
        Self {
            terrain,
            samples: Samples::default(),
            tiles,
            chunks: HashMap::new(),
            kinds: HashMap::new(),
            fields: BTreeSet::new(),
            mesher: Mesher::default(),
            is_meshed_again: true,
        }
    }

    /// Applies brushes in one transaction, but for resets, which are transactions of their own, and runs every check.
    pub fn apply(&mut self, brushes: &[Brush], what: &str) {
        let is_alone = |brush: &Brush| brush.operation == Operation::Reset;
        for group in brushes.chunk_by(|a, b| !is_alone(a) && !is_alone(b)) {
            self.apply_together(group, what);
        }
    }

    fn apply_together(&mut self, brushes: &[Brush], what: &str) {
        self.terrain.submit_all(brushes);
        let transaction = self.terrain.begin().expect("queued brushes");
        let mut commit = transaction.run();
        let news = commit.field_news().to_vec();
        // Taking the meshes out of the commit must not affect the world, which keeps its own.
        let meshes = std::mem::take(&mut commit.meshes);
        let receipts = self.terrain.commit(commit).expect("no other commit");
        assert_eq!(receipts.len(), brushes.len(), "{what}");
        for (receipt, brush) in receipts.iter().zip(brushes) {
            self.check_receipt(receipt, brush, what);
        }
        self.check_samples(what);
        self.check_bricks(what);
        self.check_fields(&news, what);
        self.check_mask(what);
        self.check_updates(&meshes, what);
        if self.is_meshed_again {
            self.check_meshes(what);
        }
    }

    pub fn material(&self, point: IVec3) -> MaterialId {
        match self.samples.get(&point) {
            Some(&(_, material)) if material != MaterialId::GROUND => material,
            _ => self.terrain.world().ground().material(point),
        }
    }

    pub fn distance(&self, point: IVec3) -> i32 {
        let stored = self.samples.get(&point);
        stored.map_or_else(|| self.terrain.world().ground().distance(point), |&(distance, _)| distance)
    }
}
