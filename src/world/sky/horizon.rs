//! Horizons: in eight directions, the steepest rise to the top of a column at one of a few distances.

/// A column at some distance, and what its top counts.
#[derive(Clone, Copy)]
pub(super) struct Step {
    pub dx: i32,
    pub dz: i32,
    /// Multiplied by a rise in 1/128 voxel, and divided by 65,536, it gives the slope in 1/32.
    pub factor: i16,
    /// That factor eight times, one for each of eight columns: from an array, compilers multiply all of them at once.
    pub factors: [i16; 8],
}

const fn step((x, z): (i32, i32), columns: i32, factor: i16) -> Step {
    Step { dx: x * columns, dz: z * columns, factor, factors: [factor; 8] }
}

/// The directions in which horizons are looked for.
const DIRECTIONS: [(i32, i32); 8] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// A straight direction has 16,384 / distance, a diagonal one that over the square root of 2.
const fn steps<const N: usize>(straight: [i32; N], diagonal: [i32; N]) -> [[Step; N]; 8] {
    let mut all = [[step((0, 0), 0, 0); N]; 8];
    let mut direction = 0;
    while direction < 8 {
        let mut at = 0;
        while at < N {
            let is_straight = direction % 2 == 0;
            let columns = if is_straight { straight[at] } else { diagonal[at] };
            let factor = if is_straight { 16_384 } else { 11_585 } / columns;
            all[direction][at] = step(DIRECTIONS[direction], columns, factor as i16);
            at += 1;
        }
        direction += 1;
    }
    all
}

/// Where ground counts everywhere. Few columns, as coarse nodes have to look at all of them too.
pub(super) const FAR: [[Step; 2]; 8] = steps([4, 16], [4, 12]);

/// Where ground also counts if it was dug or built, or if it is seen from ground that was.
pub(super) const NEAR: [[Step; 6]; 8] = steps([1, 2, 3, 6, 8, 11], [1, 2, 3, 5, 7, 9]);

/// A height in 1/256 voxel, to which slopes are taken: an `i32`, or, where the heights of all columns lie within 256
/// voxels, a `u16` that counts from the lowest, of which processors compare twice as many at once.
pub(super) trait Height: Copy {
    /// How far a top lies above a height, in 1/128 voxel; some value of 0 or less if it does not.
    fn rise_above(self, y: Self) -> i16;
}

impl Height for i32 {
    #[inline(always)]
    fn rise_above(self, y: Self) -> i16 {
        ((self - y) >> 1).clamp(i16::MIN.into(), i16::MAX.into()) as i16
    }
}

impl Height for u16 {
    #[inline(always)]
    fn rise_above(self, y: Self) -> i16 {
        (self.saturating_sub(y) >> 1) as i16
    }
}

/// The slope, in 1/32, from height `y` to a top; some value of 0 or less if the top is not above it.
#[inline(always)]
pub(super) fn slope<T: Height>(top: T, y: T, factor: i16) -> i16 {
    ((i32::from(top.rise_above(y)) * i32::from(factor)) >> 16) as i16
}

/// Raises the horizons of eight columns, whose heights are `ys`, to the tops that lie a step away.
#[inline(always)]
pub(super) fn raise<T: Height>(horizons: &mut [i16; 8], tops: &[T; 8], ys: &[T; 8], step: &Step) {
    for at in 0..8 {
        horizons[at] = horizons[at].max(slope(tops[at], ys[at], step.factors[at]));
    }
}

/// Raises the horizons of eight columns like [`raise`], where a bit of one of two masks is set.
#[inline(always)]
pub(super) fn raise_where<T: Height>(
    masks: [&[i16; 8]; 2],
    horizons: &mut [i16; 8],
    tops: &[T; 8],
    ys: &[T; 8],
    step: &Step,
) {
    for at in 0..8 {
        let slope = slope(tops[at], ys[at], step.factors[at]) & (masks[0][at] | masks[1][at]);
        horizons[at] = horizons[at].max(slope);
    }
}

/// For each slope of a horizon, in 1/32, the share of the sky in its direction that lies below: the square of its sine.
static BELOW: [u8; 256] = {
    let mut table = [0; 256];
    let mut slope = 0;
    while slope < 256 {
        let squared = (slope * slope) as u32;
        table[slope] = (255 * squared / (squared + 32 * 32)) as u8;
        slope += 1;
    }
    table
};

/// The slope of a horizon as far as it counts: steeper ones hide no more.
#[inline(always)]
pub(super) fn capped(slope: i16) -> u8 {
    slope.clamp(0, u8::MAX.into()) as u8
}

/// The share of the sky that lies below the horizon of a direction, 0..=255.
#[inline(always)]
pub(super) fn below(capped: u8) -> u16 {
    BELOW[usize::from(capped)].into()
}

/// The light where these shares of the sky are hidden in all directions together.
#[inline(always)]
pub(super) fn light_of(hidden: u16) -> u8 {
    255 - (hidden / 8) as u8
}
