//! The content that a commit replaces in the world.

use std::sync::Arc;

use super::state::World;
use crate::lattice::{BrickPos, ChunkPos};
use crate::volume::{Brick, Fields};

/// A brick by its position; `None` is a pristine one.
pub(crate) type ChangedBrick = (BrickPos, Option<Arc<Brick>>);

/// Parts of a world at one revision: bricks, fields, words of the mask. Everything else is unchanged or made from
/// these.
#[derive(Clone, Default)]
pub(crate) struct Change {
    /// In order; `None` is a pristine brick.
    pub bricks: Vec<ChangedBrick>,
    /// All fields of each chunk that a field changed in.
    pub fields: Vec<(ChunkPos, Fields)>,
    /// Words of the mask.
    pub mask: Vec<((i32, i32), u64)>,
    /// Hash of all samples of the world.
    pub sample_hash: u64,
}

impl Change {
    /// Swaps these parts with those of the world; a second swap restores it.
    pub fn swap(&mut self, world: &mut World) {
        for (pos, brick) in &mut self.bricks {
            let (key, y) = (pos.stack(), pos.0.y);
            let is_there = brick.is_some();
            let before = match brick.take() {
                Some(brick) => world.bricks.insert(*pos, brick),
                None => world.bricks.remove(pos),
            };
            if is_there != before.is_some() {
                let stack = world.stacks.entry(key).or_default();
                match (stack.binary_search(&y), is_there) {
                    (Err(at), true) => stack.insert(at, y),
                    (Ok(at), false) => drop(stack.remove(at)),
                    _ => {}
                }
                if stack.is_empty() {
                    world.stacks.remove(&key);
                }
            }
            *brick = before;
        }
        for (chunk, fields) in &mut self.fields {
            let now = std::mem::take(fields);
            let before =
                if now.is_empty() { world.fields.remove(chunk) } else { world.fields.insert(*chunk, now) };
            *fields = before.unwrap_or_default();
        }
        for (word, cells) in &mut self.mask {
            *cells = world.mask.replace_word(*word, *cells);
        }
        std::mem::swap(&mut self.sample_hash, &mut world.sample_hash);
    }

    /// Adds what a later change replaced first, so that swapping restores the state before both. Returns the bytes of
    /// the bricks that are added, and the bricks that are not.
    pub fn absorb(&mut self, later: Self) -> (usize, Vec<ChangedBrick>) {
        let bytes = |brick: &Option<Arc<Brick>>| brick.iter().map(|brick| brick_bytes(brick)).sum();
        let (bytes, left) = fill_in(&mut self.bricks, later.bricks, bytes);
        fill_in(&mut self.fields, later.fields, |_| 0);
        // The words of a mask come in no order.
        self.mask.sort_unstable_by_key(|own| own.0);
        fill_in(&mut self.mask, later.mask, |_| 0);
        (bytes, left)
    }

    /// Bytes of the lists, and of the fields in them; bricks come on top.
    pub fn bytes(&self) -> usize {
        self.bricks.capacity() * size_of::<(BrickPos, Option<Arc<Brick>>)>()
            + self.fields.capacity() * size_of::<(ChunkPos, Fields)>()
            + self.fields.iter().map(|(_, fields)| fields.bytes()).sum::<usize>()
            + self.mask.capacity() * size_of::<((i32, i32), u64)>()
    }
}

/// Adds to a sorted list what another one has at other places. Returns the sum of the `bytes` of what it adds, and what
/// it does not add.
fn fill_in<K: Copy + Ord, V>(
    list: &mut Vec<(K, V)>,
    other: Vec<(K, V)>,
    bytes: impl Fn(&V) -> usize,
) -> (usize, Vec<(K, V)>) {
    let before = list.len();
    let is_new = |(key, _): &(K, V)| list.binary_search_by_key(key, |own| own.0).is_err();
    let (mut new, left): (Vec<_>, Vec<_>) = other.into_iter().partition(is_new);
    // Exactly: capacity counts as history's bytes.
    list.reserve_exact(new.len());
    list.append(&mut new);
    let added = list[before..].iter().map(|(_, value)| bytes(value)).sum();
    list.sort_by_key(|own| own.0);
    (added, left)
}

/// Bytes of the brick that a world holds there, if it holds one. Uniform bricks count nothing: the world keeps the one
/// of their kind for as long as history has it.
pub(crate) fn replaced_bytes(world: &World, pos: BrickPos) -> usize {
    world.bricks.get(&pos).map_or(0, |brick| brick_bytes(brick))
}

/// Bytes of a brick with the counters of its `Arc`; 0 for a uniform one.
pub(crate) fn brick_bytes(brick: &Brick) -> usize {
    if brick.uniform().is_some() { 0 } else { 2 * size_of::<usize>() + brick.bytes() }
}
