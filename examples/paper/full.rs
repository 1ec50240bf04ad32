//! The whole terrain as one field of marching cubes, as in the paper's Table 5: all of its mesh is made again at each
//! edit.

use bevy_burrow::brush::{BAND, Brush, BrushError, Edit};
use bevy_burrow::ground::Ground;
use bevy_burrow::lattice::LatticeBox;
use bevy_burrow::terrain::World;
use glam::IVec3;

use crate::mesher::WholeMesher;

/// A cube of samples and the one mesh over it.
pub struct FullField {
    /// Lattice points along each axis.
    side: usize,
    /// Densities in 1/256 voxel, negative is solid; x fastest, then y, then z.
    samples: Vec<i16>,
    mesher: WholeMesher,
}

/// A density as a sample holds it, in the dense field as in the bricks of a world.
fn stored(distance: i32) -> i16 {
    distance.clamp(-i32::from(i16::MAX), i32::from(i16::MAX)) as i16
}

impl FullField {
    /// The ground's lattice points from y = 0 to the height of the cube, meshed once: all is allocated from the start.
    pub fn new(ground: &Ground) -> Self {
        let side = ground.width() as usize + 1;
        let mut field = Self { side, samples: Vec::with_capacity(side.pow(3)), mesher: WholeMesher::new() };
        field.samples.extend(field.bounds().lines().map(|point| stored(ground.distance(point))));
        field.mesher.mesh(&field.samples, side);
        field
    }

    fn bounds(&self) -> Cube {
        Cube(self.side as i32)
    }

    /// Edits the samples in the edit's reach and nothing else, then makes the whole mesh again. Says how many samples
    /// changed.
    pub fn edit(&mut self, brush: &Brush) -> Result<usize, BrushError> {
        let edit = Edit::quantize(brush)?;
        let changed = self.apply(&edit);
        self.mesher.mesh(&self.samples, self.side);
        Ok(changed)
    }

    /// The rule by which a world's samples change as well.
    fn apply(&mut self, edit: &Edit) -> usize {
        let Some(reach) = edit.reach().intersection(self.bounds().points()) else { return 0 };
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
                        let after = stored(operation.apply(i32::from(*sample), outside));
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

    /// Triangles of the mesh as it is now.
    pub fn triangles(&self) -> usize {
        self.mesher.triangles()
    }

    /// Bytes of the samples.
    pub fn sample_bytes(&self) -> usize {
        size_of_val(self.samples.as_slice())
    }

    /// Bytes of the vertex and index buffers.
    pub fn mesh_bytes(&self) -> usize {
        self.mesher.bytes()
    }

    /// Compares each lattice point of the cube with a world's.
    pub fn compare(&self, world: &World) -> Agreement {
        let view = world.samples();
        let mut agreement = Agreement::default();
        for (point, &here) in self.bounds().lines().zip(&self.samples) {
            let there = stored(view.distance(point));
            agreement.points += 1;
            agreement.otherwise_solid += usize::from((here < 0) != (there < 0));
            agreement.otherwise_dense += usize::from(here != there);
        }
        agreement
    }
}

/// How far the full field and a world agree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Agreement {
    /// Lattice points that were compared.
    pub points: usize,
    /// Points that are solid in one and air in the other.
    pub otherwise_solid: usize,
    /// Points of another density.
    pub otherwise_dense: usize,
}

impl Agreement {
    pub fn is_complete(self) -> bool {
        self.otherwise_solid + self.otherwise_dense == 0
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
