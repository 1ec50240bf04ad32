//! The search for pieces that nothing ties to the deep.
//!
//! From each seed a component of solid samples grows, brick by brick and the lowest brick first. Two things end it early:
//! a brick without any stored one below it, whose solid samples stand on pristine ground all the way down; and a sample
//! that an earlier search reached, which ended early itself. A component that is neither and ends by itself is loose.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::bits::{self, NONE, SIDES, Samples};
use crate::edits::DraftedBrick;
use crate::lattice::{BrickPos, ChunkGrid, LatticeBox};
use crate::volume::pristine_layers;
use crate::volume::{Layers, SampleView};

/// A world as the search sees it.
pub(super) struct Solid<'a> {
    view: SampleView<'a>,
    /// Samples that belong to the world.
    bounds: LatticeBox,
    stacks: &'a FxHashMap<(i32, i32), Vec<i32>>,
    newer: Option<&'a Lowest>,
}

/// The lowest of newer bricks in each stack.
pub(in crate::terrain) type Lowest = FxHashMap<(i32, i32), i32>;

impl<'a> Solid<'a> {
    /// A world with newer bricks over it, of which these are the lowest.
    pub fn new(
        view: SampleView<'a>,
        grid: ChunkGrid,
        stacks: &'a FxHashMap<(i32, i32), Vec<i32>>,
        newer: Option<&'a Lowest>,
    ) -> Self {
        // Pristine ground has no bottom.
        let mut bounds = grid.edit_bounds();
        (bounds.min.y, bounds.max.y) = (i32::MIN, i32::MAX);
        Self { view, bounds, stacks, newer }
    }

    /// Which samples of a brick are solid.
    pub fn layers(&self, pos: BrickPos) -> Layers {
        let layers = match self.view.brick(pos) {
            Some(brick) => *brick.solid(),
            None => pristine_layers(self.view.ground(), pos),
        };
        bits::and(&layers, &bits::within(pos, self.bounds))
    }

    /// Is nothing stored in the brick's stack, from it downwards?
    fn is_bottomless(&self, pos: BrickPos) -> bool {
        let stack = (pos.0.x, pos.0.z);
        let lowest = self.stacks.get(&stack).and_then(|stack| stack.first());
        [lowest, self.newer.and_then(|newer| newer.get(&stack))]
            .iter()
            .flatten()
            .all(|&&lowest| pos.0.y < lowest)
    }
}

/// A set of samples in order of its bricks.
pub(super) type Component = BTreeMap<[i32; 3], Layers>;

/// The order of bricks: the lowest first.
fn key(pos: BrickPos) -> [i32; 3] {
    [pos.0.y, pos.0.z, pos.0.x]
}

/// And back.
pub(super) fn brick([y, z, x]: [i32; 3]) -> BrickPos {
    BrickPos(glam::IVec3::new(x, y, z))
}

/// Every loose component of at most `largest` samples that holds one of the seeds, in order of their seeds.
pub(super) fn search(solid: &Solid, seeds: &Samples, largest: u64) -> Vec<Component> {
    let mut order: Vec<(BrickPos, &Layers)> = seeds.iter().map(|(&pos, layers)| (pos, layers)).collect();
    order.sort_unstable_by_key(|(pos, _)| key(*pos));
    let (mut seen, mut found) = (Samples::default(), Vec::new());
    let mut growth = Growth::default();
    for (pos, seeds) in order {
        let seeds = bits::and(seeds, &solid.layers(pos));
        loop {
            let rest = bits::without(&seeds, seen.get(&pos).unwrap_or(&NONE));
            if rest == NONE {
                break;
            }
            let is_loose = growth.grow(solid, &seen, pos, &bits::first(&rest), largest);
            for (pos, layers) in &growth.reached {
                bits::include(&mut seen, *pos, layers);
            }
            if is_loose {
                found.push(growth.reached.iter().map(|(&pos, layers)| (key(pos), *layers)).collect());
            }
        }
    }
    found
}

/// One component in the making.
#[derive(Default)]
struct Growth {
    reached: Samples,
    /// Samples to go on from, by brick.
    waiting: BTreeMap<[i32; 3], Layers>,
}

impl Growth {
    /// Grows from a seed; says whether it ended by itself.
    fn grow(&mut self, solid: &Solid, seen: &Samples, at: BrickPos, seed: &Layers, largest: u64) -> bool {
        self.reached.clear();
        self.waiting.clear();
        self.waiting.insert(key(at), *seed);
        let mut voxels = 0;
        while let Some((next, from)) = self.waiting.pop_first() {
            let pos = brick(next);
            let layers = solid.layers(pos);
            let before = self.reached.get(&pos).copied().unwrap_or(NONE);
            let from = bits::without(&bits::and(&from, &layers), &before);
            if from == NONE {
                continue;
            }
            let fresh = bits::without(&bits::flood(&from, &layers), &before);
            bits::include(&mut self.reached, pos, &fresh);
            voxels += bits::count(&fresh);
            let met = seen.get(&pos).is_some_and(|seen| bits::and(seen, &fresh) != NONE);
            if met || voxels > largest || solid.is_bottomless(pos) {
                return false;
            }
            for side in SIDES {
                let (beside, beyond) = (BrickPos(pos.0 + side), bits::beyond(&fresh, side));
                if beyond == NONE {
                    continue;
                }
                if seen.get(&beside).is_some_and(|seen| bits::and(seen, &beyond) != NONE) {
                    return false;
                }
                let waiting = self.waiting.entry(key(beside)).or_insert(NONE);
                *waiting = bits::or(waiting, &beyond);
            }
        }
        true
    }
}

/// Samples next to those that drafted bricks turned from solid to air; `before` is the world without them.
pub(super) fn seeds(before: &Solid, drafted: &[DraftedBrick]) -> Samples {
    let mut gone = Samples::default();
    for own in drafted {
        let was = before.layers(own.pos);
        bits::include(&mut gone, own.pos, &bits::without(&was, own.brick.solid()));
    }
    bits::grown_set(&gone)
}
