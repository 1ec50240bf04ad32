//! Tables of neighbouring bricks for kernels.
//!
//! Bricks that are close together share a window, a box of bricks around them, so that each is looked up once. Long
//! lists are split into slabs, whose windows are built in parallel. Bricks of different slabs share no window.

use glam::IVec3;

use super::device::Fault;
use super::layout::NONE;
use super::lists::{cut, for_each_parallel, map_into};
use crate::lattice::{BrickPos, LatticeBox};
use crate::surface::brick_window::{Window, shared};
use crate::volume::{Brick, SampleView};

/// From this many bricks on, lists are split into slabs.
const LONG: usize = 256;

/// Target number of slabs, enough to balance the load of threads.
const SLABS: usize = 64;

/// Minimum and maximum bricks of a slab: too few share few windows, too many keep other threads waiting. The
/// minimum is divided by the height of the windows.
const OF_A_SLAB: [usize; 2] = [128, 1024];

/// The position of a brick in the tables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// The brick's index in the table.
    pub number: u32,
    /// Strides to the next brick: along x, and along z `<< 16`. Along y it is 1.
    pub strides: u32,
}

/// The windows of many bricks, as brick references.
#[derive(Default)]
pub(super) struct Windows<'a> {
    slabs: Vec<Slab<'a>>,
    /// Number of requested bricks per slab; the last one may have fewer.
    of_a_slab: usize,
}

/// The windows of some consecutive bricks.
#[derive(Default)]
struct Slab<'a> {
    /// Number of entries in all previous slabs.
    first: u32,
    lists: SlabLists,
    /// Bricks without a reference yet, by entry.
    missing: Vec<(usize, &'a Brick)>,
    has_materials: bool,
}

/// The tables of a slab.
#[derive(Default)]
struct SlabLists {
    /// The entry of each requested brick, relative to the slab's first.
    entries: Vec<Entry>,
    /// The references of all entries; [`NONE`] where no brick is stored.
    refs: Vec<u32>,
}

/// Memory of slabs, reused by the next launch, since freeing memory that other threads allocated may contend with
/// them.
#[derive(Default)]
pub(super) struct KeptSlabs(Vec<SlabLists>);

/// Slabs with more entries are freed.
const KEPT_ENTRIES: usize = 1 << 14;

impl KeptSlabs {
    /// Takes memory for this many slabs.
    fn take(&mut self, slabs: usize) -> Vec<SlabLists> {
        let mut lists = self.0.split_off(self.0.len().saturating_sub(slabs));
        lists.resize_with(slabs, SlabLists::default);
        lists
    }

    /// Returns the memory of windows for reuse.
    pub fn put(&mut self, windows: Windows) {
        let lists = windows.slabs.into_iter().map(|slab| slab.lists);
        let is_small = |lists: &SlabLists| lists.refs.capacity() <= KEPT_ENTRIES;
        self.0.extend(lists.filter(is_small));
        self.0.truncate(SLABS);
    }
}

impl<'a> Slab<'a> {
    /// Builds the windows around bricks, `more` bricks higher and deeper than the usual one, in the given lists.
    /// `find` returns the reference of a brick.
    fn new(
        mut lists: SlabLists,
        view: &SampleView<'a>,
        bricks: impl Iterator<Item = BrickPos> + Clone,
        more: i32,
        find: impl Fn(&Brick) -> Option<u32>,
    ) -> Self {
        lists.entries.clear();
        lists.refs.clear();
        let (mut slab, mut window, mut rest) = (Self { lists, ..Self::default() }, Window::default(), bricks);
        while let Some((count, places)) = shared(rest.clone()) {
            let more = IVec3::Y * more;
            window = window.moved(view, LatticeBox { min: places.min - more, max: places.max + more });
            slab.enter(&window, rest.by_ref().take(count), &find);
        }
        slab
    }

    /// Adds a window and the bricks that share it.
    fn enter(
        &mut self,
        window: &Window<'a>,
        bricks: impl Iterator<Item = BrickPos>,
        find: impl Fn(&Brick) -> Option<u32>,
    ) {
        let SlabLists { entries, refs } = &mut self.lists;
        let (first, [x, _, z]) = (refs.len(), window.steps());
        let strides = (x | z << 16) as u32;
        let entry = |brick| Entry { number: (first + window.place(brick)) as u32, strides };
        entries.extend(bricks.map(entry));
        refs.resize(first + window.bricks().len(), NONE);
        for (number, brick) in (first..).zip(window.bricks()) {
            let Some(brick) = *brick else { continue };
            match find(brick) {
                Some(reference) => self.put(number, reference),
                None => self.missing.push((number, brick)),
            }
        }
    }

    fn put(&mut self, number: usize, reference: u32) {
        self.lists.refs[number] = reference;
        self.has_materials |= reference & 1 == 1;
    }
}

impl<'a> Windows<'a> {
    /// Builds windows around bricks, which are sorted by stack: one more brick on each side, and `up_and_down`
    /// vertically. `find` returns the reference of a brick. Bricks without one must be
    /// [`complete`](Self::complete)d afterwards.
    pub fn around<T: Sync>(
        view: SampleView<'a>,
        bricks: &[T],
        pos: impl Fn(&T) -> BrickPos + Send + Sync,
        up_and_down: i32,
        find: impl Fn(&Brick) -> Option<u32> + Send + Sync,
        kept: &mut KeptSlabs,
    ) -> Self {
        let height = up_and_down.max(1) as usize;
        let of_a_slab = match bricks.len() {
            few if few * height < LONG => few.max(1),
            many => many.div_ceil(SLABS).clamp((OF_A_SLAB[0] / height).max(1), OF_A_SLAB[1]),
        };
        let parts = bricks.chunks(of_a_slab);
        let slab = |(part, lists): (&[T], SlabLists)| {
            Slab::new(lists, &view, part.iter().map(&pos), up_and_down - 1, &find)
        };
        let lists = kept.take(parts.len());
        let mut slabs = map_into(parts.zip(lists).collect(), slab);
        let mut first = 0;
        for slab in &mut slabs {
            slab.first = first;
            first += slab.lists.refs.len() as u32;
        }
        Self { slabs, of_a_slab }
    }

    /// Fills in the references of bricks that had none.
    pub fn complete(&mut self, mut need: impl FnMut(&'a Brick) -> Result<u32, Fault>) -> Result<(), Fault> {
        for slab in &mut self.slabs {
            for (number, brick) in std::mem::take(&mut slab.missing) {
                slab.put(number, need(brick)?);
            }
        }
        Ok(())
    }

    /// The entry of a requested brick, by its index.
    pub fn entry(&self, number: usize) -> Entry {
        let slab = &self.slabs[number / self.of_a_slab];
        let own = slab.lists.entries[number % self.of_a_slab];
        Entry { number: slab.first + own.number, ..own }
    }

    /// The reference of a requested brick, by its index.
    pub fn reference(&self, number: usize) -> u32 {
        let slab = &self.slabs[number / self.of_a_slab];
        slab.lists.refs[slab.lists.entries[number % self.of_a_slab].number as usize]
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.slabs.iter().map(|slab| slab.lists.refs.len()).sum()
    }

    /// Whether any brick has materials of its own.
    pub fn has_materials(&self) -> bool {
        self.slabs.iter().any(|slab| slab.has_materials)
    }

    /// Writes the references of all entries.
    pub fn write(&self, out: &mut [u32]) {
        let places = cut(out, self.slabs.iter().map(|slab| slab.lists.refs.len()));
        let slabs: Vec<_> = self.slabs.iter().zip(places).collect();
        for_each_parallel(slabs, |(slab, place)| place.copy_from_slice(&slab.lists.refs));
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Arc;

    use super::*;
    use crate::ground::Ground;
    use crate::volume::Bricks;

    /// A reference that encodes the brick's position.
    fn code(pos: IVec3) -> u32 {
        (pos.x + 20 + (pos.y + 20) * 40 + (pos.z + 20) * 1600) as u32
    }

    /// A brick at (x, z, y).
    fn pos(&(x, z, y): &(i32, i32, i32)) -> BrickPos {
        BrickPos(IVec3::new(x, y, z))
    }

    /// Checks that every brick around the requested ones is found from there.
    fn check(stored: &Bricks, asked: &[(i32, i32, i32)]) {
        let ground = Ground::flat(8, 8, 0.0).unwrap();
        let own = |brick: &Brick| brick.tag.get() as u32;
        let known = |brick: &Brick| Some(own(brick)).filter(|code| !code.is_multiple_of(3));
        let (view, mut kept) = (SampleView::new(&ground, stored), KeptSlabs::default());
        // Windows for other bricks first, so that their memory is reused.
        let others = Windows::around(view, &[(0, 0, 0), (5, 6, 7)], pos, 8, known, &mut kept);
        kept.put(others);
        let mut windows = Windows::around(view, asked, pos, 8, known, &mut kept);
        let mut missing = 0;
        let found = windows.complete(|brick| {
            missing += 1;
            Ok(own(brick))
        });
        found.expect("nothing fails");
        assert!(missing > 0 && windows.has_materials());
        let mut refs = vec![7; windows.len()];
        windows.write(&mut refs);
        for (number, at) in asked.iter().map(pos).enumerate() {
            let entry = windows.entry(number);
            let [x, z] = [entry.strides & 0xffff, entry.strides >> 16].map(|stride| stride as i32);
            let around = (0..27).map(|i| IVec3::new(i % 3 - 1, i / 9 - 1, i / 3 % 3 - 1));
            for step in around.chain((-8..=8).map(|up| IVec3::Y * up)) {
                let found = refs[(entry.number as i32 + step.x * x + step.z * z + step.y) as usize];
                let expected = stored.get(&BrickPos(at.0 + step)).map_or(NONE, |_| code(at.0 + step));
                assert_eq!(found, expected, "{at:?} {step}");
            }
            assert_eq!(windows.reference(number), refs[entry.number as usize]);
        }
    }

    #[test]
    fn every_neighbour_of_a_brick_has_its_entry() {
        let mut rng = fastrand::Rng::with_seed(7);
        let place = |rng: &mut fastrand::Rng| (rng.i32(-9..9), rng.i32(-9..9), rng.i32(-9..9));
        let mut stored = Bricks::default();
        for at in (0..3000).map(|_| pos(&place(&mut rng))) {
            let brick = Brick::of_edited(&[0; 512]);
            brick.tag.set(code(at.0).into());
            stored.insert(at, Arc::new(brick));
        }
        // One slab, and several.
        for count in [60, 2 * LONG] {
            let asked: BTreeSet<_> = (0..count).map(|_| place(&mut rng)).collect();
            check(&stored, &asked.into_iter().collect::<Vec<_>>());
        }
        // A brick may be requested several times, as it can hold blocks of several chunks.
        check(&stored, &[(1, 2, 3); 2 * LONG]);
    }

    #[test]
    fn where_nothing_is_asked_for_there_is_no_entry() {
        let (ground, stored) = (Ground::flat(8, 8, 0.0).unwrap(), Bricks::default());
        let (view, mut kept) = (SampleView::new(&ground, &stored), KeptSlabs::default());
        let windows = Windows::around(view, &[(0, 0, 0); 0], pos, 1, |_| None, &mut kept);
        windows.write(&mut []);
        assert!(windows.len() == 0 && !windows.has_materials());
    }
}
