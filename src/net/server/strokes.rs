//! Strokes that can be undone: the parts that each replaced, and their new content.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::lattice::{BrickPos, ChunkPos};
use crate::net::message::ClientId;
use crate::terrain::{Patch, World};
use crate::volume::Brick;
use crate::world::{Overlay, State};

/// Edits of a player that are undone together.
struct Stroke {
    /// Counts strokes of all players.
    number: u64,
    label: Option<u64>,
    /// The content that its edits replaced.
    before: Overlay,
    /// The new content, at the same positions.
    after: Overlay,
    /// Whether another player changed its result between its edits.
    is_touched: bool,
    /// Chunks whose fields another player changed between its edits.
    mixed: BTreeSet<ChunkPos>,
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
    pub fn record(&mut self, player: ClientId, label: Option<u64>, world: &World, change: &Patch) {
        let strokes = self.players.entry(player).or_default();
        let goes_on = label.is_some() && strokes.back().is_some_and(|stroke| stroke.label == label);
        if !goes_on {
            let number = self.next;
            self.next += 1;
            self.order.push_back((number, player));
            let (before, after) = Default::default();
            let bytes = size_of::<Stroke>();
            self.bytes += bytes;
            let (is_touched, mixed) = (false, BTreeSet::new());
            strokes.push_back(Stroke { number, label, before, after, is_touched, mixed, bytes });
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

    /// Removes the last stroke of a player, and returns the change that undoes it in this world. A stroke that can't be
    /// undone is removed too: otherwise it would be in the way of all earlier ones.
    pub fn undo(&mut self, player: ClientId, world: &World) -> Result<Patch, NoUndo> {
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
    fn add(&mut self, world: &World, change: &Patch) {
        let is_other = |(pos, _): &(BrickPos, Option<Arc<Brick>>)| {
            let own = self.after.bricks.get(pos);
            own.is_some_and(|own| !Brick::is_same(own.as_ref(), world.brick(*pos)))
        };
        self.is_touched |= change.bricks.iter().any(is_other);
        let is_mixed = |chunk: &ChunkPos| {
            self.after.fields.get(chunk).is_some_and(|own| own != State::fields(world, *chunk))
        };
        self.mixed.extend(change.fields.iter().map(|(chunk, _)| *chunk).filter(is_mixed));
        self.bytes -= self.bytes_at(change);
        self.before.keep(change.inverse(world));
        self.after.lay(change);
        self.bytes += self.bytes_at(change);
    }

    /// Bytes of what it holds at the positions of a change.
    fn bytes_at(&self, change: &Patch) -> usize {
        let sides = [&self.before, &self.after];
        let bricks = change.bricks.iter().filter_map(|(pos, _)| {
            let [before, after] = sides.map(|side| side.bricks.get(pos));
            Some(ENTRY + size(before?.as_ref()) + size(after?.as_ref()))
        });
        let fields = change.fields.iter().filter_map(|(chunk, _)| {
            let [before, after] = sides.map(|side| side.fields.get(chunk));
            Some(ENTRY + before?.bytes() + after?.bytes())
        });
        bricks.chain(fields).sum()
    }

    /// The change that undoes it, if its result is still unchanged. Where others have changed the fields of a chunk
    /// since, the fields there are made to fit what is edited afterwards.
    fn undone(&self, world: &World) -> Option<Patch> {
        let is_there =
            |(pos, own): (&BrickPos, &Option<Arc<Brick>>)| Brick::is_same(own.as_ref(), world.brick(*pos));
        if self.is_touched || !self.after.bricks.iter().all(is_there) {
            return None;
        }
        let mut undone = self.before.patch(world.next_field());
        let is_own = |chunk: ChunkPos| {
            !self.mixed.contains(&chunk) && self.after.fields.get(&chunk) == Some(State::fields(world, chunk))
        };
        undone.fields.retain(|(chunk, _)| is_own(*chunk));
        undone.add_fitted_fields(world, self.before.fields.keys().copied().filter(|chunk| !is_own(*chunk)));
        Some(undone)
    }
}

/// Bytes of an entry of a stroke's lists.
const ENTRY: usize = 64;

/// Bytes that a brick takes, as if it were held here only.
fn size(brick: Option<&Arc<Brick>>) -> usize {
    brick.map_or(0, |brick| brick.bytes())
}
