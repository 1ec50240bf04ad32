//! The store's view of the world, built from records. It shares the bricks, so that a checkpoint does not need the
//! world itself.

use std::collections::{BTreeMap, BTreeSet};

use crate::lattice::{ChunkGrid, RegionPos};
use crate::store::base_level::BaseLevel;
use crate::store::regions::Region;
use crate::terrain::{CommitRecord, EditSettings, Order, Patch, WorldParts};

/// A world by regions.
#[derive(Clone, Debug)]
pub(in crate::store) struct Mirror {
    grid: ChunkGrid,
    /// Regions that hold anything, or differ from the level.
    pub regions: BTreeMap<RegionPos, Region>,
    /// Regions that changed since they were last taken, removed ones included.
    dirty: BTreeSet<RegionPos>,
    pub revision: u64,
    pub hash: u64,
    pub next_field: u64,
    pub edit_settings: EditSettings,
    /// The game's data.
    pub game: BTreeMap<String, Vec<u8>>,
    /// The level below.
    pub level: Option<BaseLevel>,
}

impl Mirror {
    /// A mirror of these parts of a world on a level with this hash; all of it counts as changed.
    pub fn new(
        grid: ChunkGrid,
        parts: WorldParts,
        hash: u64,
        game: BTreeMap<String, Vec<u8>>,
        level: Option<BaseLevel>,
    ) -> Self {
        let of_level: Vec<RegionPos> = level.iter().flat_map(BaseLevel::regions).collect();
        let WorldParts { change, revision, edit_settings, .. } = parts;
        let mut mirror = Self {
            grid,
            regions: BTreeMap::new(),
            dirty: BTreeSet::new(),
            revision,
            hash,
            next_field: change.next_field,
            edit_settings,
            game,
            level,
        };
        mirror.apply_change(&change, revision);
        // Also where nothing is left of the level.
        mirror.settle(of_level, revision);
        mirror
    }

    /// Replaces the whole world by other parts.
    pub fn replace(&mut self, parts: WorldParts, hash: u64) {
        let mut new = Self::new(self.grid, parts, hash, std::mem::take(&mut self.game), self.level.take());
        new.dirty.extend(self.regions.keys());
        new.dirty.append(&mut self.dirty);
        *self = new;
    }

    /// Applies the changes of a commit.
    pub fn apply(&mut self, record: &CommitRecord) {
        for order in &record.orders {
            match order {
                Order::Rules(rules) => self.edit_settings.rules.clone_from(rules),
                Order::Loose(loose) => self.edit_settings.loose = *loose,
                _ => {}
            }
        }
        self.apply_change(&record.change, record.revision);
        (self.revision, self.hash) = (record.revision, record.hash);
    }

    fn apply_change(&mut self, change: &Patch, revision: u64) {
        let mut touched = Vec::new();
        for (at, part) in change.by_region(self.grid) {
            self.regions.entry(at).or_default().apply(part);
            touched.push(at);
        }
        self.settle(touched, revision);
        self.next_field = self.next_field.max(change.next_field);
    }

    /// Records changed regions, and compares them with the level.
    fn settle(&mut self, touched: impl IntoIterator<Item = RegionPos>, revision: u64) {
        let chunk_size = self.chunk_size();
        for at in touched {
            let region = self.regions.entry(at).or_default();
            region.revision = revision;
            region.is_stored = match &self.level {
                Some(level) => {
                    let change = level.difference(at, region, chunk_size);
                    !change.bricks.is_empty() || !change.fields.is_empty()
                }
                None => true,
            };
            if region.is_empty() && self.level.as_ref().is_none_or(|level| !level.holds(at)) {
                self.regions.remove(&at);
            }
            self.dirty.insert(at);
        }
    }

    /// Whether everything equals the level below, or is pristine if there is none.
    pub fn is_as_level(&self) -> bool {
        let next_field = self.level.as_ref().map_or(0, |level| level.level().next_field);
        self.next_field == next_field && self.regions.values().all(|region| !region.is_stored)
    }

    /// Cells along a chunk's side.
    pub fn chunk_size(&self) -> u32 {
        self.grid.size() as u32
    }

    /// Sets the revisions that changed regions last, as their records say.
    pub fn set_revisions(&mut self, revisions: &BTreeMap<RegionPos, u64>) {
        for (at, region) in &mut self.regions {
            region.revision = revisions.get(at).copied().unwrap_or(region.revision);
        }
    }

    /// Whether anything has changed since the last [`take_dirty`](Self::take_dirty).
    pub fn is_dirty(&self) -> bool {
        !self.dirty.is_empty()
    }

    /// The regions that changed since the last call; those without a record are `None`.
    pub fn take_dirty(&mut self) -> Vec<(RegionPos, Option<Region>)> {
        let dirty = std::mem::take(&mut self.dirty);
        let stored = |at: &RegionPos| self.regions.get(at).filter(|region| region.is_stored);
        dirty.into_iter().map(|at| (at, stored(&at).cloned())).collect()
    }

    /// Counts regions as changed again, because saving them failed.
    pub fn put_back(&mut self, regions: impl IntoIterator<Item = RegionPos>) {
        self.dirty.extend(regions);
    }

    /// Counts all regions as saved, but for those that a record changes.
    pub fn mark_saved(&mut self) {
        self.dirty.clear();
    }

    /// Counts all regions as changed.
    pub fn mark_all(&mut self) {
        self.dirty.extend(self.regions.keys());
    }
}
