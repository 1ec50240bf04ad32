//! Vertices from lists of edges, eight at a time.

use wide::f32x8;

use super::edges::{Corner, Edges};
use super::{DenseGrid, DenseMesh, Density, Normals};

/// Edges taken together.
const LANES: usize = 8;

/// Vertices in the making.
#[derive(Debug, Default)]
pub(super) struct Vertices {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl Vertices {
    pub fn begin(&mut self) {
        self.positions.clear();
        self.normals.clear();
    }

    pub fn len(&self) -> usize {
        self.positions.len()
    }

    pub fn hand_over(&self, out: &mut DenseMesh) {
        out.positions.clear();
        out.positions.extend_from_slice(&self.positions);
        out.normals.clear();
        out.normals.extend_from_slice(&self.normals);
    }

    /// Adds a vertex for each listed edge of slice `z`.
    pub fn make<S: Density>(&mut self, grid: &DenseGrid<S>, z: usize, edges: &Edges, normals: Normals) {
        self.along::<S, 0>(grid, z, &edges.lists[0], normals);
        self.along::<S, 1>(grid, z, &edges.lists[1], normals);
        self.along::<S, 2>(grid, z, &edges.lists[2], normals);
    }

    fn along<S: Density, const AXIS: usize>(
        &mut self,
        grid: &DenseGrid<S>,
        z: usize,
        list: &[Corner],
        normals: Normals,
    ) {
        if list.is_empty() {
            return;
        }
        let (first, slice) = (self.len(), Slice::<S>::new::<AXIS>(grid, z));
        let with_normals = normals == Normals::Gradient;
        for edges in list.chunks(LANES) {
            let batch = slice.batch::<AXIS>(edges);
            self.positions.extend_from_slice(&batch.positions::<AXIS>(&slice));
            if with_normals {
                self.normals.extend_from_slice(&slice.normals::<AXIS>(&batch));
            }
        }
        self.positions.truncate(first + list.len());
        if !with_normals {
            return;
        }
        self.normals.truncate(first + list.len());
        if grid.apron() == 0 {
            let normals = self.normals[first..].iter_mut();
            for (normal, &edge) in normals.zip(list).filter(|(_, edge)| slice.is_at_rim::<AXIS>(**edge)) {
                *normal = rim_normal::<S, AXIS>(grid, edge, z);
            }
        }
    }
}

/// The samples around one slice. Each list begins at the slice's first corner, moved as its name says. Where a move leaves
/// the grid, what the list tells is wrong; it is only asked for gradients then, and these are made again.
struct Slice<'a, S> {
    /// Both ends of edges.
    ends: [&'a [S]; 2],
    /// Before the lower end and after the upper one, along the edge.
    beyond: [&'a [S]; 2],
    /// Around the lower end and around the upper one, along the other two axes: before and after.
    around: [[[&'a [S]; 2]; 2]; 2],
    row: usize,
    corners: [usize; 3],
    z: usize,
    apron: f32,
}

/// Eight edges: where they begin, and how far along them the surface is.
struct Batch {
    /// Places in the lists of a slice.
    at: [usize; LANES],
    x: [f32; LANES],
    y: [f32; LANES],
    t: f32x8,
    /// Samples at both ends.
    ends: [f32x8; 2],
}

/// The other two axes of an axis.
const OTHERS: [[usize; 2]; 3] = [[1, 2], [0, 2], [0, 1]];

impl<'a, S: Density> Slice<'a, S> {
    fn new<const AXIS: usize>(grid: &DenseGrid<'a, S>, z: usize) -> Self {
        let (samples, strides) = (grid.samples(), grid.strides());
        let (first, corners) = (grid.index([0, 0, z]), grid.corners());
        let len = strides[1] * (corners[1] - 1) + corners[0];
        let moved = |by: isize| {
            let from = first.saturating_add_signed(by).min(samples.len());
            &samples[from..samples.len().min(from + len)]
        };
        let [along, b, c] = [AXIS, OTHERS[AXIS][0], OTHERS[AXIS][1]].map(|axis| strides[axis] as isize);
        let around = |end: isize| [[moved(end - b), moved(end + b)], [moved(end - c), moved(end + c)]];
        Self {
            ends: [moved(0), moved(along)],
            beyond: [moved(-along), moved(2 * along)],
            around: [around(0), around(along)],
            row: strides[1],
            corners,
            z,
            apron: grid.apron() as f32,
        }
    }

    /// One sample of each of eight places.
    #[inline(always)]
    fn gather(samples: &[S], at: &[usize; LANES]) -> f32x8 {
        f32x8::new(at.map(|at| samples.get(at).map_or(0.0, |sample| sample.value())))
    }

    #[inline(always)]
    fn batch<const AXIS: usize>(&self, edges: &[Corner]) -> Batch {
        let mut corners = [edges[0]; LANES];
        corners[..edges.len()].copy_from_slice(edges);
        let at = corners.map(|corner| (corner & 0xffff) as usize + (corner >> 16) as usize * self.row);
        let ends = self.ends.map(|samples| Self::gather(samples, &at));
        let t = ends[0] / (ends[0] - ends[1]);
        // Infinite and NaN ends; all others are of different signs.
        let is_inside = t.simd_ge(f32x8::ZERO) & t.simd_le(f32x8::ONE);
        let t = is_inside.select(t, f32x8::HALF);
        let [x, y] = [corners.map(|corner| corner & 0xffff), corners.map(|corner| corner >> 16)];
        Batch { at, x: x.map(|x| x as f32), y: y.map(|y| y as f32), t, ends }
    }

    #[inline(always)]
    fn normals<const AXIS: usize>(&self, batch: &Batch) -> [[f32; 3]; LANES] {
        let of = |samples: &[S]| Self::gather(samples, &batch.at);
        let [p, q] = batch.ends;
        let along = [q - of(self.beyond[0]), of(self.beyond[1]) - p];
        let across =
            |axis: usize| [0, 1].map(|end| of(self.around[end][axis][1]) - of(self.around[end][axis][0]));
        let blend = |[a, b]: [f32x8; 2]| a + (b - a) * batch.t;
        let (along, [b, c]) = (blend(along), [0, 1].map(|axis| blend(across(axis))));
        let [x, y, z] = match AXIS {
            0 => [along, b, c],
            1 => [b, along, c],
            _ => [b, c, along],
        };
        let squared = x * x + y * y + z * z;
        let length = squared.sqrt();
        let is_sound = squared.simd_gt(f32x8::splat(LEAST)) & squared.simd_lt(f32x8::splat(MOST));
        let [nx, ny, nz] = [x / length, y / length, z / length].map(|v| v.to_array());
        let mut normals = std::array::from_fn(|lane| [nx[lane], ny[lane], nz[lane]]);
        let sound = is_sound.to_bitmask();
        if sound != 0xff {
            let [x, y, z] = [x, y, z].map(|v| v.to_array());
            for lane in (0..LANES).filter(|lane| sound >> lane & 1 == 0) {
                normals[lane] = unit([x[lane], y[lane], z[lane]]);
            }
        }
        normals
    }

    /// Do the gradients at an edge's ends look beyond the grid?
    fn is_at_rim<const AXIS: usize>(&self, edge: Corner) -> bool {
        let low = [(edge & 0xffff) as usize, (edge >> 16) as usize, self.z];
        (0..3).any(|axis| {
            let high = low[axis] + usize::from(axis == AXIS);
            low[axis] == 0 || high + 1 == self.corners[axis]
        })
    }
}

impl Batch {
    #[inline(always)]
    fn positions<const AXIS: usize>(&self, slice: &Slice<impl Density>) -> [[f32; 3]; LANES] {
        let t = self.t.to_array();
        let (apron, z) = (slice.apron, slice.z as f32);
        std::array::from_fn(|lane| {
            let mut position = [self.x[lane] + apron, self.y[lane] + apron, z + apron];
            position[AXIS] += t[lane];
            position
        })
    }
}

/// Squares of lengths between which vectors are divided as they are; others would lose digits, or are no numbers.
const LEAST: f32 = 1e-30;
/// See [`LEAST`].
const MOST: f32 = 1e30;

/// A vector of any length, made a unit one; upwards where it has no direction.
pub(super) fn unit(v: [f32; 3]) -> [f32; 3] {
    let largest = v.iter().fold(0.0f32, |largest, c| largest.max(c.abs()));
    let squared = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    if squared > LEAST && squared < MOST {
        let length = squared.sqrt();
        return v.map(|c| c / length);
    }
    let [x, y, z] = v.map(|c| c / largest);
    let length = (x * x + y * y + z * z).sqrt();
    let unit = [x / length, y / length, z / length];
    if unit.iter().all(|c| c.is_finite()) { unit } else { [0.0, 1.0, 0.0] }
}

/// A normal where a gradient looks beyond the grid: differences are one-sided there.
fn rim_normal<S: Density, const AXIS: usize>(grid: &DenseGrid<S>, edge: Corner, z: usize) -> [f32; 3] {
    let p = [(edge & 0xffff) as usize, (edge >> 16) as usize, z];
    let mut q = p;
    q[AXIS] += 1;
    let value = |corner: [usize; 3]| grid.samples()[grid.index(corner)].value();
    let (a, b) = (value(p), value(q));
    let t = Some(a / (a - b)).filter(|t| (0.0..=1.0).contains(t)).unwrap_or(0.5);
    let gradient = |corner: [usize; 3]| -> [f32; 3] {
        std::array::from_fn(|axis| {
            let (mut before, mut after) = (corner, corner);
            before[axis] = before[axis].saturating_sub(1);
            after[axis] = (after[axis] + 1).min(grid.corners()[axis] - 1);
            let rise = value(after) - value(before);
            // A one-sided difference is over half the way.
            if after[axis] - before[axis] == 1 { rise * 2.0 } else { rise }
        })
    };
    let (a, b) = (gradient(p), gradient(q));
    unit(std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t))
}
