//! The processor, with all threads of the current rayon pool where there is enough to do.

use std::cell::RefCell;

use rayon::prelude::*;

use super::Compute;
use crate::surface::block::{Block, Mesher, Parts};
use crate::surface::fresh::{FreshParts, PartLists};
use crate::surface::vertex::WorldView;
use crate::volume::{EditWork, Ledger};

/// From how many blocks on meshing is spread over threads; below, handing out costs more than it saves.
pub(crate) const PARALLEL_BLOCKS: usize = 48;

/// How many stacks of bricks a thread takes at a time.
const STACKS: usize = 4;

/// Most vertices whose memory a thread keeps for its next transaction.
const KEPT_VERTICES: usize = 1 << 16;

thread_local! {
    /// Working memory of the mesher, and parts that wait for assembly.
    static MESHER: RefCell<(Mesher, Parts)> = RefCell::default();
}

/// The processor.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cpu;

impl Compute for Cpu {
    fn edit(&self, work: &EditWork, each: &mut dyn FnMut(Ledger)) {
        work.run(each);
    }

    fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        meanwhile: &(dyn Fn() + Sync),
        then: &mut dyn FnMut(&dyn FreshParts),
    ) {
        meanwhile();
        if blocks.len() >= PARALLEL_BLOCKS {
            // Meshed into memory that is there already, and copied out as large as it has to be.
            let copy = |blocks: &&[Block]| {
                let parts = mesh(view, blocks);
                let copy = parts.clone();
                keep(parts);
                copy
            };
            let parts: Vec<Parts> = groups(blocks).par_iter().with_max_len(1).map(copy).collect();
            then(&PartLists::new(&parts));
            // Freeing many lists takes its time.
            parts.into_par_iter().for_each(drop);
            return;
        }
        let parts = [mesh(view, blocks)];
        then(&PartLists::new(&parts));
        let [parts] = parts;
        keep(parts);
    }
}

/// Meshes blocks on this thread, into memory that [`keep`] should get back.
fn mesh(view: &WorldView, blocks: &[Block]) -> Parts {
    MESHER.with_borrow_mut(|(mesher, parts)| {
        parts.clear();
        mesher.mesh(view, blocks, parts);
        std::mem::take(parts)
    })
}

/// Keeps memory for the next call, unless it is much.
fn keep(parts: Parts) {
    if parts.vertices.capacity() <= KEPT_VERTICES {
        MESHER.with_borrow_mut(|(_, kept)| *kept = parts);
    }
}

/// Blocks in groups of some stacks of bricks.
fn groups(mut blocks: &[Block]) -> Vec<&[Block]> {
    let same_stack = |a: &Block, b: &Block| (a.brick.0.x, a.brick.0.z) == (b.brick.0.x, b.brick.0.z);
    let stacks: Vec<&[Block]> = blocks.chunk_by(same_stack).collect();
    let groups = stacks.chunks(STACKS).map(|stacks| {
        let (group, others) = blocks.split_at(stacks.iter().map(|stack| stack.len()).sum());
        blocks = others;
        group
    });
    groups.collect()
}
