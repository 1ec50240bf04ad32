//! The whole terrain as one dense field: a cube of samples, with positions and normals of its whole surface.

use bevy_burrow::brush::{BAND, Brush, DEPTH, Edit, Operation};
use bevy_burrow::dense::{DenseGrid, DenseGridError, DenseMesh, DenseMesher, Normals};
use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::LatticeBox;
use glam::IVec3;

use crate::error::PaperError;

/// A cube of samples and its mesh.
pub struct DenseField {
    /// Lattice points along each axis.
    side: usize,
    /// Densities in 1/256 voxel, negative is solid; x varies fastest, then y, then z.
    samples: Vec<i16>,
    mesher: DenseMesher,
    mesh: DenseMesh,
}

/// A density as stored in a sample, in the dense field and in bricks alike.
pub fn stored(distance: i32) -> i16 {
    distance.clamp(-i32::from(i16::MAX), i32::from(i16::MAX)) as i16
}

impl DenseField {
    /// The ground's lattice points from y = 0 to the height of the cube, meshed once, so that all buffers are
    /// allocated.
    pub fn new(ground: &Ground) -> Result<Self, PaperError> {
        let side = ground.width() as usize + 1;
        let samples = Cube(side as i32).lines().map(|point| stored(ground.distance(point))).collect();
        let mut field = Self { side, samples, mesher: DenseMesher::new(), mesh: DenseMesh::default() };
        field.remesh()?;
        Ok(field)
    }

    fn remesh(&mut self) -> Result<(), DenseGridError> {
        let grid = DenseGrid::new(&self.samples, [self.side; 3])?;
        self.mesher.mesh(grid, Normals::Gradient, &mut self.mesh);
        Ok(())
    }

    /// Edits only the samples within the edit's reach, then rebuilds the whole mesh. Returns the number of changed
    /// samples.
    pub fn edit(&mut self, brush: &Brush) -> Result<usize, PaperError> {
        let edit = Edit::quantize(brush)?;
        let changed = self.apply(&edit);
        self.remesh()?;
        Ok(changed)
    }

    /// Applies an edit by the same rule as a world does.
    fn apply(&mut self, edit: &Edit) -> usize {
        let Some(reach) = edit.reach().intersection(Cube(self.side as i32).points()) else { return 0 };
        let (evaluator, operation) = (edit.evaluator(), edit.operation());
        let mut row = vec![0; reach.size().x as usize];
        let mut changed = 0;
        for z in reach.min.z..=reach.max.z {
            for y in reach.min.y..=reach.max.y {
                let start = IVec3::new(reach.min.x, y, z);
                evaluator.row(start, &mut row);
                let at = self.index(start);
                for (sample, &outside) in self.samples[at..].iter_mut().zip(&row) {
                    if outside <= BAND {
                        let (before, outside) = (i32::from(*sample), outside.max(-DEPTH));
                        let after = stored(match operation {
                            Operation::Dig => before.max(-outside),
                            Operation::Add { .. } => before.min(outside),
                            _ => before,
                        });
                        changed += usize::from(after != *sample);
                        *sample = after;
                    }
                }
            }
        }
        changed
    }

    fn index(&self, point: IVec3) -> usize {
        let point = point.as_usizevec3();
        (point.z * self.side + point.y) * self.side + point.x
    }

    /// Every lattice point with its sample.
    pub fn points(&self) -> impl Iterator<Item = (IVec3, i16)> {
        Cube(self.side as i32).lines().zip(self.samples.iter().copied())
    }

    /// The current mesh.
    pub fn mesh(&self) -> &DenseMesh {
        &self.mesh
    }

    /// Bytes of the samples.
    pub fn sample_bytes(&self) -> usize {
        size_of_val(self.samples.as_slice())
    }

    /// Bytes of the vertex and index buffers.
    pub fn mesh_bytes(&self) -> usize {
        let DenseMesh { positions, normals, indices } = &self.mesh;
        size_of_val(positions.as_slice()) + size_of_val(normals.as_slice()) + size_of_val(indices.as_slice())
    }
}

/// The lattice points of a cube at the origin.
#[derive(Clone, Copy)]
struct Cube(i32);

impl Cube {
    fn points(self) -> LatticeBox {
        LatticeBox { min: IVec3::ZERO, max: IVec3::splat(self.0 - 1) }
    }

    /// The points in the order of samples: x fastest, then y, then z.
    fn lines(self) -> impl Iterator<Item = IVec3> {
        let side = 0..self.0;
        side.clone().flat_map(move |z| {
            let xs = side.clone();
            side.clone().flat_map(move |y| xs.clone().map(move |x| IVec3::new(x, y, z)))
        })
    }
}
