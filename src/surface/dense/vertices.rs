//! Vertices from the lists of crossed edges, four at a time.
//!
//! All edges of a list run along the same axis, so all four take the same steps: read the samples around both ends, then
//! calculate with four numbers at once. Only + - * / and square roots in a fixed order, so all machines agree on every bit.

use wide::{f32x4, i32x4};

use super::cells::{Point, point};
use super::density::Density;
use super::grid::DenseGrid;

/// Edges that are worked on together.
pub(super) const LANES: usize = 4;

/// Slots behind the last vertex that may be written in vain.
pub(super) const SLACK: usize = LANES + 1;

/// Three numbers for each of four edges.
type Vectors = [f32x4; 3];

/// Writes the vertices of the edges along `AXIS` that start at `points`, whose number is a multiple of [`LANES`]. The slot
/// behind them is written too, with nothing of worth. Without `NORMALS` no normal is written.
pub(super) fn mesh<S: Density, const AXIS: usize, const NORMALS: bool>(
    grid: &DenseGrid<S>,
    points: &[Point],
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
) {
    let lattice = Lattice::new(grid, AXIS);
    let taps = Taps::new(grid, AXIS);
    let (mut positions, mut normals) = (positions.as_flattened_mut(), normals.as_flattened_mut());
    for points in points.as_chunks::<LANES>().0 {
        let indices = points.map(|point| lattice.index(point));
        let (ends, gradients);
        if !NORMALS {
            ends = lattice.ends(grid.samples(), indices);
            gradients = None;
        } else if lattice.are_inside(points) {
            let both = taps.read(indices);
            ends = both.0;
            gradients = Some(both.1);
        } else {
            ends = lattice.ends(grid.samples(), indices);
            gradients = Some(border_gradients(grid, points, AXIS));
        }
        let crossing = crossing(ends);
        let mut position = coordinates(points);
        position[AXIS] += crossing;
        write(position, positions);
        positions = &mut positions[LANES * 3..];
        if let Some([start, end]) = gradients {
            let normal = std::array::from_fn(|axis| start[axis] + (end[axis] - start[axis]) * crossing);
            write(unit(normal), normals);
            normals = &mut normals[LANES * 3..];
        }
    }
}

/// The bit above each coordinate of a point: what is left of it after a subtraction tells which one was greater.
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
    fn index(&self, point: Point) -> usize {
        let [x, y, z] = unpack(point);
        x + y * self.strides[1] + z * self.strides[2]
    }

    /// Do all neighbours of both ends of these edges lie in the grid?
    #[inline(always)]
    fn are_inside(&self, points: &[Point; LANES]) -> bool {
        let inside = points.map(|point| ((point | TOP) - self.first) & (self.last - point));
        inside[0] & inside[1] & inside[2] & inside[3] & TOP == TOP
    }

    /// The samples at both ends of the edges.
    #[inline(always)]
    fn ends<S: Density>(&self, samples: &[S], indices: [usize; LANES]) -> [f32x4; 2] {
        let high = &samples[self.along..];
        let low = &samples[..high.len()];
        [S::numbers(indices.map(|index| low[index])), S::numbers(indices.map(|index| high[index]))]
    }
}

#[inline(always)]
fn unpack(point: Point) -> [usize; 3] {
    [point & 0xffff, point >> 16 & 0xffff, point >> 32].map(|coordinate| coordinate as usize)
}

/// Coordinates of four points.
#[inline(always)]
fn coordinates(points: &[Point; LANES]) -> Vectors {
    let points = points.map(unpack);
    std::array::from_fn(|axis| f32x4::from_i32x4(i32x4::new(points.map(|point| point[axis] as i32))))
}

/// The samples around edges along one axis, each as a slice of its own that begins at the first edge's sample. All are of
/// the same length, so that a single check covers the twelve samples of an edge.
struct Taps<'a, S> {
    axis: usize,
    /// How far the slices begin behind the grid's first sample.
    first: usize,
    along: [&'a [S]; 4],
    across: [[[&'a [S]; 2]; 2]; 2],
}

impl<'a, S: Density> Taps<'a, S> {
    fn new(grid: &DenseGrid<'a, S>, axis: usize) -> Self {
        let strides = grid.strides();
        let first = strides[2];
        let farthest = (2 * strides[axis]).max(strides[axis] + strides[if axis == 2 { 1 } else { 2 }]);
        let len = grid.samples().len().saturating_sub(first + farthest);
        let tap = |back: usize, ahead: usize| {
            grid.samples().get(first + ahead - back..).and_then(|tap| tap.get(..len)).unwrap_or_default()
        };
        let along = strides[axis];
        let across = [1, 2].map(|turn| strides[(axis + turn) % 3]);
        Self {
            axis,
            first,
            along: [tap(along, 0), tap(0, 0), tap(0, along), tap(0, 2 * along)],
            across: [0, along].map(|end| across.map(|across| [tap(across, end), tap(0, end + across)])),
        }
    }

    /// The samples at both ends of four edges, and the gradients there, by central differences.
    #[inline(always)]
    fn read(&self, indices: [usize; LANES]) -> ([f32x4; 2], [Vectors; 2]) {
        let read = |tap: &[S]| S::numbers(indices.map(|index| tap[index - self.first]));
        let along = self.along.map(read);
        let across = self.across.map(|end| end.map(|[low, high]| read(high) - read(low)));
        let gradient = |end: usize| {
            let mut gradient = [f32x4::ZERO; 3];
            gradient[self.axis] = along[end + 2] - along[end];
            gradient[(self.axis + 1) % 3] = across[end][0];
            gradient[(self.axis + 2) % 3] = across[end][1];
            gradient
        };
        ([along[1], along[2]], [gradient(0), gradient(1)])
    }
}

/// The gradients at both ends of edges that may lie in the grid's border.
#[cold]
fn border_gradients<S: Density>(grid: &DenseGrid<S>, points: &[Point; LANES], axis: usize) -> [Vectors; 2] {
    [0, 1].map(|end| {
        let gradients = points.map(|point| {
            let mut point = unpack(point);
            point[axis] += end;
            border_gradient(grid, point)
        });
        std::array::from_fn(|axis| f32x4::new(gradients.map(|gradient| gradient[axis])))
    })
}

/// The gradient at a sample. Where a neighbour is missing, the difference to the other one counts twice.
#[inline]
fn border_gradient<S: Density>(grid: &DenseGrid<S>, point: [usize; 3]) -> [f32; 3] {
    let (samples, strides, size) = (grid.samples(), grid.strides(), grid.size());
    let index = point[0] + point[1] * strides[1] + point[2] * strides[2];
    std::array::from_fn(|axis| {
        let has_low = usize::from(point[axis] > 0);
        let has_high = usize::from(point[axis] + 1 < size[axis]);
        let low = samples[index - strides[axis] * has_low].number();
        let high = samples[index + strides[axis] * has_high].number();
        (high - low) * (3 - has_low - has_high) as f32
    })
}

/// Where the surface crosses edges, 0 to 1; in the middle where numbers fail.
#[inline(always)]
fn crossing([start, end]: [f32x4; 2]) -> f32x4 {
    let crossing = start / (start - end);
    // NaN alone is not equal to itself.
    crossing.simd_eq(crossing).bitselect(crossing, f32x4::HALF)
}

/// Scaled to length 1. Where numbers fail, it points up.
#[inline(always)]
fn unit(vectors: Vectors) -> Vectors {
    let [x, y, z] = vectors;
    let squared = x * x + y * y + z * z;
    let scale = f32x4::ONE / squared.sqrt();
    let units = vectors.map(|component| component * scale);
    // Smaller squares have lost digits, and larger ones are infinite.
    let is_exact = squared.simd_ge(f32x4::splat(1e-30)) & squared.simd_le(f32x4::splat(f32::MAX));
    if is_exact.all() { units } else { careful_units(vectors, units, is_exact.to_bitmask()) }
}

/// Calculates again those `units` that are not exact.
#[cold]
fn careful_units(vectors: Vectors, units: Vectors, exact: u32) -> Vectors {
    let (vectors, mut units) = (vectors.map(f32x4::to_array), units.map(f32x4::to_array));
    for lane in (0..LANES).filter(|lane| exact >> lane & 1 == 0) {
        let vector = [0, 1, 2].map(|axis| f64::from(vectors[axis][lane]));
        let length = (vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]).sqrt();
        let unit =
            if length > 0.0 && length.is_finite() { vector.map(|v| v / length) } else { [0.0, 1.0, 0.0] };
        for (units, component) in units.iter_mut().zip(unit) {
            units[lane] = component as f32;
        }
    }
    units.map(f32x4::new)
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
