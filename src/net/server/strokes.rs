//! Strokes that can be undone: the parts that each replaced, and their new content.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::lattice::{BrickPos, ChunkPos};
use crate::net::message::ClientId;
use crate::terrain::{World, WorldChange};
use crate::volume::{Brick, Fields};

type Stored = Option<Arc<Brick>>;

/// The old and the new content of a part.
struct Replaced<T> {
    before: T,
    after: T,
}

/// Edits of a player that are undone together.
struct Stroke {
    /// Counts strokes of all players.
    number: u64,
    label: Option<u64>,
    bricks: BTreeMap<BrickPos, Replaced<Stored>>,
    fields: BTreeMap<ChunkPos, Replaced<Fields>>,
    /// Whether another player changed its result between its edits.
    is_touched: bool,
    bytes: usize,
}

/// The reason why a stroke is not undone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoUndo {
    Nothing,
    Touched,
}

/// The strokes of all players, within a limit of bytes.
pub struct Strokes {
    players: FxHashMap<ClientId, VecDeque<Stroke>>,
    /// The players of the strokes, by number from the oldest that is kept.
    order: VecDeque<(u64, ClientId)>,
    next: u64,
    bytes: usize,
    limit: usize,
}

impl Strokes {
    pub fn new(limit: usize) -> Self {
        let (players, order) = Default::default();
        Self { players, order, next: 0, bytes: 0, limit }
    }

    /// Records an edit's changes of this world. Consecutive edits with equal labels are one stroke.
    pub fn record(&mut self, player: ClientId, label: Option<u64>, world: &World, change: &WorldChange) {
        let strokes = self.players.entry(player).or_default();
        let goes_on = label.is_some() && strokes.back().is_some_and(|stroke| stroke.label == label);
        if !goes_on {
            let number = self.next;
            self.next += 1;
            self.order.push_back((number, player));
            let (bricks, fields) = Default::default();
            let bytes = size_of::<Stroke>();
            self.bytes += bytes;
            strokes.push_back(Stroke { number, label, bricks, fields, is_touched: false, bytes });
        }
        if let Some(stroke) = strokes.back_mut() {
            self.bytes -= stroke.bytes;
            stroke.add(world, change);
            self.bytes += stroke.bytes;
        }
        self.trim();
    }

    fn trim(&mut self) {
        while self.bytes > self.limit {
            let Some((number, player)) = self.order.pop_front() else { return };
            let Some(strokes) = self.players.get_mut(&player) else { continue };
            if strokes.front().is_some_and(|stroke| stroke.number == number) {
                self.bytes -= strokes.pop_front().map_or(0, |stroke| stroke.bytes);
            }
            if strokes.is_empty() {
                self.players.remove(&player);
            }
        }
    }

    /// Removes the last stroke of a player, and returns the change that undoes it in this world.
    pub fn undo(&mut self, player: ClientId, world: &World) -> Result<WorldChange, NoUndo> {
        let strokes = self.players.get_mut(&player).ok_or(NoUndo::Nothing)?;
        let stroke = strokes.pop_back().ok_or(NoUndo::Nothing)?;
        if strokes.is_empty() {
            self.players.remove(&player);
        }
        self.bytes -= stroke.bytes;
        self.order.retain(|(number, _)| *number != stroke.number);
        stroke.undone(world).ok_or(NoUndo::Touched)
    }
}

impl Stroke {
    fn add(&mut self, world: &World, change: &WorldChange) {
        for (pos, after) in &change.bricks {
            let now = world.brick(*pos);
            self.bytes += size(after.as_ref());
            if let Some(own) = self.bricks.get_mut(pos) {
                self.is_touched |= !Brick::is_same(own.after.as_ref(), now);
                self.bytes -= size(own.after.as_ref());
                own.after = after.clone();
            } else {
                self.bytes += ENTRY + size(now);
                self.bricks.insert(*pos, Replaced { before: now.cloned(), after: after.clone() });
            }
        }
        for (chunk, after) in &change.fields {
            self.bytes += after.bytes();
            if let Some(own) = self.fields.get_mut(chunk) {
                self.bytes -= own.after.bytes();
                own.after = after.clone();
            } else {
                let before = world.fields_of(*chunk).cloned().unwrap_or_default();
                self.bytes += ENTRY + before.bytes();
                self.fields.insert(*chunk, Replaced { before, after: after.clone() });
            }
        }
    }

    /// The change that undoes it, if its result is still unchanged. Fields that others have changed since stay: they
    /// also contain the replaced parts.
    fn undone(&self, world: &World) -> Option<WorldChange> {
        let is_there = |(pos, own): (&BrickPos, &Replaced<Stored>)| {
            Brick::is_same(own.after.as_ref(), world.brick(*pos))
        };
        if self.is_touched || !self.bricks.iter().all(is_there) {
            return None;
        }
        let fields = self.fields.iter().filter(|(chunk, own)| match world.fields_of(**chunk) {
            Some(now) => *now == own.after,
            None => own.after.is_empty(),
        });
        Some(WorldChange {
            bricks: self.bricks.iter().map(|(pos, own)| (*pos, own.before.clone())).collect(),
            fields: fields.map(|(chunk, own)| (*chunk, own.before.clone())).collect(),
            next_field: world.next_field(),
        })
    }
}

/// Bytes of an entry of a stroke's lists.
const ENTRY: usize = 64;

/// Bytes that a brick takes, as if it were held here only.
fn size(brick: Option<&Arc<Brick>>) -> usize {
    brick.map_or(0, |brick| brick.bytes())
}
