//! The level below a world: the world starts from the level, and saves only its differences.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::Xxh3;

use super::error::StoreError;
use super::regions::Region;
use crate::format::level::Level;
use crate::format::portable::SavedRegion;
use crate::format::region::region_key;
use crate::ground::Ground;
use crate::lattice::{BrickPos, ChunkPos, RegionPos};
use crate::terrain::{EditSettings, Patch, RestoreError, Terrain, TerrainSettings, WorldParts, brick_over};
use crate::volume::{Brick, Fields, NO_FIELDS};
use crate::world::{Positions, State};

/// A level below a world, for [`StoreOptions::level`](super::StoreOptions::level).
#[derive(Clone)]
pub struct BaseLevel {
    name: LevelName,
    level: Arc<Level>,
}

/// The identity of the level that a world is based on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LevelName {
    /// The game's name for it, such as a path. It is only used in messages, never compared.
    pub label: String,
    /// Hash of the level's bricks and fields.
    pub hash: u64,
}

impl fmt::Debug for BaseLevel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("BaseLevel").field(&self.name).finish()
    }
}

/// Only their names are compared.
impl PartialEq for BaseLevel {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl BaseLevel {
    /// A level with the game's name for it. Encodes the whole level for its hash.
    pub fn new(level: impl Into<Arc<Level>>, label: impl Into<String>) -> Self {
        let (level, mut hash): (Arc<Level>, Xxh3) = (level.into(), Xxh3::new());
        hash.update(&level.settings.chunk_size.to_le_bytes());
        hash.update(&level.next_field.to_le_bytes());
        for (at, region) in &level.regions {
            let content = region.encode();
            hash.update(&region_key(*at));
            hash.update(&(content.len() as u64).to_le_bytes());
            hash.update(&content);
        }
        Self { name: LevelName { label: label.into(), hash: hash.digest() }, level }
    }

    /// The name of the level.
    pub fn name(&self) -> &LevelName {
        &self.name
    }

    /// The level itself.
    pub fn level(&self) -> &Level {
        &self.level
    }

    /// The level of a world, if it is based on one.
    pub(super) fn needed<'a>(
        name: Option<&LevelName>,
        given: Option<&'a Self>,
    ) -> Result<Option<&'a Self>, StoreError> {
        match (name, given) {
            (None, _) => Ok(None),
            (Some(name), None) => Err(StoreError::LevelMissing { label: name.label.clone() }),
            (Some(_), Some(given)) => Ok(Some(given)),
        }
    }

    /// Checks that this is the level that a world is based on.
    pub(super) fn expect(level: Option<&Self>, name: Option<&LevelName>) -> Result<(), StoreError> {
        match (level, name) {
            (Some(level), Some(name)) if level.name.hash != name.hash => Err(StoreError::LevelChanged {
                label: name.label.clone(),
                expected: name.hash,
                found: level.name.hash,
            }),
            _ => Ok(()),
        }
    }

    /// The first state of a world on this level, or of one without a level.
    pub(super) fn first(
        level: Option<&Self>,
        ground: &Arc<Ground>,
        settings: &TerrainSettings,
    ) -> Result<Terrain, RestoreError> {
        match level {
            Some(level) => Terrain::restore(Arc::clone(ground), settings, level.parts(ground)),
            None => Ok(Terrain::new(Arc::clone(ground), settings)?),
        }
    }

    /// The level's bricks and fields on a ground, which may differ from the one it was read on.
    pub(super) fn parts(&self, ground: &Ground) -> WorldParts {
        let mut parts = WorldParts { edit_settings: EditSettings::default(), ..self.level.parts() };
        for (pos, brick) in &mut parts.change.bricks {
            *brick = brick.take().map(|brick| brick_over(ground, *pos, brick));
        }
        parts
    }

    /// The regions in which the level holds anything.
    pub(super) fn regions(&self) -> impl Iterator<Item = RegionPos> {
        self.level.regions.keys().copied()
    }

    /// Whether the level holds anything in a region.
    pub(super) fn holds(&self, at: RegionPos) -> bool {
        self.level.regions.contains_key(&at)
    }

    /// The differences of a region from the level, for chunks of this size; `None` stands for bricks that are pristine
    /// again.
    pub(super) fn difference(&self, at: RegionPos, now: &Region, chunk_size: u32) -> Patch {
        let nothing = SavedRegion::default();
        let region = self.level.regions.get(&at).unwrap_or(&nothing);
        // Fields of other chunks are other fields.
        let is_alike = self.level.settings.chunk_size == chunk_size;
        let below = Below { bricks: &region.bricks, fields: if is_alike { &region.fields } else { &[] } };
        Patch::between(&below, now, now.positions().and(below.positions()), 0)
    }
}

/// What a level holds in a region: bricks and fields, in order.
struct Below<'a> {
    bricks: &'a [(BrickPos, Arc<Brick>)],
    fields: &'a [(ChunkPos, Fields)],
}

impl Below<'_> {
    fn positions(&self) -> Positions {
        Positions {
            bricks: self.bricks.iter().map(|(pos, _)| *pos).collect(),
            chunks: self.fields.iter().map(|(chunk, _)| *chunk).collect(),
        }
    }
}

impl State for Below<'_> {
    fn brick(&self, pos: BrickPos) -> Option<&Arc<Brick>> {
        find(self.bricks, &pos)
    }

    fn fields(&self, chunk: ChunkPos) -> &Fields {
        find(self.fields, &chunk).unwrap_or(&NO_FIELDS)
    }
}

/// The value of a key in a list by keys.
fn find<'a, K: Ord, V>(list: &'a [(K, V)], key: &K) -> Option<&'a V> {
    let at = list.binary_search_by(|(own, _)| own.cmp(key)).ok()?;
    list.get(at).map(|(_, value)| value)
}
