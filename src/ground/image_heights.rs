//! Ground from a grey image: scaled, and interpolated where samples lie several voxels apart.

use super::error::GroundError;
use super::extent::Extent;
use super::grey_image::{GreyImage, LinePosition};
use super::noise_heights::{NoiseHeights, check_voxels};
use super::sources::fill_row;
use super::world::Ground;

/// The maximum number of voxels from one sample of an image to the next.
pub const MAX_VOXELS_PER_SAMPLE: u32 = 64;

/// The scale of an image of heights. Its columns run along +x, its rows along +z; its first sample lies at column (0,
/// 0).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImageScale {
    /// Voxels from one sample to the next, along x and z: 1 to [`MAX_VOXELS_PER_SAMPLE`].
    ///
    /// At 1 heights are the samples, rounded to 1/256 voxel. At more they pass through the samples and between them
    /// follow Catmull-Rom splines, which have no creases.
    pub voxels_per_sample: u32,
    /// Height of grey 0 (black) in voxels; may lie above `high`.
    pub low: f64,
    /// Height of full grey (white) in voxels.
    pub high: f64,
    /// Small-scale noise for what the samples are too coarse to show.
    pub detail: Option<Detail>,
}

impl Default for ImageScale {
    /// A voxel for each sample and for each of 8 bits' grey levels: 0 to 255 voxels high.
    fn default() -> Self {
        Self { voxels_per_sample: 1, low: 0.0, high: 255.0, detail: None }
    }
}

/// Fractal noise on top of an image's heights.
///
/// It moves the samples too: noise that is pinned to zero wherever a sample lies would show their grid.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Detail {
    /// Greatest height above and below the middle, in voxels; may be negative.
    pub amplitude: f64,
    /// Size of the largest features in voxels: 1 to [`MAX_SCALE`](super::MAX_SCALE). About `voxels_per_sample` fits.
    pub scale: f64,
    /// Layers of ever smaller features: 1 to [`MAX_OCTAVES`](super::MAX_OCTAVES).
    pub octaves: u32,
    /// Another seed gives another pattern.
    pub seed: u32,
}

impl Default for Detail {
    /// Bumps of at most half a voxel, 16 voxels apart.
    fn default() -> Self {
        Self { amplitude: 0.5, scale: 16.0, octaves: 3, seed: 0 }
    }
}

impl Detail {
    /// The noise in voxels over the column (x, z), from checked parameters.
    pub(super) fn noise(self) -> Result<DetailNoise, GroundError> {
        let Self { amplitude, scale, octaves, seed } = self;
        let noise =
            NoiseHeights { seed, octaves, scale, amplitude, ..NoiseHeights::default() }.generator()?;
        Ok(Box::new(move |x, z| amplitude * noise(x, z)))
    }
}

impl Ground {
    /// Ground from an image: `(samples - 1) * voxels_per_sample` cells along each side. Rows are made in parallel.
    ///
    /// # Errors
    /// - [`GroundError::ImageTooSmall`] for an image of less than 2 x 2 samples.
    /// - [`GroundError::Parameter`] for a parameter out of its range.
    /// - [`GroundError::Size`] if the world would be larger than [`Ground::MAX_SIZE`].
    /// - [`GroundError::Height`] where a spline or the detail leaves the lattice's limit.
    /// - [`GroundError::Memory`] if the machine has too little.
    pub fn from_image(image: &GreyImage, scale: &ImageScale) -> Result<Self, GroundError> {
        let detail = scale.check(image)?;
        let (width, height, step) = (image.width(), image.height(), scale.voxels_per_sample);
        let extent = Extent::new((width - 1) * step, (height - 1) * step)?;
        let heights = extent.fill_rows(|z, row| {
            let mut line = scale.line(image, [0, extent.width()], row.len());
            line.go_to(z);
            fill_row(z, row, |x| {
                let smooth = line.height(x);
                detail.as_ref().map_or(smooth, |detail| smooth + detail(x, z))
            })
        })?;
        Ok(Self::new(extent, heights))
    }
}

/// The noise of details in voxels over the column (x, z).
pub(super) type DetailNoise = Box<dyn Fn(i32, i32) -> f64 + Send + Sync>;

impl ImageScale {
    /// Checks the parameters, and that the image spans a cell; returns the noise of its details.
    pub(super) fn check(&self, image: &GreyImage) -> Result<Option<DetailNoise>, GroundError> {
        let &Self { voxels_per_sample, low, high, detail } = self;
        let (width, height) = (image.width(), image.height());
        if width < 2 || height < 2 {
            return Err(GroundError::ImageTooSmall { width, height });
        }
        if !(1..=MAX_VOXELS_PER_SAMPLE).contains(&voxels_per_sample) {
            let value = f64::from(voxels_per_sample);
            return Err(GroundError::Parameter {
                name: "voxels per sample".into(),
                value,
                allowed: "1 to 64",
            });
        }
        check_voxels("height of grey 0", low)?;
        check_voxels("height of full grey", high)?;
        detail.map(Detail::noise).transpose()
    }

    /// Height of a sample in voxels.
    pub(super) fn voxels(&self, grey: u16) -> f64 {
        self.low + (self.high - self.low) * f64::from(grey) / 65_535.0
    }

    /// Heights along lines of constant z, for this many columns between two ends along x, both in the image.
    pub(super) fn line<'a>(&'a self, image: &'a GreyImage, ends: [i32; 2], columns: usize) -> ImageLine<'a> {
        let [first, last] = ends.map(|x| LinePosition::new(x.unsigned_abs(), self.voxels_per_sample).sample);
        // The samples of all splines between the ends, those at the image's border included.
        let samples = first.saturating_sub(1).min(image.width() - 2)..(last + 3).min(image.width());
        // Worth it if the columns have at least a sample in four of their own.
        let is_dense = samples.len() <= 4 * columns;
        ImageLine {
            image,
            scale: self,
            across: LinePosition { sample: 0, fraction: 0.0 },
            first: samples.start,
            values: vec![0.0; if is_dense { samples.len() } else { 0 }],
        }
    }
}

/// Heights of an image along a line of constant z, not rounded.
pub(super) struct ImageLine<'a> {
    image: &'a GreyImage,
    scale: &'a ImageScale,
    across: LinePosition,
    /// The first sample along x of `values`.
    first: u32,
    /// Heights of the line at samples along x; none where they are computed when they are needed.
    values: Vec<f64>,
}

impl ImageLine<'_> {
    /// Goes to the line at z.
    pub(super) fn go_to(&mut self, z: i32) {
        self.across = LinePosition::new(z.unsigned_abs(), self.scale.voxels_per_sample);
        let mut values = std::mem::take(&mut self.values);
        (self.first..).zip(&mut values).for_each(|(x, value)| *value = self.at_sample(x));
        self.values = values;
    }

    /// The height over the column at x, in voxels.
    pub(super) fn height(&self, x: i32) -> f64 {
        let along = LinePosition::new(x.unsigned_abs(), self.scale.voxels_per_sample);
        along.interpolate(self.image.width(), |x| {
            let known = x.checked_sub(self.first).and_then(|at| self.values.get(at as usize));
            known.copied().unwrap_or_else(|| self.at_sample(x))
        })
    }

    fn at_sample(&self, x: u32) -> f64 {
        self.across.interpolate(self.image.height(), |z| self.scale.voxels(self.image.grey(x, z)))
    }
}

impl LinePosition {
    /// Value here of the Catmull-Rom spline through `count` samples, at least 2. At a sample exactly the sample.
    pub(super) fn interpolate(self, count: u32, value: impl Fn(u32) -> f64) -> f64 {
        let t = self.fraction;
        if t == 0.0 {
            return value(self.sample);
        }
        let here = i64::from(self.sample);
        let [p, q, r, s] = [here - 1, here, here + 1, here + 2].map(|at| extended(at, count, &value));
        let cubic = 3.0 * (q - r) + s - p;
        let square = 2.0 * p - 5.0 * q + 4.0 * r - s;
        q + 0.5 * t * (r - p + t * (square + t * cubic))
    }
}

/// The value of a sample, beyond either end on the straight line through the last two.
fn extended(at: i64, count: u32, value: impl Fn(u32) -> f64) -> f64 {
    let last = count - 1;
    match u32::try_from(at) {
        Ok(at) if at <= last => value(at),
        Ok(_) => value(last) + (at - i64::from(last)) as f64 * (value(last) - value(last - 1)),
        Err(_) => value(0) + at as f64 * (value(1) - value(0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{ImageLimits, MAX_OCTAVES, MAX_SCALE};
    use crate::lattice::{Column, ONE};
    use proptest::prelude::*;

    fn image(width: u32, height: u32) -> impl Strategy<Value = GreyImage> {
        prop::collection::vec(any::<u16>(), (width * height) as usize)
            .prop_map(move |samples| GreyImage::from_samples(width, height, samples).unwrap())
    }

    fn any_image() -> impl Strategy<Value = GreyImage> {
        (2..6_u32, 2..6_u32).prop_flat_map(|(width, height)| image(width, height))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn heights_pass_through_the_samples(
            image in any_image(), step in 1..=64_u32, low in -900.0..900.0, high in -900.0..900.0,
        ) {
            let scale = ImageScale { voxels_per_sample: step, low, high, detail: None };
            let ground = Ground::from_image(&image, &scale).unwrap();
            prop_assert_eq!(ground.width() as u32, (image.width() - 1) * step);
            prop_assert_eq!(ground.depth() as u32, (image.height() - 1) * step);
            for (x, z) in (0..image.height()).flat_map(|z| (0..image.width()).map(move |x| (x, z))) {
                let sample = f64::from(image.grey(x, z));
                let exact = ((low + (high - low) * sample / 65_535.0) * f64::from(ONE)).round() as i32;
                prop_assert_eq!(ground.height(Column::new((x * step) as i32, (z * step) as i32)), exact);
            }
        }

        /// At a sample the slopes on both sides agree. With samples within +-A the second derivative of each piece is
        /// at most 3 * 12 A (extended border included), so at e = 1/64 of a sample three heights in a row bend by no
        /// more than 36 A e^2 and small change. A crease, as of linear interpolation, bends by 4 A e, 7 times that.
        #[test]
        fn there_are_no_creases_at_the_samples(image in any_image()) {
            let scale = ImageScale { voxels_per_sample: 64, low: -16.0, high: 16.0, detail: None };
            let ground = Ground::from_image(&image, &scale).unwrap();
            let height = |x, z| ground.height(Column::new(x, z));
            let bend = |before: i32, here: i32, after: i32| (before - 2 * here + after).abs();
            for z in 0..=ground.depth() {
                for x in (64..ground.width()).step_by(64) {
                    prop_assert!(bend(height(x - 1, z), height(x, z), height(x + 1, z)) <= 80);
                }
            }
            for z in (64..ground.depth()).step_by(64) {
                for x in 0..=ground.width() {
                    prop_assert!(bend(height(x, z - 1), height(x, z), height(x, z + 1)) <= 80);
                }
            }
        }

        #[test]
        fn one_sided_slopes_agree_at_a_sample(values in prop::array::uniform5(-100.0..100.0)) {
            let at = |sample, fraction| LinePosition { sample, fraction }.interpolate(5, |i| values[i as usize]);
            let e = 1e-6;
            for sample in 1..4 {
                let before = (values[sample as usize] - at(sample - 1, 1.0 - e)) / e;
                let after = (at(sample, e) - values[sample as usize]) / e;
                prop_assert!((before - after).abs() < 0.01, "{before} and {after} at {sample}");
            }
        }

        #[test]
        fn planes_stay_planes_up_to_the_rim(a in -50..50_i32, b in -50..50_i32, step in 1..=64_u32) {
            let sample = |i: i32| (30_000 + a * (i % 5) + b * (i / 5)) as u16;
            let image = GreyImage::from_samples(5, 4, (0..20).map(sample).collect()).unwrap();
            let scale = ImageScale { voxels_per_sample: step, low: 0.0, high: 65_535.0 / 4.0, detail: None };
            let ground = Ground::from_image(&image, &scale).unwrap();
            for (x, z) in (0..=ground.depth()).flat_map(|z| (0..=ground.width()).map(move |x| (x, z))) {
                let exact = 30_000.0 + f64::from(a * x + b * z) / f64::from(step);
                prop_assert!((f64::from(ground.height(Column::new(x, z))) - 64.0 * exact).abs() < 0.51);
            }
        }

        /// With detail, about two in five are all in range where the step is small; without, three in four.
        #[test]
        fn any_scale_makes_ground_or_an_error(
            image in image(2, 3),
            step: u32,
            low in prop_oneof![3 => -900.0..900.0, 1 => any::<f64>()],
            high in prop_oneof![3 => -900.0..900.0, 1 => any::<f64>()],
            amplitude in prop_oneof![3 => -9.0..9.0, 1 => any::<f64>()],
            scale in prop_oneof![3 => 1.0..MAX_SCALE, 1 => any::<f64>()],
            octaves in prop_oneof![3 => 1..=MAX_OCTAVES, 1 => any::<u32>()],
            seed: u32,
        ) {
            let detail = Some(Detail { amplitude, scale, octaves, seed });
            for voxels_per_sample in [step, step % 65] {
                let _ = Ground::from_image(&image, &ImageScale { voxels_per_sample, low, high, detail });
                let _ = Ground::from_image(&image, &ImageScale { voxels_per_sample, low, high, detail: None });
            }
        }

        #[test]
        fn detail_keeps_to_its_amplitude(image in image(3, 3), amplitude in 0.0..4.0, seed: u32) {
            let plain = ImageScale { voxels_per_sample: 8, ..ImageScale::default() };
            let detail = Some(Detail { amplitude, seed, ..Detail::default() });
            let smooth = Ground::from_image(&image, &plain).unwrap();
            let rough = Ground::from_image(&image, &ImageScale { detail, ..plain }).unwrap();
            for (x, z) in (0..=16).flat_map(|z| (0..=16).map(move |x| (x, z))) {
                let change = rough.height(Column::new(x, z)) - smooth.height(Column::new(x, z));
                prop_assert!(f64::from(change).abs() <= amplitude * 256.0 + 1.0);
            }
        }
    }

    #[test]
    fn bad_input_is_refused_by_name() {
        let line = GreyImage::from_samples(9, 1, vec![0; 9]).unwrap();
        let refused = Ground::from_image(&line, &ImageScale::default());
        assert_eq!(refused, Err(GroundError::ImageTooSmall { width: 9, height: 1 }));

        let square = GreyImage::from_samples(2, 2, vec![0, 0, 65_535, 65_535]).unwrap();
        let good = ImageScale::default();
        let scaled = |scale| Ground::from_image(&square, &scale);
        for (bad, expected) in [
            (ImageScale { voxels_per_sample: 0, ..good }, "voxels per sample"),
            (ImageScale { voxels_per_sample: 65, ..good }, "voxels per sample"),
            (ImageScale { low: f64::NAN, ..good }, "height of grey 0"),
            (ImageScale { high: 32_769.0, ..good }, "height of full grey"),
            (ImageScale { detail: Some(Detail { scale: 0.0, ..Detail::default() }), ..good }, "noise scale"),
        ] {
            match scaled(bad) {
                Err(GroundError::Parameter { name, .. }) => assert_eq!(name, expected),
                other => panic!("{bad:?} gave {other:?}"),
            }
        }
        assert_eq!(scaled(good).map(|g| g.height_range()), Ok((0, 255 * 256)));
        let upside_down = ImageScale { low: 9.0, high: -9.0, ..good };
        assert_eq!(scaled(upside_down).map(|g| g.height(Column::new(0, 0))), Ok(9 * 256));

        let long = GreyImage::from_samples(16_385, 2, vec![0; 32_770]).unwrap();
        let too_long = Ground::from_image(&long, &ImageScale { voxels_per_sample: 2, ..good });
        assert_eq!(too_long, Err(GroundError::Size { width: 32_768, depth: 2 }));
    }

    #[test]
    fn the_jacksboro_fault_becomes_ground() {
        let file = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/assets/jacksboro_fault.png")).unwrap();
        let image = GreyImage::decode_png(&file, &ImageLimits::default()).unwrap();
        let scale =
            ImageScale { voxels_per_sample: 4, low: 23.6, high: 107.6, detail: Some(Detail::default()) };
        let ground = Ground::from_image(&image, &scale).unwrap();
        assert_eq!((ground.width(), ground.depth()), (402 * 4, 343 * 4));
        let (lowest, highest) = ground.height_range();
        assert!(lowest < 26 * ONE && highest > 105 * ONE, "{lowest} to {highest}");
        // If this fails, interpolation or detail changed, and with them every world made from an image.
        assert_eq!(ground.hash(), 0x6DF9_41CC_5D3D_1068);
    }
}
