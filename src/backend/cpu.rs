//! The CPU backend. It uses all threads of the current rayon pool for larger stages.

use std::cell::RefCell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::{Compute, lock};
use crate::edits::{EditDelta, PreparedEdits};
use crate::lattice::ItemCost;
use crate::surface::block::{Block, Mesher, Parts};
use crate::surface::meshed_blocks::{Group, MeshedBlocks, PartLists};
use crate::surface::vertex::WorldView;

/// Number of stacks of bricks that a thread takes at a time.
const STACKS: usize = 4;

/// About how many vertices a list has room for that several threads make.
const LIST: usize = 1 << 13;

/// The maximum number of lists whose memory is kept for the next large transaction, for each thread; and for how many
/// threads at least and at most. A list takes some 400 KB, and none that is kept takes more than 1.2 MB.
const KEPT_LISTS: usize = 8;
const FEW_THREADS: usize = 4;
const MANY_THREADS: usize = 8;

thread_local! {
    /// Working memory of the mesher, and parts that wait for assembly.
    static MESHER: RefCell<(Mesher, Parts)> = RefCell::default();
}

/// Memory for parts that several threads make.
static KEPT: Mutex<Vec<Parts>> = Mutex::new(Vec::new());

/// The CPU.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Cpu;

impl Compute for Cpu {
    fn edit(&self, work: &PreparedEdits, each: &mut dyn FnMut(&mut [EditDelta])) {
        work.run(each);
    }

    fn mesh(
        &self,
        view: &WorldView,
        blocks: &[Block],
        overlap: &(dyn Fn() + Sync),
        on_done: &mut dyn FnMut(&dyn MeshedBlocks),
    ) {
        overlap();
        if !ItemCost::Brick.is_shared(blocks.len()) {
            let mut parts = MESHER.with_borrow_mut(|(_, kept)| std::mem::take(kept));
            mesh(view, blocks, &mut parts);
            on_done(&parts);
            parts.clear();
            MESHER.with_borrow_mut(|(_, kept)| *kept = parts);
            return;
        }
        let lists = Lists::default();
        let group = |blocks: &&[Block]| {
            let (list, mut parts) = lists.take();
            let group = Group { count: blocks.len(), list, first: parts.list.len() };
            mesh(view, blocks, &mut parts);
            lists.put(list, parts);
            group
        };
        let groups: Vec<Group> = groups(blocks).par_iter().with_max_len(1).map(group).collect();
        let lists = lists.all();
        on_done(&PartLists::new(&lists, &groups));
        keep(lists);
    }
}

/// Meshes blocks on this thread.
fn mesh(view: &WorldView, blocks: &[Block], parts: &mut Parts) {
    MESHER.with_borrow_mut(|(mesher, _)| mesher.mesh(view, blocks, parts));
}

/// Lists of parts that threads add to, until they are full. Each is in the hands of one thread at a time.
#[derive(Default)]
struct Lists {
    count: AtomicUsize,
    /// Lists with room that no thread uses, with their numbers.
    open: Mutex<Vec<(usize, Parts)>>,
    full: Mutex<Vec<(usize, Parts)>>,
}

impl Lists {
    /// Takes a list with room, and its number.
    fn take(&self) -> (usize, Parts) {
        let open = lock(&self.open).pop();
        open.unwrap_or_else(|| {
            let kept = lock(&KEPT).pop();
            (self.count.fetch_add(1, Ordering::Relaxed), kept.unwrap_or_else(|| Parts::with_room(LIST)))
        })
    }

    /// Takes a list back.
    fn put(&self, number: usize, parts: Parts) {
        let is_full = parts.vertices.len() > LIST / 4 * 3 || parts.list.len() > LIST;
        lock(if is_full { &self.full } else { &self.open }).push((number, parts));
    }

    /// All lists, by number.
    fn all(self) -> Vec<Parts> {
        let [mut all, full] =
            [self.open, self.full].map(|lists| lists.into_inner().unwrap_or_else(PoisonError::into_inner));
        all.extend(full);
        all.sort_unstable_by_key(|&(number, _)| number);
        all.into_iter().map(|(_, parts)| parts).collect()
    }
}

/// Keeps lists for the next transaction, unless they are many or large.
fn keep(mut lists: Vec<Parts>) {
    lists.iter_mut().for_each(Parts::clear);
    lists.retain(|Parts { list, vertices, indices }| {
        list.capacity().max(vertices.capacity()) <= 2 * LIST && indices.capacity() <= 12 * LIST
    });
    let most = KEPT_LISTS * rayon::current_num_threads().clamp(FEW_THREADS, MANY_THREADS);
    let mut kept = lock(&KEPT);
    lists.truncate(most.saturating_sub(kept.len()));
    kept.append(&mut lists);
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
