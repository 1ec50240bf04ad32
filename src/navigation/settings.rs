//! The size of an agent and what it can climb.

use crate::lattice::ONE;

/// The size of an agent and what it can climb, in voxels.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "plugin", derive(bevy::prelude::Reflect))]
#[serde(default, deny_unknown_fields)]
pub struct WalkSettings {
    /// How far the agent keeps from walls, edges and steep ground; 0 to 16. It is kept in whole cells: an agent of up
    /// to 0.7 voxels needs three cells of width, of which it walks on the middle one.
    pub radius: f32,
    /// Free height that it needs; more than 0, at most 256.
    pub height: f32,
    /// The highest step that it climbs between two neighbouring columns, however steep; 0 to 64.
    pub step: f32,
    /// The steepest ground that it walks on, as rise per run: 1 is 45 degrees; 0 to 64.
    pub slope: f32,
    /// How far polygons may be above or below the ground; 1/64 to 64. Less makes more polygons.
    pub precision: f32,
    /// The highest ledge that it jumps down; 0 to 256. With 0 it jumps down none.
    pub jump_down: f32,
    /// The highest ledge that it climbs up, where it does not walk; 0 to 256. With 0 it climbs none.
    pub climb_up: f32,
    /// How far from the ledge it lands, or climbs up from, at most; 0 to 16. It is kept in whole cells, and the
    /// distance that the agent keeps from walls and edges is not counted.
    pub leap: f32,
}

impl Default for WalkSettings {
    fn default() -> Self {
        Self {
            radius: 0.5,
            height: 2.0,
            step: 0.5,
            slope: 1.0,
            precision: 0.5,
            jump_down: 0.0,
            climb_up: 0.0,
            leap: 1.0,
        }
    }
}

impl WalkSettings {
    /// These settings with all lengths multiplied by a factor: from metres to voxels.
    pub fn scaled(self, by: f32) -> Self {
        Self {
            radius: self.radius * by,
            height: self.height * by,
            step: self.step * by,
            precision: self.precision * by,
            jump_down: self.jump_down * by,
            climb_up: self.climb_up * by,
            leap: self.leap * by,
            ..self
        }
    }
}

/// Why settings are invalid.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WalkError {
    /// A number is out of its range, or not a number.
    #[error(
        "the {name} of an agent is {value} voxels, and must be from {least} to {most}: change the settings, or the size of voxels"
    )]
    OutOfRange {
        /// The field of [`WalkSettings`].
        name: &'static str,
        /// The value of the field.
        value: f32,
        /// The least value.
        least: f32,
        /// The greatest value.
        most: f32,
    },
}

/// Settings as integers, with the cells that an agent touches.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Walker {
    /// In 1/256 voxel, as are the other lengths.
    pub(super) height: i32,
    pub(super) step: i32,
    /// The greatest difference of height between linked floors.
    pub(super) climb: i32,
    /// The square of the steepest rise, in 1/256 voxel a voxel.
    pub(super) squared_slope: i64,
    pub(super) precision: i32,
    /// For each row of cells from 0 on along z: as many cells along x as must be passable to both sides.
    pub(super) reach: Vec<i32>,
    /// How it passes ledges, if it does.
    pub(super) ledges: Option<LedgeRules>,
}

impl Walker {
    /// Checks settings. Lengths are rounded to 1/256 voxel: radius and height up, steps and slopes down.
    ///
    /// # Errors
    /// When a setting is not a number, or out of its range.
    pub fn new(settings: &WalkSettings) -> Result<Self, WalkError> {
        let check = |name, value: f32, least: f32, most: f32| match value >= least && value <= most {
            true => Ok(value * ONE as f32),
            false => Err(WalkError::OutOfRange { name, value, least, most }),
        };
        let radius = check("radius", settings.radius, 0.0, 16.0)?.ceil() as i32;
        let height = check("height", settings.height, 1.0 / ONE as f32, 256.0)?.ceil() as i32;
        let step = check("step", settings.step, 0.0, 64.0)?.floor() as i32;
        let slope = check("slope", settings.slope, 0.0, 64.0)?.floor() as i32;
        let precision = check("precision", settings.precision, 1.0 / 64.0, 64.0)?.floor() as i32;
        let jump = check("jump_down", settings.jump_down, 0.0, 256.0)?.floor() as i32;
        let ledge = check("climb_up", settings.climb_up, 0.0, 256.0)?.floor() as i32;
        let leap = check("leap", settings.leap, 0.0, 16.0)?.floor() as i32;
        let (reach, climb) = (reach(radius), step.max(slope));
        let wide = reach[0].max(reach.len() as i32 - 1);
        let ledges = LedgeRules {
            jump,
            climb: ledge,
            // The cells of the ledge and of the wall, and those that it keeps from both.
            cells: leap / ONE + 2 * wide + 2,
            wide,
            step: climb,
            height,
        };
        Ok(Self {
            height,
            step,
            climb,
            squared_slope: i64::from(slope).pow(2),
            precision,
            reach,
            ledges: (jump.max(ledge) > 0).then_some(ledges),
        })
    }

    /// How far, in columns along x and z, the ground may lie that decides whether a cell is walkable, and where its
    /// links over ledges lead.
    pub fn reach(&self) -> i32 {
        self.reach.len() as i32 + self.ledges.map_or(0, |ledges| ledges.cells + ledges.wide + 1)
    }
}

/// How agents pass ledges. Lengths in 1/256 voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct LedgeRules {
    pub jump: i32,
    pub climb: i32,
    /// Cells from the upper one to the farthest landing.
    pub cells: i32,
    /// Cells to each side of the way, and around the landing, that the agent touches.
    pub wide: i32,
    /// Rises up to this are stepped over.
    pub step: i32,
    pub height: i32,
}

/// For each row of cells: as many cells to both sides as an agent of this radius touches.
fn reach(radius: i32) -> Vec<i32> {
    let squared = i64::from(radius).pow(2);
    let touches = |x: i32, z: i32| distance(x, z) < squared;
    let rows = (0..).take_while(|&z| z == 0 || touches(0, z));
    rows.map(|z| (0..).take_while(|&x| touches(x + 1, z)).count() as i32).collect()
}

/// The square of the distance, in 1/256 voxel, from a cell to what may be in the way in the cell `x` and `z` cells
/// further, if all nearer ones are passable: of a cell in the same row, all of it; of another one, the half at the
/// farther corner.
fn distance(x: i32, z: i32) -> i64 {
    let (least, most) = (i64::from(x.min(z)), i64::from(x.max(z)));
    let squared_one = i64::from(ONE).pow(2);
    match (least, most) {
        (_, 0) => 0,
        (0, _) => (most - 1).pow(2) * squared_one,
        // To the line between its nearer two corners, or to the nearest end of that line.
        _ if most - least <= 1 => (least + most - 1).pow(2) * squared_one / 2,
        _ => ((most - 1).pow(2) + least.pow(2)) * squared_one,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_agent_touches_the_cells_within_its_radius() {
        let reach = |radius: f32| reach((radius * 256.0) as i32);
        assert_eq!(reach(0.0), [0]);
        assert_eq!(reach(0.1), [1, 0]);
        assert_eq!(reach(0.7), [1, 0]);
        assert_eq!(reach(0.72), [1, 1]);
        assert_eq!(reach(1.0), [1, 1]);
        assert_eq!(reach(1.1), [2, 1, 0]);
        assert_eq!(reach(1.45), [2, 2, 1]);
        assert_eq!(reach(2.2), [3, 2, 2, 0]);
    }

    #[test]
    fn settings_out_of_range_are_refused_by_name() {
        let good = WalkSettings::default();
        assert!(Walker::new(&good).is_ok());
        for (name, bad) in [
            ("radius", WalkSettings { radius: -0.1, ..good }),
            ("radius", WalkSettings { radius: f32::INFINITY, ..good }),
            ("height", WalkSettings { height: 0.0, ..good }),
            ("height", WalkSettings { height: f32::NAN, ..good }),
            ("step", WalkSettings { step: f32::NAN, ..good }),
            ("slope", WalkSettings { slope: 65.0, ..good }),
            ("precision", WalkSettings { precision: 0.0, ..good }),
            ("jump_down", WalkSettings { jump_down: -1.0, ..good }),
            ("climb_up", WalkSettings { climb_up: 257.0, ..good }),
            ("leap", WalkSettings { leap: f32::NAN, ..good }),
        ] {
            let error = Walker::new(&bad).expect_err(name);
            assert!(error.to_string().starts_with(&format!("the {name} of an agent is ")), "{error}");
        }
    }
}
