//! Changes that a game committed to a terrain directly, until the plugin shows them.

use std::collections::{BTreeMap, BTreeSet};

use super::commit::Commit;
use super::resolve::FieldChange;
use crate::lattice::{ChunkPos, LatticeBox, RegionPos};
use crate::world::{MeshKey, Version, World};

/// Tiles, chunks, fields and samples that changed, and the versions before and after.
pub(crate) struct PendingDisplay {
    from: Version,
    to: Version,
    drawn: BTreeSet<MeshKey>,
    fields: Vec<(ChunkPos, FieldChange)>,
    /// Boxes around the bricks that changed, by region.
    boxes: BTreeMap<RegionPos, LatticeBox>,
}

impl PendingDisplay {
    /// Nothing yet, on top of what is shown.
    pub(super) fn nothing(shown: Version) -> Self {
        let (drawn, fields, boxes) = (BTreeSet::new(), Vec::new(), BTreeMap::new());
        Self { from: shown, to: shown, drawn, fields, boxes }
    }

    /// The version of the world with all of it.
    pub fn version(&self) -> Version {
        self.to
    }

    /// Returns `true` if it belongs to this world, regardless of later commits.
    pub fn is_of(&self, world: &World) -> bool {
        self.to.is_same_world(world.version())
    }

    /// Returns `true` if this is the version before all of it.
    pub fn follows(&self, shown: Version) -> bool {
        self.from == shown
    }

    /// The tiles and chunks that changed, each once.
    pub fn drawn(&self) -> impl Iterator<Item = MeshKey> {
        self.drawn.iter().copied()
    }

    /// The number of tiles and chunks that changed.
    pub fn len(&self) -> usize {
        self.drawn.len()
    }

    /// Changes of fields, in order.
    pub fn fields(&self) -> &[(ChunkPos, FieldChange)] {
        &self.fields
    }

    /// Boxes around the samples that changed, one for each region of the lattice.
    #[cfg(any(feature = "scatter", feature = "landmass"))]
    pub fn boxes(&self) -> Vec<LatticeBox> {
        self.boxes.values().copied().collect()
    }

    /// The changes of a commit to the world at this version. They are read from its lists, because the game may have
    /// taken its meshes.
    pub(super) fn of(commit: &Commit, before: Version) -> Self {
        let tiles = commit.kept.rings.iter().map(|(tile, _)| MeshKey::Tile(*tile));
        let chunks = commit.kept.chunks.iter().map(|(chunk, _)| MeshKey::Chunk(*chunk));
        let mut boxes = BTreeMap::new();
        commit.add_changed_boxes(&mut boxes);
        let (drawn, fields) = (tiles.chain(chunks).collect(), commit.outcome.news.clone());
        Self { from: before, to: before, drawn, fields, boxes }
    }

    /// Adds what follows it directly and leads to this version; anything else is left out, and makes it useless.
    pub(super) fn add(&mut self, next: Self, to: Version) {
        if self.to == next.from {
            self.drawn.extend(next.drawn);
            self.fields.extend(next.fields);
            for (region, samples) in next.boxes {
                self.boxes.entry(region).and_modify(|all| *all = all.union(samples)).or_insert(samples);
            }
            self.to = to;
        }
    }
}
