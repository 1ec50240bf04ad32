//! The memory that a world takes.

use super::state::World;
use crate::lattice::table_bytes;
use crate::volume::{Brick, Fields};

/// Bytes that a world takes, Bevy's meshes not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Memory {
    /// Heights and material control.
    pub ground: usize,
    /// Samples of bricks, with their bits; uniform bricks of one kind count once.
    pub samples: usize,
    /// Materials of bricks.
    pub materials: usize,
    /// Meshes of the chunks that changed last, from whose unchanged parts the next ones are copied: at most 64 MiB, or
    /// one chunk. Besides, room for the next transaction is kept, which belongs to no world: some 3 MiB for each thread
    /// that meshes, up to 8 of them.
    pub meshes: usize,
    /// Where parts are in meshes, and rings of tiles.
    pub parts: usize,
    /// Mask, fields and where bricks are.
    pub index: usize,
    /// Undo history that is not shared with the world. Always 0 for a world, since history belongs to its terrain.
    pub undo: usize,
}

impl Memory {
    /// All of it.
    pub fn total(&self) -> usize {
        self.ground + self.edits() + self.undo
    }

    /// Memory of edits: everything except the ground and history.
    pub fn edits(&self) -> usize {
        self.samples + self.materials + self.meshes + self.parts + self.index
    }
}

impl World {
    /// Bytes that the world takes.
    pub fn memory(&self) -> Memory {
        let mut memory =
            Memory { ground: self.ground.bytes(), index: self.mask.bytes(), ..Memory::default() };
        // Uniform bricks of one kind are one brick.
        let single = self.bricks.values().filter(|brick| brick.uniform().is_none());
        for brick in single.chain(self.uniform.values()) {
            memory.samples += Brick::BYTES;
            memory.materials += brick.bytes() - Brick::BYTES;
        }
        for surface in self.meshes.surfaces.surfaces() {
            let (mesh, parts) = surface.bytes();
            memory.meshes += mesh;
            memory.parts += parts;
        }
        memory.parts += self.meshes.rings.values().map(|rings| rings.bytes()).sum::<usize>();
        memory.index +=
            table_bytes(&self.bricks) + self.meshes.surfaces.table_bytes() + table_bytes(&self.meshes.rings);
        memory.index += table_bytes(&self.fields) + table_bytes(&self.stacks) + table_bytes(&self.uniform);
        memory.index += table_bytes(&self.meshes.unmeshed) + self.edited_nodes.bytes();
        memory.index += self.fields.values().map(Fields::bytes).sum::<usize>();
        memory.index += self.stacks.values().map(|stack| stack.capacity() * size_of::<i32>()).sum::<usize>();
        memory
    }
}
