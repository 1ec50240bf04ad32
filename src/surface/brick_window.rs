//! The bricks in and around some blocks, each looked up once and found by its place from then on.

use glam::IVec3;

use crate::lattice::{BrickPos, LatticeBox};
use crate::volume::{Brick, SampleView};

/// The maximum number of places of a window, so that it fits into the first caches.
const MAX_PLACES: u64 = 4096;

/// Places that a window may have for any number of bricks.
const FREE: u64 = 64;

/// Further places that it may have for each requested brick.
const EACH: u64 = 12;

/// A box of bricks; those that are not stored are `None`.
#[derive(Default)]
pub(crate) struct Window<'a> {
    /// The lowest position.
    low: IVec3,
    /// Positions along each axis.
    size: IVec3,
    /// By place: y fastest, then z, then x.
    bricks: Vec<Option<&'a Brick>>,
}

impl<'a> Window<'a> {
    /// The bricks of a box of brick positions.
    pub fn new(view: &SampleView<'a>, places: LatticeBox) -> Self {
        Window::default().moved(view, places)
    }

    /// The bricks of another box, maybe of another world, in the memory of this window.
    pub fn moved<'b>(self, view: &SampleView<'b>, places: LatticeBox) -> Window<'b> {
        let mut window = Window { low: places.min, size: places.size(), bricks: emptied(self.bricks) };
        window.bricks.resize(places.volume() as usize, None);
        view.for_bricks(places, |pos, brick| window.put(pos, brick));
        window
    }

    /// An empty window that keeps the memory of this one.
    pub fn emptied<'b>(self) -> Window<'b> {
        Window { bricks: emptied(self.bricks), ..Window::default() }
    }

    fn put(&mut self, pos: BrickPos, brick: &'a Brick) {
        let place = self.place(pos);
        self.bricks[place] = Some(brick);
    }

    /// The place of a position, which must lie in the window.
    #[inline]
    pub fn place(&self, pos: BrickPos) -> usize {
        let at = pos.0 - self.low;
        ((at.x * self.size.z + at.z) * self.size.y + at.y) as usize
    }

    /// How many places further the next brick along x, y, z is.
    #[inline]
    pub fn steps(&self) -> [usize; 3] {
        [(self.size.z * self.size.y) as usize, 1, self.size.y as usize]
    }

    /// All bricks, by place.
    #[cfg(feature = "cuda")]
    pub fn bricks(&self) -> &[Option<&'a Brick>] {
        &self.bricks
    }

    /// The brick at a place.
    #[inline]
    pub fn at(&self, place: usize) -> Option<&'a Brick> {
        self.bricks[place]
    }
}

/// A list without elements in the memory of another.
fn emptied<'b>(mut bricks: Vec<Option<&Brick>>) -> Vec<Option<&'b Brick>> {
    bricks.clear();
    // A list of the same layout is collected in place.
    bricks.into_iter().map(|_| None).collect()
}

/// How many of the first bricks share one window, and the box of that window: around them, one brick more on each side.
/// Bricks should be sorted by stacks; `None` if there are no bricks.
pub(crate) fn shared(bricks: impl IntoIterator<Item = BrickPos>) -> Option<(usize, LatticeBox)> {
    let mut bricks = bricks.into_iter();
    let around = |brick: BrickPos| LatticeBox::point(brick.0).grown(1);
    let (mut count, mut places) = (1, around(bricks.next()?));
    for brick in bricks {
        let more = places.union(around(brick));
        if more != places && more.volume() > (FREE + EACH * count).min(MAX_PLACES) {
            break;
        }
        (count, places) = (count + 1, more);
    }
    Some((count as usize, places))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::ground::Ground;
    use crate::volume::Bricks;

    fn bricks(positions: &[[i32; 3]], sample: i16) -> Bricks {
        let brick = Arc::new(Brick::of_edited(&[sample; 512]));
        positions.iter().map(|&at| (BrickPos(IVec3::from_array(at)), Arc::clone(&brick))).collect()
    }

    #[test]
    fn a_window_shows_what_the_view_does() {
        let ground = Ground::flat(8, 8, 0.0).unwrap();
        let many: Vec<[i32; 3]> = (0..200).map(|i| [i % 7 - 3, i % 5 - 2, i % 11 - 4]).collect();
        let (old, new) = (bricks(&many, 1), bricks(&[[0, 0, 0], [1, -1, 2], [90, 0, 0]], 2));
        let latest = bricks(&[[0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 2, 3], [1, -1, 2], [90, 0, 0]], 3);
        let mut list: Vec<_> = latest.iter().map(|(&pos, brick)| (pos, brick.as_ref())).collect();
        list.sort_by_key(|(pos, _)| (pos.0.x, pos.0.z, pos.0.y));
        let view = SampleView::new(&ground, &old).over(&new).under(&list);
        let boxes = [([0; 3], [0; 3]), ([-2, -1, 0], [1, 1, 4]), ([-9; 3], [9; 3]), ([-1, 2, 0], [90, 2, 3])];
        for (low, high) in boxes {
            let places = LatticeBox { min: IVec3::from_array(low), max: IVec3::from_array(high) };
            let window = Window::new(&view, places);
            for pos in places.points().map(BrickPos) {
                let seen = window.at(window.place(pos)).map(std::ptr::from_ref);
                assert_eq!(seen, view.brick(pos).map(std::ptr::from_ref), "{pos:?}");
                let stands = latest.get(&pos).or_else(|| new.get(&pos)).or_else(|| old.get(&pos));
                assert_eq!(seen, stands.map(Arc::as_ptr), "{pos:?}");
            }
        }
    }

    #[test]
    fn a_window_under_a_long_list_shows_what_the_list_holds() {
        let (ground, none) = (Ground::flat(8, 8, 0.0).unwrap(), Bricks::default());
        let mut rng = fastrand::Rng::with_seed(4);
        let point = |rng: &mut fastrand::Rng| IVec3::new(rng.i32(-9..9), rng.i32(-30..30), rng.i32(-9..9));
        let stored: Bricks =
            (0..900).map(|i| (BrickPos(point(&mut rng)), Arc::new(Brick::of_edited(&[i; 512])))).collect();
        let mut list: Vec<_> = stored.iter().map(|(&pos, brick)| (pos, brick.as_ref())).collect();
        list.sort_by_key(|(pos, _)| (pos.0.x, pos.0.z, pos.0.y));
        let view = SampleView::new(&ground, &none).under(&list);
        for _ in 0..300 {
            let (a, b) = (point(&mut rng), point(&mut rng));
            let places = LatticeBox { min: a.min(b), max: a.max(b).min(a.min(b) + 12) };
            let window = Window::new(&view, places);
            for pos in places.points().map(BrickPos) {
                let seen = window.at(window.place(pos)).map(std::ptr::from_ref);
                assert_eq!(seen, stored.get(&pos).map(Arc::as_ptr), "{pos:?} of {places:?}");
            }
        }
    }

    #[test]
    fn bricks_far_from_each_other_share_no_window() {
        let at = |x| BrickPos(IVec3::new(x, 0, 0));
        assert_eq!(shared([]), None);
        let (count, places) = shared([at(0), at(1), at(1), at(90), at(91)]).unwrap();
        assert_eq!((count, places.min.x, places.max.x), (3, -1, 2));
        let column = (0..8192).map(|y| BrickPos(IVec3::new(0, y, 0)));
        assert!(shared(column).unwrap().1.volume() <= MAX_PLACES);
    }
}
