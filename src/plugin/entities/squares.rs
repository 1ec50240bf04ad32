//! Squares of ground around cameras and sources: which are loaded, built, or have colliders.

use std::hash::Hash;

use bevy::math::Affine3A;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;

/// The position (x, z) of a place in world space, in voxels of a terrain; `None` if it is not finite.
pub(crate) fn position_on(terrain_from_world: &Affine3A, place: &GlobalTransform) -> Option<Vec2> {
    let at = terrain_from_world.transform_point3(place.translation());
    at.is_finite().then(|| at.xz())
}

/// Whether two lists of positions have the same settings in the same order, and no position moved by a voxel.
pub(crate) fn are_same<T: PartialEq>(before: &[(Vec2, T)], after: &[(Vec2, T)]) -> bool {
    let is_near = |(a, b): (&(Vec2, T), &(Vec2, T))| a.0.distance(b.0) < 1.0 && a.1 == b.1;
    before.len() == after.len() && before.iter().zip(after).all(is_near)
}

/// The squares of a world of `cells` cells within a distance of a position, row by row, with their own distances. The
/// squares have sides of `side` cells, and are counted from the origin.
pub(crate) fn squares_within(
    position: Vec2,
    distance: f32,
    side: i32,
    cells: (i32, i32),
) -> impl Iterator<Item = (IVec2, f32)> {
    let along = |at: f32, cells: i32| {
        // One more, for a square that ends there.
        let first = ((at - distance) / side as f32).floor() as i32;
        let last = ((at + distance) / side as f32).floor() as i32;
        first.saturating_sub(1).max(0)..=last.min((cells - 1) / side)
    };
    let (xs, zs) = (along(position.x, cells.0), along(position.y, cells.1));
    let squares = zs.flat_map(move |z| xs.clone().map(move |x| IVec2::new(x, z)));
    squares.filter_map(move |square| {
        let low = square.as_vec2() * side as f32;
        let apart = position.distance(position.clamp(low, low + side as f32));
        (apart <= distance).then_some((square, apart))
    })
}

/// The squares around positions.
pub(crate) struct Squares<K> {
    /// Squares to be loaded, with their distance to the nearest position.
    wanted: HashMap<K, f32>,
    /// The wanted squares, and some more that stay if they are loaded.
    pub kept: HashSet<K>,
}

impl<K> Default for Squares<K> {
    fn default() -> Self {
        Self { wanted: HashMap::default(), kept: HashSet::default() }
    }
}

impl<K: Copy + Ord + Hash> Squares<K> {
    /// Adds the squares within a radius of a position; see [`squares_within`].
    pub fn add(
        &mut self,
        (position, radius): (Vec2, f32),
        side: i32,
        cells: (i32, i32),
        key: impl Fn(IVec2) -> K,
    ) {
        // Half a square more keeps one from coming and going.
        for (square, apart) in squares_within(position, radius + side as f32 / 2.0, side, cells) {
            let key = key(square);
            self.kept.insert(key);
            if apart <= radius {
                let nearest = self.wanted.entry(key).or_insert(apart);
                *nearest = apart.min(*nearest);
            }
        }
    }

    /// The squares to be loaded that pass a filter, nearest first.
    pub fn wanted(&self, mut filter: impl FnMut(K) -> bool) -> Vec<K> {
        let mut wanted: Vec<(K, f32)> =
            self.wanted.iter().map(|(&key, &apart)| (key, apart)).filter(|own| filter(own.0)).collect();
        wanted.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        wanted.into_iter().map(|own| own.0).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_those_within_the_distance() {
        let (side, cells) = (16, (200, 120));
        let mut rng = fastrand::Rng::with_seed(3);
        for _ in 0..200 {
            // Some lie outside the world, and some on borders of squares.
            let position = Vec2::new(rng.f32() * 300.0 - 50.0, rng.f32() * 220.0 - 50.0);
            let position = if rng.bool() { (position / 16.0).round() * 16.0 } else { position };
            let distance = [0.0, 16.0, 40.0, 1000.0, f32::INFINITY][rng.usize(0..5)];
            let all = (0..8).flat_map(|z| (0..13).map(move |x| IVec2::new(x, z)));
            let expected = all.filter_map(|square| {
                let low = square.as_vec2() * 16.0;
                let apart = position.distance(position.clamp(low, low + 16.0));
                (apart <= distance).then_some((square, apart))
            });
            let expected: Vec<(IVec2, f32)> = expected.collect();
            assert_eq!(squares_within(position, distance, side, cells).collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn the_nearest_squares_come_first_and_more_stay_than_are_wanted() {
        let mut squares = Squares::default();
        for x in [8.0, 88.0] {
            squares.add((Vec2::new(x, 8.0), 10.0), 16, (160, 16), |square| square.x);
        }
        assert_eq!(squares.wanted(|_| true), [0, 5, 1, 4, 6]);
        assert_eq!(squares.wanted(|x| x > 4), [5, 6]);
        let mut kept: Vec<i32> = squares.kept.iter().copied().collect();
        kept.sort_unstable();
        assert_eq!(kept, [0, 1, 4, 5, 6]);
    }
}
