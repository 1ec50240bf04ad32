//! Columns of chunks, with their tiles and chunks, and which of these lack a collider.

use std::collections::{BTreeMap, BTreeSet};

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::ground::GroundCollider;
use crate::lattice::TilePos;
use crate::plugin::{Chunk, ShownSurface, Tile};
use crate::terrain::MeshKey;

/// A column of chunks of a terrain's entity.
pub(super) type ColumnKey = (Entity, TilePos);

/// Which tile or chunk an entity is; none if it is a coarser tile.
fn drawn(tile: Option<&Tile>, chunk: Option<&Chunk>) -> Option<MeshKey> {
    let tile = tile.filter(|tile| tile.level == 0).map(|&tile| MeshKey::Tile(tile.into()));
    tile.or_else(|| chunk.map(|&chunk| MeshKey::Chunk(chunk.into())))
}

/// Tiles and chunks that show a surface, and the colliders they have.
pub(super) type Parts<'w, 's> = Query<
    'w,
    's,
    (
        &'static ShownSurface,
        Option<&'static GroundCollider>,
        Option<&'static Children>,
        &'static ChildOf,
        Option<&'static Tile>,
        Option<&'static Chunk>,
    ),
    Or<(With<Tile>, With<Chunk>)>,
>;

/// The state of a part's collider.
pub(super) struct PartState {
    pub has_collider: bool,
    pub is_missing: bool,
    /// Whether the part has a collider, or needs none.
    pub is_ready: bool,
}

/// The parts of a column, as of the last check.
#[derive(Default)]
struct ColumnState {
    parts: Vec<(Entity, MeshKey)>,
    colliders: usize,
    missing: Vec<(Entity, MeshKey)>,
    is_ready: bool,
}

/// All columns with a tile or chunk that shows a surface. They are checked again only when a part of them changed.
#[derive(Resource, Default)]
pub(super) struct Columns {
    /// Tiles and chunks that changed since the last check.
    changed_parts: Vec<Entity>,
    column_of: HashMap<Entity, ColumnKey>,
    states: HashMap<ColumnKey, ColumnState>,
    /// Columns with a missing collider, by terrain.
    waiting: BTreeMap<Entity, BTreeSet<TilePos>>,
    colliders: usize,
    missing: usize,
    /// Columns that became ready, unready or empty.
    changed: Vec<ColumnKey>,
}

impl Columns {
    /// Whether all surfaces of this column have colliders; `None` for a column without tiles and chunks, which were not
    /// spawned yet, or were despawned by the game.
    pub fn is_ready(&self, column: ColumnKey) -> Option<bool> {
        self.states.get(&column).map(|state| state.is_ready)
    }

    /// Whether this column had a collider at the last check.
    pub fn has_colliders(&self, column: ColumnKey) -> bool {
        self.states.get(&column).is_some_and(|state| state.colliders > 0)
    }

    /// Takes the columns that became ready, unready or empty since the last call.
    pub fn take_changed(&mut self) -> Vec<ColumnKey> {
        std::mem::take(&mut self.changed)
    }

    /// How many tiles and chunks have a collider, and how many still need one.
    pub fn counts(&self) -> (usize, usize) {
        (self.colliders, self.missing)
    }

    /// Takes the columns of all tiles and chunks that changed since the last call.
    pub fn take_touched(&mut self, parts: &Parts) -> BTreeSet<ColumnKey> {
        let mut touched = BTreeSet::new();
        for part in std::mem::take(&mut self.changed_parts) {
            let found = parts.get(part).ok().and_then(|(.., parent, tile, chunk)| {
                let drawn = drawn(tile, chunk)?;
                Some(((parent.parent(), drawn.tile()), drawn))
            });
            let (before, now) = (self.column_of.get(&part).copied(), found.map(|(column, _)| column));
            touched.extend(before.into_iter().chain(now));
            if before == now {
                continue;
            }
            if let Some(state) = before.and_then(|column| self.states.get_mut(&column)) {
                state.parts.retain(|&(other, _)| other != part);
            }
            self.column_of.remove(&part);
            if let Some((column, drawn)) = found {
                self.column_of.insert(part, column);
                self.states.entry(column).or_default().parts.push((part, drawn));
            }
        }
        touched
    }

    /// Checks each part of a column and returns how many there are.
    pub fn check(&mut self, column: ColumnKey, mut check: impl FnMut(Entity) -> Option<PartState>) -> usize {
        let Some(state) = self.states.get_mut(&column) else { return 0 };
        let (colliders, missing, was_ready) = (state.colliders, state.missing.len(), state.is_ready);
        (state.colliders, state.is_ready) = (0, true);
        state.missing.clear();
        for &(part, drawn) in &state.parts {
            let Some(found) = check(part) else { continue };
            state.colliders += usize::from(found.has_collider);
            state.missing.extend(found.is_missing.then_some((part, drawn)));
            state.is_ready &= found.is_ready;
        }
        self.colliders = self.colliders + state.colliders - colliders;
        self.missing = self.missing + state.missing.len() - missing;
        if was_ready != state.is_ready || state.parts.is_empty() {
            self.changed.push(column);
        }
        let (terrain, tile) = column;
        if !state.missing.is_empty() {
            self.waiting.entry(terrain).or_default().insert(tile);
        } else if let Some(waiting) = self.waiting.get_mut(&terrain) {
            waiting.remove(&tile);
            if waiting.is_empty() {
                self.waiting.remove(&terrain);
            }
        }
        let count = state.parts.len();
        if count == 0 {
            self.states.remove(&column);
        }
        count
    }

    /// The terrains that miss colliders.
    pub fn waiting(&self) -> impl Iterator<Item = Entity> {
        self.waiting.keys().copied()
    }

    /// The tiles and chunks of a terrain that miss a collider.
    pub fn missing(&self, terrain: Entity) -> impl Iterator<Item = (TilePos, Entity, MeshKey)> {
        let columns = self.waiting.get(&terrain).into_iter().flatten();
        columns.flat_map(move |&tile| {
            let missing = self.states.get(&(terrain, tile)).map_or(&[][..], |state| &state.missing);
            missing.iter().map(move |&(part, drawn)| (tile, part, drawn))
        })
    }
}

/// A tile or chunk shows a new surface, or has a new collider.
pub(super) fn record_insert(new: On<Insert, (ShownSurface, GroundCollider)>, mut columns: ResMut<Columns>) {
    columns.changed_parts.push(new.entity);
}

/// A tile or chunk was removed, or has lost its collider.
pub(super) fn record_remove(gone: On<Remove, (ShownSurface, GroundCollider)>, mut columns: ResMut<Columns>) {
    columns.changed_parts.push(gone.entity);
}
