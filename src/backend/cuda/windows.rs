//! The bricks around other bricks, as tables that kernels look them up in.
//!
//! Bricks that lie close together share a window, a box of bricks around them: so each is looked up once.

use glam::IVec3;

use crate::lattice::{BrickPos, LatticeBox};
use crate::surface::window::{Window, shared};
use crate::volume::{Brick, SampleView};

use super::layout::NONE;
use super::mail::map;

/// From how many windows on they are filled side by side.
const LONG: usize = 8;

/// Where a brick is in the tables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Its number.
    pub number: u32,
    /// Entries to the next brick along x, and `<< 16` along z; along y it is 1.
    pub strides: u32,
}

/// The windows of many bricks.
pub(super) struct Windows<'a> {
    /// Each with the entries of all windows before it.
    windows: Vec<(Window<'a>, u32)>,
    /// For each brick that was asked for, its window.
    of: Vec<u32>,
}

/// References by entry, and the bricks that have none, with their entries.
pub(super) type Refs<'a> = (Vec<u32>, Vec<(u32, &'a Brick)>);

impl<'a> Windows<'a> {
    /// Windows around bricks, sorted by stacks: one brick more to all sides, and so many up and down.
    pub fn around(
        view: SampleView<'a>,
        bricks: impl Iterator<Item = BrickPos> + Clone,
        up_and_down: i32,
    ) -> Self {
        let (mut groups, mut of, mut rest) = (Vec::new(), Vec::new(), bricks);
        let more = IVec3::Y * (up_and_down - 1);
        while let Some((count, places)) = shared(rest.clone()) {
            of.resize(of.len() + count, groups.len() as u32);
            groups.push(LatticeBox { min: places.min - more, max: places.max + more });
            rest.by_ref().take(count).for_each(drop);
        }
        let mut first = 0;
        let numbered = |window: Window<'a>| {
            let own = first;
            first += window.bricks().len() as u32;
            (window, own)
        };
        let windows = map(&groups, LONG, |&places| Window::new(&view, places));
        Self { windows: windows.into_iter().map(numbered).collect(), of }
    }

    /// The entry of a brick that was asked for, by its number among those.
    pub fn entry(&self, number: usize, brick: BrickPos) -> Entry {
        let (window, first) = &self.windows[self.of[number] as usize];
        let [x, _, z] = window.steps();
        Entry { number: first + window.place(brick) as u32, strides: (x | z << 16) as u32 }
    }

    /// What `find` says of each brick; [`NONE`] where none is stored, and where it says nothing.
    pub fn refs(&self, find: impl Fn(&Brick) -> Option<u32> + Send + Sync) -> Refs<'a> {
        let parts = map(&self.windows, LONG, |(window, first)| {
            let mut missing = Vec::new();
            let found = (*first..).zip(window.bricks()).map(|(number, brick)| {
                let Some(brick) = *brick else { return NONE };
                find(brick).unwrap_or_else(|| {
                    missing.push((number, brick));
                    NONE
                })
            });
            (found.collect::<Vec<u32>>(), missing)
        });
        let (found, missing): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        (found.concat(), missing.concat())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Arc;

    use super::*;
    use crate::ground::Ground;
    use crate::volume::Bricks;

    #[test]
    fn every_neighbour_of_a_brick_has_its_entry() {
        let ground = Ground::flat(8, 8, 0.0).unwrap();
        let mut rng = fastrand::Rng::with_seed(7);
        let place = |rng: &mut fastrand::Rng| {
            let [x, y, z] = [rng.i32(-9..9), rng.i32(-9..9), rng.i32(-9..9)];
            (x, z, y)
        };
        let code = |pos: IVec3| (pos.x + 20 + (pos.y + 20) * 40 + (pos.z + 20) * 1600) as u32;
        let pos = |(x, z, y)| BrickPos(IVec3::new(x, y, z));
        let mut stored = Bricks::default();
        for at in (0..3000).map(|_| pos(place(&mut rng))) {
            let brick = Brick::of_edited(&[0; 512]);
            brick.tag.set(code(at.0).into());
            stored.insert(at, Arc::new(brick));
        }
        let asked: BTreeSet<_> = (0..60).map(|_| place(&mut rng)).collect();
        let windows = Windows::around(SampleView::new(&ground, &stored), asked.iter().copied().map(pos), 8);
        let (mut refs, missing) = windows.refs(|brick| {
            let code = brick.tag.get() as u32;
            (!code.is_multiple_of(3)).then_some(code)
        });
        assert!(!missing.is_empty());
        for (entry, brick) in missing {
            assert_eq!(refs[entry as usize], NONE);
            refs[entry as usize] = brick.tag.get() as u32;
        }
        for (number, at) in asked.into_iter().map(pos).enumerate() {
            let entry = windows.entry(number, at);
            let [x, z] = [entry.strides & 0xffff, entry.strides >> 16].map(|stride| stride as i32);
            let around = (0..27).map(|i| IVec3::new(i % 3 - 1, i / 9 - 1, i / 3 % 3 - 1));
            for step in around.chain((-8..=8).map(|up| IVec3::Y * up)) {
                let found = refs[(entry.number as i32 + step.x * x + step.z * z + step.y) as usize];
                let expected = stored.get(&BrickPos(at.0 + step)).map_or(NONE, |_| code(at.0 + step));
                assert_eq!(found, expected, "{at:?} {step}");
            }
        }
    }
}
