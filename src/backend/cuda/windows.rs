//! The bricks around blocks, as tables that kernels look them up in.
//!
//! Blocks are put together by regions of some bricks a side. A region's window is the box around its bricks and one more
//! on each side: so bricks that lie close together share their neighbours, and each is looked up once.

use glam::IVec3;
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::lattice::BrickPos;
use crate::surface::block::Block;

/// Bricks along a region's side, as a power of two.
const REGION: i32 = 2;

/// From how many regions on their windows are filled side by side.
const LONG: usize = 16;

/// Where a block's own brick is in the tables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// Its number.
    pub number: u32,
    /// Entries to the next brick along x and along z; along y it is 1.
    pub strides: [u16; 2],
}

/// A box of bricks.
#[derive(Clone, Copy, Debug)]
struct Window {
    low: IVec3,
    high: IVec3,
    /// Entries of all windows before it.
    first: u32,
}

impl Window {
    fn size(&self) -> IVec3 {
        self.high - self.low + 1
    }

    fn len(&self) -> usize {
        let size = self.size();
        (size.x * size.y * size.z) as usize
    }

    fn entry(&self, brick: BrickPos) -> Entry {
        let (size, at) = (self.size(), brick.0 - self.low);
        let number = self.first + ((at.x * size.z + at.z) * size.y + at.y) as u32;
        Entry { number, strides: [(size.z * size.y) as u16, size.y as u16] }
    }

    /// Its bricks, in order of their entries.
    fn bricks(self) -> impl Iterator<Item = BrickPos> {
        let (low, high) = (self.low, self.high);
        (low.x..=high.x).flat_map(move |x| {
            (low.z..=high.z).flat_map(move |z| (low.y..=high.y).map(move |y| BrickPos(IVec3::new(x, y, z))))
        })
    }
}

/// The windows of many blocks.
pub(super) struct Windows {
    windows: Vec<Window>,
    /// For each block, its window.
    of: Vec<u32>,
    len: usize,
}

impl Windows {
    /// Windows around blocks.
    pub fn around(blocks: &[Block]) -> Self {
        let mut regions: FxHashMap<IVec3, u32> = FxHashMap::default();
        let mut windows: Vec<Window> = Vec::new();
        // Blocks come by stacks, so most lie in the region of the one before.
        let mut last = None;
        let find = |block: &Block| {
            let (brick, region) = (block.brick.0, block.brick.0 >> REGION);
            let number = match last {
                Some((same, number)) if same == region => number,
                _ => *regions.entry(region).or_insert_with(|| {
                    windows.push(Window { low: brick - 1, high: brick + 1, first: 0 });
                    windows.len() as u32 - 1
                }),
            };
            last = Some((region, number));
            let window = &mut windows[number as usize];
            (window.low, window.high) = (window.low.min(brick - 1), window.high.max(brick + 1));
            number
        };
        let of = blocks.iter().map(find).collect();
        let mut len = 0;
        for window in &mut windows {
            window.first = len as u32;
            len += window.len();
        }
        Self { windows, of, len }
    }

    /// Entries of all windows.
    pub fn len(&self) -> usize {
        self.len
    }

    /// The entry of the brick of a block, by the block's number.
    pub fn entry(&self, block: usize, brick: BrickPos) -> Entry {
        self.windows[self.of[block] as usize].entry(brick)
    }

    /// Writes what `find` says of each brick to its entry; returns what it gave besides, with the entry's number.
    pub fn fill<T: Send>(
        &self,
        out: &mut [u32],
        find: impl Fn(BrickPos) -> (u32, Option<T>) + Sync,
    ) -> Vec<(u32, T)> {
        let mut slices = Vec::with_capacity(self.windows.len());
        let mut rest = out;
        for window in &self.windows {
            let (own, others) = rest.split_at_mut(window.len());
            slices.push((window, own));
            rest = others;
        }
        let fill = |(window, own): (&Window, &mut [u32])| {
            let mut besides = Vec::new();
            for ((number, entry), brick) in (window.first..).zip(own).zip(window.bricks()) {
                let found = find(brick);
                *entry = found.0;
                besides.extend(found.1.map(|other| (number, other)));
            }
            besides
        };
        if slices.len() < LONG {
            slices.into_iter().flat_map(fill).collect()
        } else {
            slices.into_par_iter().flat_map_iter(fill).collect()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lattice::ChunkPos;

    #[test]
    fn every_neighbour_of_a_block_has_its_entry() {
        let chunk = ChunkPos { x: 0, y: 0, z: 0 };
        let mut rng = fastrand::Rng::with_seed(7);
        let brick = |rng: &mut fastrand::Rng| IVec3::new(rng.i32(-9..9), rng.i32(-9..9), rng.i32(-9..9));
        let blocks: Vec<Block> = (0..60).map(|_| Block { brick: BrickPos(brick(&mut rng)), chunk }).collect();
        let windows = Windows::around(&blocks);
        let code =
            |brick: BrickPos| (brick.0.x + 20 + (brick.0.y + 20) * 40 + (brick.0.z + 20) * 1600) as u32;
        let mut entries = vec![0; windows.len()];
        let odd = windows.fill(&mut entries, |brick| (code(brick), (brick.0.x % 2 != 0).then_some(brick)));
        for (number, block) in blocks.iter().enumerate() {
            let entry = windows.entry(number, block.brick);
            for step in (0..27).map(|i| IVec3::new(i % 3 - 1, i / 9 - 1, i / 3 % 3 - 1)) {
                let at = entry.number as i32
                    + step.x * i32::from(entry.strides[0])
                    + step.z * i32::from(entry.strides[1])
                    + step.y;
                assert_eq!(entries[at as usize], code(BrickPos(block.brick.0 + step)));
            }
        }
        assert!(
            odd.iter().all(|&(number, brick)| entries[number as usize] == code(brick)) && !odd.is_empty()
        );
    }
}
