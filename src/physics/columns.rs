//! Columns of chunks: which tiles and chunks stand in them, and which of these lack a collider.

use std::collections::{BTreeMap, BTreeSet};

use bevy::platform::collections::HashMap;
use bevy::prelude::*;

use super::ground::GroundCollider;
use crate::lattice::TilePos;
use crate::plugin::{Chunk, ShownSurface, Tile};
use crate::terrain::Drawn;

/// A column of chunks of a terrain's entity.
pub(super) type ColumnKey = (Entity, TilePos);

/// The column that a tile or chunk stands in.
pub(super) fn column(drawn: Drawn) -> TilePos {
    match drawn {
        Drawn::Tile(tile) => tile,
        Drawn::Chunk(chunk) => chunk.tile(),
    }
}

/// Which tile or chunk an entity is.
fn drawn(tile: Option<&Tile>, chunk: Option<&Chunk>) -> Option<Drawn> {
    let tile = tile.map(|&tile| Drawn::Tile(tile.into()));
    tile.or_else(|| chunk.map(|&chunk| Drawn::Chunk(chunk.into())))
}

/// Tiles and chunks that show a surface, and the colliders they have.
pub(super) type Parts<'w, 's> = Query<
    'w,
    's,
    (
        &'static ShownSurface,
        Option<&'static GroundCollider>,
        &'static ChildOf,
        Option<&'static Tile>,
        Option<&'static Chunk>,
    ),
    Or<(With<Tile>, With<Chunk>)>,
>;

/// What a part's collider is like.
pub(super) struct Look {
    pub has_collider: bool,
    pub is_missing: bool,
    /// Nothing is missing, or not any more.
    pub is_there: bool,
}

/// What stands in a column, as it was when it was looked at last.
#[derive(Default)]
struct State {
    parts: Vec<(Entity, Drawn)>,
    colliders: usize,
    missing: Vec<(Entity, Drawn)>,
    is_ready: bool,
}

/// All columns in which there is a tile or chunk that shows something. They are looked at again only when something
/// happened in them.
#[derive(Resource, Default)]
pub(super) struct Columns {
    /// Tiles and chunks that something happened to.
    news: Vec<Entity>,
    homes: HashMap<Entity, ColumnKey>,
    states: HashMap<ColumnKey, State>,
    /// Those in which something is missing, by terrain.
    waiting: BTreeMap<Entity, BTreeSet<TilePos>>,
    colliders: usize,
    missing: usize,
    /// Those that have got ready since, or are not any more, or are empty.
    turned: Vec<ColumnKey>,
}

impl Columns {
    /// Has everything that has triangles in this column a collider? `None` where nothing stands in it: it is to come yet, or
    /// the game took it away.
    pub fn is_ready(&self, column: ColumnKey) -> Option<bool> {
        self.states.get(&column).map(|state| state.is_ready)
    }

    /// Was there a collider in this column when it was looked at last?
    pub fn has_colliders(&self, column: ColumnKey) -> bool {
        self.states.get(&column).is_some_and(|state| state.colliders > 0)
    }

    /// The columns that have got ready since this was asked last, or are not any more, or in which nothing stands any more.
    pub fn take_turned(&mut self) -> Vec<ColumnKey> {
        std::mem::take(&mut self.turned)
    }

    /// How many tiles and chunks have a collider, and how many wait for one.
    pub fn counts(&self) -> (usize, usize) {
        (self.colliders, self.missing)
    }

    /// The columns of all tiles and chunks that something happened to since.
    pub fn take_news(&mut self, parts: &Parts) -> BTreeSet<ColumnKey> {
        let mut touched = BTreeSet::new();
        for part in std::mem::take(&mut self.news) {
            let found = parts.get(part).ok().and_then(|(.., parent, tile, chunk)| {
                let drawn = drawn(tile, chunk)?;
                Some(((parent.parent(), column(drawn)), drawn))
            });
            let (before, now) = (self.homes.get(&part).copied(), found.map(|(home, _)| home));
            touched.extend(before.into_iter().chain(now));
            if before == now {
                continue;
            }
            if let Some(state) = before.and_then(|home| self.states.get_mut(&home)) {
                state.parts.retain(|&(other, _)| other != part);
            }
            self.homes.remove(&part);
            if let Some((home, drawn)) = found {
                self.homes.insert(part, home);
                self.states.entry(home).or_default().parts.push((part, drawn));
            }
        }
        touched
    }

    /// Looks at each part of a column; tells how many there are.
    pub fn look(&mut self, column: ColumnKey, mut look: impl FnMut(Entity) -> Option<Look>) -> usize {
        let Some(state) = self.states.get_mut(&column) else { return 0 };
        let (colliders, missing, was_ready) = (state.colliders, state.missing.len(), state.is_ready);
        (state.colliders, state.is_ready) = (0, true);
        state.missing.clear();
        for &(part, drawn) in &state.parts {
            let Some(look) = look(part) else { continue };
            state.colliders += usize::from(look.has_collider);
            state.missing.extend(look.is_missing.then_some((part, drawn)));
            state.is_ready &= look.is_there;
        }
        self.colliders = self.colliders + state.colliders - colliders;
        self.missing = self.missing + state.missing.len() - missing;
        if was_ready != state.is_ready || state.parts.is_empty() {
            self.turned.push(column);
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

    /// The terrains in which something is missing.
    pub fn waiting(&self) -> impl Iterator<Item = Entity> {
        self.waiting.keys().copied()
    }

    /// What is missing in a terrain.
    pub fn missing(&self, terrain: Entity) -> impl Iterator<Item = (TilePos, Entity, Drawn)> {
        let columns = self.waiting.get(&terrain).into_iter().flatten();
        columns.flat_map(move |&tile| {
            let missing = self.states.get(&(terrain, tile)).map_or(&[][..], |state| &state.missing);
            missing.iter().map(move |&(part, drawn)| (tile, part, drawn))
        })
    }
}

/// A tile or chunk shows something new, or has got a collider.
pub(super) fn note_new(new: On<Insert, (ShownSurface, GroundCollider)>, mut columns: ResMut<Columns>) {
    columns.news.push(new.entity);
}

/// A tile or chunk is gone, or has lost its collider.
pub(super) fn note_gone(gone: On<Remove, (ShownSurface, GroundCollider)>, mut columns: ResMut<Columns>) {
    columns.news.push(gone.entity);
}
