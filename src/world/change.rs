//! The content that a commit replaces in the world.

use std::hash::Hash;

use rustc_hash::FxHashMap;

use super::patch::Patch;
use super::state::World;
use crate::lattice::{BrickPos, ChunkPos};
use crate::volume::Brick;

/// Parts of a world at one revision: bricks, fields, words of the mask. Everything else is unchanged or made from
/// these.
#[derive(Clone, Default)]
pub(crate) struct Change {
    /// Bricks and fields.
    pub patch: Patch,
    /// Words of the mask.
    pub mask: Vec<((i32, i32), u64)>,
    /// Hash of all samples of the world.
    pub sample_hash: u64,
}

impl Change {
    /// Swaps these parts with those of the world; a second swap restores it.
    pub fn swap(&mut self, world: &mut World) {
        self.patch.swap(world);
        for (word, cells) in &mut self.mask {
            *cells = world.mask.replace_word(*word, *cells);
        }
        std::mem::swap(&mut self.sample_hash, &mut world.sample_hash);
    }

    /// Adds what a later change replaced first, so that swapping restores the state before both, and returns what is
    /// not added; `reached` has the positions of this one. Takes as long as the later change is large. The lists are
    /// [sorted](Self::sort) no more.
    pub fn absorb(&mut self, reached: &mut Reached, later: Self) -> Patch {
        add_new(&mut self.mask, &mut reached.words, later.mask);
        let Patch { bricks, fields, next_field } = later.patch;
        self.patch.next_field = self.patch.next_field.max(next_field);
        Patch {
            bricks: add_new(&mut self.patch.bricks, &mut reached.bricks, bricks),
            fields: add_new(&mut self.patch.fields, &mut reached.chunks, fields),
            next_field,
        }
    }

    /// Sorts its lists by positions.
    pub fn sort(&mut self) {
        self.patch.bricks.sort_unstable_by_key(|own| own.0);
        self.patch.fields.sort_unstable_by_key(|own| own.0);
        self.mask.sort_unstable_by_key(|own| own.0);
    }

    /// Releases the room that its lists do not need.
    pub fn shrink(&mut self) {
        self.patch.bricks.shrink_to_fit();
        self.patch.fields.shrink_to_fit();
        self.mask.shrink_to_fit();
    }

    /// Bytes of the fields in its lists.
    pub fn field_bytes(&self) -> usize {
        self.patch.field_bytes()
    }

    /// Bytes of the lists; bricks and fields come on top.
    pub fn list_bytes(&self) -> usize {
        self.patch.list_bytes() + size_of_val(&self.mask[..])
    }
}

/// The positions at which a change holds something.
pub(crate) struct Reached {
    bricks: FxHashMap<BrickPos, ()>,
    chunks: FxHashMap<ChunkPos, ()>,
    words: FxHashMap<(i32, i32), ()>,
}

impl Reached {
    /// The positions of a change.
    pub fn of(change: &Change) -> Self {
        Self {
            bricks: change.patch.bricks.iter().map(|own| (own.0, ())).collect(),
            chunks: change.patch.fields.iter().map(|own| (own.0, ())).collect(),
            words: change.mask.iter().map(|own| (own.0, ())).collect(),
        }
    }
}

/// Adds to a list what another one has at new positions; returns the rest.
fn add_new<K: Copy + Eq + Hash, V>(
    list: &mut Vec<(K, V)>,
    reached: &mut FxHashMap<K, ()>,
    later: Vec<(K, V)>,
) -> Vec<(K, V)> {
    let (new, rest): (Vec<_>, Vec<_>) =
        later.into_iter().partition(|own| reached.insert(own.0, ()).is_none());
    list.extend(new);
    rest
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
