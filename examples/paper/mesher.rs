//! Meshes a whole dense field: positions, normals from the gradient, indices. A stand-in for the library's dense mesher.

use bevy_burrow::surface::cases;
use glam::{IVec3, Vec3};

/// The mesher with the buffers of its last mesh.
#[derive(Default)]
pub struct WholeMesher {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    indices: Vec<u32>,
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
        let field = Dense { samples, side: side as i32 };
        for layer in &mut self.layers {
            layer.resize(side * side, [0; 3]);
        }
        let last = field.side - 1;
        self.edges(field, 0);
        for z in 0..last {
            self.layers.swap(0, 1);
            // Layer 1 is that of z now, layer 0 that of z + 1.
            self.edges(field, z + 1);
            for y in 0..last {
                for x in 0..last {
                    self.cube(field, IVec3::new(x, y, z));
                }
            }
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

    fn edges(&mut self, field: Dense, z: i32) {
        for y in 0..field.side {
            for x in 0..field.side {
                let point = IVec3::new(x, y, z);
                let here = field.at(point);
                for axis in 0..3 {
                    let to = point + IVec3::AXES[axis];
                    if to[axis] == field.side || (here < 0) == (field.at(to) < 0) {
                        continue;
                    }
                    let share = f32::from(here) / (f32::from(here) - f32::from(field.at(to)));
                    let number = self.positions.len() as u32;
                    self.layers[0][(y * field.side + x) as usize][axis] = number;
                    self.positions.push(point.as_vec3() + IVec3::AXES[axis].as_vec3() * share);
                    let normal = field.gradient(point).lerp(field.gradient(to), share);
                    self.normals.push(normal.normalize_or(Vec3::Y));
                }
            }
        }
    }

    fn cube(&mut self, field: Dense, cube: IVec3) {
        let bit = |case, i| case | usize::from(field.at(cube + IVec3::from_array(cases::corner(i))) < 0) << i;
        let case = (0..8).fold(0, bit);
        if case == 0 || case == 255 {
            return;
        }
        for triangle in cases::table()[case].triangles() {
            self.indices.extend(triangle.map(|edge| {
                let (corner, axis) = cases::edge_corners(edge);
                let from = IVec3::from_array(cases::corner(corner));
                let at = cube + from;
                self.layers[1 - from.z as usize][(at.y * field.side + at.x) as usize][axis]
            }));
        }
    }
}

#[derive(Clone, Copy)]
struct Dense<'a> {
    samples: &'a [i16],
    side: i32,
}

impl Dense<'_> {
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
