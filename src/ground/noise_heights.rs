//! Ground from fractal noise.

use noise::{Fbm, MultiFractal, NoiseFn, Perlin, RidgedMulti};

use super::error::GroundError;
use super::world::Ground;
use crate::lattice::LIMIT;

/// The maximum number of octaves of a noise; each is about half as large as the one before.
pub const MAX_OCTAVES: u32 = 16;

/// Largest size of a noise's features, in voxels; the smallest is 1.
pub const MAX_SCALE: f64 = 1_048_576.0;

/// The kind of landscape that the noise makes. Both use Perlin's gradient noise, which needs no function whose last
/// bits differ from machine to machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NoiseKind {
    /// Rolling hills: fractal Brownian motion.
    #[default]
    Fractal,
    /// Mountain ridges with wide valleys: ridged multifractal; a negative amplitude makes canyons of the ridges.
    Ridged,
}

/// Heights from noise: `base + amplitude * noise(x / scale, z / scale)`, the noise within -1 to 1.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseHeights {
    /// Another seed gives another world.
    pub seed: u32,
    /// The kind of landscape.
    pub kind: NoiseKind,
    /// Layers of ever smaller features: 1 to [`MAX_OCTAVES`].
    pub octaves: u32,
    /// Size of the largest features in voxels: 1 to [`MAX_SCALE`].
    pub scale: f64,
    /// Greatest height above and below `base`, in voxels; may be negative.
    pub amplitude: f64,
    /// Middle height in voxels.
    pub base: f64,
}

impl Default for NoiseHeights {
    /// Hills 256 voxels apart, at most 32 voxels high and low, around 0.
    fn default() -> Self {
        Self { seed: 0, kind: NoiseKind::Fractal, octaves: 6, scale: 256.0, amplitude: 32.0, base: 0.0 }
    }
}

impl Ground {
    /// Ground of `width` x `depth` cells from noise. Rows are evaluated in parallel.
    ///
    /// # Errors
    /// - [`GroundError::Size`] unless width and depth are 1 to [`Ground::MAX_SIZE`].
    /// - [`GroundError::Parameter`] for a parameter out of its range.
    /// - [`GroundError::Height`] if base and amplitude together leave the lattice's limit.
    /// - [`GroundError::Memory`] if the machine has too little.
    pub fn from_noise(width: u32, depth: u32, noise: &NoiseHeights) -> Result<Self, GroundError> {
        let &NoiseHeights { amplitude, base, .. } = noise;
        let noise = noise.generator()?;
        Self::from_fn(width, depth, |x, z| base + amplitude * noise(x, z))
    }

    /// Ground of `width` x `depth` cells from any function of the crate [`noise`](super::noise): the height in voxels
    /// over the column (x, z) is `noise.get([x, z])`, rounded to 1/256. Scale it with the crate's `ScalePoint` and
    /// `ScaleBias`. Rows are evaluated in parallel.
    ///
    /// The crate's gradient, value and cellular noise give the same bits on every machine. Functions that call sines
    /// or cosines, such as `RotatePoint`, may not.
    ///
    /// ```
    /// use bevy_burrow::ground::noise::{Billow, Perlin, ScaleBias, ScalePoint};
    /// use bevy_burrow::prelude::*;
    ///
    /// // Features 200 voxels wide, heights around 20 voxels.
    /// let dunes = ScalePoint::new(Billow::<Perlin>::new(7)).set_scale(1.0 / 200.0);
    /// let dunes = ScaleBias::new(dunes).set_scale(12.0).set_bias(20.0);
    /// let ground = Ground::from_noise_fn(256, 256, &dunes)?;
    /// # assert_ne!(ground.height_range().0, ground.height_range().1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Self::from_fn`].
    pub fn from_noise_fn(
        width: u32,
        depth: u32,
        noise: &(impl NoiseFn<f64, 2> + Sync),
    ) -> Result<Self, GroundError> {
        Self::from_fn(width, depth, |x, z| noise.get([x.into(), z.into()]))
    }
}

/// Noise within -1 to 1 over the column (x, z), from checked parameters.
pub(super) type ColumnNoise = Box<dyn Fn(i32, i32) -> f64 + Send + Sync>;

/// Where column (0, 0) lies in the noise. Perlin noise is 0 at its own origin in every octave and for every seed, so
/// all worlds would begin at the same height, and on a peak if they are ridged.
pub(super) const ORIGIN: [f64; 2] = [0.37, 0.71];

/// A sum of octaves of Perlin's gradient noise, of checked parameters.
pub(super) enum Octaves {
    Fractal(Fbm<Perlin>),
    /// Ridged noise, which starts at -1 but ends anywhere from 0.3 to 1.5, depending on the octaves: at the peak that
    /// every ridged noise has at its own origin, counted from -1.
    Ridged(RidgedMulti<Perlin>, f64),
}

impl Octaves {
    /// Checks all parameters and makes noise of them, within -1 to 1.
    pub(super) fn new(heights: &NoiseHeights) -> Result<Self, GroundError> {
        let &NoiseHeights { seed, kind, octaves, scale, amplitude, base } = heights;
        check_voxels("noise base", base)?;
        if !(1..=MAX_OCTAVES).contains(&octaves) {
            let value = f64::from(octaves);
            return Err(GroundError::Parameter { name: "noise octaves".into(), value, allowed: "1 to 16" });
        }
        // Also keeps coordinates small enough for the noise crate, which panics on infinite ones.
        if !(1.0..=MAX_SCALE).contains(&scale) {
            return Err(GroundError::Parameter {
                name: "noise scale".into(),
                value: scale,
                allowed: "1 to 1048576 voxels",
            });
        }
        check_voxels("noise amplitude", amplitude)?;
        // The crate would count seeds on from the first one, and panic after the largest where overflow is checked.
        let sources = seeds(seed, octaves).map(Perlin::new).collect();
        Ok(match kind {
            NoiseKind::Fractal => {
                Self::Fractal(Fbm::new(0).set_octaves(octaves as usize).set_sources(sources))
            }
            NoiseKind::Ridged => {
                let noise = RidgedMulti::new(0).set_octaves(octaves as usize).set_sources(sources);
                let peak = noise.get([0.0, 0.0]) + 1.0;
                Self::Ridged(noise, peak)
            }
        })
    }
}

/// The seed of each octave.
pub(super) fn seeds(seed: u32, octaves: u32) -> impl Iterator<Item = u32> {
    (0..octaves).map(move |octave| seed.wrapping_add(octave))
}

impl NoiseHeights {
    /// Checks the parameters; returns the noise within -1 to 1 over the column (x, z), not yet scaled to heights.
    pub(super) fn generator(&self) -> Result<ColumnNoise, GroundError> {
        let scale = self.scale;
        let point = move |x, z| [f64::from(x) / scale + ORIGIN[0], f64::from(z) / scale + ORIGIN[1]];
        Ok(match Octaves::new(self)? {
            Octaves::Fractal(noise) => Box::new(move |x, z| noise.get(point(x, z))),
            Octaves::Ridged(noise, peak) => {
                Box::new(move |x, z| (noise.get(point(x, z)) + 1.0) / peak * 2.0 - 1.0)
            }
        })
    }
}

/// Checks that a length in voxels is a number within the lattice's limit.
pub(super) fn check_voxels(name: &'static str, value: f64) -> Result<(), GroundError> {
    if value.abs() <= f64::from(LIMIT) {
        Ok(())
    } else {
        Err(GroundError::Parameter { name: name.into(), value, allowed: "-32768 to 32768 voxels" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const KINDS: [NoiseKind; 2] = [NoiseKind::Fractal, NoiseKind::Ridged];

    proptest! {
        /// About two in five are all in range.
        #[test]
        fn any_parameters_make_ground_or_an_error(
            seed: u32,
            ridged: bool,
            octaves in prop_oneof![3 => 1..=MAX_OCTAVES, 1 => any::<u32>()],
            scale in prop_oneof![3 => 1.0..MAX_SCALE, 1 => any::<f64>()],
            amplitude in prop_oneof![3 => -99.0..99.0, 1 => any::<f64>()],
            base in prop_oneof![3 => -99.0..99.0, 1 => any::<f64>()],
        ) {
            let kind = KINDS[usize::from(ridged)];
            match Ground::from_noise(3, 3, &NoiseHeights { seed, kind, octaves, scale, amplitude, base }) {
                Ok(ground) => {
                    let (low, high) = ground.height_range();
                    prop_assert!(low >= -LIMIT * 256 && high <= LIMIT * 256);
                    prop_assert!((1..=MAX_OCTAVES).contains(&octaves) && (1.0..=MAX_SCALE).contains(&scale));
                    prop_assert!(base.is_finite() && amplitude.is_finite());
                }
                Err(GroundError::Parameter { .. } | GroundError::Height { .. }) => {}
                Err(error) => prop_assert!(false, "{error}"),
            }
        }

        /// The noise of [`NoiseHeights`] is the crate's own, sampled at scaled points.
        #[test]
        fn any_noise_function_makes_ground(seed: u32, scale in 1.0..999.0, bias in -99.0..99.0) {
            let points = |x: f64, z: f64| [x * (1.0 / scale), z * (1.0 / scale)];
            let noise = noise::ScalePoint::new(Perlin::new(seed)).set_scale(1.0 / scale);
            let noise = noise::ScaleBias::new(noise).set_scale(20.0).set_bias(bias);
            let ground = Ground::from_noise_fn(9, 7, &noise).unwrap();
            let perlin = Perlin::new(seed);
            for (x, z) in [(0, 0), (9, 0), (0, 7), (5, 3)] {
                let height = perlin.get(points(x.into(), z.into())) * 20.0 + bias;
                let found = ground.height(crate::lattice::Column::new(x, z));
                prop_assert_eq!(found, (height * 256.0).round() as i32);
            }
        }

        #[test]
        fn heights_stay_within_the_amplitude(
            seed: u32, ridged: bool, octaves in 1..=16_u32, scale in 1.0..MAX_SCALE, amplitude in -99.0..99.0,
        ) {
            let kind = KINDS[usize::from(ridged)];
            let noise = NoiseHeights { seed, kind, octaves, scale, amplitude, base: 7.0 };
            let (low, high) = Ground::from_noise(40, 4, &noise).unwrap().height_range();
            let reach = (f64::abs(amplitude) * 256.0).ceil() as i32;
            prop_assert!(low >= 7 * 256 - reach && high <= 7 * 256 + reach);
        }
    }

    #[test]
    fn a_noise_function_without_a_height_is_refused() {
        let noise = noise::Constant::new(f64::NAN);
        assert!(matches!(Ground::from_noise_fn(2, 2, &noise), Err(GroundError::Height { x: 0, z: 0, .. })));
        assert!(matches!(
            Ground::from_noise_fn(0, 2, &noise::Constant::new(1.0)),
            Err(GroundError::Size { .. })
        ));
    }

    #[test]
    fn parameters_out_of_range_are_refused_by_name() {
        let good = NoiseHeights::default();
        for (bad, expected) in [
            (NoiseHeights { octaves: 0, ..good }, "noise octaves"),
            (NoiseHeights { octaves: 17, ..good }, "noise octaves"),
            (NoiseHeights { scale: 0.0, ..good }, "noise scale"),
            (NoiseHeights { scale: 1e-300, ..good }, "noise scale"),
            (NoiseHeights { scale: f64::NAN, ..good }, "noise scale"),
            (NoiseHeights { amplitude: f64::INFINITY, ..good }, "noise amplitude"),
            (NoiseHeights { base: f64::NAN, ..good }, "noise base"),
        ] {
            match Ground::from_noise(2, 2, &bad) {
                Err(GroundError::Parameter { name, .. }) => assert_eq!(name, expected),
                other => panic!("{bad:?} gave {other:?}"),
            }
        }
    }

    #[test]
    fn seeds_go_on_from_zero_after_the_largest() {
        let world = |seed| Ground::from_noise(32, 32, &NoiseHeights { seed, ..NoiseHeights::default() });
        assert!(world(u32::MAX).is_ok());
        assert_eq!(seeds(u32::MAX, 3).collect::<Vec<_>>(), [u32::MAX, 0, 1]);
    }

    #[test]
    fn the_widest_world_and_finest_noise_are_in_reach() {
        let finest = NoiseHeights { octaves: 16, scale: 1.0, ..NoiseHeights::default() };
        assert!(Ground::from_noise(16_384, 1, &finest).is_ok());
    }

    #[test]
    fn noise_is_the_same_on_every_machine() {
        // If this fails, the noise or its parameters changed, and with them every world made of noise.
        let hash = |kind| {
            Ground::from_noise(64, 48, &NoiseHeights { kind, seed: 7, ..NoiseHeights::default() })
                .unwrap()
                .hash()
        };
        assert_eq!(KINDS.map(hash), [0x2537_92FB_3794_2188, 0x6992_FA54_53D8_F4F1]);
    }

    #[test]
    fn seeds_make_different_worlds() {
        let world =
            |seed| Ground::from_noise(32, 32, &NoiseHeights { seed, ..NoiseHeights::default() }).unwrap();
        assert_ne!(world(1), world(2));
        assert_eq!(world(3), world(3));
    }
}
