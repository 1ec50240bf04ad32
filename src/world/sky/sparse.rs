//! The light of columns that lie apart, or of a few places.

use rustc_hash::FxHashMap;

use super::SkyView;
use super::air::AirMemory;
use super::horizon::{FAR, Step, below, capped, light_of, slope};
use super::light::{AirLight, REACH, SkyLights};
use super::tops::StackTops;
use crate::lattice::Column;

/// Columns whose tops are found when they are asked for.
pub(crate) struct SparseSky<'a> {
    view: SkyView<'a>,
    stacks: FxHashMap<(i32, i32), Option<Box<StackTops>>>,
    heights: FxHashMap<Column, i32>,
    lights: FxHashMap<Column, u8>,
    known: AirMemory<Option<AirLight>>,
}

impl<'a> SparseSky<'a> {
    /// Nothing is known yet.
    pub fn new(view: SkyView<'a>) -> Self {
        let (stacks, heights) = (FxHashMap::default(), FxHashMap::default());
        Self { view, stacks, heights, lights: FxHashMap::default(), known: AirMemory::new(4) }
    }

    /// Finds the light on the tops of a grid of columns a stride apart together, but for those near edits.
    pub fn with_grid(mut self, low: Column, high: Column, stride: i32) -> Self {
        let count = |low: i32, high: i32| ((high - low).max(0) as usize).div_ceil(stride as usize) + 1;
        let counts @ [across, down] = [count(low.x, high.x), count(low.z, high.z)];
        let ground = self.view.ground();
        let own = ground.page_heights(low, stride, counts);
        let mut hidden = vec![0u16; own.len()];
        for direction in &FAR {
            let mut horizons = vec![0i16; own.len()];
            for &Step { dx, dz, factor, .. } in direction {
                let others = ground.page_heights(low.offset(dx, dz), stride, counts);
                for ((horizon, top), &y) in horizons.iter_mut().zip(others).zip(&own) {
                    *horizon = (*horizon).max(slope(top, y, factor));
                }
            }
            hidden.iter_mut().zip(horizons).for_each(|(sum, horizon)| *sum += below(capped(horizon)));
        }
        let mut is_near = vec![false; own.len()];
        let stack = |column: Column| (column.x >> 3, column.z >> 3);
        let by = REACH + 8;
        for (x, z) in self.view.stacks_within(stack(low.offset(-by, -by)), stack(high.offset(by, by))) {
            let along = |at: i32, low: i32, count: usize| {
                let (from, to) = (at * 8 - REACH - low, at * 8 + 7 + REACH - low);
                (from.div_euclid(stride).max(0) as usize)
                    ..((to.div_euclid(stride) + 2).max(0) as usize).min(count)
            };
            for row in along(z, low.z, down) {
                for column in along(x, low.x, across) {
                    is_near[row * across + column] = true;
                }
            }
        }
        for (at, &hidden) in hidden.iter().enumerate() {
            let column = low.offset((at % across) as i32 * stride, (at / across) as i32 * stride);
            // Beyond the rim a node ends nearer, and its last columns are others.
            if !is_near[at] && column.x <= high.x && column.z <= high.z {
                self.lights.insert(column, light_of(hidden));
                self.heights.insert(column, own[at]);
            }
        }
        self
    }

    fn stack(&mut self, column: Column) -> Option<&StackTops> {
        let (key, view) = ((column.x >> 3, column.z >> 3), self.view);
        self.stacks.entry(key).or_insert_with(|| view.with_tops(key, |tops| Box::new(*tops))).as_deref()
    }
}

impl SkyLights for SparseSky<'_> {
    fn view(&self) -> SkyView<'_> {
        self.view
    }

    fn top(&mut self, column: Column) -> i32 {
        let column = self.view.clamped(column);
        if let Some(stack) = self.stack(column) {
            return stack.tops[((column.z & 7) * 8 + (column.x & 7)) as usize];
        }
        let view = self.view;
        *self.heights.entry(column).or_insert_with(|| view.ground().lone_height(column))
    }

    fn is_changed(&mut self, column: Column) -> bool {
        let column = self.view.clamped(column);
        let bit = (column.z & 7) * 8 + (column.x & 7);
        self.stack(column).is_some_and(|stack| stack.changed >> bit & 1 == 1)
    }

    fn top_light(&mut self, column: Column) -> u8 {
        if let Some(&known) = self.lights.get(&column) {
            return known;
        }
        let y = self.top(column);
        let light = self.open_light(column, y);
        self.lights.insert(column, light);
        light
    }

    fn known(&mut self) -> &mut AirMemory<Option<AirLight>> {
        &mut self.known
    }
}
