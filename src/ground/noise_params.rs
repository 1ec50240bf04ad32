//! The parameters of noise as plain numbers, from which rows and the GPU compute heights that are equal bit
//! by bit.

use bytemuck::{Pod, Zeroable};
use noise::permutationtable::{NoiseHasher, PermutationTable};
use noise::{Fbm, Perlin, RidgedMulti};

use super::error::GroundError;
use super::extent::Extent;
use super::noise_heights::{NoiseHeights, NoiseKind, ORIGIN, Octaves, seeds};
#[cfg(any(test, feature = "cuda"))]
use super::world::Ground;
#[cfg(any(test, feature = "cuda"))]
use crate::lattice::{LIMIT, ONE};

/// [`NoiseHeights`] over a world, checked, and all numbers derived from them.
pub(crate) struct NoiseParams {
    #[cfg_attr(not(any(test, feature = "cuda")), expect(dead_code))]
    extent: Extent,
    pub kind: NoiseKind,
    /// For each octave the permutation of 0 to 255 that its gradients are drawn from.
    pub tables: Vec<[u8; 256]>,
    pub numbers: NoiseFactors,
}

/// At the column (x, z) the first octave is looked up at `(x, z) / scale + origin`, times `frequency`; each further one
/// `lacunarity` times as far out. `kernels/heights.cuh` and the crate `noise` define how their sum is used.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct NoiseFactors {
    pub scale: f64,
    pub origin: [f64; 2],
    pub frequency: f64,
    pub lacunarity: f64,
    /// Amplitude of an octave relative to the previous one.
    pub persistence: f64,
    /// Factor from a ridged octave to the weight of the next one; 0 if not ridged.
    pub weighting: f64,
    /// Factor of the sum.
    pub factor: f64,
    /// Range of ridged noise, counted from -1; 1 if not ridged.
    pub peak: f64,
    pub amplitude: f64,
    pub base: f64,
}

impl NoiseHeights {
    /// The numbers for a world of `width` x `depth` cells.
    ///
    /// # Errors
    /// Those of [`Ground::from_noise`](super::Ground::from_noise) that show before any height is computed.
    pub(crate) fn params(&self, width: u32, depth: u32) -> Result<NoiseParams, GroundError> {
        let &Self { seed, kind, octaves, scale, amplitude, base } = self;
        let noise = Octaves::new(self)?;
        let extent = Extent::new(width, depth)?;
        let tables = seeds(seed, octaves).map(table).collect();
        let common = |frequency, lacunarity, persistence| NoiseFactors {
            scale,
            origin: ORIGIN,
            frequency,
            lacunarity,
            persistence,
            weighting: 0.0,
            factor: 1.0,
            peak: 1.0,
            amplitude,
            base,
        };
        let numbers = match &noise {
            Octaves::Fractal(noise) => NoiseFactors {
                factor: fractal_factor(noise),
                ..common(noise.frequency, noise.lacunarity, noise.persistence)
            },
            Octaves::Ridged(noise, peak) => NoiseFactors {
                // A power of two: multiplying gives the bits of dividing.
                weighting: 1.0 / noise.attenuation,
                factor: ridged_factor(noise),
                peak: *peak,
                ..common(noise.frequency, noise.lacunarity, noise.persistence)
            },
        };
        Ok(NoiseParams { extent, kind, tables, numbers })
    }
}

#[cfg(all(test, feature = "cuda"))]
impl NoiseHeights {
    /// The CPU's noise over columns, before it becomes heights.
    pub(crate) fn by_column(&self) -> impl Fn(i32, i32) -> f64 {
        self.generator().expect("parameters in range")
    }
}

#[cfg(any(test, feature = "cuda"))]
impl NoiseParams {
    /// Number of columns in a row.
    #[cfg(feature = "cuda")]
    pub fn row_len(&self) -> usize {
        self.extent.row_len()
    }

    /// Columns of the world.
    pub fn columns(&self) -> usize {
        self.extent.columns()
    }

    /// The ground of these heights in 1/256 voxel, one for each column; `None` where there are more or fewer, or one is
    /// beyond the lattice's limit.
    pub fn ground(&self, heights: Vec<i32>) -> Option<Ground> {
        if heights.len() != self.columns() {
            return None;
        }
        let ground = Ground::new(self.extent, heights);
        let (low, high) = ground.height_range();
        (low >= -LIMIT * ONE && high <= LIMIT * ONE).then_some(ground)
    }
}

/// The permutation table of a seed. The crate reads `values[values[a] ^ b]` for (a, b), and `values[a]` for a alone.
fn table(seed: u32) -> [u8; 256] {
    let permutation = PermutationTable::new(seed);
    std::array::from_fn(|at| permutation.hash(&[at as isize]) as u8)
}

/// The crate's factor for the sum of octaves, which is private there: one by the sum of their strengths.
fn fractal_factor(noise: &Fbm<Perlin>) -> f64 {
    let strengths = (1..=noise.octaves).map(|octave| noise.persistence.powi(octave as i32));
    1.0 / strengths.fold(0.0, |sum, strength| sum + strength)
}

/// The factor for ridges: 2 divided by the sum of the weighted octaves if every octave is 1. The crate counts
/// one octave too many, and its first one last.
fn ridged_factor(noise: &RidgedMulti<Perlin>) -> f64 {
    let (mut strength, mut last, mut sum) = (1.0, 1.0, 0.0);
    for octave in 1..=noise.octaves {
        strength *= noise.persistence;
        last = (last / noise.attenuation.powi(octave as i32)).clamp(0.0, 1.0) * strength;
        sum += last;
    }
    2.0 / (1.0 + sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{MAX_OCTAVES, MAX_SIZE};
    use noise::{MultiFractal, NoiseFn};

    fn params(kind: NoiseKind, octaves: u32) -> NoiseParams {
        NoiseHeights { kind, octaves, ..NoiseHeights::default() }.params(3, 2).unwrap()
    }

    #[test]
    fn factors_are_those_of_the_crate() {
        /// Octaves of fixed values: one for the first, one for the others.
        #[derive(Default)]
        struct Fixed(f64);
        impl noise::Seedable for Fixed {
            fn set_seed(self, _: u32) -> Self {
                self
            }
            fn seed(&self) -> u32 {
                0
            }
        }
        impl NoiseFn<f64, 2> for Fixed {
            fn get(&self, _: [f64; 2]) -> f64 {
                self.0
            }
        }
        for octaves in 1..=MAX_OCTAVES {
            let fixed = |first, other| {
                (0..octaves).map(|octave| Fixed(if octave == 0 { first } else { other })).collect()
            };
            // 2 at half the strength, and nothing more.
            let noise = Fbm::<Fixed>::new(0).set_octaves(octaves as usize).set_sources(fixed(2.0, 0.0));
            assert_eq!(
                params(NoiseKind::Fractal, octaves).numbers.factor,
                noise.get([0.0; 2]),
                "{octaves} octaves"
            );
            // A ridge where the first octave is 0, none where another is 1. The last bit is safe from the 1 that comes
            // off.
            let noise =
                RidgedMulti::<Fixed>::new(0).set_octaves(octaves as usize).set_sources(fixed(0.0, 1.0));
            let factor = params(NoiseKind::Ridged, octaves).numbers.factor;
            assert_eq!(factor - 1.0, noise.get([0.0; 2]), "{octaves} octaves");
            assert!((1.0..2.0).contains(&factor));
        }
    }

    #[test]
    fn tables_are_permutations_and_go_on_after_the_largest_seed() {
        let tables = |seed, octaves| {
            NoiseHeights { seed, octaves, ..NoiseHeights::default() }.params(1, 1).unwrap().tables
        };
        let mut sorted = tables(7, 1)[0];
        sorted.sort_unstable();
        assert!((0..=255).eq(sorted));
        assert_eq!(tables(u32::MAX, 3)[1..], tables(0, 2));
    }

    #[test]
    fn the_farthest_point_of_an_octave_has_a_whole_part_of_31_bits() {
        let params = params(NoiseKind::Fractal, MAX_OCTAVES);
        let farthest = (f64::from(MAX_SIZE) + 1.0) * params.numbers.lacunarity.powi(MAX_OCTAVES as i32 - 1);
        assert!(farthest * params.numbers.frequency < f64::from(1 << 30) * 1.9);
    }

    #[test]
    fn an_octave_weighs_half_of_the_one_before_which_is_exact() {
        assert_eq!(params(NoiseKind::Ridged, 2).numbers.weighting, 0.5);
    }

    #[test]
    fn heights_that_do_not_fit_are_no_ground() {
        let params = params(NoiseKind::Fractal, 1);
        let ground = |last| params.ground([vec![0; 11], vec![last]].concat());
        assert_eq!(ground(5), Ground::from_heights(3, 2, [vec![0; 11], vec![5]].concat()).ok());
        assert!(ground(1 << 23).is_some() && ground((1 << 23) + 1).is_none() && ground(i32::MIN).is_none());
        assert!(params.ground(vec![0; 11]).is_none());
    }

    #[test]
    fn errors_are_those_of_the_ground() {
        let good = NoiseHeights::default();
        for (width, noise) in [
            (0, good),
            (MAX_SIZE + 1, good),
            (u32::MAX, good),
            (2, NoiseHeights { octaves: 0, ..good }),
            (2, NoiseHeights { scale: 0.5, ..good }),
            (2, NoiseHeights { amplitude: 1e9, ..good }),
            (0, NoiseHeights { base: 1e9, ..good }),
        ] {
            let error = Ground::from_noise(width, 2, &noise).unwrap_err();
            assert_eq!(noise.params(width, 2).err(), Some(error));
        }
    }
}
