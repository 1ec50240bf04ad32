//! Materials by rule: grass on the flat, snow on the heights.

use super::error::GroundError;
use super::material::{ColumnMaterial, MaterialId};

/// Lays an overlay over columns within ranges of height and slope, with soft edges.
///
/// A rule covers a column fully where height and slope lie within their ranges (ends included), not at all farther
/// outside than the fade, and in between by a straight line; height's and slope's parts are multiplied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialRule {
    /// The overlay of the rule; not [`MaterialId::GROUND`].
    pub overlay: MaterialId,
    /// Lowest and highest height in voxels; infinite ends are open.
    pub height: (f64, f64),
    /// Voxels of height over which the rule fades out beyond either end of `height`; 0 is a sharp edge.
    pub height_fade: f64,
    /// Least and greatest slope as rise over run: 0 is level, 1 is 45 degrees; infinite ends are open.
    pub slope: (f64, f64),
    /// Slope over which the rule fades out beyond either end of `slope`; 0 is a sharp edge.
    pub slope_fade: f64,
}

impl Default for MaterialRule {
    /// Material 0 everywhere.
    fn default() -> Self {
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        Self { overlay: MaterialId(0), height: all, height_fade: 0.0, slope: all, slope_fade: 0.0 }
    }
}

impl MaterialRule {
    /// Checks the rule at `index` of its list.
    pub(super) fn check(&self, index: usize) -> Result<(), GroundError> {
        let name = |parameter: &str| format!("{parameter} of material rule {index}");
        let check = |is_right: bool, parameter: &str, value: f64, allowed: &'static str| {
            let wrong = || GroundError::Parameter { name: name(parameter).into(), value, allowed };
            is_right.then_some(()).ok_or_else(wrong)
        };
        self.overlay.check(name("the overlay"))?;
        for (parameter, (low, high)) in
            [("the range of heights", self.height), ("the range of slopes", self.slope)]
        {
            for value in [low, high] {
                check(!value.is_nan(), parameter, value, "numbers or infinite")?;
            }
            check(low <= high, parameter, low, "at most its upper end")?;
        }
        for (parameter, value) in
            [("the fade of heights", self.height_fade), ("the fade of slopes", self.slope_fade)]
        {
            check((0.0..f64::INFINITY).contains(&value), parameter, value, "finite and at least 0")?;
        }
        Ok(())
    }

    /// Share of a column that the rule covers, 0 to 1.
    fn cover(&self, height: f64, slope: f64) -> f64 {
        fade(height, self.height, self.height_fade) * fade(slope, self.slope, self.slope_fade)
    }
}

/// 1 within the range, 0 farther outside than `over`, a straight line between.
fn fade(value: f64, (low, high): (f64, f64), over: f64) -> f64 {
    let outside = (low - value).max(value - high);
    if outside <= 0.0 {
        1.0
    } else if outside < over {
        1.0 - outside / over
    } else {
        0.0
    }
}

/// The material of a column of this height (voxels) and slope (rise over run) under `rules`, the topmost first.
///
/// Like coats of paint: each rule covers its part of what the rules before it left bare. The column shows as much
/// overlay as is covered at all, and as overlay the rule with the largest part, of equal ones the first.
pub(super) fn apply(base: MaterialId, rules: &[MaterialRule], height: f64, slope: f64) -> ColumnMaterial {
    let (mut bare, mut largest, mut overlay) = (1.0, 0.0, base);
    for rule in rules {
        let part = bare * rule.cover(height, slope);
        bare -= part;
        if part > largest {
            (largest, overlay) = (part, rule.overlay);
        }
    }
    ColumnMaterial { base, overlay, blend: ((1.0 - bare) * 255.0).round() as u8 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROCK: MaterialId = MaterialId(1);
    const GRASS: MaterialId = MaterialId(2);
    const SNOW: MaterialId = MaterialId(3);

    /// Snow above 100 voxels, fading in from 90; grass where it is less steep than 0.5, fading out to 1.
    fn alps() -> [MaterialRule; 2] {
        let flat = (0.0, 0.5);
        [
            MaterialRule {
                overlay: SNOW,
                height: (100.0, f64::INFINITY),
                height_fade: 10.0,
                slope: flat,
                slope_fade: 0.5,
            },
            MaterialRule { overlay: GRASS, slope: flat, slope_fade: 0.5, ..MaterialRule::default() },
        ]
    }

    #[test]
    fn rules_cover_each_other_from_the_top() {
        for (height, slope, overlay, blend) in [
            (50.0, 0.0, GRASS, 255),
            (50.0, 0.75, GRASS, 128),
            (50.0, 1.0, ROCK, 0),
            (92.0, 0.0, GRASS, 255), // a fifth snow, the rest grass: no rock in between
            (98.0, 0.0, SNOW, 255),
            (200.0, 0.2, SNOW, 255),
            (200.0, 3.0, ROCK, 0),
        ] {
            let material = apply(ROCK, &alps(), height, slope);
            assert_eq!(material, ColumnMaterial { base: ROCK, overlay, blend }, "at {height}, {slope}");
        }
    }

    #[test]
    fn parameters_that_are_no_numbers_or_no_materials_are_refused() {
        let good = MaterialRule::default();
        let nan = f64::NAN;
        assert_eq!(good.check(0), Ok(()));
        for bad in [
            MaterialRule { height: (nan, 1.0), ..good },
            MaterialRule { height: (2.0, 1.0), ..good },
            MaterialRule { slope: (0.0, nan), ..good },
            MaterialRule { height_fade: -1.0, ..good },
            MaterialRule { slope_fade: nan, ..good },
            MaterialRule { slope_fade: f64::INFINITY, ..good },
            MaterialRule { overlay: MaterialId::GROUND, ..good },
        ] {
            let Err(GroundError::Parameter { name, .. }) = bad.check(4) else { panic!("{bad:?} is allowed") };
            assert!(name.ends_with(" of material rule 4"), "{name}");
        }
    }

    proptest! {
        #[test]
        fn the_overlay_fades_without_steps(height in -50.0..150.0, slope in 0.0..2.0) {
            let blend = |h, s| i32::from(apply(ROCK, &alps(), h, s).blend);
            prop_assert!((blend(height, slope) - blend(height + 0.01, slope + 0.001)).abs() <= 3);
        }
    }
}
