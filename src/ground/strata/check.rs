//! Limits and checks of strata.

use std::borrow::Cow;

use super::{Interval, MAX_COLUMN_CONDITIONS, MAX_STRATA, Strata, Stratum, StratumBody, StratumBounds};
use crate::ground::GroundError;

/// The maximum number of voxels by which noise or folds move anything.
const MAX_ROUGH: f32 = 127.0;
/// The maximum of any other length, in voxels.
const MAX_VOXELS: f32 = 32_768.0;
/// The maximum number of voxels by which beds sink for each voxel along an axis.
const MAX_DIP: f32 = 4.0;
/// The maximum rise over run in a condition.
const MAX_SLOPE: f32 = 65_536.0;

fn check(
    is_right: bool,
    name: impl Into<Cow<'static, str>>,
    value: f32,
    allowed: &'static str,
) -> Result<(), GroundError> {
    if is_right {
        Ok(())
    } else {
        Err(GroundError::Parameter { name: name.into(), value: value.into(), allowed })
    }
}

fn check_scale(name: impl Into<Cow<'static, str>>, scale: u32) -> Result<(), GroundError> {
    let is_right = scale.is_power_of_two() && (8..=1024).contains(&scale);
    check(is_right, name, scale as f32, "a power of two from 8 to 1024")
}

impl Strata {
    /// Checks everything that [`Ground::with_strata`](crate::ground::Ground::with_strata) does.
    ///
    /// # Errors
    /// [`GroundError::Parameter`] names the stratum by its number, and the value.
    pub fn check(&self) -> Result<(), GroundError> {
        let count = self.strata.len();
        check(count <= MAX_STRATA, "the number of strata", count as f32, "at most 32")?;
        let conditions = self.strata.iter().filter(|stratum| stratum.has_column_condition()).count();
        let is_right = conditions <= MAX_COLUMN_CONDITIONS;
        check(is_right, "the number of strata with a slope or bounds", conditions as f32, "at most 16")?;
        for dip in self.bedding.dip.to_array() {
            check(dip.abs() <= MAX_DIP, "the dip of the bedding", dip, "-4 to 4")?;
        }
        let fold = self.bedding.fold;
        check((0.0..=MAX_ROUGH).contains(&fold), "the fold of the bedding", fold, "0 to 127")?;
        check_scale("the scale of the bedding", self.bedding.scale)?;
        self.strata.iter().enumerate().try_for_each(|(index, stratum)| stratum.check(index))
    }
}

impl Stratum {
    /// Returns `true` if it has a condition on columns.
    pub(super) fn has_column_condition(&self) -> bool {
        self.slope != Interval::ALL || self.bounds != StratumBounds::World
    }

    fn check(&self, index: usize) -> Result<(), GroundError> {
        let name = |parameter: &str| format!("{parameter} of stratum {index}");
        self.material.check(name("the material"))?;
        let span = |parameter: &str, span: Interval, most: f32, allowed: &'static str| {
            for end in [span.from, span.to].into_iter().flatten() {
                check(end.abs() <= most, name(parameter), end, allowed)?;
            }
            let is_ordered = span.from.zip(span.to).is_none_or(|(from, to)| from <= to);
            check(is_ordered, name(parameter), span.from.unwrap_or_default(), "at most where it ends")
        };
        span("the depth", self.depth, MAX_VOXELS, "-32768 to 32768")?;
        span("the height", self.height, MAX_VOXELS, "-32768 to 32768")?;
        span("the slope", self.slope, MAX_SLOPE, "-65536 to 65536")?;
        check((0.0..=MAX_ROUGH).contains(&self.rough), name("the roughness"), self.rough, "0 to 127")?;
        check_scale(name("the scale of the roughness"), self.rough_scale)?;
        match self.body {
            StratumBody::Fill => Ok(()),
            StratumBody::Bed { from, thickness, every } => {
                check(from.abs() <= MAX_VOXELS, name("the lower face"), from, "-32768 to 32768")?;
                let is_right = (1.0 / 256.0..=MAX_VOXELS).contains(&thickness);
                check(is_right, name("the thickness"), thickness, "1/256 to 32768")?;
                let every = every.unwrap_or(MAX_VOXELS);
                let is_right = every >= thickness && every <= MAX_VOXELS;
                check(is_right, name("the distance of beds"), every, "from their thickness to 32768")
            }
            StratumBody::Vein { scale, share } | StratumBody::Pocket { scale, share } => {
                check_scale(name("the scale"), scale)?;
                check(share > 0.0 && share <= 1.0, name("the share"), share, "more than 0 and at most 1")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::super::Bedding;
    use super::*;
    use crate::ground::MaterialId;

    const ORE: MaterialId = MaterialId(3);

    fn error(strata: Strata) -> String {
        strata.check().unwrap_err().to_string()
    }

    fn of(stratum: Stratum) -> Strata {
        Strata { strata: vec![Stratum::fill(ORE), stratum], ..Strata::default() }
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        let fill = Stratum::fill(ORE);
        let bedding = |bedding| Strata { bedding, ..Strata::default() };
        let nan = f32::NAN;
        for (strata, message) in [
            (of(Stratum::fill(MaterialId::GROUND)), "the material of stratum 1 is 255: it must be 0 to 254"),
            (
                of(Stratum { depth: Interval::between(3.0, 2.0), ..fill.clone() }),
                "the depth of stratum 1 is 3",
            ),
            (of(Stratum { height: Interval::above(nan), ..fill.clone() }), "the height of stratum 1 is NaN"),
            (
                of(Stratum { slope: Interval::below(1e9), ..fill.clone() }),
                "the slope of stratum 1 is 1000000000",
            ),
            (of(Stratum { rough: -1.0, ..fill.clone() }), "the roughness of stratum 1 is -1"),
            (of(Stratum { rough_scale: 12, ..fill }), "the scale of the roughness of stratum 1 is 12"),
            (of(Stratum::bed(ORE, nan, 1.0)), "the lower face of stratum 1 is NaN"),
            (of(Stratum::bed(ORE, 0.0, 0.0)), "the thickness of stratum 1 is 0"),
            (of(Stratum::beds(ORE, 0.0, 5.0, 4.0)), "the distance of beds of stratum 1 is 4"),
            (of(Stratum::vein(ORE, 4, 0.1)), "the scale of stratum 1 is 4: it must be a power of two"),
            (of(Stratum::pocket(ORE, 8, 0.0)), "the share of stratum 1 is 0: it must be more than 0"),
            (
                bedding(Bedding { dip: Vec2::new(0.0, 5.0), ..Bedding::default() }),
                "the dip of the bedding is 5",
            ),
            (bedding(Bedding { fold: nan, ..Bedding::default() }), "the fold of the bedding is NaN"),
            (bedding(Bedding { scale: 0, ..Bedding::default() }), "the scale of the bedding is 0"),
            (
                Strata { strata: vec![Stratum::fill(ORE); 33], ..Strata::default() },
                "the number of strata is 33: it must be at most 32",
            ),
            (
                Strata {
                    strata: vec![Stratum { slope: Interval::below(1.0), ..Stratum::fill(ORE) }; 17],
                    ..Strata::default()
                },
                "the number of strata with a slope or bounds is 17: it must be at most 16",
            ),
        ] {
            let found = error(strata);
            assert!(found.starts_with(message), "{found}");
        }
    }
}
