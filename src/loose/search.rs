//! The search for pieces that are not anchored.
//!
//! From each seed a component of solid samples grows, brick by brick and the lowest brick first. Two things end it
//! early: a brick without any stored one below it, whose solid samples stand on pristine ground all the way down; and a
//! sample that an earlier search reached, which ended early itself. A component whose growth ends without either is
//! loose.
//!
//! Seeds are taken lowest brick first, and so are the bricks of a component. So it depends on the world alone what a
//! search had reached when its budget ran out.

use std::collections::BTreeMap;

use super::LooseSettings;
use super::bits::{self, SIDES, Samples};
use crate::edits::{DraftedBrick, Overlay};
use crate::lattice::{BrickPos, LatticeBox};
use crate::volume::layers::{self, Layers, NONE};
use crate::volume::{SampleView, pristine_layers};
use crate::world::World;

/// A world as the search sees it.
pub(super) struct Solid<'a> {
    world: &'a World,
    view: SampleView<'a>,
    /// Bricks of the view that are newer than the world.
    newer: Option<&'a Overlay>,
    /// Samples that belong to the world.
    bounds: LatticeBox,
}

impl<'a> Solid<'a> {
    /// A view of a world.
    pub fn new(world: &'a World, view: SampleView<'a>, newer: Option<&'a Overlay>) -> Self {
        // Pristine ground has no bottom.
        let mut bounds = world.grid.edit_bounds();
        (bounds.min.y, bounds.max.y) = (i32::MIN, i32::MAX);
        Self { world, view, newer, bounds }
    }

    /// Which samples of a brick are solid.
    pub fn layers(&self, pos: BrickPos) -> Layers {
        let layers = match self.view.brick(pos) {
            Some(brick) => *brick.solid(),
            None => pristine_layers(self.view.ground(), pos),
        };
        layers::and(&layers, &layers::within(pos, self.bounds))
    }

    /// Whether nothing is stored in the brick's stack from this brick downwards.
    fn is_bottomless(&self, pos: BrickPos) -> bool {
        let stored = self.world.stacks.get(&pos.stack()).and_then(|stack| stack.first().copied());
        let newer = self.newer.and_then(|newer| newer.lowest(pos.stack()));
        stored.into_iter().chain(newer).all(|lowest| pos.0.y < lowest)
    }
}

/// A set of samples, by the [layer order](BrickPos::layer_order) of its bricks: the lowest first.
pub(super) type Component = BTreeMap<[i32; 3], Layers>;

/// The bricks of a component with their samples, the lowest first.
pub(super) fn bricks(component: &Component) -> impl Iterator<Item = (BrickPos, &Layers)> {
    component.iter().map(|(&place, layers)| (BrickPos::from_layer_order(place), layers))
}

/// The remaining budget of a search.
pub(super) struct Budget {
    /// Bricks that it may visit. One that is reached again later counts again.
    bricks: u64,
    /// Voxels of the pieces that it finds.
    voxels: u64,
    /// Whether something was left out.
    pub has_run_out: bool,
}

impl Budget {
    /// For queries, where the caller chooses the box.
    pub fn unbounded() -> Self {
        Self { bricks: u64::MAX, voxels: u64::MAX, has_run_out: false }
    }

    /// The budget of a search after an edit that changed `changed` bricks: see [`LooseSettings`].
    pub fn of_edit(settings: &LooseSettings, changed: usize) -> Self {
        let largest = u64::from(settings.largest);
        let bricks = (largest / 8).max(4096) + 16 * changed as u64;
        Self { bricks, voxels: (4 * largest).max(1 << 17), has_run_out: false }
    }

    /// Whether there was some left of it.
    fn visit_brick(&mut self) -> bool {
        take(&mut self.bricks, 1, &mut self.has_run_out)
    }

    fn find(&mut self, voxels: u64) -> bool {
        take(&mut self.voxels, voxels, &mut self.has_run_out)
    }
}

/// Subtracts `some` from `left`, or sets `has_run_out` if less is left.
fn take(left: &mut u64, some: u64, has_run_out: &mut bool) -> bool {
    let rest = left.checked_sub(some);
    *has_run_out |= rest.is_none();
    *left = rest.unwrap_or(*left);
    rest.is_some()
}

/// Every loose component of at most `largest` samples that holds one of the seeds, in order of their seeds, as far as
/// the budget goes.
pub(super) fn search(solid: &Solid, seeds: &Samples, largest: u64, budget: &mut Budget) -> Vec<Component> {
    let mut order: Vec<(BrickPos, &Layers)> = seeds.iter().map(|(&pos, layers)| (pos, layers)).collect();
    order.sort_unstable_by_key(|(pos, _)| pos.layer_order());
    let (mut seen, mut found) = (Samples::default(), Vec::new());
    let mut growth = Growth::default();
    for (pos, seeds) in order {
        let seeds = layers::and(seeds, &solid.layers(pos));
        loop {
            let rest = layers::without(&seeds, seen.get(&pos).unwrap_or(&NONE));
            if rest == NONE {
                break;
            }
            if budget.bricks == 0 {
                budget.has_run_out = true;
                return found;
            }
            let voxels = growth.grow(solid, &seen, (pos, &bits::first(&rest)), largest, budget);
            for (pos, layers) in &growth.reached {
                bits::include(&mut seen, *pos, layers);
            }
            if voxels.is_some_and(|voxels| budget.find(voxels)) {
                found
                    .push(growth.reached.iter().map(|(&pos, layers)| (pos.layer_order(), *layers)).collect());
            }
        }
    }
    found
}

/// A component that is growing.
#[derive(Default)]
struct Growth {
    reached: Samples,
    /// Samples from which growth continues, by brick.
    waiting: BTreeMap<[i32; 3], Layers>,
}

impl Growth {
    /// Grows from a seed. Returns the number of voxels, or `None` if the growth was ended early.
    fn grow(
        &mut self,
        solid: &Solid,
        seen: &Samples,
        (at, seed): (BrickPos, &Layers),
        largest: u64,
        budget: &mut Budget,
    ) -> Option<u64> {
        self.reached.clear();
        self.waiting.clear();
        self.waiting.insert(at.layer_order(), *seed);
        let mut voxels = 0;
        while let Some((next, from)) = self.waiting.pop_first() {
            if !budget.visit_brick() {
                return None;
            }
            let pos = BrickPos::from_layer_order(next);
            let layers = solid.layers(pos);
            let before = self.reached.get(&pos).copied().unwrap_or(NONE);
            let from = layers::without(&layers::and(&from, &layers), &before);
            if from == NONE {
                continue;
            }
            let fresh = layers::without(&bits::flood(&from, &layers), &before);
            bits::include(&mut self.reached, pos, &fresh);
            voxels += layers::count(&fresh);
            let met = seen.get(&pos).is_some_and(|seen| layers::and(seen, &fresh) != NONE);
            if met || voxels > largest || solid.is_bottomless(pos) {
                return None;
            }
            for side in SIDES {
                let (beside, beyond) = (BrickPos(pos.0 + side), bits::beyond(&fresh, side));
                if beyond == NONE {
                    continue;
                }
                if seen.get(&beside).is_some_and(|seen| layers::and(seen, &beyond) != NONE) {
                    return None;
                }
                let waiting = self.waiting.entry(beside.layer_order()).or_insert(NONE);
                *waiting = layers::or(waiting, &beyond);
            }
        }
        Some(voxels)
    }
}

/// Samples next to those that drafted bricks turned from solid to air; `before` is the world without them.
pub(super) fn seeds(before: &Solid, drafted: &[DraftedBrick]) -> Samples {
    let mut gone = Samples::default();
    for own in drafted {
        let was = before.layers(own.pos);
        bits::include(&mut gone, own.pos, &layers::without(&was, own.brick.solid()));
    }
    bits::grown_set(&gone)
}
