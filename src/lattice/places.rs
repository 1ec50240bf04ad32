//! Sorting by grid position on one thread: a counting sort where positions are dense, a comparison sort elsewhere.

/// The counting sort is used while the box around all items has at most this many positions per item.
const PLACES: u64 = 16;

/// Sorts items by their positions, compared number by number; the sort is stable.
pub(crate) fn sort_by_place<T: Copy>(items: &mut Vec<T>, place: impl Fn(&T) -> [i32; 3]) {
    if !items.is_sorted_by_key(&place) {
        *items = sort_permutation(items, place).into_iter().map(|item| items[item as usize]).collect();
    }
}

/// The numbers of items as [`sort_by_place`] would sort them.
pub(crate) fn sort_permutation<T>(items: &[T], place: impl Fn(&T) -> [i32; 3]) -> Vec<u32> {
    let (mut low, mut high) = ([i32::MAX; 3], [i32::MIN; 3]);
    for at in items.iter().map(&place) {
        (0..3).for_each(|i| (low[i], high[i]) = (low[i].min(at[i]), high[i].max(at[i])));
    }
    let size: [u64; 3] = std::array::from_fn(|i| u64::from(low[i].abs_diff(high[i])) + 1);
    let volume = size.iter().fold(1u64, |all, &size| all.saturating_mul(size));
    if volume <= PLACES * items.len() as u64 {
        return counted(items, volume as usize, |item| {
            let [x, y, z] = place(item);
            let [x, y, z] = [x - low[0], y - low[1], z - low[2]].map(|step| step as usize);
            (x * size[1] as usize + y) * size[2] as usize + z
        });
    }
    let mut order: Vec<u32> = (0..items.len() as u32).collect();
    order.sort_by_key(|&item| place(&items[item as usize]));
    order
}

/// A counting sort: the order of items by numbers below `end`.
fn counted<T>(items: &[T], end: usize, number: impl Fn(&T) -> usize) -> Vec<u32> {
    let mut next = vec![0u32; end];
    items.iter().for_each(|item| next[number(item)] += 1);
    let mut before = 0;
    for next in &mut next {
        (*next, before) = (before, before + *next);
    }
    let mut order = vec![0; items.len()];
    for (item, own) in (0..).zip(items) {
        let next = &mut next[number(own)];
        order[*next as usize] = item;
        *next += 1;
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn items_are_sorted_and_equal_ones_stay_in_order(
            places in prop::collection::vec((-3..4i32, 0..3i32, -9..1i32), 0..200),
            far in any::<bool>(),
        ) {
            let scale = if far { 1 << 28 } else { 1 };
            let place = |&(at, _): &((i32, i32, i32), usize)| [at.0 * scale, at.1, at.2];
            let mut items: Vec<_> = places.into_iter().zip(0..).collect();
            let mut expected = items.clone();
            expected.sort_by_key(place);
            sort_by_place(&mut items, place);
            prop_assert_eq!(items, expected);
        }
    }
}
