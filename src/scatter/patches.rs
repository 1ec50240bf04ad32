//! Patches: squares of plants of one species, kept up to date with a world.

use std::ops::RangeInclusive;
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::plants::{Plant, Scatter};
use crate::ground::Ground;
use crate::lattice::{Column, LatticeBox, ONE};
use crate::terrain::World;

/// The position of a patch, in patches of its species.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PatchPos {
    /// The species.
    pub species: u8,
    /// Along +x.
    pub x: i32,
    /// Along +z.
    pub z: i32,
}

/// A plant that disappeared or returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlantChange {
    /// The plant's patch.
    pub patch: PatchPos,
    /// The plant's index in the patch.
    pub index: usize,
    /// The plant.
    pub plant: Plant,
    /// Whether it stands now.
    pub stands: bool,
}

/// The plants of a patch.
#[derive(Clone, Debug, Default)]
pub struct PlantPatch {
    plants: Vec<Plant>,
    gone: Vec<bool>,
    gone_count: usize,
}

impl PlantPatch {
    /// All of its plants, those that do not stand too, in order of their ids.
    pub fn plants(&self) -> &[Plant] {
        &self.plants
    }

    /// Whether the plant with this index stands.
    pub fn stands(&self, index: usize) -> bool {
        self.gone.get(index) == Some(&false)
    }

    /// The plants that stand.
    pub fn standing(&self) -> impl Iterator<Item = &Plant> {
        self.plants.iter().zip(&self.gone).filter(|(_, gone)| !**gone).map(|(plant, _)| plant)
    }
}

/// Patches of plants that follow a world from commit to commit: for a game that draws or simulates plants.
///
/// Each species has patches of its own size, which follows from how far it is drawn.
#[derive(Clone, Debug)]
pub struct PlantPatches {
    scatter: Arc<Scatter>,
    patches: FxHashMap<PatchPos, PlantPatch>,
}

impl PlantPatches {
    /// No patches yet.
    pub fn new(scatter: Arc<Scatter>) -> Self {
        Self { scatter, patches: FxHashMap::default() }
    }

    /// The rules.
    pub fn scatter(&self) -> &Arc<Scatter> {
        &self.scatter
    }

    /// All patches, in no order.
    pub fn iter(&self) -> impl Iterator<Item = (PatchPos, &PlantPatch)> {
        self.patches.iter().map(|(&pos, patch)| (pos, patch))
    }

    /// A patch, if it is there.
    pub fn get(&self, pos: PatchPos) -> Option<&PlantPatch> {
        self.patches.get(&pos)
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.patches.len()
    }

    /// Returns `true` if there are none.
    pub fn is_empty(&self) -> bool {
        self.patches.is_empty()
    }

    /// Adds a patch with the plants that [`Scatter::patch`] gave, which may have been made on another thread.
    pub fn insert(&mut self, world: &World, pos: PatchPos, plants: Vec<Plant>) {
        let gone: Vec<bool> = plants.iter().map(|plant| !self.scatter.stands(world, plant)).collect();
        let gone_count = gone.iter().filter(|gone| **gone).count();
        self.patches.insert(pos, PlantPatch { plants, gone, gone_count });
    }

    /// Removes a patch.
    pub fn remove(&mut self, pos: PatchPos) -> Option<PlantPatch> {
        self.patches.remove(&pos)
    }

    /// Checks the plants that may have gone or returned because these samples changed; all of them if `samples` is
    /// `None`.
    ///
    /// The time grows with the number of plants that are checked: those of the loaded patches within the
    /// [reach](Scatter::reach) of the box. The box may be larger than the world.
    pub fn update(&mut self, world: &World, samples: Option<LatticeBox>) -> Vec<PlantChange> {
        let mut changes = Vec::new();
        let Some(samples) = samples else {
            let Self { scatter, patches } = self;
            for (&pos, patch) in patches.iter_mut() {
                let (low, high) = scatter.patch_cells(pos);
                patch.update(scatter, world, pos, (low, high), &mut changes);
            }
            changes.sort_by_key(|change| change.plant.id);
            return changes;
        };
        let (low, high) = self.scatter.affected(samples);
        for species in 0..self.scatter.species().len() as u8 {
            for pos in self.covering(species, low, high) {
                if let Some(patch) = self.patches.get_mut(&pos) {
                    patch.update(&self.scatter, world, pos, (low, high), &mut changes);
                }
            }
        }
        changes
    }

    /// The patches of a species with cells of a rectangle, both corners included, row by row. Visits the squares of the
    /// rectangle or all patches, whichever are fewer: the rectangle may be far larger than the world.
    fn covering(&self, species: u8, low: Column, high: Column) -> Vec<PatchPos> {
        let size = self.scatter.patch_size(species);
        let along = |low: i32, high: i32| low.div_euclid(size)..=high.div_euclid(size);
        let (xs, zs) = (along(low.x, high.x), along(low.z, high.z));
        let count = |along: &RangeInclusive<i32>| along.end().abs_diff(*along.start()) as usize + 1;
        if count(&xs).saturating_mul(count(&zs)) <= self.patches.len() {
            let squares = zs.flat_map(|z| xs.clone().map(move |x| PatchPos { species, x, z }));
            return squares.filter(|pos| self.patches.contains_key(pos)).collect();
        }
        let is_there = |pos: &PatchPos| pos.species == species && xs.contains(&pos.x) && zs.contains(&pos.z);
        let mut found: Vec<PatchPos> = self.patches.keys().copied().filter(is_there).collect();
        found.sort_unstable_by_key(|pos| (pos.z, pos.x));
        found
    }

    /// Plants of these patches that stand on cells of a rectangle, both corners included; of each species for which
    /// `wanted` has `true`.
    pub fn near_of(
        &self,
        low: Column,
        high: Column,
        wanted: impl IntoIterator<Item = bool>,
    ) -> impl Iterator<Item = &Plant> {
        let is_near = move |plant: &&Plant| {
            let cell = plant.cell();
            (low.x..=high.x).contains(&cell.x) && (low.z..=high.z).contains(&cell.z)
        };
        let wanted = (0..=u8::MAX).zip(wanted).filter(|(_, wanted)| *wanted).map(|(species, _)| species);
        let positions = wanted.flat_map(move |species| self.covering(species, low, high));
        positions.filter_map(|pos| self.get(pos)).flat_map(PlantPatch::standing).filter(is_near)
    }
}

impl PlantPatch {
    fn update(
        &mut self,
        scatter: &Scatter,
        world: &World,
        patch: PatchPos,
        (low, high): (Column, Column),
        changes: &mut Vec<PlantChange>,
    ) {
        let points =
            |low: i32, high: i32| low.saturating_mul(ONE)..high.saturating_add(1).saturating_mul(ONE);
        let (along_x, along_z) = (points(low.x, high.x), points(low.z, high.z));
        // Plants are in order of their squares along z: only some rows can be meant.
        let spacing = scatter.spacing(patch.species);
        let row = |z: i32| z.div_euclid(spacing);
        let first = self.plants.partition_point(|plant| plant.id.z < row(along_z.start));
        let end = self.plants.partition_point(|plant| plant.id.z <= row(along_z.end));
        let rows = self.plants[first..end].iter().zip(&mut self.gone[first..end]);
        for (index, (plant, gone)) in (first..).zip(rows) {
            if !(along_x.contains(&plant.x) && along_z.contains(&plant.z)) {
                continue;
            }
            let stands = scatter.stands(world, plant);
            if stands == *gone {
                *gone = !stands;
                self.gone_count = if stands { self.gone_count - 1 } else { self.gone_count + 1 };
                changes.push(PlantChange { patch, index, plant: *plant, stands });
            }
        }
    }

    /// Number of plants that do not stand.
    pub fn gone_count(&self) -> usize {
        self.gone_count
    }
}

impl Scatter {
    /// Cells along the sides of a species' patches: a power of two, about a quarter of the distance to which it is
    /// drawn.
    pub fn patch_size(&self, species: u8) -> i32 {
        let end = self.species().get(usize::from(species)).map_or(0.0, |own| own.view.end);
        ((end / 4.0) as u32).clamp(16, 128).next_power_of_two().min(128) as i32
    }

    /// Sides of a species' squares, in 1/256 voxel.
    fn spacing(&self, species: u8) -> i32 {
        self.rules.get(usize::from(species)).map_or(ONE, |rule| rule.spacing)
    }

    /// The cells of a patch: lowest and highest, both included.
    pub fn patch_cells(&self, pos: PatchPos) -> (Column, Column) {
        let size = self.patch_size(pos.species);
        let low = Column::new(pos.x.saturating_mul(size), pos.z.saturating_mul(size));
        (low, low.offset(size - 1, size - 1))
    }

    /// The plants of a patch on undug ground.
    pub fn patch(&self, ground: &Ground, pos: PatchPos) -> Vec<Plant> {
        let (low, high) = self.patch_cells(pos);
        self.plants(ground, low, high, |species| species == usize::from(pos.species))
    }
}
