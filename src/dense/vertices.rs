//! Vertices from the lists of crossed edges, four at a time.
//!
//! All edges of a list run along the same axis, so all four take the same steps: read the samples around both ends,
//! then calculate with four numbers at once. Only + - * / and square roots in a fixed order, so all machines agree on
//! every bit.

use wide::{f32x4, i32x4};

use super::cells::{Point, point};
use super::density::Density;
use super::grid::DenseGrid;

/// Edges that are processed together.
pub(super) const LANES: usize = 4;

/// A bit for each of them.
const ALL_LANES: u32 = (1 << LANES) - 1;

/// Slots behind the last vertex that may be overwritten.
pub(super) const SLACK: usize = LANES + 1;

/// Three numbers for each of four edges.
type Vectors = [f32x4; 3];

/// Writes the vertices of the edges along `AXIS` that start at `points`, whose number is a multiple of [`LANES`]. The
/// slot behind them is overwritten too. Without `NORMALS` no normal is written.
pub(super) fn mesh<S: Density, const AXIS: usize, const NORMALS: bool>(
    grid: &DenseGrid<S>,
    points: &[Point],
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
) {
    let lattice = Lattice::new(grid, AXIS);
    let taps = Taps::<S, AXIS>::new(grid);
    let has_apron = grid.first() > 0;
    let (mut positions, mut normals) = (positions.as_flattened_mut(), normals.as_flattened_mut());
    for points in points.as_chunks::<LANES>().0 {
        let mut position = coordinates(points);
        if NORMALS {
            let (ends, [start, end]) = if has_apron || lattice.are_inside(points) {
                taps.read(lattice.indices(points))
            } else {
                let indices = lattice.indices(points);
                (lattice.ends(grid.samples(), indices), border_gradients::<S, AXIS>(grid, points, indices))
            };
            let crossing = crossing(ends);
            position[AXIS] += crossing;
            let normal = |axis: usize| start[axis] + (end[axis] - start[axis]) * crossing;
            let normal = [normal(0), normal(1), normal(2)];
            let (units, are_exact) = units(normal);
            write(units, normals);
            if are_exact != ALL_LANES {
                write_exact_units(normal, are_exact, normals);
            }
            normals = &mut normals[LANES * 3..];
        } else {
            position[AXIS] += crossing(lattice.ends(grid.samples(), lattice.indices(points)));
        }
        write(position, positions);
        positions = &mut positions[LANES * 3..];
    }
}

/// The bit above each coordinate of a point: whether a subtraction clears it shows which coordinate was greater.
const TOP: Point = 0x8000_8000_8000;

/// Where samples lie in the slice.
struct Lattice {
    strides: [usize; 3],
    /// The stride along the edges.
    along: usize,
    /// The first point where an edge can start with all its neighbours inside the grid.
    first: Point,
    /// The last one, and [`TOP`].
    last: Point,
}

impl Lattice {
    fn new<S: Density>(grid: &DenseGrid<S>, axis: usize) -> Self {
        let strides = grid.strides();
        let mut far_end = [0; 3];
        far_end[axis] = 1;
        // Coordinates have 15 bits. The 16th keeps one from borrowing from the next.
        let last = (point(grid.size().map(|side| side - 2)) | TOP) - point(far_end);
        Self { strides, along: strides[axis], first: point([1; 3]), last }
    }

    #[inline(always)]
    fn indices(&self, &[a, b, c, d]: &[Point; LANES]) -> [usize; LANES] {
        let index = |point| {
            let [x, y, z] = unpack(point);
            x + y * self.strides[1] + z * self.strides[2]
        };
        [index(a), index(b), index(c), index(d)]
    }

    /// Returns `true` if all neighbours of both ends of these edges lie in the grid.
    #[inline(always)]
    fn are_inside(&self, points: &[Point; LANES]) -> bool {
        let inside = |all, point| all & ((point | TOP) - self.first) & (self.last - point);
        points.iter().fold(TOP, inside) == TOP
    }

    /// The samples at both ends of the edges.
    #[inline(always)]
    fn ends<S: Density>(&self, samples: &[S], indices: [usize; LANES]) -> [f32x4; 2] {
        let high = &samples[self.along..];
        let low = &samples[..high.len()];
        [gather(low, indices), gather(high, indices)]
    }
}

#[inline(always)]
fn gather<S: Density>(samples: &[S], [a, b, c, d]: [usize; LANES]) -> f32x4 {
    S::numbers([samples[a], samples[b], samples[c], samples[d]])
}

#[inline(always)]
fn unpack(point: Point) -> [usize; 3] {
    [(point & 0xffff) as usize, (point >> 16 & 0xffff) as usize, (point >> 32) as usize]
}

/// Coordinates of four points.
#[inline(always)]
fn coordinates(&[a, b, c, d]: &[Point; LANES]) -> Vectors {
    let xy = i32x4::new([a as i32, b as i32, c as i32, d as i32]);
    let z = i32x4::new([(a >> 32) as i32, (b >> 32) as i32, (c >> 32) as i32, (d >> 32) as i32]);
    [f32x4::from_i32x4(xy & i32x4::splat(0xffff)), f32x4::from_i32x4(xy >> 16), f32x4::from_i32x4(z)]
}

/// The samples around edges along one axis, each as a slice of its own that begins at the first edge's
/// sample. All have equal length, so that a single check covers the twelve samples of an edge.
struct Taps<'a, S, const AXIS: usize> {
    /// How far the slices begin behind the grid's first sample.
    first: usize,
    /// From one before the start of the edge to one behind its end.
    along: [&'a [S]; 4],
    /// Neighbours of the start and of the end, along the next axis, then along the one after that: before and
    /// behind.
    across: [[&'a [S]; 4]; 2],
}

impl<'a, S: Density, const AXIS: usize> Taps<'a, S, AXIS> {
    #[inline(always)]
    fn new(grid: &DenseGrid<'a, S>) -> Self {
        let (samples, strides) = (grid.samples(), grid.strides());
        let along = strides[AXIS];
        let [u, v] = [strides[(AXIS + 1) % 3], strides[(AXIS + 2) % 3]];
        let first = strides[2];
        let farthest = along + along.max(u).max(v);
        let len = samples.len().saturating_sub(first + farthest);
        let tap = |back: usize, ahead: usize| {
            // A grid too thin for any inner edge has no samples there either.
            let start = (first + ahead - back).min(samples.len() - len);
            &samples[start..start + len]
        };
        Self {
            first,
            along: [tap(along, 0), tap(0, 0), tap(0, along), tap(0, 2 * along)],
            across: [
                [tap(u, 0), tap(0, u), tap(v, 0), tap(0, v)],
                [tap(u, along), tap(0, along + u), tap(v, along), tap(0, along + v)],
            ],
        }
    }

    /// The samples at both ends of four edges, and the gradients there, by central differences.
    #[inline(always)]
    fn read(&self, [a, b, c, d]: [usize; LANES]) -> ([f32x4; 2], [Vectors; 2]) {
        let indices = [a - self.first, b - self.first, c - self.first, d - self.first];
        let [before, start, end, behind] = self.along;
        let (start, end) = (gather(start, indices), gather(end, indices));
        let start_gradient = Self::gradient(end - gather(before, indices), self.across[0], indices);
        let end_gradient = Self::gradient(gather(behind, indices) - start, self.across[1], indices);
        ([start, end], [start_gradient, end_gradient])
    }

    #[inline(always)]
    fn gradient(along: f32x4, [u_low, u_high, v_low, v_high]: [&[S]; 4], indices: [usize; LANES]) -> Vectors {
        let mut gradient = [along; 3];
        gradient[(AXIS + 1) % 3] = gather(u_high, indices) - gather(u_low, indices);
        gradient[(AXIS + 2) % 3] = gather(v_high, indices) - gather(v_low, indices);
        gradient
    }
}

/// The gradients at both ends of edges that may lie in the grid's border. Where a neighbour is missing, the difference
/// to the other one counts twice.
#[inline(never)]
fn border_gradients<S: Density, const AXIS: usize>(
    grid: &DenseGrid<S>,
    points: &[Point; LANES],
    starts: [usize; LANES],
) -> [Vectors; 2] {
    let mut gradients = [[f32x4::ZERO; 3]; 2];
    for (end, gradient) in gradients.iter_mut().enumerate() {
        for (axis, gradient) in gradient.iter_mut().enumerate() {
            let stride = grid.strides()[axis];
            let on = if axis == AXIS { end } else { 0 };
            let last = grid.size()[axis] - 1 - on;
            let (mut low, mut high, mut weight) = (starts, starts, [1.0; LANES]);
            for lane in 0..LANES {
                let at = (points[lane] >> (16 * axis) & 0xffff) as usize;
                let here = starts[lane] + end * grid.strides()[AXIS];
                let (has_low, has_high) = (at + on > 0, at < last);
                low[lane] = if has_low { here - stride } else { here };
                high[lane] = if has_high { here + stride } else { here };
                weight[lane] = if has_low & has_high { 1.0 } else { 2.0 };
            }
            *gradient = (gather(grid.samples(), high) - gather(grid.samples(), low)) * f32x4::new(weight);
        }
    }
    gradients
}

/// Where the surface crosses edges, 0 to 1; in the middle where the samples' difference is not finite.
#[inline(always)]
fn crossing([start, end]: [f32x4; 2]) -> f32x4 {
    let difference = start - end;
    difference.abs().simd_le(f32x4::splat(f32::MAX)).bitselect(start / difference, f32x4::HALF)
}

/// The vectors scaled to length 1, and a bit for each lane where `f32` was exact enough.
#[inline(always)]
fn units([x, y, z]: Vectors) -> (Vectors, u32) {
    let squared = x * x + y * y + z * z;
    let scale = f32x4::ONE / squared.sqrt();
    // Smaller squares have lost digits, and larger ones are infinite.
    let is_exact = squared.simd_ge(f32x4::splat(1e-30)) & squared.simd_le(f32x4::splat(f32::MAX));
    ([x * scale, y * scale, z * scale], is_exact.to_bitmask())
}

/// Computes the unit vectors whose bit is not set again, in `f64`. Vectors without length point up.
#[cold]
fn write_exact_units(vectors: Vectors, are_exact: u32, to: &mut [f32]) {
    let vectors = vectors.map(f32x4::to_array);
    let failed = |&(lane, _): &(usize, &mut [f32])| are_exact >> lane & 1 == 0;
    for (lane, to) in to.chunks_exact_mut(3).take(LANES).enumerate().filter(failed) {
        let vector = [0, 1, 2].map(|axis| f64::from(vectors[axis][lane]));
        let length = (vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]).sqrt();
        let has_length = length > 0.0 && length.is_finite();
        let unit = if has_length { vector.map(|component| component / length) } else { [0.0, 1.0, 0.0] };
        to.copy_from_slice(&unit.map(|component| component as f32));
    }
}

/// Writes four vectors, and one number behind them.
#[inline(always)]
fn write([x, y, z]: Vectors, to: &mut [f32]) {
    let vectors = f32x4::transpose([x, y, z, f32x4::ZERO]);
    // Each fourth number is overwritten by the next vector's first.
    let to = &mut to[..LANES * 3 + 1];
    for (lane, vector) in vectors.iter().enumerate() {
        to[lane * 3..lane * 3 + 4].copy_from_slice(vector.as_array());
    }
}
