//! Samples and the bricks that store them.

use glam::IVec3;

use crate::ground::MaterialId;
use crate::lattice::{BRICK, BrickPos};

/// Samples in a brick.
const LEN: usize = (BRICK * BRICK * BRICK) as usize;

/// The density stored at a lattice point: 1/256 voxel, negative is solid. A pristine sample is no number at all, it has
/// to be computed from the ground (rule 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample(i16);

impl Sample {
    /// Never edited.
    pub const PRISTINE: Self = Self(i16::MIN);

    /// An edited sample. Densities beyond +-127.996 voxels are stored as that: their sign is what counts there.
    pub fn edited(distance: i32) -> Self {
        Self(distance.clamp(-i32::from(i16::MAX), i32::from(i16::MAX)) as i16)
    }

    /// The stored density, `None` for a pristine sample.
    pub fn distance(self) -> Option<i32> {
        (self != Self::PRISTINE).then_some(i32::from(self.0))
    }
}

/// 8x8x8 samples with their materials.
#[derive(Clone, Debug)]
pub struct Brick {
    samples: [Sample; LEN],
    materials: [MaterialId; LEN],
}

impl Default for Brick {
    fn default() -> Self {
        Self { samples: [Sample::PRISTINE; LEN], materials: [MaterialId::GROUND; LEN] }
    }
}

impl Brick {
    /// Bytes that a brick takes.
    pub const BYTES: usize = size_of::<Self>();

    /// The sample at a lattice point that lies in this brick.
    pub fn sample(&self, point: IVec3) -> Sample {
        self.samples[BrickPos::index(point)]
    }

    /// The material at a lattice point that lies in this brick; [`MaterialId::GROUND`] where nobody changed it.
    pub fn material(&self, point: IVec3) -> MaterialId {
        self.materials[BrickPos::index(point)]
    }

    /// Stores an edited sample.
    pub(crate) fn set(&mut self, point: IVec3, sample: Sample, material: MaterialId) {
        let index = BrickPos::index(point);
        self.samples[index] = sample;
        self.materials[index] = material;
    }

    /// How many samples are edited.
    pub fn edited_count(&self) -> u32 {
        self.samples.iter().filter(|&&sample| sample != Sample::PRISTINE).count() as u32
    }

    /// Every edited sample of the brick at `pos`: point, density, material.
    pub fn edited_samples(&self, pos: BrickPos) -> impl Iterator<Item = (IVec3, i32, MaterialId)> {
        pos.samples()
            .points()
            .filter_map(|point| Some((point, self.sample(point).distance()?, self.material(point))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edited_sample_is_never_the_sentinel() {
        for distance in [i32::MIN, -32769, -32768, -32767, -1, 0, 1, 32767, 32768, i32::MAX] {
            let stored = Sample::edited(distance).distance().expect("edited samples are numbers");
            assert_eq!(stored.signum(), distance.signum());
            assert!(distance.abs_diff(0) > 32767 || stored == distance);
        }
    }

    #[test]
    fn bricks_know_what_was_edited() {
        let mut brick = Brick::default();
        let pos = BrickPos(IVec3::new(-1, 0, 2));
        let point = pos.origin() + IVec3::new(3, 5, 7);
        brick.set(point, Sample::edited(-7), MaterialId(4));
        assert_eq!(brick.edited_samples(pos).collect::<Vec<_>>(), [(point, -7, MaterialId(4))]);
        assert_eq!(brick.edited_count(), 1);
    }
}
