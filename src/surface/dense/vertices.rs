//! Vertices from lists of edges, eight at a time.

use wide::f32x8;

use super::edges::{Corner, Edges};
use super::{DenseGrid, DenseMesh, Density, Normals};

/// Edges taken together.
const LANES: usize = 8;

/// Adds to `out` a vertex for each listed edge of slice `z`.
pub(super) fn make<S: Density>(
    grid: &DenseGrid<S>,
    z: usize,
    edges: &Edges,
    normals: Normals,
    out: &mut DenseMesh,
) {
    along::<S, 0>(grid, z, &edges.lists[0], normals, out);
    along::<S, 1>(grid, z, &edges.lists[1], normals, out);
    along::<S, 2>(grid, z, &edges.lists[2], normals, out);
}

fn along<S: Density, const AXIS: usize>(
    grid: &DenseGrid<S>,
    z: usize,
    list: &[Corner],
    normals: Normals,
    out: &mut DenseMesh,
) {
    if list.is_empty() {
        return;
    }
    let first = out.positions.len();
    match normals {
        Normals::None => positions::<S, AXIS>(grid, z, list, out),
        Normals::Gradient => with_gradients::<S, AXIS>(grid, z, list, out),
    }
    out.positions.truncate(first + list.len());
    out.normals.truncate(first + list.len());
    if normals == Normals::None {
        return;
    }
    if grid.apron() == 0 {
        let is_at_rim = |corner: Corner| {
            let low = [x_of(corner), y_of(corner), z];
            let reaches = |axis: usize| low[axis] + usize::from(axis == AXIS) + 1 == grid.corners()[axis];
            (0..3).any(|axis| low[axis] == 0 || reaches(axis))
        };
        let normals = out.normals[first..].iter_mut();
        for (normal, &corner) in normals.zip(list).filter(|(_, corner)| is_at_rim(**corner)) {
            *normal = rim_normal::<S, AXIS>(grid, corner, z);
        }
    }
}

fn x_of(corner: Corner) -> usize {
    (corner & 0xffff) as usize
}

fn y_of(corner: Corner) -> usize {
    (corner >> 16) as usize
}

/// The samples of a slice at which edges along an axis begin, and as many after a move by `by`. Where that leaves the
/// grid, those that were not moved: only gradients look there, and they are made again.
struct Slice<'a, S> {
    samples: &'a [S],
    first: usize,
    /// How many: up to the last corner that begins an edge.
    len: usize,
    row: usize,
}

impl<'a, S: Density> Slice<'a, S> {
    fn new<const AXIS: usize>(grid: &DenseGrid<'a, S>, z: usize) -> Self {
        let ([width, rows, _], row) = (grid.corners(), grid.strides()[1]);
        let last = row * (rows - 1 - usize::from(AXIS == 1)) + width - 1 - usize::from(AXIS == 0);
        Self { samples: grid.samples(), first: grid.index([0, 0, z]), len: last + 1, row }
    }

    fn moved(&self, by: isize) -> &'a [S] {
        let whole = |from: usize| self.samples.get(from..from + self.len);
        let moved = self.first.checked_add_signed(by).and_then(whole);
        moved.or(whole(self.first)).unwrap_or(&[])
    }

    /// Places of eight corners; the last ones of a list that is no multiple of eight repeat its first.
    #[inline(always)]
    fn places(&self, list: &[Corner]) -> [usize; LANES] {
        let mut corners = [list[0]; LANES];
        match list.first_chunk::<LANES>() {
            Some(all) => corners = *all,
            None => corners[..list.len()].copy_from_slice(list),
        }
        let mut places = [0; LANES];
        for (place, corner) in places.iter_mut().zip(corners) {
            *place = x_of(corner) + y_of(corner) * self.row;
        }
        places
    }
}

/// The samples of `N` slices at each of eight places. All slices are equally long.
#[inline(always)]
fn gather<S: Density, const N: usize>(slices: &[&[S]; N], places: [usize; LANES]) -> [f32x8; N] {
    // Said once for all, so that no access is checked again.
    let len = slices[0].len();
    let mut same = [slices[0]; N];
    for (same, slice) in same.iter_mut().zip(slices) {
        *same = &slice[..len];
    }
    let mut lanes = [[0.0; LANES]; N];
    for (lane, place) in places.into_iter().enumerate() {
        if place < len {
            for (lanes, slice) in lanes.iter_mut().zip(same) {
                lanes[lane] = slice[place].value();
            }
        }
    }
    lanes.map(f32x8::new)
}

/// How far along an edge the surface is, between samples of which one is below zero and the other is not.
#[inline(always)]
fn share(p: f32x8, q: f32x8) -> f32x8 {
    let t = p / (p - q);
    // NaN and infinite samples may lead anywhere.
    (t.simd_ge(f32x8::ZERO) & t.simd_le(f32x8::ONE)).select(t, f32x8::HALF)
}

fn positions<S: Density, const AXIS: usize>(
    grid: &DenseGrid<S>,
    z: usize,
    list: &[Corner],
    out: &mut DenseMesh,
) {
    let slice = Slice::new::<AXIS>(grid, z);
    let ends = [0, grid.strides()[AXIS] as isize].map(|by| slice.moved(by));
    let origin = [grid.apron() as f32, (z + grid.apron()) as f32];
    for list in list.chunks(LANES) {
        let [p, q] = gather(&ends, slice.places(list));
        out.positions.extend_from_slice(&placed::<AXIS>(list, origin, share(p, q)));
    }
}

/// Positions of up to eight vertices; `origin` is where x and y begin, and the slice's z.
#[inline(always)]
fn placed<const AXIS: usize>(list: &[Corner], origin: [f32; 2], share: f32x8) -> [[f32; 3]; LANES] {
    let (share, mut positions) = (share.to_array(), [[0.0; 3]; LANES]);
    for ((position, &corner), share) in positions.iter_mut().zip(list).zip(share) {
        *position = [x_of(corner) as f32 + origin[0], y_of(corner) as f32 + origin[0], origin[1]];
        position[AXIS] += share;
    }
    positions
}

fn with_gradients<S: Density, const AXIS: usize>(
    grid: &DenseGrid<S>,
    z: usize,
    list: &[Corner],
    out: &mut DenseMesh,
) {
    let slice = Slice::new::<AXIS>(grid, z);
    let strides = grid.strides().map(|stride| stride as isize);
    let along = strides[AXIS];
    let [b, c] = [[1, 2], [0, 2], [0, 1]][AXIS].map(|axis: usize| strides[axis]);
    let moves = [0, along, -along, 2 * along, -b, b, along - b, along + b, -c, c, along - c, along + c];
    let slices = moves.map(|by| slice.moved(by));
    let origin = [grid.apron() as f32, (z + grid.apron()) as f32];
    for list in list.chunks(LANES) {
        let [p, q, before, after, pb, pb2, qb, qb2, pc, pc2, qc, qc2] = gather(&slices, slice.places(list));
        let t = share(p, q);
        let blend = |a: f32x8, b: f32x8| a + (b - a) * t;
        let along = blend(q - before, after - p);
        let b = blend(pb2 - pb, qb2 - qb);
        let c = blend(pc2 - pc, qc2 - qc);
        let gradients = match AXIS {
            0 => [along, b, c],
            1 => [b, along, c],
            _ => [b, c, along],
        };
        out.positions.extend_from_slice(&placed::<AXIS>(list, origin, t));
        out.normals.extend_from_slice(&units(gradients));
    }
}

/// Squares of lengths between which vectors are divided as they are; others would lose digits, or are no numbers.
const LEAST: f32 = 1e-30;
/// See [`LEAST`].
const MOST: f32 = 1e30;

/// Eight vectors, made unit ones.
#[inline(always)]
fn units([x, y, z]: [f32x8; 3]) -> [[f32; 3]; LANES] {
    let squared = x * x + y * y + z * z;
    let length = squared.sqrt();
    let is_sound = squared.simd_gt(f32x8::splat(LEAST)) & squared.simd_lt(f32x8::splat(MOST));
    let [ux, uy, uz] = [x / length, y / length, z / length].map(|v| v.to_array());
    let mut units = [[0.0; 3]; LANES];
    for (lane, unit) in units.iter_mut().enumerate() {
        *unit = [ux[lane], uy[lane], uz[lane]];
    }
    if !is_sound.all() {
        let [x, y, z] = [x, y, z].map(|v| v.to_array());
        for (lane, normal) in units.iter_mut().enumerate() {
            *normal = unit([x[lane], y[lane], z[lane]]);
        }
    }
    units
}

/// A vector of any length, made a unit one; upwards where it has no direction.
pub(super) fn unit(v: [f32; 3]) -> [f32; 3] {
    let squared = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    if squared > LEAST && squared < MOST {
        let length = squared.sqrt();
        return v.map(|c| c / length);
    }
    let largest = v.iter().fold(0.0f32, |largest, c| largest.max(c.abs()));
    let [x, y, z] = v.map(|c| c / largest);
    let length = (x * x + y * y + z * z).sqrt();
    let unit = [x / length, y / length, z / length];
    if unit.iter().all(|c| c.is_finite()) { unit } else { [0.0, 1.0, 0.0] }
}

/// A normal where a gradient looks beyond the grid: differences are one-sided there.
fn rim_normal<S: Density, const AXIS: usize>(grid: &DenseGrid<S>, corner: Corner, z: usize) -> [f32; 3] {
    let (samples, strides, corners) = (grid.samples(), grid.strides(), grid.corners());
    let p = [x_of(corner), y_of(corner), z];
    let mut q = p;
    q[AXIS] += 1;
    let (p_at, q_at) = (grid.index(p), grid.index(q));
    let value = |at: usize| samples.get(at).map_or(0.0, |sample| sample.value());
    let (a, b) = (value(p_at), value(q_at));
    let t = Some(a / (a - b)).filter(|t| (0.0..=1.0).contains(t)).unwrap_or(0.5);
    let gradient = |corner: [usize; 3], at: usize, axis: usize| {
        let (is_first, is_last) = (corner[axis] == 0, corner[axis] + 1 == corners[axis]);
        let before = if is_first { at } else { at - strides[axis] };
        let after = if is_last { at } else { at + strides[axis] };
        // A one-sided difference is over half the way.
        (value(after) - value(before)) * if is_first || is_last { 2.0 } else { 1.0 }
    };
    let blend = |axis: usize| {
        let (a, b) = (gradient(p, p_at, axis), gradient(q, q_at, axis));
        a + (b - a) * t
    };
    unit([blend(0), blend(1), blend(2)])
}
