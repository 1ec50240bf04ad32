//! The content that a commit replaces in the world.

use super::patch::{Patch, fill_in};
use super::state::World;
use crate::lattice::BrickPos;
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

    /// Adds what a later change replaced first, so that swapping restores the state before both. Returns what is not
    /// added.
    pub fn absorb(&mut self, later: Self) -> Patch {
        // The words of a mask come in no order.
        self.mask.sort_unstable_by_key(|own| own.0);
        fill_in(&mut self.mask, later.mask);
        self.patch.fill_in(later.patch)
    }

    /// Bytes of the lists, and of the fields in them; bricks come on top.
    pub fn bytes(&self) -> usize {
        self.patch.bytes() + self.mask.capacity() * size_of::<((i32, i32), u64)>()
    }
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
