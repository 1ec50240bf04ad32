//! The spots of a species: points that pass its rules for the ground, and keep their distance from each other.

use super::species::{Rule, WHOLE};
use crate::ground::Ground;
use crate::lattice::hash::{hash_words, mix};
use crate::lattice::{Column, ONE, ceil};

/// A point where a plant may stand, with what is random about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Spot {
    /// The square that the spot lies in.
    pub square: (i32, i32),
    /// In 1/256 voxel.
    pub x: i32,
    /// In 1/256 voxel.
    pub z: i32,
    /// The priority: of two spots that are too near to each other, the one with the greater number stays.
    priority: u64,
    /// Two more random numbers, as bits.
    pub random: u64,
    /// Height of the ground below it, in 1/65536 voxel.
    pub y: i64,
    /// Rise of the ground along x and along z, in 1/256.
    pub rise: [i32; 2],
}

/// 16 of the bits of a random number.
fn bits(random: u64, from: u32) -> i64 {
    (random >> from & 0xffff) as i64
}

/// The square of the distance between two points.
pub(super) fn squared_distance(a: (i32, i32), b: (i32, i32)) -> i64 {
    (i64::from(a.0) - i64::from(b.0)).pow(2) + (i64::from(a.1) - i64::from(b.1)).pow(2)
}

impl Spot {
    pub fn point(&self) -> (i32, i32) {
        (self.x, self.z)
    }

    /// The cell that it lies in.
    pub fn cell(&self) -> Column {
        Column::new(self.x.div_euclid(ONE), self.z.div_euclid(ONE))
    }

    /// The spot of a square, if it passes the rules for its ground.
    fn of(rule: &Rule, ground: &Ground, square: (i32, i32)) -> Option<Self> {
        let place = u64::from(square.0 as u32) | u64::from(square.1 as u32) << 32;
        let priority = hash_words([rule.key, place]);
        let random = mix(priority);
        if bits(priority, 32) >= rule.density {
            return None;
        }
        let along = |square: i32, random: i64| {
            square * rule.spacing + (i64::from(rule.spacing) * random / WHOLE) as i32
        };
        let (x, z) = (along(square.0, bits(priority, 0)), along(square.1, bits(priority, 16)));
        let spot = Self { square, x, z, priority, random, y: 0, rise: [0; 2] };
        let cell = spot.cell();
        if !((0..ground.width()).contains(&cell.x) && (0..ground.depth()).contains(&cell.z)) {
            return None;
        }
        if bits(random, 48) >= chance(rule, spot.point()) {
            return None;
        }
        spot.on(rule, ground, cell)
    }

    /// This spot on its ground, if the rule allows it.
    fn on(self, rule: &Rule, ground: &Ground, cell: Column) -> Option<Self> {
        let [[a, d], [b, c]] = ground.heights::<2>(cell);
        let (fx, fz) = (self.x - cell.x * ONE, self.z - cell.z * ONE);
        // The triangles that a tile draws: a, b, c and c, d, a.
        let rise = if fz >= fx { [c - b, b - a] } else { [d - a, c - d] };
        let climb = i64::from(fx) * i64::from(rise[0]) + i64::from(fz) * i64::from(rise[1]);
        let y = i64::from(a) * i64::from(ONE) + climb;
        let (low, high) = rule.height;
        if !(i64::from(low) * i64::from(ONE)..=i64::from(high) * i64::from(ONE)).contains(&y) {
            return None;
        }
        let nearest = nearest_column(self.x, self.z);
        let (least, greatest) = rule.squared_slope;
        if !(least..=greatest).contains(&ground.squared_slope(nearest)) {
            return None;
        }
        let surface = nearest.at(ceil(ground.height(nearest)) - 1);
        let grows = rule.materials.is_none() || rule.grows_on(ground.material(surface));
        grows.then_some(Self { y, rise, ..self })
    }
}

/// The column nearest to a point: one of the four around its cell.
pub(super) fn nearest_column(x: i32, z: i32) -> Column {
    Column::new((x + ONE / 2).div_euclid(ONE), (z + ONE / 2).div_euclid(ONE))
}

/// The chance of a spot by the groups around it: certain in the inner half of a group's area, falling to 0 at one and a
/// half times that area.
fn chance(rule: &Rule, at: (i32, i32)) -> i64 {
    let Some((size, squared_radius)) = rule.clusters else { return WHOLE };
    let own = (at.0.div_euclid(size), at.1.div_euclid(size));
    let around = (-1..=1).flat_map(|x| (-1..=1).map(move |z| (own.0 + x, own.1 + z)));
    let chances = around.map(|(x, z)| {
        let place = u64::from(x as u32) | u64::from(z as u32) << 32;
        let random = hash_words([rule.key, place, 1]);
        let along = |square: i32, random: i64| square * size + (i64::from(size) * random / WHOLE) as i32;
        let middle = (along(x, bits(random, 0)), along(z, bits(random, 16)));
        let left = 3 * squared_radius / 2 - squared_distance(middle, at);
        (left.saturating_mul(WHOLE) / squared_radius.max(1)).clamp(0, WHOLE)
    });
    chances.max().unwrap_or_default()
}

/// The spots of a rectangle of squares.
pub(super) struct Spots {
    spacing: i32,
    low: (i32, i32),
    size: (i32, i32),
    /// By square, x fastest.
    spots: Vec<Option<Spot>>,
}

impl Spots {
    /// All spots between two points, both included, which may be nearer to each other than their distance.
    fn candidates(rule: &Rule, ground: &Ground, (low, high): ((i32, i32), (i32, i32))) -> Self {
        let square = |at: (i32, i32)| (at.0.div_euclid(rule.spacing), at.1.div_euclid(rule.spacing));
        let (low, high) = (square(low), square(high));
        let size = (high.0 - low.0 + 1, high.1 - low.1 + 1);
        let rows = low.1..=high.1;
        let spots =
            rows.flat_map(|z| (low.0..=high.0).map(move |x| Spot::of(rule, ground, (x, z)))).collect();
        Self { spacing: rule.spacing, low, size, spots }
    }

    /// The spots between two points, both included, that keep their distance.
    pub fn new(rule: &Rule, ground: &Ground, (low, high): ((i32, i32), (i32, i32))) -> Self {
        let distance = rule.distance;
        let grown = ((low.0 - distance, low.1 - distance), (high.0 + distance, high.1 + distance));
        let all = Self::candidates(rule, ground, grown);
        if distance == 0 {
            return all;
        }
        let order = |spot: &Spot| (spot.priority, spot.square);
        let yields = |spot: &Spot| all.any_near(spot.point(), distance, |other| order(other) > order(spot));
        let spots = all.spots.iter().map(|spot| spot.filter(|spot| !yields(spot))).collect();
        Self { spots, ..all }
    }

    /// All spots, by square.
    pub fn iter(&self) -> impl Iterator<Item = &Spot> {
        self.spots.iter().flatten()
    }

    /// Whether one of these is less than a distance from a point.
    pub fn any_near(&self, at: (i32, i32), distance: i32, is_wanted: impl Fn(&Spot) -> bool) -> bool {
        let squares = |at: i32, low: i32, size: i32| {
            let first = (at - distance).div_euclid(self.spacing) - low;
            let last = (at + distance).div_euclid(self.spacing) - low;
            first.max(0)..=last.min(size - 1)
        };
        let squared = i64::from(distance).pow(2);
        squares(at.1, self.low.1, self.size.1).any(|z| {
            squares(at.0, self.low.0, self.size.0).any(|x| {
                let spot = self.spots[(z * self.size.0 + x) as usize].as_ref();
                spot.is_some_and(|spot| squared_distance(spot.point(), at) < squared && is_wanted(spot))
            })
        })
    }
}
