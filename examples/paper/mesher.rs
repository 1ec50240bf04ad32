//! Meshes a whole dense field: positions, normals from the gradient, indices. It stands in for the library's own dense
//! mesher; signs are looked at 64 at a time, so that empty space costs little.

use bevy_burrow::surface::cases;
use glam::{IVec3, Vec3};

/// What the page says about the mesher.
pub const DESCRIPTION: &str = "a plain mesher of this example (shared vertices, gradient normals, signs of 64 samples \
                               at a time), which stands in for the library's dense mesher";

/// The mesher with the buffers of its last mesh.
#[derive(Default)]
pub struct WholeMesher {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    indices: Vec<u32>,
    /// A bit for each sample, set where it is solid; rows of whole words.
    signs: Vec<u64>,
    /// Vertices on the edges that begin in a layer: three axes for each point, two layers.
    layers: [Vec<[u32; 3]>; 2],
}

impl WholeMesher {
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes the mesh of `side`^3 samples, x fastest, then y, then z.
    pub fn mesh(&mut self, samples: &[i16], side: usize) {
        self.positions.clear();
        self.normals.clear();
        self.indices.clear();
        self.signs.clear();
        self.signs.extend(samples.chunks_exact(side).flat_map(|row| row.chunks(64)).map(signs));
        for layer in &mut self.layers {
            layer.resize(side * side, [0; 3]);
        }
        let field = Dense { samples, side: side as i32, words: side.div_ceil(64) };
        self.vertices(field, 0);
        for z in 1..field.side {
            self.layers.swap(0, 1);
            self.vertices(field, z);
            self.cubes(field, z - 1);
        }
    }

    pub fn triangles(&self) -> usize {
        self.indices.len() / 3
    }

    pub fn bytes(&self) -> usize {
        size_of_val(self.positions.as_slice())
            + size_of_val(self.normals.as_slice())
            + size_of_val(self.indices.as_slice())
    }

    /// Positions, normals and indices.
    #[cfg(test)]
    pub fn buffers(&self) -> (&[Vec3], &[Vec3], &[u32]) {
        (&self.positions, &self.normals, &self.indices)
    }

    /// The signs of the row at (y, z); beyond the field, those of `other`, so that no edge crosses there.
    fn row(&self, field: Dense, y: i32, z: i32, word: usize, other: u64) -> u64 {
        if y == field.side || z == field.side {
            return other;
        }
        self.signs[(z * field.side + y) as usize * field.words + word]
    }

    /// The same one sample on along x; the last one of a row is followed by itself.
    fn next(&self, field: Dense, y: i32, z: i32, word: usize) -> u64 {
        let here = self.row(field, y, z, word, 0);
        let last = field.side as usize - 1;
        if word == last / 64 {
            let bit = 1 << (last % 64);
            return (here >> 1) & !bit | here & bit;
        }
        here >> 1 | self.row(field, y, z, word + 1, 0) << 63
    }

    /// Vertices on all edges that begin in the layer z, its numbers into the layer 0.
    fn vertices(&mut self, field: Dense, z: i32) {
        for (y, word) in field.words_of_layer(field.side) {
            let here = self.row(field, y, z, word, 0);
            let next = [
                self.next(field, y, z, word),
                self.row(field, y + 1, z, word, here),
                self.row(field, y, z + 1, word, here),
            ];
            for (axis, next) in next.into_iter().enumerate() {
                for x in bits(here ^ next, word) {
                    self.vertex(field, IVec3::new(x, y, z), axis);
                }
            }
        }
    }

    fn vertex(&mut self, field: Dense, from: IVec3, axis: usize) {
        let along = IVec3::AXES[axis];
        let to = from + along;
        let (here, there) = (f32::from(field.at(from)), f32::from(field.at(to)));
        let share = here / (here - there);
        self.layers[0][(from.y * field.side + from.x) as usize][axis] = self.positions.len() as u32;
        self.positions.push(from.as_vec3() + along.as_vec3() * share);
        let normal = field.gradient(from).lerp(field.gradient(to), share);
        self.normals.push(normal.normalize_or(Vec3::Y));
    }

    /// Triangles of all cubes between the layers z (numbers in layer 1) and z + 1 (layer 0).
    fn cubes(&mut self, field: Dense, z: i32) {
        for (y, word) in field.words_of_layer(field.side - 1) {
            // In the order of corners: x, then y, then z.
            let corners = [(y, z), (y + 1, z), (y, z + 1), (y + 1, z + 1)]
                .map(|(y, z)| [self.row(field, y, z, word, 0), self.next(field, y, z, word)]);
            let corners = corners.as_flattened();
            let any = corners.iter().fold(0, |any, signs| any | signs);
            let all = corners.iter().fold(u64::MAX, |all, signs| all & signs);
            for x in bits(any & !all, word).filter(|&x| x < field.side - 1) {
                let bit = |(i, signs): (usize, &u64)| ((signs >> (x % 64) & 1) as usize) << i;
                let case = corners.iter().enumerate().map(bit).sum::<usize>();
                for triangle in cases::table()[case].triangles() {
                    let number = |edge| {
                        let (corner, axis) = cases::edge_corners(edge);
                        let [dx, dy, dz] = cases::corner(corner);
                        self.layers[1 - dz as usize][((y + dy) * field.side + x + dx) as usize][axis]
                    };
                    self.indices.extend(triangle.map(number));
                }
            }
        }
    }
}

/// A bit for each of up to 64 samples, set where it is negative.
fn signs(samples: &[i16]) -> u64 {
    let first = samples[0];
    if samples.iter().fold(0, |differ, sample| differ | (sample ^ first)) >= 0 {
        return if first < 0 { u64::MAX } else { 0 };
    }
    samples.iter().rev().fold(0, |signs, &sample| signs << 1 | u64::from(sample < 0))
}

/// The places of a word's set bits along x.
fn bits(mut word: u64, number: usize) -> impl Iterator<Item = i32> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros())?;
        word &= word - 1;
        Some((number * 64) as i32 + bit as i32)
    })
}

#[derive(Clone, Copy)]
struct Dense<'a> {
    samples: &'a [i16],
    side: i32,
    /// Words of signs in a row.
    words: usize,
}

impl Dense<'_> {
    /// The words of the first `rows` rows of a layer.
    fn words_of_layer(self, rows: i32) -> impl Iterator<Item = (i32, usize)> {
        (0..rows).flat_map(move |y| (0..self.words).map(move |word| (y, word)))
    }

    fn at(self, p: IVec3) -> i16 {
        self.samples[((p.z * self.side + p.y) * self.side + p.x) as usize]
    }

    fn gradient(self, p: IVec3) -> Vec3 {
        let (low, high) = (IVec3::ZERO, IVec3::splat(self.side - 1));
        let slope = |axis: IVec3| {
            let (from, to) = ((p - axis).max(low), (p + axis).min(high));
            (f32::from(self.at(to)) - f32::from(self.at(from))) / (to - from).dot(axis) as f32
        };
        Vec3::new(slope(IVec3::X), slope(IVec3::Y), slope(IVec3::Z))
    }
}
