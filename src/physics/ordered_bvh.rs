//! Balanced trees of bounding boxes.
//!
//! parry splits boxes by a cost function, level by level, which takes most of the time of a collider. Here each split
//! halves them by count. That tree is nearly as good, and its structure depends on nothing but the number of boxes: it
//! is copied from an earlier tree, and only the boxes are computed.

use std::ops::Range;
use std::sync::{Arc, LazyLock, PoisonError, RwLock};

use avian3d::parry::bounding_volume::Aabb;
use avian3d::parry::math::Vector;
use avian3d::parry::partitioning::{Bvh, BvhBuildStrategy};
use rustc_hash::FxHashMap;

/// Trees with more leaves are built by parry: copies of that size would take more memory than they save time.
const LARGEST: usize = 1 << 14;

/// Sizes of copied trees, for each power of two. A tree is copied from the next larger one, without the leaves that it
/// lacks.
const STEPS: usize = 16;

/// Subtrees with no more leaves than this are not split by place.
const FEW: usize = 8;

/// Balanced trees by their number of leaves.
static TREES: LazyLock<RwLock<FxHashMap<usize, Arc<Bvh>>>> = LazyLock::new(RwLock::default);

/// A tree over some boxes, and for each of its leaves the number of the box. `is_heightmap` says that no box lies above
/// another, which makes it faster.
pub(super) fn ordered_bvh(bounds: &[Aabb], is_heightmap: bool) -> (Bvh, Vec<u32>) {
    let count = bounds.len();
    if count > LARGEST {
        let tree = Bvh::from_iter(BvhBuildStrategy::Binned, bounds.iter().copied().enumerate());
        return (tree, (0..count as u32).collect());
    }
    let leaves = Leaves { size: rounded_up(count), used: count };
    let mut centers = Center::all(bounds);
    if is_heightmap {
        centers = along_curve(&centers);
    } else {
        leaves.halve(&mut centers, 0..leaves.size);
    }
    let mut tree = Bvh::clone(&balanced(leaves.size));
    let boxes = (0..leaves.size).map(|leaf| {
        let used = leaves.used_before(leaf);
        if leaves.used_before(leaf + 1) == used {
            tree.remove(leaf as u32);
            return 0;
        }
        let number = centers[used].number;
        tree.insert_or_update_partially(bounds[usize::from(number)], leaf as u32, 0.0);
        u32::from(number)
    });
    let boxes = boxes.collect();
    tree.refit_without_opt();
    (tree, boxes)
}

/// The centre of a box, in 1/[`GRID`] of the longest side of the box around all centres.
#[derive(Clone, Copy)]
struct Center {
    place: [i16; 3],
    number: u16,
}

/// The largest coordinate of a centre.
const GRID: f32 = 32_000.0;

impl Center {
    fn all(bounds: &[Aabb]) -> Vec<Self> {
        let doubled = |own: &Aabb| own.mins + own.maxs;
        let none = (Vector::INFINITY, Vector::NEG_INFINITY);
        let (low, high) =
            bounds.iter().map(doubled).fold(none, |(low, high), at| (low.min(at), high.max(at)));
        let scale = GRID / (high - low).max_element().max(f32::MIN_POSITIVE);
        let center = |(number, own)| Self {
            place: ((doubled(own) - low) * scale).to_array().map(|place| place as i16),
            number,
        };
        (0..).zip(bounds).map(center).collect()
    }
}

/// Squares along a side of the plane that a curve runs through.
const SIDE: usize = 64;

/// For each square, its place along a Hilbert curve.
static CURVE: LazyLock<[u16; SIDE * SIDE]> = LazyLock::new(|| {
    let place = |mut x: usize, mut z: usize| {
        let (mut place, mut half) = (0, SIDE / 2);
        while half > 0 {
            let (right, top) = (x & half > 0, z & half > 0);
            place += half * half * ((3 * usize::from(right)) ^ usize::from(top));
            if !top {
                if right {
                    (x, z) = (SIDE - 1 - x, SIDE - 1 - z);
                }
                std::mem::swap(&mut x, &mut z);
            }
            half /= 2;
        }
        place as u16
    };
    std::array::from_fn(|square| place(square % SIDE, square / SIDE))
});

/// The centres in order of a curve over the plane. Neighbours along it are neighbours in the plane, so halves of the
/// list are compact regions.
fn along_curve(centers: &[Center]) -> Vec<Center> {
    let square = |center: &Center| {
        let [x, _, z] = center.place.map(|place| place as usize * SIDE / (GRID as usize + 1));
        CURVE[z * SIDE + x]
    };
    let mut keyed: Vec<(u16, Center)> = centers.iter().map(|center| (square(center), *center)).collect();
    let mut sorted = keyed.clone();
    // A radix sort by two digits.
    for shift in [0, 6] {
        let digit = |key: u16| usize::from(key >> shift) % SIDE;
        let mut starts = [0; SIDE];
        keyed.iter().for_each(|(key, _)| starts[digit(*key)] += 1);
        let mut sum = 0;
        starts.iter_mut().for_each(|start| sum += std::mem::replace(start, sum));
        for item in &keyed {
            let start: &mut usize = &mut starts[digit(item.0)];
            sorted[*start] = *item;
            *start += 1;
        }
        std::mem::swap(&mut keyed, &mut sorted);
    }
    keyed.into_iter().map(|(_, center)| center).collect()
}

/// The leaves of a tree, of which some are not used, at even intervals.
struct Leaves {
    size: usize,
    used: usize,
}

impl Leaves {
    /// How many of the leaves before this one are used.
    fn used_before(&self, leaf: usize) -> usize {
        leaf * self.used / self.size
    }

    /// Orders the centres of these leaves so that each subtree has its own region: halves them along the longest axis,
    /// then the halves, and so on.
    fn halve(&self, centers: &mut [Center], leaves: Range<usize>) {
        if leaves.len() <= FEW {
            return;
        }
        let (mut low, mut high) = ([i16::MAX; 3], [i16::MIN; 3]);
        for center in centers.iter() {
            for (axis, &place) in center.place.iter().enumerate() {
                low[axis] = low[axis].min(place);
                high[axis] = high[axis].max(place);
            }
        }
        let middle = leaves.start.midpoint(leaves.end);
        let left = self.used_before(middle) - self.used_before(leaves.start);
        if left == 0 || left >= centers.len() {
            return;
        }
        let longest = (0..3).max_by_key(|&axis| i32::from(high[axis]) - i32::from(low[axis]));
        // One call for each axis, so that the compiler knows it in the comparisons.
        match longest {
            Some(0) => _ = centers.select_nth_unstable_by_key(left, |center| center.place[0]),
            Some(1) => _ = centers.select_nth_unstable_by_key(left, |center| center.place[1]),
            _ => _ = centers.select_nth_unstable_by_key(left, |center| center.place[2]),
        }
        let (first, second) = centers.split_at_mut(left);
        self.halve(first, leaves.start..middle);
        self.halve(second, middle..leaves.end);
    }
}

/// The size of the tree that one with this many leaves is copied from.
fn rounded_up(count: usize) -> usize {
    let step = (count.next_power_of_two() / 2 / STEPS).max(1);
    count.next_multiple_of(step)
}

fn balanced(size: usize) -> Arc<Bvh> {
    let known = TREES.read().unwrap_or_else(PoisonError::into_inner).get(&size).cloned();
    known.unwrap_or_else(|| {
        // Boxes in a row, all of one size, are halved again and again.
        let place = |leaf: usize| Vector::X * leaf as f32;
        let bounds = (0..size).map(|leaf| Aabb::new(place(leaf), place(leaf) + Vector::ONE));
        let tree = Arc::new(Bvh::from_iter(BvhBuildStrategy::Binned, bounds.enumerate()));
        TREES.write().unwrap_or_else(PoisonError::into_inner).insert(size, Arc::clone(&tree));
        tree
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_box_is_found_where_it_is_and_nowhere_else() {
        let mut rng = fastrand::Rng::with_seed(5);
        for count in (0..70).chain([127, 128, 129, 1000, 2047, LARGEST, LARGEST + 1]) {
            let place = |rng: &mut fastrand::Rng| Vector::new(rng.f32(), rng.f32(), rng.f32()) * 40.0;
            let bounds = |rng: &mut fastrand::Rng| {
                let low = place(rng);
                Aabb::new(low, low + place(rng) / 20.0)
            };
            let all: Vec<Aabb> = (0..count).map(|_| bounds(&mut rng)).collect();
            let (tree, numbers) = ordered_bvh(&all, count % 2 == 0);
            assert_eq!(tree.leaf_count() as usize, count);
            for _ in 0..20 {
                let sought = bounds(&mut rng);
                let mut found: Vec<u32> =
                    tree.intersect_aabb(&sought).map(|leaf| numbers[leaf as usize]).collect();
                found.sort_unstable();
                let touches =
                    |own: &Aabb| own.mins.cmple(sought.maxs).all() && own.maxs.cmpge(sought.mins).all();
                let expected: Vec<u32> =
                    (0..).zip(&all).filter(|(_, own)| touches(own)).map(|(number, _)| number).collect();
                assert_eq!(found, expected, "{count} boxes");
            }
        }
    }

    #[test]
    fn boxes_in_one_place_have_a_tree_too() {
        let bounds = vec![Aabb::new(Vector::ONE, Vector::ONE); 100];
        let (tree, numbers) = ordered_bvh(&bounds, true);
        let mut found: Vec<u32> =
            tree.intersect_aabb(&bounds[0]).map(|leaf| numbers[leaf as usize]).collect();
        found.sort_unstable();
        assert!(found.into_iter().eq(0..100));
    }

    #[test]
    fn a_curve_goes_from_square_to_square_through_all_of_them() {
        let mut squares = vec![None; SIDE * SIDE];
        for (square, &place) in CURVE.iter().enumerate() {
            squares[usize::from(place)] = Some([square % SIDE, square / SIDE]);
        }
        for pair in squares.windows(2) {
            let [Some([x, z]), Some([other_x, other_z])] = pair else { panic!("a place is empty: {pair:?}") };
            assert_eq!(x.abs_diff(*other_x) + z.abs_diff(*other_z), 1, "{pair:?}");
        }
    }

    #[test]
    fn trees_are_copied_from_few_others_of_nearly_the_same_size() {
        let sizes: std::collections::BTreeSet<usize> = (0..=LARGEST).map(rounded_up).collect();
        assert!(sizes.len() <= STEPS * 15, "{}", sizes.len());
        for count in 0..=LARGEST {
            let size = rounded_up(count);
            assert!(size >= count && (size - count) * STEPS <= count, "{count}: {size}");
        }
    }
}
